"""Scattered and reflected light at the places of a measurement, fast enough to fit with."""
