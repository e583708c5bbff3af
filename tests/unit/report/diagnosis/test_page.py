"""The diagnosis page says each kind of verdict first, and shows what it rests on."""

import dataclasses
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.colors import SymLogNorm
from matplotlib.patches import Polygon

from lightfield.diagnosis.verdict.parts import Rung, SetAside
from lightfield.diagnosis.verdict.terminal import as_text
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.fitting.fitted_curves import FittedCurve
from lightfield.report.diagnosis.curves import curve_figure
from lightfield.report.diagnosis.figures import FAR_SIGMA, data_figure, residual_map, signature_figure
from lightfield.report.diagnosis.ladder import ladder_figure
from lightfield.report.diagnosis.page import diagnosis_page
from lightfield.report.diagnosis.single_places import measured_figure, place_map
from lightfield.report.diagnosis.view import DiagnosisView, DrawnReadings, Prediction, Separation, Signature
from lightfield.report.page import three_digits
from lightfield.report.tank import tank_figure
from lightfield.scene import Tank

TANK = Tank(width_m=3.66, depth_m=2.44, length_m=36.6, behind_lamp_m=0.5, lamp_depth_m=1.22)


def example(kind="ambiguous", planes=(4.5, 5.5, 6.5, 7.5, 8.5), count=21, two_sided=False):
    """Readings of a scattering water, a base model without scattering, and two explanations of it."""
    rng = np.random.default_rng(4)
    scan = np.linspace(-1 if two_sided else 0, 1, count)
    z, x = (a.ravel() for a in np.meshgrid(planes, scan, indexing="ij"))
    base = np.exp(-np.log(2) * (x / (0.067 * z)) ** 2 - 0.1 * z) / z**2
    glow = 0.03 * np.exp(-np.log(2) * (x / (0.12 * z)) ** 2 - 0.05 * z) / z**2
    top = base.max()
    base, glow = base / top, glow / top
    sigma = 0.004 * (base + glow) + 2e-5
    value = base + glow + sigma * rng.standard_normal(z.size)
    out = np.zeros(z.size, bool)
    out[2] = True
    readings = DrawnReadings(
        x, 0 * x, z, 0 * x + 525, value, sigma, ["water"] * z.size, out, 20.0 * np.arange(z.size)
    )
    estimate = {"value": 0.0312, "stderr": 0.0007, "unit": "1/m", "reason": None}
    explanation: dict[str, object] = {
        "effects": ["scattering"],
        "families": ["water"],
        "forms": ["henyey-greenstein"],
        "weight": 0.7,
        "parameters": {"water.scattering_per_m": estimate},
        "chi2_per_dof": 1.03,
        "error_percent": 0.42,
        "held_out_percent": 0.5,
        "adequacy_p": 0.4,
    }
    skirt = {**explanation, "effects": ["beam_skirt"], "weight": 0.3}
    rungs: list[dict[str, object]] = [
        {"label": "base", "error_percent": 6.1, "chi2_per_dof": 212.0, "held_out_percent": 7.3},
        {
            "label": "+ scattering",
            "error_percent": 0.42,
            "chi2_per_dof": 1.03,
            "held_out_percent": 0.5,
            "rendered_error_percent": 0.45,
            "rendered_stderr_percent": 0.06,
        },
    ]
    found = kind in ("identified", "ambiguous")
    verdict = {
        "verdict": kind,
        "effects": ["scattering"] if found else [],
        "explanations": {"identified": [explanation], "ambiguous": [explanation, skirt]}.get(kind, []),
        "nearest_rival": {"effects": ["beam_skirt"], "separation_sigma": 1.8} if found else None,
        "detection_limits": {
            "wall_reflection": {
                "parameter": "tank.wall_albedo",
                "value": 0.03,
                "unit": "1",
                "within_range": True,
            },
            "lamp_drift": {
                "parameter": "lamp.drift_per_hour",
                "value": 0.3,
                "unit": "1/h",
                "within_range": False,
            },
        },
        "hindrances": {"beam_ellipticity": [{"hinders": "one y"}]},
        "unexplained_coordinate": "x_m" if kind == "unexplained" else None,
        "ladder": [
            {"effects": [], "parameters": {}, "scene": "", **rung} for rung in (rungs if found else rungs[:1])
        ],
        "noise_floor_percent": 0.4,
        "next_measurement": {
            "asks": "part two explanations",
            "between": [["scattering"], ["beam_skirt"]],
            "readings": [
                {"x_m": 1.2, "y_m": 0.0, "z_m": 3.0, "medium": "water", "repeats": 8},
                {"x_m": -0.6, "y_m": 0.3, "z_m": 9.5, "medium": "water", "repeats": 4},
            ],
            "separation_now_sigma": 1.8,
            "separation_predicted_sigma": 10.0,
        }
        if kind == "ambiguous"
        else None,
        "assumptions": [{"term": "plane_gain_percent", "value": 0.3}],
        "base_p": 0.001,
        "within_tolerance": False,
        "tolerance_percent": 0.3,
        "errors_stated": True,
        "errors_on_trust": False,
        "determined": True,
        "variance_scale": 1.0,
        "serial_correlation": 0.0,
        "outliers": [2],
        "saturated": [],
        "readings": z.size,
        "cautions": [{"warns": "table", "about": "scan_order", "said": "scan order = plane order"}],
        "run": 2,
    }
    predictions = [Prediction("base", base + 0.3 * glow)]
    if found:
        predictions.append(Prediction("+ scattering", base + glow))
    signatures = [Signature("scattering", 0.7 * glow), Signature("beam skirt", 0.67 * glow)]
    return DiagnosisView(
        verdict=Verdict.model_validate(verdict),
        readings=readings,
        predictions=predictions,
        signatures=signatures[: len(verdict["explanations"])],
        separation=Separation(
            [["scattering"], ["beam_skirt"], ["wall_reflection"], ["background"]],
            np.array([[0, 1.8, 6.2, 14.0], [1.7, 0, 5.1, 11.2], [6.0, 5.2, 0, 140.0], [12.0, 10.0, 90.0, 0]]),
        )
        if found
        else None,
        tank=TANK,
        title="story.csv",
        provenance=[("seed", "0")],
    )


