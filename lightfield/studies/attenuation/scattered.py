"""Absorption and scattering behind the apparent attenuation, as far as the layout tells them.

    y = alpha - (a + b) s + excess(a, b) + errors

One receiver on the axis tells one combination, a + kappa b: light that was scattered forward still arrives.
Places beside the beam, or a second receiver that sees less of it, part the two.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.studies.attenuation.apparent import Apparent
from lightfield.studies.attenuation.common_errors import Design, JointEstimate, misfit_factor, misfit_p
from lightfield.studies.attenuation.excess import Excess, excess_light
from lightfield.studies.attenuation.stack import Stack
from lightfield.studies.attenuation.valley import Valley, valley_of

#: Scattering is looked for up to so many times the least apparent attenuation: kappa is 0.25 at least in what
#: was traced (0.47 for a cosine receiver and g = 0.92, more behind a collimator).
_LARGEST_B = 4.0
#: Absorption and scattering are told apart where the error of b is at most this part of its range: what is
#: not known of it beforehand then counts for 6 % of the estimate.
_MOST_ERROR_OF_B = 0.25
#: Where fits start: kappa of the first guess.
_KAPPA = 0.5
#: Gauss-Newton steps at most, and the change in 1/m at which they end.
_STEPS, _STILL = 30, 1e-7
#: Ranges of waters that are tried where light is reflected, and how far beyond the largest absorption its
#: polynomials may be continued, as a factor.
_RANGES, _AS_FAR = 5, 1.02
#: Henyey-Greenstein phase functions between which waters lie, for what the choice of one is worth.
_OTHER_G = (0.87, 0.97)


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
    told: Mask
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
    largest_b, largest_a = _LARGEST_B * max(least, 0.01), max(most, 0.01)
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
    return {g: traced_stack(apparent, trace, g) for g in _OTHER_G}


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
    valley = valley_of(stack)
    estimate, a, b, told = _fitted(apparent, stack, valley)
    kappa, combined, combined_stderr = _combination(estimate, a, b)
    reach_a, reach_b, bend = valley.reach_from(a, b, kappa)
    combined_stderr = np.maximum(combined_stderr, bend)
    nothing, largest = np.zeros_like(b), stack.excess[0].largest_b
    alone = _absorption(stack, np.maximum(combined, 0), nothing, nothing > 0)[1]
    dof = estimate.dof - int((~told).sum())
    times = misfit_factor(estimate.chi2, dof)
    along = np.column_stack([np.hypot(combined_stderr, reach_a), reach_b])
    error = times * np.maximum(estimate.stderr[:, -2:], along)
    other_kappa = {
        g: float(_combination(*_fitted(apparent, o, valley_of(o))[:3])[0].mean())
        for g, o in (others or {}).items()
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
    r, places = apparent.ratios, apparent.on_line
    y = Stack([r], [excess]).of_water(r.scene.water)
    return -np.polyfit(r.path_m[places], y[places], 1)[0]


def _fitted(
    apparent: Sequence[Apparent], stack: Stack, valley: Valley
) -> tuple[JointEstimate, Array, Array, Mask]:
    """Parameters (gains, a, b) of every colour, a, b, and where b was free.

    Where the layout does not tell b, it is held, and its column says what it would have been worth there. A
    fit along a line that hardly bends would only run to an end of it.
    """
    K = np.min([one.K_per_m for one in apparent], axis=0)
    b = np.minimum(0.5 * np.maximum(K, 0) / _KAPPA, 0.5 * stack.excess[0].largest_b)
    most = _MOST_ERROR_OF_B * stack.excess[0].largest_b
    told, free = valley.b_stderr <= most, np.zeros(len(b), bool)
    estimate, a, b = _absorption(stack, *valley.start(b, told), free)
    while True:
        told &= np.maximum(estimate.stderr[:, -1], valley.reach_from(a, b, 0 * b)[1]) <= most
        if (told == free).all():
            return estimate, a, b, told
        estimate, a, b = _absorption(stack, a, b, told)
        free = told.copy()


def _absorption(stack: Stack, a: Array, b: Array, told: Mask) -> tuple[JointEstimate, Array, Array]:
    """Gauss-Newton in a, and in b where it is told; a last row of every colour says how wide its range is.

    A step after which chi-square is larger is halved: light that bends the readings' line makes it too far.
    """
    s, alphas, largest = stack.path_m[:, None], stack.alphas, stack.excess[0].largest_b
    H, errors = stack.shared(traced=True)
    H = np.vstack([H, np.zeros((1, H.shape[1]))])
    known = np.vstack([stack.sigma, np.full((1, alphas.shape[1]), largest)])
    gains = np.concatenate([alphas, np.zeros((1, *alphas.shape[1:]))])
    least, best = np.inf, (a, b)
    for _ in range(_STEPS):
        values = np.vstack([stack.y + (a + b) * s - stack.light(a, b), 0.5 * largest - b])
        chi2 = Design(known, gains, H, errors).estimate(values).chi2
        if chi2 > least:
            a, b = 0.5 * (a + best[0]), 0.5 * (b + best[1])
        else:
            slopes = [
                np.vstack([by - s, last * np.ones_like(b)]) for last, by in enumerate(stack.slopes(a, b))
            ]
            design = Design(known, np.concatenate([gains, np.stack(slopes, axis=2)], axis=2), H, errors)
            estimate = design.estimate(values)
            least, best = chi2, (a, b)
            by_a, by_b = _step(design, values, b, told, largest)
            a, b = a + by_a, b + by_b
        if max(np.abs(a - best[0]).max(), np.abs(b - best[1]).max()) < _STILL:
            break
    return estimate, *best


def _step(design: Design, values: Array, b: Array, told: Mask, largest: float) -> tuple[Array, Array]:
    """Where the last two parameters of every colour, a and b, go.

    b goes up to an end of its range, or nowhere if it is not told; with b held there all else goes where
    it is best given that b.
    """
    theta, held, by_b = design.estimate(values).theta, np.zeros(len(b), bool), np.zeros(len(b))
    last = np.arange(design.X.shape[2]) == design.X.shape[2] - 1
    while True:
        inside = np.clip(b + theta[:, -1], 0.0, largest)
        more = ~held & (~told | (inside != b + theta[:, -1]))
        if not more.any():
            return theta[:, -2], np.where(held, by_b, theta[:, -1])
        held |= more
        by_b = np.where(more & told, inside - b, by_b)
        within = replace(design, X=np.where(held[:, None] & last, 0.0, design.X))
        theta = within.estimate(values - by_b * design.X[..., -1]).theta
