"""What the study of bands says, to people and to programs."""

from __future__ import annotations

from typing import Any

import numpy as np

from lightfield.arrays import jsonable
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.studies.band.study import CRITERIA, FLAT, PAPER_BAND, Bands, BestBand
from lightfield.wording import capital, with_error

#: A share of an attenuation that is none.
_UNTOLD = "no share to tell"
#: Least error of a share that is told: none is as small (chosen).
_LEAST_SHARE_ERROR = 1e-3


def as_text(found: Bands) -> str:
    """The answer for people."""
    low, high = found.flat_nm()
    lines = [headline(found), ""]
    for row in rows(found):
        lines.append(f"at {row[0]:>7}  {row[1]:<38} {row[2]:<12} {of_the_scene(found)} has {row[3]}")
    lines += untold_sentences(found)
    lines.append(water_sentence(found))
    if not found.is_grey:
        lines.append(
            f"at {found.spectrum.z_m.values[0]:g} m attenuation is within {100 * (FLAT - 1):.0f} % of its "
            f"least from {low:g} to {high:g} nm"
        )
    return "\n".join(lines)


def headline(found: Bands) -> str:
    """One sentence: where the scene's own band stands; or that the water has no say in it."""
    if found.is_grey:
        return (
            "The scene's water is the same at all wavelengths, so this says nothing of the water: what "
            "differs between bands is the lamp and the detector alone. State its spectrum in [water]: "
            'base = "pure" or a preset, absorption_at, or chlorophyll, CDOM and sediment.'
        )
    low, high = found.within_nm
    far = [b for b in found.best if b.z_m == found.best[-1].z_m]
    signal = next(b for b in far if b.criterion == "signal")
    first, last = found.scene_band_nm
    wide = "" if np.isclose(found.width_nm, last - first) else f" ({last - first:g} nm wide)"
    return (
        f"In the scene's water {signal.low_nm:g} to {signal.high_nm:g} nm has the most signal of any band "
        f"{found.width_nm:g} nm wide from {low:g} to {high:g} nm at {signal.z_m:g} m; "
        f"{of_the_scene(found)}{wide}, {origin(found)}, has {_of_it(signal.scene_share)}."
    )


def _of_it(share: float) -> str:
    """A share; a band that is wider than those it is beside may have more than each of them."""
    return f"{share:.3g} times as much" if share > 1 else f"{100 * share:.0f} % of it"


def of_the_scene(found: Bands) -> str:
    """The scene's own band, in words."""
    return "{:g} to {:g} nm".format(*found.scene_band_nm)


def origin(found: Bands) -> str:
    """Where the scene's own band comes from."""
    if found.scene_band_nm == PAPER_BAND:
        return "as in the tow tank experiment"
    several = len(found.scene.detector.bands_nm) > 1
    return f"the scene's {'first' if several else 'own'} band"


def water_sentence(found: Bands) -> str:
    """Whose water this is: that of the scene file, whatever readings may say."""
    water, at = found.scene.water, [np.mean(found.scene_band_nm)]
    a, b = (float(f(water, np.array(at))[0]) for f in (absorption_per_m, scattering_per_m))
    inside = {
        "chlorophyll": water.chlorophyll_mg_per_m3,
        "CDOM": water.cdom_440_per_m,
        "sediment": water.sediment_g_per_m3,
    }
    held = ", ".join(f"{name} {value:g}" for name, value in inside.items() if value) or "nothing in it"
    return (
        f"The water is the one that the scene states ({water.base}, {held}; at {at[0]:g} nm a = {a:.3g} and "
        f"b = {b:.3g} per m), not the one that readings show: where `attenuation` finds another, write that "
        "into the scene and ask again."
    )


def untold_sentences(found: Bands) -> list[str]:
    """Why shares of an attenuation are not told."""
    if found.is_grey or not any(np.isnan(b.scene_share) for b in found.best):
        return []
    return [
        f"{capital(_UNTOLD)}: where it is least, attenuation is above 0 by no more than its "
        "error (walls send back what the water takes, or too few photons tell)."
    ]


def rows(found: Bands) -> list[list[str]]:
    """Distance, criterion, best band, what the scene's band has of the best, as text."""
    return [
        [f"{b.z_m:g} m", CRITERIA[b.criterion], f"{b.low_nm:g}–{b.high_nm:g} nm", _share(b)]
        for b in found.best
        if not (found.is_grey and b.criterion == "attenuation")  # all bands alike
    ]


def _share(best: BestBand) -> str:
    """In per cent, with its error where light was traced; an attenuation over the least."""
    if not np.isfinite(best.scene_share):
        return _UNTOLD
    if best.criterion == "attenuation":
        return f"{1 / best.scene_share:.3g} times as much"
    share, known = best.scene_share, best.scene_share_stderr > 0
    error = max(best.scene_share_stderr, _LEAST_SHARE_ERROR) if known else np.nan
    if share > 1:
        return f"{with_error(share, error, 1)} times as much"
    return f"{with_error(100 * share, 100 * error, 1)} %"


def as_data(found: Bands) -> dict[str, Any]:
    """The answer for programs."""
    return {
        "best": [{name: jsonable(value) for name, value in vars(b).items()} for b in found.best],
        "grey_water": found.is_grey,
        "width_nm": found.width_nm,
        "scene_band_nm": list(found.scene_band_nm),
        "flat_nm": list(found.flat_nm()),
        **{
            part: {str(k): v.values.tolist() for k, v in {**data.coords, **data.data_vars}.items()}
            for part, data in (("spectrum", found.spectrum), ("bands", found.bands))
        },
    }
