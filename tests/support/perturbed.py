"""Scenes of which one field is another, for every field there is."""

from __future__ import annotations

from typing import Any

from lightfield.scene import Scene
from lightfield.scene.all_parameters import PARTS

WORDS: dict[str, Any] = {
    "lamp.profile": "isotropic",
    "lamp.spectrum": "cie-a",
    "detector.response": "silicon",
    "water.base": "petzold-coastal",
    "lamp.profile_departure": ((0.0, 0.1), (10.0, -0.2)),
    "lamp.power_departure": ((0.0, 0.0), (1000.0, 0.1)),
    "lamp.spectrum_departure": ((480.0, 0.0), (580.0, 0.1)),
    "water.colour_departure": ((480.0, 0.02), (580.0, -0.01)),
    "detector.plane_departure": ((4.5, 0.02), (6.5, -0.01)),
    "detector.background_departure": ((480.0, 0.02), (580.0, 0.01)),
    "water.absorption_departure": ((4.0, -0.02), (7.0, 0.03)),
    "water.absorption_at": ((480.0, 0.15), (580.0, 0.2)),
    "water.phase": {"type": "petzold"},
    "tank.surface": "none",
    "detector.quantity": "scalar_irradiance",
    "detector.aim": "lamp",
    "detector.planes_m": (2.0, 5.0),
    "detector.positions_m": ((0.1, 0.0, 4.5), (0.3, 0.0, 4.5)),
    "detector.bands_nm": ((510.0, 530.0),),
}
FIELDS = [f"{part}.{name}" for part, model in PARTS.items() for name in model.model_fields]


def changed(scene: Scene, path: str) -> Scene:
    """The scene with another value of one field; the same where that makes no sense there.

    Of a table the file beside it, in whose name "one" is "two".
    """
    now = scene.get(path)
    if path in WORDS:
        return scene.with_values({path: WORDS[path]}, validate=path == "water.phase")
    if path.endswith("table"):
        return scene.with_values({path: now.replace("one", "two")}, validate=False) if now else scene
    parameter = scene.parameters()[path]
    step = 0.2 * (abs(parameter.value) or min(1.0, parameter.high))
    value = parameter.value + (step if parameter.value + step <= parameter.high else -step)
    return scene.with_values({path: round(value) if isinstance(now, int) else value}, validate=False)
