"""A tank of one's own: the scene and the empty reading table that follow from answers to `questions`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import radians, tan
from pathlib import Path

import numpy as np
import tomli_w

from lightfield.arrays import Array
from lightfield.errors import OutputError, UsageError
from lightfield.experiments.layouts import SECONDS_PER_READING
from lightfield.experiments.questions import QUESTIONS, typed_number, typed_numbers
from lightfield.readings.checks import FARTHEST_M
from lightfield.scene import Scene
from lightfield.scene.bands import refuse_unlit
from lightfield.scene.spectral.peaks import LEDS, peaks_of
from lightfield.scene.tank import Tank, walls_m
from lightfield.scene.water.library import list_presets, preset_name
from lightfield.storage.files import write_text

SCENE, LAYOUT, READINGS = "scene.toml", "layout.csv", "readings.csv"
#: What lamps are called, and the spectrum that they have.
_NAMED = {"halogen": "planck", "white": "led-white", "warm-white": "led-warm-white"}
#: Planes that are proposed, and between which parts of the water before the lamp.
_PLANES, _FROM, _TO = 5, 0.25, 0.8
#: Distances that are proposed in open water, m.
_OPEN_M = (1.0, 2.0, 3.0, 4.0, 5.0)
#: From the wall, the part of the room that readings keep away.
_CLEAR = 0.9
#: Of so many readings on the first and the last plane two lie below and above the axis, and at most so many
#: such pairs. Chosen: the beam is told across first of all.
_POINTS_PER_PAIR, _PAIRS = 5, 2
#: Questions that only a tank has answers to.
OF_TANK = ("lamp_depth", "walls", "panes", "surface")
#: Seed of the order in which places are read: the same tank, the same table.
_ORDER = 0
#: The smallest size of any tank is less; the deepest pools are 10 to 25 m across.
_SMALLEST_M = 30.0
#: Behind the lamp there is so much water, or less in a short tank.
_BEHIND_M = 0.5

_TUBE = 'full_angle_deg = 2.0    # what the tube lets in; aim = "lamp" if it follows the lamp, not the axis'


@dataclass(frozen=True)
class NewTank:
    """What is written.

    Parameters
    ----------
    scene : Scene
        What the scene file says.
    scene_text : str
        The scene file, with comments.
    layout_text : str
        The places to read, for a plan.
    table_text : str
        The same places with empty cells for what is read.
    rows : int
        Readings to be taken.
    """

    scene: Scene
    scene_text: str
    layout_text: str
    table_text: str
    rows: int

    def save(self, folder: Path) -> dict[str, Path]:
        """Write all files, none over one that says something else.

        Returns
        -------
        dict of Path
            By name: `SCENE`, `LAYOUT`, `READINGS`.

        Raises
        ------
        OutputError
            One of them is there already and says something else.
        """
        texts = {SCENE: self.scene_text, LAYOUT: self.layout_text, READINGS: self.table_text}
        targets = {name: folder / name for name in texts}
        # What is there as it would be written, of a start that was cut short, is no loss.
        if there := [str(at) for name, at in targets.items() if not _says(at, texts[name])]:
            raise OutputError(
                "files of an experiment are here already",
                where=str(folder),
                found=", ".join(there),
                rule="nothing that was filled in is overwritten",
                remedy="choose another folder",
            )
        for name, text in texts.items():
            write_text(targets[name], text)
        return targets


def _says(path: Path, text: str) -> bool:
    """Would the file lose nothing, because it is not there or says just this?"""
    return not path.exists() or (path.is_file() and path.read_bytes() == text.encode())


def new_tank(answers: Mapping[str, str], name: str = "my tank") -> NewTank:
    """Scene and reading table from answers.

    Parameters
    ----------
    answers : mapping of str to str
        By the names of `QUESTIONS`; what is absent or empty takes its default.
    name : str
        Of the scene.

    Raises
    ------
    UsageError
        An answer that is not of its form.
    SceneError
        Answers that do not fit together, such as distances outside the tank, or a band without light.
    """
    given = {q.name: answers.get(q.name, "").strip() or q.default for q in QUESTIONS}
    if is_open(answers) and (said := [name for name in OF_TANK if answers.get(name, "").strip()]):
        raise UsageError(
            "open water has no walls, bottom or surface", where=", ".join(said),
            found="tank none", remedy="leave it out, or give the sizes of a tank, WxDxL",
        )  # fmt: skip
    tank = tank_lines(given)
    ahead = None
    if tank:
        near = ["[detector]", "planes_m = [1e-6]"]  # to see the tank by itself
        ahead = Scene.from_toml("\n".join([*tank, *near]), where="the new scene").tank
    planes = typed_numbers(given["planes"], "planes", ",") if given["planes"] else proposed_planes(ahead)
    if max(np.abs(planes)) > FARTHEST_M:
        raise UsageError(
            "farther than any lamp", where="planes", found=given["planes"],
            rule=f"in m, at most {FARTHEST_M:g}", remedy="millimetres over 1000, centimetres over 100",
        )  # fmt: skip
    points = int(typed_numbers(given["points"], "points", ",", whole=True)[0])
    if not 1 <= points <= 201:
        raise UsageError("impossible number of readings", where="points", found=points, rule="1 to 201")
    lines = [
        "# What is known about the experiment. Lengths in m from the lamp's window: x to the side, y up,",
        "# z along the beam. What is not said has a default.",
        tomli_w.dumps({"name": name}).rstrip(),
        "",
        "[lamp]",
        f"spectrum = {spectrum_toml(given['lamp'])}",
        f"hwhm_deg = {typed_number(given['beam'], 'beam')}    # half width at half maximum: "
        "a guess, it is fitted",
        f"power_w = {typed_number(given['power'], 'power')}    # counts for absolute readings alone",
        "# radius_m = 0.02    # of the window, where it is large",
        "",
        "[water]",
        *water_lines(given["water"]),
        'phase = { type = "henyey-greenstein", g = 0.924 }    # where scattered light goes: forward',
        "",
        *(tank or ["# No [tank]: open water, without walls or a surface."]),
        "",
        "[detector]",
        f'quantity = "{given["quantity"]}"    # irradiance: a flat collector; radiance: a narrow tube',
        *([_TUBE] if given["quantity"] == "radiance" else []),
        f"planes_m = [{', '.join(f'{z:g}' for z in planes)}]    # distances that are rendered",
        f"bands_nm = [{bands_toml(given)}]    # wavelengths that are seen",
        '# response = { peak_nm = 525, fwhm_nm = 10 }    # a filter; or "silicon", or a table',
        "",
    ]
    text = "\n".join(lines)
    scene = Scene.from_toml(text, where="the new scene")
    refuse_unlit(scene)
    places = _places(scene, planes, points)
    return NewTank(scene, text, table_text(scene, places), table_text(scene, places, blank=True), len(places))


def is_open(answers: Mapping[str, str]) -> bool:
    """Is it open water that they are about?"""
    return answers.get("tank", "").strip().lower() == "none"


def sizes_told(scene: Scene) -> str:
    """The tank in words, so that sizes in another order are seen before anything is measured."""
    tank = scene.tank
    if tank is None:
        return "open water, without walls or a surface"
    told = f"{tank.width_m:g} m wide, {tank.depth_m:g} m deep, {tank.length_m:g} m along the beam"
    if tank.length_m < max(tank.width_m, tank.depth_m):
        told += "; the beam goes across the tank: if it does not, begin anew with the length last, WxDxL"
    return told


def tank_lines(given: Mapping[str, str]) -> list[str]:
    """The scene's tank; nothing for open water."""
    if is_open(given):
        return []
    sizes = typed_numbers(given["tank"].lower(), "tank", "x")
    if len(sizes) != 3:
        raise UsageError(
            "not the sizes of a tank",
            where="tank",
            found=given["tank"],
            rule="WxDxL in m, such as 2x1x6, or none",
            remedy="write three sizes",
        )
    _refuse_other_units(sizes, given["tank"])
    if given["surface"].lower() not in ("yes", "no"):
        raise UsageError("neither yes nor no", where="surface", found=given["surface"], rule="yes or no")
    panes = given["panes"].lower()
    if panes not in ("no", "all", "sides"):
        raise UsageError("no such panes", where="panes", found=given["panes"], rule="no, all or sides")
    named = zip(("width_m", "depth_m", "length_m"), sizes, strict=True)
    top = "flat" if given["surface"].lower() == "yes" else "none"
    half = f"{sizes[1] / 2:g}"
    depth = (
        f"# lamp_depth_m = {half}    # from the surface down to the beam's axis: half the depth unless given"
    )
    if given["lamp_depth"]:
        depth = f"lamp_depth_m = {typed_number(given['lamp_depth'], 'lamp_depth')}"
    return [
        "[tank]",
        *(f"{name} = {value:g}" for name, value in named),
        depth,
        f"behind_lamp_m = {min(_BEHIND_M, 0.1 * sizes[2]):g}    # from the wall behind to the lamp's window",
        f"wall_albedo = {typed_number(given['walls'], 'walls')}    # what walls and floor reflect",
        "# floor_over_walls = 1.0    # the floor, in multiples of that; end_over_walls: the far end",
        '# panes = "all"    # sides, floor and ends of bare glass, with air behind; "sides": of a flume'
        if panes == "no"
        else f'panes = "{panes}"    # bare glass with air behind, a mirror; pane_reflectance = 0 if covered',
        f'surface = "{top}"    # flat: water against air; none: a lid like the walls',
    ]


