"""A store that was damaged never gives a wrong number in silence, and the same command makes it good.

Rationale: disks, copies and networks flip bits and lose files, and the zarr format has no check sum. Set-up:
one finished store of two beams and six waters; single random bits are flipped in every file that it has, and
files are cut or lost. Expected: what reads the store refuses it in one line, or reads the same numbers; the
sweep that continues it leaves the store as it was.
"""

from __future__ import annotations

import random
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from sweeping import BUDGET, differences

from lightfield.cli import main
from lightfield.errors import OutputError
from lightfield.render.response.response import Reference, TransportResponse
from lightfield.sweep import journal
from lightfield.sweep.results import open_store, verify
from lightfield.sweep.work import _read, _save

VARY = ("--vary", "lamp.hwhm_deg=3,4", "--vary", "water.scattering_per_m=0:0.3:3",
        "--vary", "water.absorption_per_m=0.05,0.1")  # fmt: skip


@pytest.fixture(scope="module")
def sound(scene: Path) -> Path:
    store = scene.parent / "sound.zarr"
    assert run(scene, store) == 0
    return store


@pytest.fixture
def store(sound: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(sound, tmp_path / "s.zarr"))


def run(scene: Path, store: Path) -> int:
    return main(["sweep", str(scene), *VARY, *BUDGET, "-o", str(store)])


