"""What a scene says about the tank. One field is one parameter."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, radians, tan
from typing import Any, Literal

from pydantic import model_validator

from lightfield.errors import RuleError
from lightfield.scene.acts import Acts
from lightfield.scene.parameters import Part, declare, number, told

#: Refractive index of the water under its surface, relative to air; 1.33 to 1.35 over the spectrum and for
#: fresh to sea water (Quan & Fry 1995, Appl. Opt. 34, 3477; see `water.molecular.refractive_index`).
WATER_INDEX = 1.34
#: As soon as there is a surface the lid is gone, and with it what it reflects.
OPENS_THE_TOP = "tank.surface_reflectance"
#: The same of panes, between acrylic, 1.49, and float glass, 1.52 (Rubin 1985, Sol. Energy Mater. 12, 275):
#: these reflect 0.2 and 0.4 % of the light more or less at most, and nothing else beyond the critical angle.
PANE_INDEX = 1.5
#: Waves in a gale of 17 m/s are of 12 degrees (Cox & Munk 1954, J. Opt. Soc. Am. 44, 838,
#: doi:10.1364/JOSA.44.000838: mean square slope 0.003 + 0.00512 W, of both directions together).
_STEEPEST_DEG = 15.0

#: First and last x, y and z, m.
Extent = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]


class Tank(Part):
    """A box of water: Lambertian or glass sides, floor, ends, and on top a lid or a water surface."""

    width_m: float = number(3.66, "m", "wall to wall; the middle is x = 0", Acts.BOX, above=0.0, high=1e5)
    depth_m: float = number(2.44, "m", "floor to surface", Acts.BOX, above=0.0, high=1e5)
    length_m: float = number(36.6, "m", "end to end in z", Acts.BOX, above=0.0, high=1e5)
    behind_lamp_m: float = number(
        0.5, "m", "from the back wall to the lamp window", Acts.BOX, low=0.0, high=1e5
    )
    lamp_depth_m: float = number(
        None, "m", "from the surface down to the lamp axis; half the depth when absent",
        Acts.BOX, above=0.0, high=1e5,
    )  # fmt: skip
    wall_albedo: float = number(
        0.0, "1", "reflected part at walls, and at a floor like them",
        Acts.REFLECTION, low=0.0, high=1.0, neutral=0.0,
    )  # fmt: skip
    floor_over_walls: float = number(
        1.0, "1", "albedo of the floor over that of the walls; the floor reflects all at most",
        Acts.FACES, low=0.0, high=100.0, neutral=1.0, later=True,
    )  # fmt: skip
    end_over_walls: float = number(
        1.0, "1", "albedo of the far end over that of the walls; the end reflects all at most",
        Acts.FACES, low=0.0, high=100.0, neutral=1.0, later=True,
    )  # fmt: skip
    surface: Literal["none", "flat"] = declare(
        "none", "top: a lid like the walls, or a flat water surface", Acts.REFLECTION
    )
    surface_reflectance: float = number(
        0.0, "1",
        "multiplies the Fresnel reflectance of the flat surface: 1 for water, above it as its error has it",
        Acts.REFLECTION, low=0.0, high=1.5, neutral=0.0,
    )  # fmt: skip
    surface_slope_deg: float = number(
        0.0, "deg",
        "rms slope of waves on the water surface, across and along the tank each; their mean over time",
        Acts.WAVES, low=0.0, high=_STEEPEST_DEG, neutral=0.0, later=True,
    )  # fmt: skip

    panes: Literal["none", "sides", "all"] = declare(
        "none", "glass or acrylic with air behind: no face, the two sides, or these, floor and both ends",
        Acts.PANES, later=True,
    )  # fmt: skip
    pane_reflectance: float = number(
        0.0, "1",
        "multiplies the Fresnel reflectance of the panes: 1 of bare ones, 0 of covered ones, above 1 as its "
        "error has it",
        Acts.PANES, low=0.0, high=1.1, neutral=0.0, later=True,
    )  # fmt: skip

    @model_validator(mode="before")
    @classmethod
    def _panes_and_their_reflectance(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        panes, reflectance = data.get("panes"), data.get("pane_reflectance")
        if reflectance is None:
            return {**data, "pane_reflectance": 1.0} if panes in ("sides", "all") else data
        if not (isinstance(reflectance, int | float) and reflectance > 0):
            return data
        if panes == "none":
            raise RuleError(
                "only panes have a reflectance", 'write panes = "sides" or panes = "all"',
                found={"panes": "none", "pane_reflectance": reflectance},
            )  # fmt: skip
        return {**data, "panes": panes or "all"}

    @model_validator(mode="before")
    @classmethod
    def _surface_and_its_reflectance(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        reflectance = data.get("surface_reflectance")
        if reflectance is None:
            return {**data, "surface_reflectance": 1.0} if data.get("surface") == "flat" else data
        if isinstance(reflectance, int | float) and reflectance > 0:
            if data.get("surface", "flat") == "none":
                raise RuleError(
                    "only a flat surface has a reflectance", 'write surface = "flat"',
                    found={"surface": "none", "surface_reflectance": reflectance},
                )  # fmt: skip
            return {**data, "surface": data.get("surface", "flat")}
        if data.get("surface") == "flat" and reflectance == 0:
            raise RuleError(
                "a surface that sends nothing back is none, and a lid like the walls stands in its place",
                'write surface = "none" for the lid, or a small surface_reflectance (0.001) for a black top',
                found={"surface": "flat", "surface_reflectance": reflectance},
            )
        return data

    @model_validator(mode="after")
    def _lamp_is_inside(self) -> Tank:
        self._lamp_at_half_depth()
        for inner, outer in (("lamp_depth_m", "depth_m"), ("behind_lamp_m", "length_m")):
            if getattr(self, inner) >= getattr(self, outer):
                stated = inner in self.model_fields_set
                raise RuleError(
                    f"{inner} must be less than {told(self, outer)}",
                    f"correct the one or the other{'' if stated else f': {inner} is its default'}",
                    found={inner: getattr(self, inner)},
                )
        return self

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Tank:
        """A copy with other values; a lamp of unstated depth stays at half the depth."""
        copy = super().model_copy(update=update, deep=deep)
        copy._lamp_at_half_depth()
        return copy

    def _lamp_at_half_depth(self) -> None:
        if "lamp_depth_m" not in self.model_fields_set:
            self.__dict__["lamp_depth_m"] = 0.5 * self.depth_m

    @property
    def floor_share(self) -> float:
        """Albedo of the floor over that of the walls, so that it reflects all at most."""
        return min(self.floor_over_walls, 1.0 / self.wall_albedo if self.wall_albedo else inf)

    @property
    def end_share(self) -> float:
        """The same of the far end, at the highest z."""
        return min(self.end_over_walls, 1.0 / self.wall_albedo if self.wall_albedo else inf)

    @property
    def brightest_over_walls(self) -> float:
        """Albedo of the brightest of walls, floor and far end over that of the walls."""
        return max(1.0, self.floor_share, self.end_share)

    @property
    def bare_panes(self) -> float:
        """Factor on the reflectance of the panes as it is stated, of covered ones as if they were bare."""
        return 0.0 if self.panes == "none" else self.pane_reflectance or 1.0

    @property
    def panes_at(self) -> tuple[float, float, float]:
        """Factors on the Fresnel reflectance of sides, floor and ends; 0 of what is no pane."""
        sides, others = self.panes != "none", self.panes == "all"
        return self.pane_reflectance * sides, self.pane_reflectance * others, self.pane_reflectance * others

    @property
    def slope(self) -> float:
        """Standard deviation of the surface's slope in one direction; 0 of a lid."""
        return tan(radians(self.surface_slope_deg)) if self.surface_reflectance > 0 else 0.0

    @property
    def room_m(self) -> tuple[float, float]:
        """From the lamp's axis to the nearer wall, and to the nearer of floor and top."""
        (left, right), (low, high), _ = self.box_m
        return min(-left, right), min(-low, high)

    @property
    def box_m(self) -> Extent:
        """First and last x, y and z of the water, as seen from the lamp's window."""
        half, back = 0.5 * self.width_m, self.behind_lamp_m
        return (
            (-half, half),
            (self.lamp_depth_m - self.depth_m, self.lamp_depth_m),
            (-back, self.length_m - back),
        )


def walls_m(tank: Tank | None) -> Extent:
    """`Tank.box_m`; open water has no end."""
    return ((-inf, inf), (-inf, inf), (-inf, inf)) if tank is None else tank.box_m
