"""A page to mail: opened from a file, it evaluates by itself what Python evaluates, within a thousandth.

In a tank whose water scatters, whose walls reflect and whose surface mirrors, from a trace of few photons:
noise is the same on both sides.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from perturbed import FIELDS, changed

from lightfield.arrays import Array, jsonable
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.errors import LightfieldError
from lightfield.explorer.experiment import Experiment
from lightfield.explorer.saved.moving_light import (
    ABSORPTION,
    ALBEDO,
    BACKGROUND,
    SCATTERING,
    moving_light,
    ranges_at_stop,
    why_fixed,
)
from lightfield.explorer.saved.packed_arrays import PackedArrays
from lightfield.explorer.saved.page import PAGE, page_html, some_places
from lightfield.explorer.session import Session
from lightfield.fitting.forward import SceneForward
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.render.diffuse.directed import Keeper
from lightfield.render.diffuse.source import response_for
from lightfield.scene import Scene

AFRESH = Keeper(cache=False)
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
SCENE = Scene.from_dict(
    {
        "name": "</script><script>alert(1)</script>",
        "lamp": {"hwhm_deg": 6.0},
        "water": {"absorption_per_m": 0.08, "scattering_per_m": 0.12},
        "tank": {"width_m": 3.0, "depth_m": 2.0, "length_m": 9.0, "wall_albedo": 0.2, "surface": "flat"},
        "detector": {"planes_m": [3.0, 4.5], "width_m": 1.6},
    }
)
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here: apt-get install chromium")
#: Across the beam, in m.
X = (-0.6, -0.3, -0.1, 0.0, 0.2, 0.4)
#: Asked of the kernel: Python's single precision and the 16 bits in which a page keeps its response.
PART = 1e-3
#: Light below this part of the brightest is compared with that part: it is what a page shows as black.
DARK = 1e-3
MOVES: list[dict[str, float]] = [
    {},
    {"water.absorption_per_m": 0.2},
    {"water.scattering_per_m": 0.28, "water.absorption_per_m": 0.02},
    {"water.scattering_per_m": 0.0},
    {"tank.wall_albedo": 0.6, "water.scattering_per_m": 0.2},
    {"tank.wall_albedo": 0.0, "gain": 2.0},
]


@pytest.fixture(scope="module")
def session() -> Session:
    session = Session(SCENE, diffuse=partial(response_for, photons=20_000, keeper=AFRESH))
    session.begin()
    return session


@pytest.fixture(scope="module")
def html(session: Session) -> str:
    return page_html(session)


def test_a_page_is_whole_and_asks_for_nothing(html: str) -> None:
    assert "http://" not in html.replace("http://www.w3.org/2000/svg", "") and "https://" not in html
    assert 'src="' not in html and "default-src 'none'" in html
    assert html.count("<script") == 2 and "alert(1)</script>" not in html


def evaluated(html: str, moves: list[dict[str, float]], folder: Path, channel: int = 0) -> list[Any]:
    """Error, readings and maps that the page itself finds after some moves from where it was saved."""
    from playwright.sync_api import sync_playwright

    file = folder / "page.html"
    file.write_text(html, encoding="utf-8")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": 1300, "height": 800})
        problems: list[str] = []
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on("console", lambda said: problems.append(said.text) if said.type == "error" else None)
        page.goto(file.as_uri())
        page.locator("html[data-painted]").wait_for()
        found = page.evaluate(
            """([moves, channel]) => moves.map((move) => {
                LF.ask({ do: "rung", at: LF.state.here });
                LF.ask({ do: "view", plane: 0, channel });
                for (const [path, value] of Object.entries(move)) {
                    LF.ask({ do: "set", values: { [path]: value }, done: true });
                }
                const [head, arrays] = LF.evaluateSaved();
                return [head.error_percent, Array.from(arrays.model), Array.from(LF.allMaps)];
            })""",
            [moves, channel],
        )
        page.get_by_role("slider", name=re.compile("scattering|absorption")).first.press("PageUp")
        page.get_by_role("button", name="Undo").click()
        assert page.title().startswith(SCENE.name)
        assert not page.locator("#why-fixed").is_visible()
        browser.close()
    assert not problems, problems
    return list(found)


def check(got: Sequence[float], wanted: Array, move: object) -> None:
    off = np.abs(np.array(got) - wanted) / np.maximum(wanted, DARK * wanted.max())
    assert off.max() < PART, (move, off.max())


@needs_browser
def test_the_kernel_is_python_within_a_thousandth(session: Session, html: str, tmp_path: Path) -> None:
    some, values = some_places(session.experiment), session.evaluator.values(session.now)
    moves = [{path: v * values["gain"] if path == "gain" else v for path, v in m.items()} for m in MOVES]
    for move, (error, model, maps) in zip(moves, evaluated(html, moves, tmp_path), strict=True):
        now = values | move
        expected = session.experiment.forward.predict(now)
        assert error == pytest.approx(session.fits.score(expected, 0).error_percent, rel=PART, abs=0.05)
        check(model, expected, move)
        check(maps, some.predict(now), move)


@needs_browser
@pytest.mark.slow  # twelve seconds of one processor, most of them for judging the noise of made-up readings
def test_every_wavelength_moves_as_python_moves_it(tmp_path: Path) -> None:
    """Three wavelengths of one trace, each with a gain and an absorption of its own; the maps are of one."""
    z, wavelength, x = (
        v.ravel() for v in np.meshgrid([3.0, 3.7, 4.5], [480.0, 520.0, 560.0], X, indexing="ij")
    )
    direct = direct_field(SCENE, x, 0 * x, z)
    value = direct * np.exp(-(wavelength - 480) / 400 * z) * (wavelength / 480) / direct.max()
    readings = Readings.from_arrays(
        value=value, stderr=0.01 * value, x_m=x, y_m=0 * x, z_m=z, wavelength_nm=wavelength
    )
    bands = tuple((w - 10.0, w + 10.0) for w in (480.0, 520.0, 560.0))
    scene = SCENE.with_values({"detector.bands_nm": bands})
    session = Session(scene, readings, diffuse=partial(response_for, photons=20_000, keeper=AFRESH))
    session.begin()
    session.maps_ready = True
    values = session.evaluator.values(session.now)
    gain, absorption, scattering = "gain.520nm", "water.absorption_at.560nm", "water.scattering_per_m"
    assert {gain, absorption, scattering} <= values.keys()
    moves = [
        {},
        {gain: 1.5 * values[gain]},
        {absorption: values[absorption] + 0.05},
        {scattering: 1.5 * values[scattering], "tank.wall_albedo": 0.1, gain: 0.7 * values[gain]},
    ]
    html = page_html(session)
    for channel, own in ((1, gain), (2, "gain.560nm")):
        some, found = some_places(session.experiment, channel), evaluated(html, moves, tmp_path, channel)
        for move, (_, model, maps) in zip(moves, found, strict=True):
            now = values | move
            check(model, session.experiment.forward.predict(now), move)
            check(maps, some.predict(now | {"gain": now[own]}), move)


def test_what_cannot_move_shows_its_numbers(session: Session) -> None:
    """An instrument that saturates is not in proportion to the light: the page keeps to what Python found."""
    saturating = SCENE.with_values({"detector.saturation": 0.2, "water.scattering_per_m": 0.0, "tank": None})
    other = Session(saturating, diffuse=None)
    other.begin()
    text = page_html(other).partition('id="saved">')[2].partition("</script>")[0]
    stops = json.loads(text)["stops"]
    assert stops[-1]["effects"] == ["saturation:hyperbolic"]
    assert stops[-1]["why_fixed"] == "the instrument saturates"
    assert stops[-1]["moves"] == {} and "fixed" in stops[-1]["sets"]["readings"]
    assert "gain" in stops[0]["moves"]


#: In bands of three colours, which the lamp warms up to and the time goes by; walls, floor and surface.
EVERYTHING = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 20.0},
        "water": {
            "absorption_per_m": 0.08,
            "scattering_per_m": 0.2,
            "absorption_at": [[480, 0.05], [560, 0.1]],
        },
        "tank": {"width_m": 2.0, "depth_m": 1.5, "length_m": 12.0, "wall_albedo": 0.3, "surface": "flat"},
        "detector": {
            "planes_m": [3.0, 4.5],
            "width_m": 1.2,
            "bands_nm": [[470, 490], [510, 530], [550, 570]],
        },
    }
)
#: What moves in a page, and by how much; a gain besides.
STEPS = {ABSORPTION: 0.03, SCATTERING: 0.1, ALBEDO: 0.2, BACKGROUND: 0.01}


@needs_browser
@pytest.mark.slow  # a trace for every field that photons know
def test_what_a_page_moves_is_python_whatever_the_scene_states(tmp_path: Path) -> None:
    """Every field of a scene in turn: its light, and the formula, move as Python's do, by more scattering and
    by all that moves in a page, or are said not to move."""
    z, wavelength, x = (
        v.ravel() for v in np.meshgrid([3.0, 4.5], [480.0, 520.0, 560.0], [-0.5, 0.0, 0.3], indexing="ij")
    )
    table = Readings.from_arrays(
        value=np.exp(-0.3 * z) * (1 + (wavelength - 480) / 100),
        stderr=np.full(len(z), 1e-3), x_m=x, y_m=0.2 * z - 0.8, z_m=z, wavelength_nm=wavelength,
        time_s=100.0 * (x + z),
    )  # fmt: skip
    sets: list[Any] = []
    arrays, expected, fixed = PackedArrays(), {}, {}
    for path in FIELDS:
        scene = changed(EVERYTHING, path)
        if path == "detector.acceptance_hwhm_deg":  # a fifth of a degree sees next to nothing
            scene = scene.with_values({path: 40.0})
        forward = SceneForward(scene, table, partial(response_for, photons=20_000, keeper=AFRESH), full=1.0)
        own = cast(Experiment, SimpleNamespace(layout=layout_of(table)))
        gain, values = forward.gains.names[0], dict.fromkeys(forward.gains.names, 1.0)
        values |= {p: float(scene.get(p)) for p in STEPS if scene.tank is not None or p != ALBEDO}
        fixed[path] = why_fixed(own, scene)
        if fixed[path] is None:
            moves = ranges_at_stop(values)
            try:
                found = moving_light(forward, values, forward.gains.names, moves, arrays)
            except LightfieldError as error:
                fixed[path] = str(error)
                continue
            steps = {p: step for p, step in STEPS.items() if p in values} | {gain: 0.3}
            for some in ((), (SCATTERING,), tuple(steps)):
                by = {p: steps[p] for p in some}
                now = {p: v + by.get(p, 0.0) for p, v in values.items()}
                moved = {"by": by, "ratio": {gain: now[gain]}, "background": by.get(BACKGROUND, 0.0)}
                sets.append([found, moved | {"albedo": now.get(ALBEDO)}])
                light = forward.light.direct(forward.light.scenes.at(now, validate=False), table)
                expected[path, some] = forward.predict(now), forward.reader.read(light, now)
    got = in_the_kernel(jsonable(sets), arrays, tmp_path)
    for (what, both), found in zip(expected.items(), got, strict=True):
        for wanted, light in zip(both, found, strict=True):
            check(light, wanted, what)
    assert fixed["detector.stray_light"] and fixed["tank.floor_over_walls"]
    assert sum(why is None for why in fixed.values()) > len(FIELDS) / 2


@needs_browser
def test_a_track_moves_as_python_moves_it(tmp_path: Path) -> None:
    """Readings between planes, walls and layers: the kernel interpolates as Python does."""
    turn = np.linspace(0, 9, 70)
    x, y, z = 0.4 * np.sin(turn), 0.3 * np.cos(turn), np.linspace(3.0, 4.5, 70)
    table = Readings.from_arrays(value=np.exp(-0.3 * z), stderr=0.01 * np.exp(-0.3 * z), x_m=x, y_m=y, z_m=z)
    scene = SCENE.with_values({"water.gradient_per_m2": 0.01, "tank.wall_albedo": 0.3})
    forward = SceneForward(scene, table, partial(response_for, photons=20_000, keeper=AFRESH), full=1.0)
    values = {forward.gains.names[0]: 1.0} | {
        p: float(scene.get(p)) for p in (ABSORPTION, SCATTERING, ALBEDO)
    }
    arrays = PackedArrays()
    found = moving_light(forward, values, forward.gains.names, ranges_at_stop(values), arrays)
    assert found["diffuse"]["weight"] is not None
    moved = {"by": {SCATTERING: 0.1}, "ratio": {}, "background": 0.0, "albedo": 0.2}
    (light, _), *_ = in_the_kernel(jsonable([[found, moved]]), arrays, tmp_path)
    now = values | {SCATTERING: values[SCATTERING] + 0.1, ALBEDO: 0.2}
    check(light, forward.predict(now), "track")


def in_the_kernel(sets: list[Any], arrays: PackedArrays, folder: Path) -> list[list[list[float]]]:
    """Readings and formula that the kernel of a page makes of sets of places, each moved by something."""
    from playwright.sync_api import sync_playwright

    file = folder / "kernel.html"
    file.write_text(f"<script>const LF = {{}};{(PAGE / 'kernel.js').read_text()}</script>", encoding="utf-8")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page()
        page.goto(file.as_uri())
        found = page.evaluate(
            """([text, sets]) => {
                const buffer = Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
                return sets.map(([set, moved]) => {
                    const { model, formula } = LF.kernel.evaluate(LF.kernel.unpack(buffer, set), moved);
                    return [Array.from(model), Array.from(formula)];
                });
            }""",
            [arrays.text, sets],
        )
        browser.close()
    return list(found)
