"""A camera view of the lit tank with Mitsuba's own volumetric path tracer: people look first.

Not a measurement: three parts of the spectrum stand for red, green and blue, each at the wavelength where the
lamp's power in it has its centre; exposure is chosen for the eye, noise is smoothed, and where a scene has
nothing that a camera could see (black walls, clear water) a little of it is lent, and said so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import acos, atan, degrees, radians, tan
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from lightfield.arrays import Array
from lightfield.errors import RenderError
from lightfield.formula.own_formulas import lit
from lightfield.render.backend import use_backend
from lightfield.render.settings import PICTURE_PIXELS, PICTURE_SAMPLES
from lightfield.render.shown_as import Shown, ShownAs
from lightfield.render.tank_edges import edges_in_view
from lightfield.scene import Scene
from lightfield.scene.bands import over_band
from lightfield.scene.lamp.frame import angles_about_axis, beam_axes
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.lamp.profile import relative_intensity
from lightfield.scene.lamp.section import section_widths
from lightfield.scene.lamp.tabulated import FIRST_NM, LAST_NM
from lightfield.scene.lamp.width import stated_width_deg
from lightfield.scene.water.coefficients import absorption_per_m, known_nm, molecular_per_m, scattering_per_m
from lightfield.scene.water.layers import is_layered, layers_absorption_per_m

#: Red, green and blue, nm. Chosen: about where displays part them.
_RGB_BANDS_NM = ((580.0, 700.0), (500.0, 580.0), (400.0, 500.0))
_LENT_ALBEDO, _LENT_SCATTERING = 0.15, 0.02
#: A colour with less than this part of the brightest one's power is black in the picture: half a step of the
#: dark end of sRGB (slope 12.92 over 255 steps) beside white.
_UNSEEN = 0.5 / 255 / 12.92
#: Part of the whole spectrum's mean that the brightest colour has at least: a tail is no light. Chosen.
_LEAST_SEEN = 1e-6
_BEAM_PIXELS = 256
_MAX_DEPTH = 10
_MIDDLE, _BELOW = 0.25, 0.8
#: How far the brightest light goes from its colour to white (chosen).
_PALEST = 0.5
#: Grey of the tank's edges, sRGB, and how much of it is mixed in: light shows through it. Chosen.
_LINE, _MIXED = 190.0, 0.5
_SPARK, _SMOOTHING_PIXELS, _CALM = 5.0, (0.7, 1.2, 2.0, 3.0, 4.5), 0.06


@dataclass(frozen=True)
class Picture:
    """Camera view.

    Parameters
    ----------
    rgb : array, shape (height, width, 3)
        Linear light, relative: row 0 is the top, column 0 at the side of +x, for it looks along the beam.
    notes : tuple of ShownAs
        What was lent to the scene so that there is something to see, and what is not shown.
    wavelength_nm : array, shape (3,), nm
        That stand for red, green and blue.
    edges : array, shape (height, width), optional
        How much of a pixel is a line along the tank's edges, see `tank_edges`; they are no light.
    """

    rgb: np.ndarray
    notes: tuple[ShownAs, ...]
    wavelength_nm: np.ndarray
    edges: np.ndarray | None = None


def take_picture(
    scene: Scene,
    *,
    width: int,
    height: int,
    samples: int,
    seed: int = 0,
    lend: bool = True,
    progress: Callable[[str], None] | None = None,
) -> Picture:
    """Look along the tank from behind the lamp, above one side.

    Parameters
    ----------
    width, height : int
        Pixels.
    samples : int
        Paths per pixel and colour.
    lend : bool
        Give black walls and clear water a little albedo and scattering, for else there is nothing to see, and
        the tank's edges a line.
    progress : callable, optional
        Takes how far it is, in words.

    Raises
    ------
    RenderError
        Pixels or samples that no picture has; a lamp that gives no light that is seen.
    BackendError
        Nothing to render on.
    """
    for name, found, (low, high) in (
        ("width", width, PICTURE_PIXELS),
        ("height", height, PICTURE_PIXELS),
        ("samples", samples, PICTURE_SAMPLES),
    ):
        if not low <= found <= high:
            raise RenderError("impossible number", where=name, found=found, rule=f"{low} to {high}")
    use_backend()
    import mitsuba as mi

    albedo = scene.reflectances[0]
    rgb_nm, power = colours_of(scene.lamp)
    lit_colours = [k for k in range(3) if power[k] > _UNSEEN * power.max()]
    # A named water may be known for a part of the colours only.
    water_nm = np.clip(rgb_nm, *known_nm(scene.water))
    scattering = scattering_per_m(scene.water, water_nm)
    notes = [
        ShownAs(Shown.WAVELENGTH, round(float(rgb_nm[k]), 1), float(water_nm[k]))
        for k in lit_colours
        if rgb_nm[k] != water_nm[k]
    ]
    if is_layered(scene.water):
        notes.append(ShownAs(Shown.LAYERS, _change_per_m(scene), 0.0))
    if lend and scene.tank and albedo < _LENT_ALBEDO:
        notes.append(ShownAs(Shown.ALBEDO, float(albedo), _LENT_ALBEDO))
        albedo = _LENT_ALBEDO
    if lend and float(scattering.max()) < _LENT_SCATTERING:
        notes.append(ShownAs(Shown.SCATTERING, float(scattering.max()), _LENT_SCATTERING))
        scattering = np.full(3, _LENT_SCATTERING)
    absorption, molecular = absorption_per_m(scene.water, water_nm), molecular_per_m(scene.water, water_nm)
    planes = []
    for k in range(3):
        if k not in lit_colours:
            planes.append(np.zeros((height, width)))
            continue
        water = float(absorption[k]), float(scattering[k])
        molecules = float(molecular[k]) / water[1] if water[1] else 0.0
        described = picture_dict(scene, *water, albedo, width, height, molecules)
        loaded = mi.load_dict(described)
        # The same seed for all colours: what noise is left is grey, not speckled.
        halves = []
        for half in (0, 1):
            if progress is not None:
                done = 2 * lit_colours.index(k) + half
                progress(f"image {done + 1} of {2 * len(lit_colours)}")
            halves.append(np.array(mi.render(loaded, spp=max(1, samples // 2), seed=2 * seed + half))[..., 0])
        image = calm(*halves)
        planes.append(image * power[k] / power.max())
    edges = edges_in_view(scene.tank, *camera_pose(scene), (width, height)) if lend and scene.tank else None
    return Picture(np.stack(planes, axis=-1), tuple(notes), rgb_nm, edges)


def colours_of(lamp: Lamp) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths, nm, where the lamp's power in red, green and blue has its centres, and the mean of it over
    each, W/(sr nm); shape (3,).

    Raises
    ------
    RenderError
        None of it is visible.
    """
    parts = [over_band(lamp, low, high, pieces=1) for low, high in _RGB_BANDS_NM]
    rgb_nm, power = (np.concatenate(one) for one in zip(*parts, strict=True))
    everywhere = over_band(lamp, FIRST_NM, LAST_NM, pieces=1).intensity.item()
    if power.max() < _LEAST_SEEN * everywhere:
        raise RenderError(
            "the lamp gives no light that is seen", where="lamp.spectrum",
            rule=f"some between {_RGB_BANDS_NM[2][0]:g} and {_RGB_BANDS_NM[0][1]:g} nm",
            remedy="correct lamp.spectrum; maps show light of every wavelength",
        )  # fmt: skip
    return rgb_nm, power


