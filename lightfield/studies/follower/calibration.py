"""How a follower that believes the formula came to its K and its gain, in the light of the render."""

from __future__ import annotations

import numpy as np

from lightfield.scene import Scene, Water
from lightfield.scene.bands import middles_nm
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.studies.follower.array_light import ArrayModel, FormulaLight, Light, Space
from lightfield.studies.follower.elements import Elements
from lightfield.studies.follower.frames import poses_on_axis

#: Ways to calibrate the formula, in words.
EXACT, FITTED, CLEAR, RELATIVE = (
    "exact c, gain set near the lamp",
    "K fitted in this water",
    "K and gain from clear water",
    "relative readings only",
)
CALIBRATIONS = (EXACT, FITTED, CLEAR, RELATIVE)
#: Scattering, 1/m, of the water in which a calibration that is then kept was made (follower at home, chosen).
CLEAR_PER_M = 0.02
#: Attenuation by which paths through water are told, 1/m.
_TRIED_PER_M = 0.1


def reading_on_axis(light: Light, z_m: float) -> float:
    """Reading on the beam's axis of a receiver that faces along the tank, 1/m^2."""
    place = poses_on_axis(light.scene.lamp, np.array([z_m]))[:, :3]
    return float(light.reading(place, np.array([[0.0, 0.0, -1.0]]))[0])


def slope_per_m(light: Light, near_m: float, far_m: float) -> float:
    """K on the beam's axis between two distances, 1/m: what Beer-Lambert makes of it.

    Light over that of the same beam in water that takes nothing; paths by water that takes `_TRIED_PER_M`.
    """

    def falls(one: Light) -> float:
        near, far = (reading_on_axis(one, z) / reading_on_axis(clear, z) for z in (near_m, far_m))
        return float(np.log(near / far))

    clear, tried = (_formula(light.scene, a) for a in (0.0, _TRIED_PER_M))
    return _TRIED_PER_M * falls(light) / falls(tried)


def _formula(scene: Scene, absorption_per_m: float) -> FormulaLight:
    """The formula in water of this attenuation."""
    return FormulaLight(scene.model_copy(update={"water": Water(absorption_per_m=absorption_per_m)}))


def believed(truth: Light, elements: Elements, calibration: str, space: Space) -> tuple[ArrayModel, float]:
    """The formula as a follower has it, and the standard deviation of its gain.

    Parameters
    ----------
    truth : Light
    elements : Elements
    calibration : str
        Of `CALIBRATIONS`.
    space : Space
        Its first and last distance are those of the calibration.
    """
    made_in = truth
    if calibration == CLEAR:
        made_in = truth.in_water_of(truth.scene.with_values({"water.scattering_per_m": CLEAR_PER_M}))
    if calibration == EXACT:
        at = middles_nm(truth.scene)[0].mean(keepdims=True)
        slope = float(sum(f(truth.scene.water, at)[0] for f in (absorption_per_m, scattering_per_m)))
    else:
        slope = slope_per_m(made_in, space.near_m, space.far_m)
    formula = _formula(truth.scene, max(slope, 0.0))
    gain = reading_on_axis(made_in, space.near_m) / reading_on_axis(formula, space.near_m)
    return ArrayModel(formula, elements, gain), np.inf if calibration == RELATIVE else 0.0


def without_a_batch(
    truth: Light, elements: Elements, calibration: str, space: Space
) -> list[tuple[ArrayModel, ArrayModel]]:
    """Readings, and the formula as it is `believed` by them, without one batch of the trace, each in turn."""
    return [
        (ArrayModel(part, elements), believed(part, elements, calibration, space)[0])
        for part in truth.leave_one_out()
    ]
