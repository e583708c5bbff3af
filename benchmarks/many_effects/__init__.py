"""Sets of nought to six effects, lamps that are no Gaussian, errors that are not as stated, unknowns beside
what is known; all through the full render."""
