"""A caution: walls of glass that the scene does not speak of would do better than all that was tried."""

from __future__ import annotations

from dataclasses import replace

from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.verdict.cautions.caution import Caution, Warns
from lightfield.fitting.forward import SceneForward
from lightfield.render.diffuse.source import response_for
from lightfield.render.reflected.reflected_light import applies

#: Panes that are tried: which faces they are, and how bare. Chosen: bare and half of it are far apart.
_TRIED = (("all", 1.0), ("all", 0.5), ("sides", 1.0), ("sides", 0.5))
#: They leave this part of the base model's chi-square at most. Chosen: as of exchanged columns.
_LEAVE = 0.25
#: Of more readings nobody is asked: images of the lamp are seen from every place. Chosen: time, some seconds.
_MOST = 400
#: What takes the place of panes where the scene has none.
_STANDS_IN = "wall_reflection"


def of_glass(forward: SceneForward, problem: Problem, finding: SearchResult) -> list[Caution]:
    """A caution where a tank with panes, with nothing else that is missing, meets the readings better than
    what was found, and what was found leaves something or makes walls reflect.

    Of light that nothing scatters: of all else a trace would be needed.
    """
    scene, closest = forward.scene, finding.closest
    names = {c.name for c in closest.explanation} if closest is not None else set()
    if (
        scene.tank is None
        or scene.tank.panes != "none"
        or not applies(scene)
        or len(forward.readings) > _MOST
    ):
        return []
    if finding.size == 0 or (finding.best is not None and _STANDS_IN not in names):
        return []
    clear = {"tank.wall_albedo": 0.0, "water.scattering_per_m": 0.0}
    base, whiten = finding.level.base, finding.level.bench.whiten
    chi2: dict[str, float] = {}
    for faces, bare in _TRIED:
        glass = scene.with_values(clear | {"tank.panes": faces, "tank.pane_reflectance": bare})
        other = SceneForward(glass, forward.readings, response_for)
        starts = [base.u, problem.model().start]
        chi2[faces] = min(
            chi2.get(faces, base.chi2), replace(problem, forward=other).fit((), whiten, starts).chi2
        )
    best = min(chi2, key=lambda faces: chi2[faces])
    found = base.chi2 if closest is None else min(base.chi2, closest.fit.chi2)
    if chi2[best] > min(_LEAVE * base.chi2, found):
        return []
    told = {"glass": chi2[best] / finding.n, "found": found / finding.n}
    return [Caution(warns=Warns.OF_GLASS, about=f'tank.panes = "{best}"', values=told)]
