"""Stock Mitsuba: `volpath` with an `irradiancemeter`, the wheel's fastest variant, no code of this package.

Run as a script in a process of its own; prints one line of JSON. The lamp is Mitsuba's `spot` with a Gaussian
texture. Each detector is one cell of the 65 x 65 map, rendered as 16 x 16 pixels: independent estimates of
one number.
"""

from __future__ import annotations

import argparse
import json
from typing import Any

from clock import Clock

PIXELS = 16
CUTOFF_DEG = 35.0  # the beam has 1e-25 of its intensity left there


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("case", help="JSON: variant, a, b, g, hwhm_deg, cell_m, detectors, spp, seeds")
    case = json.loads(parser.parse_args().case)
    import mitsuba as mi

    mi.set_variant(case["variant"])
    print(json.dumps([measure(mi, case, *place) for place in case["detectors"]]))


def measure(mi: Any, case: dict[str, Any], x: float, y: float, z: float) -> dict[str, float]:
    """Mean, its standard error, and the seconds that 2 % takes, at one detector."""
    import numpy as np

    scene = mi.load_dict(scene_of(mi, case, x, y, z))
    spp, seeds = case["spp"], case["seeds"]

    def render(seed: int) -> np.ndarray:
        return np.array(mi.render(scene, spp=spp, seed=seed))[..., 0].ravel()

    render(0)  # compiles
    clock = Clock()
    values = np.concatenate([render(seed) for seed in range(1, seeds + 1)]).astype(float)
    times = clock.read()
    mean, stderr = float(values.mean()), float(values.std(ddof=1) / len(values) ** 0.5)
    # Samples, and so seconds, that a relative error of 2 % takes.
    excess = (stderr / mean / 0.02) ** 2
    return {"x": x, "y": y, "z": z, "mean": mean, "stderr": stderr, "samples": seeds * spp * PIXELS**2,
            "wall_2_percent": times["wall"] * excess, "cpu_2_percent": times["cpu"] * excess}  # fmt: skip


def scene_of(mi: Any, case: dict[str, Any], x: float, y: float, z: float) -> dict[str, Any]:
    """Open water, a lamp at the origin along +z, one detector facing it."""
    import numpy as np

    a, b = case["a"], case["b"]
    water = {
        "type": "homogeneous",
        "id": "water",
        "sigma_t": {"type": "uniform", "value": a + b},
        "albedo": {"type": "uniform", "value": b / (a + b)},
        "phase": {"type": "hg", "g": case["g"]},
    }
    inside = {"type": "ref", "id": "water"}
    turn = mi.ScalarTransform4f
    axis = np.tan(np.radians(CUTOFF_DEG)) * (2 * (np.arange(1024) + 0.5) / 1024 - 1)
    theta = np.arctan(np.hypot(*np.meshgrid(axis, axis)))
    beam = np.exp(-np.log(2) * (theta / np.radians(case["hwhm_deg"])) ** 2).astype(np.float32)[..., None]
    texture = {"type": "bitmap", "bitmap": mi.Bitmap(np.ascontiguousarray(beam)), "raw": True}
    meter = {
        "type": "irradiancemeter",
        "medium": inside,
        "sampler": {"type": "independent"},
        "film": {
            "type": "hdrfilm",
            "width": PIXELS,
            "height": PIXELS,
            "rfilter": {"type": "box"},
            "component_format": "float32",
            "pixel_format": "luminance",
        },
    }
    pose = turn().look_at(origin=[x, y, z], target=[x, y, 0], up=[0, 1, 0]) @ turn().scale(
        0.5 * case["cell_m"]
    )
    return {
        "type": "scene",
        "integrator": {"type": "volpath", "max_depth": -1},
        "water": water,
        "lamp": {
            "type": "spot",
            "to_world": turn().look_at(origin=[0, 0, 0], target=[0, 0, 1], up=[0, 1, 0]),
            "intensity": 1.0,
            "cutoff_angle": CUTOFF_DEG,
            "beam_width": 0.999 * CUTOFF_DEG,
            "texture": texture,
            "medium": inside,
        },
        "plate": {"type": "rectangle", "to_world": pose, "bsdf": {"type": "null"}, "meter": meter},
        "far": {
            "type": "sphere",
            "radius": 80.0,
            "flip_normals": True,
            "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}},
        },
    }


if __name__ == "__main__":
    main()
