"""A fit moves what shapes the phase function of its own scene."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from analytic_readings import readings
from scipy.sparse import eye_array

from lightfield.diagnosis.problem.setup import problem_of
from lightfield.errors import RenderError
from lightfield.fitting import effects
from lightfield.fitting.forward import SceneForward
from lightfield.render.diffuse.between_g import SHAPES, BetweenG
from lightfield.scene import Scene


@pytest.mark.parametrize(
    ("phase", "form", "shapes"),
    [
        ({"type": "henyey-greenstein", "g": 0.9}, "Henyey-Greenstein", ["water.phase.g"]),
        ({"type": "fournier-forand"}, "Fournier-Forand", ["water.phase.mu"]),
        ({"type": "petzold"}, "Henyey-Greenstein", []),
    ],
)
def test_scattering_has_the_shape_of_the_scene(phase: dict[str, Any], form: str, shapes: list[str]) -> None:
    """One form of the effect for each scene: that whose shape it knows, or the coefficient alone."""
    table, scene = readings()
    scene = Scene.from_dict({**scene.to_dict(), "water": {"absorption_per_m": 0.1, "phase": phase}})
    problem, _ = problem_of(SceneForward(scene, table), table, [effects.get("scattering")], None)
    (found,) = problem.candidates
    assert [p.path for p in found.amplitudes] == ["water.scattering_per_m"]
    assert [p.path for p in found.shapes] == shapes
    if shapes:
        assert found.form.name == form


def test_light_between_slopes_is_interpolated_and_beyond_them_refused() -> None:
    """A cubic in mu comes out exactly, at the nodes and between."""
    shape = SHAPES["fournier-forand"]
    between = BetweenG(shape.nodes, np.ones(4) / 4, eye_array(1, format="csr"), shape)
    scene = Scene.from_dict({"water": {"phase": {"type": "fournier-forand"}}})
    mu = np.array(shape.nodes)
    for at in (3.25, 3.5, 3.9):
        shares = between.shares(scene.with_values({"water.phase.mu": at}))
        assert shares @ (1 + mu - 0.3 * mu**3) == pytest.approx(1 + at - 0.3 * at**3)
    with pytest.raises(RenderError, match="mu is outside"):
        between.shares(scene.with_values({"water.phase.mu": 4.5}))
