"""A warning beside a verdict as data; its words are made here, from the data alone."""

from __future__ import annotations

from enum import Enum

from pydantic import Field, computed_field

from lightfield.diagnosis.verdict.parts import Doubt, Record
from lightfield.readings.load_warning import LoadWarning, Remarks


class Warns(str, Enum):
    """What a caution warns of."""

    TABLE = "table"
    ERRORS_DOUBTED = "errors doubted"
    SCATTER_MORE = "readings scatter more than stated"
    SCATTER_FAR_MORE = "readings scatter far more than stated"
    SCATTER_LESS = "readings scatter less than stated"
    IN_COMMON = "bands are off together"
    STATED_ON_TRUST = "stated errors on trust"
    ASSUMED_ON_TRUST = "assumed errors on trust"
    MISFIT_IGNORED = "misfit within the tolerance"
    AT_BOUNDARY = "at boundary"
    CURVE_AT_BOUNDARY = "curve at boundary"
    OF_ITS_PHASE = "scattering is that of its phase function"
    OF_THE_SCENES_PHASE = "scattering is that of the scene's phase function"
    WIDTH = "width far from the scene's"
    MORE_ABSORPTION = "absorption far above the scene's"
    LESS_ABSORPTION = "absorption far below the scene's"
    GAIN = "gain beyond the calibration"
    IMMERSED = "gain of a collector in water"
    AMPLIFIES = "water that amplifies"
    OF_BAND = "gain of a mean over the band"
    EXCHANGED = "x and y exchanged"
    OF_GLASS = "walls of glass"
    COARSE_TABLE = "lamp's table in coarse steps"
    BEYOND_TABLE = "readings beyond the lamp's table"
    ANOTHER_LAMP = "another lamp than the table's"
    UNEVEN_LAMP = "uneven lamp"
    FINEST_CURVE = "lamp's curve as fine as curves go"
    GAIN_OF_ONE = "gains of planes on one reading"
    ORDERED = "an order in what is hardly larger than the errors"
    UNSETTLED = "scattered light by the trace of the search alone"
    LEFT_OUT = "scattered and reflected light left out"
    NOT_CONVERGED = "not converged"
    NOT_CONFIRMED = "not confirmed by a fresh render"


