"""Which band of wavelengths serves best, for a lamp, a water and a detector.

    signal       S(band, z) = sum over the band of  L(lambda) R(lambda) exp(-c z) (1 + f)
    noise        SNR^2 = N^2 / (N + r^2 + (m N)^2),  N electrons, r read noise, m gain mismatch
    information  J = SNR^2 (2 / z + K)^2            about the distance z from the size of a signal

The paper chooses the band of least attenuation. It is not that of most signal, for the lamp and the detector
have a say, nor that of most information about distance, for which attenuation is of use.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from scipy.integrate import cumulative_trapezoid

from lightfield.arrays import TINY, Array
from lightfield.errors import SceneError, UsageError
from lightfield.formula.closed_form import direct_field
from lightfield.render.at_readings import render_positions
from lightfield.render.settings import CachedTracing
from lightfield.scene import Detector, Scene
from lightfield.scene.lamp.spectrum import axial_intensity, knots_nm
from lightfield.scene.spectral.detector_response import SILICON
from lightfield.scene.tank import walls_m
from lightfield.scene.water.coefficients import is_grey, scattering_per_m
from lightfield.storage.tables import read_columns
from lightfield.studies import defaults
from lightfield.studies.light_at import FARTHEST_M, refuse_dark_light

if TYPE_CHECKING:
    from typing_extensions import Unpack

#: The band of the tow tank experiment, nm.
PAPER_BAND = (500.0, 550.0)
CRITERIA = {
    "attenuation": "least attenuation",
    "signal": "most signal",
    "information": "most information about range",
}
#: Steps of bands, of the light that arrives (as tables of water have), and of what the lamp gives and the
#: detector sees, nm.
_STEP_NM, _LIGHT_NM, _FINE_NM = 5.0, 2.5, 0.25
#: Attenuation is the slope over this part of a distance to either side.
_SLOPE = 0.1
#: Clearest water's attenuation times this is "flat".
FLAT = 1.25
#: What a detector counts of its brightest band in one reading, and spreads of gains.
ELECTRONS, MISMATCH = (1.0, 1e18), (0.0, 10.0)
#: Attenuation of the water taken wrong by this part, for what that does to a distance.
WRONG = 0.10


@dataclass(frozen=True)
class BestBand:
    """The best band at one distance by one criterion.

    Parameters
    ----------
    z_m : float
    criterion : str
        One of `CRITERIA`.
    low_nm, high_nm : float
    scene_share : float
        What the scene's first band has of the best value (for attenuation: the best over that band's; NaN
        where the least is not above nothing by its error, as where walls send back what the water takes).
    scene_share_stderr : float
        By the traced light.
    """

    z_m: float
    criterion: str
    low_nm: float
    high_nm: float
    scene_share: float
    scene_share_stderr: float


@dataclass(frozen=True, eq=False)
class Bands:
    """The answer.

    Parameters
    ----------
    spectrum : xarray.Dataset
        Over (z_m, wavelength_nm): `attenuation`, `attenuation_stderr`, `signal` per nm over its largest.
    bands : xarray.Dataset
        Over (z_m, low_nm): `attenuation`, `signal`, `snr`, `information`, `range_error_m`.
    best : tuple of BestBand
    width_nm : float
    """

    spectrum: xr.Dataset
    bands: xr.Dataset
    best: tuple[BestBand, ...]
    width_nm: float
    scene: Scene

    @property
    def is_grey(self) -> bool:
        """Is the water the same at all wavelengths, so that it has no best band?"""
        return is_grey(self.scene.water)

    @property
    def scene_band_nm(self) -> tuple[float, float]:
        """The scene's first band, with which the best are compared, nm."""
        return self.scene.detector.bands_nm[0]

    @property
    def within_nm(self) -> tuple[float, float]:
        """From where to where bands were compared, nm."""
        return float(self.bands.low_nm.values[0]), float(self.bands.high_nm.values[-1])

    def flat_nm(self) -> tuple[float, float]:
        """Wavelengths next to the clearest between which attenuation is within a quarter of the least, nm.

        At the nearest distance.
        """
        K, at = self.spectrum.attenuation.values[0], self.spectrum.wavelength_nm.values
        low = high = int(np.argmin(K))
        while low > 0 and K[low - 1] < FLAT * K.min():
            low -= 1
        while high < len(K) - 1 and K[high + 1] < FLAT * K.min():
            high += 1
        return float(at[low]), float(at[high])


