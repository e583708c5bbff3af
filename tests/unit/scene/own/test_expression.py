"""Formulas of anybody: right where they are formulas, and one clear refusal of everything else."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

from lightfield.errors import RuleError
from lightfield.scene.own.expression import CONSTANTS, FUNCTIONS, LONGEST, Expression

X, Y = np.array([-1.5, 0.3, 2.0]), np.array([0.7, -0.2, 4.0])

#: As written here, and as NumPy says it.
KNOWN = {
    "1": np.ones(()),
    "x": X,
    "1 - 0.5*exp(-((x - 0.2)/0.1)**2)": 1 - 0.5 * np.exp(-(((X - 0.2) / 0.1) ** 2)),
    "-x**2": -(X**2),
    "2**-x + +y": 2.0**-X + Y,
    "(x > 0)*y + (x <= 0)": np.where(X > 0, Y, 1.0),
    "where(x < y, min(x, 1), max(y, 0))": np.where(X < Y, np.minimum(X, 1), np.maximum(Y, 0)),
    "sin(2*pi*x)/cos(y) + tan(x) + atan(y)": np.sin(2 * np.pi * X) / np.cos(Y) + np.tan(X) + np.arctan(Y),
    "tanh(x) + abs(y) + sqrt(abs(x)) + log(e)": np.tanh(X) + np.abs(Y) + np.sqrt(np.abs(X)) + 1,
    "  1e3*x / 7  ": 1e3 * X / 7,
}


@pytest.mark.parametrize("text", KNOWN)
def test_a_formula_says_what_it_says(text: str) -> None:
    np.testing.assert_allclose(Expression(text)({"x": X, "y": Y}), KNOWN[text], rtol=1e-14)


def test_names_are_those_that_need_a_value() -> None:
    assert Expression("depth*exp(-x) + pi*where(x > x0, 1, e)").names == {"depth", "x", "x0"}


def test_what_has_no_value_is_no_error_of_python() -> None:
    """Whoever asks for the value looks at whether it is finite."""
    for text in ("1/0", "log(0 - 1)", "9**9**9**9", "0*1e12**1e12", "(0 - 8)**0.5", "exp(1e9)"):
        assert not np.isfinite(Expression(text)({})).all(), text


HOSTILE = [
    "",
    " ",
    "1 +",
    "x = 1",
    "x; y",
    "import os",
    "__import__('os').system('true')",
    "().__class__.__bases__[0].__subclasses__()",
    "x.real",
    "x[0]",
    "[1][0]",
    "(1, 2)",
    "{1: 2}",
    "{x for x in y}",
    "[x for x in (1, 2)]",
    "lambda: 1",
    "(lambda: 1)()",
    "exp",
    "exp()",
    "exp(1, 2)",
    "exp(x=1)",
    "exp(*x)",
    "exp(**x)",
    "exp(exp)(1)",
    "open('x')",
    "eval('1')",
    "print(1)",
    "'text'",
    "b'text'",
    "f'{x}'",
    "True",
    "None",
    "...",
    "1j",
    "1e999",
    "99999999999999999999999999999",
    "x if y else 1",
    "x and y",
    "not x",
    "~1",
    "1 << 9",
    "7 % 2",
    "7 // 2",
    "x @ y",
    "1 < x < 2",
    "x == 1",
    "x is 1",
    "x in y",
    "(x := 1)",
    "await x",
    "yield",
    "x!",
    "é",
    "\u202e1",
    "1\x00",
    "1 # remark\n",
    "(" * 240 + "1" + ")" * 240,
    "-" * 400 + "1",
    "+".join("x" * 120) + "+" + "*".join("x" * 120),
    "1" * (LONGEST + 1),
]


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_what_is_no_formula_is_refused_in_one_way(text: str) -> None:
    if text == "exp":  # a name like any other, which nobody gives a value
        assert Expression(text).names == {"exp"}
        return
    with pytest.raises(RuleError, match=r"a formula holds numbers, .*; found "):
        Expression(text).names  # noqa: B018  asked for on the first use


def test_random_formulas_are_computed_or_refused() -> None:
    """Ten thousand strings of parts of formulas and of Python, right and wrong."""
    words = [
        "x",
        "y",
        "__class__",
        "0",
        "1.5",
        "1e12",
        "1e-300",
        "2",
        "+",
        "-",
        "*",
        "/",
        "**",
        "<",
        ">=",
        "(",
        ")",
        "(",
        ")",
        ",",
        ".",
        "[",
        "]",
        "lambda",
        "import",
        "if",
        ":",
        "=",
        "'",
    ]
    parts = [*FUNCTIONS, *CONSTANTS, *words, " ", "\\"]
    rng = np.random.default_rng(11)
    computed = 0
    for _ in range(10_000):
        text = "".join(rng.choice(parts, rng.integers(1, 14)))
        formula = Expression(text)
        try:
            names = formula.names
        except RuleError:
            continue
        if names <= {"x", "y"}:
            value = formula({"x": X, "y": Y})
            assert value.dtype == float and value.shape in ((), (3,))
            computed += 1
    assert computed > 100


def test_one_that_was_computed_can_be_sent_to_another_process() -> None:
    formula = Expression("1 - 0.5*exp(-x**2)")
    before = formula({"x": X})
    for again in (pickle.loads(pickle.dumps(formula)), copy.deepcopy(formula)):
        assert again == formula
        np.testing.assert_array_equal(again({"x": X}), before)
