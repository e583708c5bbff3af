"""Apparent attenuation K(lambda): the slope of ln(water / air) with distance, by generalised least squares.

K is what the receiver loses per metre. It is neither c nor a: scattered light that still arrives hides a part
of the loss, and does so along a line that is straight to the eye.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from lightfield.arrays import Array, Mask
from lightfield.formula.own_formulas import lit
from lightfield.readings.columns import LINE_DECIMALS, PLACE_DECIMALS
from lightfield.scene.lamp.frame import axis_at
from lightfield.scene.lamp.width import half_width_rad
from lightfield.studies.attenuation.common_errors import POOR_FIT, Design, JointEstimate, misfit_p
from lightfield.studies.attenuation.ratios import FEWEST_DISTANCES, Ratios

#: What the paper states attenuation over.
_METRE = 1.0
#: From so many errors below zero on a coefficient is no chance.
SIGMAS = 3.0
#: A ratio makes most of a misfit if so much of chi-square, at most, is left without it; so many are tried.
#: Chosen.
_LEFT, _TRIED = 0.5, 20
#: A line through fewer distances is not tested by them.
_FEWEST_TESTED = 3
#: Places up to so many half widths beside the beam's axis may stand for it. Chosen: farther out scattered
#: light is much of what is read.
_ON_AXIS = 1.0
#: No beam counts as wider, rad.
_WIDEST = 1.4


@dataclass(frozen=True, eq=False)
class Apparent:
    """Apparent attenuation of one table.

    Parameters
    ----------
    ratios : Ratios
        Without the one that was set aside.
    estimate : JointEstimate
        Parameters of each colour: alpha, K in 1/m.
    on_line : array of bool, shape (n_places,)
        Places that K is of: all, or those nearest to the beam's axis where these alone lie on lines.
    set_aside : str
        A ratio that was left out because the others lie on a line without it, in words; or nothing.
    """

    ratios: Ratios
    estimate: JointEstimate
    on_line: Mask
    set_aside: str = ""

    @property
    def path_m(self) -> Array:
        """Straight paths in water to the places that K is of, m."""
        return self.ratios.path_m[self.on_line]

    @property
    def K_per_m(self) -> Array:
        """Attenuation, shape (n_colours,), 1/m."""
        return self.estimate.theta[:, 1]

    @property
    def K_stderr(self) -> Array:
        """Its standard error, shape (n_colours,), 1/m; mostly common to all colours; widened by misfits."""
        return self.estimate.stderr[:, 1]

    @property
    def shared_stderr(self) -> Array:
        """The part of the error that all colours share, shape (n_colours,), 1/m."""
        return np.asarray(np.sqrt((self.estimate.modes[:, 1] ** 2).sum(axis=1)))

    @property
    def grows_at(self) -> int:
        """Colours at which light grows with distance, beyond errors: no water does that."""
        return int((self.K_per_m < -SIGMAS * self.K_stderr).sum())

    def mean(self) -> tuple[float, float]:
        """Mean over all colours and its standard error, by the full covariance, 1/m."""
        n = len(self.K_per_m)
        return float(self.K_per_m.mean()), float(np.sqrt(self.estimate.covariance(1).sum())) / n

    def over(self, low_nm: float, high_nm: float) -> tuple[float, float]:
        """Mean over the colours of a band and its standard error, 1/m; NaN where there are none."""
        mine = (self.ratios.wavelength_nm >= low_nm) & (self.ratios.wavelength_nm <= high_nm)
        if not mine.any():
            return float("nan"), float("nan")
        covariance = self.estimate.covariance(1)[np.ix_(mine, mine)]
        return float(self.K_per_m[mine].mean()), float(np.sqrt(covariance.sum()) / mine.sum())

    def percent(self, distance_m: float = _METRE) -> tuple[Array, Array]:
        """Part of the light lost over a distance and its standard error, shape (n_colours,), %."""
        left = np.exp(-self.K_per_m * distance_m)
        return 100 * (1 - left), 100 * left * distance_m * self.K_stderr

    @property
    def stray(self) -> str:
        """The ratio that makes most of the misfit, in words; nothing where none does."""
        found = _stray(self.ratios, self.estimate, self.on_line)
        return "" if found is None else found.words

    @property
    def misfit_p(self) -> float:
        """Probability of a larger chi-square if the logarithm really falls on straight lines."""
        return misfit_p(self.estimate.chi2, self.estimate.dof)

    def one_distance(self) -> Array:
        """-ln(water / air) / s of every place by itself, gain and window uncorrected, 1/m.

        Shape (n_places, n_colours). Whatever factor lies between the media shifts it by -ln(factor) / s: a
        window of index n, whose lamp stands in water in one medium and in air in the other, has n^2.
        """
        r = self.ratios
        return -(r.y + r.geometry[:, None]) / r.path_m[:, None]

    def dataset(self) -> xr.Dataset:
        """All numbers with their errors; covariance = diag(own^2) + modes @ modes^T."""
        estimate, r = self.estimate, self.ratios
        distances = np.unique(np.round(self.path_m, LINE_DECIMALS))
        over, per_metre = [self.percent(float(d)) for d in distances], self.percent()
        colour, far = ("wavelength_nm",), ("wavelength_nm", "distance_m")
        own, error = np.sqrt(estimate.own[:, 1, 1]), "its standard error"
        variables = {
            "attenuation": (colour, self.K_per_m, "apparent attenuation K", "m-1"),
            "attenuation_stderr": (colour, self.K_stderr, error, "m-1"),
            "attenuation_stderr_own": (colour, own, "the part of its own, independent", "m-1"),
            "attenuation_stderr_modes": (
                (*colour, "shared"), estimate.modes[:, 1], "errors that all colours share", "m-1"
            ),
            "percent_per_metre": (colour, per_metre[0], "light lost per metre", "percent"),
            "percent_per_metre_stderr": (colour, per_metre[1], error, "percent"),
            "percent": (far, np.stack([p for p, _ in over], 1), "light lost over a distance", "percent"),
            "percent_stderr": (far, np.stack([e for _, e in over], 1), error, "percent"),
            "gain": (colour, estimate.theta[:, 0], "alpha: ln of gain and window", "1"),
            "gain_stderr": (colour, estimate.stderr[:, 0], error, "1"),
        }  # fmt: skip
        return xr.Dataset(
            {k: (d, v, {"long_name": name, "units": unit}) for k, (d, v, name, unit) in variables.items()},
            coords={"wavelength_nm": r.wavelength_nm, "distance_m": distances},
            attrs={
                "chi2": estimate.chi2,
                "degrees_of_freedom": estimate.dof,
                "reference": r.reference,
                "errors_times": estimate.errors_times,
            },
        )


def apparent_attenuation(ratios: Ratios) -> Apparent:
    """Fit alpha - K s to the logarithms of all colours at once.

    Where they lie on no straight lines, one ratio is set aside if the others do without it, some at its own
    distance among them: alone there, it may be the line that bends. Else K is that of the places nearest to
    the beam's axis, if these do: beside the beam scattered light is what is read.

    Parameters
    ----------
    ratios : Ratios
        From `lightfield.studies.attenuation.ratios.ratios_of`.
    """
    whole, near = np.ones(len(ratios.path_m), bool), _nearest_to_axis(ratios)
    tested = len(np.unique(ratios.stay[near])) >= _FEWEST_TESTED and not near.all()
    for places in (whole, near) if tested else (whole,):
        found = _fitted(ratios, places)
        if not misfit_p(found.chi2, found.dof) <= POOR_FIT:
            return Apparent(ratios, found.widened(), places)
        stray = _stray(ratios, found, places)
        if stray is not None and stray.among_others and misfit_p(stray.fit.chi2, stray.fit.dof) > POOR_FIT:
            return Apparent(stray.without, stray.fit.widened(), places, stray.words)
    return Apparent(ratios, _fitted(ratios, whole).widened(), whole)


def _nearest_to_axis(ratios: Ratios) -> Mask:
    """At every distance the places that are nearest to the beam's axis, if they lie in the beam."""
    x, y = axis_at(lit(ratios.scene).lamp, ratios.z_m)
    aside = np.round(np.hypot(ratios.x_m - x, ratios.y_m - y), PLACE_DECIMALS)
    least = np.full(len(ratios.stay_stderr), np.inf)
    np.minimum.at(least, ratios.stay, aside)
    beam = _ON_AXIS * np.tan(min(half_width_rad(ratios.scene.lamp), _WIDEST)) * ratios.z_m
    return np.asarray((aside <= least[ratios.stay]) & (aside <= beam))


