"""What the diagnosis page draws: plain arrays and the verdict as data; no fitting code is known here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array, Mask
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.fitting.fitted_curves import FittedCurve
from lightfield.scene import Tank
from lightfield.wording import plain


@dataclass(frozen=True)
class Prediction:
    """One rung of the ladder for every reading.

    Parameters
    ----------
    label : str
        As in the ladder, for example "+ scattering".
    value : array, shape (n,), unit of the readings
    effects : int
        How many effects it has more than the base model.
    """

    label: str
    value: Array
    effects: int = 0

    @property
    def name(self) -> str:
        """The label for people."""
        return plain(self.label)

    @property
    def short_name(self) -> str:
        """One that fits beside a panel: of many effects their number."""
        return self.name if self.effects < 2 else f"with {self.effects} effects"


@dataclass(frozen=True)
class Signature:
    """What an accepted explanation adds to the base model.

    Parameters
    ----------
    change : array, shape (n,), unit of the readings
        Prediction with the explanation, all else refitted, less the prediction of the refitted base model.
    """

    label: str
    change: Array


@dataclass(frozen=True)
class Separation:
    """Distances between explanations.

    Parameters
    ----------
    names : sequence, length k
        The effects of each.
    sigma : array, shape (k, k)
        [j, k]: distance of j, as fitted, from the nearest readings that k can produce.
    """

    names: Sequence[Sequence[str]]
    sigma: Array


@dataclass(frozen=True)
class DrawnReadings:
    """Readings with their errors.

    Parameters
    ----------
    x_m, y_m, z_m, wavelength_nm : arrays, shape (n,)
    value, sigma : arrays, shape (n,), unit of the readings
        `sigma` is the whole error that the diagnosis used.
    medium : sequence of str, length n
    left_out : array of bool, shape (n,)
        Saturated readings and outliers.
    time_s : array, shape (n,)
        NaN where it is unknown.
    """

    x_m: Array
    y_m: Array
    z_m: Array
    wavelength_nm: Array
    value: Array
    sigma: Array
    medium: Sequence[str]
    left_out: Mask
    time_s: Array


@dataclass(frozen=True)
class Group:
    """Readings of one scan (same plane, medium and wavelength), or of all scans of a band."""

    label: str
    rows: NDArray[np.intp]


@dataclass(frozen=True)
class ReadingsView:
    """Readings and what models say of them.

    Parameters
    ----------
    predictions : sequence of Prediction
        Base model first, best explanation last; one for "nothing missing".
    """

    readings: DrawnReadings
    predictions: Sequence[Prediction]

    @property
    def scan_axis(self) -> str:
        """Coordinate that varies most within planes: "x_m", "y_m", or "z_m" when neither varies.

        Of a grid or a cross that along whose middle lines the base model misses the most.
        """
        readings, groups = self.readings, self.groups()
        if self.is_grid:
            lost = np.nan_to_num(self.residual_sigma(0)) ** 2 * ~readings.left_out
            missed = {
                name: sum(float(lost[self.middle_line(group, name).rows].sum()) for group in groups)
                for name in ("x_m", "y_m")
            }
            return max(missed, key=lambda name: missed[name])
        spans = {
            name: max(float(np.ptp(getattr(readings, name)[group.rows])) for group in groups)
            for name in ("x_m", "y_m")
        }
        best = max(spans, key=lambda name: spans[name])
        return best if spans[best] > 1e-9 else "z_m"

    def middle_line(self, group: Group, along: str) -> Group:
        """Of a grid, the line next to the axis: lines drawn through a grid would jump from row to row."""
        name = "x_m" if along == "y_m" else "y_m"
        other = getattr(self.readings, name)[group.rows]
        nearest = other[np.abs(other).argmin()]
        rows = group.rows[np.abs(other - nearest) < 1e-6]
        return Group(f"{group.label}, {name[0]} = {nearest + 0.0:g} m", rows)

    @property
    def is_grid(self) -> bool:
        """Do x and y both vary within the scans?"""
        return all(
            max(float(np.ptp(getattr(self.readings, name)[group.rows])) for group in self.groups()) > 1e-6
            for name in ("x_m", "y_m")
        )

    @property
    def is_scattered(self) -> bool:
        """Are these single places rather than scans: hardly two readings share their distance?"""
        readings = self.readings
        spread = max(float(np.ptp(readings.x_m)), float(np.ptp(readings.y_m)))
        return spread > 1e-6 and 2 * len(self.groups()) > len(readings.value)

    def groups(self) -> list[Group]:
        """Scans in order of medium, wavelength and distance; labels say only what differs."""
        readings = self.readings
        media, waves = np.asarray(readings.medium), readings.wavelength_nm
        keys = sorted(
            {(m, float(w), float(z)) for m, w, z in zip(media, waves, np.round(readings.z_m, 6), strict=True)}
        )
        several_media, several_waves = len({k[0] for k in keys}) > 1, len({k[1] for k in keys}) > 1
        found = []
        for medium, wavelength, z in keys:
            rows = (media == medium) & (waves == wavelength) & (np.round(readings.z_m, 6) == z)
            label = f"z = {z:g} m"
            if several_waves:
                label += f", {wavelength:g} nm"
            if several_media:
                label += f", {medium}"
            found.append(Group(label, np.flatnonzero(rows)))
        return found

    def bands(self) -> list[Group]:
        """Readings of one medium and wavelength each; labels say only what differs."""
        media, waves = np.asarray(self.readings.medium), self.readings.wavelength_nm
        keys = sorted({(str(m), float(w)) for m, w in zip(media, waves, strict=True)})
        several_media, several_waves = (len({key[k] for key in keys}) > 1 for k in (0, 1))
        return [
            Group(
                ", ".join([f"{nm:g} nm"] * several_waves + [medium] * several_media),
                np.flatnonzero((media == medium) & (waves == nm)),
            )
            for medium, nm in keys
        ]

    def residual_sigma(self, step: int) -> Array:
        """(Reading - prediction) / sigma of one rung, shape (n,)."""
        return (self.readings.value - self.predictions[step].value) / self.readings.sigma


@dataclass(frozen=True)
class DiagnosisView(ReadingsView):
    """Everything on the page of a diagnosis.

    Parameters
    ----------
    readings, predictions
        See `ReadingsView`.
    signatures : sequence of Signature
        Accepted explanations, best first.
    hwhm_deg : float
        Half width of the lamp's beam, to draw it.
    provenance : sequence of (name, value)
    scene_toml : str
        The fitted scene.
    curves : sequence of FittedCurve
        Free-form curves of the best explanation.
    """

    verdict: Verdict
    signatures: Sequence[Signature] = ()
    separation: Separation | None = None
    tank: Tank | None = None
    hwhm_deg: float = 3.81
    title: str = "Diagnosis"
    provenance: Sequence[tuple[str, str]] = field(default_factory=tuple)
    scene_toml: str = ""
    curves: Sequence[FittedCurve] = ()
