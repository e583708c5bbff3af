"""What a verdict is made of, as data."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field, computed_field, model_validator

from lightfield.diagnosis.adequacy.structure import Structure
from lightfield.diagnosis.certainty import Certainty
from lightfield.diagnosis.problem.untestable import Hindrance, in_words
from lightfield.wording import Word


class Kind(Word):
    """What a verdict comes to: nothing is missing, these effects are, one of several sets, or not known."""

    NONE = "none"
    IDENTIFIED = "identified"
    AMBIGUOUS = "ambiguous"
    UNEXPLAINED = "unexplained"


class Record(BaseModel):
    """Plain data that nothing changes."""

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="null")

    @model_validator(mode="before")
    @classmethod
    def _read(cls, given: object) -> object:
        """Words that are read back are no data, and nought has no sign."""
        if not isinstance(given, dict):
            return given
        data = {k: v for k, v in given.items() if k not in cls.model_computed_fields}
        return {k: 0.0 if isinstance(v, float) and v == 0 else v for k, v in data.items()}


class Reason(Word):
    """Why a fitted number has no error, as every report says it."""

    HELD = "held"
    AT_BOUNDARY = "at boundary"
    DID_NOT_MOVE = "did not move the model"
    UNDETERMINED = "undetermined"
    TOO_WIDE = "undetermined: error wider than the allowed range"
    NONE = "none at all"
    SUDDEN = "as sudden as these readings tell"
    BENDS_NO_MORE = "bends no more"
    BEFORE_ALL = "before all readings"

    @property
    def short(self) -> Reason:
        """The same without its cause."""
        return Reason.UNDETERMINED if self is Reason.TOO_WIDE else self


class Estimate(Record):
    """A fitted number."""

    value: float
    stderr: float | None = Field(None, description="standard error; absent for the reason given")
    stderr_of_set: float | None = Field(
        None,
        description="the standard error if the named effects are all that act; absent: as large as stderr, "
        "which also knows of effects too small to be named and of sets that do as well; or of another set",
    )
    unit: str = "1"
    reason: Reason | None = Field(None, description="why there is no error")


class AcceptedExplanation(Record):
    """A smallest set of effects beside which nothing is missing."""

    effects: list[str]
    families: list[str]
    forms: list[str] = Field(description="functional form of each effect")
    weight: float = Field(description="relative evidence among the accepted sets and nothing else")
    parameters: dict[str, Estimate] = Field(description="by dotted path, nuisance parameters included")
    chi2_per_dof: float = Field(description="in units of the quoted errors and the error budget")
    error_percent: float | None = Field(
        description="rms residual over readings above 5 % of their plane's maximum and five of their errors; "
        "null: the model is dark"
    )
    held_out_percent: float | None = Field(description="the same, each plane predicted from the others")
    adequacy_p: float = Field(description="probability of so bad a worst test if nothing were missing")


class WaterAndBeam(Record):
    """What a fit says of the water at the shortest wavelength, and of the beam."""

    wavelength_nm: float
    absorption_per_m: float
    scattering_per_m: float
    attenuation_per_m: float = Field(description="K = a + b")
    attenuation_stderr_per_m: float | None = Field(
        None, description="of the best set, where one fitted value alone moves K; of several it is not known"
    )
    hwhm_deg: float = Field(
        description="where the beam is half as bright as where it is brightest; of an oval one that of its "
        "profile, which its sections are wider or narrower than"
    )
    oval_hwhm_deg: tuple[float, float] | None = Field(
        None, description="of an oval beam the same where it is narrowest and where it is widest"
    )


class FoundEffect(Record):
    """An effect of the best set, and how sure it is."""

    effect: str
    family: str
    form: str
    level: Certainty = Field(
        description="certain: no other set of about as many effects does as well; simplest: only sets with "
        "more parameters do, and not much better; one of: it or what may replace it; partial: certain as far "
        "as the unexplained rest allows"
    )
    parameters: dict[str, Estimate] = Field(description="its size, by dotted path")
    rms_percent: float | None = Field(
        None,
        description="of a curve: weighted rms change of the logarithm of the readings, in per cent",
    )
    sigma_to_remove: float | None = Field(
        None, description="by which the others, refitted, are worse without it"
    )
    gap: float | None = Field(
        None, description="cost of the best set without it above that of the best; null: none is known"
    )
    gap_named: float | None = Field(None, description="the same, without curves that it is a special case of")
    gap_plus: float | None = Field(
        None, description="gap_named among sets with at most one effect more, all parameters counted alike"
    )
    rival: list[str] = Field(default_factory=list, description="the best set without it")
    alternatives: list[list[str]] = Field(
        default_factory=list, description="what replaces it in sets that are accepted too"
    )
    beyond: list[str] = Field(
        default_factory=list,
        description="effects at an end of their range: were they larger, this one would not be needed",
    )
    other_lamp: bool = Field(
        False, description="a lamp of another shape would do what it and others of the set do"
    )
    lamp_detail: bool = Field(
        False, description="it may stand for detail of the lamp that the finest curve leaves out"
    )
    of_scene: bool = Field(
        False, description="the scene states it: what is sure is that its size is another, or none (`stated`)"
    )
    weight: float = Field(1.0, description="share of exp(-cost/2) of all sets with it; decides nothing")
    hardly_tested: bool = Field(
        False, description="a curve that would follow nearly any readings at these places"
    )
    with_it: WaterAndBeam
    without_it: WaterAndBeam | None = Field(None, description="refitted without this effect")

    @property
    def is_taken_away(self) -> bool:
        """Does the scene have it, and the best set not?"""
        return self.of_scene and all(one.reason is Reason.HELD for one in self.parameters.values())


class Unnamed(Record):
    """An effect that is too small to be named, and changes values by more than the errors of the best set; or
    its lamp's curve in more detail."""

    effect: str
    sigma: float = Field(description="by how much the readings ask for it; less than its price")
    with_it: dict[str, Estimate] = Field(description="what these values of the best set would be with it")
    in_errors: bool = Field(False, description="the stated errors reach what they would be")
    stated: bool = Field(False, description="the scene has it: what is too small is another size of it")


