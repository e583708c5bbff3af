"""hide, diagnose, compare and plan, as a user runs them one after the other.

Rationale: each command's files are the next one's input. Set-up: readings of unbounded, unscattering water
(nothing to trace, so it is quick) with a tilted lamp hidden in them. Expected: the verdict is valid JSON of
the published schema, every rung can be climbed again by hand, and wrong input ends with exit code 2.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import jsonschema
import pytest

from lightfield import cli
from lightfield.diagnosis.verdict.verdict import json_schema
from lightfield.report.page import to_svg

SCENE = """
[lamp]
hwhm_deg = 4.0
[water]
absorption_per_m = 0.1
[detector]
planes_m = [2.5, 3.5, 4.5, 5.5, 6.5]
width_m = 1.6
"""


OWN = """
[[effect]]
name = "rope"
stage = "path"
formula = "1 - depth*exp(-(x/0.1)**2)"
[effect.parameters]
depth = { unit = "1", range = [0.0, 0.9], neutral = 0.0, typical = 0.05 }
"""


def wide_alone(figure, name):
    """Figures for telephones are drawn by the tests of the page."""
    return "<svg></svg>" if name.endswith("-narrow") else to_svg(figure, name)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    made = tmp_path_factory.mktemp("hidden")
    (made / "scene.toml").write_text(SCENE)
    hide = f"hide {made}/scene.toml --effect beam_tilt --size lamp.tilt_x_deg=0.4 --seed 3 -o {made}/set"
    assert cli.main(hide.split()) == 0
    run = f"diagnose {made}/set/data.csv --scene {made}/scene.toml --no-trace -o {made}/found"
    run += " --effects beam_tilt,beam_offset,background"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("lightfield.report.page.to_svg", wide_alone)
        assert cli.main([*run.split(), "--json", f"{made}/v.json", "--report", f"{made}/v.html"]) == 0
    return made


def test_hide_keeps_the_truth_apart(folder: Path) -> None:
    truth = json.loads((folder / "set" / "truth.json").read_text())
    assert truth["parameters"]["lamp.tilt_x_deg"] == 0.4
    assert "tilt" not in (folder / "set" / "scene.toml").read_text()
    assert "tilt" not in (folder / "set" / "data.csv").read_text()


def test_an_effect_of_a_file_is_hidden_and_found_with_that_file(tmp_path: Path) -> None:
    """The scene that is written beside the readings does not tell what acts, nor has it the effect twice."""
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "own.toml").write_text(OWN)
    own = f"--effects-file {tmp_path}/own.toml"
    hide = f"hide {tmp_path}/scene.toml {own} --effect rope --seed 3 --max-photons 1e4 -o {tmp_path}/set"
    assert cli.main(hide.split()) == 0
    assert "rope" not in (tmp_path / "set" / "scene.toml").read_text()
    look = f"diagnose {tmp_path}/set/data.csv --scene {tmp_path}/set/scene.toml {own} --no-trace"
    assert cli.main([*look.split(), "--json", f"{tmp_path}/v.json", "--effects", "rope"]) == 0
    assert "rope" in str(json.loads((tmp_path / "v.json").read_text())["best_set"])


def test_diagnose_writes_verdict_and_report(folder: Path) -> None:
    verdict = json.loads((folder / "v.json").read_text())
    jsonschema.validate(verdict, json_schema())
    assert (verdict["verdict"], verdict["effects"]) == ("identified", ["beam_tilt"])
    page = (folder / "v.html").read_text()
    assert "<svg" in page and "beam tilt" in page.lower()
    assert "http://" not in page.replace("http://www.w3.org", "").replace("http://purl.org", ""), (
        "self-contained"
    )


def test_what_was_found_is_told_where_the_fresh_render_is_stopped(folder: Path, capsys, monkeypatch) -> None:
    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("lightfield.diagnosis.diagnose.Diagnosis.rendered", stopped)
    run = f"diagnose {folder}/set/data.csv --scene {folder}/scene.toml --effects beam_tilt,beam_offset"
    assert cli.main([*run.split(), "--json", f"{folder}/stopped.json"]) == 130
    said = capsys.readouterr()
    assert said.out.startswith("Beam tilt is missing in the model")
    assert said.out.endswith("not rendered afresh\n")
    verdict = json.loads((folder / "stopped.json").read_text())
    jsonschema.validate(verdict, json_schema())
    assert verdict["interrupted"] and verdict["effects"] == ["beam_tilt"]


def _fit(folder: Path, capsys, *more: str) -> dict:
    """Without a trace, but for the render: open water that scatters nothing has the formula's light alone."""
    where = ["compare", f"{folder}/set/data.csv", "--fit-json", f"{folder}/fit.json"]
    assert cli.main([*where, *more, *([] if "render" in more else ["--no-trace"])]) == 0
    return json.loads((folder / "fit.json").read_text())


