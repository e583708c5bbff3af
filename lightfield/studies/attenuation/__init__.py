"""What readings in water against readings in air tell of the water: attenuation, a and b, constituents."""