def _change_per_m(scene: Scene) -> float:
    """By how much the absorption differs within the water in view, 1/m."""
    water, far = scene.water, float(max(scene.detector.planes_m, default=8.5))
    along = float(np.ptp(layers_absorption_per_m(water, np.linspace(0.0, far, 200))))
    height = scene.tank.depth_m if scene.tank else 2.0 * far * tan(radians(stated_width_deg(scene.lamp)))
    graded = abs(water.height_gradient_per_m2) * height
    return along + graded + abs(water.bottom_layer_absorption_per_m)


def picture_dict(
    scene: Scene,
    absorption: float,
    scattering: float,
    albedo: float,
    width: int,
    height: int,
    molecules: float = 0.0,
) -> dict[str, Any]:
    """Stock Mitsuba description of the tank, the lamp and a camera, at one wavelength."""
    import mitsuba as mi

    from lightfield.render.tracer.build import phase_dict, shapes

    attenuation = max(absorption + scattering, 1e-6)
    water = {
        "type": "homogeneous",
        "id": "water",
        "sigma_t": {"type": "uniform", "value": attenuation},
        "albedo": {"type": "uniform", "value": scattering / attenuation},
        "phase": phase_dict(scene, molecules),
    }
    inside = {"type": "ref", "id": "water"}
    box = shapes(scene, albedo, scene.reflectances[1] if scene.surface_reflects else None)
    for shape in box.values():
        if "dielectric" in shape["bsdf"]["type"]:
            shape["interior"] = inside
    eye, target, view_deg = camera_pose(scene)
    return {
        "type": "scene",
        "integrator": {"type": "volpath", "max_depth": _MAX_DEPTH, "rr_depth": 5},
        "water": water,
        **box,
        **_lamp(scene, mi),
        "sensor": {
            "type": "perspective",
            "fov": view_deg,
            "to_world": mi.ScalarTransform4f().look_at(origin=list(eye), target=list(target), up=[0, 1, 0]),
            "medium": inside,
            "film": {
                "type": "hdrfilm",
                "width": width,
                "height": height,
                "pixel_format": "luminance",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "independent"},
        },
    }


