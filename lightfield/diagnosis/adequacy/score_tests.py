"""Is anything still missing? Score tests of every absent effect and of smooth unknowns, calibrated together.

Valid when the errors are Gaussian with the covariance of the noise module up to one unknown scale, and the
model is nearly linear in its parameters over their uncertainty. Nominal p-values are never used as they are:
the smallest one is compared with the smallest ones of a parametric bootstrap that repeats the whole
calculation (Westfall and Young 1993, Resampling-based multiple testing, Wiley), which takes care of their
number, their correlations, one-sided effects, and shapes that mean nothing without amplitude.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import special

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.subspace import DISTINCT, INDEPENDENT, TINY, beside, orthonormal
from lightfield.diagnosis.adequacy.templates import Template, bank
from lightfield.diagnosis.problem.problem import Problem
from lightfield.fitting.least_squares import Fit, Whiten

#: Family-wise level at which the base model is given up. Chosen: one false alarm in a hundred tables;
#: tests/unit/diagnosis/test_adequacy.py holds it where nothing is missing.
ALPHA = 0.01
SPANS = ("x", "plane", "time")
SCANS = ("bump", "ripple", "step", "one plane")
#: A template that keeps less than this part of its length beside the free parameters is absorbed by them.
#: Chosen: forward differences over a hundredth of the typical size (`candidates.STEP`) are hardly better.
ABSORBED = 1e-3
#: A column of a scan that keeps less than this is next to what the fit moves. Chosen: at a twentieth its
#: amplitude would have to be twenty times the noise to be seen.
_VISIBLE = 0.05
#: Scatter up to this many times the quoted variance is put down to errors quoted too small: a factor of two
#: in the standard error, as tables are wrong (tests/physics/test_diagnosis.py has 1.7).
VARIANCE_EXCESS = 4.0
#: More scatter than that is a misfit when it has this chance. Chosen: a tenth of ALPHA, which it adds to.
EXCESS_LEVEL = 1e-3
#: Fewer readings than this beyond what the tests use up cannot tell the noise; its scale is taken as stated.
#: Chosen: the error of a scale from four is 70 %.
FEWEST_SPARE = 4
#: Fewer than this, and the smooth unknowns but for those across the beam are taken to be absent from the
#: scale's misfit: it is known to 50 %, and what they would take from it is not.
_FEWEST_BESIDE_ALL = 8
#: Degrees of freedom that stand for a known scale: quantiles of t are normal ones to 0.2 % at ALPHA.
_CERTAIN = 1000
#: k neighbouring columns count as k to this power independent ones in the nominal p of a scan. Chosen, for
#: the weight of a scan among the tests alone: what is said rests on the bootstrap.
_SCAN_POWER = 0.7
#: Rounding of a sum of squares.
_ROUNDING = 1e-12
#: Replicates that are tested at a time, to bound the memory.
_AT_ONCE = 200


@dataclass(frozen=True)
class Score:
    """Score test of one effect at one shape.

    Parameters
    ----------
    direction : array, shape (n, q)
        Orthonormal directions of the projected template.
    to_amplitude : array, shape (q, q)
        Amplitudes = to_amplitude @ direction.T @ residual.
    length : float
        Length of the projected template per unit (first) amplitude: 1/length is its standard error at phi =
        1.
    """

    template: Template
    direction: Array
    to_amplitude: Array
    length: float
    testable: bool

    @property
    def key(self) -> tuple[str, str]:
        return self.template.candidate.key


@dataclass(frozen=True)
class Adequacy:
    """Verdict of the test on one fit.

    Parameters
    ----------
    p : float
        Family-wise probability of so bad a worst test if nothing were missing.
    phi, nu : float, int
        Pure-error variance scale from what neither an effect nor a smooth unknown can reach; its degrees of
        freedom.
    tests : mapping
        Nominal p of each test: (effect, form), or "~" and the unknown's name.
    excess_p : float
        Probability of so large a scatter, were the errors quoted up to a factor 2 too small.
    scale_taken : bool
        Too few readings to estimate the scale of the noise: the stated errors are taken as they are.
    critical_p : float
        Nominal p of the worst test that is undercut with probability ALPHA where nothing is missing.
    """

    p: float
    phi: float
    nu: int
    tests: Mapping[object, float]
    scores: tuple[Score, ...]
    amplitudes: tuple[Array, ...]
    excess_p: float
    scale_taken: bool = False
    critical_p: float = ALPHA

    @property
    def worst(self) -> object:
        return min(self.tests, key=lambda k: self.tests[k])

    def passes(self, alpha: float) -> bool:
        """Nothing is missing at family-wise level `alpha`, and the scatter is credible."""
        return self.p > alpha and self.excess_p > EXCESS_LEVEL


def _score(template: Template, free: Array) -> Score:
    rest = beside(free, template.columns)
    before, after = np.linalg.norm(template.columns, axis=0), np.linalg.norm(rest, axis=0)
    visible = after > ABSORBED * np.maximum(before, TINY)
    q = template.columns.shape[1]
    if not visible.any():
        return Score(template, np.zeros((len(rest), 0)), np.zeros((q, 0)), 0.0, False)
    u, s, vt = np.linalg.svd(rest[:, visible] / after[visible], full_matrices=False)
    strong = s > DISTINCT * s[0]
    to_amplitude = np.zeros((q, int(strong.sum())))
    to_amplitude[visible] = (vt[strong].T / s[strong]) / after[visible][:, None]
    return Score(template, u[:, strong], to_amplitude, float(after[visible][0]), True)


class AdequacyTest:
    """The test, ready for fits that share one whitening.

    Parameters
    ----------
    unknowns : mapping of array, shape (n, k)
        Whitened smooth unknowns, spans and scans.
    noise : callable
        Gives whitened noise, shape (n, n_bootstrap), when a fit is tested.
    errors_stated : bool
        The table quotes standard errors, so that their scale can be doubted.
    """

    def __init__(
        self,
        problem: Problem,
        whiten: Whiten,
        unknowns: Mapping[str, Array],
        noise: Callable[[], Array],
        errors_stated: bool,
        scale: float = 1.0,
    ) -> None:
        self.problem, self.whiten, self.unknowns = problem, whiten, unknowns
        self.noise, self.errors_stated, self.scale = noise, errors_stated, scale

    @cached_property
    def replicates(self) -> Array:
        """Whitened noise, shape (n, n_bootstrap)."""
        return self.noise()

    def on(self, problem: Problem) -> AdequacyTest:
        """The same test of a problem whose forward model has changed a little."""
        return AdequacyTest(problem, self.whiten, self.unknowns, self.noise, self.errors_stated, self.scale)

    def __call__(self, fit: Fit) -> Adequacy:
        """Test one fit."""
        n_kept = int(self.problem.keep.sum())
        bound = fit.at_bound()
        free = orthonormal(fit.jacobian[:, ~bound], INDEPENDENT)
        scores = tuple(_score(t, free) for t in bank(self.problem, fit, self.whiten))
        testable = [s for s in scores if s.testable]
        spans = {k: orthonormal(beside(free, self.unknowns[k])) for k in SPANS if self.unknowns[k].shape[1]}
        together = np.hstack(list(spans.values()) or [np.zeros((len(free), 0))])
        spans["all"] = orthonormal(together)
        scans = {k: self._unit(free, self.unknowns[k]) for k in SCANS}
        directions = [s.direction for s in testable]
        reach = orthonormal(np.hstack([free, *directions, together, scans["step"], scans["one plane"]]))
        if n_kept - reach.shape[1] < _FEWEST_BESIDE_ALL:
            reach = orthonormal(np.hstack([free, *directions, *[v for k, v in spans.items() if k == "x"]]))
        spare = n_kept - reach.shape[1]
        taken = spare < FEWEST_SPARE
        nu = _CERTAIN if taken else spare
        views = _Views(free, None if taken else reach, testable, spans, scans, nu)
        chance = np.concatenate(
            [
                views.p_values(self.replicates[:, first : first + _AT_ONCE])[0].min(0)
                for first in range(0, self.replicates.shape[1], _AT_ONCE)
            ]
        )
        observed = beside(free, fit.residual[:, None])
        seen_p, labels, phi = views.p_values(observed)
        worst = float(seen_p.min())
        p = (1 + int((chance <= worst).sum())) / (1 + len(chance))
        excess = float(phi[0]) * self.scale / VARIANCE_EXCESS
        return Adequacy(
            p,
            float(phi[0]),
            nu,
            dict(zip(labels, map(float, seen_p[:, 0]), strict=True)),
            scores,
            tuple(s.to_amplitude @ (s.direction.T @ observed[:, 0]) for s in scores),
            float(special.chdtrc(nu, nu * excess)) if self.errors_stated and not taken else 1.0,
            taken,
            float(np.quantile(chance, ALPHA)),
        )

    @staticmethod
    def _unit(free: Array, columns: Array) -> Array:
        before = np.linalg.norm(columns, axis=0)
        rest = beside(free, columns)
        after = np.linalg.norm(rest, axis=0)
        visible = after > _VISIBLE * np.maximum(before, TINY)
        return np.asarray(rest[:, visible] / after[visible])


class _Views:
    """All that a test looks at, as columns that whitened noise is projected on at once.

    Parameters
    ----------
    free : array, shape (n, p)
        Orthonormal basis of what the fit moves; all but `reach` are perpendicular to it.
    reach : array, shape (n, k), optional
        Orthonormal basis of all that is not pure error; None: the scale of the errors is taken as stated.
    scores : list of Score
    spans, scans : mapping of array, shape (n, k)
    nu : int
        Degrees of freedom of the pure error.
    """

    def __init__(
        self,
        free: Array,
        reach: Array | None,
        scores: list[Score],
        spans: Mapping[str, Array],
        scans: Mapping[str, Array],
        nu: int,
    ) -> None:
        self.scores, self.spans, self.scans, self.nu = scores, spans, scans, nu
        self._fitted_in_reach = None if reach is None else reach.T @ free
        fixed = [free] if reach is None else [free, reach]
        parts = [*fixed, *(s.direction for s in scores), *spans.values(), *scans.values()]
        self._ends = np.cumsum([part.shape[1] for part in parts])[:-1]
        self._columns = np.hstack(parts)

    def p_values(self, residuals: Array) -> tuple[Array, list[object], Array]:
        """Nominal p of every test, shape (n_tests, m), its name, and the scale of the pure error, shape (m,).

        Parameters
        ----------
        residuals : array, shape (n, m)
            Whitened.
        """
        nu = self.nu
        seen = iter(np.split(self._columns.T @ residuals, self._ends))
        fitted = next(seen)
        total = np.maximum((residuals**2).sum(0) - (fitted**2).sum(0), 0.0)
        phi = np.ones_like(total)
        if self._fitted_in_reach is not None:
            reached = next(seen) - self._fitted_in_reach @ fitted
            phi = np.maximum(total - (reached**2).sum(0), _ROUNDING * total + TINY) / nu
        best: dict[object, Array] = {}
        for score in self.scores:
            projected = next(seen)
            q = len(projected)
            if q == 1:
                z = projected[0] / np.sqrt(phi)
                if score.template.candidate.one_sided:
                    sign = np.sign(score.to_amplitude[np.abs(score.to_amplitude).argmax()])
                    p = np.where(sign * z > 0, special.stdtr(nu, -sign * z), 1.0)
                else:
                    p = 2 * special.stdtr(nu, -np.abs(z))
            else:
                p = special.fdtrc(q, nu, (projected**2).sum(0) / q / phi)
            best[score.key] = np.minimum(best[score.key], p) if score.key in best else p
        for name in self.spans:
            projected = next(seen)
            if q := len(projected):
                best["~" + name] = special.fdtrc(q, nu, (projected**2).sum(0) / q / phi)
        for name in self.scans:
            projected = next(seen)
            if k := len(projected):
                z = np.abs(projected).max(0) / np.sqrt(phi)
                best["~" + name] = np.minimum(2 * k**_SCAN_POWER * special.stdtr(nu, -z), 1.0)
        return np.stack(list(best.values())), list(best), phi
