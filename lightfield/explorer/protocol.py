"""What page and server say to each other: requests as JSON, answers as JSON or as numbers in binary.

A binary answer is the length of its head (4 bytes, little endian), the head (JSON, padded with spaces to a
multiple of 4 bytes), and arrays of 32-bit floats, one after the other, whose names and shapes the head lists.
"""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, TypeAdapter, ValidationError

from lightfield.arrays import Array, jsonable
from lightfield.errors import UsageError
from lightfield.scene.own.own_effect import Name, Stage

#: A request is at most so many bytes; one that brings a file, so many. Chosen: a reading table of 20 000 rows
#: has two megabytes.
_MOST_BYTES, MOST_FILE_BYTES = 100_000, 10_000_000
#: Numbers that are set at once, files that are dropped at once.
_MOST_VALUES, _MOST_FILES = 100, 200

SentNumber = Annotated[float, Field(strict=True, ge=-1e12, le=1e12, allow_inf_nan=False)]
EffectOrPath = Annotated[str, Field(max_length=120)]
Title = Annotated[str, Field(min_length=1, max_length=60)]


class _Request(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)
    id: Annotated[int, Field(ge=0, le=2**53)]


class View(_Request):
    """Show a plane of the maps, at one of the wavelengths that were read."""

    do: Literal["view"]
    plane: Annotated[int, Field(ge=0, le=1000)]
    channel: Annotated[int, Field(ge=0, le=10_000)] = 0


class Set(_Request):
    """Set parameters; `done` when the hand has left the slider."""

    do: Literal["set"]
    values: Annotated[dict[EffectOrPath, SentNumber], Field(max_length=_MOST_VALUES)]
    done: bool = False


class Switch(_Request):
    """Switch an effect on or off, or to another form."""

    do: Literal["switch"]
    effect: EffectOrPath
    on: bool


class Plain(_Request):
    """What needs nothing more."""

    do: Literal["fit", "undo", "redo", "diagnose", "report", "trace", "cancel", "survey"]


class At(_Request):
    """Go to a state of the history, a rung of the ladder, or an explanation of the verdict."""

    do: Literal["state", "rung", "accept"]
    at: Annotated[int, Field(ge=0, le=100_000)]


class Named(_Request):
    """Give the state a name, or go back to one that has it."""

    do: Literal["keep", "restore"]
    name: Title


class OwnNumber(BaseModel):
    """A parameter of a formula of the user's own."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    name: Name
    low: SentNumber
    high: SentNumber
    neutral: SentNumber | None = None
    unit: Annotated[str, Field(max_length=20)] = "1"


class Own(_Request):
    """An effect of the user's own."""

    do: Literal["own"]
    name: Name
    stage: Stage
    formula: Annotated[str, Field(max_length=500)]
    parameters: Annotated[list[OwnNumber], Field(min_length=1, max_length=8)]


def _decoded(text: object) -> bytes:
    if not isinstance(text, str):
        raise ValueError("bytes in base 64")
    return base64.b64decode(text, validate=True)  # raises a ValueError


class File(BaseModel):
    """A dropped file: its name, which is no path, and its bytes; instruments write more than text."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    name: Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^/\\\x00-\x1f]+$")]
    content: Annotated[bytes, BeforeValidator(_decoded), Field(max_length=MOST_FILE_BYTES)]


class Drop(_Request):
    """Files that were dropped into the page."""

    do: Literal["drop"]
    files: Annotated[list[File], Field(min_length=1, max_length=_MOST_FILES)]
    units: Annotated[str, Field(max_length=40)] = ""


Request = View | Set | Switch | Plain | At | Named | Own | Drop
_ADAPTER: TypeAdapter[Request] = TypeAdapter(Annotated[Request, Field(discriminator="do")])


def read_request(message: str | bytes) -> Request:
    """A request from what the page sent.

    Raises
    ------
    UsageError
        Not one: what is wrong, in one line.
    """
    if isinstance(message, bytes):
        raise UsageError("not a request", found="bytes", rule="JSON text")
    try:
        given = json.loads(message, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise UsageError("not a request", found=message[:60], rule="JSON text") from error
    if not (isinstance(given, dict) and given.get("do") == "drop") and len(message) > _MOST_BYTES:
        raise UsageError("a request is too large", found=len(message), rule=f"at most {_MOST_BYTES} bytes")
    try:
        return _ADAPTER.validate_python(given)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise UsageError("not a request", where=where[:100] or None, rule=first["msg"]) from error


def _no_number(name: str) -> float:
    raise ValueError(f"{name} is no number")


def request_id(message: str | bytes) -> int | None:
    """The number of a request that may be malformed."""
    try:
        given = json.loads(message)
        found = given.get("id") if isinstance(given, dict) else None
        return found if isinstance(found, int) else None
    except (ValueError, RecursionError):
        return None


def pack(head: Mapping[str, object], arrays: Mapping[str, Array]) -> bytes:
    """A binary answer."""
    listed = [[name, list(array.shape)] for name, array in arrays.items()]
    text = json.dumps(jsonable({**head, "arrays": listed}), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    body = b"".join(np.ascontiguousarray(array, "<f4").tobytes() for array in arrays.values())
    return struct.pack("<I", len(text)) + text + body
