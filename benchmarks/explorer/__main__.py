"""From a slider to the painted frame, and memory over many slider moves, in Chromium.

Run from the root: `python -m benchmarks.explorer [--moves N] [--many N]`. The first run traces. A move sets a
slider and sends its event, as a hand does; it ends when the browser has drawn the frame after the answer was
painted. With `--minutes N` only memory is measured, for so long, at 200 moves a minute (`memory.md`). Nothing
is asserted.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Page, sync_playwright

from lightfield.storage.files import write_text

ROOT, HERE = Path(__file__).resolve().parents[2], Path(__file__).resolve().parent
CASES = {
    "story": ("scenes/hidden_effect/scene.toml", "scenes/hidden_effect/data.csv"),
    "tow tank": ("scenes/unh_tow_tank/scene.toml",),
}
SLIDERS = {"scattering": "water.scattering_per_m", "half width": "lamp.hwhm_deg"}
PATIENCE_MS = 600_000
MB = 1e6
#: Moves a minute of a patient hand.
PACE = 200

#: Moves a slider back and forth, one move in so many milliseconds at most; milliseconds of each move.
MOVE = """async ([path, moves, pace]) => {
    const slider = document.querySelector(`input[type=range][data-path="${path}"]`);
    const root = document.documentElement;
    const middle = Number(slider.value), times = [];
    const frame = () => new Promise(requestAnimationFrame);
    for (let k = 0; k < moves; k++) {
        const before = Number(root.dataset.painted), begun = performance.now();
        slider.value = String(Math.min(1, Math.max(0, middle + 0.1 * Math.sin(0.37 * (k + 1)))));
        slider.dispatchEvent(new Event("input"));
        while (Number(root.dataset.painted) === before) await frame();
        times.push(performance.now() - begun);
        const left = pace - times[k];
        if (left > 0) await new Promise((done) => setTimeout(done, left));
    }
    slider.value = String(middle);
    slider.dispatchEvent(new Event("input"));
    slider.dispatchEvent(new Event("change"));
    return times;
}"""


@contextmanager
def opened(case: str) -> Iterator[tuple[Page, int]]:
    """The page of a case with scattering on, and the server's process."""
    served = subprocess.Popen(
        [sys.executable, "-m", "lightfield.cli", "explore", *CASES[case], "--no-browser"],
        cwd=ROOT, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert served.stdout is not None
    address = re.search(r"http\S+", served.stdout.readline())
    assert address
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu"]
            )
            page = browser.new_page(viewport={"width": 1300, "height": 800})
            page.set_default_timeout(PATIENCE_MS)
            page.goto(address[0])
            page.locator('html[data-maps="ready"]').wait_for()
            box = page.get_by_role("checkbox", name="scattering", exact=True)
            if not box.is_checked():
                box.check()
            page.locator(f'input[data-path="{SLIDERS["scattering"]}"]').wait_for()
            page.wait_for_timeout(5000)
            yield page, served.pid
            browser.close()
    finally:
        served.send_signal(signal.SIGINT)
        served.wait(60)


