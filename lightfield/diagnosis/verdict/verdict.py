"""The verdict of a diagnosis as data: what `lightfield diagnose --json` writes, with its JSON Schema."""

from __future__ import annotations

from enum import StrEnum
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Kind = Literal["none", "identified", "ambiguous", "unexplained"]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="null")


class Reason(StrEnum):
    """Why a fitted number has no error, as every report says it."""

    HELD = "held"
    AT_BOUNDARY = "at boundary"
    DID_NOT_MOVE = "did not move the model"
    UNDETERMINED = "undetermined"
    TOO_WIDE = "undetermined: error wider than the allowed range"


class Estimate(_Part):
    """A fitted number."""

    value: float
    stderr: float | None = Field(None, description="standard error; absent for the reason given")
    unit: str = "1"
    reason: Reason | None = Field(None, description="why there is no error")


class Explanation(_Part):
    """A smallest set of effects beside which nothing is missing."""

    effects: list[str]
    families: list[str]
    forms: list[str] = Field(description="functional form of each effect")
    weight: float = Field(description="relative evidence among the accepted sets and nothing else")
    parameters: dict[str, Estimate] = Field(description="by dotted path, nuisance parameters included")
    chi2_per_dof: float = Field(description="in units of the quoted errors and the error budget")
    error_percent: float = Field(description="rms residual over readings above 5 % of their plane's maximum")
    held_out_percent: float | None = Field(description="the same, each plane predicted from the others")
    adequacy_p: float = Field(description="probability of so bad a worst test if nothing were missing")


class NearestRival(_Part):
    """The next explanation and its distance."""

    effects: list[str]
    separation_sigma: float


class DetectionLimit(_Part):
    """Smallest size that would have been seen with 95 % probability."""

    parameter: str
    value: float
    unit: str
    within_range: bool = Field(description="false: not even its largest plausible size would have been seen")


class Rung(_Part):
    """One step of the ladder from the base model to the explanation."""

    label: str
    effects: list[str]
    error_percent: float
    chi2_per_dof: float
    held_out_percent: float | None
    parameters: dict[str, Estimate]
    scene: str = Field(description="the fitted scene as TOML; `compare --scene` of it gives this rung again")
    rendered_error_percent: float | None = Field(None, description="error of a fresh render of that scene")
    rendered_stderr_percent: float | None = Field(None, description="Monte Carlo error of that render")


class StatedEffect(_Part):
    """An effect that the scene itself has, and what the readings say of it."""

    effect: str | None = Field(description="absent for what no effect of the table sets free")
    judgement: Literal["supported", "undecided", "contradicted", "absent", "held"] = Field(
        description="contradicted: of another size; absent: that, and met as well without it; undecided: "
        "these readings do not tell; held: not tested, taken as stated"
    )
    stated: dict[str, float] = Field(description="the scene's values by dotted path")
    neutral: dict[str, float] = Field(default_factory=dict, description="what would switch it off")
    fitted: dict[str, Estimate] = Field(
        default_factory=dict, description="the same when fitted beside the best explanation"
    )
    limit: float | None = Field(
        None,
        description="95 % limit of its one amplitude's distance from the neutral value",
    )
    sigma_from_stated: float | None = None
    sigma_to_remove: float | None = None
    reason: str | None = Field(None, description="why it was held")


class Spot(_Part):
    """Readings to take."""

    x_m: float
    y_m: float
    z_m: float
    medium: str
    repeats: int


class NextMeasurement(_Part):
    """What to measure next, and what it would decide."""

    sentence: str
    between: list[list[str]] = Field(
        default_factory=list, description="the two explanations it would separate"
    )
    readings: list[Spot] = Field(default_factory=list)
    separation_now_sigma: float | None = None
    separation_predicted_sigma: float | None = None


class SetAside(_Part):
    """A reading that took no part in the fit."""

    row: int = Field(description="row of the table, from 0")
    reason: Literal["outlier", "saturated"]
    x_m: float
    y_m: float
    z_m: float
    medium: str
    wavelength_nm: float | None
    off_sigma: float | None = Field(description="(reading - model) / standard error; none if saturated")


class Verdict(_Part):
    """Everything a diagnosis says."""

    verdict: Kind
    sentence: str = Field(description="the verdict in words")
    headline: str = Field(description="what was found, alone")
    support: list[str] = Field(description="how sure that is, and what took no part, apart from the headline")
    effects: list[str] = Field(description="the best explanation, or none")
    explanations: list[Explanation] = Field(description="all accepted smallest sets, best first")
    nearest_rival: NearestRival | None
    detection_limits: dict[str, DetectionLimit]
    untestable: dict[str, str]
    unexplained_coordinate: str | None
    doubt: str | None = Field(None, description="why nothing is named or ruled out whatever was found")
    ladder: list[Rung]
    noise_floor_percent: float
    noise_percent: float | None = Field(
        None, description="median error of a bright reading; null: none is bright"
    )
    next_measurement: NextMeasurement | None
    stated: list[StatedEffect] = Field(
        default_factory=list, description="the scene's own effects: hypotheses too"
    )
    assumed: list[str] = Field(description="terms of the error budget that were not given")
    warnings: list[str] = Field(default_factory=list)
    base_p: float = Field(description="adequacy of the base model")
    within_tolerance: bool = Field(description="holds only within the tolerated smooth model error")
    variance_scale: float = Field(
        description="pure-error variance over the quoted one, or over what a warning says replaced it"
    )
    serial_correlation: float = Field(description="lag-one correlation of the noise in scan order")
    outliers: list[int] = Field(description="rows (from 0) left out as gross outliers")
    saturated: list[int] = Field(description="rows (from 0) left out as saturated")
    set_aside: list[SetAside] = Field(default_factory=list, description="outliers, farthest first; saturated")
    readings: int
    run: int = Field(1, description="how many diagnoses and comparisons of these readings the ledger holds")
    seed: int = 0
    lightfield_version: str = ""


def json_schema() -> dict[str, Any]:
    """JSON Schema (2020-12) of the verdict."""
    return Verdict.model_json_schema()
