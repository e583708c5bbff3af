"""Cautions: what the table leaves open, what noise and fit say of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np
from scipy import special

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.level import ALPHA
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.setup import errors_believed
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.followed import is_of_the_search_alone
from lightfield.diagnosis.search.pool.uneven_lamp import may_be_detail, of_an_uneven_lamp
from lightfield.diagnosis.search.preparation import Prepared
from lightfield.diagnosis.verdict.cautions.caution import Caution, Warns
from lightfield.diagnosis.verdict.parts import AcceptedExplanation, Estimate, Reason
from lightfield.fitting.curves import PLANES, field_of, is_amplitude
from lightfield.fitting.least_squares import Fit
from lightfield.readings import Readings
from lightfield.readings.columns import LINE_DECIMALS
from lightfield.wording import plain

#: Factors on the stated variance from which on they are spoken of, if their chances are less than these.
#: Chosen: test_diagnosis.py has one that is spoken of and one that is not; errors stated twice too large
#: scatter about a quarter, and less than half of what is stated is no danger to a finding.
_NOTED_SCALE, _NOTED_SMALL, _NO_CHANCE, _LITTLE_CHANCE = 1.5, 0.4, 1e-3, 1e-2
#: Factor on the stated variance from which on the errors are no such. Chosen: ten times in the error.
_NO_ERRORS = 100.0
#: The one scattering coefficient that is fitted without a g of its own.
_SETTLING = "water.settling_per_m"
#: What is left is told to have an order where it is larger than the errors by no more than this. Chosen:
#: beyond, a misfit is seen by eye.
_HARDLY_LARGER = 1.3
#: What the unknowns of `adequacy.templates` go with.
_GOES_WITH = {
    "~x": "the place across the beam", "~plane": "the distance", "~time": "the time",
    "~all": "place, distance and time together", "~bump": "one narrow place across the beam",
    "~ripple": "the angle, to and fro", "~step": "a moment of the scan, before and after",
    "~one plane": "one distance alone",
}  # fmt: skip


def variance_scale(prepared: Prepared, finding: SearchResult) -> float:
    """Variance of the readings' errors over the quoted one: what is left beside what explains the readings
    is noise, too. Errors that were raised here, as bands are no more alike, are not called too large."""
    times = prepared.noise.budget.times_stated
    scale = prepared.excess * finding.level.bench.phi * finding.scale * times**2
    return scale if scale >= 1.0 else min(1.0, scale * prepared.raised)


def cautions(
    readings: Readings, prepared: Prepared, finding: SearchResult, explanations: list[AcceptedExplanation]
) -> list[Caution]:
    """What the table leaves open, what the noise and the fit say of it."""
    out = [Caution.of_table(w) for w in readings.warnings]
    if prepared.doubted:
        out.append(Caution(warns=Warns.ERRORS_DOUBTED))
    scale, nu = variance_scale(prepared, finding), _spare(finding)
    believed = prepared.errors_stated and errors_believed(readings)
    stated = believed and not prepared.doubted  # of what was put in their place nobody is asked
    if stated and scale > _NOTED_SCALE and special.chdtrc(nu, nu * scale) < _NO_CHANCE:
        warns = Warns.SCATTER_FAR_MORE if scale > _NO_ERRORS else Warns.SCATTER_MORE
        out.append(Caution(warns=warns, values={"times": float(np.sqrt(scale))}))
    elif stated and scale < _NOTED_SMALL and special.chdtr(nu, nu * scale) < _LITTLE_CHANCE:
        out.append(Caution(warns=Warns.SCATTER_LESS, values={"times": float(1 / np.sqrt(scale))}))
    if (common := prepared.noise.layout.common.max()) > prepared.problem.layout.common.max():
        out.append(Caution(warns=Warns.IN_COMMON, values={"percent": 100 * float(common)}))
    if finding.levels[0].adequacy.scale_taken:
        on_trust = Warns.STATED_ON_TRUST if prepared.errors_stated else Warns.ASSUMED_ON_TRUST
        out.append(Caution(warns=on_trust))
    if finding.size == 0 and finding.level.tolerance > 0:
        out.append(Caution(warns=Warns.MISFIT_IGNORED))
    if finding.best is not None and (alike := of_an_uneven_lamp(finding.best.explanation)):
        out.append(Caution(warns=Warns.UNEVEN_LAMP, about=", ".join(c.name for c in alike)))
    many = finding.many  # also where something is unexplained: what a curve leaves of an edge, say
    of_best = many.best.explanation if many is not None else ()
    if many is not None and (beside := [c for c in of_best if may_be_detail(many.pool, many.best, c)]):
        out.append(Caution(warns=Warns.FINEST_CURVE, about=", ".join(c.name for c in beside)))
    if (shown := finding.best or finding.closest) is not None:
        out += of_single_readings(prepared.problem, shown.fit)
    out += ordered(prepared, finding) if finding.best is None and finding.size is None else []
    if is_of_the_search_alone(prepared.problem, finding.best.fit if finding.best else finding.level.base):
        out.append(Caution(warns=Warns.UNSETTLED))
    for explanation in explanations[:1]:
        out += at_boundary(explanation.parameters)
        if "water.phase.g" in explanation.parameters:
            out.append(Caution(warns=Warns.OF_ITS_PHASE))
        elif _SETTLING in explanation.parameters:
            out.append(Caution(warns=Warns.OF_THE_SCENES_PHASE, about=_SETTLING))
    return out


def ordered(prepared: Prepared, finding: SearchResult) -> list[Caution]:
    """Where nothing explains the readings, and what is left is hardly larger than their errors: which test it
    fails most."""
    level, closest = finding.level, finding.closest
    fit, adequacy, test = level.base, level.adequacy, level.bench.test
    if closest is not None and closest.adequacy is not None and closest.test is not None:
        fit, adequacy, test = closest.fit, closest.adequacy, closest.test
    spare = max(int(prepared.problem.keep.sum()) - len(fit.u), 1)
    times = float(np.sqrt(fit.chi2 / spare * test.scale))
    if adequacy.p > ALPHA or not prepared.errors_stated or times > _HARDLY_LARGER:
        return []
    worst = min(adequacy.tests, key=lambda name: adequacy.tests[name])
    about = plain(worst[0]) if isinstance(worst, tuple) else _GOES_WITH[str(worst)]
    values = {"times": times, "p": adequacy.tests[worst], "limit": adequacy.critical_p}
    return [Caution(warns=Warns.ORDERED, about=about, values=values)]


def of_single_readings(problem: Problem, fit: Fit) -> list[Caution]:
    """Of gains of planes, how many rest on one reading, and which of these lies farthest off its neighbours:
    a reading that a bubble dimmed made one, which was then certain."""
    if not any(field_of(path) == PLANES for path in fit.paths):
        return []
    basis = problem.forward.scenes.curves.bases[PLANES]
    at = np.round(problem.layout.z_m, LINE_DECIMALS)[problem.keep > 0]
    gain = basis.functions @ basis.amplitudes(fit.values)
    off = {
        float(z): 100 * abs(float(np.expm1(gain[k] - np.interp(z, *_others(basis.place, gain, k)))))
        for k, z in enumerate(basis.place)
        if np.count_nonzero(at == z) == 1
    }
    if not off:
        return []
    worst = max(off, key=lambda z: off[z])
    values = {"planes": len(off), "z_m": worst, "percent": off[worst]}
    return [Caution(warns=Warns.GAIN_OF_ONE, about=PLANES, values=values)]


def _others(place: Array, gain: Array, k: int) -> tuple[Array, Array]:
    return np.delete(place, k), np.delete(gain, k)


def at_boundary(parameters: Mapping[str, Estimate]) -> list[Caution]:
    """What lies at the edge of its range: a caution for each parameter, and one for a curve.

    Parameters
    ----------
    parameters : mapping
        Of the best set, by path.
    """
    held = {path: e.value for path, e in parameters.items() if e.reason is Reason.AT_BOUNDARY}
    alone = [path for path in held if not is_amplitude(path)]
    of_curves = Counter(field_of(path) for path in held if is_amplitude(path))
    return [
        *(Caution(warns=Warns.AT_BOUNDARY, about=path, values={"fitted": held[path]}) for path in alone),
        *(
            Caution(warns=Warns.CURVE_AT_BOUNDARY, about=field, values={"functions": count})
            for field, count in of_curves.items()
        ),
    ]


def _spare(finding: SearchResult) -> float:
    """Degrees of freedom of the noise's scale: of the test's, or of the fit's, whichever it is."""
    told, judged = finding.explaining, finding.adequacy_of(finding.explaining)
    fit = finding.level.base if told is None else told.fit
    return judged.nu if finding.scale <= judged.phi else finding.n - len(fit.u)
