"""Readings set aside, as data and in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lightfield.diagnosis.verdict.trust import Trust
from lightfield.diagnosis.verdict.verdict import NextMeasurement, SetAside, Spot

#: Readings set aside that the sentence names one by one.
_NAMED_ASIDE = 3


def entries(readings: Any, trust: Trust) -> list[SetAside]:
    """Outliers, farthest first, then saturated readings."""
    far = sorted(np.flatnonzero(trust.aside).tolist(), key=lambda i: -abs(trust.off_sigma[i]))
    saturated = np.flatnonzero(np.asarray(readings.saturated)).tolist()

    def entry(i: int, sigma: float | None) -> SetAside:
        wavelength = float(readings.wavelength_nm[i])
        return SetAside(
            row=i, reason="saturated" if sigma is None else "outlier",
            x_m=float(readings.x_m[i]), y_m=float(readings.y_m[i]), z_m=float(readings.z_m[i]),
            medium=str(readings.medium[i]), wavelength_nm=wavelength if np.isfinite(wavelength) else None,
            off_sigma=sigma,
        )  # fmt: skip

    return [entry(i, float(trust.off_sigma[i])) for i in far] + [entry(i, None) for i in saturated]


def advice(aside: list[SetAside]) -> NextMeasurement:
    """What to do about readings set aside that are no slips."""
    one = aside[0]
    spot = Spot(x_m=one.x_m, y_m=one.y_m, z_m=one.z_m, medium=one.medium, repeats=3)
    sentence = (
        "Look for what stands between lamp and detector, and repeat the readings set aside (the farthest at "
        f"{place(one, False)}): what repeats is a structure of the light, what does not is a slip."
    )
    return NextMeasurement(sentence=sentence, readings=[spot])


def place(one: SetAside, waves: bool) -> str:
    """Where a reading was taken."""
    medium = "" if one.medium == "water" else f" in {one.medium}"
    colour = f", {one.wavelength_nm:g} nm" if waves and one.wavelength_nm is not None else ""
    x, y, z = (round(v, 4) + 0.0 for v in (one.x_m, one.y_m, one.z_m))
    return f"x = {x:.3g}, y = {y:.3g}, z = {z:.3g} m{colour}{medium}"


def off(one: SetAside) -> str:
    """How far a reading that was set aside lies from the model."""
    if one.off_sigma is None:
        return one.reason
    return f"{abs(one.off_sigma):.2g} sigma {'above' if one.off_sigma > 0 else 'below'} the model"


def sentence(aside: Sequence[SetAside], readings: int, waves: bool) -> str:
    """How many readings took no part, where they lie and how far off; "" without any.

    Parameters
    ----------
    aside : sequence of SetAside
        Outliers, farthest first, and saturated readings.
    waves : bool
        Several wavelengths were read.
    """
    outliers = [e for e in aside if e.reason == "outlier"]
    said = []
    if outliers:
        named = "; ".join(f"{place(e, waves)}, {off(e)}" for e in outliers[:_NAMED_ASIDE])
        rest = len(outliers) - _NAMED_ASIDE
        least = abs(outliers[-1].off_sigma or 0.0)
        others = f"; and {rest} more, {least:.2g} sigma off or farther" if rest > 0 else ""
        verb = "was" if len(outliers) == 1 else "were"
        said.append(f"{len(outliers)} of {readings} readings {verb} set aside: {named}{others}.")
    if saturated := len(aside) - len(outliers):
        said.append(f"{saturated} saturated {'reading was' if saturated == 1 else 'readings were'} left out.")
    return " ".join(said)
