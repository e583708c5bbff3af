"""Makes the pictures of the README and of docs/explorer.md from the example experiments.

python tools/pictures.py takes two minutes, and needs Chromium.
"""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

from lightfield.diagnosis.diagnose import diagnose
from lightfield.experiments.hide import Secret, hide
from lightfield.experiments.measure import Instrument
from lightfield.maps.dataset import to_dataset
from lightfield.render.maps import render_scene
from lightfield.report.compare.figures import maps_figure
from lightfield.report.diagnosis.ladder import ladder_figure
from lightfield.report.style import save_png
from lightfield.scene import Scene
from lightfield.studies.compare.maps import compare

ROOT = Path(__file__).resolve().parents[1]
DPI = 80  # small files
#: Pixels of the browser's window.
WINDOWS = {"explorer": (1300, 774), "explorer_narrow": (420, 900)}
PATIENCE_MS = 600_000
#: More than the fit of one effect takes.
FIT_MS = 20_000


def explorer() -> None:
    """Write assets/explorer.png and assets/explorer_narrow.png: the story with scattering switched on."""
    command = [sys.executable, "-m", "lightfield.cli", "explore", "scene.toml", "data.csv", "--no-browser"]
    served = subprocess.Popen(command, cwd=ROOT / "scenes/hidden_effect", stdout=subprocess.PIPE, text=True)
    assert served.stdout is not None
    address = re.search(r"http\S+", served.stdout.readline())
    assert address is not None
    try:
        with sync_playwright() as playwright:
            chromium = shutil.which("chromium")
            browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
            page = browser.new_page()
            page.set_default_timeout(PATIENCE_MS)
            page.goto(address[0])
            page.get_by_role("checkbox", name="scattering", exact=True).check()
            page.locator("#ladder li[aria-current]", has_text="scattering").wait_for()
            page.locator('html[data-maps="ready"]').wait_for()
            shown = ""  # until no effect's error is added any more
            while (now := page.locator("#off").inner_text()) != shown:
                shown = now
                page.wait_for_timeout(FIT_MS)
            for name, (width, height) in WINDOWS.items():
                page.set_viewport_size({"width": width, "height": height})
                page.get_by_role("heading", name="Model").scroll_into_view_if_needed()
                page.wait_for_timeout(1000)  # it draws anew
                page.screenshot(path=ROOT / f"assets/{name}.png")
            for rung in page.locator("#ladder li").all_inner_texts():
                print("explorer:", " ".join(rung.split()))
            browser.close()
    finally:
        served.send_signal(signal.SIGINT)
        served.wait(60)


def main() -> None:
    """Write the pictures, and print what stands in them."""
    tank = Scene.load(ROOT / "scenes/unh_tow_tank/scene.toml")
    comparison = compare(to_dataset(render_scene(tank, rel_error=0.05)))
    planes = comparison.planes[::2]
    save_png(maps_figure(planes, comparison.units, comparison.quantity), ROOT / "assets/compare.png", DPI)

    made = hide(tank, Secret(["background", "beam_tilt"]), 3, Instrument())
    found = diagnose(made.readings, made.believed).rendered()
    ladder = [rung.model_dump() for rung in found.verdict.ladder]
    save_png(ladder_figure(ladder, found.verdict.noise_floor_percent), ROOT / "assets/ladder.png", DPI)
    print(found.as_text())
    explorer()


if __name__ == "__main__":
    main()