def _refuse_other_units(sizes: Sequence[float], answer: str) -> None:
    """No tank is so large in all directions."""
    if min(sizes) >= _SMALLEST_M:
        units = ((1000, "millimetres"), (100, "centimetres"))
        told = " or ".join(
            f"{'x'.join(f'{v / n:g}' for v in sizes)} if these are {name}" for n, name in units
        )
        raise UsageError(
            "no tank is so large", where="tank", found=answer,
            rule=f"in m, and less than {_SMALLEST_M:g} in one direction at least",
            remedy=f"write {told}; none for open water",
        )  # fmt: skip


def spectrum_toml(answer: str) -> str:
    """The lamp's spectrum as TOML."""
    if "/" in answer:
        peaks = [one.partition("/")[::2] for one in answer.split("+")]
        said = [
            f"peak_nm = {typed_number(peak, 'lamp')}, fwhm_nm = {typed_number(width, 'lamp')}"
            for peak, width in peaks
        ]
        if len(said) == 1:
            return f"{{ {said[0]} }}"
        return f"[{', '.join(f'{{ {one}, height = 1.0 }}' for one in said)}]"
    answer = _NAMED.get(answer, answer)
    if answer not in (*LEDS, "planck", "cie-a"):
        raise UsageError(
            "not a spectrum", where="lamp", found=answer,
            rule=f"PEAK/WIDTH in nm, or one of halogen, {', '.join([*LEDS, 'planck', 'cie-a'])}",
        )  # fmt: skip
    return f'"{answer}"'


