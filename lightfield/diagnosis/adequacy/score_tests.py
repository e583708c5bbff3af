"""Is anything still missing? Score tests of every absent effect and of smooth unknowns, calibrated together.

Valid when the errors are Gaussian with the covariance of the noise module up to one unknown scale, and the
model is nearly linear in its parameters over their uncertainty. Nominal p-values are never used as they are:
the smallest one is compared with the smallest ones of a parametric bootstrap that repeats the whole
calculation (Westfall and Young 1993, Resampling-based multiple testing, Wiley), which knows of number,
correlations, one-sided effects, and shapes that mean nothing without amplitude.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import special

from lightfield.arrays import TINY, Array
from lightfield.decompositions import thin_svd
from lightfield.diagnosis.adequacy.level import ALPHA
from lightfield.diagnosis.adequacy.scale import STATED_COUNT_AS
from lightfield.diagnosis.adequacy.subspace import DISTINCT, INDEPENDENT, beside, combined, orthonormal
from lightfield.diagnosis.adequacy.templates import Template, bank
from lightfield.diagnosis.problem.problem import Problem
from lightfield.fitting.least_squares import Fit, Whiten

SPANS = ("x", "plane", "time")
_SCANS = ("bump", "ripple", "step", "one plane")
#: A template that keeps less than this part of its length beside the free parameters is absorbed by them.
#: Chosen: forward differences over a hundredth of the typical size (`candidates.STEP`) are hardly better.
ABSORBED = 1e-3
#: A column of a scan that keeps less than this is next to what the fit moves. Chosen: at a twentieth its
#: amplitude would have to be twenty times the noise to be seen.
_VISIBLE = 0.05
#: Scatter up to this many times the quoted variance is put down to errors quoted too small: a factor of two
#: in the standard error, as tables are wrong (tests/physics/found/test_diagnosis.py has 1.7).
VARIANCE_EXCESS = 4.0
#: More scatter than that is a misfit when it has this chance. Chosen: a tenth of ALPHA, which it adds to.
_EXCESS_LEVEL = 1e-3
#: Fewer readings than this beyond what the tests use up cannot tell the noise; its scale is taken as stated.
#: Chosen: the error of a scale from four is 70 %.
_FEWEST_SPARE = 4
#: Fewer than this, and the smooth unknowns but for those across the beam are taken to be absent from the
#: scale's misfit: it is known to 50 %, and what they would take from it is not. Chosen; on half and one and a
#: half of it no answer hangs (test_cascade.py).
_FEWEST_BESIDE_ALL = 8
#: Degrees of freedom that stand for a known scale. Derived: quantiles of t are normal ones to 0.2 % at ALPHA.
_CERTAIN = 1000
#: k neighbouring columns count as k to this power independent ones in the nominal p of a scan. Chosen, for
#: the weight of a scan among the tests alone: what is said rests on the bootstrap.
_SCAN_POWER = 0.7
#: Readings without noise: their scatter, in units of their errors, is taken for no less. Chosen: rounding.
LEAST_SCALE = 1e-6
#: Part of a sum of squares that is nought. Derived: rounding of doubles, with room.
_ROUNDING = 1e-12


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
        Of the projected template per unit (first) amplitude: 1/length is its standard error at phi = 1.
    """

    template: Template
    direction: Array
    to_amplitude: Array
    length: float
    testable: bool

    @property
    def key(self) -> tuple[str, str]:
        return self.template.candidate.key

    @property
    def acts(self) -> bool:
        """Does the effect change anything here, be it as what is free does?"""
        return bool(self.template.columns.any())

    @property
    def unit(self) -> Array:
        """What one unit of the first amplitude changes beside the fit, shape (n,)."""
        return np.asarray(self.direction @ np.linalg.pinv(self.to_amplitude)[:, 0])


