"""Plane-parallel slabs and infinite water against published and exact numbers of radiative transfer.

The photon walk is run with detectors made here: all it asks of one is where a flight meets it and what that
counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy import stats

from lightfield.render.response.bookkeeping import Bookkeeping
from lightfield.render.tracer.absorption import ReferenceWater
from lightfield.render.tracer.emission import Emission
from lightfield.render.tracer.flight import TransportProblem
from lightfield.render.tracer.histories import Histories, TallyLayout
from lightfield.render.tracer.planes import Crossing
from lightfield.render.tracer.scattering import henyey_greenstein
from lightfield.render.tracer.surfaces import Box, Shapes, Surfaces
from lightfield.render.tracer.walk import counted, trace
from lightfield.scene import Lamp, Tank

pytestmark = pytest.mark.usefixtures("backend")

BLACK = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
WIDE_M, BEFORE_M = 1e4, 1e-5
BATCHES = 10
CONFIDENT = stats.norm.cdf(3)  # three standard errors


class FluxThrough:
    """Light through planes of constant z over their whole extent, by direction: cells are rings of |cos|.

    Parameters
    ----------
    z_m : list of float
    down : list of bool
        Per plane: whether it counts light that travels to +z or to -z.
    edges : array, shape (n + 1,)
        Rings of the cosine.
    """

    images = None
    is_slab = False

    def __init__(self, z_m: list[float], down: list[bool], edges: np.ndarray) -> None:
        self.count, self.rings = dr.opaque(mi.UInt32, len(z_m)), len(edges) - 1
        self.cells = len(z_m) * self.rings
        self.row_length = self.component_length = dr.opaque(mi.UInt32, self.cells)
        self.z, self.down, self.edges = mi.Float(z_m), mi.Bool(down), mi.Float(edges)

    def crossing(
        self, plane: Any, position: Any, direction: Any, reach: Any, mirror: bool, u: Any
    ) -> Crossing:
        z = dr.gather(mi.Float, self.z, plane)
        distance = (z - position.z) / direction.z
        cosine = dr.abs(direction.z)
        ring = dr.binary_search(0, self.rings - 1, lambda i: dr.gather(mi.Float, self.edges, i + 1) <= cosine)
        hits = (
            (distance > 0) & (distance < reach) & ((direction.z > 0) == dr.gather(mi.Bool, self.down, plane))
        )
        hits &= cosine >= dr.gather(mi.Float, self.edges, 0)
        cell = plane * self.rings + ring
        x = y = mi.Float(0)
        return Crossing(distance, x, y, z, hits, cell, mi.Bool(False), cell, mi.Float(1))

    def reading(self, crossing: Crossing, direction: Any) -> tuple[Any, Any]:
        return (mi.Float(1),), mi.Float(0)

    def behind(self, position: Any, direction: Any) -> Any:
        return mi.Bool(False)

    def ahead(self, position: Any, direction: Any) -> Any:
        return mi.Float(-1)  # nothing lies behind the last plane


@dataclass(frozen=True)
class Slab:
    """Flux per batch, plane, unscattered or scattered, and ring of the cosine; energy books."""

    flux: np.ndarray
    books: list[Bookkeeping]


def slab_box(tau: float) -> Box:
    """Black ends of a tank that is as good as infinitely wide; the first just before z = 0."""
    wide = {"width_m": 2 * WIDE_M, "depth_m": 2 * WIDE_M, "lamp_depth_m": WIDE_M}
    return Box(Tank(**wide, behind_lamp_m=BEFORE_M, length_m=tau + BEFORE_M), 0.0, None)


def trace_slab(
    surfaces: Surfaces, omega: float, g: float, planes: FluxThrough, photons: int, incidence_deg: float = 0.0
) -> Slab:
    """A slab of one mean free path per metre, lit by a pencil beam that starts at z = 0."""
    emission = Emission(Lamp(profile="pencil", tilt_x_deg=incidence_deg), cone_rad=0.1)
    histories = Histories(TallyLayout(1, path_nodes=2, longest_excess_m=1.0))
    problem = TransportProblem(
        surfaces, henyey_greenstein(g), emission, planes, histories, ReferenceWater(1 - omega, omega)
    )
    flux, books = [], []
    for batch in range(BATCHES):
        each = photons // BATCHES
        counts, book = trace(problem, each, seed=77 + batch)
        counts = counts / counted(each)
        # Rows: scattered or not, then two nodes of the path.
        flux.append(counts.reshape(2, 2, -1, planes.rings).sum(axis=1).swapaxes(0, 1))
        books.append(book)
    return Slab(np.array(flux, float), books)


def agrees(samples: np.ndarray, truth: float, at_most: float) -> None:
    """Batches agree with a printed number within three standard errors, and know it to a relative error."""
    stderr = samples.std(ddof=1) / np.sqrt(len(samples))
    assert stderr < at_most * truth
    t = (samples.mean() - truth) / stderr
    assert abs(t) < stats.t.isf(1 - CONFIDENT, len(samples) - 1), (
        f"{samples.mean():.6g} +- {stderr:.2g}, {truth}"
    )


FULL = np.array([0.0, 1.0 + 1e-6])
# omega, g, tau, R, T with direct light: van de Hulst (1980), Multiple Light Scattering, tables 12 and 35.
SLABS = {
    "g 0.75, omega 0.9, tau 2": (0.9, 0.75, 2.0, 0.09739, 0.66096),
    "isotropic, conservative": (1.0, 0.0, 1.0, 0.34133, 0.65867),
    "g 0.5, conservative": (1.0, 0.5, 1.0, None, 0.82389),
    "g 0.5, omega 0.9": (0.9, 0.5, 1.0, None, 0.73909),
    "g 0.75, omega 0.9, tau 1": (0.9, 0.75, 1.0, None, 0.82792),
}


@pytest.mark.parametrize("name", SLABS)
def test_reflection_and_transmission_of_slabs(name: str) -> None:
    """R within 3 standard errors of van de Hulst, T also within 0.3 %; what is scattered in is conserved."""
    omega, g, tau, reflected, transmitted = SLABS[name]
    planes = FluxThrough([1e-6, tau - 1e-6], [False, True], FULL)
    slab = trace_slab(slab_box(tau), omega, g, planes, 1_500_000)
    through = slab.flux[:, 1].sum(axis=(1, 2))
    agrees(through, transmitted, 0.001)
    assert abs(through.mean() / transmitted - 1) < 0.003
    np.testing.assert_allclose(slab.flux[:, 1, 0, 0], np.exp(-tau), rtol=1e-4)
    back = slab.flux[:, 0].sum(axis=(1, 2))
    if reflected is not None:
        agrees(back, reflected, 0.003)
    if omega == 1:
        agrees(back + through, 1.0, 0.001)


# mu: R and T without direct light, as pi L / (mu0 F), omega 0.9, g 0.75, tau 2.
# Van de Hulst (1980), Multiple Light Scattering, table 35, p. 435.
ANGULAR = {
    0.1: (0.13304, 0.16486),
    0.3: (0.13856, 0.22473),
    0.5: (0.11956, 0.27785),
    0.7: (0.09411, 0.36889),
    0.9: (0.07132, 0.72155),
    1.0: (0.0618, 2.4027),
}


def radiance(rings: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Mean radiance per ring of the cosine, from flux: dE = L mu dOmega."""
    return rings / (np.pi * np.diff(edges**2))


