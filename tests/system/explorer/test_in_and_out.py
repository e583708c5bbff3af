"""What comes into the explorer and what leaves it: strangers, files, reports, diagnoses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from explored import Served, answer, error, needs_browser, rest, until_error

from lightfield.explorer.documents import open_session
from lightfield.explorer.jobs import compared
from lightfield.scene import Scene


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


@pytest.mark.slow
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


@pytest.mark.slow  # what is in it: `unit/explorer/test_session.py`
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


@pytest.mark.slow  # six seconds of one processor: a render
def test_without_readings_the_report_holds_the_formula_against_a_render() -> None:
    water = {"absorption_per_m": 0.1, "scattering_per_m": 0.05}
    scene = Scene.from_dict({"water": water, "detector": {"planes_m": [4.5], "width_m": 1.0}})
    told: list[tuple[str, float | None]] = []
    html = compared(scene, lambda stage, part=None: told.append((stage, part)))
    assert "<svg" in html and "the formula against the render" in html
    parts = [part for _, part in told if part is not None]
    assert all(0 < part <= 1 for part in parts) and parts[-1] == 1
