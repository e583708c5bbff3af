"""Wavelength bands: where the water is asked in them, and how much of the lamp's light lies there."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.errors import SceneError, UsageError
from lightfield.scene.detector import Detector
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.lamp.spectrum import axial_intensity, knots_nm
from lightfield.scene.lamp.tabulated import FIRST_NM, LAST_NM, STEP_NM
from lightfield.scene.scene import Scene
from lightfield.scene.water.coefficients import (
    absorption_per_m,
    is_grey,
    known_nm,
    molecular_per_m,
    scattering_per_m,
)

#: Equal parts of a band at least, over each of which the water is taken to be the same; and at most, one for
#: a nanometre of a band.
_PIECES, _FINEST_NM = 5, 1.0
#: Within a part the optical depth of the farthest plane changes by this at most: the light of the steepest is
#: right to 4e-3 (the square over 24), that of a band to less (test_bands.py).
_MOST_CHANGE = 0.3
#: Part of a spectrum's peak that no instrument sees.
_LEAST_LIT = 1e-12
#: Wavelengths that an error lists.
_TOLD = 4
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)


class BandLight(NamedTuple):
    """Light that stands for bands: its mean over a band is the mean over the last axis.

    Parameters
    ----------
    wavelength_nm : array, shape (n_bands, n), nm
    intensity : array, same shape, W/(sr nm)
        Mean radiant intensity on the beam's axis over the part of the band (W/nm of a pencil beam).
    """

    wavelength_nm: Array
    intensity: Array


def read_nm(scene: Scene, wavelength_nm: ArrayLike) -> Array:
    """Wavelengths that are read where so many are stated, nm: the detector's shift, but no farther than what
    the water's base is known for."""
    stated = np.asarray(wavelength_nm, float)
    if not scene.detector.wavelength_shift_nm:
        return stated
    low, high = known_nm(scene.water)
    shifted = stated + scene.detector.wavelength_shift_nm
    return np.asarray(np.clip(shifted, np.minimum(low, stated), np.maximum(high, stated)))


def pieces(scene: Scene) -> int:
    """Equal parts of every band in which the water is as good as the same, up to the farthest detector."""
    if is_grey(scene.water):
        return _PIECES
    far, most = scene.detector.distances_m[-1], _PIECES
    for low, high in scene.detector.bands_read_nm:
        at = np.linspace(low, high, max(_PIECES, math.ceil((high - low) / _FINEST_NM)) + 1)
        asked = np.clip(at, *known_nm(scene.water))
        depth = far * (absorption_per_m(scene.water, asked) + scattering_per_m(scene.water, asked))
        change = float(np.abs(np.diff(depth)).max()) / (at[1] - at[0])
        most = max(most, min(math.ceil((high - low) * change / _MOST_CHANGE), len(at) - 1))
    return most


def middles_nm(scene: Scene) -> Array:
    """Middles of `_PIECES` equal parts of every band as it is read, shape (n_bands, _PIECES), nm."""
    return _middles(scene.detector.bands_read_nm)


@lru_cache(64)
def _middles(bands_nm: tuple[tuple[float, float], ...]) -> Array:
    bands = np.asarray(bands_nm, float)
    at = (np.arange(_PIECES) + 0.5) / _PIECES
    found = np.asarray(bands[:, :1] + (bands[:, 1:] - bands[:, :1]) * at)
    found.setflags(write=False)
    return found


def molecular_share(scene: Scene) -> float:
    """Part of the scattering coefficient that is molecular in the middle of the scene's bands."""
    if scene.water.base != "pure":
        return 0.0
    at = np.asarray(scene.detector.bands_read_nm, float).mean()
    return float(molecular_per_m(scene.water, at) / scattering_per_m(scene.water, at))


def over_bands(scene: Scene) -> BandLight:
    """The lamp's light in every band as it is read, see `over_band`."""
    detector, count = scene.detector, pieces(scene)
    each = [over_band(scene.lamp, low, high, detector, count) for low, high in detector.bands_read_nm]
    return BandLight(*(np.array(v) for v in zip(*each, strict=True)))


def over_first_band(scene: Scene, pieces: int) -> BandLight:
    """The lamp's light in so many parts of the first band as it is read, shape (pieces,), see `over_band`."""
    low, high = scene.detector.bands_read_nm[0]
    return over_band(scene.lamp, low, high, scene.detector, pieces)


def first_band_w_per_sr(scene: Scene) -> float:
    """Radiant intensity on the beam's axis in the first band as it is read, W/sr (W of a pencil beam).

    By the detector's response over its mean in the band, which is what a responsivity stands for.
    """
    low, high = scene.detector.bands_nm[0]
    return float(over_first_band(scene, _PIECES).intensity.mean() * (high - low))


