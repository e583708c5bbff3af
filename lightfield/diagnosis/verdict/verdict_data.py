"""What did a diagnosis find? A verdict as data, before its words."""

from __future__ import annotations

from pydantic import Field, computed_field

from lightfield.diagnosis.certainty import Certainty
from lightfield.diagnosis.problem.assumed import Assumed
from lightfield.diagnosis.problem.untestable import Hindrance
from lightfield.diagnosis.verdict.cautions.caution import Caution
from lightfield.diagnosis.verdict.next_measurement import NextMeasurement
from lightfield.diagnosis.verdict.parts import (
    AcceptedExplanation,
    DetectionLimit,
    Doubt,
    FoundEffect,
    Kind,
    LeftOver,
    Misfit,
    NearestRival,
    Record,
    Rung,
    SetAside,
    StatedEffect,
    Unnamed,
)


class Explained(Record):
    """What the readings are explained by."""

    verdict: Kind
    effects: list[str] = Field(description="the best explanation, or none")
    asked: list[str] = Field(
        default_factory=list, description="the only effects that were considered; none: all that are known"
    )
    explanations: list[AcceptedExplanation] = Field(
        description="all accepted smallest sets, best first; then what misses the test narrowly for less"
    )
    found: list[FoundEffect] = Field(
        default_factory=list, description="every effect of the best set, whatever the verdict"
    )

    @computed_field(description="effects that explain most, whatever the verdict")
    @property
    def best_set(self) -> list[str]:
        return [one.effect for one in self.found]

    @computed_field(description="effects that no other set of about as many does without")
    @property
    def certain(self) -> list[str]:
        return [one.effect for one in self.found if one.level == Certainty.CERTAIN]

    @computed_field(description="effects that only sets of more parameters do without")
    @property
    def simplest(self) -> list[str]:
        return [one.effect for one in self.found if one.level == Certainty.SIMPLEST]

    @computed_field(description="effects that are certain as far as an unexplained rest allows")
    @property
    def partial(self) -> list[str]:
        return [one.effect for one in self.found if one.level == Certainty.PARTIAL]


class LeftOpen(Record):
    """What stays open, and what can be ruled out."""

    nearest_rival: NearestRival | None
    detection_limits: dict[str, DetectionLimit]
    hindrances: dict[str, list[Hindrance]] = Field(
        default_factory=dict, description="why effects cannot be tested, by name"
    )
    unexplained_coordinate: str | None
    misfit: Misfit | None = Field(None, description="what is unexplained, and depends on one coordinate")
    left_over: list[LeftOver] = Field(
        default_factory=list, description="of an unexplained rest: local unknowns, the best first"
    )
    unnamed: list[Unnamed] = Field(
        default_factory=list,
        description="effects too small to be named that would change values beyond their stated errors",
    )
    reason_to_doubt: Doubt | None = Field(
        None, description="why nothing is named or ruled out whatever was found"
    )


class Reached(Record):
    """How near the model comes to the readings."""

    ladder: list[Rung]
    noise_floor_percent: float | None = Field(
        description="what the readings' errors leave of any model; null: no reading is bright, or it is dark"
    )
    left_by_fit_percent: float | None = Field(
        None, description="what the last rung leaves of that: what is fitted follows a part of the noise"
    )
    left_by_fit_stderr_percent: float | None = Field(
        None, description="its standard deviation by chance, large where few readings make most of it"
    )
    noise_percent: float | None = Field(
        None, description="median error of a bright reading; null: none is bright"
    )


class Advised(Record):
    """What to do, and what to be careful of."""

    next_measurement: NextMeasurement | None
    stated: list[StatedEffect] = Field(
        default_factory=list, description="the scene's own effects: hypotheses too"
    )
    assumptions: list[Assumed] = Field(
        default_factory=list, description="terms of the error budget that were not given"
    )
    cautions: list[Caution] = Field(default_factory=list, description="what to be warned of")


class HowJudged(Record):
    """The test and the errors that all rests on."""

    base_p: float = Field(description="adequacy of the base model")
    within_tolerance: bool = Field(description="holds only within the tolerated smooth model error")
    tolerance_percent: float = Field(description="smooth model error that is of no interest")
    errors_stated: bool = Field(description="the table quotes standard errors")
    errors_on_trust: bool = Field(description="too few readings to estimate the noise from")
    determined: bool = Field(description="more readings than the best explanation has parameters")
    variance_scale: float = Field(
        description="pure-error variance over the quoted one, or over what a warning says replaced it"
    )
    serial_correlation: float = Field(description="lag-one correlation of the noise in scan order")


class ReadingsUsed(Record):
    """What was read, and what of it takes no part."""

    outliers: list[int] = Field(description="rows (from 0) left out as gross outliers")
    saturated: list[int] = Field(description="rows (from 0) left out as saturated")
    beyond_table: list[int] = Field(
        default_factory=list,
        description="rows (from 0) left out where the lamp's table does not know its light",
    )
    set_aside: list[SetAside] = Field(
        default_factory=list, description="outliers, farthest first; saturated; beyond the lamp's table"
    )
    readings: int
    several_wavelengths: bool = False


class ThisRun(Record):
    """Which diagnosis it was."""

    interrupted: bool = Field(
        False, description="stopped by hand before the explained scene was rendered afresh"
    )
    run: int = Field(1, description="how many diagnoses and comparisons of these readings the ledger holds")
    seed: int = 0
    lightfield_version: str = ""


class VerdictData(ThisRun, ReadingsUsed, HowJudged, Advised, Reached, LeftOpen, Explained):
    """Everything that a verdict says, as data: the fields of its parts, from the last to the first."""
