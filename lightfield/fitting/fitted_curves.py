"""The curves that a fit has found, as people look at them, with their errors."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from lightfield.arrays import Array
from lightfield.decompositions import eigen
from lightfield.fitting.beam_width import beam_width_deg
from lightfield.fitting.curves import (
    ABSORPTION,
    AMBIENT,
    BACKGROUND,
    BEYOND,
    COLOUR,
    HALO,
    PLANES,
    POWER,
    PROFILE,
    SPECTRUM,
    field_of,
)
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit
from lightfield.formula.closed_form import table_angle
from lightfield.formula.path import attenuation_per_m
from lightfield.formula.readout import ambient, plane_gain, time_factor
from lightfield.scene import Scene
from lightfield.scene.lamp.profile import radial_intensity
from lightfield.scene.lamp.spectrum import spectral_power
from lightfield.scene.lamp.tabulated import save_intensity, save_power
from lightfield.scene.water.coefficients import scattering_per_m
from lightfield.scene.water.layers import layers_absorption_per_m
from lightfield.storage.files import output_file

#: Places at which a curve is drawn. Chosen: twice its nodes.
PLACES = 121
#: Errors of a fitted lamp below this part of the largest are left out of its table. Chosen: words alone.
_HARDLY = 1e-3
#: Angles farther from the axis than this part of the half width are not on it. Chosen.
_OFF_AXIS = 0.1
#: The table of a fitted beam profile, beside the scene that was fitted.
LAMP_TABLE = "lamp.csv"
#: The table of a fitted spectrum of the lamp, there too.
SPECTRUM_TABLE = "lamp_spectrum.csv"


@dataclass(frozen=True)
class FittedCurve:
    """One curve of a fit.

    Parameters
    ----------
    field : str
        Dotted path of the scene's curve.
    coordinate, quantity : str
        Names with units, for axes.
    at : array, shape (n,)
        deg, m, s or nm, as far as the readings reach; of planes their distances.
    value, stderr : array, shape (n,)
        Intensity over that on the axis, or next to it where that was not read, attenuation in 1/m, relative
        lamp power or in W/nm, gain, or reading.
    without : array, shape (n,)
        The same without the departure.
    rms : float
        Weighted rms of what the departure changes in the logarithm of the readings.
    """

    field: str
    coordinate: str
    quantity: str
    at: Array
    value: Array
    stderr: Array
    without: Array
    rms: float

    def as_data(self) -> dict[str, str | float | list[float]]:
        """What JSON holds."""
        columns = {"at": self.at, "value": self.value, "stderr": self.stderr, "without": self.without}
        words = {"field": self.field, "coordinate": self.coordinate, "quantity": self.quantity}
        return {**words, "rms": self.rms, **{name: column.tolist() for name, column in columns.items()}}


def _intensity(scene: Scene, angle_deg: Array, over_deg: float = 0.0) -> Array:
    """Over that at one of the angles, the axis unless given."""
    light = radial_intensity(scene.lamp, np.radians(np.concatenate([[over_deg], angle_deg])) ** 2)
    return light[1:] / light[0]


def _known_deg(forward: SceneForward, scene: Scene) -> float:
    """The axis, or the angle nearest to it that was read where that is far off: over what nobody read all
    intensities are as uncertain as that is."""
    r = forward.readings
    wet = table_angle(scene.lamp, r.x_m, r.y_m, r.z_m, r.medium)
    nearest = float(np.degrees(wet[~np.asarray(r.saturated, bool)].min()))
    return nearest if nearest > _OFF_AXIS * beam_width_deg(scene, r) else 0.0


def _attenuation(scene: Scene, z_m: Array) -> Array:
    middle = 0.5 * sum(scene.detector.bands_nm[0])
    uniform = np.asarray(attenuation_per_m(scene.water, None, middle), float)
    return uniform + layers_absorption_per_m(scene.water, z_m)


def _colour(scene: Scene, wavelength_nm: Array) -> Array:
    return np.asarray(attenuation_per_m(scene.water, wavelength_nm))


def _scattering(scene: Scene, wavelength_nm: Array) -> Array:
    return scattering_per_m(scene.water, wavelength_nm)


def _power_per_nm(scene: Scene, wavelength_nm: Array) -> Array:
    return spectral_power(scene.lamp, wavelength_nm)


def _plane_gain(scene: Scene, z_m: Array) -> Array:
    return plane_gain(scene, z_m) * np.ones(z_m.size)


def _background(scene: Scene, wavelength_nm: Array) -> Array:
    return ambient(scene, None, wavelength_nm) * np.ones(wavelength_nm.size)


def _ambient(scene: Scene, time_s: Array) -> Array:
    return ambient(scene, time_s) * np.ones(time_s.size)


_SHOWN: dict[str, tuple[str, str, Callable[[Scene, Array], Array]]] = {
    PROFILE: ("angle from the beam's axis (deg)", "intensity / that on the axis", _intensity),
    ABSORPTION: ("z (m)", "attenuation K (1/m)", _attenuation),
    POWER: ("time (s)", "relative lamp power", time_factor),
    SPECTRUM: ("wavelength (nm)", "lamp power (W/nm)", _power_per_nm),
    COLOUR: ("wavelength (nm)", "attenuation K (1/m)", _colour),
    HALO: ("wavelength (nm)", "scattering b (1/m)", _scattering),
    PLANES: ("z (m)", "gain of the plane", _plane_gain),
    BACKGROUND: ("wavelength (nm)", "reading without the lamp", _background),
    AMBIENT: ("time (s)", "reading without the lamp", _ambient),
}


def changed_rms(forward: SceneForward, values: Mapping[str, float], field: str) -> float:
    """Weighted rms of what a curve changes in the logarithm of the readings.

    Parameters
    ----------
    forward : SceneForward
        Whose readings made the functions of the curve.
    values : mapping of str to float
        Of a fit.
    field : str
        Dotted path of the scene's curve.
    """
    basis = forward.scenes.curves.bases[field]
    if field != HALO:
        return basis.rms(values)
    # Of scattering an amplitude says how the coefficient changes, of which the readings are no multiple.
    flat = {k: v for k, v in values.items() if field_of(k) != field}
    changed = (forward.predict(values) - forward.predict(flat)) / forward.scenes.curves.light
    return float(np.sqrt(np.average(changed**2, weights=forward.scenes.curves.weight)))


def fitted_curves(
    forward: SceneForward, fit: Fit, scale: float = 1.0, widest: Fit | None = None
) -> tuple[FittedCurve, ...]:
    """Every curve whose amplitudes a fit moves, with standard errors.

    They hold the noise of all that is moved, how far the curve with most functions lies from it, and what is
    finer than these, see `_with_finer`: a cloud that is narrower than planes are apart is flatter in a curve.

    Parameters
    ----------
    forward : SceneForward
        Whose readings made the functions of the curves.
    scale : float
        Variance of the readings in units of the whitening.
    widest : Fit, optional
        The same with as many functions of each curve as there are; else it has those.
    """
    curves = forward.scenes.curves
    moved = {field_of(path) for path in fit.paths} & _SHOWN.keys()
    if not moved:
        return ()
    widest = fit if widest is None else widest
    covariance, values = _with_finer(widest, scale), fit.values
    found = forward.scenes.at(values, validate=False)
    flat = {k: v for k, v in values.items() if field_of(k) not in moved}
    out = []
    for field in (field for field in _SHOWN if field in moved):
        coordinate, quantity, shown = _SHOWN[field]
        if field == PROFILE and (over := _known_deg(forward, found)):
            quantity, shown = f"intensity / that at {over:.2g} deg", partial(_intensity, over_deg=over)
        place = curves.bases[field].place
        at = np.linspace(place[0], place[-1] / (BEYOND if field == PROFILE else 1.0), PLACES)
        at = place if field == PLANES else at
        value = shown(found, at)
        wide, slopes = _with_slopes(forward, widest, shown, at)
        variance = np.maximum(np.einsum("ij,jk,ik->i", slopes, covariance, slopes), 0.0)
        stderr = np.sqrt(variance + (wide - value) ** 2)
        without = shown(forward.scenes.at(flat, validate=False), at)
        rms = changed_rms(forward, values, field)
        out.append(FittedCurve(field, coordinate, quantity, at, value, stderr, without, rms))
    return tuple(out)


def _with_finer(fit: Fit, scale: float) -> Array:
    """Covariance of what a fit moves, as if of curves over angle, distance and time two functions more were
    as large as the last two.

    They are counted as errors of these, which between them leave no place out.
    """
    covariance = fit.covariance_within_ranges(scale)
    for field in {field_of(path) for path in fit.paths} & {PROFILE, ABSORPTION, POWER, AMBIENT}:
        mine = {
            int(path.rpartition(".")[2]): i for i, path in enumerate(fit.paths) if field_of(path) == field
        }
        last = [mine[k] for k in sorted(mine)[-2:]]
        covariance[last, last] += float(np.sum(fit.u[last] ** 2))
    return covariance


def _with_slopes(
    forward: SceneForward, fit: Fit, shown: Callable[[Scene, Array], Array], at: Array
) -> tuple[Array, Array]:
    """A curve of a fit, shape (n,), and its slopes by the coordinates of the fit, (n, n_parameters)."""
    values = fit.values
    value = shown(forward.scenes.at(values, validate=False), at)
    slopes = np.empty((len(at), len(fit.u)))
    for i, parameter in enumerate(fit.model.parameters):
        there = {**values, parameter.path: parameter.value(fit.u[i] + parameter.step)}
        slopes[:, i] = (shown(forward.scenes.at(there, validate=False), at) - value) / parameter.step
    return value, slopes


def _lamp_errors(
    forward: SceneForward, fit: Fit, widest: Fit, scale: float, at_deg: Array, read_deg: float
) -> Array:
    """What the intensity of a fitted lamp may be off by, over that on the axis: independent curves, (k, n).

    Beyond the last angle that was read it is a guess, which may be all wrong where the fit's curve ends.
    """
    value = _intensity(forward.scenes.at(fit.values, validate=False), at_deg)
    wide, slopes = _with_slopes(forward, widest, _intensity, at_deg)
    variance, directions = eigen(_with_finer(widest, scale))
    errors = slopes @ (directions * np.sqrt(np.maximum(variance, 0.0)))
    _, size, curves = np.linalg.svd(errors.T, full_matrices=False)
    kept = size > _HARDLY * size.max(initial=0.0)
    guess = value * np.clip((at_deg / read_deg - 1) / (BEYOND - 1), 0.0, 1.0)
    return np.vstack([size[kept, None] * curves[kept], wide - value, guess])


def save_lamp(
    forward: SceneForward,
    fit: Fit,
    folder: str | os.PathLike[str],
    scale: float = 1.0,
    widest: Fit | None = None,
) -> Path | None:
    """Write the beam profile of a fit as a lamp table (`profile = "table"`) with its errors.

    None where none was fitted.

    Parameters
    ----------
    folder : path-like
        Gets lamp.csv.
    scale : float
        Variance of the readings in units of the whitening.
    widest : Fit, optional
        See `fitted_curves`.

    Raises
    ------
    OutputError
        The file cannot be written, or the scene reads it.
    """
    curves = forward.scenes.curves
    if PROFILE not in {field_of(p) for p in fit.paths}:
        return None
    to_deg = float(curves.bases[PROFILE].place[-1])
    read_deg = to_deg / BEYOND
    remark = f"fitted to readings within {read_deg:.3g} deg of the axis; beyond it is a guess"

    def errors(at_deg: Array) -> Array:
        return _lamp_errors(forward, fit, fit if widest is None else widest, scale, at_deg, read_deg)

    path = output_file(Path(folder) / LAMP_TABLE, *forward.scenes.scene.tables)
    return save_intensity(forward.scenes.at(fit.values).lamp, to_deg, path, remark, errors)


def save_spectrum(forward: SceneForward, fit: Fit, folder: str | os.PathLike[str]) -> Path | None:
    """Write the lamp's spectrum of a fit as a table (`spectrum = "table"`); None where none was fitted.

    Parameters
    ----------
    folder : path-like
        Gets lamp_spectrum.csv, whose head says the power that goes with it.

    Raises
    ------
    OutputError
        The file cannot be written, or the scene reads it.
    """
    curves = forward.scenes.curves
    if SPECTRUM not in {field_of(p) for p in fit.paths}:
        return None
    place = curves.bases[SPECTRUM].place
    remark = f"fitted to readings from {place[0]:g} to {place[-1]:g} nm; beyond them it is a guess"
    path = output_file(Path(folder) / SPECTRUM_TABLE, *forward.scenes.scene.tables)
    return save_power(forward.scenes.at(fit.values).lamp, path, remark)
