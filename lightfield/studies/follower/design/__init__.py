"""Arrays compared and designed: where to put elements, and where to let them face."""
