"""Effects of the user's own, and local unknowns: found, laddered and planned for like those of the table."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from analytic_readings import readings
from local_unknown import fitted_alone

from lightfield.cli import main
from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.plan import plan
from lightfield.diagnosis.problem.problem import _LEFT as LEFT
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.errors import UsageError
from lightfield.fitting import effects
from lightfield.fitting.effects.local import local_unknowns
from lightfield.fitting.forward import SceneForward
from lightfield.readings import Readings, write_table
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects

DOCUMENT = Path(__file__).parents[3] / "docs" / "own_effects.md"
#: A rope that takes 9 % of the light at x = 0.15 m, 7 cm wide.
DEPTH, PLACE_M, WIDTH_M = 0.09, 0.15, 0.07


def shade(table: Readings) -> np.ndarray:
    return np.asarray(1 - DEPTH * np.exp(-(((table.x_m - PLACE_M) / WIDTH_M) ** 2)))


@pytest.fixture
def own_file(tmp_path: Path) -> Path:
    """The example of the page about them."""
    (example,) = re.findall(r"```toml\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)
    path = tmp_path / "own.toml"
    path.write_text(example, encoding="utf-8")
    return path


def test_the_example_of_the_page_is_found(
    own_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By the command that the page names; its sentence is what the page says."""
    table, believed = readings(factor=shade, seed=3, layout="fine")
    write_table(table, tmp_path / "readings.csv")
    believed.save(tmp_path / "scene.toml")
    line = re.search(r"^    lightfield (diagnose .*)$", DOCUMENT.read_text(encoding="utf-8"), re.MULTILINE)
    assert line is not None
    words = [str(tmp_path / w) if w.endswith((".csv", ".toml")) else w for w in line[1].split()]
    assert main([*words, "--no-trace"]) == 0
    said = re.search(r"the answer is `(.*?)`", DOCUMENT.read_text(encoding="utf-8"))
    assert said is not None and said[1] in capsys.readouterr().out


def test_it_is_ranked_and_laddered_and_its_size_is_right(own_file: Path) -> None:
    table, believed = readings(factor=shade, seed=5, layout="fine")
    found = diagnose(table, with_effects(believed, own_file), diffuse=None, advise=False)
    assert found.verdict.effects == ["rope"]
    assert [rung.label for rung in found.verdict.ladder] == ["base", "+ rope"]
    place = found.verdict.explanations[0].parameters["effect.rope.x0"]
    assert abs(place.value - PLACE_M) < 4 * place.stderr
    # Two fits, each within a thousandth of the least chi-square: 0.03 of an error.
    assert abs(found.scene.get("effect.rope.x0") - place.value) < 2 * np.sqrt(LEFT) * place.stderr
    fitted, fit = Scene.from_toml(found.scene.to_toml()), found.steps[-1].fit
    np.testing.assert_allclose(
        SceneForward(fitted, table).predict({"gain": fit.values["gain"]}), fit.prediction
    )


def test_it_is_planned_for(own_file: Path) -> None:
    table, believed = readings(layout="line")
    made = plan(table, with_effects(believed, own_file), None)
    assert "rope" in made.limits


def test_it_may_not_have_the_name_of_another(own_file: Path) -> None:
    own_file.write_text(own_file.read_text().replace('"rope"', '"background"'))
    with pytest.raises(UsageError, match=r"name of another.*background"):
        effects.all_of(with_effects(Scene(), own_file))


def jump(table: Readings) -> np.ndarray:
    return np.asarray(np.where(table.time_s > 0.6 * table.time_s.max(), 0.93, 1.0))


def bubble(table: Readings) -> np.ndarray:
    """A fifth less for some minutes."""
    return 1 - 0.2 * np.exp(-(((table.time_s - 900.0) / 120.0) ** 2))


def hum(table: Readings) -> np.ndarray:
    return np.asarray(1 + 0.03 * np.sin(2 * np.pi * table.time_s / 420.0))


def rings(table: Readings) -> np.ndarray:
    theta = np.degrees(np.arctan2(np.hypot(table.x_m, table.y_m), table.z_m))
    return np.asarray(1 + 0.04 * np.sin(2 * np.pi * theta / 1.7 + 0.4))


