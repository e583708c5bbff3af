"""The explorer as people use it: in Chromium, over its server, with a scene and readings of their own.

One server and one browser serve the whole file, each test a page. The light is the closed form (nothing is
traced): a constant background is in the readings, and not in the scene.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.error import HTTPError

import analytic_readings
import pytest

from lightfield.explorer.documents import open_session
from lightfield.explorer.jobs import compared
from lightfield.readings import write_table
from lightfield.scene import Scene

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here: apt-get install chromium")
#: Milliseconds that a page is waited for: two very busy cores.
PATIENCE_MS = 240_000


@dataclass
class Served:
    """A running explorer."""

    process: subprocess.Popen[str]
    folder: Path
    address: str

    @property
    def port(self) -> str:
        found = re.search(r":(\d+)/", self.address)
        assert found
        return found[1]

    @property
    def root(self) -> str:
        return f"http://127.0.0.1:{self.port}/"


def start(folder: Path, *arguments: str) -> Served:
    process = subprocess.Popen(
        [sys.executable, "-m", "lightfield.cli", "explore", *arguments, "--no-browser"],
        cwd=folder,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])},
    )
    assert process.stdout is not None
    address = re.search(r"http\S+", process.stdout.readline())
    assert address, "the address is printed first"
    return Served(process, folder, address[0])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("explorer")
    readings, scene = analytic_readings.readings({"detector.background": 0.02}, seed=3)
    write_table(readings.subset(readings.z_m < 7), folder / "data.csv")
    other, _ = analytic_readings.readings({"lamp.tilt_x_deg": 0.8}, seed=4)
    write_table(other.subset(other.z_m < 7), folder / "other.csv")
    scene.save(folder / "scene.toml")
    return folder


@pytest.fixture(scope="module")
def served(folder: Path) -> Iterator[Served]:
    served = start(folder, "scene.toml", "data.csv", "--no-trace")
    yield served
    served.process.send_signal(signal.SIGINT)
    assert served.process.wait(60) == 0, "Ctrl-C ends it cleanly"


def answer(served: Served, path: str, **headers: str) -> int:
    try:
        with urllib.request.urlopen(urllib.request.Request(served.root + path, headers=headers)) as reply:
            return int(reply.status)
    except HTTPError as error:
        return int(error.code)


@pytest.mark.parametrize(
    "path", ["", "?token=wrong", "page/live.js", "save/session.json", "socket", "nothing"]
)
def test_nobody_gets_in_without_the_token(served: Served, path: str) -> None:
    assert answer(served, path) == 403


def test_another_name_for_this_machine_is_no_way_in(served: Served) -> None:
    """A page elsewhere whose name is made to lead here (DNS rebinding) has its own name as Host."""
    token = served.address.partition("?")[2]
    assert answer(served, f"?{token}", Host="evil.example") == 403
    assert answer(served, f"?{token}", Origin="http://evil.example") == 403


# -- in a browser ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def context(served: Served):
    if CHROMIUM is None:
        pytest.skip("no Chromium here: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        context = browser.new_context(viewport={"width": 1300, "height": 800}, accept_downloads=True)
        context.set_default_timeout(PATIENCE_MS)
        page = context.new_page()
        page.goto(served.address)
        assert page.url == served.root, "the token does not stay in the address"
        page.close()
        yield context
        browser.close()


@pytest.fixture
def page(context, served: Served):
    page = context.new_page()
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda said: problems.append(said.text) if said.type == "error" else None)
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(served.root)
    page.locator('html[data-maps="ready"]').wait_for()
    yield page
    page.close()
    assert not problems, problems
    assert all(url.startswith((served.root, "data:", "blob:")) for url in asked), (
        "nothing leaves this machine"
    )


def error(page) -> float:
    return float(page.locator("#error").inner_text().split()[0])


def until_error(page, high: float, low: float = 0.0) -> float:
    """The error once it lies between two values."""
    for _ in range(PATIENCE_MS // 100):
        if low <= error(page) < high:
            return error(page)
        page.wait_for_timeout(100)
    raise AssertionError(f"error {error(page)} %, not {low} to {high} %")


def rest(page) -> None:
    """Back to the first state."""
    page.locator("#history-menu > summary").click()
    page.locator("#history li button").first.click()
    page.keyboard.press("Escape")
    page.locator("#undo:disabled").wait_for()


@needs_browser
def test_an_effect_is_switched_on_and_the_error_falls(page) -> None:
    rest(page)
    before = error(page)
    page.get_by_role("checkbox", name="background", exact=True).check()
    after = until_error(page, 0.5 * before)
    page.locator("#ladder li[aria-current]", has_text=f"{after:.1f} %").wait_for()
    assert page.locator("#ladder li").count() == 2
    page.get_by_role("button", name="Undo").click()
    until_error(page, 1.01 * before, 0.99 * before)
    page.keyboard.press("Control+y")
    until_error(page, 0.5 * before)
    page.locator("#ladder button").first.click()
    until_error(page, 1.01 * before, 0.99 * before)


@needs_browser
def test_a_slider_is_dragged_by_mouse_and_by_keyboard(page) -> None:
    rest(page)
    before = error(page)
    slider = page.get_by_role("slider", name="absorption in 1/m")
    box = slider.bounding_box()
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + box["height"] / 2)
    page.mouse.down()
    for k in range(12):
        page.mouse.move(box["x"] + (0.2 + 0.06 * k) * box["width"], box["y"] + box["height"] / 2)
    page.mouse.up()
    dragged = until_error(page, 1e6, 1.2 * before)
    page.locator("#ladder li[aria-current]", has_text="by hand").wait_for()
    slider.focus()
    page.keyboard.press("PageUp")
    page.keyboard.press("PageUp")
    until_error(page, 1e6, 1.001 * dragged)
    page.get_by_role("button", name="Fit these").click()
    until_error(page, 1.01 * before)


@needs_browser
def test_a_page_that_is_loaded_again_is_where_it_was(page) -> None:
    rest(page)
    before = error(page)
    page.get_by_role("checkbox", name="background", exact=True).check()
    after = until_error(page, 0.5 * before)
    page.reload()
    page.locator('html[data-maps="ready"]').wait_for()
    assert error(page) == after
    assert page.get_by_role("checkbox", name="background", exact=True).is_checked()


@needs_browser
def test_a_lost_connection_comes_back_with_its_state(page) -> None:
    rest(page)
    page.get_by_role("checkbox", name="background", exact=True).check()
    after = until_error(page, 4)
    painted = int(page.locator("html").get_attribute("data-painted"))
    page.evaluate("() => window.dispatchEvent(new Event('online'))")  # as after a sleep: the line is dropped
    page.locator("#connection.lost").wait_for(state="detached")
    for _ in range(PATIENCE_MS // 100):
        if int(page.locator("html").get_attribute("data-painted")) > painted:
            break
        page.wait_for_timeout(100)
    assert error(page) == after


@needs_browser
def test_malformed_messages_get_one_error_and_the_session_lives_on(page, served: Served) -> None:
    """Sent by the page's own cookie, past the page's own code."""
    found = page.evaluate(
        """() => new Promise((done) => {
            const socket = new WebSocket(`ws://${location.host}/socket`), said = [];
            const set = '{"id": 2, "do": "set", "values": {"gain": 1e300}}';
            const bad = ['nonsense', '{"id": 1, "do": "launch"}', set];
            socket.onopen = () => bad.forEach((text) => socket.send(text));
            socket.onmessage = (event) => {
                if (typeof event.data !== 'string' || JSON.parse(event.data).type !== 'error') return;
                said.push(JSON.parse(event.data).message);
                if (said.length === bad.length) { socket.close(); done(said); }
            };
        })"""
    )
    assert len(found) == 3 and all(len(text.splitlines()) == 1 for text in found)
    rest(page)
    assert error(page) > 0


@needs_browser
def test_a_page_from_elsewhere_is_refused_although_the_browser_knows_the_cookie(
    context, served: Served
) -> None:
    page = context.new_page()
    page.route("http://evil.example/", lambda route: route.fulfill(body="<title>elsewhere</title>"))
    page.goto("http://evil.example/")
    outcome = page.evaluate(
        f"""() => new Promise((done) => {{
            const socket = new WebSocket("ws://127.0.0.1:{served.port}/socket");
            socket.onopen = () => done("open");
            socket.onerror = () => done("refused");
        }})"""
    )
    page.close()
    assert outcome == "refused"


@needs_browser
def test_what_is_saved_opens_again(page, folder: Path, tmp_path: Path) -> None:
    rest(page)
    page.get_by_role("checkbox", name="background", exact=True).check()
    until_error(page, 4)
    saved = {}
    for label, name in (("Scene", "scene.toml"), ("Readings", "residuals.csv"), ("Session", "session.json")):
        page.locator("#save-menu > summary").click()
        with page.expect_download() as download:
            page.get_by_role("link", name=label).first.click()
        page.keyboard.press("Escape")
        assert download.value.suggested_filename == name
        saved[name] = tmp_path / name
        download.value.save_as(saved[name])
    assert "background" in saved["scene.toml"].read_text()
    assert len(saved["residuals.csv"].read_text().splitlines()) == 64
    states = json.loads(saved["session.json"].read_text())
    assert states["states"][-1]["effects"] == ["background:constant"]
    again, history = open_session(saved["session.json"], diffuse=None)
    again.begin(history=history)
    assert again.now.effects == ("background:constant",)


@needs_browser
def test_a_diagnosis_runs_beside_the_page_and_its_explanation_is_accepted(page) -> None:
    rest(page)
    page.locator('html[data-maps="ready"]').wait_for()  # one job at a time
    before = error(page)
    # By the page itself: on a busy machine the diagnosis may be over before a click arrives from outside.
    page.evaluate(
        """() => {
            const [job, text, cancel] =
                ["job", "job-text", "cancel"].map((id) => document.getElementById(id));
            new MutationObserver((_, watch) => {
                if (job.hidden || cancel.hidden || !text.textContent.startsWith("diagnosis")) return;
                watch.disconnect();
                cancel.click();
                document.documentElement.dataset.cancelled = "yes";
            }).observe(job, { subtree: true, childList: true, attributes: true, characterData: true });
        }"""
    )
    page.get_by_role("button", name="Diagnose").click()
    page.locator("html[data-cancelled]").wait_for(state="attached")
    page.locator("#job").wait_for(state="hidden")
    assert not page.get_by_role("button", name="Accept: background").is_visible()
    page.get_by_role("button", name="Diagnose").click()
    page.get_by_role("button", name="Accept: background").click()
    until_error(page, 0.5 * before)
    assert "ackground" in page.locator("#verdict .headline").inner_text()
    page.locator("#save-menu > summary").click()
    with page.expect_download() as download:
        page.get_by_role("link", name="Report").click()
    assert "<svg" in Path(download.value.path()).read_text()


@needs_browser
def test_a_report_is_had_before_any_diagnosis(page) -> None:
    rest(page)
    page.get_by_role("checkbox", name="background", exact=True).check()
    page.locator("#ladder li").nth(1).wait_for()
    page.locator("#save-menu > summary").click()
    with page.expect_download() as download:
        page.get_by_role("button", name="Report of what is shown").click()
    text = Path(download.value.path()).read_text()
    assert download.value.suggested_filename == "comparison.html"
    assert "<svg" in text and "+ background: error" in text


@needs_browser
def test_all_is_done_by_keyboard(page) -> None:
    """No mouse: the first Tab enters the page, and every control is reached, named, and does its work."""
    rest(page)
    page.reload()
    page.locator('html[data-maps="ready"]').wait_for()
    before, seen = error(page), dict[str, str]()
    for _ in range(200):
        page.keyboard.press("Tab")
        hold, name = page.evaluate(
            """() => { const e = document.activeElement;
                return [e.dataset.hold || e.id || e.closest('[id]')?.id || e.tagName,
                    e.getAttribute('aria-label') || e.labels?.[0]?.textContent || e.textContent || '']; }"""
        )
        if hold == "BODY":
            break
        seen[hold] = name
    wanted = {"history-menu", "save-menu", "fit", "diagnose", "slider-gain", "effect-background", "planes",
              "map-render", "log", "profile-axis", "ladder", "residual-axis"}  # fmt: skip
    assert wanted <= seen.keys(), wanted - seen.keys()
    assert all(name.strip() for name in seen.values())

    page.get_by_role("checkbox", name="background", exact=True).focus()
    page.keyboard.press("Space")
    after = until_error(page, 0.5 * before)
    held = "() => document.activeElement.getAttribute('aria-label')"
    assert page.evaluate(held) == "background", "the focus stays where it was"
    page.locator("#ladder button").first.focus()
    page.keyboard.press("Enter")
    until_error(page, 1.01 * before, 0.99 * before)
    page.keyboard.press("Control+z")
    until_error(page, 1.01 * after)
    page.get_by_role("slider", name="half width in deg").focus()
    page.keyboard.press("PageUp")
    until_error(page, 1e6, 1.01 * after)
    page.locator("#map-render").focus()
    page.keyboard.press("ArrowRight")
    assert page.locator("#cursor").inner_text().startswith("x ")
    page.locator("#save-menu > summary").focus()
    page.keyboard.press("Enter")
    page.get_by_role("link", name="Scene (TOML)").wait_for()
    page.keyboard.press("Escape")
    assert not page.get_by_role("link", name="Scene (TOML)").is_visible()


@needs_browser
def test_roles_and_labels_say_what_is_where(page) -> None:
    for name in ("Model", "Light", "Error ladder"):
        assert page.get_by_role("region", name=name, exact=True).count() == 1
    slider = page.get_by_role("slider", name="half width in deg")
    assert re.match(r"[\d.]+ deg", slider.get_attribute("aria-valuetext"))
    assert re.match(r"[\d.]+ to [\d.]+ deg", slider.get_attribute("title"))
    assert page.get_by_role("status").first.is_visible()
    for name in ("Readings, model and formula along x", "on the axis", "Residuals in sigma over"):
        assert page.get_by_role("img", name=name).count() == 1


#: Contrast of every text that is seen against what lies behind it (WCAG 2.2, relative luminance).
CONTRAST = """() => {
    const rgb = (text) => text.match(/[\\d.]+/g).map(Number);
    const part = (v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
    const light = ([r, g, b]) => 0.2126 * part(r) + 0.7152 * part(g) + 0.0722 * part(b);
    const behind = (e) => {
        for (; e; e = e.parentElement) {
            const c = rgb(getComputedStyle(e).backgroundColor);
            if (c.length === 3 || c[3] > 0.5) return c;
        }
        return [255, 255, 255];
    };
    const poor = [];
    for (const e of document.querySelectorAll('body *')) {
        const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
        if (!own || !e.getClientRects().length || e.disabled || e.closest(':disabled')) continue;
        const style = getComputedStyle(e), ink = rgb(e instanceof SVGElement ? style.fill : style.color);
        const [a, b] = [light(ink), light(behind(e))].sort((x, y) => y - x);
        const large = parseFloat(style.fontSize) >= 24;
        if ((a + 0.05) / (b + 0.05) < (large ? 3 : 4.5)) poor.push(`${e.textContent.trim().slice(0, 40)}: ${((a + 0.05) / (b + 0.05)).toFixed(2)}`);
    }
    return [light(behind(document.body)), poor];
}"""  # noqa: E501


@needs_browser
def test_dark_and_light_can_both_be_read(page) -> None:
    page.get_by_role("checkbox", name="background", exact=True).check()
    page.locator("#ladder li").nth(1).wait_for()
    paper = {}
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        paper[scheme], poor = page.evaluate(CONTRAST)
        assert poor == [], scheme
    assert paper["light"] > 0.9 and paper["dark"] < 0.05


@needs_browser
def test_nothing_moves_for_whoever_asked_for_that(page) -> None:
    moving = """() => { LF.$('job').hidden = LF.$('job-moving').hidden = false;
        return document.getAnimations().length; }"""
    page.emulate_media(reduced_motion="no-preference")
    assert page.evaluate(moving) > 0
    page.emulate_media(reduced_motion="reduce")
    assert page.evaluate(moving) == 0


@needs_browser
def test_a_formula_of_ones_own_is_added(page) -> None:
    rest(page)
    page.locator("#own-details > summary").click()
    page.locator("#own-name").fill("step")
    page.get_by_role("textbox", name="Formula").fill("1 + step*(x > 0)")
    page.locator("#own-parameters").fill("step -0.5 0.5 0")
    page.get_by_role("button", name="Add", exact=True).click()
    page.get_by_role("checkbox", name="step", exact=True).wait_for()
    assert page.get_by_role("checkbox", name="step", exact=True).is_checked()


@needs_browser
def test_other_readings_are_opened_and_bad_ones_say_where(page, folder: Path) -> None:
    page.locator("#file").set_input_files(
        {"name": "bad.csv", "mimeType": "text/csv", "buffer": b"z_m,value\n4.5,1\n5.5,bright\n"}
    )
    page.locator("#message").wait_for()
    assert "line 3" in page.locator("#message").inner_text()
    page.locator("#file").set_input_files(folder / "other.csv")
    page.locator("#history li").nth(1).wait_for(state="detached")
    before = error(page)
    page.get_by_role("checkbox", name="beam tilt", exact=True).check()
    until_error(page, 0.5 * before)


def spectrum(level: float) -> bytes:
    """A file of SpectraSuite, in the encoding that it has: counts in 0.1 s over the scene's band."""
    rows = "".join(f"{w}\t{level:.3f}\n" for w in range(480, 571))
    head = "SpectraSuite Data File\nSpectrometers: Müller\nIntegration Time (usec): 100000 (X)\n"
    marks = ">>>>>Begin Processed Spectral Data<<<<<\n", ">>>>>End Processed Spectral Data<<<<<\n"
    return f"{head}{marks[0]}{rows}{marks[1]}".encode("latin-1")


@needs_browser
def test_spectrometer_files_are_opened_with_their_index(page) -> None:
    places = [(x, z) for z in (4.5, 5.5, 6.5) for x in (-0.2, 0.0, 0.2)]
    lines = [f"m{k}.txt,{x},{z},signal" for k, (x, z) in enumerate(places)]
    index = "\n".join(["file,x_m,z_m,role", *lines, "dark.txt,,,dark"])
    files = {f"m{k}.txt": spectrum(820.0 / (k + 1)) for k in range(9)} | {"dark.txt": spectrum(20.0)}
    given = {name: ("text/plain", content) for name, content in files.items()}
    given["index.csv"] = ("text/csv", index.encode())
    page.locator("#save-menu > summary").click()
    page.locator("#units").select_option("counts")
    page.locator("#file").set_input_files(
        [{"name": n, "mimeType": kind, "buffer": content} for n, (kind, content) in given.items()]
    )
    page.locator("#source", has_text="9 readings").wait_for()
    assert not page.locator("#message").is_visible()
    assert error(page) > 0


@needs_browser
def test_everything_fits_the_window_and_has_a_name(page) -> None:
    for width in (1300, 420):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("() => document.documentElement.scrollWidth <= window.innerWidth")
    nameless = page.evaluate(
        """() => [...document.querySelectorAll('input, select, textarea, button, canvas, a')].filter((e) =>
            e.offsetParent !== null && !e.getAttribute('aria-label') && !e.textContent.trim()
            && !(e.labels && e.labels.length && e.labels[0].textContent.trim())).map((e) => e.outerHTML)"""
    )
    assert nameless == []


@pytest.mark.slow  # six seconds of one processor: a render
def test_without_readings_the_report_holds_the_formula_against_a_render() -> None:
    water = {"absorption_per_m": 0.1, "scattering_per_m": 0.05}
    scene = Scene.from_dict({"water": water, "detector": {"planes_m": [4.5], "width_m": 1.0}})
    told: list[tuple[str, float | None]] = []
    html = compared(scene, lambda stage, part=None: told.append((stage, part)))
    assert "<svg" in html and "the formula against the render" in html
    parts = [part for _, part in told if part is not None]
    assert all(0 < part <= 1 for part in parts) and parts[-1] == 1
