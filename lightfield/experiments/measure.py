"""Readings of a known scene, as an imperfect instrument shows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.problem.layout import Layout, layout_of
from lightfield.fitting.forward import SceneForward
from lightfield.formula.closed_form import direct_field
from lightfield.formula.own_formulas import lit
from lightfield.formula.scattered.scattered_field import ScatteredField, describes
from lightfield.readings import Readings
from lightfield.readings.blindness import load_warnings
from lightfield.render.at_readings import rendered_light
from lightfield.render.limits import MADE_PHOTONS
from lightfield.scene import Scene
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m

#: Samples that a standard error is estimated from.
SAMPLES = 40
#: Read noise over the largest reading.
_FLOOR = 0.0008
#: Error of the render as a part of the noise: readings shall scatter by their noise.
_ERROR_OF_NOISE = 0.25
#: Part of the readings at which the render may err by more than the noise: as of the cells of a render, whose
#: error is that of 95 in a hundred.
_SELDOM = 0.05


@dataclass(frozen=True)
class Instrument:
    """What spoils readings.

    Parameters
    ----------
    noise : float
        Relative noise of a bright reading.
    serial : float
        Correlation of successive errors.
    outliers : float
        Part of the readings that are grossly wrong.
    plane_gain : float
        Relative error of each visit to a plane.
    position_m : float, m
        Error of each coordinate of each position.
    """

    noise: float = 0.01
    serial: float = 0.0
    outliers: float = 0.0
    plane_gain: float = 0.0
    position_m: float = 0.0

    def sigma(self, shown: Array) -> Array:
        """Standard error of readings next to 1, shape (n,)."""
        return np.hypot(self.noise * shown, _FLOOR)

    def stated(self, readings: Readings) -> Readings:
        """The readings with the errors of planes and positions in their error budget."""
        budget = readings.budget
        if self.plane_gain > 0:
            budget = replace(budget, plane_gain_percent=100 * self.plane_gain)
        if self.position_m > 0:
            budget = replace(budget, position_mm=1000 * self.position_m)
        return replace(readings, budget=budget)


@dataclass(frozen=True)
class LightAtReadings:
    """Light at the readings for unit on-axis intensity, and its Monte Carlo error, shape (n,)."""

    value: Array
    stderr: Array | float = 0.0

    @property
    def relative_error(self) -> Array:
        """Error over light, shape (n,); 0 where there is no light."""
        return np.divide(self.stderr, self.value, out=np.zeros(len(self.value)), where=self.value > 0)


@dataclass(frozen=True)
class LightInDoubt:
    """A render whose own error is larger than the noise that readings are given.

    Parameters
    ----------
    readings, of : int
        Readings at which it is, and all of them.
    light_error_percent, noise_percent : float
        Medians there, of the reading.
    photons : float
        By which it would be smaller nearly everywhere: the error falls by the root of their number.
    """

    readings: int
    of: int
    light_error_percent: float
    noise_percent: float
    photons: float

    def __str__(self) -> str:
        """One sentence, with the remedy."""
        return (
            f"at {self.readings} of {self.of} readings the render's own error, "
            f"{self.light_error_percent:.2g} %, is larger than the noise, {self.noise_percent:.2g} % "
            f"(medians there); it is stated with their errors; remedy: more photons, about {self.photons:.0e}"
        )

    def as_data(self) -> dict[str, float]:
        """The same as numbers."""
        return asdict(self)


def in_doubt(
    light: LightAtReadings, instrument: Instrument, shown: Array, photons: float
) -> LightInDoubt | None:
    """Whether a render with so many photons is worse than the noise at more than a few readings.

    Parameters
    ----------
    shown : array, shape (n,)
        Readings without noise.
    """
    own, noise = light.relative_error * shown, instrument.sigma(shown)
    worse = own > noise
    if worse.mean() <= _SELDOM:
        return None
    of_light, of_noise = (float(np.median(100 * e[worse] / shown[worse])) for e in (own, noise))
    enough = photons * float(np.quantile(own / noise, 1 - _SELDOM, method="higher")) ** 2
    return LightInDoubt(int(worse.sum()), len(shown), of_light, of_noise, enough)


def rendered(
    truth: Scene, table: Readings, noise: float, rng: np.random.Generator, max_photons: float = MADE_PHOTONS
) -> LightAtReadings:
    """The full render at the places of a table, with an error that is small beside the noise."""
    light, stderr = rendered_light(
        truth,
        table,
        seed=int(rng.integers(1, 1_000_000)),
        rel_error=_ERROR_OF_NOISE * noise,
        max_photons=max_photons,
        symmetry=True,
    )
    return LightAtReadings(light, stderr)


def measure(
    truth: Scene,
    table: Readings,
    light: LightAtReadings,
    instrument: Instrument,
    rng: np.random.Generator,
    factor: Array | float = 1.0,
) -> tuple[Readings, Array]:
    """Take the readings of a scene.

    What the render does not know of the light is an error of the readings, and stated with theirs. (Places
    that are mirror images of each other share it; so it is kept small beside the noise.)

    Parameters
    ----------
    table : Readings
        Positions and times.
    light : LightAtReadings
        That of the scene at these places.
    factor : array, shape (n,)
        Unknown influences on the light.

    Returns
    -------
    readings : Readings
    noise_free : array, shape (n,)
    """
    bright, layout = light.value * factor, layout_of(table)
    clean = _noise_free(truth, table, bright)
    n, visits = len(clean), int(layout.visit.max()) + 1
    shown = clean * (1 + instrument.plane_gain * rng.standard_normal(visits)[layout.visit])
    if instrument.position_m > 0:
        shown = shown * _displaced(truth, table, light.value, instrument.position_m, rng)
    if layout.common.any():
        shown = shown * (1 + layout.common * rng.standard_normal(n)[layout.spectrum])
    sigma = instrument.sigma(shown)
    error = _in_sigma(instrument, layout, rng)
    quoted = sigma * np.sqrt(rng.chisquare(SAMPLES - 1, n) / (SAMPLES - 1))
    stderr = np.sqrt(quoted**2 + (light.relative_error * shown) ** 2 + (layout.common * shown) ** 2)
    made = replace(table, value=shown + sigma * error, stderr=stderr, warnings=())
    return replace(made, warnings=tuple(load_warnings(made))), clean


def _noise_free(truth: Scene, table: Readings, bright: Array) -> Array:
    """Readings of the scene's readout without errors, about 1 at most, shape (n,)."""
    forward = SceneForward(truth, table, full=1.0)
    gains = dict.fromkeys(forward.gains.names, 1.0 / float((bright * forward.reader.power({})).max()))
    # Saturation is stated relative to the largest reading, which itself is saturated.
    full = 1.0
    for _ in range(60):
        clean = SceneForward(truth, table, full=full).reader.read(bright, gains)
        full, before = float(clean.max()), full
        if full == before:  # nothing moves any more; without saturation the second time
            break
    return clean