@dataclass(frozen=True)
class CountNoise:
    """Noise of what a detector counts.

    Parameters
    ----------
    electrons : float
        That the brightest band gives at the nearest distance in one reading.
    read_noise : float
        Electrons.
    mismatch : float
        Relative standard deviation of gains.

    Raises
    ------
    UsageError
        Numbers that make no sense.
    """

    electrons: float = defaults.ELECTRONS
    read_noise: float = defaults.READ_NOISE
    mismatch: float = defaults.MISMATCH

    def __post_init__(self) -> None:
        for name, (low, high), unit in (
            ("electrons", ELECTRONS, " electrons"), ("read_noise", (0.0, ELECTRONS[1]), " electrons"),
            ("mismatch", MISMATCH, ""),
        ):  # fmt: skip
            if not low <= getattr(self, name) <= high:
                raise UsageError(
                    "impossible noise",
                    where=name,
                    found=getattr(self, name),
                    rule=f"{low:g} to {high:g}{unit}",
                )

    def signal_to_noise(self, count: Array) -> Array:
        """Of so many electrons."""
        return np.asarray(count / np.sqrt(count + self.read_noise**2 + (self.mismatch * count) ** 2))


def best_band(
    scene: Scene,
    traced: bool = True,
    noise: CountNoise | None = None,
    *,
    distances_m: Sequence[float] | None = None,
    width_nm: float = defaults.WIDTH_NM,
    low_nm: float = defaults.BETWEEN_NM[0],
    high_nm: float = defaults.BETWEEN_NM[1],
    response: str | None = None,
    **tracing: Unpack[CachedTracing],
) -> Bands:
    """Compare all bands of a width.

    Parameters
    ----------
    scene : Scene
        Lamp spectrum, water, receiver.
    traced : bool
        False: direct light alone, K = c.
    distances_m : sequence of float, optional, m
        Default: the scene's first and last plane, or position.
    width_nm, low_nm, high_nm : float, nm
        Width of the bands, and where they may lie.
    response : str, optional
        CSV (wavelength_nm, response) of the detector; default: the scene's, or a typical silicon photodiode.
    **tracing
        Of `lightfield.render.maps.render_scene`: rel_error, max_photons, seed, cache.

    Raises
    ------
    UsageError
        Numbers that make no sense.
    SceneError
        A water, lamp or detector that is not known at these wavelengths, or in the scene's first band.
    """
    read = scene.detector.distances_m
    z = np.unique(np.asarray(distances_m or (read[0], read[-1]), float))
    _check(z, width_nm, low_nm, high_nm)
    own = scene.detector.bands_nm[0]
    first, last = min(low_nm, own[0]), max(high_nm, own[1])
    # At whole steps, where tables of water have their rows.
    begin = math.ceil(first / _LIGHT_NM) * _LIGHT_NM
    at = np.unique([first, *np.arange(begin, last, _LIGHT_NM), last])
    x, y = (np.full(len(z), v) for v in (scene.lamp.offset_x_m, scene.lamp.offset_y_m))
    brightest = np.max([direct_field(scene, x, y, z, np.full(len(z), w)) for w in at], axis=0)
    refuse_dark_light(z, brightest, where="distances", remedy="ask for nearer distances")
    light, K, K_stderr = _transmitted(scene, traced, z, at, tracing)
    refuse_dark_light(z, light.max(axis=1), where="distances", remedy="ask for nearer distances")

    def seen(wavelength_nm: Array) -> Array:
        given = axial_intensity(scene.lamp, wavelength_nm)
        return np.asarray(given * responsivity(response, scene.detector, wavelength_nm))

    lows = np.arange(low_nm, high_nm - width_nm, _STEP_NM)
    lows = np.concatenate([lows, [high_nm - width_nm, own[0]]])
    highs = np.append(lows[:-1] + width_nm, own[1])
    fine = np.concatenate([np.arange(first, last, _FINE_NM), knots_nm(scene.lamp), at, lows, highs])
    fine = np.unique(fine[(fine >= first) & (fine <= last)])
    what = seen(fine), np.ones_like(fine)
    if not (what[0][(fine >= low_nm) & (fine <= high_nm)] > 0).any():
        raise SceneError(
            "the lamp gives no light that the detector sees", found=f"{low_nm:g} to {high_nm:g} nm"
        )
    whole, step = (shares_of(at, fine, each, at[:1], at[-1:]) for each in what)
    per_nm = light * whole / step  # [distances, wavelengths], means over a step: lines are narrower
    spectrum = xr.Dataset(
        {
            "attenuation": (("z_m", "wavelength_nm"), K, {"units": "m-1"}),
            "attenuation_stderr": (("z_m", "wavelength_nm"), K_stderr, {"units": "m-1"}),
            "signal": (("z_m", "wavelength_nm"), per_nm / per_nm.max(axis=1, keepdims=True)),
        },
        coords={"z_m": z, "wavelength_nm": at},
    )
    shares = shares_of(at, fine, what[0], lows, highs), shares_of(at, fine, what[1], lows, highs)
    bands = _bands(spectrum, light, (lows, highs), shares, noise or CountNoise())
    return Bands(spectrum, bands.isel(low_nm=slice(-1)), tuple(_best(bands, width_nm)), width_nm, scene)