@pytest.mark.parametrize(
    ("hidden", "name", "true"),
    [
        (shade, "dip_in_x", {"depth": DEPTH, "x0": PLACE_M, "width": WIDTH_M}),
        (jump, "step_in_time", {"size": -0.07}),
        (bubble, "dip_in_time", {"depth": 0.2, "time0": 900.0, "duration": 120.0}),
        (hum, "ripple_in_time", {"a": 0.0, "b": 0.03, "period": 420.0}),
        (rings, "ripple_over_angle", {"a": 0.04 * np.sin(0.4), "b": 0.04 * np.cos(0.4), "period": 1.7}),
        (rings, "ripple_at_receiver", {"a": 0.04 * np.sin(0.4), "b": 0.04 * np.cos(0.4), "period": 1.7}),
    ],
)
def test_local_unknowns_are_found_where_they_are(hidden, name: str, true: dict[str, float]) -> None:
    """Three numbers each; their sizes within the errors of the fit, from starts over their ranges."""
    table, believed = readings(factor=hidden, seed=1, layout="fine")
    base, fit = fitted_alone(table, believed, name)
    assert len(fit.u) == len(base.u) + 3
    assert fit.chi2 < 0.5 * base.chi2
    errors, values = fit.stderr(), fit.values
    for key, value in true.items():
        path = f"effect.{name}.{key}"
        assert abs(values[path] - value) < 4 * errors[path], key


#: Of readings along x at several distances, with times.
NAMES = [
    "dip_in_x", "step_in_time", "dip_in_time", "ripple_in_time", "passing_cloud", "plume", "gain_step",
    "ripple_over_angle", "ripple_at_receiver",
]  # fmt: skip


def test_local_unknowns_are_those_that_readings_can_tell_of() -> None:
    table, _ = readings(layout="fine")
    assert [e.name for e in local_unknowns(table)] == NAMES
    still = replace(table, x_m=0 * table.x_m, time_s=np.full(len(table.value), np.nan))
    assert [e.name for e in local_unknowns(still)] == ["gain_step"]
    assert local_unknowns(replace(still, value=np.ones(len(table.value)))) == ()


def around(z_m: float, turns_deg: np.ndarray) -> np.ndarray:
    """Places on a ring of 0.1 z at one distance, (n, 3)."""
    turn = np.radians(turns_deg)
    return np.stack([0.1 * z_m * np.cos(turn), 0.1 * z_m * np.sin(turn), np.full(len(turn), z_m)], axis=1)


@pytest.mark.parametrize(("step_deg", "told"), [(90, False), (45, True), (30, True)])
def test_four_corners_ask_for_more_than_a_cross(step_deg: int, told: bool) -> None:
    x, y, z = around(2.0, np.arange(0, 360, step_deg)).T
    table = Readings.from_arrays(x_m=x, y_m=y, z_m=z, value=np.linspace(1, 2, len(x)))
    assert ("square_beam" in [e.name for e in local_unknowns(table)]) == told


PLANES_M = (1.5, 2.5, 4.0)


def square(power: float, turn_deg: float, seed: int) -> tuple[Readings, float]:
    """On a grid: I = exp(-ln2 (|tx|^p + |ty|^p) / 8^p), turned about the axis, in water of 0.08 per m; and
    the largest angle, degrees."""
    places = np.linspace(-0.25, 0.25, 9)
    x, y, z = np.array([(a * z, b * z, z) for z in PLANES_M for a in places for b in places]).T
    r, rng = np.sqrt(x * x + y * y + z * z), np.random.default_rng(seed)
    theta, at = np.degrees(np.arctan2(np.hypot(x, y), z)), np.arctan2(y, x) - np.radians(turn_deg)
    sides = np.abs(theta * np.cos(at) / 8.0) ** power + np.abs(theta * np.sin(at) / 8.0) ** power
    value = np.exp(-np.log(2) * sides - 0.08 * r) * z / r**3
    sigma = np.hypot(0.004 * value, 2e-4 * value.max())
    value = value + sigma * rng.standard_normal(len(value))
    return Readings.from_arrays(x_m=x, y_m=y, z_m=z, value=value, stderr=sigma), float(theta.max())


def of_square(table: Readings) -> Verdict:
    believed = Scene.from_dict({"lamp": {"hwhm_deg": 8.0}, "water": {"absorption_per_m": 0.1}})
    return diagnose(table, believed, diffuse=None, only=["beam_shape", "beam_skirt"], advise=False).verdict


def test_a_square_beam_is_told_beside_its_steepness() -> None:
    """Of power 4 it is a super-Gaussian of exponent 4 all round, wider in its mean than along its sides,
    times exp(-ln2/4 (theta/hwhm)^4 cos 4 phi)."""
    table, widest_deg = square(4.0, 0.0, seed=2)
    verdict = of_square(table)
    assert (verdict.verdict, verdict.unexplained_coordinate) == ("unexplained", "azimuth")
    assert "looks like a square beam" in verdict.sentence
    best = verdict.left_over[0]
    assert (best.name, best.beside, best.adequate) == ("square_beam", ["beam_shape"], True)
    corners, turned, power = (best.parameters[name] for name in ("a", "b", "power"))
    true = np.log(2) / 4 * (widest_deg / 2 / 8.0) ** 4
    assert abs(corners.value - true) < 3 * corners.stderr
    assert abs(turned.value) < 3 * turned.stderr
    assert abs(power.value - 4.0) < 3 * power.stderr
    # Drawn all round, brightest in the corners.
    assert abs(best.at[int(np.argmax(best.factor))]) % 90 == pytest.approx(45, abs=2)
    assert len(best.read_at) > 8


