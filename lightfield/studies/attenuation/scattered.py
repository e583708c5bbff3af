"""Absorption and scattering behind the apparent attenuation, as far as the layout tells them.

    y = alpha - (a + b) s + excess(a, b) + errors

One receiver on the axis tells one combination, a + kappa b: light that was scattered forward still arrives.
Places beside the beam, or a second receiver that sees less of it, part the two.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from lightfield.arrays import Array
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.scene.water.water import Water
from lightfield.studies.attenuation.apparent import Apparent
from lightfield.studies.attenuation.common_errors import Design, JointEstimate, misfit_factor, misfit_p
from lightfield.studies.attenuation.excess import Excess, excess_light
from lightfield.studies.attenuation.ratios import Ratios

#: Scattering is looked for up to so many times the least apparent attenuation: kappa is 0.25 at least in what
#: was traced (0.47 for a cosine receiver and g = 0.92, more behind a collimator).
LARGEST_B = 4.0
#: Absorption and scattering are told apart where the error of b is at most this part of its range: what is
#: not known of it beforehand then counts for 6 % of the estimate.
MOST_ERROR_OF_B = 0.25
#: Where fits start: kappa of the first guess.
_KAPPA = 0.5
#: Gauss-Newton steps at most, and the change in 1/m at which they end.
_STEPS, _STILL = 30, 1e-7
#: Ranges of waters that are tried where light is reflected, and how far beyond the largest absorption its
#: polynomials may be continued, as a factor.
_RANGES, _AS_FAR = 5, 1.02
#: Henyey-Greenstein phase functions between which waters lie, for what the choice of one is worth.
OTHER_G = (0.87, 0.97)


@dataclass(frozen=True, eq=False)
class Scattered:
    """What the readings tell of absorption and scattering, colour by colour.

    Parameters
    ----------
    wavelength_nm : array, shape (n_colours,), nm
    a, b, a_stderr, b_stderr : array, shape (n_colours,), 1/m
        Meant where `told`; elsewhere b is held at a guess, and a goes with it. Errors are widened by misfits.
    told : array of bool, shape (n_colours,)
        Does the layout part a from b?
    kappa : array, shape (n_colours,)
        Of the combination a + kappa b that the readings tell best.
    combined, combined_stderr : array, shape (n_colours,), 1/m
    absorption_alone : array, shape (n_colours,), 1/m
        What absorption would be if nothing were scattered.
    largest_b : float, 1/m
        Up to which scattering was looked for.
    share : array, shape (n_places, n_colours)
        Part of the light in water that had been scattered or reflected.
    chi2 : float
    other_kappa : dict
        Mean kappa for other phase functions, by g.
    expected : array, shape (n_colours,), 1/m
        Slope that the first table would show in the scene's own water.
    """

    wavelength_nm: Array
    a: Array
    b: Array
    a_stderr: Array
    b_stderr: Array
    told: NDArray[np.bool_]
    kappa: Array
    combined: Array
    combined_stderr: Array
    absorption_alone: Array
    largest_b: float
    share: Array
    chi2: float
    dof: int
    other_kappa: dict[float, float]
    expected: Array

    @property
    def misfit_p(self) -> float:
        """Probability of a larger chi-square if only absorption and scattering are at work."""
        return misfit_p(self.chi2, self.dof)


@dataclass(frozen=True, eq=False)
class Stack:
    """Several tables of one water under each other.

    Parameters
    ----------
    tables : sequence of Ratios
    excess : sequence of Excess
        One per table.
    """

    tables: Sequence[Ratios]
    excess: Sequence[Excess]

    @property
    def reflects(self) -> bool:
        """Do walls or a surface send light back?"""
        return any(any(table.scene.reflectances) for table in self.tables)

    @property
    def y(self) -> Array:
        """shape (n_rows, n_colours)"""
        return np.concatenate([t.y for t in self.tables])

    @property
    def sigma(self) -> Array:
        """shape (n_rows, n_colours)"""
        return np.concatenate([t.stderr for t in self.tables])

    @property
    def path_m(self) -> Array:
        """shape (n_rows,), m"""
        return np.concatenate([t.path_m for t in self.tables])

    @property
    def alphas(self) -> Array:
        """Columns of X of one constant per table, shape (n_rows, n_colours, n_tables)."""
        which = np.repeat(np.arange(len(self.tables)), [len(t.path_m) for t in self.tables])
        column = (which[:, None] == np.arange(len(self.tables))).astype(float)
        return np.repeat(column[:, None, :], self.y.shape[1], axis=1)

    def shared(self, traced: bool) -> tuple[Array, Array]:
        """H and errors of stays and, if asked for, of the traced light."""
        blocks, errors = (list(each) for each in zip(*(t.shared for t in self.tables), strict=True))
        if traced:
            blocks = [np.hstack([h, e.modes]) for h, e in zip(blocks, self.excess, strict=True)]
            errors = [
                np.concatenate([s, np.ones(e.modes.shape[1])])
                for s, e in zip(errors, self.excess, strict=True)
            ]
        return block_diag(*blocks), np.concatenate(errors)

    def light(self, a: Array, b: Array) -> Array:
        """ln(all light / direct light), shape (n_rows, n_colours)."""
        return np.concatenate([e.value(a, b) for e in self.excess])

    def of_water(self, water: Water, scattered: bool = True) -> Array:
        """ln of what a water lets through, mean over every band, shape (n_rows, n_colours).

        Parameters
        ----------
        scattered : bool
            False: every scattered photon is lost.
        """
        rows = []
        for table, excess in zip(self.tables, self.excess, strict=True):
            a, b = table.seen.coefficients(water)
            ln = -np.multiply.outer(table.path_m, a + b)
            if scattered:
                ln += excess.value(a.ravel(), b.ravel()).reshape(ln.shape)
            rows.append(table.seen.mean_ln(ln))
        return np.concatenate(rows)

    def slopes(self, a: Array, b: Array) -> tuple[Array, Array]:
        """Its derivatives by a and b, m."""
        by_a, by_b = zip(*(e.slopes(a, b) for e in self.excess), strict=True)
        return np.concatenate(by_a), np.concatenate(by_b)


def traced_stack(apparent: Sequence[Apparent], trace: DiffuseSource, g: float | None = None) -> Stack:
    """Scattered and reflected light at the places of all tables, for all waters that may be.

    In open water none absorbs more than K. Under a surface, or between walls, more light comes back the
    farther away it is read, and K may be a third of the absorption: there that absorption counts which would
    show K if nothing were scattered.

    Parameters
    ----------
    apparent : sequence of Apparent
    g : float, optional
        Asymmetry of a Henyey-Greenstein phase function; default: the scene's.
    """
    clearest = np.min([one.K_per_m for one in apparent], axis=0)
    most = np.max([one.K_per_m for one in apparent], axis=0)
    for _ in range(_RANGES):
        stack = _stack_up_to(apparent, trace, float(clearest.min()), float(most.max()), g)
        if not stack.reflects:
            break
        nothing = np.zeros_like(most)
        alone = _absorption(stack, np.maximum(most, 0.0), nothing, nothing > 0)[1]
        if alone.max() <= _AS_FAR * stack.excess[0].largest_a:
            break
        clearest, most = np.maximum(clearest, alone), np.maximum(most, alone)
    return stack


def _stack_up_to(
    apparent: Sequence[Apparent], trace: DiffuseSource, least: float, most: float, g: float | None
) -> Stack:
    """The same for waters of which the clearest and the darkest would absorb so much, 1/m."""
    largest_b, largest_a = LARGEST_B * max(least, 0.01), max(most, 0.01)
    typical = (0.5 * max(least, 0.01), max(least, 0.01))
    excess = []
    for one in apparent:
        ratios = one.ratios
        if g is not None:
            other = ratios.scene.with_values({"water.phase.g": g}, validate=False)
            ratios = replace(ratios, scene=other)
        places = (ratios.x_m, ratios.y_m, ratios.z_m)
        excess.append(excess_light(ratios.scene, places, trace, largest_a, largest_b, typical))
    return Stack([one.ratios for one in apparent], excess)


def other_phases(apparent: Sequence[Apparent], trace: DiffuseSource) -> dict[float, Stack]:
    """The same light for other phase functions of the family, by g; none where the scene's has no g."""
    if apparent[0].ratios.scene.water.phase.type != "henyey-greenstein":
        return {}
    return {g: traced_stack(apparent, trace, g) for g in OTHER_G}


