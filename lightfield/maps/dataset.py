"""A rendering as one xarray data set: maps, errors, coordinates, units, provenance; NetCDF and EXR files."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from pydantic import ValidationError

from lightfield.arrays import Array
from lightfield.errors import OutputError
from lightfield.maps.colour import linear_rgb
from lightfield.maps.exr import Attribute, SpectralImage, plane_names, write_spectral_exr
from lightfield.scene import Detector, Scene, Tank
from lightfield.scene.acts import DIFFUSE
from lightfield.scene.all_parameters import neutral
from lightfield.scene.in_tank import plane_size_m
from lightfield.storage.files import MAKE_ROOM, atomic_path
from lightfield.storage.inputs import MAPS, check_regular
from lightfield.version import __version__

if TYPE_CHECKING:
    from lightfield.render.at_readings import AtPlaces
    from lightfield.render.maps import Rendering

#: First bytes of HDF5, and so of NetCDF-4.
_HDF5 = b"\x89HDF\r\n\x1a\n"
_DIMS = ("wavelength_nm", "z_m", "y_m", "x_m")
_PARTS = ("direct", "diffuse")
#: Of the metadata of every file (Climate and Forecast).
CONVENTIONS = "CF-1.11"
#: Coordinates of a place, in m, in words.
PLACE = {
    "z_m": "distance of the plane from the lamp",
    "y_m": "height above the lamp",
    "x_m": "horizontal distance from the axis",
}
QUANTITIES = {
    "irradiance": ("W m-2 nm-1", "spectral irradiance on planes that face the lamp (-z)"),
    "scalar_irradiance": ("W m-2 nm-1", "spectral scalar irradiance"),
    "radiance": ("W m-2 sr-1 nm-1", "spectral radiance averaged over the cone of the collimator"),
}
#: Dimension, values and attributes of a coordinate.
_Placed = tuple[str, Array, dict[str, str]]


def to_dataset(rendering: Rendering | AtPlaces, wavelengths_nm: Array | None = None) -> xr.Dataset:
    """Maps of a rendering with everything needed to understand them later.

    Parameters
    ----------
    rendering : Rendering or AtPlaces
        Of planes, or of single places.
    wavelengths_nm : array, shape (n,), nm, optional
        Default: one map per band of the detector, averaged over the band.

    Returns
    -------
    xarray.Dataset
        Dimensions (wavelength_nm, z_m, y_m, x_m), or (wavelength_nm, position) where the scene lists single
        positions; wavelengths rise, whatever the order of the bands. Variables are named after the quantity:
        `irradiance`, `irradiance_stderr`, and the same for the parts `irradiance_direct` and
        `irradiance_diffuse`.
    """
    quantity = str(rendering.scene.detector.quantity)
    units, meaning = QUANTITIES[quantity]
    bands = np.asarray(rendering.scene.detector.bands_nm, float)
    centres = bands.mean(axis=1) if wavelengths_nm is None else np.asarray(wavelengths_nm, float)
    traced = rendering.rendering if hasattr(rendering, "rendering") else rendering
    dims, coords = _places(rendering)
    coords["wavelength_nm"] = (
        "wavelength_nm",
        centres,
        {"units": "nm", "standard_name": "radiation_wavelength"},
    )
    data: dict[str, tuple[tuple[str, ...], Array, dict[str, str]]] = {}
    inside = getattr(traced.grid, "inside", None)
    cut = dims == _DIMS and inside is not None and bool(np.any(inside < 1))
    outside = {"comment": "NaN: cells that are not all in the tank"} if cut else {}
    for part in ("all", *_PARTS):
        name = quantity if part == "all" else f"{quantity}_{part}"
        mean, stderr = rendering.maps(wavelengths_nm, part=part)
        if part == "diffuse" and neutral(rendering.scene, DIFFUSE) and not np.nan_to_num(mean).any():
            stderr = 0.0 * mean  # nothing could come
        about = meaning if part == "all" else f"{meaning}, {part} part"
        data[name] = (
            dims,
            mean,
            {"units": units, "long_name": about, "ancillary_variables": f"{name}_stderr", **outside},
        )
        data[f"{name}_stderr"] = (
            dims,
            stderr,
            {"units": units, "long_name": f"Monte Carlo standard error of {name}; infinite: no photon came"},
        )
    dataset = xr.Dataset(data, coords=coords, attrs={"quantity": quantity, **provenance(traced)})
    if wavelengths_nm is None:
        dataset["wavelength_nm"].attrs["bounds"] = "wavelength_bounds_nm"
        dataset["wavelength_bounds_nm"] = (("wavelength_nm", "bound"), bands)
        for part in ("", "_direct", "_diffuse"):
            dataset[quantity + part].attrs["cell_methods"] = "wavelength_nm: mean area: mean (cell)"
    return dataset.sortby("wavelength_nm")


def _places(rendering: Rendering | AtPlaces) -> tuple[tuple[str, ...], dict[str, _Placed]]:
    """Dimensions and coordinates of the maps: planes, or single positions."""
    where = rendering.grid if hasattr(rendering, "grid") else rendering
    single = where is rendering
    coords = {
        name: (
            "position" if single else name,
            np.asarray(getattr(where, name), float),
            {"units": "m", "long_name": words, "axis": name[0].upper()},
        )
        for name, words in PLACE.items()
    }
    return (_DIMS[0], "position") if single else _DIMS, coords


def scene_attributes(scene: Scene, title: str = "light field of an underwater lamp") -> dict[str, Attribute]:
    """Global attributes of whatever is traced: conventions, scene, software.

    Parameters
    ----------
    title : str
        Of a scene without a name.
    """
    return {
        "Conventions": CONVENTIONS,
        "title": str(scene.name or title),
        "source": f"Monte Carlo light transport, lightfield {__version__}, mitsuba {version('mitsuba')}",
        # Without the time: equal runs give equal files, and the file system knows when.
        "history": f"lightfield {__version__}",
        "orientation": "x horizontal, y up, z along the axis from the lamp; indices grow with coordinates",
        "scene_toml": str(scene.to_toml()),
        # With every default written out, for defaults may change with the version.
        "scene_json": json.dumps(scene.model_dump(mode="json")),
        "scene_digest": str(scene.digest()),
        "lightfield_version": __version__,
    }


def provenance(rendering: Rendering) -> dict[str, Attribute]:
    """Global attributes: conventions, scene, seed, photons, requested and reached error, energy, software."""
    scene, settings, energy = rendering.scene, rendering.settings, rendering.energy
    attributes = scene_attributes(scene) | {
        "seed": int(settings.seed),
        "requested_relative_error": float(settings.rel_error),
        "reached_relative_error": float(rendering.reached),
        "photons": int(rendering.response.photons),
    }
    balance = {**asdict(energy), "closure": energy.closure}
    attributes |= {f"energy_{name}": float(value) for name, value in balance.items()}
    attributes["energy_units"], attributes["energy_comment"] = energy_units(scene)
    return attributes


def energy_units(scene: Scene) -> tuple[str, str]:
    """Unit of the attributes `energy_*`, and what they are, in words."""
    unit, of = ("1", "1 W of the lamp") if scene.lamp.profile == "pencil" else ("sr", "1 W/sr on the axis")
    return (
        unit,
        f"W for {of}, in the reference water of the trace; energy_closure as a part of energy_emitted",
    )


def write_netcdf(dataset: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write a data set as compressed NetCDF-4, whole or not at all.

    Raises
    ------
    OutputError
        The place is not writable.
    """
    packed: dict[Any, dict[str, Any]] = {
        name: {"zlib": True, "complevel": 4} for name in dataset.data_vars if dataset[name].ndim > 2
    }
    # No coordinate is missing anywhere, say the CF conventions (section 2.5.1).
    packed |= {name: {"_FillValue": None} for name in dataset.coords}
    try:
        with atomic_path(path) as temporary:
            dataset.to_netcdf(temporary, engine="netcdf4", encoding=packed)
    except (OSError, RuntimeError) as error:
        raise OutputError(
            "cannot write the data set", where=str(path), found=str(error), remedy=MAKE_ROOM
        ) from error
    return Path(path)


