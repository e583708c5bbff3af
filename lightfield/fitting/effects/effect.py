"""What an effect is: a named group of scene parameters set free from their neutral values."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from lightfield.fitting.parameter import Lowest
from lightfield.scene.acts import DIFFUSE, Acts
from lightfield.scene.all_parameters import acts_on

#: What effects go together, see `Effect.combines_with`.
TOGETHER = (
    "each effect once, no curve with what it contains, and what is known for direct light alone not with "
    "diffuse light"
)

Scale = Literal[
    "one",
    "power",
    "signal",
    "inverse_signal",
    "hwhm",
    "hours",
    "inverse_hours",
    "seconds",
    "moment",
    "interval",
    "range",
    "heights",
    "nearest",
    "spread",
    "attenuation",
]
Need = Literal[
    "vary_x",
    "vary_y",
    "vary_z",
    "oblique",
    "time",
    "to_and_fro",
    "tank",
    "mirror",
    "panes",
    "water",
    "air_and_water",
    "two_colours",
    "spectral",
    "overlap",
    "known_base",
    "formula_beam",
    "table_beam",
    "off_axis",
    "absolute",
    "relative",
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
        "inverse_hours", "moment" (0 = first, 1 = last reading), "interval" (mean time from one reading to the
        next), "range" (0 = nearest, 1 = farthest plane), "heights" (0 = lowest, 1 = highest of lamp
        and readings), "nearest" (distance of the nearest plane, or of the scene's own if it is nearer),
        "spread" (of the attenuation in the band, 1/m, as water may have it), "attenuation" (of the scene's
        water, 1/m).
    grid : tuple of float
        Start values of a shape parameter, one that means nothing while the amplitude is zero.
    inverse_square : bool
        The fit moves (10/value)^2, for widths whose neutral value is "infinitely wide", stored as 0.
    square : bool
        The fit moves value^2, for what changes the light by its square; the numbers above are squares too,
        in multiples of that of `per`.
    needs : tuple of str
        Conditions on the readings without which this parameter stays fixed.
    real : float, optional
        The most that there is of it, where a fit may go beyond by its error; no more is hidden.
    lowest : str
        What its lowest value is: an "edge" of what is plausible, or one like others, with "none" of something
        (a face reflects nothing) or "sudden". A fit that ends there is an answer.
    """

    path: str
    low: float
    high: float
    typical: float
    per: Scale = "one"
    grid: tuple[float, ...] = ()
    inverse_square: bool = False
    square: bool = False
    needs: tuple[Need, ...] = ()
    real: float | None = None
    lowest: Lowest = "edge"


@dataclass(frozen=True)
class Form:
    """One functional form of an effect: amplitudes that are zero when it is off, and shapes.

    Parameters
    ----------
    refines : bool
        Tried only where a shorter form of the effect is in the best set already: a curve so fine would take
        what is no curve of its kind.
    at_any_time : bool
        It may begin whenever: sought among sets of effects alone. So many beginnings follow noise, which is
        not judged beside them.
    """

    name: str
    amplitudes: tuple[Free, ...]
    shapes: tuple[Free, ...] = ()
    refines: bool = False
    at_any_time: bool = False


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
    instead_of : tuple of str
        Parameters of the base model that it takes the place of: held in the middle of their range.
    contains : tuple of str
        Of a free-form curve: effects that are special cases of it, and are never combined with it.
    apart_from : tuple of str
        Other effects that it is never combined with.
    kind_of : tuple of str
        Of a curve: what it contains that is there wherever it is, as a background where one has a colour.
    """

    name: str
    family: str
    forms: tuple[Form, ...]
    physics: str
    signature: str
    laboratory: str
    needs: tuple[Need, ...] = ()
    instead_of: tuple[str, ...] = ()
    contains: tuple[str, ...] = ()
    apart_from: tuple[str, ...] = ()
    kind_of: tuple[str, ...] = ()

    @property
    def is_free_form(self) -> bool:
        """Is it a curve: are others special cases of it, or its amplitudes numbered?"""
        return bool(self.contains) or any(path.rpartition(".")[2].isdigit() for path in self.paths)

    @cached_property
    def diffuse(self) -> bool:
        """It acts through scattered or reflected light, which comes from the transport response."""
        return any(acts_on(path) & DIFFUSE for path in self.paths)

    @cached_property
    def direct_only(self) -> bool:
        """It acts by the direction of arrival, known for direct light only: not combined with diffuse."""
        return any(acts_on(path) & Acts.RECEIVER for path in self.paths)

    @cached_property
    def of_direction(self) -> bool:
        """It acts by the direction of direct light alone, at the lamp or at the receiver."""
        acts = [acts_on(path) for path in self.paths]  # nothing of a formula of the user's own
        return all(one and not one & ~(Acts.BEAM | Acts.SECTION | Acts.RECEIVER) for one in acts)

    def combines_with(self, other: Effect) -> bool:
        """Can both be in one explanation? See `TOGETHER`."""
        clash = (self.direct_only and other.diffuse) or (self.diffuse and other.direct_only)
        special = other.name in self.contains or self.name in other.contains
        apart = other.name in self.apart_from or self.name in other.apart_from
        return self.name != other.name and not clash and not special and not apart

    @property
    def paths(self) -> tuple[str, ...]:
        """Every scene parameter that some form of the effect frees, in order and once."""
        frees = (free for form in self.forms for free in (*form.amplitudes, *form.shapes))
        return tuple(dict.fromkeys(free.path for free in frees))
