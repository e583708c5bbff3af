"""A render that is stopped, politely or not, leaves no half-written file, and the next one works.

Rationale: traces run for minutes; people press Ctrl-C, queues kill. Set-up: real `lightfield render`
processes, stopped in the middle of the trace and in the middle of writing a result or a cache entry.
Expected: no file under a final name that is not complete; after Ctrl-C nothing at all; the same command then
gives the full result; a damaged cache entry is rebuilt, and the result does not depend on it.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lightfield import cli
from lightfield.maps.dataset import read_netcdf
from lightfield.render.backend import use_backend
from lightfield.render.maps import render_scene
from lightfield.scene import Scene

SCENE = """
[water]
absorption_per_m = 0.1
scattering_per_m = 0.1
[tank]
wall_albedo = 0.2
[detector]
planes_m = [2.0, 3.0]
width_m = 1.0
pixels = 9
"""
BUDGET = ("--max-photons", "3e4", "--rel-error", "0.5", "--no-figures")
RESULTS = ["irradiance_z2.000m.exr", "irradiance_z3.000m.exr", "maps.nc"]
MAIN = "\nimport sys; from lightfield.cli import main; sys.exit(main(sys.argv[1:]))"

# Says when the first photons are counted, and then traces on for ever.
IN_TRACE = """
from contextlib import contextmanager
from lightfield.commands.shared import tracing
from lightfield.progress import heard_by
@contextmanager
def bar(name):
    with heard_by(lambda words, part: print("now", flush=True)):
        yield