def _in_sigma(instrument: Instrument, layout: Layout, rng: np.random.Generator) -> Array:
    """Errors in units of their standard deviation, shape (n,)."""
    error, serial = rng.standard_normal(layout.size), instrument.serial
    for previous, now in zip(layout.order[:-1], layout.order[1:], strict=True):
        error[now] = serial * error[previous] + np.sqrt(1 - serial**2) * error[now]
    gross = rng.random(layout.size) < instrument.outliers
    return error + gross * rng.choice([-1, 1], layout.size) * rng.uniform(6, 30, layout.size)


def _displaced(
    truth: Scene, table: Readings, light: Array, position_m: float, rng: np.random.Generator
) -> Array:
    """Light a few millimetres off over `light` at the stated place.

    Direct and scattered light move; what walls and surface reflect varies over longer ways.
    """
    here = [table.x_m, table.y_m, table.z_m]
    _, first, moment = np.unique(table.time_s, return_index=True, return_inverse=True)
    place = np.argsort(np.argsort(first))[moment]  # all wavelengths of one moment share it
    there = [c + position_m * rng.standard_normal(len(first))[place] for c in here]
    one, other = (
        direct_field(truth, x, y, z, table.wavelength_nm, table.medium, table.time_s)
        for x, y, z in (here, there)
    )
    moved = other - one + _scattered_moves(truth, table, there, np.maximum(light - one, 0.0))
    whole = np.maximum(light, one)  # where nothing is read, nothing moves
    return 1 + np.divide(moved, whole, out=np.zeros_like(one), where=whole > 0)


def _scattered_moves(truth: Scene, table: Readings, there: Sequence[Array], diffuse: Array) -> Array:
    """By how much scattered light is more at other places, shape (n,): as without photons, of what there is.

    Of beams and receivers for which that is not known, by its fall with the distance.

    Parameters
    ----------
    diffuse : array, shape (n,)
        Scattered and reflected light at the places of the table.
    """
    n, here = len(diffuse), (table.x_m, table.y_m, table.z_m)
    wave = np.where(np.isnan(table.wavelength_nm), np.mean(truth.detector.bands_nm[0]), table.wavelength_nm)
    channels, channel = np.unique(wave, return_inverse=True)
    wet = (np.asarray(table.medium) != "air") & (np.minimum(table.z_m, there[2]) > 0)
    if not (scattering_per_m(truth.water, channels) > 0).any():
        return np.zeros(n)
    if not describes(lit(truth)):
        near, far = (np.where(wet, z, 1.0) for z in (table.z_m, there[2]))
        lost = absorption_per_m(truth.water, channels)[channel] * (far - near)
        return np.asarray(diffuse * ((near / far) ** 2 * np.exp(-lost) - 1))
    # All from the same nodes: what is interpolated between them is a little off at both alike.
    x, y, z = (
        np.concatenate([np.where(wet, v, 1.0) for v in both]) for both in zip(here, there, strict=True)
    )
    light = ScatteredField(x, y, z).light(lit(truth), list(channels.tolist()))
    one, other = (light[channel, rows] for rows in (np.arange(n), np.arange(n, 2 * n)))
    growth = np.divide(other, one, out=np.ones(n), where=wet & (one > 0)) - 1
    return np.asarray(np.minimum(diffuse, one) * growth)
