"""A store from somebody else never runs code: what it declares is read before any library opens it.

Rationale: the metadata of the zarr format name the codecs and filters that decode a chunk, and the codec
`pickle` runs whatever stands in the chunk. Set-up: a small store, turned into hostile ones whose journals
have the right digests. Expected: one line and exit code 2, and the zarr library has not been called; which
version is installed does not matter then. That the attack is real is shown on zarr 2 (slow tier).
"""

from __future__ import annotations

import json
import os
import pickle
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import xarray as xr
import zarr
from sweeping import SCENE

from lightfield.cli import main
from lightfield.errors import OutputError
from lightfield.scene import Scene
from lightfield.sweep import journal, zarrfile
from lightfield.sweep.axes import parse_axis
from lightfield.sweep.results import open_store
from lightfield.sweep.runner import run_sweep
from lightfield.sweep.sweep_plan import SweepSettings, make_plan
from lightfield.sweep.zarrfile import Variable, metadata_files, refuse_foreign_metadata

ARRAY = "status/.zarray"
Metadata = dict[str, Any]


class Payload:
    """Unpickled, it makes a file."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str, str]]:
        return open, (str(self.file), "w")


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    store = tmp_path_factory.mktemp("foreign") / "sound.zarr"
    axes = [parse_axis("water.absorption_per_m=0.1,0.2")]
    run_sweep(make_plan(Scene.from_toml(SCENE), axes, SweepSettings(max_photons=1e4, rel_error=0.5)), store)
    return store


@pytest.fixture
def store(sound: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(sound, tmp_path / "s.zarr"))


def declare(store: Path, change: Callable[[Metadata], Any]) -> None:
    """Change the metadata of a store, all copies of them."""
    whole = json.loads((store / ".zmetadata").read_text())
    change(whole["metadata"])
    (store / ".zmetadata").write_text(json.dumps(whole))
    for key, content in whole["metadata"].items():
        (store / key).parent.mkdir(parents=True, exist_ok=True)
        (store / key).write_text(json.dumps(content))


def sign(store: Path) -> None:
    """Give the journal the digests of what is there, as anyone can."""
    names = [
        str(f.relative_to(store)) for f in store.rglob("*") if f.is_file() and f.parent.name != ".lightfield"
    ]
    files = {name: journal.digest((store / name).read_bytes()) for name in names}
    journal.rewrite(store, [{"files": files}])


def pickled(store: Path, mark: Path, how: str) -> None:
    """Let `status` be decoded by the codec `pickle`, and put a payload into its chunk."""
    hostile = {"compressor": {"id": "pickle"}} if how == "compressor" else {
        "filters": [{"id": "pickle"}], "dtype": "|O", "compressor": None}  # fmt: skip
    declare(store, lambda metadata: metadata[ARRAY].update(hostile))
    (store / "status/0").write_bytes(pickle.dumps(Payload(mark)))
    sign(store)


def set_array(**values: Any) -> Callable[[Metadata], Any]:
    return lambda metadata: metadata[ARRAY].update(values)


BLOSC = {"id": "blosc", "cname": "zstd", "clevel": 3, "shuffle": 1, "blocksize": 0}
CHANGES: dict[str, Callable[[Metadata], Any]] = {
    "pickle as compressor": set_array(compressor={"id": "pickle"}),
    "pickle as filter": set_array(filters=[{"id": "pickle"}]),
    "pickle as filter of objects": set_array(filters=[{"id": "pickle"}], dtype="|O", compressor=None),
    "objects": set_array(dtype="|O"),
    "objects in a structure": set_array(dtype=[["a", "|O"]]),
    "another compressor": set_array(compressor={"id": "zlib", "level": 1}),
    "a setting of the compressor": set_array(compressor={**BLOSC, "typesize": 8}),
    "something more": set_array(storage_transformers=[{"type": "x"}]),
    "version 3 of the format": set_array(zarr_format=3, codecs=[{"name": "numcodecs.pickle"}]),
    "a chunk of no cases": set_array(chunks=[0]),
    "no number": set_array(shape=["2"]),
    "a group in the group": lambda metadata: metadata.update({"more/.zgroup": {"zarr_format": 2}}),
    "an array outside": lambda metadata: metadata.update({"../more/.zarray": metadata[ARRAY]}),
    "no table": lambda metadata: metadata.update({ARRAY: 5}),
}


@pytest.mark.parametrize("what", CHANGES)
def test_what_a_sweep_does_not_write_is_refused_before_anything_opens_it(
    what: str,
    store: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def opened(*_: Any, **__: Any) -> None:
        raise AssertionError("the store was opened")

    for module, name in ((xr, "open_zarr"), (zarr, "open_group"), (zarr, "open")):
        monkeypatch.setattr(module, name, opened)
    declare(store, CHANGES[what])
    sign(store)
    assert not journal.damaged_files(
        store, journal.journal_entries(store)[0]
    )  # only the declaration is wrong
    for words in (
        ["show", str(store)],
        ["export", str(store), "--exr", str(tmp_path / "exr")],
        ["sweep", "--verify", str(store)],
    ):
        assert main(words) == 2
        errors = capsys.readouterr().err
        assert errors.count("\n") == 1
        assert "the metadata of this store are not those of a sweep" in errors


def test_metadata_of_version_3_beside_ours_are_refused(store: Path) -> None:
    """zarr 3 would read `zarr.json` first, with codecs that nobody has looked at."""
    pipeline = [{"name": "numcodecs.pickle", "configuration": {}}]
    (store / "zarr.json").write_text(
        json.dumps({"zarr_format": 3, "node_type": "group", "attributes": {}, "codecs": pipeline})
    )
    sign(store)
    with pytest.raises(OutputError, match=r"zarr\.json"):
        open_store(store)


def test_consolidated_metadata_and_those_of_the_arrays_must_agree(store: Path) -> None:
    """Whichever of the two a version of the library reads."""
    array = json.loads((store / ARRAY).read_text())
    (store / ARRAY).write_text(json.dumps({**array, "compressor": {"id": "pickle"}}))
    sign(store)
    with pytest.raises(OutputError, match="says something else"):
        open_store(store)


@pytest.mark.parametrize("dtype", ["<f4", "<f8", "|i1", "<i4", "<i8", "<U240"])
def test_whatever_a_sweep_writes_is_accepted(tmp_path: Path, dtype: str) -> None:
    declared = {"v": Variable(("a", "b"), (3, 5), (1, 5), dtype, {"units": "1"})}
    for name, content in metadata_files(declared, {"title": "t"}).items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    refuse_foreign_metadata(tmp_path)
    # And it is what the library itself would make of it.
    array = zarr.open_group(str(tmp_path), mode="r")["v"]
    assert (array.shape, array.chunks, array.dtype.str) == ((3, 5), (1, 5), dtype)


def test_a_journal_names_no_file_outside_the_store(store: Path) -> None:
    for name in ("../secret", "/etc/passwd", "a/../../secret"):
        journal.rewrite(store, [{"files": {name: "0" * 32}}])
        assert journal.journal_entries(store) == ([], 1)


@pytest.mark.parametrize("content", [b"", b"no Blosc", b"\x02\x01\x21\x08" + 60 * b"\xff"])
@pytest.mark.parametrize("command", ["show", "export"])
def test_a_chunk_that_nothing_decodes_is_one_error(
    store: Path, command: str, content: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With digests that are right: damage is found before, this was made."""
    for name in ("irradiance", "irradiance_stderr", "on_axis_irradiance"):
        for chunk in (store / name).glob("[0-9]*"):
            chunk.write_bytes(content)
    sign(store)
    assert (
        main([command, str(store), *(["--exr"] if command == "export" else ["-o"]), str(tmp_path / "out")])
        == 2
    )
    told = capsys.readouterr().err
    assert "a file of this store cannot be decoded" in told and str(store) in told


