"""A diagnosis set up: readings, layout, noise, candidates."""