def read_netcdf(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a data set written by `write_netcdf` into memory.

    Raises
    ------
    OutputError
        Not a NetCDF file, a damaged one, or not one of ours.
    """
    check_regular(path, MAPS)
    try:
        dataset = xr.load_dataset(path, engine="netcdf4")
    except (OSError, ValueError, RuntimeError) as error:
        if _begins_as_netcdf(path):
            raise OutputError(
                "this data set is damaged or cut short", where=str(path),
                rule="a whole NetCDF file, as a render writes it",
                remedy="copy it again from where it was written, or render again",
            ) from error  # fmt: skip
        raise OutputError(
            "cannot read this as a data set", where=str(path),
            rule="NetCDF, as a render writes it", remedy="check the path, or render again",
        ) from error  # fmt: skip
    if (lacks := lacking(dataset)) is not None:
        raise OutputError(
            "not a rendering", where=str(path), rule=lacks,
            remedy="give a file that a render wrote",
        )  # fmt: skip
    return dataset


def lacking(dataset: xr.Dataset) -> str | None:
    """What a data set would need to be a rendering; None where it is one."""
    quantity = dataset.attrs.get("quantity")
    if quantity not in QUANTITIES or quantity not in dataset:
        return f"needs one of {', '.join(QUANTITIES)}, and the attribute `quantity` that names it"
    if f"{quantity}_stderr" not in dataset or "scene_toml" not in dataset.attrs:
        return f"needs {quantity}_stderr and the attribute scene_toml"
    if dataset[quantity].dims not in (_DIMS, (_DIMS[0], "position")):
        return f"needs {quantity} over {', '.join(_DIMS)}, or over {_DIMS[0]} and position"
    return None


def brightest(light: xr.DataArray, name: str = "wavelength_nm") -> int:
    """Index of the colour with most light, over everything else."""
    others = [dim for dim in light.dims if dim != name]
    return int(np.argmax(light.sum(others).values))


def _begins_as_netcdf(path: str | os.PathLike[str]) -> bool:
    """Has a file the first bytes of NetCDF-4, whatever follows?"""
    with open(path, "rb") as file:
        return file.read(len(_HDF5)) == _HDF5


def plane_image(dataset: xr.Dataset, plane: int, common_scale: float | None = None) -> SpectralImage:
    """One plane of a data set as a spectral image.

    Parameters
    ----------
    plane : int
        Index along z_m.
    common_scale : float, optional
        That of the preview which all planes share.
    """
    quantity, attrs = dataset.attrs["quantity"], dataset.attrs
    scene = json.loads(attrs["scene_json"])
    z = float(dataset.z_m[plane])
    wavelengths = dataset.wavelength_nm.values.astype(float)
    reached = attrs.get("reached_relative_error")
    details: dict[str, Attribute] = {
        "quantity": quantity,
        "plane_pose": f"z = {z:g} m, normal -z, x horizontal, y up, origin at the lamp",
        "lamp": json.dumps(scene.get("lamp", {})),
        "water": json.dumps(scene.get("water", {})),
        "scene": attrs["scene_toml"],
        "scene_digest": attrs["scene_digest"],
        "version": attrs["lightfield_version"],
    }
    if reached is not None:
        details["monte_carlo_relative_error"] = float(reached)
    for name in ("seed", "photons"):
        if name in attrs:
            details[name] = int(attrs[name])
    return SpectralImage(
        wavelength_nm=wavelengths,
        value=dataset[quantity].values[:, plane],
        stderr=dataset[f"{quantity}_stderr"].values[:, plane],
        x_m=dataset.x_m.values.astype(float),
        y_m=dataset.y_m.values.astype(float),
        z_m=z,
        units=QUANTITIES[quantity][0].replace("-", "^-").replace(" ", "."),  # as EXR has them: m^-2.nm^-1
        response=_responses(dataset, scene["detector"]),
        attributes=details,
        common_scale=common_scale,
        plane_m=_plane_m(scene),
    )


def _plane_m(scene: Mapping[str, Any]) -> tuple[float, float]:
    """Width and height of the planes of a scene, m, given all that it dumps."""
    detector, tank = _part_of(scene["detector"], "width_m", "height_m", "pixels"), scene.get("tank")
    return plane_size_m(detector, None if tank is None else Tank.model_validate(tank))


def _responses(
    dataset: xr.Dataset, detector: Mapping[str, Any]
) -> dict[float, tuple[list[float], list[float]]]:
    """What weighs the wavelengths of every band as it is read, from 0 to 1; nothing where a table is gone."""
    bounds = np.asarray(dataset.get("wavelength_bounds_nm", np.empty((0, 2))), float)
    try:
        seen = _part_of(detector, "response", "response_table", "bands_nm", "wavelength_shift_nm")
    except ValidationError:
        return {}
    response, found = seen.spectral_response, {}
    knots = response.knots_nm
    for w, (low, high) in zip(dataset.wavelength_nm.values, bounds + seen.wavelength_shift_nm, strict=False):
        at = np.unique([low, *knots[(knots > low) & (knots < high)], high])
        weight = response.at(at)
        found[float(w)] = (at.tolist(), (weight / weight.max()).tolist())
    return found


def _part_of(detector: Mapping[str, Any], *names: str) -> Detector:
    """A detector of which some fields are stated, given all that one dumps."""
    return Detector.model_validate({n: detector[n] for n in names if detector.get(n) is not None})


def write_exr_planes(dataset: xr.Dataset, folder: str | os.PathLike[str]) -> list[Path]:
    """One spectral EXR per plane, named after quantity and distance, see `exr.plane_names`."""
    quantity = dataset.attrs["quantity"]
    values = np.nan_to_num(dataset[quantity].values)  # [n_wavelength, n_plane, n_y, n_x]
    scale = float(linear_rgb(values, dataset.wavelength_nm.values.astype(float)).max(initial=0.0))
    return [
        write_spectral_exr(Path(folder) / name, plane_image(dataset, index, scale or None))
        for index, name in enumerate(plane_names(quantity, dataset.z_m.values.tolist()))
    ]
