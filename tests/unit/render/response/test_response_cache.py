"""The cache of responses is trusted only where it is whole and its key is exactly right."""

from __future__ import annotations

import errno
import os
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from lightfield.render.response import response_cache
from lightfield.render.response.response import Reference, TransportResponse

KEY = {"kind": "test", "grid": [np.arange(3.0), 0.1], "seed": 1}
ARRAYS = {"tally": np.arange(24, dtype=np.float32).reshape(2, 3, 4), "photons": np.array(7)}


@pytest.fixture
def entry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A stored entry in a cache of its own."""
    monkeypatch.setenv("LIGHTFIELD_CACHE", str(tmp_path))
    response_cache.keep(KEY, ARRAYS)
    (path,) = (tmp_path / "transport").glob("*.npz")
    return path


def test_what_is_stored_comes_back(entry: Path) -> None:
    found = response_cache.recall(KEY)
    assert found is not None
    assert found.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        np.testing.assert_array_equal(found[name], array)
        assert found[name].dtype == array.dtype


@pytest.mark.parametrize(
    "other", [{"seed": 2}, {"grid": [np.arange(3.0), 0.2]}, {"grid": [np.arange(4.0), 0.1]}, {"more": 0}]
)
def test_another_key_finds_nothing(entry: Path, other: dict[str, object]) -> None:
    assert response_cache.recall(KEY | other) is None
    assert entry.exists()


def test_an_older_format_is_not_read(entry: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A program that walks or tallies otherwise never sees old responses."""
    monkeypatch.setattr(response_cache, "FORMAT", response_cache.FORMAT + 1)
    assert response_cache.recall(KEY) is None


@pytest.mark.parametrize("place", [10, 200, -40])
def test_a_flipped_bit_is_noticed(entry: Path, place: int) -> None:
    data = bytearray(entry.read_bytes())
    data[place] ^= 0x10
    entry.write_bytes(bytes(data))
    found = response_cache.recall(KEY)
    # A bit that nothing depends on (a file date in the archive) may flip; numbers may not.
    assert found is None or all((found[name] == ARRAYS[name]).all() for name in ARRAYS)


def test_every_flipped_bit_of_the_numbers_is_noticed(entry: Path) -> None:
    whole = entry.read_bytes()
    start = whole.index(ARRAYS["tally"].tobytes())
    for place in range(start, start + ARRAYS["tally"].nbytes, 7):
        data = bytearray(whole)
        data[place] ^= 1
        entry.write_bytes(bytes(data))
        assert response_cache.recall(KEY) is None


@pytest.mark.parametrize("fault", [MemoryError("no room"), OSError(errno.EIO, "a fault of the disk")])
def test_what_is_no_damage_leaves_the_entry(
    fault: Exception, entry: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may be read another time. Without memory there is no answer; without a disk it is computed anew."""

    def failing(*_: object, **__: object) -> None:
        raise fault

    with monkeypatch.context() as patched:
        patched.setattr(response_cache.np, "load", failing)
        if isinstance(fault, MemoryError):
            with pytest.raises(MemoryError):
                response_cache.recall(KEY)
        else:
            assert response_cache.recall(KEY) is None
    assert response_cache.recall(KEY) is not None


@pytest.mark.parametrize("kept", [0, 1, 100, 0.5, 0.99])
def test_a_truncated_entry_is_dropped_and_made_again(entry: Path, kept: float) -> None:
    data = entry.read_bytes()
    entry.write_bytes(data[: int(kept if kept >= 1 else kept * len(data))])
    assert response_cache.recall(KEY) is None
    assert not entry.exists()
    response_cache.keep(KEY, ARRAYS)
    assert response_cache.recall(KEY) is not None


def test_an_entry_under_a_wrong_name_is_not_read(entry: Path) -> None:
    """As after a careless copy: the key inside the file decides, not the name."""
    other = KEY | {"seed": 2}
    entry.rename(entry.with_name(f"{response_cache.digest_of(other)}.npz"))
    assert response_cache.recall(other) is None


@pytest.mark.parametrize("merged", [None, np.array([[[0, 1], [1, 0]]])])
def test_a_response_comes_back_whole(tmp_path: Path, merged: np.ndarray | None) -> None:
    """In the cache and beside a sweep's store, by way of one list of its arrays."""
    cells = 4 if merged is None else 2
    reference = Reference(0.1, 0.2, 0.3)
    response = TransportResponse(
        np.arange(6.0 * cells).reshape(2, 3, cells),
        np.arange(9).reshape(3, 3),
        np.array([0.0, 0.5, 1.0]),
        np.arange(1.0, 5.0).reshape(1, 2, 2),
        reference,
        640,
        merged,
    )
    np.savez(tmp_path / "stored.npz", **response.packed())
    with np.load(tmp_path / "stored.npz") as stored:
        back = TransportResponse.unpacked(stored, reference)
    for field in fields(TransportResponse):
        np.testing.assert_array_equal(getattr(back, field.name), getattr(response, field.name))


def test_room_is_made_by_the_oldest_while_others_make_room_too(
    entry: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """What vanished since it was listed, as a link to nothing is, costs no entry."""
    size = entry.stat().st_size
    os.utime(entry, (1, 1))
    (entry.parent / "gone.npz").symlink_to(entry.parent / "nothing")
    monkeypatch.setattr(response_cache, "LARGEST_BYTES", int(2.5 * size))
    for name in ("second", "third"):
        response_cache.keep({"name": name}, ARRAYS)
    assert not caplog.records
    assert not entry.exists()
    assert all(response_cache.recall({"name": name}) is not None for name in ("second", "third"))
