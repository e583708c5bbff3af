"""Light of a lamp whose width has a colour, from traces of it as it shines at some wavelengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lightfield.arrays import TINY, Array
from lightfield.render.response.response import TransportResponse


@dataclass(frozen=True)
class OfColours:
    """A response at any wavelength, between those at some.

    Parameters
    ----------
    at_nm : tuple of float
    responses : tuple of TransportResponse
        Of the lamp as it shines at each of these wavelengths, by the same photons.
    """

    at_nm: tuple[float, ...]
    responses: tuple[TransportResponse, ...]

    def evaluate(
        self,
        wavelengths_nm: Array,
        a: Array,
        b: Array,
        albedo: Array | float,
        surface: Array | float,
        hardening: float = 0.0,
        part: str = "all",
    ) -> tuple[Array, Array]:
        """Maps at wavelengths, nm, and in waters, m^-1, of shape (n,); see `TransportResponse.evaluate`.

        On the polynomial in the logarithm of the wavelength through those of which there are traces: of
        scattered and reflected light itself, and of the logarithm of straight light, which falls off as a
        Gaussian does.
        """
        if part == "all":
            asked = wavelengths_nm, a, b, albedo, surface, hardening
            (straight, error), (rest, noise) = (self.evaluate(*asked, p) for p in ("direct", "diffuse"))
            # Where nothing was scattered its error is not known: none is told where straight light is.
            told = np.isfinite(noise) | ~((rest == 0) & (straight > 0))
            return straight + rest, np.hypot(error, np.where(told, noise, 0.0))
        each = [r.evaluate(a, b, albedo, surface, hardening=hardening, part=part) for r in self.responses]
        means, errors = (np.array(v) for v in zip(*each, strict=True))
        shares = self._shares(wavelengths_nm).reshape(len(each), -1, *(1,) * (means.ndim - 2))
        spread = (np.abs(shares) * errors).sum(axis=0)
        if part == "diffuse":
            return (shares * means).sum(axis=0), spread
        lit = (means > 0).all(axis=0)
        return np.exp((shares * np.log(np.maximum(means, TINY))).sum(axis=0)) * lit, spread

    def _shares(self, wavelengths_nm: Array) -> Array:
        """Of each trace at each wavelength (Lagrange), shape (n_traces, n)."""
        at = np.log(self.at_nm)
        away, between = np.log(np.asarray(wavelengths_nm, float)) - at[:, None], at[:, None] - at
        others = [np.arange(len(at)) != k for k in range(len(at))]
        return np.array([away[o].prod(axis=0) / between[k, o].prod() for k, o in enumerate(others)])
