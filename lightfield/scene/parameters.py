"""How one number of a scene is declared: unit, meaning, range and neutral value, once."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo

FOLDER_KEY = "folder"


class Part(BaseModel):
    """Immutable piece of a scene: unknown keys are errors, numbers are finite, text is never a number."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, validate_default=False)


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
    *,
    low: float | None = None,
    high: float | None = None,
    above: float | None = None,
    below: float | None = None,
    neutral: float | None = None,
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
    low, high : float, optional
        Inclusive range.
    above, below : float, optional
        Exclusive range.
    neutral : float, optional
        Value that switches the effect off.
    """
    extra: dict[str, Any] = {"unit": unit}
    if neutral is not None:
        extra["neutral"] = neutral
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


def numbers_of(part: BaseModel, prefix: str = "") -> Iterator[Parameter]:
    """Every scalar number of a part and of the parts inside it, with dotted path.

    Parameters
    ----------
    part : BaseModel
        Scene or piece of one.
    prefix : str
        Path of the part, ending with a dot, or empty.
    """
    for name, field in type(part).model_fields.items():
        value = getattr(part, name)
        if isinstance(value, BaseModel):
            yield from numbers_of(value, f"{prefix}{name}.")
            continue
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
            open_ends=(_has(type(part), name, "gt"), _has(type(part), name, "lt")),
        )


def _has(model: type[BaseModel], name: str, rule: str) -> bool:
    return any(getattr(found, rule, None) is not None for found in model.model_fields[name].metadata)


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


def _resolve(value: str, info: ValidationInfo) -> str:
    """A table's path as an absolute path, taken from the scene file's folder."""
    folder = (info.context or {}).get(FOLDER_KEY, os.curdir)
    path = Path(os.path.abspath(Path(folder, value).expanduser()))
    if not path.is_file():
        raise ValueError(f"no such file: {path}; remedy: give a path relative to the scene file")
    return str(path)


TablePath = Annotated[str, AfterValidator(_resolve)]
