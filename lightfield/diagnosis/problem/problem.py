"""One diagnosis: readings, base model and candidates, and how a set of effects becomes a model to fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.layout import Layout
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit, Whiten, least_squares
from lightfield.fitting.parameter import FitParameter, Model

Explanation = tuple[Candidate, ...]

#: Steps of a fit at most, and what a further one would gain in chi-square. Chosen: a thirtieth of an error.
_STEPS, _LEFT = 40, 1e-3
#: Fits to more readings than this begin with a sample of so many. Chosen: time alone; with fewer, fits and
#: answers are the same (test_many.py, test_sample.py).
MANY, SAMPLE = 3000, 1500
#: Chi-square by which fits to the sample are worse than the best, in units of what scatters: up to the first
#: they may be the best of all readings, beyond the second they are out of the question. Chosen: 3.5 and ten
#: sigma of a sample that is half of all at most.
_AS_GOOD, FAR_BEHIND = 12.0, 100.0
#: Fits to the sample that differ by less found the same minimum. Chosen: where a fit stops, in chi-square.
_SAME_MINIMUM = 1e-2
#: Amplitudes from which a single set of effects is fitted, in multiples of the typical one. Chosen.
_SIZES = (1.0, 10.0, -3.0)
#: From each point of a grid of shapes, and each sign of the amplitude, a fit takes so many steps; so many of
#: the best go on; of larger grids than this, of three shapes, so many points are drawn. Chosen: time against
#: thoroughness.
_STEPS_AT_SHAPE, _SHAPES_GO_ON, _MOST_SHAPES = 4, 2, 125


@dataclass(frozen=True)
class Problem:
    """Readings, a forward model, its nuisance parameters, and the effects that may be missing.

    Parameters
    ----------
    value : array, shape (n,)
    keep : array of 0 and 1, shape (n,)
        Readings left out (saturated, gross outliers) carry 0.
    base : tuple of FitParameter
        Gain per channel, beam half-width, absorption.
    candidates, curves : tuple of Candidate
        Named effects, and free-form ones, for what no named effect explains.
    """

    forward: SceneForward
    layout: Layout
    value: Array
    keep: Array
    base: tuple[FitParameter, ...]
    candidates: tuple[Candidate, ...]
    curves: tuple[Candidate, ...] = ()

    def model(self, explanation: Explanation = ()) -> Model:
        """The base model with the effects of an explanation set free."""
        replaced = {path for c in explanation for path in c.effect.instead_of}
        base = (p.held(0.5 * (p.low + p.high)) if p.path in replaced else p for p in self.base)
        return Model(self.forward, (*base, *(p for c in explanation for p in c.parameters)))

    def with_curves(self) -> Problem:
        """The same, where curves are candidates like any other."""
        return replace(self, candidates=(*self.candidates, *self.curves), curves=())

    def without_curves(self) -> Problem:
        """The same, where curves are set aside until no named effect will do."""
        named = tuple(c for c in self.candidates if not c.effect.is_free_form)
        curves = tuple(c for c in self.candidates if c.effect.is_free_form)
        return replace(self, candidates=named, curves=(*curves, *self.curves))

    def fit(
        self,
        explanation: Explanation,
        whiten: Whiten,
        starts: Sequence[Array],
        max_steps: int = _STEPS,
        value: Array | None = None,
        tolerance: float = _LEFT,
    ) -> Fit:
        """The best of the fits from several starts."""
        model = self.model(explanation)
        target = self.value if value is None else value
        best: Fit | None = None
        for start in starts:
            fit = least_squares(model, target, whiten, start, self.keep, max_steps, tolerance)
            if best is None or fit.chi2 < best.chi2:
                best = fit
        assert best is not None, "a fit needs a start"
        return best

    def with_largest_forms(self, explanation: Explanation, fit: Fit, whiten: Whiten) -> Fit:
        """A fit with the largest form of each of its curves, from where it lies; itself where it has none.

        What a smaller form leaves out is not known to be none: errors are those of the largest.
        """
        wide = tuple(map(self._largest_form, explanation))
        if not any(c.effect.is_free_form for c in wide):
            return fit
        return self.fit(wide, whiten, [self.model(wide).at(fit.by_path)])

    def _largest_form(self, candidate: Candidate) -> Candidate:
        """Of a curve; of all else the effect itself."""
        if not candidate.effect.is_free_form:
            return candidate
        forms = (c for c in (*self.candidates, *self.curves) if c.name == candidate.name)
        return max((candidate, *(c for c in forms if not c.form.refines)), key=lambda c: len(c.parameters))

    def rough(self, explanation: Explanation, whiten: Whiten, start: Array, max_steps: int) -> Fit:
        """A fit of a few steps, to a sample of many readings: its chi-square ranks it among its like."""
        if self.sample is None or not isinstance(whiten, Whitener):
            return self.fit(explanation, whiten, [start], max_steps)
        rows, problem = self.sample
        return problem.fit(explanation, whiten.of(rows), [start], max_steps)

    def fit_all(self, begun: Sequence[tuple[Explanation, Sequence[Array]]], whiten: Whiten) -> list[Fit]:
        """The best fit of every explanation, each from several starts.

        Of many readings, what a sample shows to be far behind the best is left as the sample tells it.
        """
        if self.sample is None or not isinstance(whiten, Whitener):
            return [self.fit(explanation, whiten, starts) for explanation, starts in begun]
        rows, problem = self.sample
        rough = [[problem.fit(e, whiten.of(rows), [start]) for start in starts] for e, starts in begun]
        lowest = min((fit.chi2 for fits in rough for fit in fits), default=0.0)
        scatter = max(1.0, lowest / len(problem.value))
        out = []
        for (explanation, _), fits in zip(begun, rough, strict=True):
            best = min(fits, key=lambda f: f.chi2)
            if best.chi2 - lowest > FAR_BEHIND * scatter:
                out.append(self.fit(explanation, whiten, [best.u], max_steps=0))
            else:
                near = [f.u for f in fits if f is best or self._may_be_as_good(f, best, scatter)]
                out.append(self.fit(explanation, whiten, near))
        return out

    @staticmethod
    def _may_be_as_good(fit: Fit, best: Fit, scatter: float) -> bool:
        """Is it another minimum of a sample than the best one, and not much worse?"""
        return _SAME_MINIMUM * scatter < fit.chi2 - best.chi2 < _AS_GOOD * scatter

    @cached_property
    def sample(self) -> tuple[NDArray[np.bool_], Problem] | None:
        """Which readings stand for many: of every few that follow each other in a channel one at random."""
        if len(self.value) <= MANY:
            return None
        layout, every = self.layout, len(self.value) / SAMPLE
        place = every * (np.arange(SAMPLE) + np.random.default_rng(0).random(SAMPLE))
        rows = np.zeros(layout.size, bool)
        rows[layout.order[place.astype(int)]] = True
        if len(np.unique(layout.channel[rows])) <= layout.channel.max():
            return None
        some = replace(
            self, forward=self.forward.subset(rows), layout=layout.subset(rows), value=self.value[rows],
            keep=self.keep[rows],
        )  # fmt: skip
        return rows, some

    def starts(self, base: Array, explanation: Explanation, whiten: Whiten) -> list[Array]:
        """Where to begin a fit of one set of effects about which nothing is known.

        Where an effect has shapes, also there where a few steps from each point of its grid lead lowest, one
        effect after the other.
        """
        out = [self.default_start(base, explanation, size) for size in _SIZES]
        best = out[:1]
        at = len(self.base)
        for candidate in explanation:
            end = at + len(candidate.parameters)
            if len(candidate.grid) > 1:
                begun = [np.r_[best[0][:at], own, best[0][end:]] for own in _shaped(candidate)]
                rough = [self.rough(explanation, whiten, u, max_steps=_STEPS_AT_SHAPE) for u in begun]
                best = [fit.u for fit in sorted(rough, key=lambda fit: fit.chi2)[:_SHAPES_GO_ON]]
            at = end
        return out if best[0] is out[0] else [*out, *best]

    def default_start(self, base: Array, explanation: Explanation, fraction: float = 1.0) -> Array:
        """Base coordinates followed by typical amplitudes and the first shapes of each effect."""
        parts = [np.asarray(base[: len(self.base)])]
        for candidate in explanation:
            for parameter, typical in zip(candidate.amplitudes, candidate.typical, strict=True):
                parts.append(
                    np.array([np.clip(parameter.start + fraction * typical, parameter.low, parameter.high)])
                )
            parts.append(np.array([p.start for p in candidate.shapes]))
        return np.concatenate(parts)


def _shaped(candidate: Candidate) -> list[Array]:
    """Coordinates of one effect at every point of the grid of its shapes, amplitudes of typical size."""
    points = np.array(candidate.grid)
    if len(points) > _MOST_SHAPES:
        points = np.random.default_rng(0).permutation(points)[:_MOST_SHAPES]
    start, low, high = (
        np.array([getattr(p, k) for p in candidate.amplitudes]) for k in ("start", "low", "high")
    )
    sizes = [np.clip(start + sign * np.array(candidate.typical), low, high) for sign in (1.0, -1.0)]
    # There is no slope in a shape where the amplitude cannot leave zero.
    return [np.r_[size, point] for size in sizes if (size != start).any() for point in points]
