"""The lamp: angular profile, luminaire files, spectrum."""
