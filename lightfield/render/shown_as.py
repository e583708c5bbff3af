"""What a picture shows otherwise than its scene says: a record, and its words."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any


class Shown(str, Enum):
    """What is shown otherwise; stable names, for programs."""

    WAVELENGTH = "wavelength_nm"
    ALBEDO = "wall_albedo"
    SCATTERING = "scattering_per_m"
    LAYERS = "absorption_change_per_m"


@dataclass(frozen=True)
class ShownAs:
    """One number of the scene and what stands for it in the picture.

    Parameters
    ----------
    own, shown : float
        In the unit that the name ends in; an albedo has none.
    """

    what: Shown
    own: float
    shown: float

    def __str__(self) -> str:
        return _WORDS[self.what].format(own=self.own, shown=self.shown)

    def as_data(self) -> dict[str, Any]:
        """The record for programs."""
        return asdict(self) | {"what": self.what.value}


_WORDS = {
    Shown.WAVELENGTH: "water at {own:g} nm shown as at {shown:g} nm, where its table ends",
    Shown.ALBEDO: "walls shown with albedo {shown:g} instead of {own:g}",
    Shown.LAYERS: "absorption that changes by {own:.2g} 1/m within the water shown as the same everywhere",
    Shown.SCATTERING: "scattering shown as {shown:g} 1/m instead of {own:.2g} 1/m",
}
