"""Does the diagnosis find the right effect? Hundreds of rendered measurements with a known secret, and the scores."""
