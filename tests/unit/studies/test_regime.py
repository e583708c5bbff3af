"""The regime map finds the known limits of a made-up field where exp(-c z) is wrong by a known factor."""

import numpy as np
import pytest

from lightfield.errors import SceneError
from lightfield.report.regime import percent_text, regime_figure
from lightfield.report.style import save_png
from lightfield.scene import Scene
from lightfield.studies.regime import (
    ALBEDOS,
    OPTICAL_DEPTHS,
    RECEIVERS,
    as_text,
    depth_within,
    regime_map,
    regime_plan,
    rows,
    undecided,
)
from lightfield.sweep.sweep_plan import SweepSettings


def lossless_scattering(depths=OPTICAL_DEPTHS, albedos=ALBEDOS, receivers=tuple(RECEIVERS)):
    """All light scattered is seen (irradiance) or a tenth of it (collimator): K = a, or K = a + 0.9 b."""
    seen = np.array([1.0 if receiver == "irradiance" else 0.1 for receiver in receivers])
    depth, albedo = np.array(depths), np.array(albedos)[:, None]
    render = np.exp(-depth * (1 - seen[:, None, None] * albedo))
    error = np.exp(-depth) / render - 1
    return regime_map(render, np.full(render.shape, 1e-6), error, depths, albedos, receivers)


def at_one_point(render, stderr, error):
    """A map of one point."""
    values = (np.full((1, 1, 1), value) for value in (render, stderr, error))
    return regime_map(*values, [1.0], [0.5], ["irradiance"])


def test_error_is_that_of_the_wrong_exponent():
    found = lossless_scattering()
    assert found.formula_error.dims == ("receiver", "albedo", "optical_depth")
    at = found.formula_error.sel(receiver="irradiance", albedo=0.8, optical_depth=2.0)
    assert float(at) == pytest.approx(np.exp(-1.6) - 1)
    assert float(abs(found.formula_error.sel(albedo=0.0)).max()) == 0


def test_what_was_not_rendered_is_unknown():
    """Nothing at all, from the first point on, or beyond points that the formula agrees with."""

    def reach(*errors):
        found = lossless_scattering([0.1, 0.2, 0.5], [0.5], ["x"])
        found.formula_error[0, 0] = np.array(errors)
        return rows(found)[0][2]

    nothing = np.nan
    assert reach(nothing, nothing, nothing) == reach(nothing, 0.01, 0.01) == "unknown"
    assert reach(0.01, nothing, nothing) == "> 0.1"
    assert reach(0.01, 0.01, nothing) == "> 0.2"
    assert reach(0.06, nothing, nothing) == "< 0.1" and reach(0.01, 0.01, 0.01) == "> 0.5"
    share = np.log(5) / np.log(9)  # straight in both logarithms
    assert float(reach(0.01, 0.09, nothing)) == pytest.approx(0.1 * 2**share, abs=0.005)


def test_the_lamp_stands_in_the_axis_that_is_asked_about_and_is_seen_in_its_band():
    """Where it is in a tank, and how it is turned there, is no matter of where the formula holds."""
    lamp = {"hwhm_deg": 4.0, "spectrum": "led-deep-red"}
    turned = {**lamp, "offset_x_m": 0.4, "offset_y_m": -0.1, "tilt_x_deg": 6.0, "tilt_y_deg": 2.0}
    red = {"detector": {"bands_nm": [[640.0, 680.0]]}}
    plans = [regime_plan(Scene.from_dict({"lamp": one, **red}), SweepSettings()) for one in (turned, lamp)]
    scenes = [plan.cases.scene for plan in plans]
    assert scenes[0] == scenes[1]
    assert scenes[0].detector.bands_nm == ((640.0, 680.0),)
    with pytest.raises(SceneError, match=r"no light in the bands.*500-550 nm"):
        regime_plan(Scene.from_dict({"lamp": lamp}), SweepSettings())


def test_reach_is_where_the_error_crosses_the_level():
    depth = np.array([0.1, 0.2, 0.5, 1.0, 2.0])
    error = np.expm1(-0.4 * depth)
    # 1 - exp(-0.4 t) = 0.10 at t = 0.263; log-log interpolation on this grid is good to 2 %.
    assert depth_within(depth, error, 0.10) == pytest.approx(0.263, rel=0.02)
    assert depth_within(depth, 0 * error, 0.10) == np.inf
    assert np.isnan(depth_within(depth, error - 1, 0.10))
    assert depth_within(depth, np.array([0.0, 0.01, np.nan, 0.0, 0.0]), 0.05) == 0.2, (
        "the unknown is not within"
    )


def test_noise_leaves_points_open_and_the_map_says_so():
    found = at_one_point(1.0, 0.01, -0.06)
    assert undecided(found.formula_error.values, found.formula_error_stderr.values).all(), (
        "6 % off with a noise of 1 %: within 5 % or not is open"
    )
    sure = at_one_point(1.0, 0.001, -0.06)
    assert not undecided(sure.formula_error.values, sure.formula_error_stderr.values).any()


def test_table_and_verdict():
    found = lossless_scattering()
    table = {(row[0], row[1]): row[2:] for row in rows(found)}
    assert table["irradiance", "0"] == ["> 20", "> 20", "> 20"]
    assert float(table["2 degree collimator", "0.8"][2]) > 5 * float(table["irradiance", "0.8"][2])
    assert as_text(found).startswith("In water of albedo 0.8 the formula is within 10 % up to c z = ")


def test_nothing_rendered_is_unknown_not_zero():
    found = at_one_point(0.0, 0.0, np.nan)
    assert np.isnan(found.formula_error.values).all()


def test_figure_is_drawn(tmp_path):
    found = lossless_scattering()
    assert save_png(regime_figure(found), tmp_path / "regime.png").stat().st_size > 10_000
    telephone = regime_figure(found, narrow=True)
    assert telephone.get_figwidth() < 5
    assert [percent_text(e) for e in (0.0001, -0.051, -0.4, -0.9995, 2.5, np.nan)] == [
        "0", "−5.1", "−40", "−99.9", "250", "–",
    ]  # fmt: skip
    assert [percent_text(e, whole=True) for e in (-0.051, -0.4, -0.9995, np.nan)] == ["−5", "−40", "−99", "–"]
