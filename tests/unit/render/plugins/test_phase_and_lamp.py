"""Phase function and lamp as Mitsuba calls them, beside their formulas."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lightfield.render.backend import use_backend

G, HWHM_DEG = 0.9, 6.0


@pytest.fixture(scope="module")
def mi() -> Any:
    """Mitsuba with the plugins in it."""
    use_backend()
    import mitsuba

    from lightfield.render.plugins import registration

    registration.register()  # a second time is none
    return mitsuba


def henyey_greenstein(cosine: np.ndarray) -> np.ndarray:
    """Per sr."""
    return np.asarray((1 - G * G) / (4 * np.pi * (1 + G * G - 2 * G * cosine) ** 1.5))


@pytest.fixture(scope="module")
def phase(mi: Any) -> Any:
    model = f'{{"type": "henyey-greenstein", "g": {G}}}'
    return mi.load_dict({"type": "lightfield_phase", "model": model})


def meeting(mi: Any) -> Any:
    """Light that flies along +x; Mitsuba's own direction points back along the flight."""
    met = mi.MediumInteraction3f()
    met.wi = mi.Vector3f(-1.0, 0.0, 0.0)
    met.sh_frame = mi.Frame3f(met.wi)
    return met


def test_the_density_of_a_turn_is_the_phase_function(mi: Any, phase: Any) -> None:
    """From a thousandth of a degree to straight back."""
    psi = np.radians([1e-3, 0.1, 3.0, 40.0, 90.0, 150.0, 180.0])
    towards = mi.Vector3f(mi.Float(np.cos(psi)), mi.Float(np.sin(psi)), 0.0)
    value, density = phase.eval_pdf(mi.PhaseFunctionContext(), meeting(mi), towards)
    assert np.array(density) == pytest.approx(henyey_greenstein(np.cos(psi)), rel=2e-3)
    assert np.ravel(np.array(value))[: len(psi)] == pytest.approx(np.array(density))


def test_turns_are_drawn_by_their_density(mi: Any, phase: Any) -> None:
    """At the middles of equal parts of both random numbers: unit vectors whose mean cosine is g."""
    n = 256
    u, v = (g.ravel() for g in np.meshgrid(*2 * [(np.arange(n) + 0.5) / n]))
    drawn, weight, density = phase.sample(
        mi.PhaseFunctionContext(), meeting(mi), 0.5, mi.Point2f(mi.Float(u), mi.Float(v))
    )
    x, y, z = (np.array(part, float) for part in (drawn.x, drawn.y, drawn.z))
    assert x**2 + y**2 + z**2 == pytest.approx(np.ones(n * n), abs=1e-5)
    assert x.mean() == pytest.approx(G, abs=1e-3)
    assert [y.mean(), z.mean()] == pytest.approx([0.0, 0.0], abs=1e-4)
    assert np.array(density) == pytest.approx(henyey_greenstein(x), rel=5e-3)
    assert np.unique(np.array(weight)).tolist() == [1.0]


def test_a_lamp_shines_by_its_beam_over_the_distance_squared(mi: Any) -> None:
    """A Gaussian of 6 degrees from a place aside, 3 W/sr on its axis, seen from four places."""
    lamp = mi.load_dict({
        "type": "lightfield_lamp", "profile": "gaussian", "hwhm_deg": HWHM_DEG,
        "offset_x_m": 0.2, "intensity": 3.0,
    })  # fmt: skip
    x, z = np.array([0.2, 0.5, 0.2, -0.4]), np.array([4.0, 4.0, 1.0, 5.0])
    here = mi.Interaction3f()
    here.p = mi.Point3f(mi.Float(x), 0.0, mi.Float(z))
    sample, light = lamp.sample_direction(here, mi.Point2f(0.5, 0.5))
    away = np.hypot(x - 0.2, z)
    theta = np.degrees(np.arctan2(np.abs(x - 0.2), z))
    right = 3.0 * np.exp(-np.log(2) * (theta / HWHM_DEG) ** 2) / away**2
    assert np.array(sample.dist) == pytest.approx(away, rel=1e-6)
    assert np.array(light)[0] == pytest.approx(right, rel=1e-4)
    assert np.array(lamp.eval_direction(here, sample))[0] == pytest.approx(right, rel=1e-4)
