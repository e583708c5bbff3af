"""What an effect is: a named group of scene parameters set free from their neutral values."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import entry_points
from typing import Literal

from lightfield.errors import UsageError

ENTRY_POINT_GROUP = "lightfield.effects"

Scale = Literal[
    "one", "power", "signal", "inverse_signal", "hwhm", "hours", "inverse_hours", "seconds", "range", "band"
]
Need = Literal[
    "vary_x",
    "vary_y",
    "vary_z",
    "time",
    "tank",
    "water",
    "air_and_water",
    "spectral",
    "known_base",
    "off_axis",
    "absolute",
]


@dataclass(frozen=True)
class Free:
    """One scene parameter that an effect sets free.

    Parameters
    ----------
    path : str
        Dotted path of the scene parameter.
    low, high : float
        Physically plausible bounds, in multiples of `per`.
    typical : float
        Size worth asking about, in multiples of `per`; also the yard-stick of finite differences.
    per : str
        What the numbers are multiples of: "one" (the parameter's own unit), "power" (of the scene's lamp),
        "signal" (largest reading),
        "inverse_signal", "hwhm" (beam half width), "hours" or "seconds" (duration of the scan),
        "inverse_hours", "range" (0 = nearest, 1 = farthest plane), "band" (band width in nm).
    grid : tuple of float
        Start values of a shape parameter, one that means nothing while the amplitude is zero.
    inverse_square : bool
        The fit moves (10/value)^2, for widths whose neutral value is "infinitely wide", stored as 0.
    needs : tuple of str
        Conditions on the readings without which this parameter stays fixed.
    """

    path: str
    low: float
    high: float
    typical: float
    per: Scale = "one"
    grid: tuple[float, ...] = ()
    inverse_square: bool = False
    needs: tuple[Need, ...] = ()


@dataclass(frozen=True)
class Form:
    """One functional form of an effect: amplitudes that are zero when it is off, and shapes."""

    name: str
    amplitudes: tuple[Free, ...]
    shapes: tuple[Free, ...] = ()


@dataclass(frozen=True)
class Effect:
    """A physical effect, as the table of effects declares it.

    Parameters
    ----------
    name, family : str
        The family is what data can nearly always tell, the name what they often can.
    forms : tuple of Form
        Functional forms, the usual one first.
    physics, signature, laboratory : str
        What happens, what its residual looks like, how to check or remove it.
    needs : tuple of str
        Conditions on readings and scene without which it cannot be tested.
    diffuse : bool
        It acts through scattered or reflected light, which comes from the transport response.
    direct_only : bool
        It acts by the direction of arrival, known for direct light only: never combined with diffuse light.
    instead_of : tuple of str
        Parameters of the base model that it takes the place of: held in the middle of their range.
    """

    name: str
    family: str
    forms: tuple[Form, ...]
    physics: str
    signature: str
    laboratory: str
    needs: tuple[Need, ...] = ()
    diffuse: bool = False
    direct_only: bool = False
    instead_of: tuple[str, ...] = ()

    def combines_with(self, other: Effect) -> bool:
        """Can both be in one explanation?"""
        clash = (self.direct_only and other.diffuse) or (self.diffuse and other.direct_only)
        return self.name != other.name and not clash

    @property
    def paths(self) -> tuple[str, ...]:
        """Every scene parameter that some form of the effect frees, in order and once."""
        frees = (free for form in self.forms for free in (*form.amplitudes, *form.shapes))
        return tuple(dict.fromkeys(free.path for free in frees))


def _from_entry_points() -> Iterable[Effect]:
    for entry in entry_points(group=ENTRY_POINT_GROUP):
        where = f"{entry.group}: {entry.name} = {entry.value}"
        try:
            found = entry.load()
            found = found() if callable(found) and not isinstance(found, Effect) else found
            listed = [found] if isinstance(found, Effect) else list(found)
        except Exception as error:  # another package's code: whatever it raises is its defect
            raise UsageError(
                "effects of another package cannot be loaded",
                where=where,
                found=f"{type(error).__name__}: {error}",
                remedy="fix or uninstall that package",
            ) from error
        for effect in listed:
            if not isinstance(effect, Effect):
                raise UsageError(
                    "an entry point gives something that is not an effect",
                    where=where,
                    found=type(effect).__name__,
                    rule="an Effect, a sequence of Effects, or a function returning one of these",
                    remedy="fix or uninstall that package",
                )
            _check_paths(effect, where)
            yield effect


def _check_paths(effect: Effect, where: str) -> None:
    """Refuse what no scene has."""
    from lightfield.scene import Scene

    known = Scene.from_dict({"tank": {}}).parameters()
    for path in effect.paths:
        if path not in known:
            near = difflib.get_close_matches(path, known, n=1)
            raise UsageError(
                f"the effect {effect.name} frees a parameter that no scene has",
                where=where,
                found=path,
                remedy=f"did you mean {near[0]}?" if near else "`lightfield scene` lists the parameters",
            )


@lru_cache(maxsize=1)
def table() -> Mapping[str, Effect]:
    """Every known effect by name: the built-in table, then those of installed packages.

    Raises
    ------
    UsageError
        A third-party entry point gives something else, or a name that is already taken.
    """
    from lightfield.effect_table import EFFECTS

    effects = {effect.name: effect for effect in EFFECTS}
    for effect in _from_entry_points():
        if effect.name in effects:
            raise UsageError(
                "two effects have one name",
                where=ENTRY_POINT_GROUP,
                found=effect.name,
                remedy="rename the new one",
            )
        effects[effect.name] = effect
    return effects


def get(name: str) -> Effect:
    """The effect called `name`.

    Raises
    ------
    UsageError
        No effect has that name; the error lists those that exist.
    """
    effects = table()
    if name not in effects:
        near = difflib.get_close_matches(name, effects, n=1)
        raise UsageError(
            "unknown effect", found=name, rule="one of " + ", ".join(effects),
            remedy=f"did you mean {near[0]}?" if near else "`lightfield diagnose --list` explains them",
        )  # fmt: skip
    return effects[name]


def get_form(name: str) -> tuple[Effect, Form]:
    """The effect and form that "effect" (its first form) or "effect:form" names.

    Raises
    ------
    UsageError
        No effect has that name, or it has no such form.
    """
    title, _, wanted = name.partition(":")
    effect = get(title)
    forms = [form for form in effect.forms if wanted in ("", form.name)]
    if not forms:
        known = ", ".join(form.name for form in effect.forms)
        raise UsageError(f"unknown form of {title}", found=wanted, rule=f"one of {known}")
    return effect, forms[0]
