"""A diagnosis whose answers are known: readings linear in everything, with normal errors of known size.

Derivatives are columns, so that what a test expects comes from textbook regression and not from this program.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from lightfield.diagnosis.adequacy.robust import Serial
from lightfield.diagnosis.adequacy.score_tests import AdequacyTest
from lightfield.diagnosis.adequacy.templates import whitened_unknowns
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.layout import Layout, layout_of
from lightfield.diagnosis.problem.noise import Budget, Noise
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.preparation import Prepared
from lightfield.diagnosis.search.set_of_effects import ScoredSet, bic
from lightfield.fitting.effects import Effect, Form, Free
from lightfield.fitting.least_squares import Fit
from lightfield.fitting.parameter import FitParameter


def layout(planes: int = 5, across: int = 12, in_order: bool = False) -> Layout:
    """Scans across the axis at several distances, read in random order or as they stand."""
    x, z = np.tile(np.linspace(-1, 1, across), planes), np.repeat(np.arange(planes) + 4.5, across)
    n = len(x)
    time = 20.0 * (np.arange(n) if in_order else np.random.default_rng(0).permutation(n))
    return layout_of(
        SimpleNamespace(
            x_m=x, y_m=np.zeros(n), z_m=z, time_s=time, wavelength_nm=np.full(n, 525.0),
            medium=np.full(n, "water"), visit=np.full(n, np.nan),
            repeat=np.full(n, np.nan), common_percent=np.full(n, np.nan),
        )
    )  # fmt: skip


class Dark:
    """No trace of scattered or reflected light."""

    trace = None


class Untraced:
    """Nothing is scattered or reflected."""

    diffuse = Dark()

    def to_trace(self, found: object) -> None:
        return None

    def factor_to_traced(self, values: Mapping[str, float]) -> float:
        return 1.0


class Linear:
    """Readings: the sum of columns, each times the value of its path."""

    light = Untraced()

    def __init__(self, columns: Mapping[str, np.ndarray]) -> None:
        self.columns = {path: np.asarray(column, float) for path, column in columns.items()}
        self.size = len(next(iter(self.columns.values())))
        self.readings = SimpleNamespace(stderr=np.full(self.size, np.nan))

    def predict(self, values: Mapping[str, float]) -> np.ndarray:
        return sum(
            (values[path] * column for path, column in self.columns.items() if path in values),
            np.zeros(self.size),
        )

    def subset(self, rows: np.ndarray) -> Linear:
        return Linear({path: column[rows] for path, column in self.columns.items()})

    def holding(self, values: Mapping[str, float]) -> Linear:
        return self

    def lamp_errors(self, values: Mapping[str, float]) -> np.ndarray:
        return np.zeros((len(self.predict(values)), 0))

    def errors(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros((self.size, 0)), np.zeros(self.size)


def candidate(name: str, low: float = -1e3, high: float = 1e3) -> Candidate:
    """An effect of one amplitude, neutral at 0, in units of the standard errors."""
    path = f"toy.{name}"
    form = Form("linear", (Free(path, low, high, 1.0),))
    effect = Effect(name, "toy", (form,), "", "", "look at it")
    return Candidate(effect, form, (FitParameter(path, low, high, 0.0, 1e-3),), (1.0,), (), ((),), (0.0,))


def curve(name: str, forms: Sequence[int], contains: tuple[str, ...]) -> list[Candidate]:
    """A free-form effect: nested forms of so many amplitudes, that contain other effects."""
    paths = [f"toy.{name}{k}" for k in range(max(forms))]
    declared = tuple(Form(f"{d} terms", tuple(Free(p, -1e3, 1e3, 1.0) for p in paths[:d])) for d in forms)
    effect = Effect(name, "toy curve", declared, "", "", "look at it", contains=contains)
    return [
        Candidate(
            effect, form, tuple(FitParameter(p, -1e3, 1e3, 0.0, 1e-3) for p in paths[:d]),
            (1.0,) * d, (), ((),), (0.0,) * d,
        )
        for form, d in zip(declared, forms, strict=True)
    ]  # fmt: skip


@dataclass(frozen=True)
class Toy:
    """A problem, its true base, and the standard errors of its readings, shape (n,).

    The base model is a level and a slope with the distance, on a bell across the axis.
    """

    problem: Problem
    base: np.ndarray
    sigma: np.ndarray

    @classmethod
    def of(
        cls, candidates: Sequence[Candidate], columns: Mapping[str, np.ndarray], lay: Layout | None = None
    ) -> Toy:
        """With these effects, whose columns are in units of the standard errors."""
        lay = layout() if lay is None else lay
        bell = np.exp(-2 * lay.x_m**2)
        sigma = 0.01 * bell + 0.001
        own = {"level": bell, "slope": bell * (lay.z_m - lay.z_m.mean())}
        effects = {f"toy.{name}": sigma * column for name, column in columns.items()}
        parameters = tuple(FitParameter(path, -1e3, 1e3, 0.5, 1e-3) for path in own)
        clean = own["level"] + 0.1 * own["slope"]
        problem = Problem(Linear(own | effects), lay, clean, np.ones(lay.size), parameters, tuple(candidates))
        return cls(problem, clean, sigma)

    @property
    def noise(self) -> Noise:
        return self.noise_within(0.0)

    def noise_within(self, tolerance: float) -> Noise:
        """The noise, with a smooth relative error of the model that is of no interest."""
        lay = self.problem.layout
        return Noise(lay, self.sigma, self.base, Budget(0.0, 0.0, tolerance), np.zeros(lay.size))

    @property
    def whiten(self) -> Whitener:
        return Whitener(self.noise)

    def with_value(self, value: np.ndarray) -> Problem:
        """The problem with other readings."""
        p = self.problem
        return Problem(p.forward, p.layout, value, p.keep, p.base, p.candidates)

    def drawn(self, rng: np.random.Generator, factor: float = 1.0, **effects: float) -> Problem:
        """The problem with readings of these effects, their errors so many times the stated ones."""
        true = self.base + self.problem.forward.predict({f"toy.{name}": v for name, v in effects.items()})
        return self.with_value(true + factor * self.sigma * rng.standard_normal(len(true)))

    def regression(self, problem: Problem, *names: str) -> tuple[np.ndarray, np.ndarray, float]:
        """Coefficients, their covariance and chi-square of base and effects, by linear regression."""
        columns = self.problem.forward.columns
        design = np.stack([columns[p] for p in ("level", "slope", *(f"toy.{n}" for n in names))], axis=1)
        design = design / self.sigma[:, None]
        value = problem.value / self.sigma
        found = np.linalg.lstsq(design, value, rcond=None)[0]
        rest = value - design @ found
        return found, np.linalg.inv(design.T @ design), float(rest @ rest)

    def fit(self, problem: Problem, *effects: Candidate) -> Fit:
        """The same as a fit."""
        found, _, chi2 = self.regression(problem, *(c.name for c in effects))
        model = problem.model(effects)
        prediction = model.predict(found)
        residual = (problem.value - prediction) / self.sigma
        slopes = np.stack([model.forward.columns[p.path] for p in model.parameters], axis=1)
        return Fit(
            model, found, prediction, residual, chi2, lambda: slopes / self.sigma[:, None], converged=True
        )

    def test(self, problem: Problem, replicates: np.ndarray, errors_stated: bool = True) -> AdequacyTest:
        """The adequacy test with given whitened noise, shape (n, replicates)."""
        unknowns = whitened_unknowns(problem, self.whiten)
        return AdequacyTest(problem, self.whiten, unknowns, lambda: replicates, errors_stated)

    def prepared(self, problem: Problem, tolerance: float = 0.0) -> Prepared:
        """What the search begins from, where nothing is wrong with the readings."""
        return Prepared(problem, self.noise_within(tolerance), Serial(), self.fit(problem), (), True)


def waves(lay: Layout) -> dict[str, np.ndarray]:
    """Three columns that no smooth unknown is: products of x, z and time that are not of one of them."""
    time = lay.phase_of_scan
    return {
        "odd": np.sin(3 * lay.x_m) * (lay.z_m - 6.5),
        "dusk": 3 * time * lay.x_m,
        "rows": np.cos(2 * lay.x_m) * np.sin(2 * lay.z_m),
    }


def toy(low: float = -1e3, lay: Layout | None = None, **more: np.ndarray) -> Toy:
    """A candidate for each of `waves`, and for each column more."""
    lay = layout() if lay is None else lay
    columns = {**waves(lay), **more}
    return Toy.of([candidate(name, low) for name in columns], columns, lay)


def tried(made: Toy, problem: Problem, *names: str) -> ScoredSet:
    """A set of effects, fitted and scored."""
    explanation = tuple(c for c in problem.candidates if c.name in names)
    fit = made.fit(problem, *explanation)
    return ScoredSet(explanation, fit, bic(fit, explanation, 1.0, len(problem.value)))