def scattered_light(
    apparent: Sequence[Apparent], stack: Stack, others: Mapping[float, Stack] | None = None
) -> Scattered:
    """Fit a and b of every colour where the layout parts them, elsewhere a with b held.

    Parameters
    ----------
    apparent : sequence of Apparent
    stack : Stack
        From `traced_stack`.
    others : mapping, optional
        From `other_phases`.
    """
    estimate, a, b, told = _fitted(apparent, stack)
    kappa, combined, combined_stderr = _combination(estimate, a, b)
    nothing, largest = np.zeros_like(b), stack.excess[0].largest_b
    alone = _absorption(stack, np.maximum(combined, 0), nothing, nothing > 0)[1]
    dof = estimate.dof - int((~told).sum())
    times = misfit_factor(estimate.chi2, dof)
    error = times * estimate.stderr[:, -2:]
    other_kappa = {
        g: float(_combination(*_fitted(apparent, o)[:3])[0].mean()) for g, o in (others or {}).items()
    }
    return Scattered(
        apparent[0].ratios.wavelength_nm, a, b, error[:, 0], error[:, 1], told, kappa, combined,
        times * combined_stderr, alone, largest, -np.expm1(-stack.light(a, b)), estimate.chi2, dof,
        other_kappa, scene_says(apparent[0], stack.excess[0]),
    )  # fmt: skip