def _check(z: Array, width_nm: float, low_nm: float, high_nm: float) -> None:
    """Refuse distances and bands that cannot be asked about."""
    if not ((z > 0) & (z <= FARTHEST_M)).all():
        raise UsageError(
            "impossible distances", found=z.tolist(), rule=f"above 0 m, at most {FARTHEST_M:g} m"
        )
    if not (0 < low_nm < high_nm < np.inf and _STEP_NM <= width_nm <= high_nm - low_nm):
        raise UsageError(
            "impossible bands", where="width and range of the bands",
            found=f"{width_nm:g} nm wide between {low_nm:g} and {high_nm:g} nm",
            rule=f"at least {_STEP_NM:g} nm wide, and no wider than the range they lie in",
            remedy="change the width, or the range",
        )  # fmt: skip


def _transmitted(
    scene: Scene, traced: bool, z: Array, at: Array, tracing: CachedTracing
) -> tuple[Array, Array, Array]:
    """Light at each distance for unit intensity, the slope K of ln(light z^2) and its error, (n_z, n)."""
    wall = walls_m(scene.tank)[2][1]
    if z.max() >= wall:
        raise UsageError(
            "a distance outside the tank", found=f"{z.max():g} m", rule=f"less than {wall:g} m",
            remedy="ask for nearer distances; the scene's planes are asked about where none are given",
        )  # fmt: skip
    step = np.minimum(_SLOPE, 0.5 * (wall / z - 1))  # half way to the wall, where that is nearer
    places = np.concatenate([z * (1 - step), z, z * (1 + step)])
    x, y = (np.full(len(places), v) for v in (scene.lamp.offset_x_m, scene.lamp.offset_y_m))
    if traced and ((scattering_per_m(scene.water, at) > 0).any() or scene.reflects):
        listed = {
            "positions_m": tuple(zip(x.tolist(), y.tolist(), places.tolist(), strict=True)),
            "bands_nm": ((float(at[0]), float(at[-1])),),
        }
        there = scene.model_copy(update={"detector": scene.detector.model_copy(update=listed)})
        light, error = (v.T for v in render_positions(there, **tracing).relative(at))
    else:
        light = np.array([direct_field(scene, x, y, places, np.full(len(x), w)) for w in at]).T
        error = np.zeros_like(light)
    ln = np.log(np.maximum(light, TINY)) + 2 * np.log(places)[:, None]
    near, _, far = np.split(ln, 3)
    first, _, last = np.split(error / np.maximum(light, TINY), 3)
    width = (2 * step * z)[:, None]
    return np.split(light, 3)[1], (near - far) / width, np.hypot(first, last) / width


