"""A beam whose width has a colour: at every wavelength a lamp of one width."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.lamp.width import widened

if TYPE_CHECKING:
    from lightfield.scene.scene import Scene

#: Wavelength at which the width of a beam is stated, nm.
REFERENCE_NM = 550.0


def wider_in_colour(lamp: Lamp, wavelength_nm: ArrayLike) -> Array:
    """How much wider the beam is at a wavelength than at 550 nm: (lambda / 550 nm)^kappa.

    A phosphor around a blue chip, a dichroic reflector, a lens that bends red less.

    Parameters
    ----------
    lamp : Lamp
        width_slope (kappa).
    wavelength_nm : array, nm
    """
    return np.asarray((np.asarray(wavelength_nm, dtype=float) / REFERENCE_NM) ** lamp.width_slope)


def in_colour(scene: Scene, wavelength_nm: float) -> Scene:
    """The scene with the lamp as it shines at a wavelength, nm: of one width for all, the intensity on the
    axis as it is."""
    lamp = scene.lamp
    if not lamp.width_slope:
        return scene
    wider = float(wider_in_colour(lamp, wavelength_nm))
    one = widened(lamp, wider).model_copy(update={"width_slope": 0.0})
    return scene.model_copy(update={"lamp": one})


def colour_by_colour(
    scene: Scene, wavelengths_nm: Sequence[float | None], light: Callable[[Scene, list[float]], Array]
) -> Array:
    """Light at several wavelengths, each from the lamp as it shines there, shape (..., n_wavelengths, n).

    Parameters
    ----------
    wavelengths_nm : sequence of float
        None: the middle of the first band.
    light : callable
        Of a scene at some wavelengths, shape (..., n_wavelengths, n).
    """
    middle = 0.5 * sum(scene.detector.bands_nm[0])
    at = [middle if w is None else float(w) for w in wavelengths_nm]
    return np.concatenate([light(in_colour(scene, w), [w]) for w in at], axis=-2)
