"""Phase functions, and what a scene file may say about them."""
