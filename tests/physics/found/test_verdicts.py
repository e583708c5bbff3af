"""Each kind of verdict on readings that the renderer made, not the formula that is asked to explain them.

The readings lie in tests/data/verdicts (its README has the commands and seeds) and in scenes/hidden_effect: a
full trace of the true scene with a lamp of finite size, then noise, gain errors of 0.2 % and position errors
of 0.5 to 1 mm. Hidden sizes are those of the commands. The responses are traced with fewer photons than by
default, to be quick; their error is part of the diagnosis.
"""

from __future__ import annotations

import json
import re
from functools import partial
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from analytic_readings import scene as open_water

from lightfield.diagnosis.adequacy.level import ALPHA
from lightfield.diagnosis.diagnose import Diagnosis, diagnose
from lightfield.diagnosis.plan import plan
from lightfield.diagnosis.verdict.ladder import bright
from lightfield.diagnosis.verdict.verdict import json_schema
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.readings import read_table
from lightfield.render.diffuse.source import response_for
from lightfield.scene import Scene
from lightfield.studies.compare.readings import fit_readings

ROOT = Path(__file__).resolve().parents[3]
DATA = ROOT / "tests" / "data" / "verdicts"
STORY = ROOT / "scenes" / "hidden_effect"
KINDS = ("none", "identified")
SLOW = pytest.mark.slow
#: What colours water; all that is asked there in the quick tests.
COLOURS = ["cdom", "sediment", "chlorophyll", "scattering"]
quick = partial(response_for, photons=1_000_000)
#: In the quick tests: half of them.
fewest = partial(response_for, photons=500_000)


def of_kind(kind: str, diffuse: DiffuseSource = quick) -> Diagnosis:
    story = kind == "identified"
    data, scene = (STORY / "data.csv", STORY) if story else (DATA / f"{kind}.csv", DATA)
    return diagnose(read_table(data), Scene.load(scene / "scene.toml"), diffuse=diffuse)


@pytest.fixture(scope="module")
def dense_of_story() -> list[float]:
    """Water that was asked to be traced, beside the clear one, while the story was diagnosed, per metre."""
    return []


@pytest.fixture(scope="module")
def found(dense_of_story: list[float]) -> dict[str, Diagnosis]:
    """The other kinds are in the slow tier, and in `test_diagnosis.py` in readings of the formula."""

    def watched(*args, dense_per_m=None):
        if dense_per_m is not None:
            dense_of_story.append(dense_per_m)
        return fewest(*args, dense_per_m=dense_per_m)

    return {kind: of_kind(kind, watched if kind == "identified" else fewest) for kind in KINDS}


def test_nothing_hidden_nothing_found(found):
    verdict = found["none"].verdict
    assert (verdict.verdict, verdict.effects, verdict.explanations) == ("none", [], [])
    assert verdict.base_p > ALPHA
    limit = verdict.detection_limits["scattering"]
    assert limit.within_range and limit.value < 0.2, "the size hidden in the story would have been seen"


def test_scattering_is_named_and_measured(found):
    """b = 0.2 per metre, g = 0.92; intervals assume that the class is right: four errors are allowed.

    What is explained is held to the noise floor: the rms of n readings scatters by 1/sqrt(2 n) of itself, and
    three times that are allowed.
    """
    verdict = found["identified"].verdict
    assert (verdict.verdict, verdict.effects) == ("identified", ["scattering"])
    values = verdict.explanations[0].parameters
    for path, truth in (("water.scattering_per_m", 0.2), ("water.phase.g", 0.92)):
        assert abs(values[path].value - truth) < 4 * values[path].stderr, path
    base, explained = verdict.ladder
    assert explained.error_percent < 0.5 * base.error_percent
    assert explained.held_out_percent < 0.5 * base.held_out_percent
    spread = 1 + 3 / np.sqrt(2 * len(found["identified"].readings))
    assert explained.error_percent < spread * verdict.noise_floor_percent
    assert verdict.nearest_rival.separation_sigma > 6


def test_scattering_that_the_scene_has_and_the_readings_lack_is_refuted(found):
    """Readings of clear water, and a scene of b = 0.15 per metre: said with a limit, and the noise is met."""
    scene = Scene.load(DATA / "scene.toml").with_values({"water.scattering_per_m": 0.15})
    few = ["scattering", "background", "beam_tilt"]
    done = diagnose(found["none"].readings, scene, diffuse=fewest, only=few, advise=False)
    verdict, (entry,) = done.verdict, done.verdict.stated
    assert (verdict.verdict, verdict.effects) == ("identified", ["scattering"])
    assert entry.judgement == "absent" and entry.limit < 0.05
    assert "Your scene's scattering is not in the readings" in verdict.sentence
    assert done.scene.water.scattering_per_m == 0
    assert verdict.ladder[-1].error_percent == pytest.approx(
        found["none"].verdict.ladder[-1].error_percent, rel=0.1
    )


