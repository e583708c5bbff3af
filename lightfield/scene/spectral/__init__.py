"""Curves over wavelength: peaks of lamps and filters, LEDs by name, the response of detectors."""
