"""A diagnosis as the report draws it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.subspace import INDEPENDENT, beside, orthonormal
from lightfield.diagnosis.search.small_sets import ScoredSet
from lightfield.diagnosis.search.told_apart import separation
from lightfield.diagnosis.verdict.ladder import adds
from lightfield.fitting.fitted_curves import fitted_curves
from lightfield.fitting.least_squares import Fit
from lightfield.readings import Readings
from lightfield.report.diagnosis.view import DiagnosisView, DrawnReadings, Prediction, Separation, Signature
from lightfield.scene.lamp.width import stated_width_deg

if TYPE_CHECKING:
    from lightfield.diagnosis.diagnose import Diagnosis

_COMPARED = 6
#: A rejected explanation that comes no nearer to the readings than this, in sigma, is itself next to nothing.
_VISIBLE_SIGMA = 3.0
#: What a step of a fit may leave of the chi-square of a distance: so much, or this part of what it were if
#: all were linear. The matrix has two digits, and thirty fits to a hundredth of a sigma take as long as the
#: diagnosis itself (in a turbid tank 28 s; so 16 s, and no cell of another colour).
_UNSEEN, _UNSEEN_PART = 0.05, 0.002


def _separations(found: Diagnosis) -> Separation | None:
    """Distances between the accepted explanations and the best of the others."""
    finding, problem = found.finding, found.prepared.problem
    # Of more than two effects the gaps tell, and every distance would take a fit of all of them.
    if not finding.accepted or finding.beyond_two:
        return None
    chosen = list(finding.accepted[:_COMPARED])
    whiten, phi = finding.whiten, finding.level.phi
    seen = finding.level.base.chi2 - _VISIBLE_SIGMA**2 * phi
    for tried in sorted(finding.tried, key=lambda t: t.bic):
        if len(chosen) >= _COMPARED:
            break
        if (
            len(tried.explanation) == len(chosen[0].explanation)
            and tried.fit.chi2 < seen
            and all(tried.names != c.names for c in chosen)
        ):
            chosen.append(tried)

    def between(one: ScoredSet, other: ScoredSet) -> float:
        if one is other:
            return 0.0
        left = max(_UNSEEN, _UNSEEN_PART * linear(one.fit, other.fit))
        return separation(problem, whiten, one.fit, other, phi, left).separation_sigma

    sigma = np.array([[between(one, other) for other in chosen] for one in chosen])
    return Separation([c.names for c in chosen], sigma)


def linear(truth: Fit, rival: Fit) -> float:
    """Chi-square between readings under `truth` and those of a rival, were it linear in its parameters."""
    away = (rival.residual - truth.residual)[:, None]
    return float(np.sum(beside(orthonormal(rival.jacobian, INDEPENDENT), away) ** 2))


def _tidy(metres: Array) -> Array:
    """To a tenth of a millimetre: 1e-16 m is rounding, and no part of a title."""
    return np.asarray(np.round(metres, 4) + 0.0)


def drawn_readings(readings: Readings, sigma: Array, keep: Array) -> DrawnReadings:
    """Readings as figures draw them: errors of shape (n,), and `keep` 0 for what does not count."""
    return DrawnReadings(
        _tidy(readings.x_m),
        _tidy(readings.y_m),
        _tidy(readings.z_m),
        readings.wavelength_nm,
        readings.value,
        sigma,
        [str(m) for m in readings.medium],
        keep == 0,
        readings.time_s,
    )


def view_of(found: Diagnosis) -> DiagnosisView:
    """Everything on the page of a diagnosis."""
    readings, problem, finding = found.readings, found.prepared.problem, found.finding
    base = finding.level.base.prediction
    verdict = found.verdict
    return DiagnosisView(
        drawn_readings(readings, found.sigma, problem.keep),
        [
            Prediction(
                " ".join(s.label for s in found.steps[: k + 1]),
                step.fit.prediction,
                sum(map(adds, step.explanation)),
            )
            for k, step in enumerate(found.steps)
        ],
        verdict,
        [Signature(" + ".join(t.names), t.fit.prediction - base) for t in finding.accepted],
        _separations(found),
        found.forward.scene.tank,
        stated_width_deg(found.scene.lamp),
        found.forward.scene.name or "Diagnosis",
        (
            ("readings", readings.source or "given as arrays"),
            ("number of readings", str(verdict.readings)),
            ("lightfield", verdict.lightfield_version),
            ("scene", found.forward.scene.digest()[:16]),
            ("seed", str(verdict.seed)),
            ("run on these readings", str(verdict.run)),
        ),
        found.scene.to_toml(),
        fitted_curves(found.forward, found.steps[-1].fit, finding.level.phi, found.widest),
    )
