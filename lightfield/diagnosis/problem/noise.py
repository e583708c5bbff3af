"""Noise of the readings: standard errors, serial correlation, error budget."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.diagnosis.problem.assumed import Assumed
from lightfield.diagnosis.problem.chain import fewer_columns, low_rank
from lightfield.diagnosis.problem.layout import Labels, Layout
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.position_slope import position_slope

#: How far a model error that is of no interest, and that of the response of diffuse light (of one trace), is
#: the same in two bands. Chosen: on half of the first, or 0.99, no test of several bands hangs.
_CHANNELS_ALIKE, _RESPONSES_ALIKE = 0.7, 0.99
#: So many readings are whitened as one. Chosen: time alone; what blocks leave out is _LEFT_OUT.
WHITENED_WHOLE = 512
#: Shared variance that is left out between blocks, in units of the reading's own: chi-square and determinant
#: stay right to that part (test_chain.py); and over the largest one, what rounding leaves of it, in double
#: precision and, of many readings, in single.
_LEFT_OUT, _ROUNDING, _ROUNDING_OF_MANY = 1e-4, 1e-11, 1e-6
#: Of more readings than this what they share is told by fewer columns, which leave out so much of a reading's
#: own variance on average, in the directions of which they share least. Measured: beside 10,125 readings with
#: scattered light 563 do for 1070; chi-square differs by less than 1e-4 of itself, and scatters by 1.4e-2.
_MANY, _LEFT_OUT_OF_MANY = 3000, 5e-4
#: Rows of what readings share that are worked out at a time. Chosen: memory alone.
_AT_ONCE = 512
#: The shared covariance of so many readings is kept while their factor is made; beside errors of photons they
#: are whitened as one. Measured: what 1495 share takes 957 columns, and as long as the whole factor.
_KEPT_WHOLE = 1500
#: Photons' variance over a reading's own from which on products of their contributions are double precision.
#: Measured: rounded singly they leave a covariance of 1000 readings that is none from a million times on.
_SINGLE = 1e3
#: Photons' contributions are as they are where there are so many times more readings. Chosen: time alone.
_SMALL_RANK = 8


@dataclass(frozen=True)
class Budget:
    """Error budget in relative units and metres, and which of its terms were assumed rather than given."""

    plane_gain: float
    position_m: float
    tolerance: float
    gain_stated: bool = False
    assumed: tuple[Assumed, ...] = ()
    outlier_rate: float = 0.0
    #: Standard error of the calibration; None on a relative scale.
    calibration: float | None = None
    #: The stated errors are taken for so many times as large as they are.
    times_stated: float = 1.0

    def position_slope(self, forward: SceneForward, values: Mapping[str, float]) -> Array:
        """|gradient| of the readings, per metre, shape (n,); zeros where places are exact."""
        return position_slope(forward, values) if self.position_m > 0 else np.zeros(forward.size)


@dataclass(frozen=True)
class Noise:
    """Everything the covariance is made of.

    Parameters
    ----------
    sigma, prediction : array, shape (n,)
        Smoothed standard error, without what the bands of a spectrum share, and the model reading that it
        belongs to.
    position_slope : array, shape (n,)
        |gradient| of the prediction with respect to x, y, z, per metre.
    photon_modes : array, shape (n, k), optional
        Monte Carlo errors of the predictions as independent contributions.
    response_error : array, shape (n,), optional
        Size of a smooth error of the predictions' scattered and reflected light.
    lamp_modes : array, shape (n, k), optional
        What errors of the lamp's table make of the predictions, as independent contributions.
    """

    layout: Layout
    sigma: Array
    prediction: Array
    budget: Budget
    position_slope: Array
    photon_modes: Array | None = None
    response_error: Array | None = None
    lamp_modes: Array | None = None

    @property
    def without_light(self) -> Noise:
        """The same without the errors of the light."""
        return replace(self, photon_modes=None, response_error=None, lamp_modes=None)

    @property
    def alone(self) -> Noise:
        """The readings' own errors and nothing that they share."""
        layout = replace(self.layout, common=np.zeros(self.layout.size))
        return replace(self.without_light, layout=layout, budget=Budget(0.0, 0.0, 0.0))

    @property
    def _bright(self) -> Array:
        return np.clip(self.prediction, 0, None)

    @cached_property
    def stays(self) -> tuple[Labels, Array]:
        """Stays that share a gain error, from 0, -1 for a reading without; its size; both of shape (n,)."""
        _, stay, count = np.unique(self.layout.visit, return_inverse=True, return_counts=True)
        # Assumed for lack of better, it must not widen the errors of readings that have a stay to themselves.
        has_one = self.budget.gain_stated | (count[stay] > 1)
        gain = np.where(has_one, self.budget.plane_gain * self._bright, 0.0)
        return np.where(gain > 0, stay, -1), gain

    @property
    def has_many(self) -> bool:
        """Are there so many readings that what they share is told by fewer columns, and kept singly?"""
        return self.layout.size > _MANY

    @property
    def is_kept_whole(self) -> bool:
        """Is the shared covariance kept while its factor is made?"""
        return self.layout.size <= _KEPT_WHOLE

    @property
    def has_modes(self) -> bool:
        """Are there Monte Carlo errors?"""
        return self.photon_modes is not None and bool(self.photon_modes.size)

    @property
    def of_moments(self) -> tuple[tuple[Labels, Array], ...]:
        """Errors that readings taken at once share: labels from 0, and their size; both of shape (n,).

        By the place, in one moment; and by what all bands of a spectrum see.
        """
        lay = self.layout
        every = (
            (lay.moment, self.budget.position_m * self.position_slope),
            (lay.spectrum, lay.common * self._bright),
        )
        return tuple(one for one in every if one[1].any())

    def _smooth(self, a: Labels, b: Labels, tolerance: float) -> Array:
        """Covariance of tolerated model error and diffuse light between two sets of readings."""
        if self.layout.size > WHITENED_WHOLE and self.is_kept_whole and not self.has_modes:
            # Asked for twice: for its rank, and for the factor.
            if tolerance not in self._whole:
                every = np.arange(self.layout.size)
                self._whole[tolerance] = self._smooth_between(every, every, tolerance)
            return np.asarray(self._whole[tolerance][np.ix_(a, b)])
        return self._smooth_between(a, b, tolerance)

    def _smooth_between(self, a: Labels, b: Labels, tolerance: float) -> Array:
        lay, out = self.layout, np.zeros((len(a), len(b)))
        smooth = [(tolerance * self._bright, _CHANNELS_ALIKE)] if tolerance > 0 else []
        if self.response_error is not None and self.response_error.any():
            smooth.append((self.response_error, _RESPONSES_ALIKE))
        if smooth:
            one_channel = lay.one_channel or lay.channel[a][:, None] == lay.channel[b][None]
            for part, share in smooth:
                shared = np.outer(part[a], part[b])
                if one_channel is not True:
                    shared *= np.where(one_channel, 1.0, share)
                out += shared
            out *= lay.alike_among(a) if a is b else lay.alike(a, b)
        if self.has_modes:
            some = self._exact_modes[a]
            # Of one array with itself BLAS does half the work.
            out += some @ (some if a is b else self._exact_modes[b]).T
        if self.lamp_modes is not None:
            out += self.lamp_modes[a] @ self.lamp_modes[b].T
        return out

    @cached_property
    def _exact_modes(self) -> Array:
        """Monte Carlo errors in a precision whose rounding is far below the readings' own noise."""
        assert self.photon_modes is not None
        many_times = float(((self.photon_modes**2).sum(axis=1) / self.sigma**2).max())
        return self.photon_modes.astype(float, copy=False) if many_times > _SINGLE else self.photon_modes

    def _smooth_variance(self, tolerance: float) -> Array:
        out = (tolerance * self._bright) ** 2
        if self.response_error is not None:
            out = out + self.response_error**2
        for modes in (self.photon_modes, self.lamp_modes):
            if modes is not None:
                out = out + (modes**2).sum(axis=1)
        return np.asarray(out)

    @cached_property
    def _whole(self) -> dict[float, Array]:
        return {}

    def forget(self, columns: bool) -> None:
        """Free the memory of what was kept while a factor was made, with the shared columns or without."""
        self._whole.clear()
        if columns:
            self._smooth_columns.clear()

    @cached_property
    def _smooth_columns(self) -> dict[float, Array]:
        return {}

    def smooth_columns(self, tolerance: float) -> Array:
        """Columns U with U U^T near the covariance of tolerated model error and diffuse light, shape (n, r).

        No variance differs by more than `_LEFT_OUT` times that of the reading's own noise; those of many
        readings by `_LEFT_OUT_OF_MANY` on average.
        """
        if tolerance not in self._smooth_columns:
            parts = self._parts(tolerance) if self._few_modes else [self._of_low_rank(tolerance)]
            if self.has_many:  # of the first alone, then of what is left of it and the other
                parts[0] = fewer_columns(parts[:1], self.sigma, 0.5 * _LEFT_OUT_OF_MANY)
                parts = [fewer_columns(parts, self.sigma, 0.5 * _LEFT_OUT_OF_MANY)]
            self._smooth_columns[tolerance] = np.hstack(parts)
        return self._smooth_columns[tolerance]

    def _of_low_rank(self, tolerance: float) -> Array:
        own, variance = self.sigma, self._smooth_variance(tolerance) / self.sigma**2
        kind, rounding = (np.float32, _ROUNDING_OF_MANY) if self.has_many else (np.float64, _ROUNDING)

        def between(a: Labels, b: Labels) -> Array:
            out = np.empty((len(a), len(b)), kind)
            for at in range(0, len(a), _AT_ONCE):
                some = a[at : at + _AT_ONCE]
                out[at : at + _AT_ONCE] = self._smooth(some, b, tolerance) / np.outer(own[some], own[b])
            return out

        few = max(_LEFT_OUT, rounding * float(variance.max()))
        columns = low_rank(between, variance, few)
        columns *= own[:, None]
        return columns

    @property
    def _few_modes(self) -> bool:
        modes = self.photon_modes
        return modes is not None and 0 < _SMALL_RANK * modes.shape[1] < self.layout.size

    def smooth_parts(self, tolerance: float) -> list[Array]:
        """The same, not yet side by side: what photons contribute apart, where that is little."""
        if not self._few_modes or self.has_many:
            return [self.smooth_columns(tolerance)]
        return self._parts(tolerance)

    def _parts(self, tolerance: float) -> list[Array]:
        assert self.photon_modes is not None
        return [replace(self, photon_modes=None)._of_low_rank(tolerance), self.photon_modes]

    def extra(self, tolerance: float, rows: Labels | None = None) -> Array:
        """Covariance of all or some readings that does not scale with the quoted errors, shape (n, n)."""
        a = np.arange(self.layout.size) if rows is None else rows
        out = self._smooth(a, a, tolerance)
        stay, gain = (each[a] for each in self.stays)
        if gain.any():
            out += np.outer(gain, gain) * (stay[:, None] == stay[None])
        for label, size in self.of_moments:
            out += np.outer(size[a], size[a]) * (label[a][:, None] == label[a][None])
        return out

    def serial(self, rho: float, rows: Labels | None = None) -> Array:
        """Correlation of the own noise of all or some readings in scan order, shape (n, n)."""
        lay = self.layout
        lag = lay.lag if rows is None else lay.lag_of(rows)
        out = (rho ** np.arange(lag.max() + 1))[lag]
        if not lay.one_channel:
            channel = lay.channel if rows is None else lay.channel[rows]
            out *= channel[:, None] == channel[None]
        return np.asarray(out)

    def covariance(self, rho: float, phi: float, tolerance: float, rows: Labels | None = None) -> Array:
        """phi S R S + plane gain + stage + what bands share + tolerated smooth model error + Monte Carlo,
        shape (n, n)."""
        sigma, out = self.sigma if rows is None else self.sigma[rows], self.extra(tolerance, rows)
        if rho == 0:
            out[np.diag_indices(len(sigma))] += phi * sigma**2
            return out
        own = phi * np.outer(sigma, sigma)
        own *= self.serial(rho, rows)
        own += out
        return own

    def variance(self, phi: float, tolerance: float) -> Array:
        """Diagonal of the covariance without serial correlation, shape (n,)."""
        shared = sum(size**2 for _, size in self.of_moments)
        return phi * self.sigma**2 + self.stays[1] ** 2 + shared + self._smooth_variance(tolerance)

    def independent(self, tolerance: float) -> bool:
        """Do no two readings share an error, but for serial correlation?"""
        labels = self.stays[0][self.stays[0] >= 0], *(label[size > 0] for label, size in self.of_moments)
        alone = all(len(np.unique(label)) == len(label) for label in labels)
        return alone and not self._smooth_variance(tolerance).any()

    def subset(self, rows: NDArray[np.bool_]) -> Noise:
        """Of some of the readings."""
        of_light = (self.photon_modes, self.response_error, self.lamp_modes)
        return Noise(
            self.layout.subset(rows), self.sigma[rows], self.prediction[rows], self.budget,
            self.position_slope[rows], *(None if each is None else each[rows] for each in of_light),
        )  # fmt: skip
