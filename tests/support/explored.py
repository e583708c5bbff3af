"""An explorer that runs, and what tests ask of its page."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import urllib.request
from dataclasses import dataclass
from pathlib import Path
from urllib.error import HTTPError

import pytest

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


def answer(served: Served, path: str, **headers: str) -> int:
    try:
        with urllib.request.urlopen(urllib.request.Request(served.root + path, headers=headers)) as reply:
            return int(reply.status)
    except HTTPError as error:
        return int(error.code)


def error(page) -> float:
    return float(page.locator("#error").inner_text().split()[0])


def until_error(page, high: float, low: float = 0.0) -> float:
    """The error once it lies between two values."""
    for _ in range(PATIENCE_MS // 20):
        if low <= error(page) < high:
            return error(page)
        page.wait_for_timeout(20)
    raise AssertionError(f"error {error(page)} %, not {low} to {high} %")


def rest(page) -> None:
    """Back to the first state."""
    page.locator("#history-menu > summary").click()
    page.locator("#history li button").first.click()
    page.keyboard.press("Escape")
    page.locator("#undo:disabled").wait_for()
