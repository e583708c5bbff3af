"""Spectral OpenEXR images of detector planes.

Layout: Fichet, Pacanowski & Wilkie (2021), "An OpenEXR layout for spectral images", JCGT 10(3): one 32-bit
channel `S0.<centre>nm` per wavelength, with a decimal comma, and an R, G, B preview. Standard errors stand in
channels of the same name in the layer `stderr.`. The preview's brightest channel is 1 on each plane;
`preview_scale` says what 1 stands for. Planes that belong together have a second preview, in the layer
`common.`, on one scale for all of them, `common_scale`.

Orientation. An image is what an observer *behind the plane, looking back at the lamp* (towards -z) sees: the
first row is the top (largest y), columns run with growing x. It is the picture one gets by plotting x to the
right and y upwards. In memory (`SpectralImage`) rows run with growing y, like the data set's coordinates.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import ArrayLike, NDArray

from lightfield.arrays import Array
from lightfield.errors import OutputError
from lightfield.maps.colour import CHROMATICITIES, linear_rgb
from lightfield.storage.files import MAKE_ROOM, atomic_path

Attribute = str | int | float
_LAYOUT_VERSION = "1.0"
_ERROR_LAYER, _COMMON_LAYER = "stderr.", "common."
_OURS = "lightfield."
_ORIENTATION = "seen from behind the plane towards the lamp (-z): first row is +y, columns run with +x"
#: Digits of a distance in m.
_MILLIMETRE, _FINEST = 3, 16
_CHANNEL = re.compile(r"^(stderr\.)?S0\.(\d+(?:,\d+)?)nm$")


@dataclass(frozen=True)
class SpectralImage:
    """Spectral map on one plane.

    Parameters
    ----------
    wavelength_nm : array, shape (n_wavelength,), nm, increasing
    value, stderr : array, shape (n_wavelength, n_y, n_x), `units`
        stderr may be None, and infinite where no photon came
    x_m, y_m : array, shape (n_x,) and (n_y,), m: pixel centres, increasing, evenly spaced
    z_m : float, m: distance of the plane
    units : str, in the layout's notation, for example `W.m^-2.nm^-1`
    response : mapping of wavelength to (wavelengths nm, relative response) of its band
    attributes : our own attributes, name without prefix to text or number
    common_scale : float, optional: what 1 in the layer `common.` stands for, as `colour.linear_rgb` gives it
    plane_m : pair of float, m: width and height of the plane, which a single column or row does not tell
    """

    wavelength_nm: NDArray[np.float64]
    value: NDArray[np.float64]
    stderr: NDArray[np.float64] | None
    x_m: NDArray[np.float64]
    y_m: NDArray[np.float64]
    z_m: float
    units: str = "W.m^-2.nm^-1"
    response: Mapping[float, tuple[Sequence[float], Sequence[float]]] = field(default_factory=dict)
    attributes: Mapping[str, Attribute] = field(default_factory=dict)
    common_scale: float | None = None
    plane_m: tuple[float, float] = (1.0, 1.0)


def plane_names(what: str, z_m: Sequence[float]) -> list[str]:
    """A file for every plane, `irradiance_z4.500m.exr`: to the millimetre, finer where planes lie closer.

    Parameters
    ----------
    what : str
        Which they show.
    z_m : sequence of float, m
        Each once.
    """
    for digits in range(_MILLIMETRE, _FINEST):
        names = [f"{what}_z{z:.{digits}f}m.exr" for z in z_m]
        if len(set(names)) == len(names):
            break
    return names


def channel_name(wavelength_nm: float) -> str:
    """Channel of one wavelength: `S0.525,000000nm` (Fichet et al. 2021)."""
    return f"S0.{wavelength_nm:.6f}nm".replace(".", ",").replace("S0,", "S0.", 1)


def response_text(wavelength_nm: Sequence[float], response: Sequence[float]) -> str:
    """Band response as the layout writes it: `400nm:0.98;410nm:0.97;` (Fichet et al. 2021)."""
    return "".join(f"{w:.9g}nm:{r:.9g};" for w, r in zip(wavelength_nm, response, strict=True))


def write_spectral_exr(path: str | os.PathLike[str], image: SpectralImage) -> Path:
    """Write one spectral image, whole or not at all.

    Raises
    ------
    OutputError
        Values are not finite, wavelengths repeat, shapes disagree, or the place is not writable.
    """
    _check(path, image)
    channels: dict[str, NDArray[np.float32]] = {}
    preview = linear_rgb(np.nan_to_num(image.value), image.wavelength_nm)
    scale = float(preview.max(initial=0.0)) or 1.0
    for index, name in enumerate("RGB"):
        channels[name] = _to_file(preview[..., index] / scale)
        if image.common_scale:
            channels[_COMMON_LAYER + name] = _to_file(preview[..., index] / image.common_scale)
    for index, wavelength in enumerate(image.wavelength_nm):
        name = channel_name(wavelength)
        channels[name] = _to_file(image.value[index])
        if image.stderr is not None:
            channels[_ERROR_LAYER + name] = _to_file(image.stderr[index])
    return _written({**_header(image), _OURS + "preview_scale": np.array([scale])}, channels, Path(path))


def read_spectral_exr(path: str | os.PathLike[str]) -> SpectralImage:
    """Read a spectral image; channels are sorted by their number, for EXR keeps them in alphabetical order.

    Raises
    ------
    OutputError
        Not an EXR file, or not in the spectral layout.
    """
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            header = dict(file.header())
            pixels = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
    except (RuntimeError, OSError, ValueError) as error:
        raise OutputError(
            "cannot read this as an EXR image",
            where=str(path),
            found=str(error),
            remedy="give a file written by lightfield",
        ) from error
    value: dict[float, NDArray[np.float64]] = {}
    stderr: dict[float, NDArray[np.float64]] = {}
    for name, channel in pixels.items():
        match = _CHANNEL.match(name)
        if match:
            wavelength = float(match[2].replace(",", "."))
            (stderr if match[1] else value)[wavelength] = channel[::-1].astype(float)
    if not value or "spectralLayoutVersion" not in header:
        raise OutputError(
            "not a spectral image",
            where=str(path),
            found=sorted(pixels)[:6],
            rule="channels S0.<centre>nm and spectralLayoutVersion",
        )
    wavelengths = np.array(sorted(value))
    n_y, n_x = next(iter(value.values())).shape
    size = np.asarray(header.get(_OURS + "pixel_size_m", (1.0, 1.0)), dtype=float)
    first = np.asarray(header.get(_OURS + "first_pixel_m", (0.0, n_y - 1.0)), dtype=float)
    # Of an image that was cropped the window begins elsewhere than where the file says the first pixel is.
    first = first + np.asarray(header["dataWindow"][0]) * size * (1, -1)
    return SpectralImage(
        wavelength_nm=wavelengths,
        value=np.stack([value[w] for w in wavelengths]),
        stderr=np.stack([stderr[w] for w in wavelengths]) if set(stderr) == set(value) else None,
        x_m=first[0] + size[0] * np.arange(n_x),
        y_m=first[1] - size[1] * np.arange(n_y)[::-1],
        z_m=float(np.ravel(header.get(_OURS + "plane_z_m", np.nan))[0]),
        units=str(header.get("emissiveUnits", "")),
        response={
            w: _response(str(header[channel_name(w)])) for w in wavelengths if channel_name(w) in header
        },
        attributes=_attributes(header),
        common_scale=float(header[_OURS + "common_scale"][0]) if _OURS + "common_scale" in header else None,
        plane_m=(float(size[0]) * n_x, float(size[1]) * n_y),
    )


def write_layers_exr(
    path: str | os.PathLike[str],
    layers: Mapping[str, ArrayLike],
    attributes: Mapping[str, Attribute],
    preview: ArrayLike,
    x_m: Array,
    y_m: Array,
) -> Path:
    """Maps beside each other in one image, whole or not at all.

    Parameters
    ----------
    path : path-like
    layers : mapping of str to array, shape (n_y, n_x)
        Channels by their full name, "render.525nm": what stands before the last point is the layer.
    attributes : mapping
        Our own attributes, name without prefix to text or number.
    preview : array, shape (n_y, n_x, 3)
        Linear sRGB that viewers show first.
    x_m, y_m : arrays, shapes (n_x,) and (n_y,), m
        Centres of the pixels; one of a side does not tell how wide it is, and then none is told.

    Raises
    ------
    OutputError
        The place is not writable.
    """
    header: dict[str, object] = {
        "compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage,
        "chromaticities": CHROMATICITIES, _OURS + "orientation": _ORIENTATION, **_ours(attributes),
    }  # fmt: skip
    if min(x_m.size, y_m.size) > 1:
        header |= _places(x_m, y_m, (1.0, 1.0))
    seen = np.asarray(preview)
    channels = {name: _to_file(seen[..., index]) for index, name in enumerate("RGB")}
    channels |= {name: _to_file(layer) for name, layer in layers.items()}
    return _written(header, channels, Path(path))


def _written(header: Mapping[str, object], channels: Mapping[str, NDArray[np.float32]], path: Path) -> Path:
    """Write an image, whole or not at all."""
    try:
        with atomic_path(path) as temporary:
            OpenEXR.File(dict(header), dict(channels)).write(str(temporary))
    except RuntimeError as error:
        raise OutputError(
            "cannot write the EXR image", where=str(path), found=str(error), remedy=MAKE_ROOM
        ) from error
    return path


def _header(image: SpectralImage) -> dict[str, object]:
    header: dict[str, object] = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "chromaticities": CHROMATICITIES,
        "spectralLayoutVersion": _LAYOUT_VERSION,
        "emissiveUnits": image.units,
        _OURS + "plane_z_m": np.array([image.z_m]),
        _OURS + "orientation": _ORIENTATION,
        **_places(image.x_m, image.y_m, image.plane_m),
    }
    if image.common_scale:
        header[_OURS + "common_scale"] = np.array([image.common_scale])
    for wavelength, (nodes, response) in image.response.items():
        header[channel_name(wavelength)] = response_text(nodes, response)
    return {**header, **_ours(image.attributes)}


def _places(x_m: Array, y_m: Array, plane_m: tuple[float, float]) -> dict[str, object]:
    """Where pixels lie and how large they are; of a single row or column the plane tells."""
    size = [_spacing(centres, whole) for centres, whole in zip((x_m, y_m), plane_m, strict=True)]
    return {
        "pixelAspectRatio": size[0] / size[1] if min(size) > 0 else 1.0,
        _OURS + "pixel_size_m": np.array(size),
        _OURS + "first_pixel_m": np.array([x_m[0], y_m[-1]]),
    }


def _ours(attributes: Mapping[str, Attribute]) -> dict[str, object]:
    """Attributes under our prefix, as EXR keeps them."""
    header: dict[str, object] = {}
    for name, attribute in attributes.items():
        # Numbers as doubles and long integers as text: EXR's own int and float have 32 bits.
        small = isinstance(attribute, int) and abs(attribute) < 2**31
        header[_OURS + name] = (
            np.array([attribute]) if isinstance(attribute, float) else attribute if small else str(attribute)
        )
    return header


def _attributes(header: Mapping[str, Any]) -> dict[str, Attribute]:
    own = {"plane_z_m", "pixel_size_m", "first_pixel_m", "orientation", "preview_scale", "common_scale"}
    found: dict[str, Attribute] = {}
    for key, attribute in header.items():
        name = key.removeprefix(_OURS)
        if key.startswith(_OURS) and name not in own:
            number = isinstance(attribute, np.ndarray)
            found[name] = float(attribute[0]) if number else attribute
    return found


def _response(text: str) -> tuple[list[float], list[float]]:
    pairs = [part.split("nm:") for part in text.split(";") if part]
    return [float(w) for w, _ in pairs], [float(r) for _, r in pairs]


def _check(path: str | os.PathLike[str], image: SpectralImage) -> None:
    where = str(path)
    expected = (image.wavelength_nm.size, image.y_m.size, image.x_m.size)
    outside = np.isnan(image.value).all(axis=0)
    for name, array in (("value", image.value), ("stderr", image.stderr)):
        if array is None:
            continue
        if array.shape != expected:
            raise OutputError(
                f"{name} has the wrong shape", where=where, found=array.shape, rule=f"must be {expected}"
            )
        # An infinite standard error is honest (no photon came); an infinite value never is. Pixels outside
        # the tank are NaN, in all channels alike.
        bad = np.isnan(array) != outside
        if name == "value":
            bad |= np.isinf(array)
        if bad.any():
            raise OutputError(f"{name} has {np.count_nonzero(bad)} values that are not numbers", where=where)
    names = [channel_name(w) for w in image.wavelength_nm]
    if len(set(names)) != len(names):
        raise OutputError(
            "two channels have the same wavelength", where=where, rule="wavelengths differ by 1e-6 nm or more"
        )


def _spacing(centres: Array, whole: float) -> float:
    return float((centres[-1] - centres[0]) / (centres.size - 1)) if centres.size > 1 else whole


def _to_file(rows_upwards: ArrayLike) -> NDArray[np.float32]:
    return np.ascontiguousarray(np.asarray(rows_upwards)[::-1], dtype=np.float32)


#: What the numbers of a picture are.
_PICTURE_UNITS = "relative radiance x lightfield.exposure; 1 is white"


def write_rgb_exr(
    rgb: np.ndarray, factor: float, beside: Path, notes: Sequence[str], attributes: Mapping[str, Attribute]
) -> Path:
    """Write linear light, exposed by a factor as the PNG is, next to it, as 32-bit R, G, B."""
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "comments": "; ".join(notes),
        "chromaticities": CHROMATICITIES,
        **_ours({"exposure": float(factor), "units": _PICTURE_UNITS, **attributes}),
    }
    channels = {"RGB": np.ascontiguousarray(rgb * factor, np.float32)}
    return _written(header, channels, beside.with_suffix(".exr"))