#: What speaks of a mistake in the table or the scene, which effects then stand in for.
_MISTAKES = (
    Warns.SCATTER_FAR_MORE, Warns.WIDTH, Warns.MORE_ABSORPTION, Warns.LESS_ABSORPTION, Warns.GAIN,
    Warns.IMMERSED, Warns.OF_BAND, Warns.EXCHANGED, Warns.OF_GLASS, Warns.COARSE_TABLE, Warns.ANOTHER_LAMP,
)  # fmt: skip
#: The same of the table's own checks.
_MISTAKES_OF_TABLES = (
    Remarks.FAR_PLACES, Remarks.FAST_TIMES, Remarks.SLOW_TIMES, Remarks.LARGE_ERRORS, Remarks.TINY_ERRORS,
    Remarks.EXACT_ZEROS,
)  # fmt: skip
#: How a fresh render contradicts a fit.
_CONTRADICTED = (
    "the fresh render does not confirm the fit ({rendered_percent:.2g} % against {fitted_percent:.2g} %)"
)
_ON_TRUST = (
    "too few readings to estimate the noise from them: the {} errors are taken as they are, and the verdict "
    "is no better than they are"
)
_ABSORPTION = (
    "the fitted absorption is {{ratio:.2g}} times the scene's ({{fitted:.3g}} 1/m, not {{stated:.3g}}): "
    "check that {}, and the unit of z_m (metres from the lamp's window)"
)
#: The words, with the numbers of the record in their places.
_WORDS = {
    Warns.TABLE: "{said}",
    Warns.ERRORS_DOUBTED: "the stated errors do not go with the scatter of dark and of bright readings: "
    "errors with a dark floor and a part in proportion were estimated from the readings instead",
    Warns.SCATTER_MORE: "the readings scatter {times:.1f} times as much as their errors say: these are too "
    "small, or something changes from reading to reading",
    Warns.SCATTER_FAR_MORE: "the readings scatter {times:.0f} times as much as their errors say: are these "
    "standard errors, in the unit of the readings, and not relative ones?",
    Warns.SCATTER_LESS: "the readings scatter {times:.1f} times less than their errors say: are these "
    "standard errors, in the unit of the readings?",
    Warns.IN_COMMON: "the bands of one spectrum are off together by {percent:.2g} % of the light, as their "
    "scatter shows and the table does not say: a lamp that flickers, or places that are a little off; it is "
    "taken for an error that they share (state common_percent, or position_mm)",
    Warns.STATED_ON_TRUST: _ON_TRUST.format("stated"),
    Warns.ASSUMED_ON_TRUST: _ON_TRUST.format("assumed"),
    Warns.UNEVEN_LAMP: "only the direction of the light tells of {about}: a lamp with another uneven beam "
    "may do the same; turn the lamp by 90 degrees about its axis and read again: what turns too is its own",
    Warns.FINEST_CURVE: "the lamp's curve takes as many functions as there are: {about} may stand for detail "
    "that it leaves out, an edge or a ring; measure the lamp with a fine step, and state its table (in air "
    "behind a flat window its angles are 1.34 times those in water: lamp.table_width)",
    Warns.GAIN_OF_ONE: "gains of {planes:g} of the planes rest on one reading each, where a slip looks the "
    "same: read again first at z = {z_m:.4g} m, which is {percent:.2g} % off its neighbours",
    Warns.ORDERED: "what is left is hardly larger than the errors ({times:.2g} times), and yet has an order: "
    "it goes with {about} (p = {p:.1g}; below {limit:.1g} is no chance): a small effect that is missing, or "
    "errors that neighbours share",
    Warns.UNSETTLED: "scattered light is that of one trace in other water, weighed anew, as the beam is not "
    "round or the receiver no cosine collector: what is fitted may be off by several of its errors",
    Warns.LEFT_OUT: "the scene scatters or reflects light that was not traced and is not in the model: the "
    "fit may take it for something else",
    Warns.MISFIT_IGNORED: "a significant misfit is smaller than the tolerance and was ignored",
    Warns.AT_BOUNDARY: "{about} lies at the edge of its plausible range ({fitted:g}): not a finding",
    Warns.CURVE_AT_BOUNDARY: "the curve {about} lies at the edge of its plausible range (in {functions:g} of "
    "its functions): not a finding",
    Warns.OF_ITS_PHASE: "b and g, and the absorption beside them, are those of a Henyey-Greenstein phase "
    "function; where the water's own is "
    "more peaked, its b is larger than this one (in rendered waters up to twice after Petzold, up to four "
    "times after Fournier and Forand): put it into the scene if b itself matters "
    '(of "fournier-forand" the slope mu is fitted with b)',
    Warns.OF_THE_SCENES_PHASE: "{about} belongs to the scene's phase function, which is taken as right: its "
    "error does not know that of g (0.006 of it were 4 errors in light walked with another one)",
    Warns.WIDTH: "the fitted width is {ratio:.2g} times the scene's (a half width of {fitted:.3g}, "
    "not {stated:.3g} degrees): check the unit of x_m and y_m (metres from the axis, not a diameter), and "
    "that the scene's is a half width at half maximum, not a full one",
    Warns.MORE_ABSORPTION: _ABSORPTION.format(
        "the scene's is a natural, not a decadic, coefficient of absorption"
    ),
    Warns.LESS_ABSORPTION: _ABSORPTION.format("these readings were taken in water (column medium)"),
    Warns.GAIN: "the readings are {ratio:.3g} times what the scene's lamp of {power_w:g} W gives, and "
    "calibrated to {calibration_percent:g} %: check their unit, or lamp.power_w",
    Warns.IMMERSED: "a collector that was calibrated in air, of an immersion factor of {factor:.3g}, would "
    "read just so in water: if that is left out of these readings, state it (detector.immersion_factor); "
    "in water alone it is as another lamp.power_w",
    Warns.AMPLIFIES: "the water that fits best would have to give light back (its attenuation comes down to "
    "{least_per_m:.2g} 1/m): a straight gradient or drift holds only so far; read the attenuation at both "
    "ends of the tank, at the beginning and at the end of the scan",
    Warns.OF_BAND: "means over the band would be {ratio:.3g} times what is read at the stated wavelengths: "
    "if these readings are such, leave wavelength_nm out",
    Warns.EXCHANGED: "with x_m and y_m exchanged the scene comes much nearer to the readings (chi2 per "
    "reading {exchanged:.2g} instead of {as_given:.2g}): check the columns",
    Warns.OF_GLASS: "walls of bare glass with air behind ({about}) come nearer to the readings, with nothing "
    "else missing, than what was found (chi2 per reading {glass:.2g}, not {found:.2g}): if the tank has "
    "them, state {about} and tank.pane_reflectance = 0, and diagnose again",
    Warns.COARSE_TABLE: "the lamp's table has steps of {step_deg:.2g} degrees, and smooth beams through them "
    "differ by up to {percent:.2g} % in the light of these readings: effects of lamp and receiver may "
    "stand in for that; measure it in finer steps",
    Warns.BEYOND_TABLE: "{beyond:g} of {readings:g} readings are left out: they lie {from_deg:.3g} degrees "
    "or farther from the beam's axis, where the lamp's table does not know its light to a fifth: measure the "
    "lamp as far as that, or fit it to readings that reach so far (with a Gaussian beam in the scene)",
    Warns.ANOTHER_LAMP: "the lamp's table is not that of these readings: from a Gaussian beam of "
    "{width_deg:.3g} degrees on they are explained better (chi-square, with the price of what is set free, "
    "{better:.0f} less), and what is said here is said beside that: check that it is the table of this lamp, "
    "in degrees from its axis, and in water",
    Warns.NOT_CONVERGED: "the fit was stopped before it stood still: one step more would lower chi-square by "
    "{gain:.2g} and move {about} by {sigma:.2g} of its error; begin nearer to the end (with the fitted scene "
    "that -o writes), or leave out one of the effects that hang together",
    Warns.NOT_CONFIRMED: _CONTRADICTED + ": the explanation is no better than the former",
}