tracing.progress_of = bar
"""

# Stops in the middle of writing a file: half of its bytes are on the disk.
IN_WRITE = """
import os, time
import lightfield.storage.files as files
from contextlib import contextmanager
whole = files.atomic_path
@contextmanager
def half(path):
    with whole(path) as temporary:
        yield temporary
        if str(path).endswith({suffix!r}):
            size = os.path.getsize(temporary)
            os.truncate(temporary, size // 2)
            print("now", flush=True)
            time.sleep(60)
files.atomic_path = half
"""

STAGES = {
    "trace": (IN_TRACE, ("--max-photons", "1e12", "--rel-error", "1e-5")),
    "result": (IN_WRITE.format(suffix=".nc"), BUDGET),
    "image": (IN_WRITE.format(suffix=".exr"), BUDGET),
    "cache": (IN_WRITE.format(suffix=".npz"), BUDGET),
}


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "scene.toml").write_text(SCENE)
    # The kernels compiled for other tests are good for these too.
    (tmp_path / "cache").mkdir()
    kernels = Path(os.environ["LIGHTFIELD_CACHE"]) / "kernels"
    kernels.mkdir(exist_ok=True)
    (tmp_path / "cache" / "kernels").symlink_to(kernels)
    monkeypatch.setenv("LIGHTFIELD_CACHE", str(tmp_path / "cache"))
    return tmp_path


def files_in(folder: Path) -> list[str]:
    """Every file, hidden ones and those in folders too."""
    return sorted(str(file.relative_to(folder)) for file in folder.rglob("*") if file.is_file())


def entries(place: Path) -> list[Path]:
    return sorted((place / "cache" / "transport").glob("*.npz"))


def interrupt(place: Path, stage: str, number: signal.Signals) -> tuple[int, str]:
    before, options = STAGES[stage]
    words = [sys.executable, "-c", before + MAIN, "render", "scene.toml", "-o", "out", *options]
    child = subprocess.Popen(words, cwd=place, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert child.stdout is not None and child.stdout.readline() == "now\n", child.communicate()[1]
        child.send_signal(number)
        _, message = child.communicate(timeout=60)
    finally:
        child.kill()
    return child.returncode, message


def render(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)
    assert cli.main(["render", "scene.toml", "-o", "out", *BUDGET]) == 0


#: Of every stage one way to be stopped; the others are in the slow tier.
QUICK = {
    ("trace", signal.SIGINT),
    ("result", signal.SIGKILL),
    ("cache", signal.SIGKILL),
    ("image", signal.SIGINT),
}


@pytest.mark.parametrize(
    ("stage", "number"),
    [
        pytest.param(
            stage, n, id=f"{stage}-{n.name}", marks=[] if (stage, n) in QUICK else [pytest.mark.slow]
        )
        for stage in STAGES
        for n in (signal.SIGINT, signal.SIGKILL)
    ],
)
def test_nothing_half_written_is_left_and_the_next_run_works(place, monkeypatch, capsys, stage, number):
    code, message = interrupt(place, stage, number)
    if number == signal.SIGKILL:
        assert code == -signal.SIGKILL
    else:
        assert code == 130, message
        assert len(message.splitlines()) == 1 and "Traceback" not in message
        assert not [name for name in files_in(place / "out") if name.startswith(".") or "/" in name]
    # What stands under a final name is complete: it opens, and every pixel has its value and error.
    for name in (file.name for file in (place / "out").glob("*") if file.is_file()):
        assert name == "maps.nc" and stage == "image", f"{name} was written before the render was done"
        complete(place / "out")
    assert stage in ("result", "image") or not entries(place)
    render(place, monkeypatch)
    assert files_in(place / "out") == RESULTS, "remains of the killed run are swept up"
    complete(place / "out")
    assert len(entries(place)) == 1
    assert [path.name for path in (place / "cache" / "transport").iterdir()] == [entries(place)[0].name]


def complete(folder: Path) -> None:
    maps = read_netcdf(folder / "maps.nc")
    assert maps.irradiance.shape == (1, 2, 9, 9)
    assert np.isfinite(maps.irradiance).all() and (maps.irradiance > 0).all()
    assert np.isfinite(maps.irradiance_stderr).all()


def same(maps: xr.Dataset, others: xr.Dataset) -> None:
    """Equal but for the order in which threads add single-precision numbers (1.2e-7 each)."""
    np.testing.assert_allclose(maps.irradiance, others.irradiance, rtol=1e-5)
    # Errors are differences between batches, which cancel some digits.
    np.testing.assert_allclose(maps.irradiance_stderr, others.irradiance_stderr, rtol=1e-3)


def test_a_second_writer_is_left_alone(tmp_path):
    """Half-written files of a process that still lives are not leftovers."""
    from lightfield.storage.files import atomic_path, output_folder

    with atomic_path(tmp_path / "maps.nc") as temporary:
        temporary.write_text("half")
        output_folder(tmp_path)
        temporary.write_text("whole")
    assert (tmp_path / "maps.nc").read_text() == "whole"


def _truncated(content: bytes) -> bytes:
    return content[: len(content) // 2]


def _one_bit(content: bytes) -> bytes:
    # In the middle of the largest array, the tally.
    at = len(content) // 2
    return content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]


DAMAGE = {
    "empty": lambda content: b"",
    "truncated": _truncated,
    "one bit": _one_bit,
    "garbage": lambda content: b"\x93NUMPY" + bytes(2000),
    "zeros": lambda content: bytes(len(content)),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_cache_entry_is_rebuilt(place, monkeypatch, capsys, caplog, damage):
    render(place, monkeypatch)
    entry = entries(place)[0]
    good, first = entry.read_bytes(), read_netcdf(place / "out" / "maps.nc")
    entry.write_bytes(DAMAGE[damage](good))
    assert entry.read_bytes() != good
    render(place, monkeypatch)
    again = read_netcdf(place / "out" / "maps.nc")
    same(again, first)
    assert "damaged" in caplog.text and "rebuilt" in caplog.text
    assert entry.stat().st_size == len(good)
    caplog.clear()
    render(place, monkeypatch)
    assert not caplog.text, "the rebuilt entry is sound"


def test_an_entry_under_a_wrong_name_is_not_taken(place, monkeypatch, capsys):
    """A sound file of another scene is as wrong as a damaged one."""
    render(place, monkeypatch)
    entry = entries(place)[0]
    first = read_netcdf(place / "out" / "maps.nc")
    (place / "scene.toml").write_text(SCENE.replace("wall_albedo = 0.2", "wall_albedo = 0.7"))
    render(place, monkeypatch)
    other = next(path for path in entries(place) if path != entry)
    wrong = read_netcdf(place / "out" / "maps.nc")
    assert not np.array_equal(wrong.irradiance, first.irradiance)
    entry.write_bytes(other.read_bytes())
    (place / "scene.toml").write_text(SCENE)
    render(place, monkeypatch)
    same(read_netcdf(place / "out" / "maps.nc"), first)


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit])
def test_a_stop_while_the_walk_is_recorded_is_still_a_stop(monkeypatch, stop) -> None:
    """Dr.Jit reports whatever ends its loop as a RuntimeError, even Ctrl-C."""
    use_backend()
    from lightfield.render.tracer.planes import Planes

    def stopped(*_: object) -> None:
        raise stop

    monkeypatch.setattr(Planes, "reading", stopped)
    with pytest.raises(stop):
        render_scene(Scene.from_toml(SCENE), max_photons=3e4, cache=False)


LATE = """
import sys, time
from lightfield import cli
class Slow:
    def __del__(self):
        time.sleep(0.3)
kept, run = Slow(), cli._run
def stopped_at_the_end(argv):
    code = run(argv)
    cli._again_soon(2)
    return code
cli._run = stopped_at_the_end
sys.exit(cli.main())
"""


def test_a_stop_that_was_put_off_does_not_kill_a_program_that_has_done(tmp_path):
    """Python forgets who answers to an alarm before it has taken itself apart."""
    (tmp_path / "scene.toml").write_text("[detector]\nplanes_m = [2.0]\n")
    words = [sys.executable, "-c", LATE, "scene", str(tmp_path / "scene.toml")]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode in (0, 130), done.returncode
    assert done.stderr in ("", "lightfield: interrupted\n")