def test_garbage_for_metadata_is_one_error(store: Path) -> None:
    for content in (b"", b"[]", b"{}", b'{"metadata": 5}', b"\xff", b"[" * 100_000, b"null"):
        (store / zarrfile.CONSOLIDATED).write_bytes(content)
        sign(store)
        with pytest.raises(OutputError, match="not those of a sweep"):
            open_store(store)


@pytest.fixture(scope="module")
def zarr_2(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Environment of a process that has zarr 2, with the last numcodecs that unpickles without a question."""
    folder = tmp_path_factory.mktemp("zarr2")
    packages = ["zarr==2.18.3", "numcodecs==0.13.1", "asciitree", "fasteners", "xarray==2024.11.0"]
    words = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--no-deps",
        "--target",
        str(folder),
        *packages,
    ]
    installed = subprocess.run(words, capture_output=True, text=True, check=False)
    if installed.returncode:
        pytest.skip(f"zarr 2 cannot be installed: {installed.stderr[-200:]}")
    here = str(Path(__file__).resolve().parents[3])
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), here])}


@pytest.mark.slow
@pytest.mark.parametrize("how", ["compressor", "filter"])
def test_the_attack_is_real_with_zarr_2_and_is_stopped(
    how: str, store: Path, tmp_path: Path, zarr_2: dict[str, str]
) -> None:
    def run(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, *words], env=zarr_2, cwd=tmp_path, capture_output=True, text=True, check=False
        )

    shown = run("-m", "lightfield.cli", "show", str(store))
    assert shown.returncode == 0, shown.stderr  # a sound store is read by zarr 2 as well
    mark = tmp_path / "executed"
    pickled(store, mark, how)
    code = (
        "import sys, zarr, xarray as xr; assert zarr.__version__[0] == '2'; xr.open_zarr(sys.argv[1]).load()"
    )
    opened = run("-c", code, str(store))
    assert mark.exists(), opened.stderr
    mark.unlink()
    for words in (["show", str(store)], ["export", str(store), "--exr", str(tmp_path / "exr")]):
        refused = run("-m", "lightfield.cli", *words)
        assert refused.returncode == 2
        assert "the metadata of this store are not those of a sweep" in refused.stderr
        assert not mark.exists()
