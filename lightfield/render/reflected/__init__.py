"""Light that walls and surface reflect, without Monte Carlo noise."""
