"""Light of a scene at places, mean over its band as it is read: direct and diffuse, with errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.errors import UsageError
from lightfield.fitting.diffuse_light import DiffuseSource, TracedDiffuse
from lightfield.formula.closed_form import direct_field
from lightfield.formula.own_formulas import lit
from lightfield.render.diffuse.dense_water import dense_water, trace_for
from lightfield.scene import Scene
from lightfield.scene.bands import over_first_band, refuse_unlit
from lightfield.scene.lamp.width import stated_width_deg
from lightfield.scene.water.coefficients import scattering_per_m

Points = tuple[Array, Array, Array]
#: Farthest distance that is asked about, m: in the clearest water e^-20 of the light is left there.
FARTHEST_M = 1000.0
#: Of the lamp's light: less cannot be squared, and is told from nothing by no detector.
_LEAST_LEFT = 1e-100


#: Parts of the band: 3 nm in one of 60 nm, so that a narrow filter over the steep rise of water is right.
_PARTS = 20


@dataclass(frozen=True, eq=False)
class LightAt:
    """Light at n places for unit on-axis intensity.

    Parameters
    ----------
    direct, diffuse : array, shape (n,), 1/m^2 (1/m^2/sr for radiance)
    modes : array, shape (n, k)
        Errors of the diffuse light as independent contributions; the last is the smooth one.
    """

    direct: Array
    diffuse: Array
    modes: Array

    @property
    def total(self) -> Array:
        """All light, shape (n,)."""
        return self.direct + self.diffuse

    @property
    def relative_modes(self) -> Array:
        """Errors of ln(all light), shape (n, k); none where there is no light."""
        total = self.total[:, None]
        return np.divide(self.modes, total, out=np.zeros_like(self.modes), where=total > 0)


def diffuse_response_at(
    trace: DiffuseSource, scene: Scene, places: Points, largest_b: float
) -> TracedDiffuse:
    """The response of the diffuse light at places, in water that scatters up to so much.

    Photons are sent as wide as the beam is, a table's too.

    Parameters
    ----------
    trace : callable
        `lightfield.render.diffuse.source.response_for` or the like.
    largest_b : float, 1/m
    """
    width = stated_width_deg(lit(scene).lamp)
    sent = scene.with_values({"lamp.hwhm_deg": width}, validate=False)
    response = trace(sent, *places)
    if dense_water(np.array([largest_b])) is not None:
        response = response.with_denser(trace(sent, *places, dense_per_m=trace_for(largest_b)))
    return response


def light_at(scene: Scene, x_m: Array, y_m: Array, z_m: Array, trace: DiffuseSource | None) -> LightAt:
    """Light at places, mean over the scene's first band as the detector reads it.

    The lamp's spectrum times the detector's response is the weight; the band is shifted as its wavelengths.

    Parameters
    ----------
    x_m, y_m, z_m : array, shape (n,), m
    trace : callable, optional
        None: direct light alone.
    """
    scene = lit(scene)
    at, power = over_first_band(scene, _PARTS)
    share = power / power.sum() if power.sum() > 0 else np.full(len(power), 1.0 / len(power))
    places = (x_m, y_m, z_m)
    direct = sum(
        (
            part * direct_field(scene, *places, np.full(len(z_m), w))
            for part, w in zip(share, at, strict=True)
        ),
        np.zeros(len(z_m)),
    )
    if trace is None:
        return LightAt(direct, np.zeros(len(z_m)), np.zeros((len(z_m), 1)))
    colours = [float(w) for w in at]
    response = diffuse_response_at(trace, scene, places, float(scattering_per_m(scene.water, at).max()))
    diffuse = share @ response.light(scene, colours)
    middle = np.full(len(z_m), len(colours) // 2)
    noise, smooth = response.errors(scene, colours, middle)
    return LightAt(direct, diffuse, np.column_stack([noise, smooth]))


def refuse_dark(scene: Scene, z_m: Sequence[float], *, where: str | None = None, remedy: str) -> None:
    """Refuse distances so far that nothing is left of the light; to be called before anything is traced.

    Parameters
    ----------
    scene : Scene
        Direct light on its axis is asked about, mean over its first band.
    z_m : sequence of float, m
    where, remedy : str, optional
        Of the error.

    Raises
    ------
    UsageError
        Less than `_LEAST_LEFT` is left there.
    SceneError
        There was none in the scene's bands.
    """
    refuse_unlit(scene)
    z = np.asarray(z_m, float)
    x, y = (np.full(len(z), v) for v in (scene.lamp.offset_x_m, scene.lamp.offset_y_m))
    refuse_dark_light(z, light_at(scene, x, y, z, None).direct, where=where, remedy=remedy)


def refuse_dark_light(z_m: Array, direct: Array, *, where: str | None, remedy: str) -> None:
    """As `refuse_dark`, by the direct light at the distances for unit intensity, shape (n,)."""
    if dark := [f"{z:g}" for z, there in zip(z_m, direct * z_m**2, strict=True) if not there > _LEAST_LEFT]:
        raise UsageError(
            "no light is left so far from the lamp", where=where, found=f"{', '.join(dark)} m",
            rule=f"direct light times squared distance more than {_LEAST_LEFT:g} of the lamp's intensity",
            remedy=remedy,
        )  # fmt: skip
