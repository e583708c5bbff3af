"""Scenes of which one field is another, for every field there is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lightfield.formula.readout import Halves, Taken
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
    "water.scattering_departure": ((480.0, 0.4), (580.0, -0.3)),
    "detector.plane_departure": ((4.5, 0.02), (6.5, -0.01)),
    "detector.background_course": ((0.0, 0.02), (900.0, 0.01)),
    "detector.background_departure": ((480.0, 0.02), (580.0, 0.01)),
    "water.absorption_departure": ((4.0, -0.02), (7.0, 0.03)),
    "water.absorption_at": ((480.0, 0.15), (580.0, 0.2)),
    "water.phase": {"type": "petzold"},
    "tank.surface": "none",
    "tank.panes": "sides",
    "detector.quantity": "scalar_irradiance",
    "detector.aim": "lamp",
    "detector.planes_m": (2.0, 5.0),
    "detector.positions_m": ((0.1, 0.0, 4.5), (0.3, 0.0, 4.5)),
    "detector.bands_nm": ((510.0, 530.0),),
}
#: Three colours of one spectrum, the last with one of half its wavelength: every readout acts on them.
TAKEN = Taken(
    spectrum=np.zeros(3, int),
    wavelength_nm=np.array([450.0, 500.0, 900.0]),
    time_s=np.array([0.0, 900.0, 1800.0]),
    halves=Halves(np.array([2]), np.array([0]), np.array([1]), np.array([0.5])),
    z_m=np.array([4.5, 5.5, 6.5]),
)
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


def scenes_of_every_field(folder: Path) -> list[Scene]:
    """Scenes in which, between them, every field counts; their tables are written into a folder."""
    for name, row in {"one": "5,0.5", "two": "5,0.7"}.items():
        (folder / f"beam_{name}.csv").write_text(f"angle_deg,intensity\n0,1\n{row}\n90,0\n")
        (folder / f"light_{name}.csv").write_text(f"wavelength_nm,power\n400,1\n500,{row[-1]}\n700,1\n")
        (folder / f"response_{name}.csv").write_text(f"wavelength_nm,response\n400,1\n500,{row[-1]}\n700,1\n")
        (folder / f"water_{name}.csv").write_text(
            f"wavelength_nm,absorption_per_m,scattering_per_m\n400,0.1,0.1\n550,0.{row[-1]},0.{row[-1]}\n700,0.1,0.1\n"
        )
    everything = Scene.from_dict(
        {
            "lamp": {
                "profile": "two-component", "skirt_fraction": 0.1, "ellipticity": 1.2, "tilt_x_deg": 1.0,
                "asymmetry_x": 0.1,
                "shape_exponent": 2.5, "apparent_distance_m": 0.3, "drift_per_hour": 0.1,
                "radius_m": 0.05, "warmup_fraction": 0.1, "window_index": 1.3,
            },
            "water": {
                "base": "pure", "absorption_per_m": 0.05, "scattering_per_m": 0.1,
                "chlorophyll_mg_per_m3": 0.5,
                "cdom_440_per_m": 0.1, "sediment_g_per_m3": 0.2, "absorption_at": [[480, 0.1], [580, 0.2]],
                "gradient_per_m2": 0.01, "layer_absorption_per_m": 0.1, "hardening_per_m": 0.02,
                "height_gradient_per_m2": 0.01, "bottom_layer_absorption_per_m": 0.05,
                "drift_per_m_per_hour": 0.01, "settling_per_m": 0.1,
            },
            "tank": {"wall_albedo": 0.2, "surface": "flat", "surface_reflectance": 0.5, "lamp_depth_m": 1.0,
                     "panes": "all", "pane_reflectance": 0.5},
            "detector": {
                "width_m": 1.0, "height_m": 0.8, "acceptance_hwhm_deg": 20.0, "saturation": 0.1,
                "background": 0.1, "cosine_error": 0.1, "tilt_x_deg": 2.0, "background_step": 0.05,
                "background_step_s": 800.0, "background_step_for_s": 600.0, "background_step_over_s": 300.0,
            },
        }
    )  # fmt: skip
    other = everything.with_values(
        {
            "lamp.profile": "table", "lamp.intensity_table": str(folder / "beam_one.csv"),
            "lamp.spectrum": "table", "lamp.spectrum_table": str(folder / "light_one.csv"),
            "detector.response": "table", "detector.response_table": str(folder / "response_one.csv"),
            "water.base": "table", "water.table": str(folder / "water_one.csv"),
            "detector.quantity": "radiance", "detector.acceptance_hwhm_deg": 0.0,
            "detector.cosine_error": 0.0, "detector.full_angle_deg": 30.0, "detector.saturation": 0.0,
            "detector.saturation_quadratic": 0.1,
        }
    )  # fmt: skip
    linear = everything.with_values({"detector.saturation": 0.0})
    return [everything, other, linear]
