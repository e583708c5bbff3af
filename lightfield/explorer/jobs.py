"""What is done in a process of its own: traces of the maps, diagnoses, reports."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.diagnosis.verdict.words.effects import as_well, called, effect_size, level
from lightfield.diagnosis.verdict.words.stated import named_beside_scene
from lightfield.explorer.beside import Tell
from lightfield.explorer.experiment import all_lit, explored
from lightfield.progress import heard_by
from lightfield.readings import Readings
from lightfield.render.diffuse.directed import Keeper
from lightfield.render.diffuse.source import response_for
from lightfield.render.maps import render_scene
from lightfield.report.diagnosis.drawn import view_of
from lightfield.scene import Scene
from lightfield.studies.compare.readings import fit_readings
from lightfield.wording import plain


@dataclass(frozen=True)
class Diagnosed:
    """What a diagnosis leaves.

    Parameters
    ----------
    verdict : mapping
        Words, explanations and ladder as the page shows them.
    report : str
        The report, HTML.
    """

    verdict: Mapping[str, object]
    report: str


def trace_maps(scene: Scene, readings: Readings | None, dense_per_m: float | None, tell: Tell) -> None:
    """Leave in the cache what the maps and the readings of an experiment need."""
    experiment = explored(scene, readings, partial(response_for, keeper=Keeper(told=tell)), dense_per_m, tell)
    tell("scattered and reflected light for the maps")
    values = {p.path: p.value(p.start) for p in experiment.problem.base} | all_lit(experiment)
    experiment.maps[0].predict(values)


def diagnosed(scene: Scene, readings: Readings, traced: bool, tell: Tell) -> Diagnosed:
    """Diagnose readings, with or without traced light, and draw the report."""
    from lightfield.report.diagnosis.page import diagnosis_page

    source = partial(response_for, keeper=Keeper(told=tell)) if traced else None
    found = diagnose(readings, scene, diffuse=source, progress=tell)
    if found.steps[1:] and traced:
        tell("rendering the explained scene afresh")
        found = found.rendered()
    tell("drawing the report")
    return Diagnosed(verdict_data(found.verdict), diagnosis_page(view_of(found)))


def verdict_data(v: Verdict) -> dict[str, object]:
    """A verdict as the page shows it."""
    explanations = [
        {
            "keys": _keys(one.effects, one.forms),
            "label": " + ".join(named_beside_scene(one, v.stated)) or "nothing is missing",
            "values": {path: estimate.value for path, estimate in one.parameters.items()},
            "error_percent": one.error_percent,
            "chi2_per_dof": one.chi2_per_dof,
            "weight": one.weight,
        }
        for one in v.explanations
    ]
    if not explanations and v.found:
        last = v.ladder[-1]
        explanations = [
            {
                "keys": _keys([f.effect for f in v.found], [f.form for f in v.found]),
                "label": f"{_named(f.effect for f in v.found)}, the best so far",
                "values": {path: estimate.value for path, estimate in last.parameters.items()},
                "error_percent": last.error_percent,
                "chi2_per_dof": last.chi2_per_dof,
                "weight": None,
            }
        ]
    rival = None if as_well(v.found) else v.nearest_rival  # else each effect says what would do as well
    return {
        "kind": v.verdict,
        "headline": v.headline,
        "support": v.support,
        "doubt": v.doubt,
        "explanations": explanations,
        "found": [
            {
                "name": called(one),
                "level": one.level,
                "words": level(one),
                "size": effect_size(one),
                "sigma": one.sigma_to_remove,
                "rival": _named(one.rival),
            }
            for one in v.found
        ],
        "rival": None if rival is None else {"label": _named(rival.effects), "sigma": rival.separation_sigma},
        "next": None if v.next_measurement is None else v.next_measurement.sentence,
        "rendered_percent": v.ladder[-1].rendered_error_percent,
        "floor_percent": v.noise_floor_percent,
    }


def _keys(effects: Sequence[str], forms: Sequence[str]) -> list[str]:
    return [f"{name}:{form}" for name, form in zip(effects, forms, strict=True)]


def _named(effects: Iterable[str]) -> str:
    return " + ".join(plain(name) for name in effects)


def compared(scene: Scene, tell: Tell) -> str:
    """The report of a scene without readings: the formula against its render."""
    from lightfield.maps.dataset import to_dataset
    from lightfield.report.compare.page import comparison_page
    from lightfield.studies.compare.maps import compare

    stage = "rendering the scene that is shown"
    tell(stage)
    with heard_by(lambda words, part: tell(stage, part)):
        dataset = to_dataset(render_scene(scene))
    tell("drawing the report")
    return comparison_page(compare(dataset), dataset.attrs)


def climbed(
    scene: Scene,
    readings: Readings,
    effects: Sequence[str],
    rungs: Sequence[Mapping[str, object]],
    traced: bool,
    tell: Tell,
) -> str:
    """The report of readings before any diagnosis: the model with some effects, fitted, and its ladder.

    Parameters
    ----------
    scene : Scene
        With all effects off.
    effects : sequence of str
        "effect:form" of each that is set free.
    rungs : sequence of mapping
        The ladder that leads to it, as a ledger has its entries.
    """
    from lightfield.report.compare.readings_page import readings_page

    tell("fitting what is shown")
    source = partial(response_for, keeper=Keeper(told=tell)) if traced else None
    report = fit_readings(readings, scene, effects, diffuse=source)
    tell("drawing the report")
    s = report.statistics
    newest = {
        **rungs[-1],
        "error_percent": s.error_percent,
        "chi2_per_dof": s.chi2_per_dof,
        "held_out_percent": s.held_out_percent,
    }
    return readings_page(report, [*rungs[:-1], newest], f"{scene.name or 'Scene'}: model and readings")
