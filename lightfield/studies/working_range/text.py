"""What a study of the working range says, to people and to programs."""

from __future__ import annotations

from typing import Any

import numpy as np

from lightfield.arrays import finite
from lightfield.scene.lamp.frame import is_tilted
from lightfield.studies.follower.array_light import LAMP_TILTS
from lightfield.studies.follower.survey import DOCKING_ASKS
from lightfield.studies.working_range.poses import ARRAY
from lightfield.studies.working_range.reaches import POSE_RULES, RELATIVE, Reach
from lightfield.studies.working_range.study import WorkingRange
from lightfield.wording import rounded


def as_text(found: WorkingRange) -> str:
    """The answer for people."""
    table = [["", *columns(found)], *rows(found)]
    words, *widths = (max(len(cell) for cell in column) for column in zip(*table, strict=True))
    lines = [headline(found), ""]
    for rule, *cells in table:
        lines.append(
            "  ".join([f"{rule:<{words}}", *(f"{c:>{w}}" for c, w in zip(cells, widths, strict=True))])
        )
    lines += [*asked_sentences(found), array_sentence(found)]
    return "\n".join(lines)


def headline(found: WorkingRange) -> str:
    """One sentence: the paper's rule, with and without scattered light."""
    light, share = found.reaches[0], 100 * found.share
    falls = f"light falls to {share:g} % of that at {found.reference_m:g} m at {distance(light)}"
    if not found.traced:
        return f"By the formula alone (nothing traced) the {falls}."
    return f"The {falls}; the formula says {distance_or_none(light.formula_m)}."


def asked_sentences(found: WorkingRange) -> list[str]:
    """How far was asked, and which light is meant where the lamp does not point along the tank."""
    near, far = (float(found.dataset.z_m[k]) for k in (0, -1))
    ends = found.dataset.attrs["ends"]
    asked = f"Asked from {near:g} to {found.dataset.asked_to_m:.4g} m{f', {ends}' * bool(ends)}."
    if far < found.dataset.asked_to_m:
        asked += f" Beyond {far:.3g} m too few photons arrive to say how much light is scattered."
    if not is_tilted(found.scene.lamp):
        return [asked]
    lamp = found.scene.lamp
    return [
        asked,
        f"The lamp is tilted by {lamp.tilt_x_deg:g} and {lamp.tilt_y_deg:g} degrees towards +x and +y: light "
        "over that at the reference is told straight ahead of the lamp, along the tank; spot and poses are "
        "about the beam's own axis.",
    ]


def array_sentence(found: WorkingRange) -> str:
    """Which array reads, and what it does not know."""
    array = found.array
    shape = f"curved with a radius of {array.radius_m:g} m" if array.radius_m else "flat"
    if array.layout == "table":
        words = "as in its table"
    else:
        fitted = found.scene.array is None and array.size_m < ARRAY.size_m
        smaller = f" (not {ARRAY.size_m:g}: so that it fits this tank)" * fitted
        words = f"{array.count[0]} x {array.count[1]}, {array.size_m:g} m{smaller}, {shape}"
    unknown = ", ".join(f"{name} {_known(name, sigma)}" for name, sigma in found.nuisances.items())
    flat = "" if array.layout == "table" or array.radius_m else " " + _FLAT
    return (
        f"Poses: the Cramer-Rao bound of one reading of the array ({words}; {array.layout}), on the axis, "
        f"facing the lamp; known beforehand to: {unknown or 'all exactly'}.{flat} Docking asks for "
        f"{DOCKING_ASKS}."
    )


#: What so few photons leave open.
UNTOLD = "too few photons to say"
#: What a flat array cannot tell.
_FLAT = "A flat array that faces the lamp trades yaw against a step aside: a curved one tells them apart."


def _known(name: str, sigma: float) -> str:
    return f"{np.degrees(sigma):.2g} deg" if name in LAMP_TILTS else f"{rounded(100 * sigma, 3)} %"


#: Directions of a pose in words, by those of `POSE_RULES`.
_DIRECTIONS = {
    "across": "position across the beam",
    "along": "position along the beam",
    "turned": "yaw and pitch",
}