def test_every_stored_rung_gives_its_error_again(folder: Path, capsys) -> None:
    ladder = json.loads((folder / "v.json").read_text())["ladder"]
    assert len(ladder) == 2
    for k, rung in enumerate(ladder):
        again = _fit(folder, capsys, "--scene", f"{folder}/found/rung{k}.toml")
        assert again["error_percent"] == pytest.approx(rung["error_percent"], rel=5e-3)
        # What was fitted stands there with its error.
        noted = re.findall(r"= (\S+)  # fitted: .* ± (\S+)", (folder / f"found/rung{k}.toml").read_text())
        of_scene = [v for path, v in rung["parameters"].items() if path != "gain" and v["stderr"]]
        known = [(v["value"], v["stderr"]) for v in of_scene]
        assert sorted(float(value) for value, _ in noted) == pytest.approx(sorted(v for v, _ in known))
        assert sorted(float(e) for _, e in noted) == pytest.approx(sorted(e for _, e in known), rel=0.06)


def test_climbing_by_hand_appends_to_the_ledger(folder: Path, capsys, monkeypatch) -> None:
    monkeypatch.setattr("lightfield.report.page.to_svg", lambda drawing, name: "<svg></svg>")
    errors = []
    rungs = []
    for names in ("beam_offset", "beam_offset,beam_tilt"):
        more = ["--scene", f"{folder}/scene.toml", "--with", names, "-o", f"{folder}/byhand"]
        errors.append(_fit(folder, capsys, *more)["error_percent"])
        page = (folder / "byhand" / "index.html").read_text(encoding="utf-8")
        rungs.append(re.findall(r'<th scope="row"[^>]*>(\+ [^<]+)</th>', page))
        assert f"error {errors[-1]:.3g} %" in page
    assert errors[1] < errors[0]
    assert rungs == [["+ beam_offset"], ["+ beam_offset", "+ beam_offset + beam_tilt"]]
    text = next(p for p in (folder / "byhand").iterdir() if "ledger" in p.name).read_text()
    assert text.index("+ beam_offset") < text.index("beam_offset + beam_tilt")
    assert sorted(p.name for p in (folder / "byhand").glob("rung*.toml")) == ["rung0.toml", "rung1.toml"]


RENDER = ("--solver", "render", "--max-photons", "1e5", "--seed", "3")


def test_the_render_agrees_where_the_formula_is_exact(folder: Path, capsys) -> None:
    """No scattering, no walls: a fresh render of the fitted scene moves no parameter."""
    more = ["--scene", f"{folder}/found/rung1.toml"]
    fast, rendered = _fit(folder, capsys, *more), _fit(folder, capsys, *more, *RENDER)
    assert rendered["solver"] == "render"
    assert rendered["error_percent"] == pytest.approx(fast["error_percent"], rel=5e-3)


def test_plan_says_what_the_layout_can_see(folder: Path, capsys) -> None:
    run = f"plan {folder}/set/data.csv --scene {folder}/scene.toml --no-trace --json {folder}/plan.json"
    assert cli.main(run.split()) == 0
    plan = json.loads((folder / "plan.json").read_text())
    limit = plan["detection_limits"]["beam_tilt"]
    assert limit["within_range"] and limit["value"] < 0.4, "the hidden tilt was found"
    assert "was not traced" in plan["untestable"]["scattering"]


@pytest.mark.parametrize(
    "wrong",
    [
        "diagnose {f}/set/data.csv --scene {f}/no.toml",
        "diagnose {f}/set/data.csv --scene {f}/scene.toml --effects nonsense",
        "compare {f}/set/data.csv --scene {f}/scene.toml --with beam_ellipticity",
        "plan {f}/no.csv --scene {f}/scene.toml",
        "hide {f}/scene.toml --effect cdom -o {f}/never",
    ],
)
def test_wrong_input_ends_with_2(folder: Path, wrong: str, capsys) -> None:
    assert cli.main(wrong.format(f=folder).split()) == 2
    assert capsys.readouterr().err.startswith("lightfield: ")
    assert not list((folder / "never").glob("*")), "a wrong input left a file"


def test_a_layout_without_light_is_told(folder: Path, tmp_path: Path, capsys) -> None:
    """exp(-850) is no number: neither a limit nor "every effect would be told" follows from it."""
    (tmp_path / "dark.toml").write_text("[water]\nabsorption_per_m = 100.0\n")
    (tmp_path / "far.csv").write_text("x_m,z_m\n" + "".join(f"{x},8.5\n" for x in (0, 0.1, 0.2, 0.3)))
    assert cli.main(f"plan {tmp_path}/far.csv --scene {tmp_path}/dark.toml --no-trace".split()) == 2
    assert "no light of the scene reaches this layout" in capsys.readouterr().err


