"""Free-form curves: what they are made of, and that they find lamps, waters and times that no formula names.

Readings come from closed forms written here, not from the curves of the fit.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from analytic_readings import scene as believed
from beams import flood
from scipy.stats import chi2

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.setup import problem_of
from lightfield.diagnosis.problem.untestable import Hinders, Hindrance
from lightfield.errors import OutputError, UsageError
from lightfield.experiments.layouts import scan
from lightfield.fitting import effects
from lightfield.fitting.curves import ABSORPTION, BEYOND, POWER, PROFILE, is_amplitude
from lightfield.fitting.fitted_curves import FittedCurve, fitted_curves, save_lamp
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit
from lightfield.fitting.smooth_functions import NODES
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.scene.lamp.profile import relative_intensity
from lightfield.studies.compare.readings import fit_readings

#: True half width, absorption, shift of the lamp, background; the scene believes 4 deg, 0.12 and none.
HWHM, PER_M, SHIFT_M, GROUND = 4.6, 0.105, 0.03, 0.01
SURE = 1e-4  # chance of a false alarm of a test by chi-square


def ringed(q: np.ndarray) -> np.ndarray:
    """A narrow core in a ring."""

    def light(q: np.ndarray) -> np.ndarray:
        return 0.7 * np.exp(-np.log(2) * (q / 0.8) ** 2) + 0.3 * np.exp(-(((q - 1.1) / 0.45) ** 2))

    return light(q) / light(np.zeros(1))


def gaussian(q: np.ndarray) -> np.ndarray:
    return np.exp(-np.log(2) * q**2)


def even(at: np.ndarray) -> np.ndarray:
    """No more and no less than the uniform water, or the steady lamp."""
    return np.zeros_like(at)


def readings(
    lamp: Callable[[np.ndarray], np.ndarray] = gaussian,
    depth: Callable[[np.ndarray], np.ndarray] = even,
    power: Callable[[np.ndarray], np.ndarray] = even,
    *,
    layout: str = "line",
    seed: int = 0,
    noise: float = 0.005,
    shift_m: float = 0.0,
    ground: float = 0.0,
) -> Readings:
    """In closed form: I(theta) exp(-a r - depth(z) r/z + power(t)) z / r^3, 1 at most; ground, and noise."""
    rng = np.random.default_rng(seed)
    table = scan(believed(), layout, "random", rng)
    x, y, z = table.x_m - shift_m, table.y_m, table.z_m
    r = np.sqrt(x**2 + y**2 + z**2)
    theta = np.degrees(np.arctan2(np.hypot(x, y), z))
    light = lamp(theta / HWHM) * np.exp(-PER_M * r - depth(z) * r / z + power(table.time_s)) * z / r**3
    value = light / light.max() + ground
    sigma = np.hypot(noise * value, 0.16 * noise)
    return replace(table, value=value + sigma * rng.standard_normal(len(z)), stderr=sigma)


def problem(table: Readings, *names: str) -> Problem:
    made = problem_of(SceneForward(believed(), table), table, map(effects.get, names), None)[0]
    first = {c.name: c for c in reversed(made.candidates)}  # of every named effect its usual form
    return replace(made, candidates=tuple(first[name] for name in names if name in first))


def fitted(problem: Problem, stderr: np.ndarray) -> Fit:
    """The largest curve together with every named effect, from where nothing departs.

    But one of 31 functions, which are for steep edges (test_lamps.py).
    """
    chosen = ([c for c in problem.curves if len(c.amplitudes) < 31][-1], *problem.candidates)

    def whiten(columns: np.ndarray) -> np.ndarray:
        return (columns.T / stderr).T

    base = problem.fit((), whiten, [problem.model().start])
    return problem.fit(chosen, whiten, [np.r_[base.u, np.zeros(sum(len(c.amplitudes) for c in chosen))]])


def curve_of(problem: Problem, fit: Fit) -> FittedCurve:
    (curve,) = fitted_curves(problem.forward, fit)
    return curve


def likely(squares: np.ndarray, of: int) -> bool:
    """May a sum of so many squares of standard normal numbers be this?"""
    return bool(chi2.ppf(SURE / 2, of) < np.sum(squares) < chi2.ppf(1 - SURE / 2, of))


@pytest.mark.parametrize("field", [PROFILE, ABSORPTION, POWER])
def test_functions_are_orthonormal_and_leave_out_what_the_base_model_has(field: str) -> None:
    """By differences of predicted readings: in their logarithm, weighed as the readings are."""
    table = readings(layout="fine")
    forward = SceneForward(believed(), table)
    weight = (np.clip(table.value, 0.005 * table.value.max(), None) / table.stderr) ** 2
    weight /= weight.sum()
    step = 1e-4

    def change(path: str) -> np.ndarray:
        up, down = (np.log(forward.predict({path: sign * step})) for sign in (1, -1))
        return (up - down) / (2 * step)

    columns = np.stack([change(path) for path in forward.scenes.curves.bases[field].paths], axis=1)
    if field == ABSORPTION:  # what it changes on the way to the first plane is a gain
        columns -= weight @ columns
    np.testing.assert_allclose(columns.T @ (weight[:, None] * columns), np.eye(columns.shape[1]), atol=1e-6)
    r = np.sqrt(table.x_m**2 + table.y_m**2 + table.z_m**2)
    theta2 = np.arctan2(np.hypot(table.x_m, table.y_m), table.z_m) ** 2
    base = {
        PROFILE: [np.ones_like(r), theta2 / theta2.max()],
        ABSORPTION: [np.ones_like(r), r],
        POWER: [r**0],
    }
    for smooth in base[field]:
        # Between nodes a square is a straight line, at most a quarter of a step squared (1.3^2) away.
        off = 1.3**2 / 4 / (NODES - 1) ** 2 if smooth is not r else 1e-6
        assert np.abs(columns.T @ (weight * smooth)).max() < off


@pytest.mark.parametrize("name", ["beam_profile", "attenuation_profile", "lamp_power_curve"])
def test_what_the_base_model_explains_is_no_curve(name: str) -> None:
    """A Gaussian of another width in water of another absorption, without noise."""
    table = readings(noise=1e-7)
    found = problem(table, name)
    fit = fitted(found, np.hypot(0.005 * table.value, 8e-4))
    amplitudes = [value for path, value in fit.values.items() if is_amplitude(path)]
    assert amplitudes and np.abs(amplitudes).max() < 1e-4
    assert fit.values["lamp.hwhm_deg"] == pytest.approx(HWHM, rel=1e-3)
    assert fit.values["water.absorption_per_m"] == pytest.approx(PER_M, rel=1e-3)


@pytest.mark.parametrize("lamp", [flood, ringed])
def test_a_lamp_of_its_own_shape_is_found_under_other_effects(lamp: Callable[..., np.ndarray]) -> None:
    """Offset, background, absorption and the profile itself are right within the errors that are stated."""
    names, seeds = ("beam_offset", "background", "beam_profile"), range(12)
    truth = {"lamp.offset_x_m": SHIFT_M, "water.absorption_per_m": PER_M}
    pulls, off, left = [], [], 0.0
    for seed in seeds:
        table = readings(lamp, seed=seed, layout="fine", shift_m=SHIFT_M, ground=GROUND)
        found = problem(table, *names)
        fit = fitted(found, table.stderr)
        assert fit.converged and not fit.at_bound().any()
        errors = fit.stderr()
        pulls.append([(fit.values[path] - true) / errors[path] for path, true in truth.items()])
        curve = curve_of(found, fit)
        places = np.searchsorted(curve.at, HWHM * np.array([0.4, 0.8, 1.2, 1.6]))
        off.append((curve.value - lamp(curve.at / HWHM))[places] / curve.stderr[places])
        left += fit.chi2
        dof = len(table.value) - len(fit.u)
    assert likely(np.square(pulls), len(seeds) * len(truth))
    for place in np.transpose(off):  # at one angle and another they are not independent
        assert likely(place**2, len(seeds))
    assert left / len(seeds) < dof + 4 * np.sqrt(2 * dof / len(seeds))


def test_named_effects_alone_do_not_explain_such_a_lamp() -> None:
    table = readings(ringed, layout="fine", shift_m=SHIFT_M, ground=GROUND)
    found = problem(table, "beam_offset", "background", "beam_shape")

    def whiten(columns: np.ndarray) -> np.ndarray:
        return (columns.T / table.stderr).T

    start = found.default_start(found.model().start, found.candidates)
    assert found.fit(found.candidates, whiten, [start]).chi2 > 10 * len(table.value)


def test_attenuation_along_the_tank_is_found() -> None:
    """K rises by a half in the middle of the tank: a smooth hump, and its integral by quadrature."""

    def hump(z: np.ndarray) -> np.ndarray:
        return 0.05 * np.exp(-(((z - 6.2) / 1.3) ** 2))

    def depth(z: np.ndarray) -> np.ndarray:
        steps = (np.arange(400) + 0.5) / 400
        return (hump(z[:, None] * steps) * z[:, None]).mean(axis=1)

    off = []
    for seed in range(6):
        table = readings(depth=depth, layout="fine", seed=seed)
        found = problem(table, "attenuation_profile")
        fit = fitted(found, table.stderr)
        curve = curve_of(found, fit)
        inner = np.searchsorted(curve.at, [5.2, 6.2, 7.2])
        off.append(((curve.value - PER_M - hump(curve.at)) / curve.stderr)[inner])
        assert fit.chi2 < len(table.value) - len(fit.u) + 4 * np.sqrt(2 * len(table.value))
    for place in np.transpose(off):
        assert likely(place**2, len(off))


def test_a_lamp_that_changes_in_its_own_way_is_found() -> None:
    """It warms up by 6 % and sags by 3 % later on; up to a factor, which is the gain."""

    def power(time_s: np.ndarray) -> np.ndarray:
        part = time_s / np.max(time_s)
        return 0.06 * np.tanh(4 * part) - 0.03 * part**3

    off = []
    for seed in range(6):
        table = readings(power=power, seed=seed)
        found = problem(table, "lamp_power_curve")
        fit = fitted(found, table.stderr)
        curve = curve_of(found, fit)
        ratio = np.log(curve.value) - power(curve.at)
        off.append(((ratio - ratio.mean()) / curve.stderr)[[15, 45, 75, 105]])
        assert fit.chi2 < len(table.value) - len(fit.u) + 4 * np.sqrt(2 * len(table.value))
    for place in np.transpose(off):
        assert likely(place**2, len(off))


def test_curves_are_kept_apart_from_named_effects() -> None:
    """They are no candidates of a search among named effects, and never stand beside what they contain."""
    table = readings()
    told = {"beam_profile", "attenuation_profile", "lamp_power_curve", "plane_gain", "background_curve"}
    names = [*effects.table(), *effects.curves()]
    found = problem(table, *names)
    assert not any(c.effect.is_free_form for c in found.candidates)
    assert {c.name for c in found.curves} == told
    assert not set(effects.curves()) & set(effects.table())
    sizes = {name: [len(c.amplitudes) for c in found.curves if c.name == name] for name in told}
    # Five distances tell of three functions beside gain and absorption, the angles of 45 beside gain and
    # width.
    few = {"attenuation_profile": [2, 3], "plane_gain": [3]}
    in_time = {"lamp_power_curve": [3, 6], "background_curve": [3, 6, 12, 24]}
    assert sizes == {"beam_profile": [2, 4, 7, 11, 19, 31, 45], **in_time, **few}
    # Of these two leave one distance over, that could contradict them; and three none.
    spare = [c.spare for c in found.curves if c.name == "attenuation_profile"]
    assert spare == [1, 0]
    for curve in effects.curves().values():
        for name, effect in effects.table().items():
            # What counts direct light only does not know of what is scattered.
            together = name not in curve.contains and not (curve.diffuse and effect.direct_only)
            assert curve.combines_with(effect) == effect.combines_with(curve) == together


def test_readings_that_cannot_tell_a_curve_say_so() -> None:
    table = readings()
    there = table.z_m < 5
    one_plane = replace(table.subset(there), time_s=np.full(there.sum(), np.nan))
    _, why = problem_of(SceneForward(believed(), one_plane), one_plane, effects.curves().values(), None)
    of_colours = {"attenuation_spectrum", "lamp_spectrum", "background_spectrum", "scattering_spectrum"}
    assert (
        set(why) == {"attenuation_profile", "lamp_power_curve", "plane_gain", "background_curve"} | of_colours
    )
    two = table.subset(table.z_m < 6)
    _, why = problem_of(SceneForward(believed(), two), two, effects.curves().values(), None)
    assert why["attenuation_profile"] == (Hindrance(Hinders.FEW_PLACES),)


def test_amplitudes_mean_the_same_at_other_places_and_of_some_readings() -> None:
    table = readings(ringed)
    forward = SceneForward(believed(), table)
    values = {f"{PROFILE}.1": 0.3, f"{PROFILE}.3": -0.1, f"{ABSORPTION}.1": 0.02, f"{POWER}.2": 0.05}
    rows = np.arange(len(table.value)) % 3 == 0
    every = forward.predict(values)
    np.testing.assert_array_equal(forward.subset(rows).predict(values), every[rows])
    some = table.subset(rows)
    places = {name: getattr(some, name) for name in ("x_m", "y_m", "z_m", "medium", "time_s")}
    np.testing.assert_allclose(forward.at(**places).predict(values), every[rows], rtol=1e-12)
    stated = forward.scenes.at(values)
    again = SceneForward(Scene.from_toml(stated.to_toml()), table)
    np.testing.assert_allclose(again.predict({}), every, rtol=1e-12)
    # What the scene has stays, and is added to.
    np.testing.assert_allclose(again.predict(values) / every, every / forward.predict({}), rtol=1e-4)


def test_a_fitted_profile_is_a_lamp_for_every_scene(tmp_path: Path) -> None:
    table = readings(flood, layout="fine")
    found = problem(table, "beam_profile")
    fit = fitted(found, table.stderr)
    assert save_lamp(found.forward, fit, tmp_path) == tmp_path / "lamp.csv"
    assert save_lamp(found.forward, replace(fit, model=found.model()), tmp_path) is None
    text = '[lamp]\nprofile = "table"\nintensity_table = "lamp.csv"\n[water]\nabsorption_per_m = 0.105\n'
    with_table = Scene.from_toml(text, folder=tmp_path)
    with_curve = found.forward.scenes.at({**fit.values, "water.absorption_per_m": PER_M})
    lit = [direct_field(s, table.x_m, table.y_m, table.z_m) for s in (with_table, with_curve)]
    relative = [light / light.max() for light in lit]
    np.testing.assert_allclose(*relative, atol=3e-4)


def test_no_lamp_is_brighter_beyond_what_was_read() -> None:
    """Nothing holds a curve there: one that ended upwards went on, and had more light than all the rest."""
    table, rng = readings(), np.random.default_rng(5)
    scenes = SceneForward(believed(), table).scenes
    basis = scenes.curves.bases[PROFILE]
    last = basis.place[basis.place <= basis.place[-1] / BEYOND][-1]
    beyond = np.radians(np.linspace(last, 1.5 * basis.place[-1], 200))
    upwards = 0
    for width in (2.0, 4.0, 8.0, 16.0):
        values = dict(zip(basis.paths, rng.uniform(-1, 1, len(basis.paths)), strict=True))
        lamp = scenes.at({**values, "lamp.hwhm_deg": width}).lamp
        light = relative_intensity(lamp, beyond, 0 * beyond)
        assert light.max() < 1.01 * light[0], "between nodes a departure is straight, a Gaussian is not"
        upwards += np.diff(basis.curve(basis.amplitudes(values)))[-1] > 0
    assert upwards, "some end upwards"


def test_a_lamp_of_a_table_may_depart_in_width_too(tmp_path: Path) -> None:
    """Its width is no parameter of the base model: two functions mend a table that is 15 % too narrow."""
    angle = np.linspace(0, 90, 2000)
    rows = "\n".join(f"{a},{i}" for a, i in zip(angle, gaussian(1.15 * angle / HWHM), strict=True))
    (tmp_path / "lamp.csv").write_text(f"angle_deg,intensity\n{rows}\n")
    text = '[lamp]\nprofile = "table"\nintensity_table = "lamp.csv"\n[water]\nabsorption_per_m = 0.12\n'
    scene, table = Scene.from_toml(text, folder=tmp_path), readings(noise=1e-5)
    found, _ = problem_of(SceneForward(scene, table), table, [effects.get("beam_profile")], None)
    stderr = np.hypot(0.005 * table.value, 8e-4)
    assert fitted(replace(found, curves=found.curves[:1]), stderr).chi2 < 0.01 * len(table.value)


def test_compare_fits_a_curve_by_its_name_and_leaves_a_lamp(tmp_path: Path) -> None:
    """The one with most functions, unless a form is named; and never beside what it contains."""
    table = readings(flood, layout="fine", noise=0.01)
    report = fit_readings(table, believed(), ["beam_profile"])
    units = {path: e.unit for path, e in report.estimates.items() if path.startswith(PROFILE)}
    assert units == {f"{PROFILE}.{k}": "1" for k in range(1, 52)}
    report.save(tmp_path)
    lamp = Scene.from_dict({"lamp": {"profile": "table", "intensity_table": str(tmp_path / "lamp.csv")}}).lamp
    theta = np.radians(HWHM * np.array([0.5, 0.9, 1.3]))
    seen = relative_intensity(lamp, theta, 0 * theta)
    np.testing.assert_allclose(seen, flood(np.degrees(theta) / HWHM), atol=0.02)
    with pytest.raises(UsageError, match="no curve with what it contains"):
        fit_readings(table, believed(), ["beam_profile", "beam_shape"])


def test_a_diagnosis_leaves_its_curves_and_its_lamp(tmp_path: Path) -> None:
    """Beside the scenes of its rungs, where the last of them has a curve."""
    table = readings(ringed, noise=0.01)
    made = diagnose(table, believed(), diffuse=None, only=["background"], advise=False)
    found = problem(table, "beam_profile")
    last = replace(made.steps[-1], explanation=found.curves[-2:-1], fit=fitted(found, table.stderr))
    steps = [*made.steps[:-1], last]
    replace(made, basis=replace(made.basis, steps=steps, forward=found.forward)).save(tmp_path / "with")
    made.save(tmp_path / "without")
    assert {"lamp.csv", "curves.json"} <= {path.name for path in (tmp_path / "with").iterdir()}
    assert not {"lamp.csv", "curves.json"} & {path.name for path in (tmp_path / "without").iterdir()}
    (curve,) = json.loads((tmp_path / "with" / "curves.json").read_text())
    at, value, stderr = (np.array(curve[name]) for name in ("at", "value", "stderr"))
    near = at < 1.5 * HWHM
    off = np.abs(value - ringed(at / HWHM))[near]
    assert off.max() < 0.03 and stderr[near].max() < 0.1, "it says something"
    assert np.mean(off <= 2 * stderr[near]) > 0.95, "what is finer than its functions is in its errors"
    fitted_scene = Scene.load(tmp_path / "with" / f"rung{len(steps) - 1}.toml")
    assert fitted_scene.lamp.profile_departure and curve["rms"] > 0.1
    # The next campaign reads that lamp: it is not written over.
    of_it = {"lamp.profile": "table", "lamp.intensity_table": str(tmp_path / "with" / "lamp.csv")}
    scenes = replace(found.forward.scenes, scene=believed().with_values(of_it))
    again = SceneForward(scenes.scene, table, light=replace(found.forward.light, scenes=scenes))
    with pytest.raises(OutputError, match="in use"):
        save_lamp(again, last.fit, tmp_path / "with")


@pytest.mark.parametrize("seed", [0, 1])
def test_a_cloud_that_is_narrower_than_planes_are_apart_is_within_the_errors_of_its_curve(seed: int) -> None:
    """By noise alone half of the curve lay beyond two of its errors (as did half of an exponential fall)."""
    rng = np.random.default_rng(seed)
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-0.6, 0.6, 9), np.linspace(1.5, 6.5, 6)))
    steps = np.linspace(0, 6.6, 6601)
    cloud = 0.12 * np.exp(-(((steps - 3.4) / 0.6) ** 2))
    depth = np.interp(z, steps, np.r_[0, np.cumsum(0.5 * (cloud[1:] + cloud[:-1]) * np.diff(steps))])
    r = np.hypot(x, z)
    light = (
        gaussian(np.degrees(np.arctan2(np.abs(x), z)) / HWHM) * z / r**3 * np.exp(-0.1 * r - depth * r / z)
    )
    light /= light.max()
    error = np.hypot(0.005 * light, 2e-4)
    table = Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=light + error * rng.standard_normal(len(x)), stderr=error,
        time_s=20.0 * rng.permutation(len(x)), quantity="irradiance",
    )  # fmt: skip
    made = diagnose(table, believed(), diffuse=None, only=["background", "attenuation_profile"], advise=False)
    (curve,) = fitted_curves(made.forward, made.steps[-1].fit, made.finding.level.phi, made.widest)
    true = 0.1 + 0.12 * np.exp(-(((curve.at - 3.4) / 0.6) ** 2))
    assert curve.field == ABSORPTION
    assert np.mean(np.abs(curve.value - true) < 2 * curve.stderr) > 0.9
    assert np.median(curve.stderr) < 0.05, "they say something"
