"""The parts of a scene: lamp, water, tank, detector. One field is one parameter."""

from __future__ import annotations

import difflib
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from lightfield.scene.lamp.photometry import intensity_table
from lightfield.scene.parameters import Part, TablePath, number
from lightfield.scene.water.library import list_presets
from lightfield.scene.water.phase.spec import HenyeyGreenstein, PhaseSpec
from lightfield.storage.tables import read_columns, readable

Metres = Annotated[float, Field(strict=True)]
PositiveMetres = Annotated[float, Field(strict=True, gt=0.0)]
Absorption = Annotated[float, Field(strict=True, ge=0.0, le=100.0)]
Nanometres = Annotated[float, Field(strict=True, ge=200.0, le=2000.0)]


class Lamp(Part):
    """The source; Gaussian family: exp(-ln2 (theta/hwhm)^m) + f exp(-ln2 (theta/hwhm_s)^2)."""

    profile: Literal["gaussian", "super-gaussian", "two-component", "table", "isotropic", "pencil"] = Field(
        "gaussian", description="angular shape of the beam"
    )
    hwhm_deg: float = number(3.81, "deg", "half width of the beam at half maximum", low=0.05, high=90.0)
    shape_exponent: float = number(2.0, "1", "m of exp(-ln2 (theta/hwhm)^m)", low=0.2, high=50.0, neutral=2.0)
    skirt_fraction: float = number(
        0.0, "1", "on-axis intensity of the skirt over that of the core", low=0.0, high=10.0, neutral=0.0
    )
    skirt_hwhm_deg: float = number(
        15.0, "deg", "half width of the skirt at half maximum", low=0.05, high=90.0
    )
    ellipticity: float = number(1.0, "1", "hwhm in y over hwhm in x", low=0.05, high=20.0, neutral=1.0)
    offset_x_m: float = number(0.0, "m", "lamp centre in x", low=-10.0, high=10.0, neutral=0.0)
    offset_y_m: float = number(0.0, "m", "lamp centre in y", low=-10.0, high=10.0, neutral=0.0)
    tilt_x_deg: float = number(
        0.0, "deg", "beam axis turned towards +x", above=-90.0, below=90.0, neutral=0.0
    )
    tilt_y_deg: float = number(
        0.0, "deg", "beam axis turned towards +y", above=-90.0, below=90.0, neutral=0.0
    )
    apparent_distance_m: float = number(
        0.0,
        "m",
        "distance behind the window from which the light seems to come",
        low=0.0,
        high=50.0,
        neutral=0.0,
    )
    radius_m: float = number(0.0, "m", "radius of a uniformly bright window", low=0.0, high=5.0, neutral=0.0)
    window_index: float = number(
        1.0, "1", "readings in air see I(theta/n)/n^2 of the beam in water", low=1.0, high=2.0, neutral=1.0
    )
    drift_per_hour: float = number(
        0.0, "1/h", "lamp power changes by 1 + d t", low=-10.0, high=10.0, neutral=0.0
    )
    warmup_fraction: float = number(
        0.0, "1", "lamp power changes by 1 + f (1 - exp(-t/tau))", above=-1.0, high=10.0, neutral=0.0
    )
    warmup_time_s: float = number(600.0, "s", "tau of the warm-up", above=0.0, high=1e6)
    power_w: float = number(
        50.0, "W", "radiant power of the beam over the whole spectrum", above=0.0, high=1e6
    )
    spectrum: Literal["planck", "cie-a", "table"] = Field("planck", description="spectral shape")
    temperature_k: float = number(2900.0, "K", "temperature of the Planck spectrum", low=500.0, high=20000.0)
    intensity_table: TablePath | None = Field(
        None, description="for profile table: CSV (angle_deg, intensity), IES LM-63 (.ies) or EULUMDAT (.ldt)"
    )
    spectrum_table: TablePath | None = Field(
        None, description="for spectrum table: CSV (wavelength_nm, power), any scale"
    )

    @model_validator(mode="after")
    def _profile_has_its_parameters(self) -> Lamp:
        needs = {
            "super-gaussian": "shape_exponent",
            "two-component": "skirt_fraction",
            "table": "intensity_table",
        }.get(self.profile)
        if needs and needs not in self.model_fields_set:
            raise ValueError(f'profile "{self.profile}" needs {needs}; remedy: add {needs}')
        if self.spectrum == "table" and self.spectrum_table is None:
            raise ValueError('spectrum "table" needs spectrum_table; remedy: add spectrum_table')
        if self.intensity_table is not None:
            readable(intensity_table, self.intensity_table)
        if self.spectrum_table is not None:
            readable(read_columns, self.spectrum_table, ("wavelength_nm", "power"))
        return self