def test_a_steeper_square_is_told_and_its_ladder_falls() -> None:
    """Of power 8 and turned it is no unknown's form: it has a term of eight times the direction too. A rung
    with the corners alone, at their size beside the beam's steepness, left millions of per cent."""
    verdict = of_square(square(8.0, 30.0, seed=5)[0])
    best = verdict.left_over[0]
    assert (best.name, best.beside) == ("square_beam", ["beam_shape"])
    chi2 = [rung.chi2_per_dof for rung in verdict.ladder]
    errors = [rung.error_percent for rung in verdict.ladder]
    assert chi2 == sorted(chi2, reverse=True) and errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.01 * errors[0]
    (water,) = (e for path, e in verdict.ladder[-1].parameters.items() if path == "water.absorption_per_m")
    assert abs(water.value - 0.08) < 3 * water.stderr


@pytest.mark.slow
def test_unexplained_readings_leave_hypotheses_that_explain_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Rings of the lamp, 4 %: no effect of the table, and one of those that are proposed."""
    table, believed = readings(factor=rings, seed=2, layout="fine")
    write_table(table, tmp_path / "readings.csv")
    believed.save(tmp_path / "scene.toml")
    out, command = tmp_path / "out", ["diagnose", str(tmp_path / "readings.csv"), "--no-trace"]
    command += ["--scene", str(tmp_path / "scene.toml"), "-o", str(out)]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert f"for --effects-file: {out / 'hypotheses.toml'}" in said
    assert main([*command, "--effects-file", str(out / "hypotheses.toml")]) == 0
    # Of a lamp that points along the axis nobody can tell whether it or the receiver has the rings.
    assert capsys.readouterr().out.count("Ripple") == 1


def test_an_unexplained_rest_comes_with_its_curve(tmp_path: Path) -> None:
    """A plume shades the rays that pass x = -0.2 m at 6 m: the verdict stays open, and says where."""

    def plume(table: Readings) -> np.ndarray:
        there = np.exp(-(((table.x_m * 6 / table.z_m + 0.2) / 0.1) ** 2))
        return np.asarray(1 - 0.25 * there * (table.z_m > 6))

    table, believed = readings({"detector.background": 0.01}, factor=plume, seed=3, noise=0.004)
    found = diagnose(table, believed, diffuse=None, only=["background", "beam_tilt"])
    verdict = found.verdict
    assert verdict.verdict == "unexplained"
    best = verdict.left_over[0]
    assert (best.name, best.coordinate, best.beside) == ("plume", "x", ["background"])
    # Where between two planes it rises nobody can tell: its middle and its width are rays, x/z.
    rises = best.parameters["z0"].value / 6
    assert 6 / 6 < rises < 6.5 / 6
    for name, true in (("depth", 0.25), ("x0", -0.2 * rises), ("width", 0.1 * rises)):
        estimate = best.parameters[name]
        assert estimate.stderr is not None and abs(estimate.value - true) < 4 * estimate.stderr, name
    assert verdict.unexplained_coordinate == best.coordinate, "headline and curve speak of one thing"
    assert verdict.misfit is not None
    worst = np.array(best.read_at)[np.interp(best.read_at, best.at, best.factor).argmin()]
    assert verdict.misfit.worst_at == worst, "where readings tell of it"
    assert verdict.next_measurement is not None
    (spot,) = verdict.next_measurement.readings
    assert spot.z_m > 6 and abs(spot.x_m * 6 / spot.z_m + 0.2) < 0.1, "in the shadow"
    # Drawn at the farthest plane, 8.5 m: the shadow lies at x = -0.2 * 8.5 / 6 m.
    far = float(table.z_m.max())
    at, factor = np.array(best.at), np.array(best.factor)
    assert at[factor.argmin()] == pytest.approx(-0.2 * far / 6, abs=0.03)
    assert factor.min() == pytest.approx(0.75, abs=0.04)
    # The readings beyond it lie on that curve, within their noise of 0.4 % (and more where light is little).
    off = np.array(best.read) - np.interp(best.read_at, at, factor)
    assert len(off) > 20 and np.median(np.abs(off)) < 0.01
    assert (
        "A plume beside background describes" in verdict.sentence
        and f"such as {best.formula}" in verdict.sentence
    )
    found.save(tmp_path)
    proposed = tmp_path / "hypotheses.toml"
    assert 'name = "plume"' in proposed.read_text().partition("[[effect]]")[2][:60]
    # Effects that were read, perhaps with changes of one's own, are not written over by new ones.
    proposed.write_text("# mine")
    found.save(tmp_path, effects_file=tmp_path / "x" / ".." / proposed.name)
    assert proposed.read_text() == "# mine"
