"""A verdict in words: made last, and from its data alone."""
