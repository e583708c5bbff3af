"""Questions asked of a scene or of readings."""
