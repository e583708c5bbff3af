"""Readings as a real campaign gives them: many effects at once, lamps that are no Gaussian."""