def _pose_rules() -> dict[str, str]:
    words = {}
    for suffix, known in (("", ""), (RELATIVE, ", relative readings only")):
        for axis, (_, unit, limit) in POSE_RULES.items():
            words[f"pose_{axis}{suffix}"] = f"{_DIRECTIONS[axis]} to {limit:g} {unit}{known}"
        words[f"pose{suffix}"] = f"all that docking asks of a pose{known}"
    return words


#: What must be known of a pose, by the name of a reach.
POSE_WORDS = _pose_rules()


def rules(found: WorkingRange) -> dict[str, str]:
    """What must hold, by the name of a reach."""
    return {
        "light": f"at least {100 * found.share:g} % of the light at {found.reference_m:g} m",
        "signal": f"signal at least {found.snr:g} times a noise of {100 * found.noise:g} %",
        **POSE_WORDS,
    }


def columns(found: WorkingRange) -> tuple[str, ...]:
    """What stands beside the rules of `rows`."""
    return ("with scattered light", "formula") if found.traced else ("formula",)


def rows(found: WorkingRange) -> list[list[str]]:
    """Rule, distance with its error where light was traced, and that of the formula, as text."""
    words = rules(found)
    formula = [
        _near(r.formula_near_m) + _from(r.formula_from_m, 0.0, r.formula_m, distance_or_none(r.formula_m))
        for r in found.reaches
    ]
    if not found.traced:
        return [[words[r.name], told] for r, told in zip(found.reaches, formula, strict=True)]
    return [[words[r.name], distance(r), told] for r, told in zip(found.reaches, formula, strict=True)]


def distance(reach: Reach) -> str:
    """A distance with its error."""
    if not reach.is_told or reach.stderr_m > reach.z_m:
        return UNTOLD
    far = f"{reach.z_m:.2f}{_pm(reach.stderr_m)} m" if np.isfinite(reach.z_m) else distance_or_none(reach.z_m)
    sure = f" (for sure to {reach.sure_m:.2f} m)" if np.isfinite(reach.sure_m) else ""
    return _near(reach.near_m) + _from(reach.from_m, reach.from_stderr_m, reach.z_m, far) + sure


def _pm(stderr: float) -> str:
    """An error behind its number. No error is none: what is smaller than the last digit is that digit."""
    return f" ± {max(stderr, 0.01):.2f}" if np.isfinite(stderr) and stderr > 0 else ""


def _near(end_m: float) -> str:
    """Where it ends to hold near the lamp, if it does again farther away."""
    return f"to {end_m:.2f} m, " if np.isfinite(end_m) else ""


def _from(near_m: float, stderr_m: float, far_m: float, far: str) -> str:
    """How far it holds, and where it begins to, if not at once."""
    if not np.isfinite(near_m):
        return far
    begins = f"{near_m:.2f}{_pm(stderr_m)} m"
    return f"from {begins} on" if np.isinf(far_m) else f"{begins} to {far}"


def distance_or_none(value: float) -> str:
    """A distance that may lie beyond what is told: what was asked, or what photons tell."""
    return "nowhere" if np.isnan(value) else "beyond all told" if np.isinf(value) else f"{value:.2f} m"


def as_data(found: WorkingRange) -> dict[str, Any]:
    """The answer for programs."""
    data, words = found.dataset, rules(found)
    return {
        "unknown": found.nuisances,
        "array": found.array.model_dump(mode="json"),
        "reaches": [
            {
                "name": r.name,
                "rule": words[r.name],
                "z_m": finite(r.z_m),
                "stderr_m": finite(r.stderr_m),
                "formula_m": finite(r.formula_m),
                "from_m": finite(r.from_m),
                "from_stderr_m": finite(r.from_stderr_m),
                "sure_m": finite(r.sure_m),
                "near_m": finite(r.near_m),
                "told": r.is_told,
                "formula_from_m": finite(r.formula_from_m),
                "formula_near_m": finite(r.formula_near_m),
                "beyond_all_asked": bool(np.isinf(r.z_m)),
            }
            for r in found.reaches
        ],
        **{str(k): [finite(x) for x in v.values] for k, v in {**data.coords, **data.data_vars}.items()},
        **{str(k): v for k, v in data.attrs.items()},
        "snr": found.snr,
        "traced": found.traced,
        "readings": None
        if found.readings is None
        else {str(k): v.values.tolist() for k, v in found.readings.variables.items()},
    }
