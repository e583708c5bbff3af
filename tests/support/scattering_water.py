"""Water that scatters, without walls unless they are given."""

from __future__ import annotations

from lightfield.scene import Scene


def scene(**values: object) -> Scene:
    """Unbounded water of b = 0.3 per m; keywords name the scene's values with __ for a point."""
    text = (
        "[water]\nbase = 'none'\nabsorption_per_m = 0.1\nscattering_per_m = 0.3\n"
        "[detector]\nquantity = 'irradiance'\n"
    )
    return Scene.from_toml(text).with_values({k.replace("__", "."): v for k, v in values.items()})
