"""An experiment and a state in words and numbers for the page: effects, parameters, ladder."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from lightfield.diagnosis.problem.untestable import in_words
from lightfield.explorer.experiment import PERCENT, Experiment
from lightfield.explorer.fits import Fits, Fitted, Goodness
from lightfield.explorer.state import State
from lightfield.fitting.effects.registry import effect_name
from lightfield.fitting.parameter import FitParameter, is_gain
from lightfield.wording import plain

#: A slider of what is found on a logarithmic scale goes to so many times the fitted value, and down alike.
_AROUND = 4.0
#: That of the absorption goes to so much in 1/m at least. Chosen: harbour water.
_ABSORPTION_TO = 0.5
_ENDINGS = ("_per_m2", "_per_m", "_per_nm", "_per_hour", "_m", "_deg", "_nm", "_s", "_w", "_k")


def experiment_data(e: Experiment, fits: Fits) -> dict[str, object]:
    """What does not change while one experiment is explored."""
    r = e.readings
    return {
        "title": e.scene.name or "Scene",
        "has_data": e.has_data,
        "source": r.source,
        "unit": r.units,
        "planes_m": list(e.places.z_m),
        "map_x_m": e.places.x_m,
        "map_y_m": e.places.y_m,
        "x_m": r.x_m,
        "y_m": r.y_m,
        "z_m": r.z_m,
        "time_s": r.time_s,
        "wavelength_nm": r.wavelength_nm,
        "channel": e.layout.channel,
        "wavelengths_nm": e.forward.light.diffuse.wavelengths_nm,
        "air": e.layout.air,
        "value": e.problem.value,
        "sigma": e.sigma,
        "kept": e.problem.keep > 0,
        "angle_deg": np.degrees(e.layout.angle_rad),
        "floor_percent": fits.floor_percent,
        "assumed": _assumed(e),
        "warnings": [str(w) for w in r.warnings],
        "untestable": {name: in_words(why) for name, why in e.untestable.items()},
    }


def state_data(fits: Fits, state: State, survey: Mapping[str, float]) -> dict[str, Any]:
    """Effects, parameters and ladder of a state."""
    e = fits.experiment
    here = fits.known(state.effects)
    chosen = [e.candidates[key] for key in state.effects]
    held = {path for c in chosen for path in c.effect.instead_of}
    parameters = [p for p in e.problem.base if p.path not in held]
    parameters += [p for c in chosen for p in c.parameters]
    return {
        "effects": _effects(e, state, survey),
        "base": [p.path for p in e.problem.base if p.path not in held],
        "parameters": {p.path: _parameter(e, p, state, here, fits.known(())) for p in parameters},
        "ladder": ladder(fits, state),
    }


def _effects(e: Experiment, state: State, survey: Mapping[str, float]) -> list[dict[str, object]]:
    forms: dict[str, list[str]] = {}
    for key, candidate in e.candidates.items():
        forms.setdefault(candidate.name, []).append(key)
    out = []
    for name, keys in forms.items():
        on = next((key for key in keys if key in state.effects), None)
        # Of a curve that which can follow most, unless a form is named; else the usual form.
        usual = keys[-1] if e.candidates[keys[0]].effect.is_free_form else keys[0]
        one = e.candidates[on or usual]
        chosen = [e.candidates[key].effect for key in state.effects]
        barring = [effect.name for effect in chosen if not one.effect.combines_with(effect)]
        out.append(
            {
                "name": name,
                "key": on or usual,
                "on": on is not None,
                "forms": [{"key": key, "name": e.candidates[key].form.name} for key in keys],
                "family": "curve" if one.effect.is_free_form else one.effect.family,
                "physics": one.effect.physics,
                "signature": one.effect.signature,
                "laboratory": one.effect.laboratory,
                "parameters": [p.path for p in one.parameters],
                "error_percent": survey.get(on or usual),
                "not_with": barring[0] if on is None and barring else None,
            }
        )
    return out


def _parameter(
    e: Experiment, p: FitParameter, state: State, here: Fitted | None, base: Fitted | None
) -> dict[str, object]:
    declared, now = e.parameters.get(p.path), state.values[p.path]
    low, high = p.low, p.high
    found = here or base
    best = found.values.get(p.path) if found else None
    if p.coordinate == "log":
        middle, reach = p.coordinate_of(best or now), float(np.log(_AROUND))
        low, high = max(low, middle - reach), min(high, middle + reach)
    elif p.path in {b.path for b in e.problem.base}:
        high = min(high, max(_ABSORPTION_TO, _AROUND * abs(best or now)))
    u = p.coordinate_of(now) if p.coordinate != "log" or now > 0 else low
    neutral = None if declared is None or declared.neutral is None else declared.neutral
    return {
        "label": label_of(p.path),
        "unit": "" if declared is None or declared.unit == "1" else declared.unit,
        "meaning": "reading per unit of light" if declared is None else declared.meaning,
        "coordinate": p.coordinate,
        "low": min(low, u),
        "high": max(high, u),
        "neutral": neutral if p.coordinate in ("linear", "square") else None,
        "value": now,
        "fixed": p.is_held,
        "fitted": here.values.get(p.path) if here and not p.is_held else None,
        "stderr": here.stderr.get(p.path) if here else None,
    }


def _assumed(experiment: Experiment) -> list[str]:
    """What misfits are counted in."""
    if not experiment.has_data:
        return [f"misfits count in {PERCENT:g} % of the render"]
    return [str(one) for one in experiment.assumed]


def label_of(path: str) -> str:
    """A parameter's name for people, without its unit."""
    if is_gain(path):
        return path.replace(".", " ")
    part, _, rest = path.partition(".")
    for ending in _ENDINGS:
        if rest.endswith(ending) and rest != ending:
            rest = rest.removesuffix(ending)
            break
    rest = plain({"hwhm": "half width", "phase.g": "phase g"}.get(rest, rest)).replace(".", " ")
    return f"{'own ' if part == 'effect' else ''}{rest}"


def effects_in_words(effects: Iterable[str]) -> str:
    """Effects "effect:form" for people."""
    return " + ".join(plain(effect_name(key)) for key in effects)


def unfitted(fits: Fits, effects: tuple[str, ...], values: Mapping[str, float]) -> Goodness:
    """How well some effects do with values as they are."""
    e = fits.experiment
    paths = [p.path for p in e.problem.base]
    paths += [p.path for key in effects for p in e.candidates[key].parameters]
    return fits.score(e.forward.predict({path: values[path] for path in paths}), fits.moved(effects))


def ladder(fits: Fits, state: State) -> list[dict[str, object]]:
    """Base model, and one effect more with every rung, each fitted; as far as it was."""
    out = []
    for k in range(len(state.effects) + 1):
        effects, e = state.effects[:k], fits.experiment
        fitted = fits.known(effects)
        if fitted is None and e.has_data:
            continue
        score = fitted.score if fitted and e.has_data else unfitted(fits, effects, state.values)
        name = effects_in_words(state.effects[k - 1 : k]) if k else "beam, 1/r², K"
        out.append(
            {
                "at": k,
                "label": f"+ {name}" if k else name,
                "error_percent": score.error_percent,
                "chi2_per_dof": score.chi2_per_dof,
            }
        )
    return out
