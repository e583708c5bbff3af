"""A scene as a plain Mitsuba dictionary and XML file, for people who render with Mitsuba itself."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import Any

from lightfield.formula.own_formulas import lit, on_path
from lightfield.render.backend import use_backend
from lightfield.render.response.grid import scene_grid
from lightfield.scene import Scene
from lightfield.scene.bands import BandLight, over_band
from lightfield.scene.lamp.colour import in_colour
from lightfield.scene.receiver import RECEIVER
from lightfield.scene.water.coefficients import absorption_per_m, molecular_per_m, scattering_per_m
from lightfield.scene.water.layers import is_layered
from lightfield.storage.files import atomic_path

_KINDS = {
    "lightfield_lamp": "Emitter",
    "lightfield_phase": "PhaseFunction",
    "detector_plane": "Sensor",
    "photon_tracer": "Integrator",
}


def mitsuba_dict(scene: Scene) -> dict[str, Any]:
    """Scene in its first band as a dictionary for `mi.load_dict`, with our plugins.

    The lamp's light is its mean over the band; water and beam are those at the centre of that light.
    """
    use_backend()
    from lightfield.render.plugins.lamp import CURVES, PROPERTIES
    from lightfield.render.tracer.build import phase_dict, shapes

    at, intensity = _first_band(scene)
    scene = in_colour(lit(scene), float(at[0]))
    a, b = float(absorption_per_m(scene.water, at)[0]), float(scattering_per_m(scene.water, at)[0])
    c = a + b
    grid = scene_grid(scene)
    medium = {
        "type": "homogeneous",
        "id": "water",
        "sigma_t": {"type": "uniform", "value": max(c, 1e-9)},
        "albedo": {"type": "uniform", "value": b / c if c else 0.0},
        "phase": phase_dict(scene, float(molecular_per_m(scene.water, at)[0]) / b if b else 0.0),
    }
    lamp: dict[str, Any] = {"type": "lightfield_lamp", "medium": {"type": "ref", "id": "water"}}
    lamp["intensity"] = float(intensity[0])
    given = {name: value for name in PROPERTIES if (value := getattr(scene.lamp, name)) not in (None, ())}
    lamp |= {name: json.dumps(v) if name in CURVES else v for name, v in given.items()}
    height = len(grid.y_m) * grid.pitch_y_m
    planes = {
        f"plane_{number}": {
            "type": "detector_plane",
            "z_m": float(z),
            "width_m": len(grid.x_m) * grid.pitch_x_m,
            "height_m": height,
            **{name: getattr(scene.detector, name) for name in RECEIVER},
            "film": {
                "type": "hdrfilm",
                "width": len(grid.x_m),
                "height": len(grid.y_m),
                "rfilter": {"type": "box"},
            },
        }
        for number, z in enumerate(grid.z_m)
    }
    return {
        "type": "scene",
        "integrator": {"type": "photon_tracer", "photons": 1_000_000},
        "water": medium,
        "lamp": lamp,
        **shapes(scene, scene.reflectances[0], scene.reflectances[1] if scene.surface_reflects else None),
        **planes,
    }


def left_out(scene: Scene) -> list[str]:
    """What a scene says and its XML does not hold, for people."""
    (low, high), *others = scene.detector.bands_nm
    band = f"it holds {low:g}-{high:g} nm, as at {_first_band(scene)[0][0]:.4g} nm, and no other band"
    told = [band] * bool(others)
    if scene.detector.positions_m is not None:
        told += ["it holds the planes of the positions that the detector lists, not the positions"]
    beside = [
        ("absorption that changes within the water", is_layered(scene.water)),
        ("effects of your own on the path", bool(on_path(scene))),
        ("the step from water to glass in panes, and walls behind them", scene.pane_reflectance > 0),
        ("the follower and its array", scene.array is not None or scene.follower is not None),
    ]
    return told + [f"without {what}" for what, there in beside if there]


def _first_band(scene: Scene) -> BandLight:
    """The lamp's light in the first band, where its power has its centre; shape (1,)."""
    return over_band(scene.lamp, *scene.detector.bands_read_nm[0], scene.detector, pieces=1)


def write_xml(scene: Scene, path: str | os.PathLike[str]) -> Path:
    """Write the scene as Mitsuba XML, what it leaves out in a comment; load it after `use_backend()`."""
    described = mitsuba_dict(scene)
    import mitsuba as mi

    target = Path(path)
    # Mitsuba writes helper folders beside its output: let it do so in a folder of its own.
    with tempfile.TemporaryDirectory() as folder, atomic_path(target) as temporary:
        state = mi.parser.parse_dict(mi.parser.ParserConfig(mi.variant()), described)
        for node in state.nodes:
            # Mitsuba does not know what kind of thing a plugin written in Python is.
            kind = _KINDS.get(node.props.plugin_name())
            if kind:
                node.type = getattr(mi.ObjectType, kind)
        inside = Path(folder) / "scene.xml"
        mi.parser.write_file(state, str(inside))
        comments = "".join(f"<!-- {line} -->\n" for line in left_out(scene))
        temporary.write_text(comments + inside.read_text(encoding="utf-8"), encoding="utf-8")
    return target
