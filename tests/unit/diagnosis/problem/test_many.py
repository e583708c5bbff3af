"""Short ways for many readings give what the long ones give."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from analytic_readings import scene
from numpy.testing import assert_allclose

from lightfield.diagnosis.adequacy.scale import scale_along
from lightfield.diagnosis.adequacy.subspace import combined, orthonormal
from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.problem import problem
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.problem.noise import Budget, Noise
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings


def line_scans(n: int, offset_m: float = 0.0, background: float = 0.0) -> Readings:
    """Readings across the beam at five distances, with an error of 0.5 % and a dark floor.

    Parameters
    ----------
    background : float
        Over the brightest reading.
    """
    rng, z = np.random.default_rng(5), np.repeat(np.linspace(4.5, 8.5, 5), n // 5)
    x = np.tile(np.linspace(-0.9, 0.9, n // 5), 5)
    light = direct_field(scene().with_values({"lamp.offset_x_m": offset_m}), x, 0 * x, z)
    light += background * light.max()
    error = np.hypot(0.005 * light, 0.0008 * light.max())
    return Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=light + error * rng.standard_normal(len(x)), stderr=error,
        time_s=np.arange(len(x)), quantity="irradiance",
    )  # fmt: skip


def test_fits_that_begin_with_a_sample_end_where_the_others_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two effects, and one that a sample shows to be out of the question."""
    readings = line_scans(300, 0.02, 0.01)
    only = ["beam_offset", "background", "lamp_drift"]
    found = []
    for many in (10**9, 200):
        monkeypatch.setattr(problem, "MANY", many)
        monkeypatch.setattr(problem, "SAMPLE", 100)
        verdict = diagnose(readings, scene(), diffuse=None, only=only, advise=False).verdict
        found.append((verdict.effects, verdict.explanations[0].parameters))
    (effects, every), (the_same, sampled) = found
    assert sorted(effects) == sorted(the_same) == ["background", "beam_offset"]
    for path, one in every.items():
        assert one.stderr and abs(one.value - sampled[path].value) < 0.05 * one.stderr, path


def test_a_basis_from_products_spans_what_a_basis_from_columns_does() -> None:
    """Columns of all sizes, two of them collinear and one empty."""
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((40, 6)) * 10.0 ** np.arange(-3, 3)
    columns = np.column_stack([columns, columns[:, 1] + columns[:, 2], np.zeros(40)])
    direct, found = orthonormal(columns), columns @ combined(columns.T @ columns)
    assert_allclose(found.T @ found, np.eye(6), atol=1e-9)
    assert_allclose(found @ found.T, direct @ direct.T, atol=1e-9)


def test_one_factor_serves_every_scale_of_the_noise() -> None:
    """The stage's error, however small, takes a factor for each scale, and a polynomial between them."""
    rng, layout = np.random.default_rng(2), layout_of(line_scans(600))
    light = 1 + np.cos(layout.x_m)
    noise = Noise(layout, 0.01 * light, light, Budget(0.003, 0.0, 0.003, True), np.ones(600))
    plain = Whitener(replace(noise, budget=Budget(0.0, 0.0, 0.0)), 0.3)
    raw = Whitener(noise, 0.3, 1.7, 0.003).coloured(rng.standard_normal(600))
    rich = orthonormal(plain(np.stack([light, light * layout.x_m, light / layout.z_m], axis=1)))
    keep = (np.arange(600) % 50 > 0) * 1.0
    one, each = (
        scale_along(plain(raw), rich, plain, replace(noise, budget=budget), 0.003, keep)
        for budget in (noise.budget, replace(noise.budget, position_m=1e-9))
    )
    assert one == pytest.approx(each, rel=1e-3)
    assert one == pytest.approx(1.7, rel=0.25)