def water_lines(answer: str) -> list[str]:
    """The water as TOML."""
    answer = preset_name(answer)
    if answer in ("pure", *list_presets()):
        return [f'base = "{answer}"', "# absorption_per_m = 0.0    # beyond that; it is fitted"]
    values = answer.replace(",", " ").split()
    if len(values) != 2:
        raise UsageError(
            "not a water", where="water", found=answer,
            rule=f"A,B in 1/m, pure, or one of {', '.join(list_presets())}",
            remedy="give absorption and scattering, such as 0.1,0",
        )  # fmt: skip
    a, b = (typed_number(value, "water") for value in values)
    return [
        f"absorption_per_m = {a}    # a guess, it is fitted",
        f"scattering_per_m = {b}    # a diagnosis asks whether there is any",
    ]


def bands_toml(given: Mapping[str, str]) -> str:
    """The detector's bands as TOML: as answered, or all that an LED gives, a band about each of its peaks."""
    if given["band"]:
        bands = [typed_numbers(one, "band", ":") for one in given["band"].split(",")]
    elif _NAMED.get(given["lamp"], given["lamp"]) in LEDS or "/" in given["lamp"]:
        text = f"[lamp]\nspectrum = {spectrum_toml(given['lamp'])}"
        peaks = peaks_of(Scene.from_toml(text, where="lamp").lamp.spectrum) or ()
        bands = []
        for low, high in sorted((p.peak_nm - p.fwhm_nm, p.peak_nm + p.fwhm_nm) for p in peaks):
            if bands and low < bands[-1][1]:  # light of both is in one band
                bands[-1][1] = max(bands[-1][1], high)
            else:
                bands.append([low, high])
        bands = [[5.0 * round(end / 5.0) for end in band] for band in bands]
    else:
        bands = [[500.0, 550.0]]
    if any(len(band) != 2 for band in bands):
        raise UsageError(
            "not a band",
            where="band",
            found=given["band"],
            rule="LOW:HIGH in nm, or several: 430:470,500:560",
        )
    return ", ".join(f"[{low:g}, {high:g}]" for low, high in bands)


