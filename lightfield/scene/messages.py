"""Turns everything that is wrong with a scene into a complaint each: key, value, rule, remedy."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError

from lightfield.errors import Complaint, RuleError, SceneError
from lightfield.scene.parameters import bounds, has_rule, parts_in

_RANGE_ERRORS = {"greater_than", "greater_than_equal", "less_than", "less_than_equal", "finite_number"}
#: Parts that a scene may lack, and what needs them.
ABSENT = {"tank": "walls need", "array": "a follower's detectors need", "follower": "a pose needs"}
_NUMBER_ERRORS = {"float_type", "int_type", "int_from_float"}


def scene_error(error: ValidationError, model: type[BaseModel], where: str) -> SceneError:
    """All problems of a scene as one error, one complaint each.

    Parameters
    ----------
    error : ValidationError
        As raised by pydantic.
    model : type
        Class that was being read, to name the valid keys and ranges.
    where : str
        File name or other origin.
    """
    complaints = (one for problem in error.errors() for one in _complaints(dict(problem), model))
    return SceneError.of([*complaints], where)


def absent_error(path: str, part: str) -> SceneError:
    """A parameter of a part that this scene does not have."""
    return SceneError(
        f"{path}: this scene has no {part}",
        rule=f"{ABSENT[part]} a [{part}]",
        remedy=f"add a [{part}] table to the scene",
    )


#: Of so many valid keys each is named.
_LISTED = 40
#: So alike are keys of which one may have been meant.
_ALIKE = 0.6
#: Words of the field that are no keys here, by how they begin: the key, and how it says the same.
_SAID_AS = {
    "tank.floor_albedo": ("tank.floor_over_walls", "the floor's albedo over that of the walls"),
    "tank.glass": ("tank.panes", "panes of glass with air behind"),
    "tank.end_": ("tank.end_over_walls", "the far end's albedo over that of the walls"),
    "tank.far_": ("tank.end_over_walls", "the far end's albedo over that of the walls"),
    "water.turbidity": ("water.scattering_per_m", "what is turbid scatters"),
}


def nearest_keys(path: str, valid: Iterable[str]) -> str:
    """Remedy for a key that does not exist: the nearest valid ones.

    Parameters
    ----------
    path : str
        Dotted path as written.
    valid : iterable of str
        Valid dotted paths at that place.
    """
    choices = sorted(valid)
    for word, (key, how) in _SAID_AS.items():
        if path.startswith(word) and key in choices:
            return f"did you mean {key} ({how})?"
    leaf = path.rpartition(".")[2]
    leaves = {c: c.rpartition(".")[2] for c in choices}
    near = [c for c in choices if leaves[c] == f"{leaf}s"]
    near = near or [c for c in choices if leaves[c].startswith(f"{leaf}_") or leaves[c].endswith(f"_{leaf}")]
    # A part that both have in front does not make two keys alike.
    alike = [c for c in choices if difflib.SequenceMatcher(None, leaves[c], leaf).ratio() >= _ALIKE]
    near = near or difflib.get_close_matches(path, alike, n=1, cutoff=_ALIKE)
    if near:
        return f"did you mean {' or '.join(near[:3])}?"
    if len(choices) > _LISTED:  # of all the parameters of a scene, the parts
        choices = sorted({f"{c.partition('.')[0]}.…" for c in choices})
    return f"valid here are {', '.join(choices)}" if choices else "remove it"


def _complaints(problem: Mapping[str, Any], model: type[BaseModel]) -> list[Complaint]:
    owner, keys = _walk(model, tuple(problem["loc"]))
    path, kind, value = ".".join(keys), str(problem["type"]), problem.get("input")
    if kind == "extra_forbidden":
        prefix = "".join(f"{key}." for key in keys[:-1])
        valid = [prefix + name for name in owner.model_fields]
        return [Complaint("unknown key", value, "only known keys", nearest_keys(path, valid), path)]
    rule, remedy = _rule(problem, owner, keys)
    if isinstance(error := problem.get("ctx", {}).get("error"), RuleError):
        if error.about:
            return [replace(one, key=path or "scene") for one in error.about]
        value, what = error.found, "not possible"
    elif kind == "missing":
        value, what = None, "missing"
    else:
        what = "wrong value" if value is not None else "no value"
    return [Complaint(what if path else f"the scene as a whole is {what}", value, rule, remedy, path)]


def _walk(model: type[BaseModel], loc: tuple[Any, ...]) -> tuple[type[BaseModel], list[str]]:
    """The class that owns the last key, and the keys as written in the file (union tags dropped)."""
    keys: list[str] = []
    owner: type[BaseModel] = model
    current: Any = model
    for part in loc:
        if " " in str(part):  # which way a curve was written in: no key of the file
            continue
        classes = list(dict.fromkeys(parts_in(current)))
        tagged = [c for c in classes if part in _tags(c)]
        if len(classes) > 1 and tagged:
            current = tagged[0]
            continue
        keys.append(str(part))
        if get_origin(current) is dict:  # of parameters by their names
            current = get_args(current)[1]
            continue
        if len(classes) == 1:
            owner = classes[0]
            if isinstance(part, int):  # one of several
                continue
            field = owner.model_fields.get(str(part))
            current = field.annotation if field is not None else None
    return owner, keys


def _tags(model: type[BaseModel]) -> tuple[str, ...]:
    field = model.model_fields.get("type")
    return tuple(getattr(field.annotation, "__args__", ())) if field is not None else ()


def _rule(problem: Mapping[str, Any], owner: type[BaseModel], keys: list[str]) -> tuple[str, str]:
    kind, context = str(problem["type"]), problem.get("ctx", {})
    name = next((key for key in reversed(keys) if not key.isdigit()), "")
    field = owner.model_fields.get(name)
    meaning = field.description if field is not None and field.description else name
    if kind in _RANGE_ERRORS | _NUMBER_ERRORS and field is not None:
        extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        unit = str(extra.get("unit", "1"))
        sort = "a whole number" if field.annotation is int else "a number"
        remedy = "a value in that range" if kind in _RANGE_ERRORS else f"{sort} without quotes or unit"
        if keys[-1] != name:
            return f"{_message(problem)} ({unit}): {meaning}", f"write {remedy}"
        return f"{sort} {_interval(owner, name)} ({unit}): {meaning}", f"write {name} = {remedy}"
    if kind == "literal_error":
        return f"one of {context['expected']}", f"choose one of them: {meaning}"
    if kind.startswith("union_tag"):
        return (
            f"type is one of {context.get('expected_tags', 'the phase functions')}",
            "set type to one of them",
        )
    if isinstance(error := context.get("error"), RuleError):
        return error.rule, error.remedy or f"change {'.'.join(keys)}"
    if kind in {"model_type", "model_attributes_type"}:
        return "a table of keys", f"write it as [{'.'.join(keys)}]" if keys else "give keys and values"
    if kind == "missing":
        if keys[-1] != name and field is not None:
            return f"{meaning}: more values than these", f"write {name} = [..., ...]"
        return f"{meaning} has no default", f"add {name}"
    if kind == "tuple_type":
        if isinstance(problem.get("input"), dict):
            return "a list of tables", f"write [[{'.'.join(keys)}]], with two brackets, before each"
        inner = "[..., ...]" if keys[-1] == name else "[[..., ...]]"  # an item of a list of lists
        return "a list of values", f"write {name} = {inner}: {meaning}"
    return _message(problem), f"correct it: {meaning}"


def _message(problem: Mapping[str, Any]) -> str:
    return str(problem["msg"]).removeprefix("Input should be ").removeprefix("a valid ")


def _interval(owner: type[BaseModel], name: str) -> str:
    low, high = bounds(owner, name)
    words = []
    if low > -float("inf"):
        words.append(f"{'>' if has_rule(owner, name, 'gt') else '>='} {low:g}")
    if high < float("inf"):
        words.append(f"{'<' if has_rule(owner, name, 'lt') else '<='} {high:g}")
    return " and ".join(words) or "that is finite"
