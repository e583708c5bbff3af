"""Lamps: angular profile and spectrum."""
