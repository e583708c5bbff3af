"""Which version this is: what is written says so."""

__version__ = "0.1.0"
