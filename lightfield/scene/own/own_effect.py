"""An effect of the user's own: a formula that acts at one stage of the light's way, and its parameters."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from lightfield.arrays import Array
from lightfield.errors import RuleError, SceneError
from lightfield.scene.acts import Acts
from lightfield.scene.own.expression import CONSTANTS, FUNCTIONS, Expression
from lightfield.scene.parameters import Part

Stage = Literal["source", "path", "receiver", "readout"]
#: What a formula may speak of at each stage: position of the reading and distance from the apparent source in
#: m, angle from the beam's axis in degrees, time in s, wavelength in nm; the reading over the largest one.
_PLACE = ("x", "y", "z", "r", "theta", "wavelength")
_VARIABLES: dict[str, tuple[str, ...]] = {
    "source": ("theta", "time", "wavelength"),
    "path": _PLACE,
    "receiver": (*_PLACE, "time"),
    "readout": (*_PLACE, "time", "signal"),
}
#: Effects of a scene, parameters of each, characters of a name: at most. Chosen: what a person can think of.
MOST_EFFECTS, _MOST_PARAMETERS, _LONGEST_NAME = 20, 8, 40
#: A size worth asking about, as a part of the range, where none is given; starts of a shape. Chosen.
_TYPICAL_PART, STARTS = 0.05, (0.1, 0.3, 0.5, 0.7, 0.9)
#: What a formula gives with every amplitude switched off differs from 1 (or the signal) by rounding at most.
_NEUTRAL = 1e-9
#: Light is multiplied by at most so much.
_MOST = 1e6
Number = Annotated[float, Field(strict=True, ge=-1e9, le=1e9)]
Name = Annotated[str, Field(pattern=rf"^[a-z][a-z0-9_]{{0,{_LONGEST_NAME - 1}}}$")]
Clause = Annotated[str, Field(max_length=500)]


class Places(NamedTuple):
    """Where and when light is read, each of shape (n,): m, degrees from the beam's axis, nm, s."""

    x: Array
    y: Array
    z: Array
    r: Array
    theta: Array
    wavelength: Array
    time: Array


class OwnParameter(Part):
    """A number of the formula: with a neutral value an amplitude, without one a shape."""

    unit: Annotated[str, Field(max_length=20)] = Field("1", description='unit as printed, "1" for a ratio')
    range: tuple[Number, Number] = Field(description="lowest and highest plausible value")
    neutral: Number | None = Field(None, description="value that switches the effect off")
    typical: Number | None = Field(None, description="size worth asking about")
    value: Number | None = Field(None, description="value in this scene; default: neutral, or the middle")
    meaning: Clause = Field("", description="one clause for people")

    @model_validator(mode="after")
    def _values_are_in_range(self) -> OwnParameter:
        low, high = self.range
        if not low < high:
            raise RuleError("a range must rise", "write [lowest, highest]", found=[low, high])
        for name in ("neutral", "value"):
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise RuleError(f"within {low:g} to {high:g}", "widen the range", found={name: value})
        if self.typical is not None and not 0 < self.typical <= high - low:
            typical = {"typical": self.typical}
            raise RuleError("a size within the range", "write one above 0", found=typical)
        return self

    @property
    def now(self) -> float:
        """Its value in the scene."""
        if self.value is not None:
            return self.value
        return 0.5 * (self.range[0] + self.range[1]) if self.neutral is None else self.neutral

    @property
    def size(self) -> float:
        """A size worth asking about."""
        return _TYPICAL_PART * (self.range[1] - self.range[0]) if self.typical is None else self.typical


