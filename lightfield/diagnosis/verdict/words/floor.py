"""Why may the error of a fit lie below the noise floor?"""

from __future__ import annotations

from lightfield.diagnosis.verdict.verdict_data import VerdictData
from lightfield.wording import rounded

#: An error below this part of the floor is spoken of: what a fit of few numbers to many readings leaves is no
#: less. Chosen: words alone.
_FAR_BELOW = 0.9
#: Standard deviations that are chance. Chosen: one of twenty is beyond.
_CHANCE = 2.0


def left_of_floor(v: VerdictData) -> str | None:
    """What a fit leaves of the noise floor in per cent, where the error lies far below that; else None."""
    known = _error_and_left(v)
    return None if known is None else f"{rounded(known[1])} ± {rounded(known[2], 1)}"


def why_below(v: VerdictData) -> str:
    """Why the error lies far below the floor; "" where it does not."""
    known = _error_and_left(v)
    if known is None:
        return ""
    error, left, chance = known
    if error < left - _CHANCE * chance:
        return (
            "The floor lies above the error: the errors of the readings, as stated or as their scatter was "
            f"judged, are larger than what is left (of such errors a fit would leave {left_of_floor(v)} %)."
        )
    follows = left < _FAR_BELOW * (v.noise_floor_percent or left)
    why = "as the fit follows a part of the noise" if follows else "by chance: few readings make most of both"
    return f"The floor lies above the error {why}; of such errors a fit leaves {left_of_floor(v)} %."


def _error_and_left(v: VerdictData) -> tuple[float, float, float] | None:
    """Error of the last rung, and what a fit would leave, with its standard deviation, where they differ."""
    error, floor = v.ladder[-1].error_percent, v.noise_floor_percent
    left, chance = v.left_by_fit_percent, v.left_by_fit_stderr_percent
    if error is None or floor is None or left is None or chance is None or error >= _FAR_BELOW * floor:
        return None
    return error, left, chance
