"""The formula against the render, and a model against readings."""
