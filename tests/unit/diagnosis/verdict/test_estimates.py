"""Why a fitted number has no error."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from lightfield.diagnosis.verdict.estimates import estimates
from lightfield.diagnosis.verdict.parts import Reason
from lightfield.fitting.curves import ABSORPTION, PROFILE
from lightfield.fitting.parameter import FitParameter


def test_a_lamps_curve_that_may_not_bend_more_is_at_no_edge_of_what_is_plausible() -> None:
    """Ten amplitudes of one curve were "at boundary", beside "Certain: beam profile"."""
    names = (f"{PROFILE}.7", f"{ABSORPTION}.1", "lamp.skirt_hwhm_deg")
    fit = SimpleNamespace(
        paths=names, u=np.ones(3), jacobian=np.eye(3), values=dict.fromkeys(names, 1.0),
        model=SimpleNamespace(parameters=tuple(FitParameter(n, 0.0, 1.0, 0.5, 1e-3) for n in names)),
        at_bound=lambda: np.ones(3, bool), stderr=lambda scale: dict.fromkeys(names, np.nan),
    )  # fmt: skip
    found = estimates(cast(Any, fit), 1.0, {})
    assert [found[name].reason for name in names] == [
        Reason.BENDS_NO_MORE, Reason.AT_BOUNDARY, Reason.AT_BOUNDARY,
    ]  # fmt: skip
    assert all(one.stderr is None for one in found.values())
