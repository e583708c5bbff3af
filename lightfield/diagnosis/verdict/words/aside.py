"""Which readings took no part, and how far off are they?"""

from __future__ import annotations

from collections.abc import Sequence

from lightfield.diagnosis.verdict.parts import SetAside, WhyAside
from lightfield.diagnosis.verdict.speech import place

#: Readings set aside that the sentence names one by one. Chosen: words alone.
_NAMED_ASIDE = 3


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
    outliers = [e for e in aside if e.reason == WhyAside.OUTLIER]
    said = []
    if outliers:
        named = "; ".join(f"{place(e, waves)}, {off(e)}" for e in outliers[:_NAMED_ASIDE])
        rest = len(outliers) - _NAMED_ASIDE
        least = abs(outliers[-1].off_sigma or 0.0)
        others = f"; and {rest} more, {least:.2g} sigma off or farther" if rest > 0 else ""
        verb = "was" if len(outliers) == 1 else "were"
        said.append(f"{len(outliers)} of {readings} readings {verb} set aside: {named}{others}.")
    if saturated := sum(e.reason == WhyAside.SATURATED for e in aside):
        said.append(f"{saturated} saturated {'reading was' if saturated == 1 else 'readings were'} left out.")
    if beyond := sum(e.reason == WhyAside.BEYOND_TABLE for e in aside):
        verb = "reading was" if beyond == 1 else "readings were"
        said.append(f"{beyond} {verb} left out that lie where the lamp's table is a guess.")
    return " ".join(said)
