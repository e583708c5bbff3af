"""What a scene says about the detectors. One field is one parameter."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, ClassVar, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from lightfield.errors import RuleError
from lightfield.scene.acts import Acts
from lightfield.scene.curve import Curve, ShownCurve
from lightfield.scene.parameters import Nanometres, Part, TablePath, declare, number
from lightfield.scene.spectral.detector_response import COLUMNS, DetectorResponse
from lightfield.scene.spectral.peaks import Peak, way_written
from lightfield.storage.tables import read_columns, readable

Metres = Annotated[float, Field(strict=True)]
#: Wavelengths of maps and images that are nearer to each other are one, nm.
_SAME_NM = 1e-6
PositiveMetres = Annotated[float, Field(strict=True, gt=0.0)]


class Detector(Part):
    """Receivers that face the lamp (-z), on planes or at single positions, with their readout."""

    tables_of: ClassVar[Mapping[str, str]] = {"response_table": "response"}

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
        None, "m", "width of a plane in x; when absent 2 m, or the tank's width if less",
        Acts.PLACES, above=0.0, high=1e4,
    )  # fmt: skip
    height_m: float | None = number(
        None, "m", "height of a plane in y; when absent the width, up to the tank's floor and top",
        Acts.PLACES, above=0.0,
    )  # fmt: skip
    pixels: int = number(
        65, "1", "pixels along the width, and along a height that is not stated",
        Acts.PLACES, low=1, high=4096,
    )  # fmt: skip
    positions_m: tuple[tuple[Metres, Metres, PositiveMetres], ...] | None = declare(
        None, "single positions [x, y, z] instead of planes", Acts.PLACES, unit="m"
    )
    bands_nm: tuple[tuple[Nanometres, Nanometres], ...] = declare(
        ((500.0, 550.0),), "wavelength bands [from, to]", Acts.PLACES, unit="nm"
    )
    response: (
        Annotated[
            Annotated[Literal["silicon", "table"], Tag("a name")]
            | Annotated[Peak, Tag("one peak")]
            | Annotated[tuple[Peak, ...], Field(min_length=1), Tag("several peaks")],
            Discriminator(way_written),
        ]
        | None
    ) = declare(
        None,
        "weight of wavelengths in a band, of detector and filter: a name, a peak { peak_nm, fwhm_nm }, or a "
        "list of peaks; absent: all alike",
        Acts.POWER,
        later=True,
    )
    response_table: TablePath | None = declare(
        None, "for response table: CSV (wavelength_nm, response), any scale", Acts.POWER, later=True
    )
    lag_m: float = number(
        0.0, "m", "what is read lies so far behind the stated places, along the way from one to the next",
        Acts.MOTION, low=-1.0, high=1.0, neutral=0.0, later=True,
    )  # fmt: skip
    wavelength_shift_nm: float = number(
        0.0, "nm", "what is read lies so far above the wavelengths and bands that are stated",
        Acts.PLACES, low=-50.0, high=50.0, neutral=0.0,
    )  # fmt: skip
    second_order: float = number(
        0.0, "1",
        "part of the signal at half the wavelength that is read with it, where both are in one spectrum",
        Acts.READOUT, low=0.0, high=1.0, neutral=0.0, later=True,
    )  # fmt: skip
    stray_light: float = number(
        0.0, "1",
        "part of each wavelength's signal that is replaced by the mean of all that are read at once",
        Acts.READOUT, low=0.0, high=1.0, neutral=0.0,
    )  # fmt: skip
    background: float = number(
        0.0, "reading", "constant reading from ambient light or dark signal",
        Acts.READOUT, low=-1e9, high=1e9, neutral=0.0,
    )  # fmt: skip
    background_drift_per_hour: float = number(
        0.0, "1/h", "background changes by 1 + d t",
        Acts.READOUT, low=-1000.0, high=1000.0, neutral=0.0,
    )  # fmt: skip
    background_step: float = number(
        0.0, "reading", "added to the background from a moment on: ambient light that is switched",
        Acts.READOUT, low=-1e9, high=1e9, neutral=0.0, later=True,
    )  # fmt: skip
    background_step_s: float = number(
        0.0, "s", "when it is added", Acts.READOUT, low=-1e12, high=1e12, later=True
    )
    background_step_for_s: float = number(
        0.0, "s", "how long it stays; 0: to the end", Acts.READOUT, low=0.0, high=1e12, later=True
    )
    background_step_over_s: float = number(
        10.0, "s", "within this time before and after the moment most of it comes (tanh), or goes",
        Acts.READOUT, above=0.0, high=1e12, later=True,
    )  # fmt: skip
    background_course: ShownCurve = declare(
        (), "[[time_s, reading], ...] added to the background: linear between, constant beyond",
        Acts.READOUT, neutral=(), later=True,
    )  # fmt: skip
    background_departure: ShownCurve = declare(
        (), "[[wavelength_nm, reading], ...] added to the background: linear between, constant beyond",
        Acts.READOUT, neutral=(), later=True,
    )  # fmt: skip
    saturation: float = number(
        0.0, "1", "k of s / (1 + k s), s relative to the largest reading",
        Acts.READOUT, low=0.0, high=10.0, neutral=0.0,
    )  # fmt: skip
    saturation_quadratic: float = number(
        0.0, "1", "k of s (1 - k s), s relative to the largest reading",
        Acts.READOUT, low=0.0, high=0.5, neutral=0.0,
    )  # fmt: skip
    plane_departure: Curve = declare(
        (), "[[z_m, ln of a factor], ...] on the signal at each distance: linear between, constant beyond",
        Acts.READOUT, neutral=(), later=True,
    )  # fmt: skip
    immersion_factor: float = number(
        1.0, "1",
        "irradiance in water over that in air which gives the same reading; readings in water are divided",
        Acts.READOUT, low=0.5, high=2.5, neutral=1.0,
    )  # fmt: skip
    acceptance_hwhm_deg: float = number(
        0.0, "deg", "half width of a Gaussian acceptance; 0 means unlimited, as hundreds and more nearly are",
        Acts.RECEIVER, low=0.0, high=1e5, neutral=0.0,
    )  # fmt: skip
    cosine_error: float = number(
        0.0, "1", "relative error of the cosine response at 60 degrees; it grows with 1 - cos",
        Acts.RECEIVER, low=-0.5, high=0.5, neutral=0.0,
    )  # fmt: skip
    tilt_x_deg: float = number(
        0.0, "deg", "receiver axis turned towards +x", Acts.RECEIVER, above=-90.0, below=90.0, neutral=0.0
    )

    @property
    def distances_m(self) -> tuple[float, ...]:
        """Distances that are read, rising, m: of the planes, or of the single positions instead of them."""
        single = self.positions_m
        return self.planes_m if single is None else tuple(sorted({z for _, _, z in single}))

    @property
    def bands_read_nm(self) -> tuple[tuple[float, float], ...]:
        """What is read where `bands_nm` are stated, by `wavelength_shift_nm`."""
        shift = self.wavelength_shift_nm
        return tuple((low + shift, high + shift) for low, high in self.bands_nm)

    @property
    def spectral_response(self) -> DetectorResponse:
        """What its response makes of light over wavelength."""
        return DetectorResponse(self.response, self.response_table)

    @model_validator(mode="after")
    def _places_and_bands(self) -> Detector:
        if not self.planes_m and not self.positions_m:
            raise RuleError("there is something to measure", "give planes_m or positions_m")
        for name in ("acceptance_hwhm_deg", "cosine_error"):
            if getattr(self, name) and self.quantity != "irradiance":
                raise RuleError(f"{name} is for irradiance", "set it to 0", found=self.quantity)
        if any(b <= a for a, b in zip(self.planes_m, self.planes_m[1:], strict=False)):
            raise RuleError("planes_m must rise", "sort them, drop doubles", found=[*self.planes_m])
        if not self.bands_nm:
            raise RuleError("there is a wavelength band", "give bands_nm = [[500, 550]]")
        for low, high in self.bands_nm:
            if high <= low:
                raise RuleError("a band must rise", "write [from, to]", found=[low, high])
        for one, other in pairwise(sorted(self.bands_nm, key=sum)):
            if sum(other) - sum(one) < 2 * _SAME_NM:
                raise RuleError(
                    "bands are told apart by their middles",
                    "move one of them a little, or write two scenes",
                    found=[[*one], [*other]],
                )
        self._sees_its_bands()
        return self

    def _sees_its_bands(self) -> None:
        if self.response == "table" and self.response_table is None:
            raise RuleError('response "table" needs response_table', "add response_table")
        if self.response_table is not None:
            readable(read_columns, self.response_table, COLUMNS)
        if self.response is None:
            return
        shift = self.wavelength_shift_nm
        beside = {"wavelength_shift_nm": shift} if shift else {}
        for low, high in self.bands_read_nm:
            inside = [at for at in self.spectral_response.knots_nm.tolist() if low < at < high]
            if not self.spectral_response.at([low, 0.5 * (low + high), high, *inside]).max() > 0:
                raise RuleError(
                    "the response sees something of every band",
                    "correct response or bands_nm" + (", or wavelength_shift_nm" if shift else ""),
                    found={"band": [low - shift, high - shift], **beside},
                )