def _bands(
    spectrum: xr.Dataset,
    light: Array,
    edges: tuple[Array, Array],
    shares: tuple[Array, Array],
    noise: CountNoise,
) -> xr.Dataset:
    """What every band gives at every distance; the last is the scene's own.

    Parameters
    ----------
    light : array, shape (n_distances, n_wavelengths)
    edges : pair of arrays, shape (n_bands,), nm
        Lower and upper.
    shares : pair of arrays, shape (n_bands, n_wavelengths)
        See `shares_of`: of what is seen, and of the wavelengths alike.
    """
    z, (seen, alike), (lows, highs) = spectrum.z_m.values, shares, edges
    signal = light @ seen.T  # [distances, bands]
    weight = light[:, None, :] * seen
    weight = np.where(weight.any(axis=2, keepdims=True), weight, alike)  # no light: all alike
    total = weight.sum(axis=2)
    K, error = (
        (weight * spectrum[name].values[:, None, :]).sum(axis=2) / total
        for name in ("attenuation", "attenuation_stderr")
    )
    most = signal[:, :-1].max(axis=1, keepdims=True)
    snr = noise.signal_to_noise(noise.electrons * signal / most[0])
    slope = 2 / z[:, None] + K
    dims = ("z_m", "low_nm")
    return xr.Dataset(
        {
            "attenuation": (dims, K, {"units": "m-1"}),
            "attenuation_stderr": (dims, error, {"units": "m-1"}),
            "signal": (dims, signal / most),
            "snr": (dims, snr),
            "information": (dims, (snr * slope) ** 2, {"units": "m-2"}),
            "range_error_m": (dims, WRONG * K * z[:, None] / slope, {"units": "m"}),
        },
        coords={"z_m": z, "low_nm": lows, "high_nm": ("low_nm", highs)},
    )


def _best(bands: xr.Dataset, width: float) -> list[BestBand]:
    """The best of every criterion at every distance, the scene's own (the last) aside."""
    found = []
    for k, z in enumerate(bands.z_m.values):
        row = bands.isel(z_m=k)
        for name in CRITERIA:
            values, K, error = (row[n].values for n in (name, "attenuation", "attenuation_stderr"))
            others, own = values[:-1], values[-1]
            best = int(np.argmin(others) if name == "attenuation" else np.argmax(others))
            with np.errstate(divide="ignore", invalid="ignore"):
                share = float(others[best] / own if name == "attenuation" else own / others[best])
            # Traced light errs alike in all bands: the difference is left of it.
            if name == "attenuation" and not (K[best] > error[best] and K[-1] > 0):
                share = stderr = float("nan")
            elif name == "attenuation":
                stderr = share * abs(float(error[best] / K[best] - error[-1] / K[-1]))
            else:  # by its part of K, which is all of it at most
                part = error[best] / max(abs(K[best]), error[best]) if error[best] > 0 else 0.0
                stderr = share * abs(float(K[best] - K[-1])) * float(z * part)
            low = float(row.low_nm.values[best])
            found.append(BestBand(float(z), name, low, low + width, share, stderr))
    return found


def shares_of(at: Array, fine: Array, seen: Array, lows: Array, highs: Array) -> Array:
    """What each wavelength stands for in every band, shape (n_bands, n_wavelengths).

    The integral over a band of what is seen, times what is one at a wavelength, none at the others and linear
    between.

    Parameters
    ----------
    at : array, shape (n_wavelengths,), nm
        Rising.
    fine, seen : array, shape (n,), nm
        Edges of bands and much between, with what is seen there.
    """
    hats = np.stack([np.interp(fine, at, each) for each in np.eye(len(at))], axis=1)
    summed = cumulative_trapezoid(seen[:, None] * hats, fine, axis=0, initial=0.0)
    low, high = (np.searchsorted(fine, edge) for edge in (lows, highs))
    return np.asarray(summed[high] - summed[low])


def responsivity(path: str | None, detector: Detector, at: Array) -> Array:
    """Response at wavelengths, in any unit: of a table, the scene's, or that of silicon."""
    if path is None:
        return np.interp(at, *SILICON) if detector.response is None else detector.spectral_response.at(at)
    try:
        known, response = read_columns(path, ("wavelength_nm", "response"))
    except OSError as error:
        raise SceneError(
            error.strerror or "cannot be read", where=path, rule="a CSV file", remedy="correct the path"
        ) from error
    return np.interp(at, known, response, left=0.0, right=0.0)
