"""A scene: everything that is known about an experiment, immutable, addressed by dotted paths."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import BaseModel, Field, ValidationError, ValidationInfo, model_validator

from lightfield.errors import RuleError, SceneError, brief
from lightfield.scene.detector import Detector
from lightfield.scene.follower import DetectorArray, Follower
from lightfield.scene.in_tank import (
    check_all_inside,
    follower_in,
    mirrors_follow,
    plane_size_m,
    room_for_lamp_m,
    water_in,
)
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.listed import OWN_FIELD, is_listed, listed_parameters, listed_value, with_listed
from lightfield.scene.messages import ABSENT, absent_error, nearest_keys, scene_error
from lightfield.scene.own.own_effect import MOST_EFFECTS, OwnEffect
from lightfield.scene.parameters import (
    FOLDER_KEY,
    Parameter,
    Part,
    change_tables,
    drop_later,
    numbers_of,
    with_fields,
    without_minus_zero,
)
from lightfield.scene.tank import Tank
from lightfield.scene.water.coefficients import clearest_in
from lightfield.scene.water.water import Water
from lightfield.storage import inputs, toml
from lightfield.storage.files import write_text

#: So many changed values are named in an error.
_NAMED = 3
_LIGHTLESS = {"array", "follower"}  #: Parts that change nothing of the light.
#: What a scene is called in errors while it is made; None: who makes it says so himself.
_WHERE = "where"


class Scene(Part):
    """Lamp, water, tank and detector of one experiment."""

    name: str = Field("", description="short name, for titles")
    description: str = Field("", description="free text")
    lamp: Lamp = Field(default_factory=Lamp, description="the source")
    water: Water = Field(default_factory=Water, description="the medium")
    tank: Tank | None = Field(None, description="the box; absent: unbounded water")
    detector: Detector = Field(default_factory=Detector, description="the receivers")
    array: DetectorArray | None = Field(None, description="the follower's detectors; absent: none")
    follower: Follower | None = Field(None, description="where they are; absent: on the axis")
    effect: tuple[OwnEffect, ...] = Field(
        (), max_length=MOST_EFFECTS, description="hypotheses of one's own", json_schema_extra={"later": True}
    )

    @model_validator(mode="after")
    def _effects_have_names(self) -> Scene:
        names = [effect.name for effect in self.effect]
        for name, count in Counter(names).items():
            if count > 1:
                at = [k for k, other in enumerate(names, 1) if other == name]
                raise RuleError(
                    "each [[effect]] has a name of its own", "rename all of them but one",
                    found={"name": name, "tables": at},
                )  # fmt: skip
        return self

    @model_validator(mode="after")
    def _slab_is_in_the_tank(self) -> Scene:
        """Where nobody says where it is."""
        self.__dict__["water"] = water_in(self.water, self.tank)
        return self

    @model_validator(mode="after")
    def _all_is_in_the_tank(self) -> Scene:
        check_all_inside(self.detector, self.lamp, self.follower, self.tank)
        return self

    @model_validator(mode="after")
    def _water_never_amplifies(self) -> Scene:
        """Less absorption than the base has is possible, less than none is not."""
        if self.water.absorption_per_m >= 0:
            return self
        try:
            at_nm, least = clearest_in(self.water, self.detector.bands_read_nm)
        except SceneError as error:
            raise RuleError.of(error) from error
        if least < 0:
            raise RuleError(
                f"with what the base absorbs it is >= 0 (1/m) at every wavelength; at {at_nm:g} nm it is "
                f"{least:.3g}",
                f"write at least {math.ceil(1e4 * (self.water.absorption_per_m - least)) / 1e4:.4f}",
                found={"water.absorption_per_m": self.water.absorption_per_m},
            )
        return self

    # The last, so that it hears of what all others find.
    @model_validator(mode="wrap")
    @classmethod
    def _told(cls, data: Any, read: Callable[[Any], Scene], info: ValidationInfo) -> Scene:
        """Whoever makes a scene hears in one sentence what is wrong with it."""
        where = (info.context or {}).get(_WHERE, "scene")
        try:
            return read(data)
        except ValidationError as error:
            if where is None:  # there are better words
                raise
            raise scene_error(error, cls, where) from None

    # -- files ---------------------------------------------------------------------------------

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scene:
        """Read a scene file; tables named in it are looked for next to it.

        Parameters
        ----------
        path : path-like
            TOML file.

        Raises
        ------
        SceneError
            Not readable, not TOML, or not a scene: all problems at once.
        """
        source = Path(path)
        text = inputs.read_utf8(source, inputs.SCENE, "TOML")
        if all(not line.strip() or line.lstrip().startswith("#") for line in text.splitlines()):
            raise SceneError(
                "the file says nothing",
                where=str(path),
                rule="at least one of [lamp], [water], [tank], [detector]",
                remedy="write what is known; the rest has defaults",
            )
        return cls.from_toml(text, where=str(path), folder=source.parent)

    @classmethod
    def from_toml(cls, text: str, *, where: str = "scene", folder: str | os.PathLike[str] = ".") -> Scene:
        """Scene from TOML text.

        Parameters
        ----------
        text : str
            TOML.
        where : str
            Name of the origin in errors.
        folder : path-like
            Folder that relative table paths start from.

        Raises
        ------
        SceneError
            Not TOML, or not a scene.
        """
        try:
            data = toml.loads(text)
        except ValueError as error:
            raise SceneError(f"not TOML: {error}", where=where, remedy="correct that line") from error
        return cls.from_dict(data, where=where, folder=folder)

    @classmethod
    def from_dict(
        cls, data: Mapping[str, Any], *, where: str = "scene", folder: str | os.PathLike[str] = "."
    ) -> Scene:
        """Scene from nested dictionaries, as TOML or JSON give them.

        Parameters
        ----------
        data : mapping
            Nested values.
        where : str
            Name of the origin in errors.
        folder : path-like
            Folder that relative table paths start from.

        Raises
        ------
        SceneError
            Not a scene.
        """
        return cls.model_validate(data, context={FOLDER_KEY: os.fspath(folder), _WHERE: where})

    def to_dict(self) -> dict[str, Any]:
        """What was said about the scene, without what was left at its default."""
        return dict(self.model_dump(mode="json", exclude_unset=True, exclude_none=True))

    def to_toml(self) -> str:
        """The scene as TOML; `from_toml` gives the same scene back."""
        return tomli_w.dumps(self.to_dict())

    def save(self, path: str | os.PathLike[str], notes: Mapping[str, str] | None = None) -> None:
        """Write the scene; tables inside the file's folder are named relative to it.

        Parameters
        ----------
        path : path-like
            Target, usually `*.toml`.
        notes : mapping, optional
            Comments by the dotted path of a number, beside which they are written.

        Raises
        ------
        OutputError
            The file cannot be written.
        """
        data, folder = self.to_dict(), Path(path).resolve().parent

        def named(table: str) -> str:
            full = Path(table).resolve()
            return full.relative_to(folder).as_posix() if full.is_relative_to(folder) else table

        change_tables(self, data, named)
        write_text(path, toml.with_notes(tomli_w.dumps(data), notes or {}))

    @classmethod
    def json_schema(cls) -> dict[str, Any]:
        """JSON Schema (2020-12) of a scene file, with unit and neutral value of every number."""
        return cls.model_json_schema()

    # -- parameters ----------------------------------------------------------------------------

    def parameters(self) -> dict[str, Parameter]:
        """Every scalar of the scene by dotted path; a scene without a tank has no tank parameters."""
        width, height = self.plane_size_m
        absent = {"detector.width_m": width, "detector.height_m": height}
        known = {parameter.path: parameter for parameter in numbers_of(self, absent=absent)}
        if self.water.base == "none":  # nothing that could be clearer
            absorption = known["water.absorption_per_m"]
            known[absorption.path] = replace(absorption, low=0.0)
        for name, (low, high) in room_for_lamp_m(self.lamp, self.tank).items() if self.tank else ():
            offset = known[f"lamp.{name}"]
            known[offset.path] = replace(offset, low=max(offset.low, low), high=min(offset.high, high))
        return known | {parameter.path: parameter for parameter in listed_parameters(self)}

    @property
    def plane_size_m(self) -> tuple[float, float]:
        """Width and height of the detector planes; where nothing is said, clipped to the tank."""
        return plane_size_m(self.detector, self.tank)

    @property
    def follower_here(self) -> Follower:
        """The follower; distances that nobody stated as far as the scene reaches."""
        return follower_in(self.follower, self.tank, self.detector)

    @property
    def reflectances(self) -> tuple[float, float]:
        """Of walls and of the water surface; 0 in open water."""
        return (self.tank.wall_albedo, self.tank.surface_reflectance) if self.tank else (0.0, 0.0)

    @property
    def reflects(self) -> bool:
        """Does anything in the tank send light back: walls, the water surface, panes?"""
        return any(self.reflectances) or self.pane_reflectance > 0

    @property
    def pane_reflectance(self) -> float:
        """Factor on the Fresnel reflectance of panes; 0 without any."""
        return self.tank.pane_reflectance if self.tank else 0.0

    @property
    def surface_reflects(self) -> bool:
        """Is there a water surface, and does it send light back?"""
        return self.reflectances[1] > 0

    def get(self, path: str) -> Any:
        """Value at a dotted path.

        Parameters
        ----------
        path : str
            For example "water.phase.g".

        Raises
        ------
        SceneError
            There is no such parameter in this scene.
        """
        if is_listed(path):
            value = listed_value(self, path)
            if value is None:
                raise self._no_such(path)
            return value
        current: Any = self
        for name in path.split("."):
            if not isinstance(current, BaseModel) or name not in type(current).model_fields:
                raise self._no_such(path)
            current = getattr(current, name)
        return current

    def with_values(self, values: Mapping[str, Any], validate: bool = True) -> Scene:
        """The same scene with some values changed.

        Parameters
        ----------
        values : mapping of str to value
            New values by dotted path. Setting `tank.surface_reflectance` above 0 makes the surface flat, to 0
            a lid of it; panes mirror as bare ones do unless that is set too, see `mirrors_follow`.
        validate : bool
            False skips the check of values (not of paths), for the inner loop of a fit.

        Raises
        ------
        SceneError
            Unknown path, or a value that breaks a rule.
        """
        values = {path: _plain(value) for path, value in values.items()}
        try:
            values = with_listed(self, mirrors_follow(values, self.tank))
            if not validate:
                return with_fields(self, values)._with_slab_in_tank(values)
        except KeyError as error:
            raise self._no_such(error.args[0]) from None
        # Parts that stay as they are were checked when they were made.
        changed = {path.partition(".")[0] for path in values}
        data = {name: getattr(self, name) for name in self.model_fields_set}
        for name in changed & data.keys():
            if isinstance(data[name], BaseModel):
                data[name] = data[name].model_dump(exclude_unset=True)
        for path, value in values.items():
            *parents, leaf = path.split(".")
            self.get(path)
            owner: dict[str, Any] = data
            part: Any = self
            for key in parents:
                owner, part = owner.setdefault(key, {}), getattr(part, key)
                # Tells which phase function it is, also when left unsaid.
                if "type" in type(part).model_fields:
                    owner.setdefault("type", part.type)
            owner[leaf] = _dumped(value)
        data[OWN_FIELD] = [_dumped(effect) for effect in data.get(OWN_FIELD, ())]
        if not data[OWN_FIELD]:
            del data[OWN_FIELD]
        try:
            return type(self).model_validate(data, context={_WHERE: None})
        except ValidationError as error:
            whole = any(not problem["loc"] for problem in error.errors())  # else a problem names its value
            raise scene_error(error, type(self), _assigned(values) if whole else "values") from None

    def __repr__(self) -> str:
        return f"<Scene: {self.name or 'without a name'}; {'in a tank' if self.tank else 'open water'}>"

    def digest(self) -> str:
        """SHA-256 of all that the physics depends on: every value, and the content of every table."""
        data = self.model_dump(mode="json", exclude={"name", "description", *_LIGHTLESS})
        change_tables(self, data, lambda table: inputs.content_digest(table, inputs.TABLE))
        drop_later(self, data)
        data["detector"]["width_m"] = self.plane_size_m[0]
        text = json.dumps(without_minus_zero(data), sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()

    def _with_slab_in_tank(self, values: Mapping[str, Any]) -> Scene:
        """The same; a slab of water whose place nobody states follows a tank that has changed."""
        if not any(path.startswith("tank.") for path in values):
            return self
        water = water_in(self.water, self.tank)
        return self if water is self.water else self.model_copy(update={"water": water})

    def _no_such(self, path: str) -> SceneError:
        part = path.partition(".")[0]
        if part in ABSENT and getattr(self, part) is None:
            return absent_error(path, part)
        known = [*self.parameters(), "lamp.profile", "water.base", "detector.quantity"]
        return SceneError(f"{path}: no such parameter", remedy=nearest_keys(path, known))


def _dumped(value: Any) -> Any:
    """What was said about a part, to be checked again; other values as they are."""
    return value.model_dump(exclude_unset=True) if isinstance(value, BaseModel) else value


def _assigned(values: Mapping[str, Any]) -> str:
    """What was to be changed, as an error names it."""
    told = [f"{path} = {brief(value, 40)}" for path, value in values.items()]
    return ", ".join(told[:_NAMED]) + (f" and {len(told) - _NAMED} more" if len(told) > _NAMED else "")


def _plain(value: Any) -> Any:
    """NumPy scalars as Python numbers."""
    return value.item() if hasattr(value, "item") and getattr(value, "ndim", 0) == 0 else value