def camera_pose(scene: Scene) -> tuple[Array, Array, float]:
    """Eye, point looked at, horizontal angle of view: behind and above the lamp, which is in the picture."""
    far = float(max(scene.detector.planes_m, default=8.5))
    lamp = np.array([scene.lamp.offset_x_m, scene.lamp.offset_y_m, 0.0])
    if scene.tank is None:
        eye = lamp + far * np.array([-0.3, 0.22, -0.12])
    else:
        tank = scene.tank
        back = -min(0.9 * tank.behind_lamp_m, 0.6 * tank.width_m)
        eye = np.array([-0.44 * tank.width_m, 0.7 * tank.lamp_depth_m, back])
    to_lamp, to_end = lamp - eye, lamp + np.array([0, 0, far]) - eye
    to_lamp, to_end = to_lamp / np.linalg.norm(to_lamp), to_end / np.linalg.norm(to_end)
    between = degrees(acos(float(np.clip(to_lamp @ to_end, -1, 1))))
    return eye, eye + to_lamp + to_end, float(np.clip(between + 26, 40, 115))


def _lamp(scene: Scene, mi: Any) -> dict[str, Any]:
    """The beam as an image thrown by a projector, and a small dark housing behind it."""
    lamp = lit(scene).lamp
    skirt = lamp.skirt_hwhm_deg if lamp.skirt_fraction > 0 else 0.0
    half_deg = min(max(3.2 * stated_width_deg(lamp) * section_widths(lamp)[1], 2.5 * skirt, 4.0), 70.0)
    reach = tan(radians(half_deg))
    u = (np.arange(_BEAM_PIXELS) + 0.5) / _BEAM_PIXELS * 2 - 1
    # Row 0 of the projected image is up, column 0 is on the left of someone looking along the beam: +x.
    x, y = np.meshgrid(-u * reach, -u * reach)
    beam = relative_intensity(lamp, *angles_about_axis(x, y, 1.0)) * (1 + x * x + y * y) ** 1.5
    axis = beam_axes(lamp)[2]
    origin = [lamp.offset_x_m, lamp.offset_y_m, 0.0]
    pose = mi.ScalarTransform4f().look_at(
        origin=origin, target=[o + a for o, a in zip(origin, axis, strict=True)], up=[0, 1, 0]
    )
    dark = {
        "type": "twosided",
        "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.05}},
    }
    size = max(lamp.radius_m, 0.05)
    behind = [o - 1e-3 * a for o, a in zip(origin, axis, strict=True)]
    rear = [o - 0.25 * a for o, a in zip(origin, axis, strict=True)]
    return {
        "lamp": {
            "type": "projector",
            "to_world": pose,
            "fov": 2 * degrees(atan(reach)),
            "irradiance": {
                "type": "bitmap",
                "bitmap": mi.Bitmap(beam[..., None].astype(np.float32)),
                "raw": True,
                "wrap_mode": "clamp",
            },
        },
        "housing": {"type": "cylinder", "p0": rear, "p1": behind, "radius": size, "bsdf": dark},
    }