class Water(Part):
    """Inherent optical properties: base, grey additions, constituents, non-uniformity, phase function."""

    base: str = Field("none", description='"none", "pure", "table" or the name of a preset')
    absorption_per_m: float = number(
        0.0,
        "1/m",
        "grey absorption, added to the base; below 0 for water clearer than its base",
        low=-100.0,
        high=100.0,
        neutral=0.0,
    )
    scattering_per_m: float = number(
        0.0, "1/m", "grey scattering, added to the base", low=0.0, high=100.0, neutral=0.0
    )
    table: TablePath | None = Field(
        None, description='for base "table": CSV (wavelength_nm, absorption_per_m, scattering_per_m)'
    )
    chlorophyll_mg_per_m3: float = number(0.0, "mg/m^3", "chlorophyll", low=0.0, high=1000.0, neutral=0.0)
    cdom_440_per_m: float = number(
        0.0, "1/m", "absorption of dissolved organic matter at 440 nm", low=0.0, high=100.0, neutral=0.0
    )
    cdom_slope_per_nm: float = number(
        0.014, "1/nm", "exponential slope of that absorption", low=0.0, high=0.1
    )
    sediment_g_per_m3: float = number(0.0, "g/m^3", "non-algal particles", low=0.0, high=1e4, neutral=0.0)
    absorption_at: tuple[tuple[Nanometres, Absorption], ...] = Field(
        (),
        description="[[wavelength_nm, absorption_per_m], ...], added to the base: linear between, "
        "constant beyond",
    )
    temperature_c: float = number(20.0, "degC", "of the water", low=-2.0, high=40.0)
    salinity_psu: float = number(0.0, "1", "practical salinity", low=0.0, high=45.0)
    gradient_per_m2: float = number(
        0.0, "1/m^2", "absorption grows by this per metre of z", low=-1.0, high=1.0, neutral=0.0
    )
    gradient_centre_m: float = number(
        3.25, "m", "z at which the gradient adds nothing", low=-100.0, high=100.0
    )
    layer_absorption_per_m: float = number(
        0.0, "1/m", "extra absorption of a slab across the tank", low=0.0, high=100.0, neutral=0.0
    )
    layer_centre_m: float = number(6.5, "m", "z of the slab's middle", low=0.0, high=1000.0)
    layer_width_m: float = number(1.0, "m", "thickness of the slab along z", above=0.0, high=1000.0)
    hardening_per_m: float = number(
        0.0, "1/m", "q of -ln T = K r - (q r)^2 / 2 (wide band)", low=0.0, high=10.0, neutral=0.0
    )
    phase: PhaseSpec = Field(default_factory=HenyeyGreenstein, description="phase function")

    @field_validator("absorption_per_m")
    @classmethod
    def _only_a_base_can_be_clearer(cls, value: float, info: ValidationInfo) -> float:
        if value < 0 and info.data.get("base") == "none":
            raise ValueError(
                f"found {value:g}, a number >= 0 (1/m) in water without a base; "
                "remedy: write absorption_per_m = a value >= 0, or name a base"
            )
        return value

    @model_validator(mode="after")
    def _base_is_known(self) -> Water:
        wavelengths = [wavelength for wavelength, _ in self.absorption_at]
        if any(b <= a for a, b in pairwise(wavelengths)):
            raise ValueError(
                f"wavelengths of absorption_at must rise, found {wavelengths}; "
                "remedy: sort them, drop doubles"
            )
        if self.base == "table" and self.table is None:
            raise ValueError('base "table" needs table; remedy: add table = "file.csv"')
        if self.table is not None:
            readable(read_columns, self.table, ("wavelength_nm", "absorption_per_m", "scattering_per_m"))
        known = ["none", "pure", "table", *list_presets()]
        if self.base not in known:
            near = difflib.get_close_matches(self.base, known, n=1, cutoff=0.4)
            raise ValueError(
                f'base "{self.base}" is not one of {", ".join(known)}; '
                f"remedy: {f'did you mean {near[0]}?' if near else 'choose one of them'}"
            )
        return self


