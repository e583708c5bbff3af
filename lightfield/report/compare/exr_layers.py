"""Render, formula and error of the formula as layers of one OpenEXR image for each plane."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lightfield.maps.colour import spectrum_to_rgb
from lightfield.maps.dataset import scene_attributes
from lightfield.maps.exr import plane_names, write_layers_exr
from lightfield.studies.compare.maps import Comparison


def write_layers(comparison: Comparison, folder: Path) -> list[Path]:
    """One image for each plane, `compare_z4.500m.exr`.

    Layers `render`, `stderr`, `formula` (in the comparison's units) and `error` (formula / render - 1; NaN
    where no light was rendered), each with a channel a wavelength, as `render.525nm`; R, G, B: the render.
    """
    written, known = [], scene_attributes(comparison.scene)
    distances = sorted({plane.z_m for plane in comparison.planes})
    for name, z_m in zip(plane_names("compare", distances), distances, strict=True):
        planes = [plane for plane in comparison.planes if plane.z_m == z_m]
        layers = {}
        for plane in planes:
            channel = f"{plane.wavelength_nm:g}nm".replace(".", ",")
            layers[f"render.{channel}"] = plane.render
            layers[f"stderr.{channel}"] = plane.stderr
            layers[f"formula.{channel}"] = plane.formula
            layers[f"error.{channel}"] = plane.ratio - 1
        light = np.nan_to_num(np.stack([plane.render for plane in planes])).astype(np.float64)
        preview = spectrum_to_rgb(light, np.array([plane.wavelength_nm for plane in planes]))
        about: dict[str, str | int | float] = {
            "quantity": comparison.quantity, "units": comparison.units, "plane_z_m": float(z_m),
            "layers": "render, stderr, formula in units; error = formula / render - 1",
            **{name: known[name] for name in ("scene_toml", "scene_digest", "lightfield_version")},
        }  # fmt: skip
        x_m, y_m = planes[0].x_m, planes[0].y_m
        written.append(write_layers_exr(folder / name, layers, about, preview, x_m, y_m))
    return written
