"""Right or wrong, set by set.

A single accepted set is a claim. An effect that moves the readings by less than two sigma cannot be seen by
anyone: the right verdict is then "none". Second functional forms count as the effect they belong to.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.runs import Row
from lightfield.fitting import effects

INVISIBLE_SIGMA = 2.0
#: From here on an effect should be found.
CLEAR_SIGMA = 5.0
#: Curves that describe an unknown influence rightly: it acts by the coordinate of the curve alone.
CURVE_OF = {
    "unknown:ripple": "beam_profile", "unknown:kink": "beam_profile", "unknown:flicker": "lamp_power_curve",
}  # fmt: skip
#: In which coordinate the misfit of an unknown lies.
COORDINATE = {
    "unknown:ripple": ("angle",), "unknown:kink": ("angle",),
    "unknown:flicker": ("time",), "unknown:shadow": ("x",),
    "unknown:plume": ("plane", "x", "y", "angle"),
}  # fmt: skip


def visible(row: Row) -> bool:
    """Is there something to find?"""
    return bool((row["hidden"] or row["unknown"]) and row["delta"] >= INVISIBLE_SIGMA)


def detected(row: Row) -> bool:
    return bool(row["verdict"] in ("identified", "ambiguous", "unexplained"))


def claimed(row: Row) -> bool:
    return bool(row["verdict"] == "identified")


def is_truth(row: Row, names: Sequence[str]) -> bool:
    """Are these names, in whatever order, what was hidden?"""
    if row["any_of"]:
        return bool(names) and set(names) <= _any_of(row)
    return bool(row["hidden"]) and sorted(names) == sorted(row["hidden"])


def claim_right(row: Row) -> bool:
    """A claim of exactly the truth; an invisible truth cannot be claimed rightly."""
    return claimed(row) and visible(row) and is_truth(row, row["effects"])


def contains_truth(row: Row) -> bool:
    """Do the named effects include the true ones?"""
    if row["any_of"]:
        return bool(set(row["effects"]) & _any_of(row))
    return set(row["hidden"]) <= set(row["effects"])


def names_true(row: Row) -> bool:
    """Is every named effect a true one?"""
    return bool(row["effects"]) and set(row["effects"]) <= (_any_of(row) or set(row["hidden"]))


def _any_of(row: Row) -> set[str]:
    """Names that are right where nature follows none of the table's formulas; and curves with one in them."""
    some = set(row["any_of"])
    return some | {name for name, curve in effects.curves().items() if some & set(curve.contains)}


def family_right(row: Row) -> bool:
    """Do the named effects belong to the true families, and all of these?"""
    families = {effects.get(name).family for name in row["effects"]}
    return families == {effects.get(name).family for name in row["hidden"]}


def in_set(row: Row) -> bool:
    """Is the truth one of the accepted explanations?"""
    return any(is_truth(row, e["effects"]) for e in row.get("explanations", []))


def size(row: Row) -> int:
    """How many effects an explanation has; 0 without one."""
    return len(row["effects"]) if row["verdict"] in ("identified", "ambiguous") else 0


def coordinate_right(row: Row) -> bool:
    return row.get("coordinate") in COORDINATE.get(row["unknown"], ())


def rival_of_truth(row: Row) -> list[str]:
    """The explanation that the advised readings should tell from the truth; empty if the truth is not one."""
    pair = row["advice"]["between"]
    others = [names for names in pair if not is_truth(row, names)]
    return others[0] if len(pair) == 2 and len(others) == 1 else []


def rival_rejected(row: Row) -> bool:
    """With the advised readings: is the rival no longer part of an explanation other than the truth?"""
    rival, accepted = set(rival_of_truth(row)), row["advice"]["accepted"]
    return bool(accepted) and not any(rival <= set(names) for names in accepted if not is_truth(row, names))


def told_by_its_curve(row: Row) -> bool:
    """Is the first explanation of an unknown influence the curve that describes it, and nothing else?"""
    first = [e["effects"] for e in row.get("explanations", [])][:1]
    return row["unknown"] in CURVE_OF and first == [[CURVE_OF[row["unknown"]]]]


def outcome(row: Row) -> str:
    """One word: "right", "in set" (reported as one of several), "not seen", "unexplained",
    "one of two" or "wrong"."""
    verdict = row["verdict"]
    if verdict == "error":
        return "error"
    if not visible(row):
        return "right" if verdict == "none" else "false alarm"
    if verdict == "none":
        return "not seen"
    if row["unknown"]:
        by_its_curve = [e["effects"] for e in row.get("explanations", [])][:1] == [
            [CURVE_OF.get(row["unknown"])]
        ]
        return "right" if verdict == "unexplained" or by_its_curve else "wrong"
    if claim_right(row):
        return "right"
    if len(row["hidden"]) == 2 and size(row) == 1 and names_true(row):
        # One of two was named; the other one could not be seen beside it, or was missed.
        return "right" if row.get("second", np.inf) < INVISIBLE_SIGMA else "one of two"
    if verdict == "unexplained":
        return "unexplained"
    return "in set" if verdict == "ambiguous" and in_set(row) else "wrong"
