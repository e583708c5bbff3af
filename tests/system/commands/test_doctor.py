"""The doctor: a healthy installation passes, and each way of being ill is told apart.

Expected behaviour: exit code 0 and PASS; 1 when the render is wrong or dies; 2 when there is no backend.
"""

from __future__ import annotations

import math
import sys

import pytest
from scipy.stats import chi2

from lightfield import cli
from lightfield.commands import doctor as command
from lightfield.render import doctor as examination
from lightfield.render.known_case import Check, render_known_case


def test_this_machine_is_healthy(capsys, monkeypatch):
    monkeypatch.setenv("LIGHTFIELD_BACKEND", "llvm")
    assert cli.main(["doctor"]) == 0
    text = capsys.readouterr().out
    assert text.splitlines()[-1] == "PASS"
    for word in (
        "mitsuba",
        "drjit",
        "backend",
        "llvm_ad_spectral",
        "libLLVM",
        "threads",
        "cache",
        "standard errors",
    ):
        assert word in text


def test_known_case_scatters_as_it_says():
    """Each run counts hits of a sphere (binomial), so z^2 of 12 seeds adds up to chi-square."""
    checks = [render_known_case(seed) for seed in range(12)]
    assert checks[0].known == pytest.approx(math.pi * 0.06 * 50 / 4)  # pi L (R/d)^2 over a 50 nm band
    assert 0.001 < chi2.sf(sum(check.z**2 for check in checks), len(checks)) < 0.999


def test_the_check_knows_wrong_from_right():
    assert Check(2.004, 0.004, 2.0).passed
    assert not Check(2.04, 0.004, 2.0).passed
    assert not Check(0.0, 0.004, 2.0).passed  # the silent zero of a sensor in the wrong medium
    assert not Check(math.nan, 0.004, 2.0).passed
    assert not Check(2.0, 0.1, 2.0).passed  # too noisy to tell
    assert not Check(2.0, 0.004, 2.0, problem="died").passed


@pytest.mark.parametrize(
    ("body", "text"),
    [
        ("import os; os.abort()", "signal 6"),
        ("raise RuntimeError('no kernel')", "no kernel"),
        ("print('?')", "exit 0"),
    ],
)
def test_a_render_that_dies_is_a_finding(monkeypatch, capsys, tmp_path, body, text):
    interpreter = tmp_path / "python"
    interpreter.write_text(f"#!/bin/sh\nexec '{sys.executable}' -c \"{body}\"\n")
    interpreter.chmod(0o755)
    monkeypatch.setattr(examination.sys, "executable", str(interpreter))
    monkeypatch.setenv("LIGHTFIELD_BACKEND", "llvm")
    assert cli.main(["doctor"]) == 1
    assert text in capsys.readouterr().out.splitlines()[-1]


def test_a_wrong_number_fails(monkeypatch, capsys):
    monkeypatch.setattr(command, "check", lambda: Check(117.7, 0.2, 2.356))
    monkeypatch.setenv("LIGHTFIELD_BACKEND", "llvm")
    assert cli.main(["doctor"]) == 1
    assert capsys.readouterr().out.splitlines()[-1].startswith("FAIL")


def test_no_backend_is_an_error_with_the_remedy(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("LIGHTFIELD_BACKEND", "llvm")
    monkeypatch.setenv("LIGHTFIELD_LLVM_FOLDERS", str(tmp_path))
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    assert cli.main(["doctor"]) == 2
    captured = capsys.readouterr()
    assert captured.out.splitlines()[-1] == "FAIL: no backend"
    assert len(captured.err.splitlines()) == 1
    assert "remedy: " in captured.err
