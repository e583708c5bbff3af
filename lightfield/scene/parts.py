"""The parts of a scene that light comes from and goes through: lamp and water. One field is one parameter."""

from __future__ import annotations

import difflib
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from lightfield.scene.acts import Acts
from lightfield.scene.lamp.photometry import intensity_table
from lightfield.scene.parameters import Nanometres, Part, TablePath, declare, number
from lightfield.scene.water.library import list_presets
from lightfield.scene.water.phase.spec import HenyeyGreenstein, PhaseSpec
from lightfield.storage.tables import read_columns, readable

Absorption = Annotated[float, Field(strict=True, ge=0.0, le=100.0)]
COEFFICIENTS = Acts.ABSORPTION | Acts.SCATTERING | Acts.COLOUR


class Lamp(Part):
    """The source; Gaussian family: exp(-ln2 (theta/hwhm)^m) + f exp(-ln2 (theta/hwhm_s)^2)."""

    profile: Literal["gaussian", "super-gaussian", "two-component", "table", "isotropic", "pencil"] = declare(
        "gaussian", "angular shape of the beam", Acts.BEAM
    )
    hwhm_deg: float = number(
        3.81, "deg", "half width of the beam at half maximum", Acts.BEAM, low=0.05, high=90.0
    )
    shape_exponent: float = number(
        2.0, "1", "m of exp(-ln2 (theta/hwhm)^m)", Acts.BEAM, low=0.2, high=50.0, neutral=2.0
    )
    skirt_fraction: float = number(
        0.0,
        "1",
        "on-axis intensity of the skirt over that of the core",
        Acts.BEAM,
        low=0.0,
        high=10.0,
        neutral=0.0,
    )
    skirt_hwhm_deg: float = number(
        15.0, "deg", "half width of the skirt at half maximum", Acts.BEAM, low=0.05, high=90.0
    )
    ellipticity: float = number(
        1.0, "1", "hwhm in y over hwhm in x", Acts.BEAM, low=0.05, high=20.0, neutral=1.0
    )
    offset_x_m: float = number(0.0, "m", "lamp centre in x", Acts.SOURCE, low=-10.0, high=10.0, neutral=0.0)
    offset_y_m: float = number(0.0, "m", "lamp centre in y", Acts.SOURCE, low=-10.0, high=10.0, neutral=0.0)
    tilt_x_deg: float = number(
        0.0, "deg", "beam axis turned towards +x", Acts.BEAM, above=-90.0, below=90.0, neutral=0.0
    )
    tilt_y_deg: float = number(
        0.0, "deg", "beam axis turned towards +y", Acts.BEAM, above=-90.0, below=90.0, neutral=0.0
    )
    apparent_distance_m: float = number(
        0.0,
        "m",
        "distance behind the window from which the light seems to come",
        Acts.BEAM | Acts.SOURCE,
        low=0.0,
        high=50.0,
        neutral=0.0,
    )
    radius_m: float = number(
        0.0, "m", "radius of a uniformly bright window", Acts.SOURCE, low=0.0, high=5.0, neutral=0.0
    )
    window_index: float = number(
        1.0,
        "1",
        "readings in air see I(theta/n)/n^2 of the beam in water",
        Acts.AIR,
        low=1.0,
        high=2.0,
        neutral=1.0,
    )
    drift_per_hour: float = number(
        0.0, "1/h", "lamp power changes by 1 + d t", Acts.TIME, low=-10.0, high=10.0, neutral=0.0
    )
    warmup_fraction: float = number(
        0.0,
        "1",
        "lamp power changes by 1 + f (1 - exp(-t/tau))",
        Acts.TIME,
        above=-1.0,
        high=10.0,
        neutral=0.0,
    )
    warmup_time_s: float = number(600.0, "s", "tau of the warm-up", Acts.TIME, above=0.0, high=1e6)
    power_w: float = number(
        50.0, "W", "radiant power of the beam over the whole spectrum", Acts.POWER, above=0.0, high=1e6
    )
    spectrum: Literal["planck", "cie-a", "table"] = declare("planck", "spectral shape", Acts.POWER)
    temperature_k: float = number(
        2900.0, "K", "temperature of the Planck spectrum", Acts.POWER, low=500.0, high=20000.0
    )
    intensity_table: TablePath | None = declare(
        None,
        "for profile table: CSV (angle_deg, intensity), IES LM-63 (.ies) or EULUMDAT (.ldt)",
        Acts.BEAM,
    )
    spectrum_table: TablePath | None = declare(
        None, "for spectrum table: CSV (wavelength_nm, power), any scale", Acts.POWER
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

    base: str = declare(
        "none", '"none", "pure", "table" or the name of a preset', Acts.BASE | COEFFICIENTS, neutral="none"
    )
    absorption_per_m: float = number(
        0.0,
        "1/m",
        "grey absorption, added to the base; below 0 for water clearer than its base",
        Acts.ABSORPTION,
        low=-100.0,
        high=100.0,
        neutral=0.0,
    )
    scattering_per_m: float = number(
        0.0, "1/m", "grey scattering, added to the base", Acts.SCATTERING, low=0.0, high=100.0, neutral=0.0
    )
    table: TablePath | None = declare(
        None,
        'for base "table": CSV (wavelength_nm, absorption_per_m, scattering_per_m)',
        Acts.BASE | COEFFICIENTS,
    )
    chlorophyll_mg_per_m3: float = number(
        0.0, "mg/m^3", "chlorophyll", COEFFICIENTS, low=0.0, high=1000.0, neutral=0.0
    )
    cdom_440_per_m: float = number(
        0.0,
        "1/m",
        "absorption of dissolved organic matter at 440 nm",
        Acts.ABSORPTION | Acts.COLOUR,
        low=0.0,
        high=100.0,
        neutral=0.0,
    )
    cdom_slope_per_nm: float = number(
        0.014,
        "1/nm",
        "exponential slope of that absorption",
        Acts.ABSORPTION | Acts.COLOUR,
        low=0.0,
        high=0.1,
    )
    sediment_g_per_m3: float = number(
        0.0, "g/m^3", "non-algal particles", COEFFICIENTS, low=0.0, high=1e4, neutral=0.0
    )
    absorption_at: tuple[tuple[Nanometres, Absorption], ...] = declare(
        (),
        "[[wavelength_nm, absorption_per_m], ...], added to the base: linear between, constant beyond",
        Acts.ABSORPTION | Acts.COLOUR,
        neutral=(),
    )
    temperature_c: float = number(20.0, "degC", "of the water", Acts.BASE | COEFFICIENTS, low=-2.0, high=40.0)
    salinity_psu: float = number(
        0.0, "1", "practical salinity", Acts.BASE | Acts.SCATTERING | Acts.COLOUR, low=0.0, high=45.0
    )
    gradient_per_m2: float = number(
        0.0, "1/m^2", "absorption grows by this per metre of z", Acts.LAYERS, low=-1.0, high=1.0, neutral=0.0
    )
    gradient_centre_m: float = number(
        3.25, "m", "z at which the gradient adds nothing", Acts.LAYERS, low=-100.0, high=100.0
    )
    layer_absorption_per_m: float = number(
        0.0,
        "1/m",
        "extra absorption of a slab across the tank",
        Acts.LAYERS,
        low=0.0,
        high=100.0,
        neutral=0.0,
    )
    layer_centre_m: float = number(6.5, "m", "z of the slab's middle", Acts.LAYERS, low=0.0, high=1000.0)
    layer_width_m: float = number(
        1.0, "m", "thickness of the slab along z", Acts.LAYERS, above=0.0, high=1000.0
    )
    hardening_per_m: float = number(
        0.0,
        "1/m",
        "q of -ln T = K r - (q r)^2 / 2 (wide band)",
        Acts.HARDENING,
        low=0.0,
        high=10.0,
        neutral=0.0,
    )
    phase: PhaseSpec = declare(HenyeyGreenstein(), "phase function", Acts.PHASE)

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
