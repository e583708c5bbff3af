"""Measured beam profiles: CSV, IES LM-63 and EULUMDAT files as intensity against angle from the axis."""

from __future__ import annotations

import os
import warnings
from functools import lru_cache
from pathlib import Path

import numpy as np

from lightfield.arrays import Array
from lightfield.errors import SceneError, SceneWarning
from lightfield.scene.lamp.luminaire_files import read_eulumdat, read_ies
from lightfield.storage.inputs import LUMINAIRE, read_bytes
from lightfield.storage.tables import LARGEST, read_columns

#: A luminaire is called round up to this difference of its half planes. Chosen: the error of the formula that
#: a comparison calls small.
ROUND = 0.05


def intensity_table(path: str) -> tuple[Array, Array]:
    """Angle from the beam axis and intensity relative to the axis.

    IES and EULUMDAT files give intensity over half planes around the nadir; they are averaged, with a
    `SceneWarning` where they differ, and the nadir is the beam axis.

    Parameters
    ----------
    path : str
        CSV (angle_deg, intensity in any unit), `.ies` (LM-63, type C) or `.ldt` (EULUMDAT).

    Returns
    -------
    angle_rad, intensity : array, shape (n,)
        Rising angle from 0; intensity 1 on the axis.

    Raises
    ------
    SceneError
        Not readable as that format, or no light on the axis.
    """
    state = os.stat(path)
    return _load(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=32)
def _load(path: str, _modified: int, _size: int) -> tuple[Array, Array]:
    if Path(path).suffix.lower() in {".ies", ".ldt"}:
        angle, intensity = _photometric(path)
    else:
        angle, intensity = read_columns(path, ("angle_deg", "intensity"))
    if angle[0] != 0.0 or angle[-1] > 180.0:
        raise SceneError(
            "a beam table starts on the axis", where=path, found=f"{angle[0]:g} to {angle[-1]:g} deg",
            rule="angle_deg from 0, at most 180", remedy="add the value at 0 deg",
        )  # fmt: skip
    if not intensity[0] > intensity.max() / LARGEST:
        raise SceneError(
            "no light on the beam axis", where=path, found=float(intensity[0]), rule="above 0 at 0 deg",
            remedy="turn the lamp's axis to 0 deg in the table",
        )  # fmt: skip
    return np.radians(angle), intensity / intensity[0]


def _photometric(path: str) -> tuple[Array, Array]:
    """Vertical angles in degrees up to 90, and intensity averaged over the half planes."""
    is_ldt = path.lower().endswith(".ldt")
    try:
        text = read_bytes(path, LUMINAIRE).decode("latin-1")
        luminaire = (read_eulumdat if is_ldt else read_ies)(text)
    except (ValueError, KeyError, IndexError) as error:
        raise SceneError(
            f"not readable as {'EULUMDAT' if is_ldt else 'IES LM-63'}", where=path, found=str(error),
            rule="a complete type C file", remedy="export it again, or as CSV with angle_deg, intensity",
        ) from error  # fmt: skip
    if luminaire.asymmetry > ROUND:
        warnings.warn(
            f"{path}: the luminaire is averaged around its axis, though half planes differ by up to "
            f"{100 * luminaire.asymmetry:.0f} % of its largest intensity from that mean "
            "(lamp.ellipticity makes an oval beam)",
            SceneWarning,
            stacklevel=2,
        )
    keep = luminaire.angle_deg <= 90.0
    return luminaire.angle_deg[keep], luminaire.intensity[keep]
