"""Reads spectral EXR images back, by what their layout says (see `lightfield.maps.exr`)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from lightfield.maps.exr import OURS, Attribute, SpectralImage, channel_name

CHANNEL = re.compile(r"^(stderr\.)?S0\.(\d+(?:,\d+)?)nm$")
#: Attributes of ours that are fields of an image.
FIELDS = {"plane_z_m", "pixel_size_m", "first_pixel_m", "orientation", "preview_scale", "common_scale"}


def read_spectral_exr(path: Path) -> SpectralImage:
    """An image; channels are sorted by their number, for EXR keeps them in alphabetical order."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        header = dict(file.header())
        pixels = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
    assert "spectralLayoutVersion" in header
    value, stderr = dict[float, np.ndarray](), dict[float, np.ndarray]()
    for name, channel in pixels.items():
        if match := CHANNEL.match(name):
            wavelength = float(match[2].replace(",", "."))
            (stderr if match[1] else value)[wavelength] = channel[::-1].astype(float)
    wavelengths = np.array(sorted(value))
    n_y, n_x = next(iter(value.values())).shape
    first, size = header[OURS + "first_pixel_m"], header[OURS + "pixel_size_m"]
    return SpectralImage(
        wavelength_nm=wavelengths,
        value=np.stack([value[w] for w in wavelengths]),
        stderr=np.stack([stderr[w] for w in wavelengths]) if set(stderr) == set(value) else None,
        x_m=first[0] + size[0] * np.arange(n_x),
        y_m=first[1] - size[1] * np.arange(n_y)[::-1],
        z_m=float(header[OURS + "plane_z_m"][0]),
        units=str(header["emissiveUnits"]),
        response={
            w: _response(str(header[channel_name(w)])) for w in wavelengths if channel_name(w) in header
        },
        attributes=_attributes(header),
        common_scale=float(header[OURS + "common_scale"][0]) if OURS + "common_scale" in header else None,
    )


def _attributes(header: Mapping[str, Any]) -> dict[str, Attribute]:
    own = {k.removeprefix(OURS): v for k, v in header.items() if k.startswith(OURS)}
    return {
        name: float(value[0]) if isinstance(value, np.ndarray) else value
        for name, value in own.items()
        if name not in FIELDS
    }


def _response(text: str) -> tuple[list[float], list[float]]:
    pairs = [part.split("nm:") for part in text.split(";") if part]
    return [float(w) for w, _ in pairs], [float(r) for _, r in pairs]