@pytest.fixture(scope="module")
def page(words_alone):
    """Function that gives the page of an `example`, made once: one of the kinds is drawn, figures and all."""

    @cache
    def of_kind(kind):
        with pytest.MonkeyPatch.context() as patch:
            if kind != "ambiguous":
                words_alone(patch)
            return diagnosis_page(example(kind))

    return of_kind


@pytest.mark.parametrize("kind", ["none", "identified", "ambiguous", "unexplained"])
def test_every_verdict_is_said_first(page, kind):
    html, view = page(kind), example(kind)
    assert html.index(view.verdict.headline) < html.index("<h2>")
    for said in view.verdict.support:
        assert html.index(said) < html.index("<h2>")
    for needed in ("base", "noise floor 0.4 %", "plane_gain_percent = 0.3", "all readings have the same y"):
        assert needed in html
    assert ("What would explain it" in html) == (kind == "ambiguous")
    assert "src=" not in html.replace('src="data:', "")


def test_advice_is_drawn_and_listed(page):
    html = page("ambiguous")
    assert "measure here next" in html
    assert "8 times" in html
    assert "would part scattering and beam skirt by 10.0 sigma" in html


def test_parameters_come_with_error_and_unit(page):
    assert "water.scattering_per_m = 0.0312 ± 0.0007 1/m" in page("identified")


def test_fresh_render_is_shown_on_the_ladder(page):
    html = page("identified")
    assert "rendered afresh" in html
    assert "0.45 ± 0.06" in html


@pytest.mark.usefixtures("undrawn")
def test_readings_on_the_axis_only_and_many_planes(tmp_path):
    on_axis = example(count=1, planes=(4.5, 5.5, 6.5, 7.5, 8.5))
    assert on_axis.scan_axis == "z_m"
    many = example(planes=tuple(np.linspace(3, 9, 9)), two_sided=True)
    assert len(many.groups()) == 9
    assert "Readings and model" in diagnosis_page(many)
    page = diagnosis_page(on_axis)
    assert "along the axis" in page and len(page) > 10_000


def test_groups_name_only_what_differs():
    view = example(planes=(4.5, 6.5), count=3)
    assert [g.label for g in view.groups()] == ["z = 4.5 m", "z = 6.5 m"]
    readings = view.readings
    mixed = DrawnReadings(
        readings.x_m, readings.y_m, readings.z_m, readings.wavelength_nm, readings.value, readings.sigma,
        ["air", "water", "water"] * 2, readings.left_out, readings.time_s,
    )  # fmt: skip
    both = DiagnosisView(mixed, view.predictions, view.verdict)
    assert next(g.label for g in both.groups()) == "z = 4.5 m, air"
    np.testing.assert_array_equal(np.sort(np.concatenate([g.rows for g in both.groups()])), np.arange(6))


def test_the_distance_of_rivals_stands_below_the_headline(page):
    html = page("ambiguous")
    assert ">Scattering or beam skirt: these readings cannot tell.<" in html
    assert ">Scattering lies 1.8 sigma from beam skirt.<" in html