def test_angular_reflection_and_transmission() -> None:
    """Narrow rings around van de Hulst's cosines; the two next to 1 are extrapolated to it."""
    edges = np.array([0.09, 0.11, 0.29, 0.31, 0.49, 0.51, 0.69, 0.71, 0.895, 0.905, 0.996, 0.998, 1.0000001])
    planes = FluxThrough([1e-6, 2 - 1e-6], [False, True], edges)
    slab = trace_slab(slab_box(2.0), 0.9, 0.75, planes, 3_000_000)
    for plane in (0, 1):
        factor = np.pi * radiance(slab.flux[:, plane, 1], edges)
        found = [*factor.T[0:9:2], 1.5 * factor[:, 11] - 0.5 * factor[:, 10]]
        for samples, printed in zip(found, ANGULAR.values(), strict=True):
            agrees(samples, printed[plane], 0.1 if samples is found[-1] else 0.03)


def test_semi_infinite_water_lit_aslant() -> None:
    """Isotropic scattering, omega 0.8, light at 60 degrees: Eu/Ed = 0.36799, nadir Lu/Ed = 0.09583 per sr.

    Chandrasekhar (1950), as quoted by Gordon (1985); discrete ordinates give 0.36797 and 0.09586.
    """
    edges = np.array([0.0, 0.9, 0.95, 1.0000001])
    planes = FluxThrough([1e-6], [False], edges)
    slab = trace_slab(slab_box(40.0), 0.8, 0.0, planes, 800_000, incidence_deg=60.0)
    upward = slab.flux[:, 0, 1]
    agrees(upward.sum(axis=1), 0.36799, 0.002)
    nadir = radiance(upward, edges)
    agrees(1.5 * nadir[:, 2] - 0.5 * nadir[:, 1], 0.09583, 0.02)


