"""Does the diagnosis find the right effect? Rendered measurements with a known secret, and scores."""
