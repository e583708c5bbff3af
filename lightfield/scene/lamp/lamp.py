"""What a scene says about the lamp. One field is one parameter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from lightfield.errors import RuleError
from lightfield.scene.acts import Acts
from lightfield.scene.curve import BeamCurve, Curve
from lightfield.scene.lamp.photometry import beam_table
from lightfield.scene.parameters import Part, TablePath, declare, number
from lightfield.scene.spectral.peaks import Peak, way_written
from lightfield.storage.tables import read_columns, readable

#: Names of spectra; those of LEDs are in `spectral.peaks`.
SpectrumName = Literal[
    "planck", "cie-a", "table", "led-royal-blue", "led-blue", "led-cyan", "led-green", "led-amber", "led-red",
    "led-deep-red", "led-white", "led-warm-white",
]  # fmt: skip
Several = Annotated[tuple[Peak, ...], Field(min_length=1)]
SECTION = Acts.BEAM | Acts.SECTION
#: The family of which each profile is the plain Gaussian with more of its parameters.
_GAUSSIAN = ("profile", "gaussian", "super-gaussian", "two-component")


class Lamp(Part):
    """The source; Gaussian family: exp(-ln2 (theta/hwhm)^m) + f exp(-ln2 (theta/hwhm_s)^2)."""

    tables_of: ClassVar[Mapping[str, str]] = {"intensity_table": "profile", "spectrum_table": "spectrum"}

    profile: Literal["gaussian", "super-gaussian", "two-component", "table", "isotropic", "pencil"] = declare(
        "gaussian", "angular shape of the beam", Acts.BEAM
    )
    hwhm_deg: float = number(
        3.81, "deg", "half width of the beam at half maximum",
        Acts.BEAM, low=0.05, high=90.0, only_for=_GAUSSIAN,
    )  # fmt: skip
    shape_exponent: float = number(
        2.0, "1", "m of exp(-ln2 (theta/hwhm)^m)",
        Acts.BEAM, low=0.2, high=50.0, neutral=2.0, only_for=_GAUSSIAN,
    )  # fmt: skip
    skirt_fraction: float = number(
        0.0, "1", "on-axis intensity of the skirt over that of the core",
        Acts.BEAM, low=0.0, high=10.0, neutral=0.0, only_for=_GAUSSIAN,
    )  # fmt: skip
    skirt_hwhm_deg: float = number(
        15.0, "deg", "half width of the skirt at half maximum",
        Acts.BEAM, low=0.05, high=90.0, only_for=_GAUSSIAN,
    )  # fmt: skip
    ellipticity: float = number(
        1.0, "1", "hwhm in y over hwhm in x", SECTION, low=0.05, high=20.0, neutral=1.0
    )
    ellipticity_diagonal: float = number(
        1.0, "1", "hwhm towards +x+y over hwhm towards +x-y, of a beam that is as wide in y as in x",
        SECTION, low=0.05, high=20.0, neutral=1.0, later=True,
    )  # fmt: skip
    asymmetry_x: float = number(
        0.0, "1", "the beam is wider by this part towards +x, and narrower towards -x",
        SECTION, low=-0.6, high=0.6, neutral=0.0, later=True,
    )  # fmt: skip
    asymmetry_y: float = number(
        0.0, "1", "the beam is wider by this part towards +y, and narrower towards -y",
        SECTION, low=-0.6, high=0.6, neutral=0.0, later=True,
    )  # fmt: skip
    width_slope: float = number(
        0.0, "1", "kappa of the beam's width: its angles are (wavelength / 550 nm)^kappa times as large",
        Acts.BEAM_COLOUR, low=-2.0, high=2.0, neutral=0.0, later=True,
    )  # fmt: skip
    offset_x_m: float = number(0.0, "m", "lamp centre in x", Acts.SOURCE, low=-10.0, high=10.0, neutral=0.0)
    offset_y_m: float = number(0.0, "m", "lamp centre in y", Acts.SOURCE, low=-10.0, high=10.0, neutral=0.0)
    tilt_x_deg: float = number(
        0.0, "deg", "beam axis turned towards +x", Acts.BEAM, above=-90.0, below=90.0, neutral=0.0
    )
    tilt_y_deg: float = number(
        0.0, "deg", "beam axis turned towards +y", Acts.BEAM, above=-90.0, below=90.0, neutral=0.0
    )
    apparent_distance_m: float = number(
        0.0, "m",
        "distance z0 behind the window, along the tank, from which the light seems to come (a lamp that is "
        "turned about its window is offset by -z0 tan(tilt) too); below 0 in front of it, as where a range "
        "scale reads too long",
        Acts.BEAM | Acts.SOURCE, low=-1.0, high=50.0, neutral=0.0,
    )  # fmt: skip
    radius_m: float = number(
        0.0, "m", "radius of a uniformly bright window", Acts.SOURCE, low=0.0, high=5.0, neutral=0.0
    )
    window_index: float = number(
        1.0, "1", "readings in air see I(theta/n)/n^2 of the beam in water",
        Acts.AIR, low=1.0, high=2.0, neutral=1.0,
    )  # fmt: skip
    drift_per_hour: float = number(
        0.0, "1/h", "lamp power changes by 1 + d t", Acts.TIME, low=-10.0, high=10.0, neutral=0.0
    )
    warmup_fraction: float = number(
        0.0, "1", "lamp power changes by 1 + f (1 - exp(-t/tau))",
        Acts.TIME, above=-1.0, high=10.0, neutral=0.0,
    )  # fmt: skip
    warmup_time_s: float = number(600.0, "s", "tau of the warm-up", Acts.TIME, above=0.0, high=1e6)
    power_w: float = number(
        50.0, "W", "radiant power of the beam over the whole spectrum", Acts.POWER, above=0.0, high=1e6
    )
    spectrum: Annotated[
        Annotated[SpectrumName, Tag("a name")]
        | Annotated[Peak, Tag("one peak")]
        | Annotated[Several, Tag("several peaks")],
        Discriminator(way_written),
    ] = declare(
        "planck", "spectral shape: a name, a peak { peak_nm, fwhm_nm }, or a list of them", Acts.POWER
    )
    temperature_k: float = number(
        2900.0, "K", "temperature of the Planck spectrum",
        Acts.POWER, low=500.0, high=20000.0, only_for=("spectrum", "planck"),
    )  # fmt: skip
    intensity_table: TablePath | None = declare(
        None,
        "for profile table: CSV (angle_deg, intensity; phi_deg), IES LM-63 (.ies) or EULUMDAT (.ldt)",
        Acts.BEAM,
    )
    table_width: float = number(
        1.0, "1", "the beam of a table is so many times as wide as the table says",
        Acts.BEAM, low=0.2, high=5.0, neutral=1.0, only_for=("profile", "table"), later=True,
    )  # fmt: skip
    spectrum_table: TablePath | None = declare(
        None, "for spectrum table: CSV (wavelength_nm, power), any scale", Acts.POWER
    )

    profile_departure: BeamCurve = declare(
        (),
        "[[angle_deg, ln of a factor], ...] on the intensity of the profile: linear between, constant beyond",
        Acts.BEAM, neutral=(), later=True,
    )  # fmt: skip
    spectrum_departure: Curve = declare(
        (), "[[wavelength_nm, ln of a factor], ...] on the spectral power: linear between, constant beyond",
        Acts.POWER, neutral=(), later=True,
    )  # fmt: skip
    power_departure: Curve = declare(
        (), "[[time_s, ln of a factor], ...] on the lamp power: linear between, constant beyond",
        Acts.TIME, neutral=(), later=True,
    )  # fmt: skip

    @property
    def least_distance_m(self) -> float:
        """Of places from the window, m: twice as far as a point in front of it from which the light comes."""
        return max(-2 * self.apparent_distance_m, 0.0)

    @model_validator(mode="after")
    def _profile_has_its_parameters(self) -> Lamp:
        needs = {
            "super-gaussian": "shape_exponent",
            "two-component": "skirt_fraction",
            "table": "intensity_table",
        }.get(self.profile)
        if needs and needs not in self.model_fields_set:
            raise RuleError(f'profile "{self.profile}" needs {needs}', f"add {needs}")
        if self.profile_departure and self.profile in ("isotropic", "pencil"):
            raise RuleError(
                f'profile "{self.profile}" has no angle to depart by', "leave profile_departure out"
            )
        if self.spectrum == "table" and self.spectrum_table is None:
            raise RuleError('spectrum "table" needs spectrum_table', "add spectrum_table")
        if self.intensity_table is not None:
            readable(beam_table, self.intensity_table)
        if self.spectrum_table is not None:
            readable(read_columns, self.spectrum_table, ("wavelength_nm", "power"))
        return self