@pytest.mark.usefixtures("undrawn")
def test_readings_set_aside_are_listed_and_stand_below_the_headline(page):
    view = example("none")
    one = {"row": 17, "reason": "outlier", "x_m": 0.3, "y_m": 0.0, "z_m": 4.5, "medium": "water"}
    aside = [
        one | {"wavelength_nm": 525.0, "off_sigma": -46.2},
        one | {"row": 3, "reason": "saturated", "wavelength_nm": None, "off_sigma": None},
    ]
    set_aside = [SetAside(**each) for each in aside]
    verdict = view.verdict.model_copy(update={"set_aside": set_aside, "readings": 245})
    assert verdict.sentence.endswith(
        "1 of 245 readings was set aside: x = 0.3, y = 0, z = 4.5 m, 46 sigma below the model. "
        "1 saturated reading was left out."
    )
    html = diagnosis_page(dataclasses.replace(view, verdict=verdict))
    assert f">{view.verdict.headline}<" in html
    assert ">1 of 245 readings was set aside: x = 0.3" in html
    cells = "".join(f"<td>{c}</td>" for c in ("17", "0.3", "0", "4.5", "water", "525", "-46.2"))
    assert cells in html and "<td>saturated</td>" in html
    assert "Readings set aside" not in page("none")


@pytest.mark.usefixtures("undrawn")
def test_fitted_curves_are_drawn_with_their_errors(page):
    at = np.linspace(0, 12, 40)
    one = at**0
    beam = FittedCurve(
        "lamp.profile_departure", "angle (deg)", "intensity", at, one, 0.01 * at, 0.9 * one, 0.1
    )
    html = diagnosis_page(dataclasses.replace(example(), curves=(beam, beam)))
    assert "Fitted curves with their errors" in html
    assert "Fitted curves with their errors" not in page("ambiguous")
    figure = curve_figure((beam,))
    upper, lower = figure.axes
    assert (upper.get_xlabel(), lower.get_xlabel(), upper.get_ylabel()) == ("", "angle (deg)", "intensity")
    assert upper.get_title("left") + upper.get_title() == "beam profile\nchanging the readings by 10 % rms"
    (band,) = (patch.get_paths()[0].get_extents() for patch in lower.collections)
    assert (band.ymin, band.ymax) == pytest.approx((-0.24, 0.24))


def at_places(kind="ambiguous"):
    """The readings of `example` at places that share no plane and no line."""
    view = example(kind)
    n = view.readings.value.size
    rng = np.random.default_rng(2)
    x_m, y_m, z_m = rng.normal(0, 0.3, n), rng.normal(0, 0.3, n), rng.uniform(2, 9, n)
    return dataclasses.replace(view, readings=dataclasses.replace(view.readings, x_m=x_m, y_m=y_m, z_m=z_m))


@pytest.mark.usefixtures("undrawn")
def test_single_places_are_drawn_as_measured_against_model_and_over_r_and_z():
    view = at_places()
    assert view.is_scattered and not example().is_scattered
    html = diagnosis_page(view)
    assert "along the axis" not in html and "from the axis" in html
    assert "Each reading with its error against what the model says of its place" in html
    drawn = measured_figure(view)
    base, best = drawn.axes
    for axis, prediction in zip((base, best), (view.predictions[0], view.predictions[-1]), strict=True):
        points = axis.containers[0].lines[0]
        kept = ~view.readings.left_out
        unit = view.readings.value.max()
        assert points.get_linestyle() == "None"  # nothing joins places that no scan joins
        assert np.allclose(points.get_xdata(), prediction.value[kept] / unit)
        assert np.allclose(points.get_ydata(), view.readings.value[kept] / unit)
    dots = place_map(view).axes[0].collections[0].get_offsets()
    assert np.allclose(dots[:, 1], np.hypot(view.readings.x_m, view.readings.y_m))


def test_readings_over_decades_are_drawn_logarithmically_and_the_ladder_comes_first(page):
    assert data_figure(example()).axes[0].get_yscale() == "log"
    html = page("identified")
    assert html.index("The error falls") < html.index("Readings and model")


def test_readings_of_no_light_stand_at_the_foot_of_a_logarithmic_axis():
    """Noise about zero takes some of them below it, where such an axis has no place."""
    view = example()
    dark = np.argsort(view.readings.value)[:2]
    value = view.readings.value.copy()
    value[dark] = (-1e-6, 0.0)
    readings = dataclasses.replace(view.readings, value=value)
    shown = data_figure(dataclasses.replace(view, readings=readings))
    uppers = [axis for axis in shown.axes if axis.get_yscale() == "log"]
    marks = [line for axis in uppers for line in axis.lines if line.get_label() == "zero or below"]
    assert sum(len(mark.get_xdata()) for mark in marks) == 2
    assert "zero or below" in [text.get_text() for text in shown.legends[0].get_texts()]


