"""How one number of a scene is declared: unit, meaning, range and neutral value, once."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache, reduce
from operator import attrgetter, or_
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, model_validator
from pydantic_core import to_jsonable_python

from lightfield.errors import RuleError
from lightfield.scene.acts import Acts

if TYPE_CHECKING:
    from typing_extensions import Self

FOLDER_KEY = "folder"
AnyPart = TypeVar("AnyPart", bound=BaseModel)
_Inside = tuple[str, tuple[tuple[str, str], ...]]


class Part(BaseModel):
    """Immutable piece of a scene: unknown keys are errors, numbers are finite, text is never a number."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, validate_default=False)
    #: Fields that name a table, and the field that says "table" where it is used.
    tables_of: ClassVar[Mapping[str, str]] = {}

    @model_validator(mode="before")
    @classmethod
    def _a_table_that_is_named_is_meant(cls, data: Any) -> Any:
        """Where nothing else is said."""
        if not isinstance(data, Mapping):
            return data
        meant = {use: "table" for name, use in cls.tables_of.items() if data.get(name) is not None}
        return {**meant, **data}

    @property
    def tables(self) -> list[Path]:
        """Files that are read with it, and with the parts inside it."""
        found: list[Path] = []
        for name in _of_tables(type(self)):
            value = getattr(self, name)
            found += (
                value.tables if isinstance(value, Part) else [Path(value)] if isinstance(value, str) else []
            )
        return found

    def __copy__(self) -> Self:
        """As pydantic's own, of what a part has: fields and nothing else. A fit makes some 100,000 copies."""
        made, put = type(self).__new__(type(self)), object.__setattr__  # it is frozen once it is made
        put(made, "__dict__", self.__dict__.copy())
        put(made, "__pydantic_fields_set__", self.__pydantic_fields_set__.copy())
        put(made, "__pydantic_extra__", None)
        put(made, "__pydantic_private__", None)
        return made


@dataclass(frozen=True)
class Parameter:
    """One scalar of a scene, as fits, sweeps and plots see it."""

    path: str
    unit: str
    meaning: str
    low: float
    high: float
    neutral: float | None
    value: float
    open_ends: tuple[bool, bool] = (False, False)

    def allows(self, value: float) -> bool:
        """Is the value within the range, whose ends may not belong to it?"""
        above = value > self.low if self.open_ends[0] else value >= self.low
        return above and (value < self.high if self.open_ends[1] else value <= self.high)

    @property
    def range(self) -> str:
        """The range in words."""
        words = ["above " if self.open_ends[0] else "", f"{self.low:g} to "]
        return "".join([*words, "below " if self.open_ends[1] else "", f"{self.high:g}"])


def number(
    default: Any,
    unit: str,
    meaning: str,
    acts_on: Acts,
    *,
    low: float | None = None,
    high: float | None = None,
    above: float | None = None,
    below: float | None = None,
    neutral: float | None = None,
    later: bool = False,
    only_for: tuple[str, ...] = (),
) -> Any:
    """Declare a number.

    Parameters
    ----------
    default : float, int, None or ...
        Default value; `...` means the number must be given.
    unit : str
        Unit as printed, "1" for a ratio.
    meaning : str
        One clause for people.
    acts_on : Acts
        What of the way from the lamp to a reading it changes.
    low, high : float, optional
        Inclusive range.
    above, below : float, optional
        Exclusive range.
    neutral : float, optional
        Value that switches the effect off.
    later : bool
        The first scenes did not have it, and were what they are with it at its default: see `drop_later`.
    only_for : tuple of str
        The field that holds a choice, and those choices beside which alone the number counts.
    """
    extra = _extra(acts_on, unit, neutral, later, only_for)
    return Field(
        default,
        description=meaning,
        ge=low,
        le=high,
        gt=above,
        lt=below,
        strict=True,
        json_schema_extra=extra,
    )


def declare(
    default: Any,
    meaning: str,
    acts_on: Acts,
    *,
    unit: str | None = None,
    neutral: Any = None,
    later: bool = False,
) -> Any:
    """Declare what is no single number: a word, a list, a file; arguments as for `number`."""
    return Field(default, description=meaning, json_schema_extra=_extra(acts_on, unit, neutral, later))


def _extra(
    acts_on: Acts, unit: str | None, neutral: Any, later: bool, only_for: tuple[str, ...] = ()
) -> dict[str, Any]:
    """What is kept with a field beside its type and range, as a JSON Schema shows it."""
    given = {"unit": unit, "neutral": neutral, "later": later or None, "only_for": [*only_for] or None}
    names = [str(stage.name).lower() for stage in Acts if stage in acts_on]
    return {**{key: value for key, value in given.items() if value is not None}, "acts_on": names}