def refuse_unlit(scene: Scene) -> None:
    """Refuse a lamp that gives no light in any band: to be called before anything is traced.

    Raises
    ------
    SceneError
        Less than `_LEAST_LIT` of the spectrum's peak in every band, and no stray light of the others.
    """
    brightest, peak = _brightest(scene.lamp)
    if scene.detector.stray_light or over_bands(scene).intensity.max() > _LEAST_LIT * peak:
        return
    if not peak > 0:  # nan, of a table without power
        raise SceneError(
            "the lamp gives no light at all", where="lamp.spectrum_table", found="no power at any wavelength",
            rule="some above 0", remedy="correct the table",
        )  # fmt: skip
    raise SceneError(
        "the lamp gives no light in the bands that are seen", where="detector.bands_nm",
        found=", ".join(f"{low:g}-{high:g} nm" for low, high in scene.detector.bands_nm),
        rule=f"the lamp is brightest at {brightest:.0f} nm", remedy="correct the bands, or lamp.spectrum",
    )  # fmt: skip


def refuse_unlit_wavelengths(scene: Scene, wavelengths_nm: Array, where: str) -> None:
    """Refuse a lamp that gives no light at any of some wavelengths: to be called before anything is traced.

    Parameters
    ----------
    wavelengths_nm : array, shape (n,), nm
    where : str
        Who asks for them.

    Raises
    ------
    UsageError
        Less than `_LEAST_LIT` of the spectrum's peak at every one.
    """
    brightest, peak = _brightest(scene.lamp)
    if not axial_intensity(scene.lamp, wavelengths_nm).max() > _LEAST_LIT * peak:
        raise UsageError(
            "the lamp gives no light at these wavelengths", where=where,
            found=", ".join(f"{one:g}" for one in wavelengths_nm[:_TOLD])
            + ("" if len(wavelengths_nm) <= _TOLD else f" to {wavelengths_nm[-1]:g}") + " nm",
            rule=f"the lamp is brightest at {brightest:.0f} nm",
            remedy="wavelengths at which it shines, or correct lamp.spectrum",
        )  # fmt: skip


def _brightest(lamp: Lamp) -> tuple[float, float]:
    """Wavelength, nm, at which a lamp is brightest, and its intensity there."""
    at = np.unique(np.concatenate([np.arange(FIRST_NM, LAST_NM + STEP_NM, STEP_NM), knots_nm(lamp)]))
    intensity = axial_intensity(lamp, at)
    return float(at[int(intensity.argmax())]), float(intensity.max())


def over_band(
    lamp: Lamp, low_nm: float, high_nm: float, detector: Detector | None = None, pieces: int = _PIECES
) -> BandLight:
    """The lamp's light in equal parts of a band, each where its power has its centre; shape (pieces,).

    However narrow its lines are: a table is integrated piece by piece between its own wavelengths, exactly
    for its straight pieces (Gauss-Legendre, 3 points). What changes with the square of the wavelength within
    a part is lost, of the water alone.

    Parameters
    ----------
    detector : Detector, optional
        Its response weighs the wavelengths: the mean over the band is that of light times response over the
        mean response. Without one all count alike.
    """
    edges = np.linspace(low_nm, high_nm, pieces + 1)
    inner = knots_nm(lamp)
    weighed = detector is not None and detector.response is not None
    if detector is not None and weighed:
        inner = np.concatenate([inner, detector.spectral_response.knots_nm])
    ends = np.unique(np.concatenate([edges, inner[(inner > low_nm) & (inner < high_nm)]]))
    half, middle = 0.5 * np.diff(ends), 0.5 * (ends[1:] + ends[:-1])
    at = middle[:, None] + half[:, None] * _NODES
    power = axial_intensity(lamp, at) * _WEIGHTS * half[:, None]
    if detector is not None and weighed:
        response = detector.spectral_response.at(at)
        mean = (response * _WEIGHTS * half[:, None]).sum() / (high_nm - low_nm)
        power = power * response / mean
    part = np.clip(np.searchsorted(edges, middle) - 1, 0, pieces - 1)
    total, moment = (np.bincount(part, v.sum(axis=1), pieces) for v in (power, power * at))
    centre = np.divide(moment, total, out=0.5 * (edges[1:] + edges[:-1]), where=total > 0)
    return BandLight(centre, total / np.diff(edges))


def at_wavelengths(lamp: Lamp, wavelength_nm: ArrayLike) -> BandLight:
    """The lamp's light at single wavelengths, arrays of shape (n, 1)."""
    at = np.asarray(wavelength_nm, float)[:, None]
    return BandLight(at, axial_intensity(lamp, at))