def calm(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Mean of two independent images, smoothed in every place only as much as its noise asks for.

    Parameters
    ----------
    first, second : arrays, shape (height, width)

    Returns
    -------
    array, shape (height, width)
        Gaussian means of the smallest width whose relative noise is below `_CALM`.
    """
    # One lucky path makes a spark; the other image does not have it.
    first, second = (
        np.minimum(one, _SPARK * gaussian_filter(other, 2.5, mode="nearest"))
        for one, other in ((first, second), (second, first))
    )
    mean, variance = 0.5 * (first + second), 0.25 * (first - second) ** 2
    result, undecided = mean.copy(), np.ones(mean.shape)
    for width in _SMOOTHING_PIXELS:
        smooth = gaussian_filter(mean, width, mode="nearest")
        # Variance of a Gaussian mean of independent pixels, itself smoothed over the neighbourhood.
        noise = np.sqrt(gaussian_filter(variance, max(width, 3.0), mode="nearest") / (4 * np.pi * width**2))
        result += undecided * (smooth - result)
        enough = np.clip(1.5 - 0.5 * noise / (_CALM * smooth + 1e-30), 0, 1)
        undecided = undecided * (1 - gaussian_filter(enough, 1.0, mode="nearest"))
    return result


def exposure(rgb: np.ndarray) -> float:
    """Factor that brings four fifths of the lit part of a picture below a quarter of white.

    White is reached by the brightest of the three colours, not by luminance, to which blue adds 7 %: the
    light of a blue lamp would be fourteen times beyond what a screen can show.
    """
    bright = rgb.max(axis=-1)
    lit_part = bright[bright > 0]
    return float(_MIDDLE / np.quantile(lit_part, _BELOW)) if lit_part.size else 1.0


def as_seen(taken: Picture) -> np.ndarray:
    """The view in sRGB bytes, shape (height, width, 3), the tank's edges drawn into it."""
    pixels = tone_mapped(taken.rgb)
    if taken.edges is None:
        return pixels
    line = _MIXED * taken.edges[..., None]
    return np.asarray(np.round(pixels + line * np.maximum(_LINE - pixels, 0.0)), np.uint8)


def tone_mapped(rgb: np.ndarray) -> np.ndarray:
    """Linear light to sRGB bytes: exposure from the brightness of the lit part, highlights rolled off.

    The brighter, the paler, as on film: else the light of a blue lamp, of which a screen shows little, has no
    shape.

    Parameters
    ----------
    rgb : array, shape (height, width, 3)

    Returns
    -------
    array of uint8, shape (height, width, 3)
    """
    exposed = rgb * exposure(rgb)
    bright = exposed.max(axis=-1, keepdims=True)
    rolled = exposed / (1 + bright) * (1 + bright / 25)
    pale = _PALEST * bright**2 / (1 + bright**2)
    linear = np.clip(rolled + pale * (rolled.max(axis=-1, keepdims=True) - rolled), 0, 1)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.asarray(np.round(255 * curve), np.uint8)