@cache
def acts_of(model: type[BaseModel], name: str) -> Acts:
    """What a field acts on; nothing, where it is not declared (names and descriptions)."""
    extra = model.model_fields[name].json_schema_extra
    stages = extra.get("acts_on") if isinstance(extra, dict) else None
    named = stages if isinstance(stages, list) else []
    return reduce(or_, (Acts[str(stage).upper()] for stage in named), Acts(0))


@cache
def fields_on(model: type[BaseModel], what: Acts) -> tuple[str, ...]:
    """Names of the fields of a part that act on any of these stages."""
    return tuple(name for name in model.model_fields if acts_of(model, name) & what)


@cache
def neutral_of(model: type[BaseModel]) -> dict[str, Any]:
    """Values that switch fields of a part off, by name; of those that have one."""
    extras = {name: field.json_schema_extra for name, field in model.model_fields.items()}
    return {n: e["neutral"] for n, e in extras.items() if isinstance(e, dict) and "neutral" in e}


@cache
def _switches(model: type[BaseModel], what: Acts) -> tuple[Callable[[Any], Any], Any]:
    """Reads the fields that act on any of these stages and have a neutral value; and these values."""
    neutral = {n: v for n, v in neutral_of(model).items() if acts_of(model, n) & what}
    if not neutral:
        return (lambda part: ()), ()
    return attrgetter(*neutral), tuple(neutral.values()) if len(neutral) > 1 else next(iter(neutral.values()))


def switched_off(part: BaseModel, what: Acts) -> bool:
    """Is every field of a part that acts on any of these stages, and has a neutral value, at it?"""
    read, neutral = _switches(type(part), what)
    return bool(read(part) == neutral)


def numbers_of(
    part: BaseModel, prefix: str = "", absent: Mapping[str, float] = MappingProxyType({})
) -> Iterator[Parameter]:
    """Every scalar number of a part and of the parts inside it, with dotted path.

    Parameters
    ----------
    part : BaseModel
        Scene or piece of one.
    prefix : str
        Path of the part, ending with a dot, or empty.
    absent : mapping of str to float
        What numbers that were not given come to, by dotted path.
    """
    for name, field in type(part).model_fields.items():
        value = getattr(part, name)
        if isinstance(value, BaseModel):
            yield from numbers_of(value, f"{prefix}{name}.", absent)
            continue
        value = absent.get(f"{prefix}{name}") if value is None else value
        extra = field.json_schema_extra
        if not isinstance(extra, dict) or "unit" not in extra or not isinstance(value, int | float):
            continue
        low, high = bounds(type(part), name)
        neutral = extra.get("neutral")
        yield Parameter(
            path=f"{prefix}{name}",
            unit=str(extra["unit"]),
            meaning=field.description or "",
            low=low,
            high=high,
            neutral=float(neutral) if isinstance(neutral, int | float) else None,
            value=float(value),
            open_ends=(has_rule(type(part), name, "gt"), has_rule(type(part), name, "lt")),
        )


def with_fields(part: AnyPart, values: Mapping[str, Any]) -> AnyPart:
    """A part with other values, which are not checked.

    Parameters
    ----------
    part : BaseModel
        Scene or piece of one.
    values : mapping of str to value
        By dotted path.

    Raises
    ------
    KeyError
        With the path that the part has nothing at.
    """
    own, inside = _by_part(type(part), tuple(values))
    update = {name: values[name] for name in own}
    for name, its in inside:
        try:
            update[name] = with_fields(
                update.get(name, getattr(part, name)), {rest: values[path] for rest, path in its}
            )
        except KeyError as error:
            raise KeyError(f"{name}.{error.args[0]}") from None
    return part.model_copy(update=update) if update else part


@lru_cache(maxsize=4096)
def _by_part(model: type[BaseModel], paths: tuple[str, ...]) -> tuple[tuple[str, ...], tuple[_Inside, ...]]:
    """Names of own fields among some paths; and names of parts, each with the rest of its paths and these."""
    own, inside = list[str](), dict[str, list[tuple[str, str]]]()
    for path in paths:
        name, within, rest = path.partition(".")
        if name not in _names(model):
            raise KeyError(path)
        if within:
            inside.setdefault(name, []).append((rest, path))
        else:
            own.append(name)
    return tuple(own), tuple((name, tuple(its)) for name, its in inside.items())