class Tank(Part):
    """A box of water: Lambertian sides, floor, ends, and on top a lid like them or a flat surface."""

    width_m: float = number(3.66, "m", "wall to wall in x", above=0.0, high=1e5)
    depth_m: float = number(2.44, "m", "floor to surface", above=0.0, high=1e5)
    length_m: float = number(36.6, "m", "end to end in z", above=0.0, high=1e5)
    behind_lamp_m: float = number(0.5, "m", "from the back wall to the lamp window", low=0.0, high=1e5)
    lamp_depth_m: float = number(1.22, "m", "from the surface down to the lamp axis", above=0.0, high=1e5)
    wall_albedo: float = number(0.0, "1", "reflected part at walls and floor", low=0.0, high=1.0, neutral=0.0)
    surface: Literal["none", "flat"] = Field(
        "none", description="top: a lid like the walls, or a flat water surface"
    )
    surface_reflectance: float = number(
        0.0, "1", "multiplies the Fresnel reflectance of the flat surface", low=0.0, high=1.0, neutral=0.0
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
        if self.lamp_depth_m >= self.depth_m:
            raise ValueError(
                f"lamp_depth_m must be less than depth_m = {self.depth_m}; remedy: raise the lamp"
            )
        if self.behind_lamp_m >= self.length_m:
            raise ValueError(
                f"behind_lamp_m must be less than length_m = {self.length_m}; remedy: move the lamp"
            )
        return self


class Detector(Part):
    """Receivers that face the lamp (-z), on planes or at single positions, with their readout."""

    quantity: Literal["irradiance", "scalar_irradiance", "radiance"] = Field(
        "irradiance",
        description="plane irradiance (cosine), scalar irradiance, or radiance over a cone",
    )
    full_angle_deg: float = number(
        2.0, "deg", "full angle of the collimator (radiance)", above=0.0, high=180.0
    )
    aim: Literal["axis", "lamp"] = Field(
        "axis", description="collimator parallel to the axis, or aimed at the lamp"
    )
    planes_m: tuple[PositiveMetres, ...] = Field(
        (4.5, 5.5, 6.5, 7.5, 8.5),
        description="z of the detector planes, rising",
        json_schema_extra={"unit": "m"},
    )
    width_m: float = number(2.0, "m", "width of a plane in x", above=0.0, high=1e4)
    height_m: float | None = number(
        None, "m", "height of a plane in y; same as the width when absent", above=0.0
    )
    pixels: int = number(65, "1", "pixels along the width", low=1, high=4096)
    positions_m: tuple[tuple[Metres, Metres, Metres], ...] | None = Field(
        None, description="single positions [x, y, z] instead of planes", json_schema_extra={"unit": "m"}
    )
    bands_nm: tuple[tuple[Nanometres, Nanometres], ...] = Field(
        ((500.0, 550.0),),
        description="wavelength bands [from, to]",
        json_schema_extra={"unit": "nm"},
    )
    background: float = number(
        0.0, "reading", "constant reading from ambient light or dark signal", low=-1e9, high=1e9, neutral=0.0
    )
    saturation: float = number(
        0.0, "1", "k of s / (1 + k s), s relative to the largest reading", low=0.0, high=10.0, neutral=0.0
    )
    saturation_quadratic: float = number(
        0.0, "1", "k of s (1 - k s), s relative to the largest reading", low=0.0, high=0.5, neutral=0.0
    )
    acceptance_hwhm_deg: float = number(
        0.0, "deg", "half width of a Gaussian acceptance; 0 means unlimited", low=0.0, high=180.0, neutral=0.0
    )
    tilt_x_deg: float = number(
        0.0, "deg", "receiver axis turned towards +x", above=-90.0, below=90.0, neutral=0.0
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