@dataclass(frozen=True)
class Adequacy:
    """Verdict of the test on one fit.

    Parameters
    ----------
    p : float
        Family-wise probability of so bad a worst test if nothing were missing.
    phi, nu : float
        Pure-error variance scale from what no effect and no smooth unknown can reach; its dof.
    tests : mapping
        Nominal p of each test: (effect, form), or "~" and the unknown's name.
    excess_p : float
        Probability of so large a scatter, were the errors quoted up to a factor 2 too small.
    scale_taken : bool
        Too few readings to tell the scale of the noise: stated errors are taken as they are.
    critical_p : float
        Nominal p of the worst test that is undercut with probability ALPHA where nothing is missing.
    """

    p: float
    phi: float
    nu: float
    tests: Mapping[object, float]
    scores: tuple[Score, ...]
    amplitudes: tuple[Array, ...]
    excess_p: float
    scale_taken: bool = False
    critical_p: float = ALPHA

    def passes(self, alpha: float) -> bool:
        """Nothing is missing at family-wise level `alpha`, and the scatter is credible."""
        return self.p > alpha and self.excess_p > _EXCESS_LEVEL

    def only_scatters(self, alpha: float) -> bool:
        """Is nothing missing at level `alpha` but a scatter that is not credible?"""
        return self.p > alpha and self.excess_p <= _EXCESS_LEVEL


def _score(template: Template, free: Array) -> Score:
    rest = beside(free, template.columns)
    before, after = np.linalg.norm(template.columns, axis=0), np.linalg.norm(rest, axis=0)
    visible = after > ABSORBED * np.maximum(before, TINY)
    q = template.columns.shape[1]
    if not visible.any():
        return Score(template, np.zeros((len(rest), 0)), np.zeros((q, 0)), 0.0, False)
    u, s, vt = thin_svd(rest[:, visible] / after[visible])
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
        self._seen: tuple[Mapping[str, Array], Array] | None = None
        self._last: tuple[Fit, Adequacy] | None = None

    def on(self, problem: Problem) -> AdequacyTest:
        """The same test of a problem whose forward model has changed a little."""
        return AdequacyTest(problem, self.whiten, self.unknowns, self.noise, self.errors_stated, self.scale)

    def score(self, fit: Fit, at_any_time: bool = False) -> tuple[tuple[Score, ...], tuple[Array, ...]]:
        """Scores of one fit alone, and the amplitudes that they ask for; of what begins whenever, too."""
        free = _moved(fit)
        scores = tuple(_score(t, free) for t in bank(self.problem, fit, self.whiten, at_any_time))
        observed = beside(free, fit.residual[:, None])[:, 0]
        return scores, tuple(s.to_amplitude @ (s.direction.T @ observed) for s in scores)

    def __call__(self, fit: Fit) -> Adequacy:
        """Test one fit; once, when it is asked for twice in a row."""
        if self._last is None or self._last[0] is not fit:
            self._last = fit, self._tested(fit)
        return self._last[1]

    def _tested(self, fit: Fit) -> Adequacy:
        scores, amplitudes = self.score(fit)
        replicates = self.noise()
        if self._seen is None:  # unknowns look at it alike whatever was fitted: that goes off below
            squares = np.einsum("ij,ij->j", replicates, replicates, dtype=float)
            self._seen = self._unknown(replicates), squares
        unknown, squares = self._seen
        count_as, n = STATED_COUNT_AS if self.errors_stated else 0.0, int(self.problem.keep.sum())
        views = _Views(_moved(fit), scores, self.unknowns, n, count_as)
        chance = views.least_p(replicates, unknown, squares)
        rest = fit.residual[:, None]
        seen_p, labels, phi = views.p_values(rest, self._unknown(rest), (rest**2).sum(0))
        worst = float(seen_p.min())
        p = (1 + int((chance <= worst).sum())) / (1 + len(chance))
        excess, nu = float(phi[0]) * self.scale / VARIANCE_EXCESS, views.nu
        return Adequacy(
            p,
            float(phi[0]),
            nu,
            dict(zip(labels, map(float, seen_p[:, 0]), strict=True)),
            scores,
            amplitudes,
            float(special.chdtrc(nu, nu * excess)) if self.errors_stated and not views.scale_taken else 1.0,
            views.scale_taken,
            float(np.quantile(chance, ALPHA)),
        )

    def _unknown(self, residuals: Array) -> Mapping[str, Array]:
        return {name: _products(columns, residuals) for name, columns in self.unknowns.items()}


