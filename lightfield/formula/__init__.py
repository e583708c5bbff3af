"""The closed-form model: Gaussian beam x inverse square x Beer-Lambert, stage by stage."""
