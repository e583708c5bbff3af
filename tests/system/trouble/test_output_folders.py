"""What a run leaves in a folder: of one run alone, and the same bytes whenever the same run is repeated.

Rationale: two renders into one folder would leave the maps of one beside the images of the other, and a file
that differs at every run cannot be compared by its hash. Set-up: a small tank. Expected: the second is
refused before it traces anything; two equal runs on one thread (several sum in another order each time, and
agree to single precision) leave equal files, down to the last bit.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from sweeping import SCENE

from lightfield.cli import main
from lightfield.render.backend import use_backend
from lightfield.scene import Scene
from lightfield.storage.files import locked_folder
from lightfield.sweep.axes import parse_axis
from lightfield.sweep.runner import run_sweep
from lightfield.sweep.sweep_plan import SweepSettings, make_plan

SCENES = Path(__file__).resolve().parents[3] / "scenes"
HIDDEN = f"{SCENES}/hidden_effect/data.csv --scene {SCENES}/hidden_effect/scene.toml"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a scene and a small store."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "scene.toml").write_text(SCENE)
    axes = [parse_axis("water.absorption_per_m=0.1,0.2")]
    settings = SweepSettings(max_photons=1e4, rel_error=0.5)
    run_sweep(make_plan(Scene.from_toml(SCENE), axes, settings), folder / "s.zarr")
    return folder


@pytest.mark.parametrize(
    "line",
    [
        "render {made}/scene.toml -o {out}",
        "compare {made}/scene.toml -o {out}",
        f"compare {HIDDEN} -o {{out}}",
        f"diagnose {HIDDEN} -o {{out}}",
        "regime -o {out}",
        f"hide {SCENES}/hidden_effect/scene.toml -o {{out}}",
        "show {made}/s.zarr -o {out}",
        "export {made}/s.zarr --exr {out}",
        f"demo --scenes {SCENES} -o {{out}}",
    ],
)
def test_a_folder_that_another_run_writes_to_is_refused_at_once(
    line: str, made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def traced(*_: object, **__: object) -> None:
        raise AssertionError("light was traced")

    for module in ("lightfield.commands.render", "lightfield.commands.compare", "lightfield.sweep.work"):
        monkeypatch.setattr(f"{module}.render_scene", traced)
    with locked_folder(tmp_path):
        assert main(line.format(made=made, out=tmp_path).split()) == 2
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1 and "another program is writing to this folder" in errors
    assert list(tmp_path.iterdir()) == []


RUN = """
import sys
from lightfield.cli import main
scene, out = sys.argv[1:]
trace = "--max-photons 2e4 --rel-error 0.5".split()
assert main(["render", scene, *trace, "--no-cache", "-o", f"{out}/maps"]) == 0
assert main(["compare", f"{out}/maps/maps.nc", "-o", f"{out}/page"]) == 0
vary = ["--vary", "water.scattering_per_m=0,0.2"]
assert main(["sweep", scene, *vary, *trace, "-o", f"{out}/s.zarr"]) == 0
"""


@pytest.mark.slow
def test_equal_runs_leave_equal_bytes(tmp_path: Path) -> None:
    """Times stand in no file but the journal of a sweep (how long a trace took) and the ledger."""
    if use_backend().kind == "cuda":
        pytest.skip("sums on a card have no order: equal to single precision, not in their bits")
    (tmp_path / "scene.toml").write_text(SCENE)
    found = []
    for run in ("one", "two"):
        words = [sys.executable, "-c", RUN.replace("main([", 'main(["--threads", "1", '), "scene.toml", run]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        files = {
            f.relative_to(tmp_path / run): f.read_bytes() for f in (tmp_path / run).rglob("*") if f.is_file()
        }
        found.append({name: content for name, content in files.items() if name.name != "journal.jsonl"})
    one, two = found
    assert {name.suffix for name in one} >= {".nc", ".exr", ".png", ".json", ".html"}
    assert one.keys() == two.keys()
    assert [str(name) for name in one if one[name] != two[name]] == []
