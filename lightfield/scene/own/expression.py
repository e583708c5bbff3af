"""Formulas that anybody may have written: arithmetic over named arrays, and nothing else.

The text is parsed, never evaluated, by Python; what is not on the lists below is refused before anything is
computed, and so is what is long or deep.
"""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.errors import RuleError

#: Longest formula, in characters; most parts (numbers, names, operations) of it. Chosen: much arithmetic.
LONGEST, _MOST_PARTS = 500, 200
#: Largest number that may be written.
_LARGEST = 1e12

CONSTANTS = {"pi": math.pi, "e": math.e}
FUNCTIONS: dict[str, tuple[Callable[..., Any], int]] = {
    "exp": (np.exp, 1),
    "log": (np.log, 1),
    "sqrt": (np.sqrt, 1),
    "sin": (np.sin, 1),
    "cos": (np.cos, 1),
    "tan": (np.tan, 1),
    "atan": (np.arctan, 1),
    "tanh": (np.tanh, 1),
    "abs": (np.abs, 1),
    "min": (np.minimum, 2),
    "max": (np.maximum, 2),
    "where": (np.where, 3),
}
_TWO: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}
_ONE: dict[type[ast.unaryop], Callable[[Any], Any]] = {ast.USub: np.negative, ast.UAdd: np.positive}
_COMPARE: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
}
_RULE = (
    f"numbers, names, + - * / **, one comparison (< <= > >=) at a time, brackets, {', '.join(CONSTANTS)} and "
    f"{', '.join(FUNCTIONS)}; at most {LONGEST} characters and {_MOST_PARTS} parts"
)


@dataclass(frozen=True)
class Expression:
    """A formula.

    Raises
    ------
    RuleError
        On the first use: not a formula, or one beyond the rules.
    """

    text: str

    @cached_property
    def _tree(self) -> ast.expr:
        if len(self.text) > LONGEST:
            raise _refused(f"{len(self.text)} characters")
        if not self.text.isascii() or not self.text.isprintable():
            odd = next(c for c in self.text if not c.isascii() or not c.isprintable())
            raise _refused(f"{odd!r}, which is no plain character (U+{ord(odd):04X})")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # Python's on what is odd, and refused below
                tree = ast.parse(self.text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            raise _refused("what is no formula") from error
        parts = 0
        for node in ast.walk(tree):
            parts += isinstance(node, ast.expr)
            if parts > _MOST_PARTS:
                raise _refused(f"more than {_MOST_PARTS} parts")
            _check(node)
        return tree

    @cached_property
    def _computed(self) -> Callable[[Mapping[str, Array]], Any]:
        return _computing(self._tree)

    @cached_property
    def names(self) -> frozenset[str]:
        """Names that need a value."""
        called = {id(node.func) for node in ast.walk(self._tree) if isinstance(node, ast.Call)}
        every = (node for node in ast.walk(self._tree) if isinstance(node, ast.Name))
        return frozenset(node.id for node in every if id(node) not in called) - CONSTANTS.keys()

    def __reduce__(self) -> tuple[type[Expression], tuple[str]]:
        """Another process reads the text again: what computes it cannot be sent there."""
        return Expression, (self.text,)

    def __call__(self, values: Mapping[str, Array | float]) -> Array:
        """The formula's value, in the shape that the named values have together; not always finite.

        Parameters
        ----------
        values : mapping
            At least the `names`.
        """
        known: dict[str, Any] = {name: np.asarray(values[name], float) for name in self.names}
        with np.errstate(all="ignore"):
            return np.asarray(self._computed(CONSTANTS | known), float)


def _refused(found: str) -> RuleError:
    return RuleError(f"a formula holds {_RULE}", "write it with these alone", found=found)


def _check(node: ast.AST) -> None:
    """Refuse a part of a formula that is not on the lists."""
    if isinstance(node, ast.Constant):
        number = node.value
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise _refused(f"a value that is no number ({type(number).__name__})")
        if not -_LARGEST <= number <= _LARGEST:
            raise _refused("a number beyond 1e12")
    elif isinstance(node, ast.Call):
        called = node.func.id if isinstance(node.func, ast.Name) else ""
        if called not in FUNCTIONS or node.keywords:
            raise _refused(f"a call of {called[:40] or 'something without a name'}")
        takes = FUNCTIONS[called][1]
        if len(node.args) != takes:
            raise _refused(f"{called} with {len(node.args)} values instead of {takes}")
    elif isinstance(node, ast.Compare):
        if len(node.ops) != 1:
            raise _refused("several comparisons in a row")
    elif not isinstance(node, _ALLOWED):
        power = "^, of bits: a power is **" if isinstance(node, ast.BitXor) else None
        raise _refused(power or f"something else ({type(node).__name__})")


_ALLOWED = (ast.Name, ast.Load, ast.BinOp, ast.UnaryOp, *_TWO, *_ONE, *_COMPARE)


def _computing(node: ast.AST) -> Callable[[Mapping[str, Array]], Any]:
    """What computes a part of a formula from named values: a fit does so ten thousand times."""
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        number = np.float64(node.value)
        return lambda known: number
    if isinstance(node, ast.Name):
        return itemgetter(node.id)
    if isinstance(node, ast.UnaryOp):
        one, operand = _ONE[type(node.op)], _computing(node.operand)
        return lambda known: one(operand(known))
    if isinstance(node, ast.BinOp):
        two, left, right = _TWO[type(node.op)], _computing(node.left), _computing(node.right)
        return lambda known: two(left(known), right(known))
    if isinstance(node, ast.Compare):
        holds = _COMPARE[type(node.ops[0])]
        left, right = _computing(node.left), _computing(node.comparators[0])
        return lambda known: np.asarray(holds(left(known), right(known)), float)
    assert isinstance(node, ast.Call) and isinstance(node.func, ast.Name), "checked when it was parsed"
    function, given = FUNCTIONS[node.func.id][0], [_computing(argument) for argument in node.args]
    return lambda known: function(*[argument(known) for argument in given])
