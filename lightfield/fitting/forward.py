"""Readings predicted from parameter values: the bridge from a scene and a reading table to a fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.fitting.gains import Gains
from lightfield.fitting.light_source import LightSource
from lightfield.fitting.reader import Reader
from lightfield.readings import Readings
from lightfield.scene import Scene


class SceneForward:
    """Predicts the readings of a table from values of scene parameters and one gain per channel.

    Parameters
    ----------
    scene : Scene
        Values that are not given to `predict` are the scene's.
    diffuse : callable, optional
        Traces the scattered and reflected light, see `DiffuseLight`.
    full : float, optional
        Reading that saturation is relative to; default: the largest.
    dense_per_m : float, optional, m^-1
        Also trace in this water; default: if the scene's own asks for it.
    light : LightSource, optional
        Instead of a new one.

    Attributes
    ----------
    light : LightSource
        Light at the readings.
    scenes : SceneOfValues
        Which scene values stand for.
    gains : Gains
        Reading per unit of light.
    reader : Reader
        What is read of the light.
    """

    def __init__(
        self,
        scene: Scene,
        readings: Readings,
        diffuse: DiffuseSource | None = None,
        full: float | None = None,
        dense_per_m: float | None = None,
        light: LightSource | None = None,
    ) -> None:
        self.scene, self.readings = scene, readings
        self.light = light or LightSource.of(scene, readings, diffuse, dense_per_m)
        self.scenes, self.gains = self.light.scenes, Gains(self.light)
        full = float(np.max(np.abs(readings.value))) if full is None else full
        self.reader = Reader(self.scenes, readings, self.gains, full)

    @property
    def size(self) -> int:
        return len(self.light.diffuse.channels[1])

    def at(self, share: float = 1.0, **places: NDArray[Any]) -> SceneForward:
        """The same scene at other places.

        Parameters
        ----------
        share : float
            Part of the photons that a trace there is worth.
        places : arrays of one length
            Columns of readings: positions, medium and time.
        """
        columns: dict[str, Any] = {**places}
        n = len(next(iter(places.values())))
        there = replace(self.readings.subset(np.zeros(n, int)), **columns)
        return self.with_light(self.light.at(there, share))

    def subset(self, rows: NDArray[np.bool_]) -> SceneForward:
        """The same at some of the readings, of every channel some."""
        return self.with_light(self.light.subset(rows))

    def holding(self, values: Mapping[str, float]) -> SceneForward:
        """The same near some values, for slopes: scattered and reflected light does not follow the lamp."""
        return self.with_light(self.light.holding(values))

    def read_as(self, readings: Readings) -> SceneForward:
        """The same light, at the same places, read as in another table: curves are laid out by its values."""
        return SceneForward(self.scene, readings, light=self.light.read_as(readings))

    def with_light(self, light: LightSource) -> SceneForward:
        """The same instrument in other light, at its places and of its scene."""
        return SceneForward(light.scenes.scene, light.readings, full=self.reader.full, light=light)

    def predict(self, values: Mapping[str, float]) -> Array:
        """Readings, shape (n,)."""
        return self.reader.read(self.light.light(values), values)

    def errors(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Errors of the predicted readings by their light's, before saturation, see `LightSource.errors`."""
        modes, smooth = self.light.errors(values)
        factor = self.reader.per_light(values)
        modes *= factor[:, None]
        return modes, factor * smooth

    def lamp_errors(self, values: Mapping[str, float]) -> Array:
        """Errors of the predicted readings by those of the lamp's table, see `LightSource.lamp_errors`."""
        modes = self.light.lamp_errors(values)
        return np.asarray(modes * self.reader.per_light(values)[:, None]) if modes.size else modes
