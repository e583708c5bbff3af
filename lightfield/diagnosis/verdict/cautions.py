"""What a reader of the verdict is to be warned of."""

from __future__ import annotations

import numpy as np
from scipy import special

from lightfield.diagnosis.search.cascade import Finding
from lightfield.diagnosis.search.preparation import Prepared
from lightfield.diagnosis.verdict.parts import AcceptedExplanation, Reason
from lightfield.readings import Readings

#: Factors on the stated variance from which on they are spoken of; the first only if its chance is less than
#: the third. Chosen: test_diagnosis.py has one that is spoken of and one that is not.
_NOTED_SCALE, _NOTED_SMALL, _NO_CHANCE = 1.5, 0.25, 1e-3


def variance_scale(prepared: Prepared, finding: Finding) -> float:
    """Variance of the readings' errors over the quoted one."""
    return prepared.excess * finding.level.bench.phi * finding.level.phi


def cautions(
    readings: Readings, prepared: Prepared, finding: Finding, explanations: list[AcceptedExplanation]
) -> list[str]:
    """Sentences beside the verdict: what the table leaves open, what the noise and the fit say of it."""
    out = [str(w) for w in readings.warnings]
    if prepared.doubted:
        out.append(
            "the stated errors do not go with the scatter of dark and of bright readings: errors with a dark "
            "floor and a part in proportion were estimated from the readings instead"
        )
    scale, nu = variance_scale(prepared, finding), finding.level.adequacy.nu
    if prepared.errors_stated and scale > _NOTED_SCALE and special.chdtrc(nu, nu * scale) < _NO_CHANCE:
        out.append(
            f"the readings scatter {np.sqrt(scale):.1f} times as much as their errors say: these are too "
            "small, or something changes from reading to reading"
        )
    elif prepared.errors_stated and scale < _NOTED_SMALL:
        out.append(
            f"the readings scatter {1 / np.sqrt(scale):.1f} times less than their errors say: "
            "are these standard errors, in the unit of the readings?"
        )
    if finding.levels[0].adequacy.scale_taken:
        stated = "stated" if prepared.errors_stated else "assumed"
        out.append(
            f"too few readings to estimate the noise from them: the {stated} errors are taken as they are, "
            "and the verdict is no better than they are"
        )
    if finding.size == 0 and finding.level.tolerance > 0:
        out.append("a significant misfit is smaller than the tolerance and was ignored")
    for explanation in explanations[:1]:
        for path, estimate in explanation.parameters.items():
            if estimate.reason is Reason.AT_BOUNDARY:
                out.append(
                    f"{path} lies at the edge of its plausible range ({estimate.value:g}): not a finding"
                )
        if "water.phase.g" in explanation.parameters:
            out.append(
                "b and g are those of a Henyey-Greenstein phase function; where the water's own is more "
                "peaked, its b is larger than this one (in rendered waters up to twice after Petzold, up "
                "to four times after Fournier and Forand): put it into the scene if b itself matters "
                '(of "fournier-forand" the slope mu is fitted with b)'
            )
    return out