class Caution(Record):
    """Something to be warned of."""

    warns: Warns
    about: str | None = Field(
        None,
        description="the parameter or the effects that it speaks of; of a table its warning's stable name",
    )
    values: dict[str, float] = Field(default_factory=dict, description="the numbers it rests on, by name")
    table: LoadWarning | None = Field(None, description="what the table's own checks say, where it is that")

    @computed_field(description="`table` in words: what is the matter, and what would help")
    @property
    def said(self) -> str | None:
        return None if self.table is None else str(self.table)

    @computed_field(description="the caution in words")
    @property
    def sentence(self) -> str:
        return _WORDS[self.warns].format(about=self.about, said=self.said, **self.values)

    @property
    def speaks_of_a_mistake(self) -> bool:
        """Would effects stand in for a mistake in the table or the scene?"""
        return self.warns in _MISTAKES or (self.table is not None and self.table.code in _MISTAKES_OF_TABLES)

    @classmethod
    def of_table(cls, warning: LoadWarning) -> Caution:
        """What the table's own checks say."""
        return cls(warns=Warns.TABLE, about=warning.code.value, table=warning)


def not_confirmed(why: Doubt) -> str:
    """How a fresh render contradicts a fit."""
    return _CONTRADICTED.format(rendered_percent=why.rendered_percent, fitted_percent=why.fitted_percent)