def _products(columns: Array, residuals: Array) -> Array:
    """Of columns, shape (n, k), with residuals, shape (n, m), at the precision of these."""
    return np.asarray(columns.astype(residuals.dtype, copy=False).T @ residuals, float)


def _moved(fit: Fit) -> Array:
    """Orthonormal basis of what a fit moves, shape (n, p)."""
    return orthonormal(fit.jacobian[:, ~fit.at_bound()], INDEPENDENT)


class _Views:
    """All that a test looks at beside a fit, as combinations of columns that noise is projected on once.

    Parameters
    ----------
    free : array, shape (n, p)
        Orthonormal basis of what the fit moves.
    scores : tuple of Score
    unknowns : mapping of array, shape (n, k)
        Whitened.
    kept : int
        Number of readings.
    count_as : float
        Readings to spare that the whitening counts as.

    Attributes
    ----------
    nu : float
        Degrees of freedom of the pure error.
    scale_taken : bool
        Too few: the scale of the errors is taken as stated.
    """

    def __init__(
        self,
        free: Array,
        scores: tuple[Score, ...],
        unknowns: Mapping[str, Array],
        kept: int,
        count_as: float = 0.0,
    ) -> None:
        self.scores = [s for s in scores if s.testable]
        self._free = free
        self._directions = np.hstack([*(s.direction for s in self.scores), np.zeros((len(free), 0))])
        ends = np.cumsum([0, *(s.direction.shape[1] for s in self.scores)]).tolist()
        #: Of these the ones of every score.
        self._rows = [slice(*between) for between in pairwise(ends)]
        rest = {name: beside(free, columns) for name, columns in unknowns.items()}
        self._fitted = {name: columns.T @ free for name, columns in unknowns.items()}
        #: Columns of each scan that the fit leaves visible, and their lengths.
        self._scans: dict[str, tuple[NDArray[np.bool_], Array]] = {}
        for name in _SCANS:
            before, after = (np.linalg.norm(each[name], axis=0) for each in (unknowns, rest))
            visible = after > _VISIBLE * np.maximum(before, TINY)
            self._scans[name] = visible, after[visible]
        # Everything that is not pure error, side by side, and where each part of it is.
        parts = {"effects": self._directions} | {name: rest[name] for name in (*SPANS, "step", "one plane")}
        for name in ("step", "one plane"):
            visible, length = self._scans[name]
            parts[name] = parts[name][:, visible] / length
        every = np.hstack(list(parts.values()))
        gram = every.T @ every
        ends = np.cumsum([part.shape[1] for part in parts.values()])
        place = {
            name: slice(end - part.shape[1], end)
            for end, (name, part) in zip(ends.tolist(), parts.items(), strict=True)
        }

        def within(*names: str) -> Array:
            """Bases of the spans of some parts, one beside the other, in terms of all columns."""
            out = [np.zeros((len(gram), 0))]
            for name in names:
                at = place[name]
                basis = combined(gram[at, at])
                out.append(np.zeros((len(gram), basis.shape[1])))
                out[-1][at] = basis
            return np.hstack(out)

        def whole(*names: str) -> Array:
            at = np.r_[tuple(place[name] for name in names)]
            return np.eye(len(gram))[:, at]

        def basis(columns: Array) -> Array:
            return columns @ combined(columns.T @ gram @ columns)

        self._spans = {name: within(name) for name in SPANS}
        self._spans["all"] = basis(within(*SPANS))
        reach = basis(np.hstack([whole("effects", "step", "one plane"), within(*SPANS)]))
        if kept - free.shape[1] - reach.shape[1] < _FEWEST_BESIDE_ALL:
            reach = basis(np.hstack([whole("effects"), within("x")]))
        spare = kept - free.shape[1] - reach.shape[1]
        self.scale_taken = spare < _FEWEST_SPARE
        self.nu, self._known = _CERTAIN if self.scale_taken else spare + count_as, count_as
        self._reach = reach
        self._parts = tuple(parts)

    def p_values(
        self, residuals: Array, unknown: Mapping[str, Array], squares: Array
    ) -> tuple[Array, list[object], Array]:
        """Nominal p of every test, shape (n_tests, m), its name, and the scale of the pure error, shape (m,).

        Parameters
        ----------
        residuals : array, shape (n, m)
            Whitened.
        unknown : mapping of array, shape (k, m)
            Products of every unknown with them.
        squares : array, shape (m,)
            Their sums of squares.
        """
        nu, (directions, phi, rest) = self.nu, self._seen(residuals, unknown, squares)
        best: dict[object, Array] = {}
        for score, rows in zip(self.scores, self._rows, strict=True):
            if (rows.stop - rows.start) == 1:
                z = directions[rows.start] / np.sqrt(phi)
                sign = _only_sign(score)
                p = 2 * special.stdtr(nu, -np.abs(z)) if sign is None else _one_tail(nu, sign * z)
            else:
                p = _p_together(nu, directions[rows], phi)
            best[score.key] = np.minimum(best[score.key], p) if score.key in best else p
        return np.stack([*best.values(), *rest.values()]), [*best, *rest], phi

    def least_p(self, residuals: Array, unknown: Mapping[str, Array], squares: Array) -> Array:
        """The least of `p_values`, shape (m,): of tests alike that of the largest statistic is worked out."""
        nu, (directions, phi, rest) = self.nu, self._seen(residuals, unknown, squares)
        either, one_tail, found = np.zeros_like(phi), np.zeros_like(phi), [*rest.values()]
        for score, rows in zip(self.scores, self._rows, strict=True):
            if (rows.stop - rows.start) > 1:
                found.append(_p_together(nu, directions[rows], phi))
            elif (sign := _only_sign(score)) is not None:
                one_tail = np.maximum(one_tail, sign * directions[rows.start])
            else:
                either = np.maximum(either, np.abs(directions[rows.start]))
        found += [_one_tail(nu, one_tail / np.sqrt(phi)), 2 * special.stdtr(nu, -either / np.sqrt(phi))]
        return np.asarray(np.min(found, axis=0))

    def _seen(
        self, residuals: Array, unknown: Mapping[str, Array], squares: Array
    ) -> tuple[Array, Array, dict[object, Array]]:
        """Projections on every score's direction, the scale of the pure error, and p of spans and scans."""
        nu = self.nu
        fitted, directions = (_products(each, residuals) for each in (self._free, self._directions))
        seen = {name: unknown[name] - self._fitted[name] @ fitted for name in unknown}
        scanned = {name: seen[name][at] / length[:, None] for name, (at, length) in self._scans.items()}
        every = np.vstack([({"effects": directions} | seen | scanned)[name] for name in self._parts])
        total = np.maximum(squares - (fitted**2).sum(0), 0.0)
        phi = np.ones_like(total)
        if not self.scale_taken:
            reached = ((self._reach.T @ every) ** 2).sum(0)
            phi = (np.maximum(total - reached, _ROUNDING * total + TINY) + self._known) / nu
            phi = np.maximum(phi, LEAST_SCALE)
        rest: dict[object, Array] = {}
        for name, basis in self._spans.items():
            if basis.shape[1]:
                rest["~" + name] = _p_together(nu, basis.T @ every, phi)
        for name, projected in scanned.items():
            if k := len(projected):
                z = np.abs(projected).max(0) / np.sqrt(phi)
                rest["~" + name] = np.minimum(2 * k**_SCAN_POWER * special.stdtr(nu, -z), 1.0)
        return directions, phi, rest


def _only_sign(score: Score) -> float | None:
    """That of the direction in which alone an effect can be; none where it can be in both."""
    if not score.template.candidate.one_sided:
        return None
    return float(np.sign(score.to_amplitude.flat[np.abs(score.to_amplitude).argmax()]))


def _one_tail(nu: float, z: Array) -> Array:
    """p of a statistic that counts in one direction alone, shape (m,); 1 in the other."""
    return np.where(z > 0, special.stdtr(nu, -z), 1.0)


def _p_together(nu: float, projected: Array, phi: Array) -> Array:
    """p of several directions together, shape (q, m), by the F test."""
    q = len(projected)
    return np.asarray(special.fdtrc(q, nu, (projected**2).sum(0) / q / phi))
