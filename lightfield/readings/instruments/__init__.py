"""Readers of instrument files, one module per format."""