class NearestRival(Record):
    """The next explanation and its distance."""

    effects: list[str]
    separation_sigma: float


class DetectionLimit(Record):
    """Smallest size that would have been seen with 95 % probability."""

    parameter: str
    value: float
    unit: str
    within_range: bool = Field(description="false: not even its largest plausible size would have been seen")


#: A prediction that is off by more tells nothing by how much, %. Chosen: words and pictures alone.
FAR_OFF_PERCENT = 1000.0


class Rung(Record):
    """One step of the ladder from the base model to the explanation."""

    label: str
    effects: list[str]
    error_percent: float | None = Field(
        description="rms of reading less model over model; null: the model is dark where readings are bright"
    )
    chi2_per_dof: float
    held_out_percent: float | None
    parameters: dict[str, Estimate]
    scene: str = Field(description="the fitted scene as TOML; a comparison with it gives this rung again")
    removed_percent: float | None = Field(
        None, description="share of the base model's misfit, beyond noise, that this rung removes"
    )
    rendered_error_percent: float | None = Field(None, description="error of a fresh render of that scene")
    rendered_stderr_percent: float | None = Field(None, description="Monte Carlo error of that render")


#: A stated size that the search let stand is contradicted only from here on, in sigma: the adequacy test is
#: the judge. Chosen: noise alone goes there once in 1.7 million, to half of it too often
#: (test_refutation.py).
CONTRADICTED_SIGMA = 5.0


class Judgement(Word):
    """What readings say of an effect that the scene has."""

    SUPPORTED = "supported"
    UNDECIDED = "undecided"
    CONTRADICTED = "contradicted"
    ABSENT = "absent"
    HELD = "held"

    @property
    def contradicts_scene(self) -> bool:
        """Is the effect there, but of another size, or not there at all?"""
        return self in (Judgement.CONTRADICTED, Judgement.ABSENT)


class StatedEffect(Record):
    """An effect that the scene itself has, and what the readings say of it."""

    effect: str | None = Field(description="absent for what no effect of the table sets free")
    judgement: Judgement = Field(
        description="contradicted: of another size; absent: that, and met as well without it; undecided: "
        "these readings do not tell; held: not tested, taken as stated"
    )
    stated: dict[str, float] = Field(description="the scene's values by dotted path")
    neutral: dict[str, float] = Field(default_factory=dict, description="what would switch it off")
    fitted: dict[str, Estimate] = Field(
        default_factory=dict, description="the same when fitted beside the best explanation"
    )
    beside: list[str] = Field(
        default_factory=list, description="effects of the best explanation that were free with it"
    )
    limit: float | None = Field(
        None,
        description="95 % limit of its one amplitude's distance from the neutral value",
    )
    sigma_from_stated: float | None = None
    sigma_to_remove: float | None = None
    held_by: list[Hindrance] = Field(default_factory=list, description="why it was held")
    if_free: dict[str, Estimate] = Field(
        default_factory=dict,
        description="held while the rest was fitted: values of that rest which are another, or much less "
        "sure, with this effect free",
    )

    @computed_field(description="`held_by` in words")
    @property
    def reason(self) -> str | None:
        return in_words(self.held_by) or None


