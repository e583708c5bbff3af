"""Errors of the library name options as they are written, and the file of the scene that they are about."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

import pytest

from lightfield import cli
from lightfield.commands.shared.told import run_told
from lightfield.errors import LightfieldError, SceneError, UsageError

DARK = "[lamp]\nspectrum = { peak_nm = 470, fwhm_nm = 25 }\n[detector]\nbands_nm = [[800, 850]]\n"
FOLLOWS = "[array]\n[follower]\nz_m = 5.0\n"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("array show plain.toml --no-trace", "plain.toml: the scene has no array; "),
        ("regime dark.toml", "dark.toml: detector.bands_nm: the lamp gives no light"),
        ("regime missing.toml", "lightfield: missing.toml: cannot read the scene; "),
        ("link plain.toml --bit-rate 0", "--bit-rate: impossible number; found 0.0; rule: 0.001 to 1e+12"),
        ("array optimise ring.toml --elements 3 --no-trace", "--elements: too few elements to know a pose"),
        (
            "follow ring.toml --duration -3",
            "--duration: impossible number; found -3.0; rule: above 0 to 3600 s",
        ),
        ("follow ring.toml --believe truth", "--believe: no such belief; found 'truth'"),
        ("follow ring.toml --believe fittd", "remedy: did you mean fitted?"),
        ("field export plain.toml -o f.nc --from 5 --to 3", "impossible grid; found "),
        ("attenuation behind.csv --scene plain.toml", "z_m is an impossible position"),
    ],
)
def test_errors_are_in_words_of_the_command_line(
    words: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In one line, with a remedy."""
    monkeypatch.chdir(tmp_path)
    for name, text in (
        ("plain.toml", "[water]\nabsorption_per_m = 0.1\n"),
        ("dark.toml", DARK),
        ("ring.toml", FOLLOWS),
    ):
        Path(name).write_text(text)
    Path("behind.csv").write_text("medium,z_m,value\nwater,4.5,1\nwater,-3,1\nair,4.5,2\nair,5.5,2\n")
    assert cli.main(words.split()) == 2
    error = capsys.readouterr().err
    assert says in error and "remedy: " in error and error.count("\n") == 1


@pytest.mark.parametrize(
    ("error", "where"),
    [
        (UsageError("no", where="with_"), "--with"),
        (UsageError("no", where="bit rate"), "--bit-rate"),
        (UsageError("no", where="plot"), "plot"),  # no option
        (UsageError("no"), None),
        (SceneError("no", where="lamp.spectrum"), "a.toml: lamp.spectrum"),
        (SceneError("no", where="tables/lamp.csv"), "tables/lamp.csv"),
        (SceneError("no"), "a.toml"),
    ],
)
def test_where_an_error_is(error: LightfieldError, where: str | None) -> None:
    def run(args: Namespace) -> int:
        raise error

    with pytest.raises(type(error)) as told:
        run_told(run, Namespace(scene=Path("a.toml"), others=[]), {"--with", "--bit-rate"})
    assert told.value.where == where and told.value.what == "no"


def test_of_several_scenes_none_is_blamed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_text("name = 'a'\n" + FOLLOWS)
    Path("b.toml").write_text("name = 'b'\n")
    assert cli.main(["array", "compare", "a.toml", "--with", "b.toml", "--no-trace"]) == 2
    assert capsys.readouterr().err.startswith("lightfield: the scene has no array")
    assert cli.main(["array", "compare", "a.toml", "--with", "a.toml", "--no-trace"]) == 2
    assert "--with: two scenes of one name" in capsys.readouterr().err


def test_a_failed_case_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """And which: the first of them; a store of another sweep is told by what is varied, as it is written."""
    monkeypatch.chdir(tmp_path)
    Path("lit.toml").write_text(DARK.replace("[800, 850]", "[450, 490]") + "planes_m = [2]\npixels = 3\n")
    Path("ring.toml").write_text(DARK.replace("[800, 850]", "[450, 490]") + "planes_m = [4.5, 8]\n" + FOLLOWS)
    asked = "follow ring.toml --no-trace --duration 2 --runs 1 -o f.zarr --vary lamp.spectrum.peak_nm=470,900"
    assert cli.main(asked.split()) == 1
    assert "1 case failed: lamp.spectrum.peak_nm=900: " in capsys.readouterr().out
    asked = "sweep lit.toml --max-photons 1e4 --rel-error 0.5 -o s.zarr --vary lamp.spectrum.peak_nm="
    assert cli.main(f"{asked}470,900".split()) == 1
    told = capsys.readouterr().out
    assert "1 case failed: lamp.spectrum.peak_nm=900: " in told and "no light in the bands" in told
    assert cli.main(f"{asked}470,480".split()) == 2
    error = capsys.readouterr().err
    assert "varied lamp.spectrum.peak_nm: there [470.0, 900.0], asked for [470.0, 480.0]" in error
