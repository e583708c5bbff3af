"""Effects of the user's own: what a scene says of one, and the formulas that it may hold."""