class PlaceToRead(Record):
    """Readings to take."""

    x_m: float
    y_m: float
    z_m: float
    medium: str
    repeats: int


class WhyAside(Word):
    """Why a reading took no part."""

    OUTLIER = "outlier"
    SATURATED = "saturated"
    BEYOND_TABLE = "beyond the lamp's table"


class SetAside(Record):
    """A reading that took no part in the fit."""

    row: int = Field(description="row of the table, from 0")
    reason: WhyAside
    x_m: float
    y_m: float
    z_m: float
    medium: str
    wavelength_nm: float | None
    off_sigma: float | None = Field(description="(reading - model) / standard error; none if saturated")


class Misfit(Record):
    """An unexplained misfit that depends on one coordinate alone."""

    coordinate: str
    worst_at: float = Field(
        description="where along it the readings depart most, in m, degrees, minutes or nm"
    )
    period_deg: float | None = Field(None, description="of a misfit that is periodic in the angle")
    period_s: float | None = Field(None, description="of a misfit that is periodic in time")
    like: str | None = Field(None, description="local unknown that describes it best, if one does")
    at_one: bool = Field(False, description="it lies at that one place along the coordinate")


class LeftOver(Record):
    """A local unknown beside what is known: where and how large the rest is that nothing explains."""

    name: str
    formula: str = Field(description="with its parameters by name")
    stage: str = Field(description="where it acts, as for effects of the user's own")
    coordinate: str = Field(description="along which its curve is told: x, y, time, angle or signal")
    beside: list[str] = Field(description="effects that are left beside it")
    parameters: dict[str, Estimate]
    removed_percent: float = Field(description="share of the misfit left by the best set that it removes")
    error_percent: float | None = Field(description="error of the readings with it; null: it is dark")
    adequate: bool = Field(description="nothing is missing beside it")
    at: list[float] = Field(description="along the coordinate, in m, degrees or minutes")
    factor: list[float] = Field(description="what it makes of the light there, one where nothing")
    stderr: list[float]
    read_at: list[float] = Field(
        default_factory=list, description="bright readings it acts on, along the coordinate"
    )
    read: list[float] = Field(
        default_factory=list, description="these over the model with everything but the unknown"
    )


class DoubtReason(Word):
    """Why no effect can be named, and none ruled out."""

    NOTHING_BRIGHT = "no bright reading is left"
    NOISE = "too much noise"
    COARSE = "the readings come in steps"
    FLAT = "the readings do not change from place to place"
    NO_BETTER = "a constant tells the readings as well as the model"
    PINNED = "the readings ask for what is impossible"
    SET_ASIDE = "readings set aside are no slips"
    NOT_CONFIRMED = "a fresh render does not confirm the fit"
    SCATTER = "the readings scatter far more than stated"


class Doubt(Record):
    """Why nothing is named or ruled out whatever was found."""

    reason: DoubtReason
    noise_percent: float | None = Field(
        None, description="median error of a bright reading, or of its rounding"
    )
    pinned: dict[str, float] = Field(
        default_factory=dict, description="parameters of the base model at the edge of what is possible"
    )
    structure: Structure | None = Field(None, description="what the readings set aside have in common")
    named: list[str] = Field(default_factory=list, description="effects that were not confirmed")
    fitted_percent: float | None = Field(None, description="error of the fit that was not confirmed")
    rendered_percent: float | None = Field(None, description="error of the fresh render of it")
    times: float | None = Field(None, description="scatter over the stated errors")

    @property
    def leaves_names(self) -> bool:
        """Does what was found hold for the readings, but for some, or for what they scatter by?"""
        return self.reason in (DoubtReason.SET_ASIDE, DoubtReason.SCATTER)
