"""A lamp's beam and its spectrum as tables, the files that `profile` and `spectrum` = "table" read."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lightfield.arrays import Array
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.lamp.photometry import SHARED_ERROR
from lightfield.scene.lamp.profile import sections_of
from lightfield.scene.lamp.section import is_even
from lightfield.scene.lamp.spectrum import knots_nm, spectral_power
from lightfield.storage.files import write_text

#: Even steps up to the last angle that counts, then ever larger ones to the side: linear between them, a beam
#: is right to 1e-3 of its axis (test_curve.py).
_EVEN, _LARGER = 401, 100
#: Wavelengths of a scene, and steps of a table of power: a black body is right to 1e-3 (test_more_curves.py).
FIRST_NM, LAST_NM, STEP_NM = 200.0, 2000.0, 5.0


def intensity_rows(lamp: Lamp, to_deg: float) -> dict[str, Array]:
    """Columns of the table: angles in degrees and the intensity there over that on the axis, shape (n,).

    Parameters
    ----------
    lamp : Lamp
        Gaussian family or table, with what departs from it; of an oval or lopsided beam the even one,
        of a table that is not round every half plane.
    to_deg : float
        Up to here the beam is tabulated finely.
    """
    fine = np.linspace(0.0, min(to_deg, 90.0), _EVEN)
    angle = np.unique(np.concatenate([fine, np.geomspace(max(fine[-1], 1e-3), 90.0, _LARGER)]))
    turn, intensity = sections_of(lamp, np.radians(angle))
    columns = {"angle_deg": np.tile(angle, len(turn)), "phi_deg": np.repeat(np.degrees(turn), len(angle))}
    if len(turn) == 1:
        del columns["phi_deg"]
    return columns | {"intensity": (intensity / intensity[0, 0]).ravel()}


def save_intensity(
    lamp: Lamp,
    to_deg: float,
    path: str | os.PathLike[str],
    remark: str = "",
    errors: Callable[[Array], Array] | None = None,
) -> Path:
    """Write the table, whole or not at all; arguments as for `intensity_rows`.

    Parameters
    ----------
    remark : str
        One line on where it comes from.
    errors : callable, optional
        Of angles in degrees, shape (n,): errors of the intensity there, shape (k, n), see `beam_table`.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    columns = intensity_rows(lamp, to_deg)
    if errors is not None and is_even(lamp) and "phi_deg" not in columns:
        for k, error in enumerate(errors(columns["angle_deg"]), 1):
            columns[f"{SHARED_ERROR}{k}"] = error
    rows = [",".join(f"{v:.8g}" for v in row) for row in zip(*columns.values(), strict=True)]
    lines = [*([f"# {remark}"] if remark else []), ",".join(columns), *rows]
    return write_text(path, "\n".join(lines) + "\n")


def save_power(lamp: Lamp, path: str | os.PathLike[str], remark: str = "") -> Path:
    """Write the lamp's power per nanometre with what departs from it, whole or not at all.

    A table is scaled to the lamp's power: the head says which, of what the table holds.

    Parameters
    ----------
    remark : str
        One line on where it comes from.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    even = np.arange(FIRST_NM, LAST_NM + STEP_NM / 2, STEP_NM)
    bends = knots_nm(lamp)
    at = np.unique(np.concatenate([even, bends[(bends >= FIRST_NM) & (bends <= LAST_NM)]]))
    power = spectral_power(lamp, at)
    whole = float(np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(at)))
    rows = [f"{w:.8g},{p:.8g}" for w, p in zip(at, power, strict=True)]
    head = [f"# {line}" for line in (remark, f"power_w = {whole:.8g}") if line]
    return write_text(path, "\n".join([*head, "wavelength_nm,power", *rows]) + "\n")