def test_titles_of_panels_do_not_run_into_each_other():
    view, each = example(), np.arange(105)
    made = {"medium": [("water", "air")[k // 2 % 2] for k in each], "wavelength_nm": 460.0 + 160 * (each % 2)}
    shown = data_figure(dataclasses.replace(view, readings=dataclasses.replace(view.readings, **made)))
    shown.draw_without_rendering()
    ends = [axis._left_title.get_window_extent().intervalx for axis in shown.axes[:5]]
    assert all(a[1] < b[0] for a, b in pairwise(ends))


def test_what_could_not_have_been_seen_is_listed_on_the_page_and_in_the_terminal(page):
    view, html = example("none"), page("none")
    assert "What could not have been seen" in html and "lamp drift" in html
    said = as_text(view.verdict)
    assert "could not have been seen, not even at the largest plausible size: lamp_drift" in said


def test_a_telephone_gets_one_panel_a_row():
    view = example()
    for draw in (data_figure, residual_map, signature_figure):
        wide, narrow = draw(view), draw(view, narrow=True)
        assert narrow.get_figwidth() < wide.get_figwidth() / 2
        narrow.draw_without_rendering()
        lefts = {round(axis.get_position().x0, 2) for axis in narrow.axes if not hasattr(axis, "_colorbar")}
        assert len(lefts) == 1, draw.__name__


def in_bands(waves=(460.0, 550.0), times=1.0):
    """The readings of `example` in several bands; the base model's misfit is `times` as large."""
    view = example("ambiguous")
    many, n = len(waves), view.readings.value.size
    columns = {name: np.tile(getattr(view.readings, name), many) for name in vars(view.readings)}
    columns |= {"wavelength_nm": np.repeat(waves, n), "sigma": columns["sigma"] / times}
    predictions = [dataclasses.replace(p, value=np.tile(p.value, many)) for p in view.predictions]
    return dataclasses.replace(view, readings=DrawnReadings(**columns), predictions=predictions)


def test_residuals_of_bands_stand_side_by_side_at_their_own_distances():
    view = in_bands()
    base, other, *after = [axis for axis in residual_map(view).axes if not hasattr(axis, "_colorbar")]
    assert len(after) == 2
    for axis, band in ((base, "460 nm"), (other, "550 nm")):
        at = axis.collections[0].get_offsets()
        assert set(at[:, 1]) == {4.5, 5.5, 6.5, 7.5, 8.5} and len(at) == view.readings.value.size / 2
        assert axis.get_title("left").startswith(f"{band}\nrms ")
    assert base.get_ylabel().startswith("base\n")
    several = residual_map(in_bands(tuple(np.linspace(450, 600, 7))))
    assert several.get_suptitle() == "5 of 7 bands are drawn"


def test_colours_of_residuals_reach_as_far_as_the_misfit():
    """Where it is many times the noise, over decades: else all would be one red."""
    for times in (1.0, 20.0):
        view = in_bands(times=times)
        dots = residual_map(view).axes[0].collections[0]
        most = np.nanmax(np.abs(view.residual_sigma(0)[~view.readings.left_out]))
        assert dots.norm.vmax == pytest.approx(most) and dots.norm.vmin == pytest.approx(-most)
        assert isinstance(dots.norm, SymLogNorm) == (most > FAR_SIGMA)
    assert most > FAR_SIGMA


def test_the_ladder_says_the_table_s_numbers():
    unknown = dict.fromkeys(("held_out_percent", "removed_percent", "rendered_error_percent"))
    rung = Rung(
        label="base", effects=[], error_percent=1234.6, chi2_per_dof=1e5, parameters={}, scene="",
        rendered_stderr_percent=None, **unknown,
    )  # fmt: skip
    drawn = ladder_figure([rung], 1.427)
    said = [text.get_text() for text in drawn.axes[0].texts]
    assert said == [f"{three_digits(1234.6)} %"] and three_digits(1234.6) == "1230"
    assert "noise floor 1.43 %" in [text.get_text() for text in drawn.legends[0].get_texts()]


def test_the_beam_ends_at_the_walls():
    drawn = tank_figure(np.array([0.0]), np.array([0.0]), np.array([9.0]), TANK, (), 30.0)
    beam = next(patch for patch in drawn.axes[0].patches if isinstance(patch, Polygon))
    box = beam.get_clip_box().transformed(drawn.axes[0].transData.inverted())
    assert (box.y0, box.y1) == pytest.approx((-TANK.width_m / 2, TANK.width_m / 2))


@pytest.mark.parametrize(
    ("label", "effects", "short"),
    [
        ("base", 0, "base"),
        ("base + beam_tilt", 1, "base + beam tilt"),
        ("base - background", 0, "base - background"),
        ("base + beam_tilt + scattering", 2, "with 2 effects"),
    ],
)
def test_a_model_of_many_effects_is_called_by_their_number(label: str, effects: int, short: str) -> None:
    assert Prediction(label, np.zeros(3), effects).short_name == short
