"""The parts of a scene round the water: the tank, and the detectors in it. One field is one parameter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from lightfield.scene.acts import Acts
from lightfield.scene.parameters import Nanometres, Part, declare, number, told

Metres = Annotated[float, Field(strict=True)]
PositiveMetres = Annotated[float, Field(strict=True, gt=0.0)]


class Tank(Part):
    """A box of water: Lambertian sides, floor, ends, and on top a lid like them or a flat surface."""

    width_m: float = number(3.66, "m", "wall to wall in x", Acts.BOX, above=0.0, high=1e5)
    depth_m: float = number(2.44, "m", "floor to surface", Acts.BOX, above=0.0, high=1e5)
    length_m: float = number(36.6, "m", "end to end in z", Acts.BOX, above=0.0, high=1e5)
    behind_lamp_m: float = number(
        0.5, "m", "from the back wall to the lamp window", Acts.BOX, low=0.0, high=1e5
    )
    lamp_depth_m: float = number(
        None,
        "m",
        "from the surface down to the lamp axis; half the depth when absent",
        Acts.BOX,
        above=0.0,
        high=1e5,
    )
    wall_albedo: float = number(
        0.0, "1", "reflected part at walls and floor", Acts.REFLECTION, low=0.0, high=1.0, neutral=0.0
    )
    surface: Literal["none", "flat"] = declare(
        "none", "top: a lid like the walls, or a flat water surface", Acts.REFLECTION
    )
    surface_reflectance: float = number(
        0.0,
        "1",
        "multiplies the Fresnel reflectance of the flat surface",
        Acts.REFLECTION,
        low=0.0,
        high=1.0,
        neutral=0.0,
    )

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
                raise ValueError(
                    f'surface_reflectance = {reflectance} with surface "none"; remedy: write surface = "flat"'
                )
            return {**data, "surface": data.get("surface", "flat")}
        return data

    @model_validator(mode="after")
    def _lamp_is_inside(self) -> Tank:
        self._lamp_at_half_depth()
        for inner, outer in (("lamp_depth_m", "depth_m"), ("behind_lamp_m", "length_m")):
            if getattr(self, inner) >= getattr(self, outer):
                raise ValueError(
                    f"{inner} must be less than {outer}, found {told(self, inner)} and {told(self, outer)}; "
                    f"remedy: correct the one, or give the other"
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
    def box_m(self) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
        """First and last x, y and z of the water, as seen from the lamp's window."""
        half, back = 0.5 * self.width_m, self.behind_lamp_m
        return (
            (-half, half),
            (self.lamp_depth_m - self.depth_m, self.lamp_depth_m),
            (-back, self.length_m - back),
        )


class Detector(Part):
    """Receivers that face the lamp (-z), on planes or at single positions, with their readout."""

    quantity: Literal["irradiance", "scalar_irradiance", "radiance"] = declare(
        "irradiance", "plane irradiance (cosine), scalar irradiance, or radiance over a cone", Acts.RECEIVER
    )
    full_angle_deg: float = number(
        2.0, "deg", "full angle of the collimator (radiance)", Acts.RECEIVER, above=0.0, high=180.0
    )
    aim: Literal["axis", "lamp"] = declare(
        "axis", "collimator parallel to the axis, or aimed at the lamp", Acts.RECEIVER
    )
    planes_m: tuple[PositiveMetres, ...] = declare(
        (4.5, 5.5, 6.5, 7.5, 8.5), "z of the detector planes, rising", Acts.PLACES, unit="m"
    )
    width_m: float | None = number(
        None,
        "m",
        "width of a plane in x; when absent 2 m, or the tank's width if less",
        Acts.PLACES,
        above=0.0,
        high=1e4,
    )
    height_m: float | None = number(
        None,
        "m",
        "height of a plane in y; when absent the width, up to the tank's floor and top",
        Acts.PLACES,
        above=0.0,
    )
    pixels: int = number(
        65,
        "1",
        "pixels along the width, and along a height that is not stated",
        Acts.PLACES,
        low=1,
        high=4096,
    )
    positions_m: tuple[tuple[Metres, Metres, Metres], ...] | None = declare(
        None, "single positions [x, y, z] instead of planes", Acts.PLACES, unit="m"
    )
    bands_nm: tuple[tuple[Nanometres, Nanometres], ...] = declare(
        ((500.0, 550.0),), "wavelength bands [from, to]", Acts.PLACES, unit="nm"
    )
    background: float = number(
        0.0,
        "reading",
        "constant reading from ambient light or dark signal",
        Acts.READOUT,
        low=-1e9,
        high=1e9,
        neutral=0.0,
    )
    saturation: float = number(
        0.0,
        "1",
        "k of s / (1 + k s), s relative to the largest reading",
        Acts.READOUT,
        low=0.0,
        high=10.0,
        neutral=0.0,
    )
    saturation_quadratic: float = number(
        0.0,
        "1",
        "k of s (1 - k s), s relative to the largest reading",
        Acts.READOUT,
        low=0.0,
        high=0.5,
        neutral=0.0,
    )
    acceptance_hwhm_deg: float = number(
        0.0,
        "deg",
        "half width of a Gaussian acceptance; 0 means unlimited",
        Acts.RECEIVER,
        low=0.0,
        high=180.0,
        neutral=0.0,
    )
    tilt_x_deg: float = number(
        0.0, "deg", "receiver axis turned towards +x", Acts.RECEIVER, above=-90.0, below=90.0, neutral=0.0
    )

    @model_validator(mode="after")
    def _places_and_bands(self) -> Detector:
        if not self.planes_m and not self.positions_m:
            raise ValueError("nothing to measure; remedy: give planes_m or positions_m")
        if self.acceptance_hwhm_deg and self.quantity != "irradiance":
            raise ValueError(
                f"acceptance_hwhm_deg is for irradiance, found {self.quantity}; remedy: set it to 0"
            )
        if any(b <= a for a, b in zip(self.planes_m, self.planes_m[1:], strict=False)):
            raise ValueError(
                f"planes_m must rise, found {list(self.planes_m)}; remedy: sort them, drop doubles"
            )
        if not self.bands_nm:
            raise ValueError("no wavelength band; remedy: give bands_nm = [[500, 550]]")
        for low, high in self.bands_nm:
            if high <= low:
                raise ValueError(f"a band must rise, found [{low:g}, {high:g}]; remedy: write [from, to]")
        return self