def proposed_planes(tank: Tank | None) -> list[float]:
    """Distances that fit the tank, m, to a tenth where it is long enough."""
    if tank is None:
        return list(_OPEN_M)
    end = tank.box_m[2][1]
    digits = 1 if end > 2 else 2 if end > 0.2 else 3
    return sorted({float(round(z, digits)) for z in np.linspace(_FROM * end, _TO * end, _PLANES)})


def _places(scene: Scene, planes: Sequence[float], points: int) -> Array:
    """Where to read, shape (n, 3), m: across the beam on every plane, not at the very wall, in random order.

    What drifts then looks like nothing that depends on the place. Before, between and after them the axis of
    the first plane, again and again: that tells the drift, and how well a place is found again.
    On the first and the last plane a few lie below and above the axis in place of some beside it: were all at
    one height, nothing could tell a beam that is no circle, or water in layers.
    """
    reach, digits = np.full(len(planes), _CLEAR * 0.5 * scene.plane_size_m[0]), 3
    if scene.detector.quantity == "radiance":  # a tube along the axis sees the lamp only from near it
        half = radians(0.5 * scene.detector.full_angle_deg)
        reach, digits = np.minimum(reach, _CLEAR * tan(half) * np.asarray(planes)), 4
    _, (low, high), _ = walls_m(scene.tank)
    places: list[tuple[float, float, float]] = []
    for k, (z, far) in enumerate(zip(planes, reach, strict=True)):
        pairs = min(points // _POINTS_PER_PAIR, _PAIRS) if k in (0, len(planes) - 1) else 0
        side = np.linspace(-1.0, 1.0, points - 2 * pairs) if points > 1 else np.zeros(1)
        part = np.arange(1, pairs + 1) / max(pairs, 1)
        above = np.concatenate([part * max(-far, _CLEAR * low), part * min(far, _CLEAR * high)])
        places += [(x, 0.0, z) for x in _written(far * side, digits)]
        places += [(0.0, y, z) for y in _written(above, digits)]
    again = (0.0, 0.0, planes[0])
    mixed = np.random.default_rng(_ORDER).permutation(places)
    rows = [[again, *mixed[first : first + points]] for first in range(0, len(mixed), points)]
    return np.array([*(place for some in rows for place in some), again])


def _written(metres: Array, digits: int) -> list[float]:
    """As a person writes them down; no minus before nothing."""
    return (np.round(metres, digits) + 0.0).tolist()


def table_text(scene: Scene, places: Array, *, blank: bool = False) -> str:
    """Places to read as a table; `blank`: with empty cells for what is read in each band, and how to fill
    them."""
    head = [
        f'# quantity = "{scene.detector.quantity}"',
        '# scale = "relative"    # or "absolute", with units',
    ]
    if blank:
        head += [
            "## What is known of the errors; take one # away and write yours. What is not said is assumed.",
            "## position_mm = 2.0    # how well the places are known",
            "## plane_gain_percent = 0.5    # how well a stay at a plane repeats",
            "## Fill in value (any unit), and stderr and time_s (seconds since the start) where known;",
            "## drop rows that were not read. One place comes again and again: it tells how steady all is.",
            "## The order is random: what drifts then looks like no distance. Where your stage is too slow,",
            "## go plane by plane, with that one place before, between and after them, and give time_s.",
        ]
    else:
        head.append(
            f"## time_s as if a reading took {SECONDS_PER_READING:g} s: what drifts can be planned for."
        )
    seen: Counter[tuple[float, ...]] = Counter()
    rows = []
    # A plan reads every band at every place of itself.
    colours = [f",{sum(band) / 2:g}" for band in scene.detector.bands_nm] if blank else []
    colours = colours if len(colours) > 1 else [""]
    for k, place in enumerate(places.tolist()):
        cells = ",,," if blank else f",{SECONDS_PER_READING * k:g}"
        where = f"water,{','.join(f'{v:g}' for v in place)},{seen[tuple(place)]}"
        rows += [f"{where}{colour}{cells}" for colour in colours]
        seen[tuple(place)] += 1
    names = "value,stderr,time_s" if blank else "time_s"
    names = f"wavelength_nm,{names}" if len(colours) > 1 else names
    return "\n".join([*head, f"medium,x_m,y_m,z_m,repeat,{names}", *rows]) + "\n"