def test_semi_infinite_water_under_a_dielectric_surface() -> None:
    """R = 0.26 with the specular 4 %, omega 0.9, isotropic, index 1.5: Giovanelli (1955), Opt. Acta 2, 153.

    Adding-doubling (iadpython, 16 to 64 directions) gives 0.2599 to 0.2601. The walk starts in the water,
    whose surface reflects by Fresnel's formulas and lets the rest escape. Of shapes of Mitsuba's: 100 free
    paths wide, because a graphics card knows where triangles are to the seventh digit of their size only.
    """
    turn, wide = mi.ScalarTransform4f, [100.0, 100.0, 1.0]
    down = turn().translate([0, 0, -1e-4]) @ turn().rotate([1, 0, 0], 180) @ turn().scale(wide)
    glass = {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0}
    scene = mi.load_dict({"type": "scene", "top": {"type": "rectangle", "to_world": down, "bsdf": glass}})
    slab = trace_slab(Shapes(scene), 0.9, 0.0, FluxThrough([39.0], [True], FULL), 1_000_000)
    agrees(np.array([0.04 + 0.96 * book.escaped / book.emitted for book in slab.books]), 0.2600, 0.002)


class AbsorptionMoments:
    """Expected moments of the place of absorption in infinite water, flight by flight.

    A flight from p along d is absorbed at p + s d with density a exp(-c s), whose moments are in closed form.
    Cells are 1, z, z^2, x^2 + y^2.
    """

    images = None
    is_slab = False

    def __init__(self, a: float, b: float) -> None:
        self.count, self.cells = dr.opaque(mi.UInt32, 4), 4
        self.row_length = self.component_length = dr.opaque(mi.UInt32, 4)
        self.a, self.c = dr.opaque(mi.Float, a), dr.opaque(mi.Float, a + b)

    def crossing(
        self, plane: Any, position: Any, direction: Any, reach: Any, mirror: bool, u: Any
    ) -> Crossing:
        p, never = position, mi.Bool(False)
        return Crossing(mi.Float(0), p.x, p.y, p.z, mi.Bool(True), plane, never, plane, mi.Float(1))

    def reading(self, crossing: Crossing, direction: Any) -> tuple[Any, Any]:
        c, moment = self.c, crossing.cell
        z2, x2, y2 = (
            p * p + 2 * p * d / c + 2 * d * d / (c * c)
            for p, d in ((crossing.z, direction.z), (crossing.x, direction.x), (crossing.y, direction.y))
        )
        value = dr.select(moment == 1, crossing.z + direction.z / c, dr.select(moment == 2, z2, x2 + y2))
        return (dr.select(moment == 0, 1, value) * self.a / c,), mi.Float(0)

    def behind(self, position: Any, direction: Any) -> Any:
        return mi.Bool(False)

    def ahead(self, position: Any, direction: Any) -> Any:
        return mi.Float(-1)  # nothing lies behind the last plane


WATERS = [
    (0.114, 0.037, 0.924),
    pytest.param(0.179, 0.219, 0.924, marks=pytest.mark.slow),
    pytest.param(0.366, 1.824, 0.924, marks=pytest.mark.slow),
    pytest.param(0.1, 0.9, 0.75, marks=pytest.mark.slow),
    (0.5, 0.5, 0.0),
]


@pytest.mark.parametrize(("a", "b", "g"), WATERS)
def test_where_a_pencil_beam_is_absorbed(a: float, b: float, g: float) -> None:
    """Exact moments (Lewis 1950, Phys. Rev. 78, 526, integrated over the path with absorption).

    With k_l = b (1 - g^l): <z> = 1/(a + k1); <z^2> = 2/(3 (a + k1)) (1/a + 2/(a + k2));
    <x^2 + y^2> = 4 k2 / (3 a (a + k1) (a + k2)). Waters: Petzold's clear, coastal and harbor, and two others.
    """
    k1, k2 = b * (1 - g), b * (1 - g * g)
    exact = {
        "absorbed": 1.0,
        "z": 1 / (a + k1),
        "z^2": 2 / (3 * (a + k1)) * (1 / a + 2 / (a + k2)),
        "x^2 + y^2": 4 * k2 / (3 * a * (a + k1) * (a + k2)),
    }
    scene = mi.load_dict(
        {"type": "scene", "water": {"type": "sphere", "radius": 1e4, "flip_normals": True, "bsdf": BLACK}}
    )
    emission = Emission(Lamp(profile="pencil"), cone_rad=0.1)
    histories = Histories(TallyLayout(0, path_nodes=2))
    surfaces, turn, planes = Shapes(scene), henyey_greenstein(g), AbsorptionMoments(a, b)
    problem = TransportProblem(surfaces, turn, emission, planes, histories, ReferenceWater(a, b))
    samples, each = [], 10_240
    for batch in range(BATCHES):
        # In parts: four cells get all deposits, and single precision drops what adds little to a large sum.
        parts = [trace(problem, each, 500 + batch, first=first)[0] for first in range(0, 8 * each, each)]
        samples.append(np.sum(parts, axis=(0, 1), dtype=float) / 8 / counted(each))
    for moment, truth in zip(np.array(samples, float).T, exact.values(), strict=True):
        agrees(moment, truth, 0.01)
