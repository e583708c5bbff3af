"""The page: which chosen numbers decide, and which do not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.chosen.sets import GROUPS, SETS, Bundled, Set
from benchmarks.chosen.values import Chosen, other

#: What a parameter moves by less is the same, in its standard errors.
SAME = 0.5
Row = Mapping[str, Any]
TEXT = """\
# Chosen numbers: what a diagnosis says where one is half or double

Made by `python -m benchmarks.chosen`; nothing is asserted.

The diagnosis and its fits have {count} numbers that were chosen, not derived or measured
(`tests/unit/test_constants.py` holds that each says so). Each is halved and doubled here, one at a time (a
probability near one: what is left to it; a tuple: all of it), and {sets} tables of 105 readings, of direct
light written out in `sets.py`, are diagnosed; where these do not use a number, the one of
`scenes/hidden_effect`, which was rendered in full, with the scattered light that it needs. A number counts as
used where a function ran that looks it up. What was computed from it as the program started stays as it was:
where the two no longer go together the answer is an error.

| numbers | |
|---|---:|
| used by these tables | {used} |
| of them tried so far | {tried} |
| no verdict, best set or certain name changes | {calm} |
| of these a fitted parameter moves by more than {same:g} standard errors | {moving} |
| something changes | {loud} |
| a name that was not hidden becomes certain | {wrong} |

## What changes

As it is, the tables are called:

| table | hidden | verdict | best set | certain |
|---|---|---|---|---|
{now}

| number | as it is | instead | table | verdict | best set | certain |
|---|---:|---:|---|---|---|---|
{changes}

## What moves alone

Parameters of the last rung, by so many of their standard errors at most.

| number | as it is | instead | table | parameter | by |
|---|---:|---:|---|---|---:|
{moves}

## What changes nothing

{nothing}

## What these tables do not use

{unused}
"""


def page(rows: Sequence[Row], known: Sequence[Chosen]) -> str:
    """The text of the page."""
    firsts, by_label = first_rows(rows), {one.label: one for one in known}
    now = {name: sentence for row in firsts.values() for name, sentence in row["said"].items()}
    used = [label for label in group_of_each(rows) if label in by_label]
    tried = [row for row in rows if row["label"] in used]
    loud = {row["label"]: None for row in tried if any(_differs(row, now, one) for one in _tables(row))}
    wrong = {
        row["label"]: None
        for row in tried
        if any(_wrongly(row["said"][one.name], now[one.name], one) for one in _tables(row))
    }
    moves = [(row, *_moved(row, now)) for row in tried if row["label"] not in loud]
    moving = {row["label"]: None for row, by, *_ in moves if by > SAME}
    calm = [label for label in dict.fromkeys(row["label"] for row in tried) if label not in loud]
    return TEXT.format(
        count=len(known), sets=len(SETS), used=len(used), same=SAME,
        tried=len({row["label"] for row in tried}), calm=len(calm), moving=len(moving), loud=len(loud),
        wrong=len(wrong),
        now="\n".join(_as_it_is(now[one.name], one) for name in firsts for one in GROUPS[name]),
        changes="\n".join(
            _change(row, by_label[row["label"]], one)
            for row in sorted(tried, key=lambda r: (r["label"], r["factor"]))
            for one in _tables(row)
            if _differs(row, now, one)
        ) or "| none | | | | | | |",
        moves="\n".join(
            f"| {_numbers(row, by_label[row['label']])} | {table} | {path} | {by:.1f} |"
            for row, by, table, path in sorted(moves, key=lambda m: -m[1])
            if by > SAME
        ) or "| none | | | | | |",
        nothing=_listed([label for label in calm if label not in moving]),
        unused=_listed([one.label for one in known if one.label not in used]),
    )  # fmt: skip


def first_rows(rows: Sequence[Row]) -> dict[str, Row]:
    """What is said with all numbers as they are, by group."""
    return {row.get("group", "direct"): row for row in rows if row["label"] == ""}


def group_of_each(rows: Sequence[Row]) -> dict[str, str]:
    """By which group a number is tried: the first that uses it."""
    firsts = first_rows(rows)
    return {label: name for name in reversed(GROUPS) if name in firsts for label in firsts[name]["used"]}


def _tables(row: Row) -> Sequence[Set | Bundled]:
    """The tables that were diagnosed for a row."""
    return GROUPS[row.get("group", "direct")]


def _differs(row: Row, now: Row, one: Set | Bundled) -> bool:
    there, here = row["said"][one.name], now[one.name]
    return any(there[k] != here[k] for k in ("verdict", "best_set", "certain"))


def _wrongly(sentence: Row, now: Row, one: Set | Bundled) -> bool:
    return not set(sentence["certain"]) - set(now["certain"]) <= set(one.hidden)


def _moved(row: Row, here: Row) -> tuple[float, str, str]:
    """By how many standard errors a parameter of the last rung moves at most, of which table, and which."""
    most = (0.0, "", "")
    for one in _tables(row):
        before, after = here[one.name]["values"], row["said"][one.name]["values"]
        for path in before.keys() & after.keys():
            value, stderr = before[path]
            if stderr and np.isfinite(stderr):
                most = max(most, (abs(after[path][0] - value) / stderr, one.name, path))
    return most


def _as_it_is(sentence: Row, one: Set | Bundled) -> str:
    hidden = ", ".join(one.hidden) or ("a shadow" if one.name == "shadow" else "")
    return f"| {one.name} | {hidden} | {_sentence(sentence)} |"


def _sentence(sentence: Row) -> str:
    return " | ".join([sentence["verdict"], ", ".join(sentence["best_set"]), ", ".join(sentence["certain"])])


def _numbers(row: Row, one: Chosen) -> str:
    return f"`{one.label}` | {_short(one.value)} | {_short(other(one.value, row['factor']))}"


def _change(row: Row, one: Chosen, table: Set | Bundled) -> str:
    return f"| {_numbers(row, one)} | {table.name} | {_sentence(row['said'][table.name])} |"


def _short(value: Any) -> str:
    if isinstance(value, dict):
        return "; ".join(f"{k}: {_short(v)}" for k, v in value.items())
    if isinstance(value, tuple):
        return ", ".join(_short(v) for v in value)
    return f"{value:.4g}" if isinstance(value, (int, float)) else str(value)


def _listed(labels: Sequence[str]) -> str:
    """By module."""
    modules: dict[str, list[str]] = {}
    for label in labels:
        module, _, name = label.rpartition(".")
        modules.setdefault(module, []).append(name)
    return (
        "\n".join(f"- `{module}`: {', '.join(names)}" for module, names in sorted(modules.items()))
        or "Nothing."
    )
