"""The light field of an underwater lamp: rendered, modelled, measured, explained."""

__version__ = "0.1.0"