def _combination(estimate: JointEstimate, a: Array, b: Array) -> tuple[Array, Array, Array]:
    """kappa of the best known a + kappa b, that sum and its error."""
    covariance = estimate.of_each()[:, -2:, -2:]
    variance, across = covariance[:, 1, 1], covariance[:, 0, 1]
    kappa = -across / variance
    left = np.clip(covariance[:, 0, 0] - across**2 / variance, 0, None)
    return kappa, a + kappa * b, np.sqrt(left)


def scene_says(apparent: Apparent, excess: Excess) -> Array:
    """Slope K that the scene's own water would show here, shape (n_colours,), 1/m."""
    r = apparent.ratios
    y = Stack([r], [excess]).of_water(r.scene.water)
    return -np.polyfit(r.path_m, y, 1)[0]


def _fitted(
    apparent: Sequence[Apparent], stack: Stack
) -> tuple[JointEstimate, Array, Array, NDArray[np.bool_]]:
    """Parameters (gains, a, b) of every colour, a, b, and where b was free.

    Where the layout does not tell b, it stays where the fit starts, and its column says what it would have
    been worth there. A fit along a line that hardly bends would only run to an end of it.
    """
    K = np.min([one.K_per_m for one in apparent], axis=0)
    b = np.minimum(0.5 * np.maximum(K, 0) / _KAPPA, 0.5 * stack.excess[0].largest_b)
    held = np.zeros(len(b), bool)
    estimate, a, b = _absorption(stack, np.maximum(K - _KAPPA * b, 0), b, held)
    told = estimate.stderr[:, -1] <= MOST_ERROR_OF_B * stack.excess[0].largest_b
    if told.any():
        estimate, a, b = _absorption(stack, a, b, told)
    return estimate, a, b, told


def _drawn_out(b: Array, step: Array, largest: float) -> NDArray[np.bool_]:
    return ((b <= 0) & (step < 0)) | ((b >= largest) & (step > 0))


def _absorption(
    stack: Stack, a: Array, b: Array, told: NDArray[np.bool_]
) -> tuple[JointEstimate, Array, Array]:
    """Gauss-Newton in a, and in b where it is told; a last row of every colour says how wide its range is."""
    s, alphas, largest = stack.path_m[:, None], stack.alphas, stack.excess[0].largest_b
    tables = alphas.shape[2]
    H, errors = stack.shared(traced=True)
    H = np.vstack([H, np.zeros((1, H.shape[1]))])
    known = np.vstack([stack.sigma, np.full((1, alphas.shape[1]), largest)])
    for _ in range(_STEPS):
        by_a, by_b = stack.slopes(a, b)
        rest = stack.y + (a + b) * s - stack.light(a, b)
        columns = np.concatenate([alphas, (by_a - s)[..., None], (by_b - s)[..., None]], axis=2)
        last = np.zeros((1, *columns.shape[1:]))
        last[..., -1] = 1.0
        columns, values = np.concatenate([columns, last]), np.vstack([rest, 0.5 * largest - b])
        estimate = Design(known, columns, H, errors).estimate(values)
        step, held = estimate.theta, np.zeros(len(b), bool)
        # With b held, or at an end that it is drawn beyond, all else goes where it is best given that b.
        while (more := ~held & (~told | _drawn_out(b, step[:, tables + 1], largest))).any():
            held |= more
            within = np.where(held[:, None] & (np.arange(tables + 2) > tables), 0.0, columns)
            step = Design(known, within, H, errors).estimate(values).theta
        new_a = a + step[:, tables]
        new_b = np.where(held, b, np.clip(b + step[:, tables + 1], 0.0, largest))
        moved = max(np.abs(new_a - a).max(), np.abs(new_b - b).max())
        a, b = new_a, new_b
        if moved < _STILL:
            break
    return estimate, a, b