@pytest.mark.parametrize(
    "wrong",
    [
        "diagnose {f}/mine.csv --scene {f}/mine.toml --no-trace --json {f}/mine.csv",
        "diagnose {f}/mine.csv --scene {f}/mine.toml --no-trace --report {f}/x/../mine.toml",
        "diagnose {f}/mine.csv --scene {f}/mine.toml --no-trace --json {f}/one --report {f}/one",
        "compare {f}/mine.csv --scene {f}/mine.toml --fit-json {f}/mine.toml",
        "plan {f}/mine.csv --scene {f}/mine.toml --no-trace --json {f}/mine.csv",
        "hide {f}/scene.toml -o {f}",
        "diagnose {f}/mine.csv --scene {f}/found/rung1.toml --no-trace -o {f}/found",
        "diagnose {f}/mine.csv --scene {f}/mine.toml --effects-file {f}/own.toml --json {f}/own.toml",
        "diagnose {f}/mine.csv --scene {f}/mine.toml --effects-file {f}/own/rung0.toml -o {f}/own",
        "diagnose {f}/mine.csv --scene {f}/mine.toml --effects-file {f}/own/curves.json -o {f}/own",
        "diagnose {f}/own/lamp.csv --scene {f}/mine.toml --no-trace -o {f}/own",
        "plan {f}/mine.csv --scene {f}/mine.toml --no-trace --effects-file {f}/own.toml --json {f}/own.toml",
        "compare {f}/mine.csv --scene {f}/mine.toml --effects-file {f}/own.toml --fit-json {f}/x/../own.toml",
        "hide {f}/mine.toml --effects-file {f}/own/data.csv -o {f}/own",
    ],
)
def test_what_is_read_is_never_overwritten(folder: Path, wrong: str, capsys) -> None:
    for name, source in (("mine.csv", "set/data.csv"), ("mine.toml", "scene.toml")):
        (folder / name).write_bytes((folder / source).read_bytes())
    (folder / "own").mkdir(exist_ok=True)
    (folder / "own/lamp.csv").write_bytes((folder / "mine.csv").read_bytes())
    mine = [folder / name for name in ("own.toml", "own/rung0.toml", "own/curves.json", "own/data.csv")]
    for file in mine:
        file.write_text(OWN)
    assert cli.main(wrong.format(f=folder).split()) == 2
    assert "in use in the same run" in capsys.readouterr().err
    assert {file.read_text() for file in mine} == {OWN}
    assert (folder / "own/lamp.csv").read_bytes() == (folder / "mine.csv").read_bytes()
    assert (folder / "mine.csv").read_bytes() == (folder / "set/data.csv").read_bytes()
    assert (folder / "mine.toml").read_text() == (folder / "scene.toml").read_text() == SCENE


@pytest.mark.parametrize("twice", ["beam_tilt,beam_tilt", "lamp_drift,lamp_drift:warm-up"])
def test_an_effect_is_not_fitted_twice(folder: Path, twice: str, capsys) -> None:
    assert (
        cli.main(["compare", f"{folder}/set/data.csv", "--scene", f"{folder}/scene.toml", "--with", twice])
        == 2
    )
    assert "cannot be fitted together" in capsys.readouterr().err


def test_compare_repeats_the_warnings_of_the_table(folder: Path, capsys) -> None:
    data = _fit(folder, capsys, "--scene", f"{folder}/scene.toml")
    assert any("no integration times" in note for note in data["notes"])
    table = folder / "renamed.csv"
    table.write_text((folder / "set/data.csv").read_text().replace("x_m", "x_mm"))
    assert cli.main(["compare", str(table), "--scene", f"{folder}/scene.toml", "--no-trace"]) in (0, 2)
    out = capsys.readouterr()
    assert "x_mm" in out.out + out.err


@pytest.mark.parametrize(
    ("command", "file"),
    [
        ("diagnose {f}/set/data.csv --scene {f}/scene.toml --no-trace --effects beam_tilt --json", "v.json"),
        (
            "compare {f}/set/data.csv --scene {f}/scene.toml --no-trace --with beam_tilt --fit-json",
            "fit.json",
        ),
    ],
)
def test_what_is_for_programs_is_written_before_people_read(
    folder: Path, tmp_path: Path, monkeypatch, command: str, file: str
) -> None:
    """`... | head -1` ends the text: what a long search found was lost with it."""

    def unread(*_: object, **__: object) -> None:
        raise BrokenPipeError

    for module in ("diagnose", "compare"):
        monkeypatch.setattr(f"lightfield.commands.{module}.print", unread, raising=False)
    monkeypatch.setattr("lightfield.cli._code_of", lambda error: 0)
    assert cli.main([*command.format(f=folder).split(), str(tmp_path / file)]) == 0
    assert json.loads((tmp_path / file).read_text(encoding="utf-8"))