class _Stray(NamedTuple):
    """A ratio that makes most of a misfit: in words, what is left without it, the fit of that, and whether
    others were read at its distance, which then do not stray."""

    words: str
    without: Ratios
    fit: JointEstimate
    among_others: bool


def _stray(ratios: Ratios, found: JointEstimate, places: Mask) -> _Stray | None:
    """The ratio that makes most of a misfit.

    Tried without each of those that are farthest off: a wild one at an end bends the line towards itself.
    """
    if not misfit_p(found.chi2, found.dof) <= POOR_FIT:
        return None
    off = np.nan_to_num(np.abs(found.residual / ratios.stderr))
    least, worst = _LEFT * found.chi2, None
    for flat in np.argsort(off, axis=None)[: -_TRIED - 1 : -1]:
        row, colour = np.unravel_index(flat, off.shape)
        y, stderr = ratios.y.copy(), ratios.stderr.copy()
        y[row, colour] = stderr[row, colour] = np.nan
        left = np.isfinite(stderr[:, colour]) & places
        if len(np.unique(ratios.stay[left])) < FEWEST_DISTANCES:
            continue
        without = replace(ratios, y=y, stderr=stderr)
        fit = _fitted(without, places)
        if fit.chi2 < least:
            least, worst = fit.chi2, (row, colour, without, fit)
    if worst is None:
        return None
    row, colour, without, fit = worst
    nm, path_m = ratios.wavelength_nm[colour], ratios.path_m[row]
    over = float(np.expm1(ratios.y[row, colour] - fit.theta[colour] @ [1.0, -path_m]))
    side = f"{100 * abs(over):.2g} % {'above' if over > 0 else 'below'} the line of the rest"
    beside = np.isfinite(fit.residual[ratios.stay == ratios.stay[row]]).any()
    return _Stray(f"through {path_m:.3g} m of water at {nm:g} nm, {side}", without, fit, bool(beside))


def _fitted(ratios: Ratios, places: Mask) -> JointEstimate:
    """The lines through some of the places."""
    ones, stderr = np.ones_like(ratios.y), np.where(places[:, None], ratios.stderr, np.nan)
    X = np.stack([ones, -ratios.path_m[:, None] * ones], axis=2)
    return Design(stderr, X, *ratios.shared).estimate(ratios.y)
