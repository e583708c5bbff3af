"""Constants of fast light, and stated errors over many seeds."""
