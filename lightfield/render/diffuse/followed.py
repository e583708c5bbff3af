"""Scattered light followed without photons, corrected by a smooth traced ratio; reflected light as traced."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array, Mask
from lightfield.formula.scattered.scattered_field import ScatteredField, describes
from lightfield.render.diffuse.diffuse_response import REFLECTED, SCATTERED, DiffuseResponse
from lightfield.render.diffuse.ratio import TRUNCATION, Ratio
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import neutral_values
from lightfield.scene.water.water import Water

#: What only a response follows, switched off: there the light without photons begins.
_PLAIN = neutral_values(Acts.SECTION | Acts.RECEIVER)


def field_at(places: tuple[Array, Array, Array]) -> ScatteredField:
    """Light at some places that is known without photons; what it works out takes memory, and serves all that
    is followed there."""
    return ScatteredField(*_in_front(places))


def _in_front(places: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
    x, y, z = (np.asarray(v, float) for v in places)
    return x, y, np.where(z > 0, z, 1.0)  # in air, or behind the window: asked for by nobody


@dataclass(frozen=True, eq=False)
class FollowedLight:
    """Diffuse light at n places: the ratio stays as it was traced, all else moves with the scene.

    Parameters
    ----------
    response : DiffuseResponse
        For all light that was reflected, and for what `describes` leaves out, by which it changes the light.
    ratio : array, shape (n_wavelengths, n)
        Traced over known light.
    root : array, shape (n_wavelengths, n, k)
        Its error as independent contributions.
    """

    field: ScatteredField
    response: DiffuseResponse
    ratio: Array
    root: Array

    @classmethod
    def of(
        cls,
        response: DiffuseResponse,
        places: tuple[Array, Array, Array],
        traced: Sequence[tuple[Scene, Ratio]],
        field: ScatteredField | None = None,
    ) -> FollowedLight:
        """From one trace or several, each with the scene that it is of; photons pooled.

        Parameters
        ----------
        field : ScatteredField, optional
            At the same places: what it has worked out is known.
        """
        x, y, z = _in_front(places)
        shares = np.array([ratio.photons for _, ratio in traced], float)
        shares /= shares.sum()
        value: Array | float = 0.0
        roots = []
        for share, (scene, ratio) in zip(shares, traced, strict=True):
            basis = ratio.basis(scene, x, y, z)
            value = value + share * ratio.value @ basis.T
            roots.append(share * np.einsum("nk,wkj->wnj", basis, ratio.root))
        known = field_at(places) if field is None else field
        return cls(known, response, np.asarray(value), np.concatenate(roots, axis=2))

    def light(self, scene: Scene, wavelengths_nm: Sequence[float | None]) -> Array:
        """Scattered and reflected light for unit on-axis intensity, shape (n_wavelengths, n), m^-2."""
        return self.in_waters(scene, [scene.water], wavelengths_nm)[0]

    def in_waters(
        self, scene: Scene, waters: Sequence[Water], wavelengths_nm: Sequence[float | None]
    ) -> Array:
        """The same in waters that differ by what absorbs and scatters, (n_waters, n_wavelengths, n)."""
        reflected = self.response.in_waters(scene, waters, wavelengths_nm, REFLECTED)
        return np.asarray(self._scattered(scene, waters, wavelengths_nm) * self.ratio + reflected)

    def errors(
        self, scene: Scene, wavelengths_nm: Sequence[float | None], channel: NDArray[np.integer[Any]]
    ) -> tuple[Array, Array]:
        """As those of a `DiffuseResponse`: few modes, one for each polynomial, and what these leave out."""
        mine = channel, np.arange(len(channel))
        scattered = self._scattered(scene, [scene.water], wavelengths_nm)[0][mine]
        modes, smooth = self.response.errors(scene, wavelengths_nm, channel, REFLECTED)
        return (
            np.hstack([scattered[:, None] * self.root[mine], modes]),
            np.hypot(smooth, TRUNCATION * scattered * self.ratio[mine]),
        )

    def some(self, rows: Mask) -> FollowedLight:
        """At some of the readings, from the same traces."""
        return replace(
            self, field=self.field.some(rows), response=self.response.some(rows), ratio=self.ratio[:, rows],
            root=self.root[:, rows],
        )  # fmt: skip

    def _scattered(
        self, scene: Scene, waters: Sequence[Water], wavelengths_nm: Sequence[float | None]
    ) -> Array:
        """What was scattered and not reflected, uncorrected, shape (n_waters, n_wavelengths, n)."""
        if describes(scene):
            return self._known(scene, waters, wavelengths_nm)
        plain = scene.with_values(_PLAIN, validate=False)
        here, there = (self.response.in_waters(s, waters, wavelengths_nm, SCATTERED) for s in (scene, plain))
        change = np.divide(here, there, out=np.ones_like(here), where=there > 0)
        return np.asarray(self._known(plain, waters, wavelengths_nm) * change)

    def _known(self, scene: Scene, waters: Sequence[Water], wavelengths_nm: Sequence[float | None]) -> Array:
        """The same without photons, of a scene that is described."""
        return self.field.in_waters(
            [scene.model_copy(update={"water": water}) for water in waters], wavelengths_nm
        )