def measured(case: str, moves: int, many: int) -> dict[str, Any]:
    """Times of moves of each slider, and memory before and after many of them."""
    with opened(case) as (page, pid):
        out: dict[str, Any] = {"sliders": {}}
        for name, path in SLIDERS.items():
            page.evaluate(MOVE, [path, 20, 0])
            out["sliders"][name] = times_of(page.evaluate(MOVE, [path, moves, 0]))
        memory = [memory_of(page, pid)]
        for _ in range(4):
            page.evaluate(MOVE, [SLIDERS["scattering"], many // 4, 0])
            memory.append(memory_of(page, pid))
        out["memory"] = memory
    return out


def minute_by_minute(case: str, minutes: int) -> list[tuple[float, float]]:
    """Memory at the beginning and after every minute of moves, scattering and half width in turn."""
    with opened(case) as (page, pid):
        memory = [memory_of(page, pid)]
        for minute in range(minutes):
            path = list(SLIDERS.values())[minute % 2]
            page.evaluate(MOVE, [path, PACE, 60_000 / PACE])
            memory.append(memory_of(page, pid))
            print(case, minute + 1, memory[-1], flush=True)
    return memory


def memory_text(results: dict[str, list[tuple[float, float]]], minutes: int) -> str:
    """The page of memory over minutes."""
    head = " | ".join(str(k) for k in range(minutes + 1))
    lines = [
        "# Memory over minutes of slider moves",
        "",
        f"Made by `python -m benchmarks.explorer --minutes {minutes}`; nothing is asserted. {PACE} moves a",
        "minute, of the scattering and of the half width in turn, with maps shown; MB at first and after",
        f"every minute. Two cores, load average {os.getloadavg()[0]:.0f} at the end.",
        "",
        f"| scene | what | {head} |",
        "|---|---|" + "---:|" * (minutes + 1),
    ]
    for case, memory in results.items():
        for k, what in enumerate(("server, resident", "page, live objects")):
            lines.append(f"| {case} | {what} | " + " | ".join(f"{m[k]:.1f}" for m in memory) + " |")
    return "\n".join(lines) + "\n"


def times_of(found: list[float]) -> dict[str, float]:
    """Median and tails, ms."""
    times = np.array(found)
    return {
        "median": float(np.median(times)),
        "95 %": float(np.quantile(times, 0.95)),
        "worst": float(times.max()),
    }


def memory_of(page: Any, pid: int) -> tuple[float, float]:
    """Resident memory of the server and live objects of the page, MB."""
    status = Path(f"/proc/{pid}/status").read_text()
    resident = re.search(r"VmRSS:\s+(\d+) kB", status)
    assert resident
    session = page.context.new_cdp_session(page)
    session.send("HeapProfiler.collectGarbage")
    heap = session.send("Runtime.getHeapUsage")["usedSize"]
    return int(resident[1]) * 1024 / MB, heap / MB


def as_text(results: dict[str, Any], moves: int, many: int) -> str:
    """The page of results."""
    lines = [
        "# From a slider to the painted frame",
        "",
        f"Made by `python -m benchmarks.explorer`; nothing is asserted. {moves} moves of a slider in",
        "headless Chromium, milliseconds from the slider's event to the frame after the answer was painted:",
        "readings, residuals, profile, axis and three maps of 41 x 41. A frame alone takes 17 ms. Goal: 100",
        f"ms at the 95 % point. Two cores, load average {os.getloadavg()[0]:.0f} at the end.",
        "",
        "| scene | slider | median | 95 % | worst |",
        "|---|---|---:|---:|---:|",
    ]
    for case, found in results.items():
        for slider, t in found["sliders"].items():
            lines.append(f"| {case} | {slider} | {t['median']:.0f} | {t['95 %']:.0f} | {t['worst']:.0f} |")
    lines += [
        "",
        f"Memory in MB at the beginning and after each quarter of {many} moves of the scattering:",
        "",
        "| scene | what | begin | 1/4 | 1/2 | 3/4 | end |",
        "|---|---|---:|---:|---:|---:|---:|",
    ]
    for case, found in results.items():
        for k, what in enumerate(("server, resident", "page, live objects")):
            lines.append(f"| {case} | {what} | " + " | ".join(f"{m[k]:.1f}" for m in found["memory"]) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, print, and keep the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--moves", type=int, default=200)
    parser.add_argument("--many", type=int, default=2000)
    parser.add_argument("--minutes", type=int, default=0)
    args = parser.parse_args()
    if args.minutes:
        found = {}
        for case in CASES:  # written after each: this takes long
            found[case] = minute_by_minute(case, args.minutes)
            write_text(HERE / "memory.md", memory_text(found, args.minutes))
        return
    results = {}
    for case in CASES:
        results[case] = measured(case, args.moves, args.many)
        print(case, json.dumps(results[case]), flush=True)
    write_text(HERE / "README.md", as_text(results, args.moves, args.many))


if __name__ == "__main__":
    main()
