"""What commands write for programs is JSON by the letter: it has no infinity and no NaN."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from lightfield.commands.shared.answer import write_json


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
