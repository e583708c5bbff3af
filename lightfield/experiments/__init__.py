"""The virtual laboratory: layouts, readings made by the full render, hidden effects."""
