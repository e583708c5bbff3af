"""One server and one browser for every file of tests, a page for each test."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import analytic_readings
import pytest
from explored import CHROMIUM, PATIENCE_MS, Served, start

from lightfield.readings import write_table


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
    with opened(context, served) as page:
        yield page


@pytest.fixture(scope="module")
def still(context, served: Served):
    """A page for tests that only look at it."""
    with opened(context, served) as page:
        yield page


@contextmanager
def opened(context, served: Served):
    """A page that has no trouble, and asks nobody else for anything."""
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
