"""Every answer says itself briefly, draws into the axes that it is given, becomes tables and a page."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from analytic_readings import readings
from matplotlib.figure import Figure

import lightfield as lf
from lightfield.api.light.compare import Comparison, Fit
from lightfield.api.light.maps import Maps
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.errors import SceneWarning
from lightfield.maps.dataset import to_dataset
from lightfield.studies.compare.maps import compare
from lightfield.studies.compare.readings import fit_readings
from lightfield.studies.follower.array_light import ArrayModel, FormulaLight
from lightfield.studies.follower.elements import elements_of

SCENES = Path(__file__).resolve().parents[3] / "scenes"


@pytest.fixture(scope="module")
def table():
    """Readings with a background that nobody told of, and what their experimenter believes."""
    return readings({"detector.background": 0.02}, seed=4)


@pytest.fixture(scope="module")
def diagnosis(table):
    return lf.diagnose(*table, effects=["background", "beam_offset"], trace=False)


@pytest.fixture(scope="module")
def surveyed():
    return lf.array.show(SCENES / "leader_follower" / "clear.toml", trace=False)


@pytest.fixture
def maps(make):
    return Maps(to_dataset(make(pixels=9)))


def answers(table, diagnosis, surveyed, maps):
    """One of every kind that needs no trace, with how many rows its table has."""
    readings, scene = table
    tank = SCENES / "unh_tow_tank"
    follower = SCENES / "leader_follower" / "clear.toml"
    ranged = lf.range(scene, trace=False)
    banded = lf.band(tank / "spectra.toml", trace=False, width=100.0, between=(450.0, 650.0))
    water = lf.attenuation([tank / "spectra.csv"], [tank / "spectra.toml"], trace=False)
    arrays = lf.array.compare(follower, {"flat": follower.with_name("flat.toml")}, trace=False)
    biased = lf.pose.bias(follower, trace=False)
    return {
        "maps": (maps, 3 * 9 * 9),
        "comparison": (Comparison(compare(maps.details), maps), 3),
        "fit": (Fit(fit_readings(readings, scene)), len(readings)),
        "diagnosis": (diagnosis, len(readings)),
        "together": (lf.plan(readings, scene, effects=["background", "beam_offset"], trace=False), 2),
        "following": (lf.follow(follower, runs=1, duration=2.0, trace=False), None),
        "plan": (lf.plan(readings, scene, trace=False), None),
        "range": (ranged, ranged.to_xarray().sizes["z_m"]),
        "band": (banded, 2 * banded.to_xarray().sizes["low_nm"]),
        "attenuation": (water, water.to_xarray().sizes["wavelength_nm"]),
        "arrays": (arrays, 2),
        "bias": (biased, biased.to_xarray()["bias_z"].size),
        "survey": (surveyed, surveyed.to_xarray()["A"].size),
    }


#: Whose pages other tests make; all are drawn in the slow tier.
DRAWN_ELSEWHERE = {"diagnosis", "comparison", "range", "attenuation", "survey", "arrays"}
#: What holds all that it rests on, and goes to no other process.
HEAVY = {"diagnosis", "fit"}


@pytest.mark.usefixtures("undrawn")
def test_every_answer_can_be_read_drawn_tabled_and_written(table, diagnosis, surveyed, maps, tmp_path):
    for name, (answer, rows) in answers(table, diagnosis, surveyed, maps).items():
        assert len(repr(answer)) <= 200 and "\n" not in repr(answer), name
        assert str(answer) == answer.as_text() and answer.headline
        assert isinstance(answer.as_data(), dict)
        axes = Figure().subplots()
        assert answer.plot(axes) is axes, name
        assert axes.has_data() or axes.images, name
        assert rows is None or len(answer.to_pandas()) == rows, name
        assert answer.to_xarray().sizes, name
        shown = answer._repr_html_()
        assert shown.startswith("<div>") and shown.count("<tr") <= 14 and len(shown) < 5000, name
        if name in HEAVY:
            with pytest.raises(
                lf.LightfieldError, match=f"{type(answer).__name__}: holds more than can be pi"
            ):
                pickle.dumps(answer)
        else:
            assert pickle.loads(pickle.dumps(answer)).as_data() == answer.as_data(), name
        if name not in DRAWN_ELSEWHERE:
            page = answer.report(tmp_path / f"{name}.html").read_text(encoding="utf-8")
            assert "</html>" in page and "<svg" in page, name
            assert page.count('<div class="wide"><svg') == page.count("<figure") > 0, name
            assert page.count('<div class="narrow"><svg') == page.count("<figure"), name


@pytest.mark.slow
def test_every_answer_has_a_page(table, diagnosis, surveyed, maps, tmp_path):
    for name, (answer, _) in answers(table, diagnosis, surveyed, maps).items():
        page = answer.report(tmp_path / f"{name}.html").read_text(encoding="utf-8")
        assert "</html>" in page and "<svg" in page, name


def test_a_page_is_written_to_a_path_and_drawn_in_axes(diagnosis):
    with pytest.raises(lf.LightfieldError, match=r"path: .*the path of a file"):
        diagnosis.report(3)
    with pytest.raises(lf.LightfieldError, match=r"ax: .*the axes of a matplotlib figure"):
        diagnosis.plot("a")


def test_an_answer_without_axes_draws_into_a_figure_of_its_own(diagnosis):
    from matplotlib import pyplot

    axes = diagnosis.plot()
    assert axes.get_figure().number in pyplot.get_fignums()
    pyplot.close(axes.get_figure())


def test_a_diagnosis_in_python_is_that_of_the_command(table, diagnosis):
    readings, _ = table
    assert diagnosis.effects == ["background"]
    assert Verdict.model_validate(diagnosis.as_data()) == diagnosis.verdict
    assert diagnosis.scene.detector.background == pytest.approx(
        diagnosis.verdict.explanations[0].parameters["detector.background"].value
    )
    rows = diagnosis.to_pandas()
    np.testing.assert_allclose(rows.value, readings.value)
    np.testing.assert_allclose(rows.residual_sigma * rows.sigma, rows.value - rows.model, atol=1e-12)
    assert rows.base_model.sub(rows.value).std() > 2 * rows.model.sub(rows.value).std()


def test_angles_in_tables_are_degrees_and_names_of_lengths_say_metres(surveyed):
    table, data = surveyed.to_pandas(), surveyed.to_xarray()
    for name, unit in (("sigma_x_m", 1.0), ("sigma_yaw_deg", np.degrees(1.0))):
        np.testing.assert_allclose(table[name], unit * data[name.rpartition("_")[0]].values.ravel())


def test_what_a_diagnosis_says_goes_to_other_processes(diagnosis):
    assert pickle.loads(pickle.dumps(diagnosis.verdict)) == diagnosis.verdict
    assert pickle.loads(pickle.dumps(diagnosis.scene)) == diagnosis.scene


def test_the_inside_of_a_diagnosis_and_readings_are_brief_too(table, diagnosis):
    assert len(repr(diagnosis.details)) < 300 and len(repr(table[0])) < 300


def test_readings_become_a_table_that_lacks_nothing_but_empty_columns(table):
    readings, _ = table
    found = readings.to_pandas()
    assert len(found) == len(readings)
    assert {"x_m", "y_m", "z_m", "medium", "value", "stderr", "time_s"} <= set(found)
    assert "integration_time_s" not in found


def test_markup_in_a_name_stays_text(maps):
    named = Maps(maps.details.assign_attrs(quantity="irradiance"))
    data = named.details.rename({"irradiance": "<b>", "irradiance_stderr": "<b>_stderr"})
    shown = Maps(data.assign_attrs(quantity="<b>"))._repr_html_()
    assert "&lt;b&gt;" in shown and "<b><b>" not in shown.replace("<b>Maps.</b>", "")


def test_the_comparison_gives_the_formula_beside_the_maps(maps):
    comparison = Comparison(compare(maps.details), maps)
    found = comparison.to_xarray()
    for k, plane in enumerate(comparison.details.planes):
        np.testing.assert_array_equal(found.formula.values[0, k], plane.formula)
    assert found.formula.dims == found.irradiance.dims


def test_a_data_set_of_maps_is_compared_as_the_maps_are(maps, tmp_path):
    whole = lf.compare(maps).to_pandas()
    opened = xr.load_dataset(maps.save(tmp_path / "maps.nc"))
    for given in (maps.to_xarray(), opened):
        pd.testing.assert_frame_equal(lf.compare(given).to_pandas(), whole)
    one = lf.compare(maps.to_xarray().isel(z_m=[1])).to_pandas()
    assert one.axis_error.item() == whole.axis_error[1]
    with pytest.raises(lf.LightfieldError, match=r"over wavelength_nm, z_m.*keeps its dimensions"):
        lf.compare(maps.to_xarray().isel(z_m=0))


def test_what_does_not_belong_together_is_refused(table, maps, tmp_path):
    readings, scene = table
    for wrong in (
        lambda: lf.compare(readings),
        lambda: lf.compare(maps, scene),
        lambda: lf.compare(scene, solver="render"),
        lambda: lf.compare(readings, scene, rel_error=0.1),
        lambda: lf.compare(maps, seed=1),
        lambda: lf.sweep(scene, {}, tmp_path / "none.zarr"),
    ):
        with pytest.raises(lf.LightfieldError):
            wrong()


def test_what_does_nothing_in_a_sweep_is_warned_of_where_it_was_asked_for(tmp_path):
    """Drift of the lamp, in maps of time 0."""
    scene = lf.Scene.from_dict({"detector": {"planes_m": [2.0], "pixels": 3}})
    with pytest.warns(SceneWarning, match="lamp.drift_per_hour changes no map") as told:
        lf.sweep(
            scene, {"lamp.drift_per_hour": [0, 0.1]}, tmp_path / "s.zarr", max_photons=1e3, rel_error=0.5
        )
    assert told[0].filename == __file__


@pytest.mark.usefixtures("undrawn")
def test_a_sweep_of_few_photons(tmp_path):
    bands = [[600, 620], [500, 550]]
    scene = lf.Scene.from_dict({"detector": {"planes_m": [2.0, 3.0], "pixels": 7, "bands_nm": bands}})
    vary = {"water.absorption_per_m": np.array([0.05, 0.1]), "lamp.hwhm_deg": "3:5:2"}
    found = lf.sweep(scene, vary, tmp_path / "s.zarr", max_photons=1e3, rel_error=0.5)
    assert found.to_xarray().sizes["water.absorption_per_m"] == 2
    assert found.to_xarray()["lamp.hwhm_deg"].values.tolist() == [3.0, 5.0]
    rows = found.to_pandas()
    assert {"on_axis_irradiance", "water.absorption_per_m"} <= set(rows) and "irradiance" not in rows
    again = lf.Sweep.load(found.path)
    np.testing.assert_array_equal(again.to_xarray().irradiance.values, found.to_xarray().irradiance.values)
    axes = Figure().subplots()
    assert found.plot(axes) is axes and len(axes.lines) == 2
    assert found.to_xarray().wavelength_nm.values.tolist() == [525.0, 610.0]  # rise, as of maps
    assert (
        found.to_xarray().irradiance.isel(wavelength_nm=0)
        < 0.8 * found.to_xarray().irradiance.isel(wavelength_nm=1)
    ).any()
    assert axes.get_title().endswith("\nat wavelength_nm = 525.0, z_m = 2.0")
    with pytest.raises(lf.LightfieldError, match="on_axis_irradiance"):
        found.plot(quantity="irradiance")
    assert "4 cases" in repr(found)
    assert "<svg" in found.report(tmp_path / "s.html").read_text(encoding="utf-8")


def test_poses_come_with_their_errors_in_the_units_of_their_columns(tmp_path):
    """Readings of the array by the formula itself: the poses are found again."""
    follower = lf.Scene.load(SCENES / "leader_follower" / "turbid.toml")
    model = ArrayModel(FormulaLight(follower), elements_of(follower.array))
    truth = np.array([[0.05, 0.0, 5.0, 0.02, 0.0, 0.0], [0.1, 0.0, 6.0, -0.02, 0.0, 0.0]])
    shown = model.readings(truth)
    names = ",".join(f"e{k + 1}" for k in range(shown.shape[1]))
    rows = [f"{k},{','.join(map(repr, row.tolist()))}" for k, row in enumerate(shown)]
    table = tmp_path / "elements.csv"
    table.write_text("\n".join([f"time_s,{names}", *rows]) + "\n")
    found = lf.pose.estimate(table, follower, trace=False)
    poses = found.to_pandas()
    assert poses.time_s.tolist() == [0.0, 1.0]
    assert poses.status.tolist() == ["found", "found"]
    np.testing.assert_allclose(poses[["x_m", "y_m", "z_m"]], truth[:, :3], atol=1e-4)
    np.testing.assert_allclose(poses.yaw_deg, np.degrees(truth[:, 3]), atol=0.01)
    inside = [one.total.sigma for one in found.details.estimates]
    np.testing.assert_allclose(poses.sigma_x_m, [sigma["x"] for sigma in inside])
    np.testing.assert_allclose(poses.sigma_yaw_deg, [np.degrees(sigma["yaw"]) for sigma in inside])
    axes = Figure().subplots()
    assert found.plot(axes) is axes and "2 readings" in repr(found)
    followed = lf.pose.estimate(pd.read_csv(table), follower, filter=True, trace=False)
    track = followed.to_pandas()
    pd.testing.assert_frame_equal(track[poses.columns], poses, rtol=1e-3, atol=1e-4)
    end = followed.details.tracked[-1]
    last = track[["filtered_x_m", "filtered_yaw_deg", "filtered_sigma_x_m", "filtered_sigma_yaw_deg"]].iloc[
        -1
    ]
    yaw = float(np.sqrt(end.total[3, 3]))
    expected = [end.pose[0], np.degrees(end.pose[3]), np.sqrt(end.total[0, 0]), np.degrees(yaw)]
    np.testing.assert_allclose(last.astype(float), expected)
    with pytest.raises(lf.LightfieldError, match="readings: column e1 is missing"):
        lf.pose.estimate(pd.DataFrame({"time_s": [0.0]}), follower, trace=False)