def test_scattering_that_the_readings_show_is_supported(found):
    """The story's water, b = 0.2 per metre and g = 0.92, stated as it is."""
    truth = {"water.scattering_per_m": 0.2, "water.phase.g": 0.92}
    scene = Scene.load(STORY / "scene.toml").with_values(truth)
    verdict = diagnose(found["identified"].readings, scene, diffuse=fewest, advise=False).verdict
    assert verdict.verdict == "none"
    (entry,) = (e for e in verdict.stated if e.effect == "scattering")
    assert entry.judgement == "supported" and entry.sigma_to_remove > 10


def test_dense_water_is_traced_only_when_it_explains_the_readings(found, dense_of_story):
    """Fits of the story wander through water of b = 0.5 per m and end at 0.2: one trace is enough."""

    def clear_only(*args, dense_per_m=None):
        return pytest.fail("dense water was traced") if dense_per_m else fewest(*args)

    assert found["identified"].verdict.effects == ["scattering"] and dense_of_story == []
    hazy = Scene.load(STORY / "scene.toml").with_values({"water.scattering_per_m": 0.35})
    with pytest.raises(pytest.fail.Exception, match="dense water"):
        fit_readings(found["identified"].readings, hazy, diffuse=clear_only)


@pytest.mark.slow
def test_the_storys_page_states_its_numbers():
    """Both fits as the page makes them, with all photons: with fewer they move by some per cent."""
    page = (STORY / "README.md").read_text(encoding="utf-8")
    readings = read_table(STORY / "data.csv")
    base = fit_readings(readings, Scene.load(STORY / "scene.toml"), diffuse="trace")
    (stated,) = re.findall(r"error \*\*([\d.]+) %\*\*", page)
    assert base.statistics.error_percent == pytest.approx(float(stated), rel=0.01)
    by_hand = fit_readings(readings, Scene.load(STORY / "scene.toml"), ["scattering"], diffuse="trace")
    for stated in re.findall(r"Error \*\*([\d.]+) %\*\*", page):
        assert by_hand.statistics.error_percent == pytest.approx(float(stated), rel=0.03), (
            "the page rounds by 2 %"
        )


def test_the_explained_scene_rendered_afresh_stays_at_the_noise(found):
    """A trace that took no part in the fit: physics, not curve fitting."""
    rung = found["identified"].rendered(max_photons=1e6).verdict.ladder[-1]
    floor = found["identified"].verdict.noise_floor_percent
    assert rung.rendered_error_percent < np.hypot(floor, 3 * rung.rendered_stderr_percent) + 0.5


@pytest.mark.slow
def test_a_small_tilt_of_lamp_or_detector_is_ambiguous():
    """Both are a slope across the beam; 0.06 degrees are seen, and not told apart."""
    verdict = of_kind("ambiguous").verdict
    jsonschema.validate(json.loads(verdict.model_dump_json()), json_schema())
    assert verdict.verdict == "ambiguous"
    sets = [e.effects for e in verdict.explanations]
    assert ["beam_tilt"] in sets and ["detector_tilt"] in sets
    assert sum(e.weight for e in verdict.explanations) <= 1 + 1e-9
    assert verdict.nearest_rival.separation_sigma < 3
    assert "beam tilt" in verdict.next_measurement.sentence


@pytest.mark.slow
def test_a_shadow_is_unexplained_and_located():
    """A dip of 23 % and 6.5 cm at x = 0.08 m on every plane: no effect of the table.

    In the quick tests `test_beside_unknowns.py` has a shadow, in readings of the formula.
    """
    verdict = of_kind("unexplained").verdict
    assert (verdict.verdict, verdict.effects) == ("unexplained", [])
    assert verdict.unexplained_coordinate == "x"
    assert verdict.next_measurement.readings[0].x_m == pytest.approx(0.08, abs=0.081)


@pytest.mark.parametrize("kind", KINDS)
def test_json_obeys_the_published_schema(found, kind):
    data = json.loads(found[kind].verdict.model_dump_json())
    published = jsonschema.Draft202012Validator(json_schema())
    published.check_schema(published.schema)
    published.validate(data)
    assert not published.is_valid({**data, "verdict": "perhaps"})


@pytest.mark.slow
def test_stored_rungs_give_their_error_again(found, tmp_path):
    """`compare --scene rungN.toml`: gain, width and absorption refitted, and the same minimum found.

    Light that is scattered is traced anew: it is the same within the error that both traces state. As many
    photons as the ladder had: readings are weighed by their scatter about what fits best, and that is
    scattered light.
    """
    done = found["identified"].save(tmp_path)
    again = fit_readings(done.readings, Scene.load(tmp_path / "rung1.toml"), diffuse=fewest)
    modes, smooth = done.prepared.problem.forward.errors(done.steps[1].fit.values)
    before, now = done.steps[-1].fit.prediction, again.model.fit.prediction
    counted = bright(done.prepared.problem)
    own = np.hypot(np.linalg.norm(modes, axis=1), smooth) / before
    rms = [float(np.sqrt(np.mean(part[counted] ** 2))) for part in (now / before - 1, own)]
    assert rms[0] < np.sqrt(2) * rms[1] < 0.02
    assert again.statistics.adequacy_p > 0.01
    base = fit_readings(done.readings, Scene.load(tmp_path / "rung0.toml"), diffuse=fewest)
    assert base.statistics.error_percent == pytest.approx(done.verdict.ladder[0].error_percent, rel=0.01)