def flip(file: Path, rng: random.Random) -> None:
    """Flip one random bit."""
    content = bytearray(file.read_bytes())
    bit = rng.randrange(8 * len(content))
    content[bit // 8] ^= 1 << bit % 8
    file.write_bytes(content)


def numbers(data: xr.Dataset) -> dict[str, bytes]:
    return {str(name): data[name].values.tobytes() for name in data.variables}


def files_of(store: Path) -> list[Path]:
    return sorted(file for file in store.rglob("*") if file.is_file() and file.stat().st_size)


def detected_or_harmless(store: Path, seed: int) -> bool:
    """Whether a random bit, in every file in turn, is detected; fails when it changes a number in silence."""
    rng, expected, detected = random.Random(seed), numbers(open_store(store)), 0
    for file in files_of(store):
        kept = file.read_bytes()
        flip(file, rng)
        try:
            found = open_store(store)
        except OutputError:
            detected += 1
        else:
            assert numbers(found) == expected, file
        file.write_bytes(kept)
    assert numbers(open_store(store)) == expected
    return detected > 0.98 * len(files_of(store))


def test_a_flipped_bit_in_any_file_is_detected_or_harmless(store: Path) -> None:
    assert detected_or_harmless(store, 1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(50))
def test_thousands_of_flipped_bits_are_detected_or_harmless(store: Path, seed: int) -> None:
    assert detected_or_harmless(store, 1000 + seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_the_same_sweep_makes_random_damage_good(scene: Path, sound: Path, store: Path, seed: int) -> None:
    """Five files at a time flipped, cut short, emptied or lost."""
    rng = random.Random(seed)
    for file in rng.sample(files_of(store), 5):
        harm = rng.choice(("flip", "cut", "empty", "lose"))
        if harm == "flip":
            flip(file, rng)
        elif harm == "lose":
            file.unlink()
        else:
            file.write_bytes(file.read_bytes()[: len(file.read_bytes()) // 2 if harm == "cut" else 0])
    code = run(scene, store)
    # Without the journal and with a damaged plan nobody knows what the store is for.
    if code == 2:
        assert not (store / journal.NAME).exists() or journal.journal_entries(store)[1]
        return
    assert code == 0
    assert verify(store).complete
    assert differences(store, sound) == []


def harm(store: Path, what: str) -> None:
    """Damage one thing, by name."""
    rng = random.Random(0)
    if what == "missing chunk":
        (store / "irradiance/1.0.0.0.0.0.0").unlink()
    elif what == "journal line":
        lines = (store / journal.NAME).read_bytes().splitlines(keepends=True)
        number = next(n for n, line in enumerate(lines) if b'"trace": 1' in line)
        lines[number] = lines[number].replace(b"reached", b"reachad")
        (store / journal.NAME).write_bytes(b"".join(lines))
    elif what == "missing journal":
        (store / journal.NAME).unlink()
    else:
        flip(store / what, rng)


HARMS = ("irradiance/0.0.0.0.0.0.0", "missing chunk", "z_m/0", "status/0.0.0", "irradiance/.zarray",
         ".zmetadata", journal.PLAN, "journal line", "missing journal")  # fmt: skip


@pytest.mark.parametrize("what", HARMS)
def test_damage_is_one_line_and_the_same_sweep_makes_it_good(
    what: str, scene: Path, sound: Path, store: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    harm(store, what)
    commands: list[list[str]] = [["sweep", "--verify", str(store)], ["show", str(store)]]
    for words in [*commands, ["export", str(store), "--exr", str(tmp_path / "exr"), "--all"]]:
        assert main(words) == 2
        errors = capsys.readouterr().err
        assert "damaged or missing" in errors or "has no journal" in errors
        assert "run its sweep again" in errors
        assert "defect" not in errors
    assert run(scene, store) == 0
    assert "nothing was left" not in capsys.readouterr().out or what in ("z_m/0", "status/0.0.0",
        "irradiance/.zarray", ".zmetadata", journal.PLAN)  # fmt: skip
    assert differences(store, sound) == []
    assert main(["sweep", "--verify", str(store)]) == 0
    assert "all as they were written; 2 blocks, complete" in capsys.readouterr().out


def test_what_was_made_good_is_said(scene: Path, store: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (store / "plane_power/0.0.0.0.0").unlink()
    assert run(scene, store) == 0
    output = capsys.readouterr().out
    assert "1 damaged files were made good: plane_power/0.0.0.0.0" in output
    assert "2 traced" in output and "6 were there already" in output


def test_a_damaged_plan_without_a_journal_is_refused(
    scene: Path, store: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (store / journal.NAME).unlink()
    (store / journal.PLAN).write_bytes((store / journal.PLAN).read_bytes()[:100])
    assert run(scene, store) == 2
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1 and "the plan of this store is damaged" in errors


def test_every_damaged_file_is_named(store: Path) -> None:
    gone = sorted(str(file.relative_to(store)) for file in store.glob("*/.z*"))
    for name in gone:
        (store / name).unlink()
    with pytest.raises(OutputError, match=f"{len(gone)} files of this store damaged or missing") as caught:
        verify(store)
    assert [one.where for one in caught.value.problems] == gone


def test_a_kill_between_journal_and_file_is_no_damage(store: Path) -> None:
    """The digest of a summary is noted before the summary is written: the older one is still sound."""
    journal.add_entry(store, {"files": {"status/0.0.0": "0" * 32}})
    assert verify(store).complete


def test_a_response_on_disk_is_read_as_it_was_written_or_not_at_all(tmp_path: Path) -> None:
    """Traces wait on disk for their blocks; the archive's check sums must cover all of it."""
    rng = np.random.default_rng(1)
    response = TransportResponse(
        rng.random((2, 3, 4)), rng.integers(0, 5, (3, 3)), rng.random(3), rng.random((1, 2, 2)),
        Reference(0.1, 0.2, 0.3), 1000, rng.integers(0, 4, (1, 2, 2)),
    )  # fmt: skip
    file, bits = tmp_path / "000000.npz", random.Random(2)
    _save(file, response, 0.1)
    kept, expected = file.read_bytes(), content(_read(file))
    lost = 0
    for _ in range(1000):
        flip(file, bits)
        found = _read(file)
        lost += found is None
        assert found is None or content(found) == expected
        file.write_bytes(kept)
    assert lost > 500


def content(stored: Any) -> list[Any]:
    assert stored is not None
    response, reached = stored
    arrays = (response.tally, response.histories, response.excess_m, response.straight_m, response.merged)
    return [None if a is None else (a.dtype, a.tobytes()) for a in arrays] + [
        response.reference, response.photons, reached]  # fmt: skip
