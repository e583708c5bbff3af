"""No command writes over a table that its scene reads: a lamp's, an array's, a leader's way."""

from __future__ import annotations

from pathlib import Path

import pytest

from lightfield import cli

LAMP = "angle_deg,intensity\n0,1\n3,0.7\n6,0.2\n12,0\n"
ARRAY = "x_m,y_m,z_m,nx,ny,nz\n" + "".join(
    f"{x},{y},0,{x},{y},-1\n" for x in (-0.1, 0.1) for y in (-0.1, 0, 0.1)
)
SCENE = """
[lamp]
profile = "table"
intensity_table = "lamp.csv"
[array]
layout = "table"
table = "array.csv"
[detector]
planes_m = [2.0, 4.0]
"""


@pytest.mark.parametrize(
    "wrong",
    [
        "array optimise scene.toml --no-trace --elements 6 --box 0.3 --table array.csv",
        "array show scene.toml --no-trace --report array.csv",
        "pose bias scene.toml --no-trace --json array.csv",
        "follow scene.toml --no-trace --duration 1 --runs 1 --track lamp.csv",
        "range scene.toml --no-trace --json lamp.csv",
        "band scene.toml --no-trace --report lamp.csv",
        "link scene.toml --json lamp.csv",
        "field export scene.toml --no-trace -o lamp.csv",
        "plan layout.csv --scene scene.toml --no-trace --report lamp.csv",
        "attenuation readings.csv --scene scene.toml --no-trace -o lamp.csv",
        "diagnose readings.csv --scene scene.toml --no-trace --report lamp.csv",
        "compare readings.csv --scene scene.toml --fit-json lamp.csv",
        "scene scene.toml --to-xml lamp.csv",
    ],
)
def test_a_table_of_the_scene_is_kept(tmp_path: Path, monkeypatch, capsys, wrong: str) -> None:
    monkeypatch.chdir(tmp_path)
    places = "z_m\n2\n3\n4\n"
    readings = "z_m,value,wavelength_nm\n2,1,525\n3,0.4,525\n4,0.2,525\n"
    files = {"lamp.csv": LAMP, "array.csv": ARRAY, "scene.toml": SCENE, "layout.csv": places}
    for name, text in (files | {"readings.csv": readings}).items():
        Path(name).write_text(text, encoding="utf-8")
    assert cli.main(wrong.split()) == 2
    assert "in use in the same run" in capsys.readouterr().err
    assert {name: Path(name).read_text(encoding="utf-8") for name in files} == files
