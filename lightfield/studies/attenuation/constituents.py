"""What is dissolved and suspended in the water: chlorophyll, CDOM and sediment with profile intervals.

    y = alpha(lambda) - (a + b) s + excess(a, b) + errors,    a, b = pure water + constituents

and its mean over the band where a colour stands for one (`seen`). All colours are fitted together; gains and
errors of stays are free. The same with excess = 0 is Beer-Lambert with c = a + b, which takes every scattered
photon for lost. It can fit as well and be wrong all the same.
Where a model does not fit, its intervals are those of errors larger by `common_errors.misfit_factor`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import stats
from scipy.optimize import brentq, least_squares, minimize_scalar

from lightfield.arrays import Array
from lightfield.scene.water.water import Water
from lightfield.studies.attenuation.common_errors import POOR_FIT, Design, misfit_factor, misfit_p
from lightfield.studies.attenuation.scattered import Stack

_Row = tuple[str, str, float, float, float]
#: What is looked for: field of the water, its unit, its name, where fits start, what it is scaled by, and how
#: much there may be at most.
CONSTITUENTS: dict[str, _Row] = {
    "chlorophyll_mg_per_m3": ("mg/m³", "chlorophyll", 0.1, 0.1, 100.0),
    "cdom_440_per_m": ("1/m", "CDOM at 440 nm", 0.02, 0.05, 10.0),
    "sediment_g_per_m3": ("g/m³", "sediment", 0.02, 0.1, 100.0),
}
#: Scattering of the same size at all wavelengths, beside what the constituents bring along.
GREY = "scattering_per_m"
EXTRA = {GREY: ("1/m", "grey scattering", 0.02, 0.05, 2.0)}
#: Rise of chi-square at the ends of intervals of 68 % and 95 % (one parameter; Wilks 1938,
#: doi:10.1214/aoms/1177732360).
_RISE_68, _RISE_95 = 1.0, 3.841
#: The same in words, of amounts that are found and of those that are not.
LEVELS = "intervals of 68 %, limits of 95 %"
#: Slopes of CDOM that are tried, and how finely, 1/nm: from humic acids to the clearest ocean (0.008 to 0.03:
#: Twardowski et al. 2004, doi:10.1016/j.marchem.2004.02.008).
_SLOPE, _SLOPES_PER_NM, _SLOPE_TO = "cdom_slope_per_nm", (0.008, 0.03), 1e-5
#: Constituents need so many wavelengths: one more than there are of them.
FEWEST_COLOURS = len(CONSTITUENTS) + 1
#: First step of the search for an end of an interval, in standard errors; and its growth.
_FIRST_STEP, _GROWTH = 1.0, 2.0
#: Ends of intervals are found to this part of a standard error.
_FOUND = 0.02


@dataclass(frozen=True)
class Amount:
    """One constituent.

    Parameters
    ----------
    value, stderr : float
        Maximum of the likelihood, and half of the interval of 68 % (of its upper half where it begins at 0).
    low_68, high_68, low_95, high_95 : float
        Ends of the profile intervals; 0 where they reach to nothing.
    """

    name: str
    unit: str
    value: float
    stderr: float
    low_68: float
    high_68: float
    low_95: float
    high_95: float

    @property
    def found(self) -> bool:
        """Is nothing of it excluded at 95 %?"""
        return self.low_95 > 0.0


@dataclass(frozen=True)
class Alternatives:
    """Amounts that stand for each other: each may be nothing, all of them together may not, at 95 %.

    Parameters
    ----------
    names : tuple of str
        Fields of the water.
    rise : float
        Of chi-square where all are nothing; widened by misfits.
    """

    names: tuple[str, ...]
    rise: float


@dataclass(frozen=True, eq=False)
class Constituents:
    """The answer of one model of the light.

    Parameters
    ----------
    amounts : dict of Amount, by field of the water
        Intervals are widened by misfits.
    alternatives : tuple of Alternatives
        Of amounts that are not found one by one.
    water : Water
        With these amounts.
    chi2 : float
    """

    amounts: dict[str, Amount]
    alternatives: tuple[Alternatives, ...]
    water: Water
    chi2: float
    dof: int

    @property
    def p(self) -> float:
        """Probability of a larger chi-square."""
        return misfit_p(self.chi2, self.dof)

    @property
    def rejected(self) -> bool:
        """Do the readings exclude this model of the light, whatever the amounts?"""
        return self.p <= POOR_FIT

    def instead_of(self, name: str) -> list[str]:
        """What may be there instead of an amount: fields of the water."""
        sets = [one.names for one in self.alternatives if name in one.names]
        return [other for other in self.amounts if other != name and any(other in names for names in sets)]

    @property
    def errors_times(self) -> float:
        """By what the errors of the readings are multiplied for the intervals."""
        return misfit_factor(self.chi2, self.dof)


@dataclass(frozen=True)
class OtherSlope:
    """Where a model fits best whose CDOM may fall otherwise over the wavelength than the scene's.

    Parameters
    ----------
    held_per_nm, slope_per_nm : float, 1/nm
        As stated, and where chi-square is least.
    chi2 : float
        There.
    """

    held_per_nm: float
    slope_per_nm: float
    chi2: float
    dof: int

    @property
    def fits(self) -> bool:
        """Would the readings not exclude it?"""
        return misfit_p(self.chi2, self.dof) > POOR_FIT


@dataclass(frozen=True)
class _Fit:
    """Amounts at the least chi-square, some of them perhaps held."""

    u: Array
    chi2: float
    covariance: Array


def fit_constituents(
    stack: Stack, base: Water, *, scattered: bool = True, grey: bool = False
) -> Constituents:
    """Fit the constituents to all tables and colours at once.

    Parameters
    ----------
    stack : Stack
        Readings, and what scattered light adds to them.
    base : Water
        Pure water with its temperature and salinity; its own constituents are replaced.
    scattered : bool
        False: Beer-Lambert with c = a + b.
    grey : bool
        Let the water scatter equally at all wavelengths besides, for particles that the constituents' models
        do not describe.
    """
    names = {**CONSTITUENTS, **(EXTRA if grey else {})}
    sought = _Sought.of(stack, base, names, scattered)
    best = sought.fit(sought.start)
    times = misfit_factor(best.chi2, sought.dof)
    amounts = {
        name: _profile(sought, best, k, times, called, unit)
        for k, (name, (unit, called, *_)) in enumerate(names.items())
    }
    alternatives = _alternatives(sought, best, amounts, times)
    water = base.model_copy(update={n: float(v) for n, v in zip(names, best.u, strict=True)})
    return Constituents(amounts, alternatives, water, best.chi2, sought.dof)


def best_amounts(stack: Stack, base: Water, *, scattered: bool = True) -> dict[str, float]:
    """The amounts of `fit_constituents` without their intervals, by field of the water."""
    sought = _Sought.of(stack, base, CONSTITUENTS, scattered)
    best = sought.fit(sought.start)
    return dict(zip(CONSTITUENTS, best.u.tolist(), strict=True))


def other_slope(
    stack: Stack, base: Water, found: Constituents, *, scattered: bool = True
) -> OtherSlope | None:
    """The slope of CDOM that the readings call for beside all amounts; None where chi-square hardly falls.

    Parameters
    ----------
    found : Constituents
        Of the same stack with the slope of `base`.
    """
    start = np.array([found.amounts[name].value for name in CONSTITUENTS])

    def chi2(slope: float) -> float:
        there = base.model_copy(update={_SLOPE: slope})
        return _Sought.of(stack, there, CONSTITUENTS, scattered).fit(start).chi2

    best = minimize_scalar(chi2, bounds=_SLOPES_PER_NM, method="bounded", options={"xatol": _SLOPE_TO})
    if found.chi2 - best.fun < _RISE_95:
        return None
    return OtherSlope(base.cdom_slope_per_nm, float(best.x), float(best.fun), found.dof - 1)


def pure(water: Water) -> Water:
    """The water without what is looked for: its base, or pure water where it says none."""
    bare = Water(temperature_c=water.temperature_c, salinity_psu=water.salinity_psu, phase=water.phase)
    known = {"base": "pure" if water.base == "none" else water.base, "table": water.table}
    return bare.model_copy(update={**known, _SLOPE: water.cdom_slope_per_nm})


@dataclass(frozen=True)
class _Sought:
    """Amounts that are sought: what they leave of the readings, in their errors, and their limits.

    Parameters
    ----------
    left : callable
        Of amounts, shape (n,).
    start, scale, most : array, shape (n,)
        Where fits start, the scale of each amount, and how much there may be.
    dof : int
        Of a fit of all.
    """

    left: Callable[[Array], Array]
    start: Array
    scale: Array
    most: Array
    dof: int

    @classmethod
    def of(
        cls,
        stack: Stack,
        base: Water,
        names: dict[str, tuple[str, str, float, float, float]],
        scattered: bool,
    ) -> _Sought:
        design, y = Design(stack.sigma, stack.alphas, *stack.shared(traced=scattered)), stack.y

        def left(u: Array) -> Array:
            amounts = {name: max(float(v), 0.0) for name, v in zip(names, u, strict=True)}
            return design.whitened(y - stack.of_water(base.model_copy(update=amounts), scattered))

        start, scale, most = (np.array([row[k] for row in names.values()], float) for k in (2, 3, 4))
        dof = int(np.isfinite(y).sum()) - design.X.shape[1] * design.X.shape[2] - len(names)
        return cls(left, start, scale, most, dof)

    def fit(self, start: Array, held: Collection[int] = ()) -> _Fit:
        """Least chi-square over all amounts but the held ones, none below nothing."""
        free = [k for k in range(len(start)) if k not in held]
        if not free:
            return _Fit(start, float((self.left(start) ** 2).sum()), np.zeros((0, 0)))

        def some(v: Array) -> Array:
            u = start.copy()
            u[free] = v
            return self.left(u)

        scale, most = self.scale[free], self.most[free]
        inside = np.clip(start[free], 1e-6 * scale, 0.999 * most)
        found = least_squares(
            some, inside, bounds=(np.zeros(len(free)), most), x_scale=scale, xtol=1e-6, ftol=1e-7
        )
        u = start.copy()
        u[free] = found.x
        return _Fit(u, float(2 * found.cost), np.linalg.pinv(found.jac.T @ found.jac))


def _profile(sought: _Sought, best: _Fit, k: int, times: float, name: str, unit: str) -> Amount:
    """Where chi-square, least over all other amounts, rises by 1 and by 3.84; of errors `times` as large."""
    value, step = float(best.u[k]), times * float(np.sqrt(best.covariance[k, k]))
    most = float(sought.most[k])
    known: dict[float, float] = {value: 0.0}
    last = [best.u]

    def rise(at: float) -> float:
        if at not in known:
            start = last[-1].copy()
            start[k] = at
            fit = sought.fit(start, held=(k,))
            last.append(fit.u)
            known[at] = (fit.chi2 - best.chi2) / times**2
        return known[at]

    def end(level: float, direction: int) -> float:
        limit, size, at = (0.0 if direction < 0 else most), _FIRST_STEP * step, value
        while True:
            beyond = float(np.clip(at + direction * size, 0.0, most))
            if rise(beyond) >= level:
                low, high = sorted((at, beyond))
                return float(brentq(lambda v: rise(float(v)) - level, low, high, xtol=_FOUND * step))
            if beyond == limit:
                return limit
            at, size = beyond, size * _GROWTH

    low_68, high_68 = end(_RISE_68, -1), end(_RISE_68, 1)
    low_95, high_95 = end(_RISE_95, -1), end(_RISE_95, 1)
    stderr = 0.5 * (high_68 - low_68) if low_68 > 0 else high_68 - value
    return Amount(name, unit, value, stderr, low_68, high_68, low_95, high_95)


def _alternatives(
    sought: _Sought, best: _Fit, amounts: dict[str, Amount], times: float
) -> tuple[Alternatives, ...]:
    """The smallest sets of amounts, none found by itself, of which not all are nothing.

    As each lies at its boundary there, the limit, chi-square of as many degrees of freedom as there are
    amounts, is on the safe side (Self & Liang 1987, doi:10.1080/01621459.1987.10478472).
    """
    names = list(amounts)
    missing = [k for k, amount in enumerate(amounts.values()) if not amount.found]
    found: list[Alternatives] = []
    for size in range(2, len(missing) + 1):
        for held in combinations(missing, size):
            chosen = tuple(names[k] for k in held)
            if any(set(one.names) <= set(chosen) for one in found):
                continue
            start = best.u.copy()
            start[list(held)] = 0.0
            rise = (sought.fit(start, held).chi2 - best.chi2) / times**2
            if rise > stats.chi2.isf(0.05, size):
                found.append(Alternatives(chosen, rise))
    return tuple(found)
