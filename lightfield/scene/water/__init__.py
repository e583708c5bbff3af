"""Inherent optical properties of water: data tables, constituents, coefficients."""
