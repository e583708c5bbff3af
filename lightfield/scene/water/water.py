"""What a scene says about the water. One field is one parameter."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, ClassVar

from pydantic import Field, ValidationInfo, field_validator, model_validator

from lightfield.errors import RuleError, did_you_mean
from lightfield.scene.acts import Acts
from lightfield.scene.curve import Curve
from lightfield.scene.parameters import Nanometres, Part, TablePath, declare, number
from lightfield.scene.water.library import list_presets, preset_name
from lightfield.scene.water.phase.spec import HenyeyGreenstein, PhaseSpec
from lightfield.storage.tables import read_columns, readable

PerMetre = Annotated[float, Field(strict=True, ge=0.0, le=100.0)]
_COEFFICIENTS = Acts.ABSORPTION | Acts.SCATTERING | Acts.COLOUR


class Water(Part):
    """Inherent optical properties: base, grey additions, constituents, non-uniformity, phase function."""

    tables_of: ClassVar[Mapping[str, str]] = {"table": "base"}

    base: str = declare(
        "none", '"none", "pure", "table" or the name of a preset', Acts.BASE | _COEFFICIENTS, neutral="none"
    )
    absorption_per_m: float = number(
        0.0, "1/m", "grey absorption, added to the base; below 0 for water clearer than its base",
        Acts.ABSORPTION, low=-100.0, high=100.0, neutral=0.0,
    )  # fmt: skip
    scattering_per_m: float = number(
        0.0, "1/m", "grey scattering, added to the base", Acts.SCATTERING, low=0.0, high=100.0, neutral=0.0
    )
    scattering_slope: float = number(
        0.0, "1", "eta of that scattering, and of particles that settle: times (550 nm / wavelength)^eta",
        Acts.SCATTERING | Acts.COLOUR, low=-4.0, high=4.0, neutral=0.0, later=True,
    )  # fmt: skip
    scattering_departure: Curve = declare(
        (),
        "[[wavelength_nm, ln of a factor], ...] on that scattering too, over the factor at 550 nm: linear "
        "between, constant beyond",
        Acts.SCATTERING | Acts.COLOUR,
        neutral=(),
        later=True,
    )
    table: TablePath | None = declare(
        None,
        'for base "table": CSV (wavelength_nm, absorption_per_m, scattering_per_m)',
        Acts.BASE | _COEFFICIENTS,
    )
    chlorophyll_mg_per_m3: float = number(
        0.0, "mg/m^3", "chlorophyll", _COEFFICIENTS, low=0.0, high=1000.0, neutral=0.0
    )
    cdom_440_per_m: float = number(
        0.0, "1/m", "absorption of dissolved organic matter at 440 nm",
        Acts.ABSORPTION | Acts.COLOUR, low=0.0, high=100.0, neutral=0.0,
    )  # fmt: skip
    cdom_slope_per_nm: float = number(
        0.014, "1/nm", "exponential slope of that absorption",
        Acts.ABSORPTION | Acts.COLOUR, low=0.0, high=0.1,
    )  # fmt: skip
    sediment_g_per_m3: float = number(
        0.0, "g/m^3", "non-algal particles", _COEFFICIENTS, low=0.0, high=1e4, neutral=0.0
    )
    absorption_at: tuple[tuple[Nanometres, PerMetre], ...] = declare(
        (), "[[wavelength_nm, absorption_per_m], ...], added to the base: linear between, constant beyond",
        Acts.ABSORPTION | Acts.COLOUR, neutral=(), later=True,
    )  # fmt: skip
    colour_departure: Curve = declare(
        (),
        "[[wavelength_nm, absorption in 1/m], ...] added to all of it, which stays >= 0: linear between, "
        "constant beyond",
        Acts.ABSORPTION | Acts.COLOUR,
        neutral=(),
        later=True,
    )
    temperature_c: float = number(
        20.0, "degC", "of the water", Acts.BASE | _COEFFICIENTS, low=-2.0, high=40.0
    )
    salinity_psu: float = number(
        0.0, "1", "practical salinity", Acts.BASE | Acts.SCATTERING | Acts.COLOUR, low=0.0, high=45.0
    )
    gradient_per_m2: float = number(
        0.0, "1/m^2", "absorption grows by this per metre of z", Acts.LAYERS, low=-1.0, high=1.0, neutral=0.0
    )
    gradient_centre_m: float = number(
        3.25, "m", "z at which the gradient adds nothing", Acts.LAYERS, low=-100.0, high=100.0
    )
    height_gradient_per_m2: float = number(
        0.0, "1/m^2", "absorption grows by this per metre of y, from nothing at the lamp's height",
        Acts.LAYERS, low=-1.0, high=1.0, neutral=0.0,
    )  # fmt: skip
    bottom_layer_absorption_per_m: float = number(
        0.0, "1/m", "extra absorption below a height, less where negative",
        Acts.LAYERS, low=-1.0, high=100.0, neutral=0.0, later=True,
    )  # fmt: skip
    bottom_layer_top_m: float = number(
        -0.3, "m", "y of the middle of what parts that layer from the water above",
        Acts.LAYERS, low=-1000.0, high=1000.0, later=True,
    )  # fmt: skip
    bottom_layer_blend_m: float = number(
        0.1, "m", "height over which that layer sets in, evenly",
        Acts.LAYERS, above=0.0, high=1000.0, later=True,
    )  # fmt: skip
    layer_absorption_per_m: float = number(
        0.0, "1/m", "extra absorption of a slab across the tank",
        Acts.LAYERS, low=0.0, high=100.0, neutral=0.0,
    )  # fmt: skip
    layer_centre_m: float = number(
        6.5, "m", "z of the slab's middle; half way in a tank that ends before",
        Acts.LAYERS, low=0.0, high=1000.0,
    )  # fmt: skip
    layer_width_m: float = number(
        1.0, "m", "thickness of the slab along z", Acts.LAYERS, above=0.0, high=1000.0
    )
    absorption_departure: Curve = declare(
        (), "[[z_m, absorption in 1/m], ...] added along the tank: linear between, constant beyond",
        Acts.LAYERS, neutral=(), later=True,
    )  # fmt: skip
    hardening_per_m: float = number(
        0.0, "1/m", "q of -ln T = K r - (q r)^2 / 2 (wide band)",
        Acts.HARDENING, low=0.0, high=10.0, neutral=0.0,
    )  # fmt: skip
    drift_per_m_per_hour: float = number(
        0.0, "1/(m h)", "absorption grows by this per hour from time 0",
        Acts.AGEING, low=-10.0, high=10.0, neutral=0.0,
    )  # fmt: skip
    settling_per_m: float = number(
        0.0, "1/m", "b_s of scattering b_s exp(-t/tau) by particles that settle",
        Acts.SCATTERING | Acts.AGEING, low=0.0, high=100.0, neutral=0.0,
    )  # fmt: skip
    settling_time_s: float = number(3600.0, "s", "tau of the settling", Acts.AGEING, above=0.0, high=1e7)
    phase: PhaseSpec = declare(HenyeyGreenstein(), "phase function", Acts.PHASE)

    @field_validator("base")
    @classmethod
    def _as_its_source_writes_it(cls, value: str) -> str:
        return preset_name(value)

    @field_validator("absorption_per_m")
    @classmethod
    def _only_a_base_can_be_clearer(cls, value: float, info: ValidationInfo) -> float:
        if value < 0 and info.data.get("base") == "none":
            raise RuleError(
                "a number >= 0 (1/m) in water without a base",
                "write absorption_per_m = a value >= 0, or name a base",
                found=value,
            )
        return value

    @model_validator(mode="after")
    def _base_is_known(self) -> Water:
        wavelengths = [wavelength for wavelength, _ in self.absorption_at]
        if any(b <= a for a, b in pairwise(wavelengths)):
            raise RuleError(
                "wavelengths of absorption_at must rise", "sort them, drop doubles", found=wavelengths
            )
        if self.base == "table" and self.table is None:
            raise RuleError('base "table" needs table', 'add table = "file.csv"')
        if self.table is not None:
            readable(read_columns, self.table, ("wavelength_nm", "absorption_per_m", "scattering_per_m"))
        known = ["none", "pure", "table", *list_presets()]
        if self.base not in known:
            near = did_you_mean(self.base, known, cutoff=0.4)
            rule = "a known base" if near else f"one of {', '.join(known)}"
            raise RuleError(rule, near or "choose one of them", found={"base": self.base})
        return self
