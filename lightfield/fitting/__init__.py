"""Fitting a model to readings: parameters, least squares, the forward model, effects."""
