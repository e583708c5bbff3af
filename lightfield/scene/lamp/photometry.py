"""Measured beams: CSV, IES LM-63 and EULUMDAT files as intensity against angle from the axis and turn."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lightfield.arrays import Array
from lightfield.errors import SceneError
from lightfield.scene.lamp.between_angles import filled, monotone, splined
from lightfield.scene.lamp.luminaire_files import all_around, read_eulumdat, read_ies
from lightfield.storage.inputs import LUMINAIRE, kept_by_file, read_bytes
from lightfield.storage.tables import LARGEST, column_names, read_columns, read_rows

#: Half planes that differ by no more than this part of the largest intensity from their mean are one round
#: beam. Chosen: the error that light without photons is given (`render.diffuse.ratio`).
_ROUND = 0.002
#: Intensities that differ by less, as a part of that on the axis, are the same.
_SAME_INTENSITY = 1e-9
#: From here on it can be felt by how much two smooth beams through one table differ, as a part of the beam
#: there: a third of the misfit that a diagnosis takes for none unless it is told otherwise.
_UNTOLD = 1e-3
_TURN = 2 * np.pi
#: Columns of a table with errors: of every row by itself; and how those begin that rows share.
_OWN_ERROR, SHARED_ERROR = "stderr", "error_"


@dataclass(frozen=True, eq=False)
class BeamTable:
    """Intensity of a beam relative to its axis; linear between, dark beyond the last angle.

    Parameters
    ----------
    angle_rad : array, shape (n_angles,)
        From the axis, rising from 0; dense enough for straight lines to follow a smooth beam.
    turn_rad : array, shape (n_turns,)
        About the axis from x towards y of the beam, from 0 to 2 pi, both included; of a round beam 0 alone.
    intensity : array, shape (n_turns, n_angles)
        1 on the axis.
    stated_rad : array, shape (n_stated,)
        Those of the angles at which it was measured.
    errors : array, shape (k, n_stated)
        Independent contributions to the error of the intensity over that on the axis, of a round beam.
    """

    angle_rad: Array
    turn_rad: Array
    intensity: Array
    stated_rad: Array
    errors: Array = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def is_round(self) -> bool:
        """Is it the same all round its axis?"""
        return len(self.turn_rad) == 1

    def wider(self, factor: float) -> BeamTable:
        """The same at angles so many times as large."""
        if factor == 1.0:
            return self
        return replace(self, angle_rad=factor * self.angle_rad, stated_rad=factor * self.stated_rad)

    @cached_property
    def mean(self) -> Array:
        """Average over the turn, shape (n_angles,)."""
        return _average(self.turn_rad, self.intensity)

    @cached_property
    def mirrored(self) -> tuple[bool, bool]:
        """Is it the same at -x, and at -y?"""
        return self._alike(np.pi), self._alike(0.0)

    def relative_errors(self, angle_rad: Array) -> Array:
        """The errors over the intensity at angles from the axis, shape (k, n); where it is dark none.

        Those that are stated; and, one for each pair of measured angles, what is not told of a smooth beam
        between them, where that can be felt.
        """
        intensity = np.interp(angle_rad, self.angle_rad, self.mean, right=0.0)
        measured = np.interp(self.stated_rad, self.angle_rad, self.mean)
        relative = self.errors / np.where(measured > 0, measured, np.inf)
        every = [monotone(self.stated_rad, each, angle_rad) for each in relative]  # as the beam's logarithm
        untold, between = self.untold(angle_rad), np.searchsorted(self.stated_rad, angle_rad)
        steps = np.unique(between[np.abs(untold) > _UNTOLD])
        every += [np.where(between == i, untold, 0.0) for i in steps]
        return np.array(every).reshape(-1, len(intensity)) * (intensity > 0)

    def untold(self, angle_rad: Array) -> Array:
        """What the measured angles do not tell of a smooth beam between them, over what it is, shape (n,).

        By how much another smooth beam differs, see `splined`, averaged over the turn; as far as it is lit.
        """
        mean = np.interp(self.stated_rad, self.angle_rad, self.mean)
        dark = np.flatnonzero(mean <= 0)
        lit = slice(dark[0] if len(dark) else None)
        if len(mean[lit]) < 2:
            return np.zeros(len(angle_rad))
        within = angle_rad < self.stated_rad[lit][-1]
        here = np.interp(angle_rad, self.angle_rad, self.mean)
        other = splined(self.stated_rad[lit], mean[lit], np.where(within, angle_rad, 0.0))
        return np.where(within, other / np.where(within, here, 1.0) - 1.0, 0.0)

    def _alike(self, about: float) -> bool:
        """Is it the same at a turn and at that mirrored?"""
        turn = np.concatenate([self.turn_rad, (about - self.turn_rad) % _TURN])[:, None]
        one, other = self.at(self.angle_rad, turn), self.at(self.angle_rad, about - turn)
        return bool(np.abs(one - other).max() <= _SAME_INTENSITY)

    def at(self, angle_rad: ArrayLike, turn_rad: ArrayLike) -> Array:
        """Relative intensity at angles from the axis and turns about it, rad, broadcast together."""
        angle = np.asarray(angle_rad, float)
        if self.is_round:
            return np.interp(angle, self.angle_rad, self.intensity[0], right=0.0)
        turn = np.mod(turn_rad, _TURN)
        j, across = _place(self.turn_rad, turn)
        i, along = _place(self.angle_rad, angle)
        low, high = (
            self.intensity[k, i] + along * (self.intensity[k, i + 1] - self.intensity[k, i])
            for k in (j, j + 1)
        )
        return np.asarray((low + across * (high - low)) * (angle <= self.angle_rad[-1]))


def _average(turn_rad: Array, intensity: Array) -> Array:
    """Mean of half planes, (n_turns, n_angles), between which a beam is linear; shape (n_angles,)."""
    if len(turn_rad) == 1:
        return intensity[0]
    return np.asarray(np.diff(turn_rad) @ (0.5 * (intensity[1:] + intensity[:-1])) / _TURN)


def _place(nodes: Array, at: Array) -> tuple[NDArray[np.integer[Any]], Array]:
    """Number of the node before each place, and how far it is to the next."""
    before = np.clip(np.searchsorted(nodes, at, side="right") - 1, 0, len(nodes) - 2)
    return before, np.clip((at - nodes[before]) / (nodes[before + 1] - nodes[before]), 0.0, 1.0)


@kept_by_file(32)
def beam_table(path: str) -> BeamTable:
    """A measured beam, with its shape all around its axis.

    IES and EULUMDAT files give intensity over half planes around the nadir, which is the beam axis; the half
    plane C0 is towards +x of the beam, C90 towards -y (counterclockwise as seen from above the luminaire:
    IES LM-63-2002, definitions). Symmetric parts are completed.

    Parameters
    ----------
    path : str
        CSV (angle_deg, intensity in any unit, and phi_deg of a beam that is not round), `.ies` (LM-63,
        type C) or `.ldt` (EULUMDAT). The CSV of a round beam may state errors in the unit of the intensity:
        `stderr`, of every row by itself, and `error_1`, `error_2` ..., curves by which all of it may be off
        together, each by one standard error and independent of the others.

    Raises
    ------
    SceneError
        Not readable as that format, or no light on the axis.
    """
    read = _photometric if Path(path).suffix.lower() in {".ies", ".ldt"} else _columns
    angle, turn, intensity = read(path)
    if angle[0] != 0.0 or angle[-1] > 180.0:
        raise SceneError(
            "a beam table starts on the axis", where=path, found=f"{angle[0]:g} to {angle[-1]:g} deg",
            rule="angle_deg from 0, at most 180", remedy="add the value at 0 deg",
        )  # fmt: skip
    turns = np.radians(turn)
    axis = _average(turns, intensity)[0]
    if not axis > intensity.max() / LARGEST:
        raise SceneError(
            "no light on the beam axis", where=path, found=float(axis), rule="above 0 at 0 deg",
            remedy="turn the lamp's axis to 0 deg in the table",
        )  # fmt: skip
    intensity = intensity / axis
    intensity[:, 0] = 1.0
    errors = _stated_errors(path, angle) / axis
    # What is off on the axis is off in the unit of all.
    errors = errors - np.outer(errors[:, 0], intensity[0])
    mean = _average(turns, intensity)
    if np.abs(intensity - mean).max() <= _ROUND * mean.max():
        turns, intensity = np.zeros(1), mean[None]
    stated = np.radians(angle)
    every, intensity = filled(stated, intensity)
    table = BeamTable(every, turns, intensity, stated, errors)
    for column in (table.angle_rad, table.turn_rad, table.intensity, table.stated_rad, table.errors):
        column.setflags(write=False)
    return table


def _columns(path: str) -> tuple[Array, Array, Array]:
    """Angles in degrees, turns in degrees, and intensity, of a CSV file."""
    names = column_names(path)
    if "phi_deg" not in names:
        if "angle_deg" in names:
            _refuse_two_sides(path)
        angle, intensity = read_columns(path, ("angle_deg", "intensity"))
        return angle, np.zeros(1), intensity[None]
    every, phi, value = read_rows(path, ("angle_deg", "phi_deg", "intensity"))
    angle, i = np.unique(every, return_inverse=True)
    turn, j = np.unique(phi, return_inverse=True)
    grid = np.full((len(turn), len(angle)), np.nan)
    grid[j.ravel(), i.ravel()] = value
    on_axis = np.isfinite(grid[:, 0])
    if angle[0] == 0.0 and on_axis.any():
        grid[~on_axis, 0] = grid[on_axis, 0].mean()  # there all half planes meet
    problems = []
    if np.any(value < 0) or np.any(every < 0):
        problems.append("negative angles or intensities")
    if len(np.unique(np.stack([every, phi]), axis=1).T) < len(value):
        problems.append("a place that is given twice")
    if np.isnan(grid).any():
        k, n = np.argwhere(np.isnan(grid))[0]
        problems.append(f"no intensity at angle_deg {angle[n]:g}, phi_deg {turn[k]:g}")
    if not problems:
        try:
            return angle, *all_around(turn, grid)
        except ValueError as error:
            problems.append(str(error))
    raise SceneError(
        "not a table of a beam", where=path, found="; ".join(problems),
        rule="every angle_deg at every phi_deg, over 90, 180 or 360 deg of phi, intensities from 0",
        remedy="complete the table, or leave out what is too much",
    )  # fmt: skip


def _refuse_two_sides(path: str) -> None:
    (angle,) = read_rows(path, ("angle_deg",))
    if angle.min() < 0:
        raise SceneError(
            "a table of two sides of a beam", where=path,
            found=f"angle_deg from {angle.min():g} to {angle.max():g}",
            rule="angle_deg from 0, and phi_deg for the side",
            remedy="give one side phi_deg 0, the other phi_deg 180, and write its angles without the minus",
        )  # fmt: skip


def _stated_errors(path: str, angle: Array) -> Array:
    """Contributions to the error of the intensity, in its unit, shape (k, n_angles)."""
    if Path(path).suffix.lower() in {".ies", ".ldt"}:
        return np.empty((0, len(angle)))
    names = column_names(path)
    shared, own = [n for n in names if n.startswith(SHARED_ERROR)], [n for n in names if n == _OWN_ERROR]
    if not (shared or own):
        return np.empty((0, len(angle)))
    if "phi_deg" in names:
        raise SceneError(
            "errors of a beam that is not round", where=path, found=", ".join([*own, *shared]),
            rule="errors beside angle_deg and intensity alone", remedy="leave out these columns",
        )  # fmt: skip
    columns = read_rows(path, (*own, *shared))
    errors = [np.diag(column) for column in columns[: len(own)]]
    return np.concatenate([*errors, *(column[None] for column in columns[len(own) :])])


def _photometric(path: str) -> tuple[Array, Array, Array]:
    """Vertical angles in degrees up to 90, turns from +x towards +y of the beam in degrees, and intensity."""
    is_ldt = path.lower().endswith(".ldt")
    try:
        text = read_bytes(path, LUMINAIRE).decode("latin-1")
        angle, plane, intensity = (read_eulumdat if is_ldt else read_ies)(text)
    except (ValueError, KeyError, IndexError) as error:
        raise SceneError(
            f"not readable as {'EULUMDAT' if is_ldt else 'IES LM-63'}", where=path, found=str(error),
            rule="a complete type C file", remedy="export it again, or as CSV with angle_deg, intensity",
        ) from error  # fmt: skip
    keep = angle <= 90.0
    if len(plane) > 1:
        plane, intensity = 360.0 - plane[::-1], intensity[::-1]  # seen along the beam C runs the other way
    return angle[keep], plane, intensity[:, keep]
