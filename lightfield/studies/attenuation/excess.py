"""What scattered and reflected light adds at the receiver, for any water: ln(all light / direct light).

One trace answers for every absorption and scattering. It is asked at the nodes of Chebyshev polynomials in
both, so that a fit evaluates all colours at all places in microseconds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from lightfield.arrays import Array
from lightfield.decompositions import thin_svd
from lightfield.errors import RenderError
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.formula.closed_form import direct_field
from lightfield.formula.own_formulas import lit
from lightfield.scene import Scene
from lightfield.scene.acts import IN_WATER
from lightfield.scene.all_parameters import without
from lightfield.scene.listed import OWN_FIELD
from lightfield.studies.light_at import Points, diffuse_response_at

#: Nodes in absorption and in scattering: the polynomials meet the response between them to a twentieth of
#: its own error (tests/physics/found/test_attenuation.py).
NODES_A, NODES_B = 4, 9
#: Light that is known worse than this is not followed: chosen, a fit would only follow the noise.
_MOST_ERROR = 0.2
#: Modes of the trace's error smaller than this part of the largest are left out.
_SMALL_MODE = 1e-3


@dataclass(frozen=True, eq=False)
class Excess:
    """ln(all light / direct light) at the places of a table.

    Parameters
    ----------
    largest_a, largest_b : float, 1/m
        Up to which the polynomials hold; beyond they are continued straight.
    coefficients : array, shape (NODES_A, NODES_B, n_places)
    modes : array, shape (n_places, k)
        Errors of the light over the light, in a typical water, as independent contributions: noise of the
        trace, and one for what is smooth.
    typical : (a, b), 1/m
        That water.
    """

    largest_a: float
    largest_b: float
    coefficients: Array
    modes: Array
    typical: tuple[float, float] = (0.0, 0.0)

    def value(self, a: Array, b: Array) -> Array:
        """At absorption and scattering coefficients, shape (n,), 1/m: shape (n_places, n)."""
        s, t = self._inside(a, b)
        by_a, by_b = self.slopes(a, b)
        beyond_a, beyond_b = a - 0.5 * (s + 1) * self.largest_a, b - 0.5 * (t + 1) * self.largest_b
        return _grid(self.coefficients, s, t) + by_a * beyond_a + by_b * beyond_b

    def error_over_typical(self, a: Array, b: Array) -> Array:
        """Of the light's error over that of the typical water, as the parts of the light that were scattered
        or reflected are, shape (n_places, n); 1 where nothing is there."""
        there = -np.expm1(-self.value(*np.array(self.typical)[:, None]))
        share = -np.expm1(-self.value(a, b))
        return np.divide(np.maximum(share, 0.0), there, out=np.ones_like(share), where=there > 0)

    def slopes(self, a: Array, b: Array) -> tuple[Array, Array]:
        """Derivatives by a and by b, each of shape (n_places, n), m."""
        s, t = self._inside(a, b)
        by_a = _grid(chebyshev.chebder(self.coefficients, axis=0), s, t) * 2 / self.largest_a
        by_b = _grid(chebyshev.chebder(self.coefficients, axis=1), s, t) * 2 / self.largest_b
        return by_a, by_b

    def _inside(self, a: Array, b: Array) -> tuple[Array, Array]:
        return (
            np.clip(2 * np.asarray(a) / self.largest_a - 1, -1, 1),
            np.clip(2 * np.asarray(b) / self.largest_b - 1, -1, 1),
        )


def grey(scene: Scene, a: float, b: float) -> Scene:
    """The scene in uniform water of these coefficients, with its own phase function."""
    plain = without(scene, IN_WATER)
    return plain.with_values({"water.absorption_per_m": a, "water.scattering_per_m": b}, validate=False)


def excess_light(
    scene: Scene,
    places: Points,
    trace: DiffuseSource,
    largest_a: float,
    largest_b: float,
    typical: tuple[float, float],
) -> Excess:
    """Ask the response at the nodes.

    Parameters
    ----------
    scene : Scene
        Lamp, tank, receiver and phase function; its water counts nowhere.
    places : (x_m, y_m, z_m)
    trace : callable
        `lightfield.render.diffuse.source.response_for` or the like.
    largest_a, largest_b : float, 1/m
    typical : (a, b), 1/m
        Water whose errors are taken for those of all.
    """
    # Own effects on the beam are in its lamp; others dim all light alike.
    scene = lit(scene).model_copy(update={OWN_FIELD: ()})
    first, count = grey(scene, *typical), len(places[2])
    response = diffuse_response_at(trace, first, places, largest_b)
    nodes = chebyshev.chebpts1(NODES_A), chebyshev.chebpts1(NODES_B)
    values = np.zeros((NODES_A, NODES_B, count))
    for i, a in enumerate(0.5 * (nodes[0] + 1) * largest_a):
        for k, b in enumerate(0.5 * (nodes[1] + 1) * largest_b):
            water = grey(scene, float(a), float(b))
            values[i, k] = response.light(water, [None])[0] / direct_field(water, *places)
    light = response.light(first, [None])[0] + direct_field(first, *places)
    noise, smooth = response.errors(first, [None], np.zeros(count, int))
    modes = _modes(np.column_stack([noise, smooth]) / light[:, None])
    if not (values > -1).all() or np.linalg.norm(modes, axis=1).max(initial=0.0) > _MOST_ERROR:
        raise RenderError(
            "the water is too dense for its scattered light to be followed so far",
            found=f"scattering up to {largest_b:.2g} per m, places up to {max(places[2]):g} m away",
            rule=f"light known to {100 * _MOST_ERROR:g} %",
            remedy="ask for nearer places, or leave scattered light out",
        )
    values = np.log1p(values)
    for axis, at in enumerate(nodes):
        turned = np.tensordot(np.linalg.inv(chebyshev.chebvander(at, len(at) - 1)), values, (1, axis))
        values = np.moveaxis(turned, 0, axis)
    return Excess(largest_a, largest_b, values, modes, typical)


def _grid(coefficients: Array, s: Array, t: Array) -> Array:
    """Polynomials at pairs of (s, t): shape (n_places, n)."""
    left = chebyshev.chebvander(s, coefficients.shape[0] - 1)
    right = chebyshev.chebvander(t, coefficients.shape[1] - 1)
    return np.asarray(np.einsum("ni,nk,ikp->pn", left, right, coefficients, optimize=True))


def _modes(modes: Array) -> Array:
    """The same covariance by as few contributions as there are places."""
    left, size, _ = thin_svd(modes)
    keep = size > _SMALL_MODE * size.max(initial=0.0)
    return np.asarray(left[:, keep] * size[keep])


def no_excess(places: int) -> Excess:
    """Of light that is neither scattered nor reflected."""
    return Excess(1.0, 1.0, np.zeros((NODES_A, NODES_B, places)), np.zeros((places, 0)))