class OwnEffect(Part):
    """An effect of the user's own."""

    name: Name = Field(description="what results call it")
    family: Annotated[str, Field(min_length=1, max_length=_LONGEST_NAME)] = Field(
        "own hypothesis", description="what readings can nearly always tell"
    )
    stage: Stage = Field(
        description="source: factor on all light; path: on light that comes straight; receiver: on all light "
        "that arrives; readout: the new reading"
    )
    formula: str = Field(description="arithmetic over the stage's variables and the parameters")
    parameters: dict[Name, OwnParameter] = Field(min_length=1, max_length=_MOST_PARAMETERS)
    physics: Clause = Field("A hypothesis of the user's own.", description="what happens")
    laboratory: Clause = Field("Change what it supposes, and read again.", description="how to check it")

    @model_validator(mode="after")
    def _formula_is_possible(self) -> OwnEffect:
        expression, variables = Expression(self.formula), _VARIABLES[self.stage]
        where = f"formula of {self.name}"
        taken = {*CONSTANTS, *FUNCTIONS, *_VARIABLES["readout"]} & self.parameters.keys()
        if taken:
            raise RuleError(
                f"{where}: parameters have names of their own", "rename it", found=", ".join(sorted(taken))
            )
        unknown = expression.names - {*variables, *self.parameters}
        if unknown:
            raise RuleError(
                f"{where}: at the stage {self.stage} there are {', '.join(variables)}",
                "declare it under parameters, or choose another stage",
                found=", ".join(sorted(name[:40] for name in unknown)),
            )
        unused = self.parameters.keys() - expression.names
        if unused:
            raise RuleError(
                f"{where}: it uses every parameter", "drop what it does not use",
                found=f"without {', '.join(sorted(unused))}",
            )  # fmt: skip
        if all(p.neutral is None for p in self.parameters.values()):
            raise RuleError(f"{where}: some parameter has a neutral value", "say which value switches it off")
        if (
            self.stage == "source"
            and "theta" in expression.names
            and expression.names & {"time", "wavelength"}
        ):
            raise RuleError(f"{where}: no theta beside time or wavelength", "make two effects of it")
        self._check_neutral(where)
        return self

    def _check_neutral(self, where: str) -> None:
        """With every amplitude off it changes nothing, whatever the shapes."""
        signal = np.array([1.0, 0.5, 0.1])
        at = {
            "x": 0.2 * signal,
            "y": -0.1 * signal,
            "z": 5.0 * signal,
            "r": 5.1 * signal,
            "theta": 3 * signal,
        }
        at |= {"time": 1000 * signal, "wavelength": 400 + 200 * signal, "signal": signal}
        for part in STARTS:
            shapes = {k: p.range[0] + part * (p.range[1] - p.range[0]) for k, p in self.parameters.items()}
            off = {k: p.neutral for k, p in self.parameters.items() if p.neutral is not None}
            found = np.broadcast_to(self._expression({**at, **shapes, **off}), signal.shape)
            wanted = signal if self.stage == "readout" else np.ones_like(signal)
            wrong = ~(np.abs(found - wanted) <= _NEUTRAL)
            if wrong.any():
                gives = "the signal" if self.stage == "readout" else "1"
                value = f"{found[wrong][0]:g} instead of {wanted[wrong][0]:g}"
                raise RuleError(
                    f"{where}: with its neutral values it gives {gives}", "correct it", found=value
                )

    @cached_property
    def _expression(self) -> Expression:
        return Expression(self.formula)

    @property
    def is_off(self) -> bool:
        """Is every amplitude at its neutral value?"""
        return all(p.neutral is None or p.now == p.neutral for p in self.parameters.values())

    def speaks_of(self, variable: str) -> bool:
        """Does its formula depend on a variable of its stage?"""
        return variable in self._expression.names

    @property
    def is_of_angle(self) -> bool:
        """Is it a factor on the beam's shape?"""
        return self.stage == "source" and self.speaks_of("theta")

    @property
    def acts(self) -> Acts:
        """What of the light's way it changes."""
        if self.is_of_angle:
            return Acts.BEAM
        of_light = {"source": Acts.POWER | Acts.TIME, "path": Acts.STRAIGHT}
        return of_light.get(self.stage, Acts.READOUT)

    def at(self, places: Places, signal: Array | float = 1.0) -> Array:
        """The factor, or the new reading over the largest, shape (n,).

        Raises
        ------
        SceneError
            The formula has no finite value there.
        """
        values = {name: p.now for name, p in self.parameters.items()}
        found = self._expression({**places._asdict(), "signal": signal, **values})
        if not np.isfinite(found).all():
            said = ", ".join(f"{name} = {value:.4g}" for name, value in values.items())
            raise SceneError(
                "a formula has no finite value at every reading",
                where=f"effect {self.name}",
                found=f"{self.formula} with {said}",
                remedy="narrow the ranges, or write the formula so that it has one",
            )
        return found if self.stage == "readout" else np.clip(found, 0.0, _MOST)
