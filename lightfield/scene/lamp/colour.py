"""A beam whose width has a colour: at every wavelength a lamp of one width."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import TINY, Array
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.lamp.width import widened

if TYPE_CHECKING:
    from lightfield.scene.scene import Scene

#: Wavelength at which the width of a beam is stated, nm.
REFERENCE_NM = 550.0
#: Light of more wavelengths than that is interpolated from so many widths. Measured, with 24 wavelengths from
#: 420 to 650 nm and b = 0.1 per m: readings are right to 2e-7 at kappa = 0.3, 6e-6 at 1 and 2e-4 at 2, and
#: take a third (of scattered light alone, and far out, see test_colour.py).
_WIDTHS = 6


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
    if len(set(at)) <= _WIDTHS:
        return np.concatenate([light(in_colour(scene, w), [w]) for w in at], axis=-2)
    nodes = _nodes(min(at), max(at))
    known = np.stack([light(in_colour(scene, float(w)), at) for w in nodes])
    return _between(np.log(nodes), known, np.log(at))


def _nodes(first_nm: float, last_nm: float) -> Array:
    """Those of Chebyshev over the logarithm of the wavelength, nm, rising."""
    turn = -np.cos(np.pi * (np.arange(_WIDTHS) + 0.5) / _WIDTHS)
    return np.asarray(np.sqrt(first_nm * last_nm) * (last_nm / first_nm) ** (0.5 * turn))


def _between(nodes: Array, known: Array, at: Array) -> Array:
    """Light at each of some wavelengths, of that for the width of every node, shape (n_nodes, ...,
    n_wavelengths, n): the polynomial of its logarithm, and straight lines where some of it is dark."""
    apart = nodes[:, None] - nodes + np.eye(len(nodes))
    weights = np.stack(
        [np.prod(np.delete(at[:, None] - nodes, k, 1), axis=1) / apart[k].prod() for k in range(len(nodes))]
    )
    straight = np.stack([np.interp(at, nodes, one) for one in np.eye(len(nodes))])
    lit = (known > TINY).all(axis=0)
    bent = np.exp(np.einsum("kw,k...wn->...wn", weights, np.log(np.where(lit, known, 1.0))))
    return np.where(lit, bent, np.einsum("kw,k...wn->...wn", straight, known))