def drop_later(part: BaseModel, data: dict[str, Any]) -> None:
    """Leave out of what a part dumped as JSON what the first scenes did not have, where it is at its default.

    Their digests, and with them what was kept under these, stay as they are.

    Parameters
    ----------
    part : BaseModel
        Scene or piece of one.
    data : dict
        What it dumped, changed in place.
    """
    later = _later(type(part))
    for name in [name for name in data if name in later and data[name] == later[name]]:
        del data[name]
    for name, inner in _inside(part, data):
        drop_later(inner, data[name])


def change_tables(part: BaseModel, data: dict[str, Any], change: Callable[[str], str]) -> None:
    """Put something else in the place of the path of every table that a part dumped; as `drop_later`."""
    for name in _tables(type(part)) & data.keys():
        if data[name]:
            data[name] = change(data[name])
    for name, inner in _inside(part, data):
        change_tables(inner, data[name], change)


def _inside(part: BaseModel, data: Mapping[str, Any]) -> list[tuple[str, BaseModel]]:
    """Parts of a part that it dumped."""
    values = ((name, getattr(part, name)) for name in data)
    return [(name, value) for name, value in values if isinstance(value, BaseModel)]


@cache
def _later(model: type[BaseModel]) -> dict[str, Any]:
    """Fields that the first scenes did not have, with their defaults as JSON has them."""
    fields, extras = model.model_fields, {n: f.json_schema_extra for n, f in model.model_fields.items()}
    later = [name for name, extra in extras.items() if isinstance(extra, dict) and extra.get("later")]
    return {name: to_jsonable_python(fields[name].get_default()) for name in later}


@cache
def _tables(model: type[BaseModel]) -> frozenset[str]:
    """Fields that hold the path of a table, also those that may hold none."""
    _, rule = get_args(TablePath)
    fields = model.model_fields.items()
    return frozenset(n for n, f in fields if rule in f.metadata or TablePath in get_args(f.annotation))


@cache
def _of_tables(model: type[BaseModel]) -> tuple[str, ...]:
    """Fields that hold the path of a table, or a part that may hold one."""
    of_parts = {n for n, f in model.model_fields.items() if any(map(_of_tables, parts_in(f.annotation)))}
    return tuple(name for name in model.model_fields if name in _tables(model) | of_parts)


def parts_in(annotation: Any) -> list[type[BaseModel]]:
    """Classes of parts that a field may hold."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [part for one in get_args(annotation) for part in parts_in(one)]


@cache
def _names(model: type[Any]) -> frozenset[str]:
    """Fields of a part; what is no part has none."""
    return frozenset(model.model_fields if issubclass(model, BaseModel) else ())


def has_rule(model: type[BaseModel], name: str, rule: str) -> bool:
    """Is a field declared with a rule, as "gt"?"""
    return any(getattr(found, rule, None) is not None for found in model.model_fields[name].metadata)


def told(part: BaseModel, name: str) -> str:
    """A value as an error names it: `depth_m = 2.44`, and whether that is only the default."""
    value = getattr(part, name)
    shown = f"{value:g}" if isinstance(value, int | float) else value
    return f"{name} = {shown}{'' if name in part.model_fields_set else ' (its default)'}"


def bounds(model: type[BaseModel], name: str) -> tuple[float, float]:
    """Lowest and highest value of a number, infinite where it has no limit.

    Parameters
    ----------
    model : type
        Class that declares the number.
    name : str
        Field name.
    """
    low, high = -float("inf"), float("inf")
    for rule in model.model_fields[name].metadata:
        for attribute in ("ge", "gt"):
            low = max(low, getattr(rule, attribute, low))
        for attribute in ("le", "lt"):
            high = min(high, getattr(rule, attribute, high))
    return low, high


def without_minus_zero(value: Any) -> Any:
    """-0.0 is the same scene as 0.0."""
    if isinstance(value, dict):
        return {key: without_minus_zero(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [without_minus_zero(inner) for inner in value]
    return value + 0.0 if isinstance(value, float) else value


def _resolve(value: str, info: ValidationInfo) -> str:
    """A table's path as an absolute path, taken from the scene file's folder."""
    folder = (info.context or {}).get(FOLDER_KEY, os.curdir)
    path = Path(os.path.abspath(Path(folder, value).expanduser()))
    if not path.is_file():
        raise RuleError("a file that exists", "give a path relative to the scene file", found=str(path))
    return str(path)


TablePath = Annotated[str, AfterValidator(_resolve)]
Nanometres = Annotated[float, Field(strict=True, ge=200.0, le=2000.0)]
