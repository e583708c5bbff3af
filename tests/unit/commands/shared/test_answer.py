"""What commands write for programs is JSON by the letter: it has no infinity and no NaN."""

from __future__ import annotations

import json
from argparse import Namespace
from pathlib import Path

import numpy as np
import pytest

from lightfield.commands.shared.answer import answered, write_json


def test_what_is_no_finite_number_is_null(tmp_path: Path) -> None:
    given = {
        "a": float("nan"),
        "b": [1.5, float("inf")],
        "c": {"d": np.float64("-inf"), "e": "nan", "f": True},
    }
    write_json(given, tmp_path / "a.json")
    text = (tmp_path / "a.json").read_text(encoding="utf-8")
    assert json.loads(text) == {"a": None, "b": [1.5, None], "c": {"d": None, "e": "nan", "f": True}}
    assert "Infinity" not in text and "NaN" not in text


class Told:
    """An answer whose text nobody reads to its end."""

    def as_text(self) -> str:
        raise BrokenPipeError

    def as_data(self) -> dict[str, float]:
        return {"far_m": 8.5}

    def report(self, path: Path) -> Path:
        path.write_text("<html></html>", encoding="utf-8")
        return path


def test_files_are_written_though_whoever_reads_the_text_has_heard_enough(tmp_path: Path) -> None:
    """`lightfield range ... --json a.json --report a.html | head -1` left neither, as it happened."""
    args = Namespace(json=tmp_path / "a.json", report=tmp_path / "a.html")
    with pytest.raises(BrokenPipeError):
        answered(args, Told())  # type: ignore[arg-type]
    assert json.loads(args.json.read_text(encoding="utf-8")) == {"far_m": 8.5}
    assert args.report.read_text(encoding="utf-8") == "<html></html>"
