"""A page to mail: opened from a file, it evaluates by itself what Python evaluates, within a thousandth.

In a tank whose water scatters, whose walls reflect and whose surface mirrors, from a trace of few photons:
noise is the same on both sides.
"""

from __future__ import annotations

import json
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from lightfield.explorer.saved.page import page_html, some_places
from lightfield.explorer.session import Session
from lightfield.render.diffuse.source import response_for
from lightfield.scene import Scene

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
    session = Session(SCENE, diffuse=partial(response_for, photons=20_000, cache=False))
    session.begin()
    return session


@pytest.fixture(scope="module")
def html(session: Session) -> str:
    return page_html(session)


def test_a_page_is_whole_and_asks_for_nothing(html: str) -> None:
    assert "http://" not in html.replace("http://www.w3.org/2000/svg", "") and "https://" not in html
    assert 'src="' not in html and "default-src 'none'" in html
    assert html.count("<script") == 2 and "alert(1)</script>" not in html


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here: apt-get install chromium")
def test_the_kernel_is_python_within_a_thousandth(session: Session, html: str, tmp_path: Path) -> None:
    from playwright.sync_api import sync_playwright

    file, some = tmp_path / "page.html", some_places(session.experiment)
    file.write_text(html, encoding="utf-8")
    values = session.evaluator.values(session.now)
    moves = [{path: v * values["gain"] if path == "gain" else v for path, v in m.items()} for m in MOVES]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": 1300, "height": 800})
        problems: list[str] = []
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on("console", lambda said: problems.append(said.text) if said.type == "error" else None)
        page.goto(file.as_uri())
        page.locator("html[data-painted]").wait_for()
        found = page.evaluate(
            """(moves) => moves.map((move) => {
                LF.ask({ do: "rung", at: LF.state.here });
                for (const [path, value] of Object.entries(move)) {
                    LF.ask({ do: "set", values: { [path]: value }, done: true });
                }
                const [head, arrays] = LF.evaluateSaved();
                return [head.error_percent, Array.from(arrays.model), Array.from(LF.allMaps)];
            })""",
            moves,
        )
        page.get_by_role("slider", name="absorption in 1/m").press("PageUp")
        page.get_by_role("button", name="Undo").click()
        assert page.title().startswith("</script>")
        browser.close()
    assert not problems, problems
    for move, (error, model, maps) in zip(moves, found, strict=True):
        now = values | move
        expected = session.experiment.forward.predict(now)
        assert error == pytest.approx(session.fits.score(expected, 0).error_percent, rel=PART, abs=0.05)
        for got, wanted in ((model, expected), (maps, some.predict(now))):
            off = np.abs(np.array(got) - wanted) / np.maximum(wanted, DARK * wanted.max())
            assert off.max() < PART, (move, off.max())


def test_what_cannot_move_shows_its_numbers(session: Session) -> None:
    """An instrument that saturates is not in proportion to the light: the page keeps to what Python found."""
    saturating = SCENE.with_values({"detector.saturation": 0.2, "water.scattering_per_m": 0.0, "tank": None})
    other = Session(saturating, diffuse=None)
    other.begin()
    text = page_html(other).partition('id="saved">')[2].partition("</script>")[0]
    stops = json.loads(text)["stops"]
    assert stops[-1]["effects"] == ["saturation:hyperbolic"]
    assert stops[-1]["moves"] == {} and "fixed" in stops[-1]["sets"]["readings"]
    assert "gain" in stops[0]["moves"]