@pytest.mark.parametrize(
    ("file", "name", "path", "truth", "only"),
    [
        ("sediment", "sediment", "water.sediment_g_per_m3", 0.5, COLOURS),
        pytest.param("cdom", "cdom", "water.cdom_440_per_m", 0.1, None, marks=SLOW),
        pytest.param("sediment", "sediment", "water.sediment_g_per_m3", 0.5, None, marks=SLOW),
        pytest.param("chlorophyll", "chlorophyll", "water.chlorophyll_mg_per_m3", 0.8, None, marks=SLOW),
        pytest.param("much_sediment", "sediment", "water.sediment_g_per_m3", 2.0, None, marks=SLOW),
    ],
    ids=lambda value: "few" if value is COLOURS else None,
)
def test_what_is_dissolved_or_floats_in_pure_water_is_named(file, name, path, truth, only):
    """Four bands, 450 to 650 nm, half width and grey absorption refitted: the spectrum tells them apart.

    The last water scatters 1.1 per metre: 4 to 7 % of the light on the axis at 5 m was not scattered, and
    a trace in dense water has to be asked for.

    With water that is unknown at every wavelength none of them can be tested.
    """
    table, scene = read_table(DATA / f"{file}.csv"), Scene.load(DATA / "colour.toml")
    verdict = diagnose(table, scene, diffuse=fewest if only else quick, only=only, advise=False).verdict
    assert (verdict.verdict, verdict.effects) == ("identified", [name])
    estimate = verdict.explanations[0].parameters[path]
    assert abs(estimate.value - truth) < 4 * estimate.stderr
    unknown = scene.with_values({"water.base": "none"})
    bare = diagnose(table, unknown, diffuse=None, advise=False, only=[name]).verdict
    assert "free at every wavelength" in bare.untestable[name]


def test_plan_promises_what_diagnose_can_see(found):
    """Limits before the measurement (noise as stated) and after it (noise as seen), at the same fitted scene.

    Direct light only: the places that a plan considers would need a trace of their own.
    """
    table, scene = found["none"].readings, found["none"].scene
    seen = diagnose(table, scene, diffuse=None, advise=False).verdict
    made = plan(table, scene)
    after = {name: limit for name, limit in seen.detection_limits.items() if limit.within_range}
    assert {"beam_tilt", "background", "saturation", "lamp_drift"} <= set(after)
    for name, limit in after.items():
        assert made.limits[name].reachable, name
        print(name, made.limits[name].value, limit.value)
        assert 1 / 1.5 < made.limits[name].value / limit.value < 1.5, name
    assert made.limits["beam_tilt"].value < 0.06, "the tilt of the ambiguous set is seen"


def test_plan_with_traced_light_promises_what_diagnose_can_see(found):
    """Scattering and walls: the limit before the measurement and after it, each from a trace."""
    table, scene = found["none"].readings, found["none"].scene
    after = found["none"].verdict.detection_limits
    made = plan(table, scene, partial(response_for, photons=200_000))
    limit = made.limits["scattering"]
    assert limit.reachable and limit.path == "water.scattering_per_m"
    for name in ("scattering", "wall_reflection", "surface_reflection"):
        if name in after and after[name].within_range:
            assert 1 / 1.5 < made.limits[name].value / after[name].value < 1.5, name
    assert "scattering" in made.isolability.names


def test_four_numbers_say_little_and_say_so():
    """Three parameters leave one number: any effect that moves it explains it.

    Rounding does not: within 5 cm the radii are angles of 3.2 to 4.5 degrees at 4.5 m, and of 2.4 to 3.0 at
    8.5 m; by a regression with the stated errors chi-square is 8.3 for one degree of freedom.
    """
    table = ROOT / "scenes" / "unh_tow_tank"
    bare = diagnose(read_table(table / "measured.csv"), open_water(), diffuse=None).verdict
    assert bare.verdict == "ambiguous" and len(bare.explanations) >= 3
    assert any("too few readings to estimate the noise" in w for w in bare.warnings)
    rounded = read_table(table / "measured_with_rounding.csv")
    verdict = diagnose(rounded, open_water(), diffuse=None).verdict
    assert verdict.verdict == "ambiguous" and any("too few" in w for w in verdict.warnings)
