"""Wall hits between the nodes of a tally count right on average where they must."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.render.backend import use_backend


def test_factor_is_right_at_the_reference_and_at_the_brightest_walls() -> None:
    """(rho / rho0)^m for every m up to the last node; down to 0.3 to 2 % of what walls of 0.9 send."""
    use_backend()
    from lightfield.render.tracer.histories import WallNodes

    nodes = WallNodes((0, 1, 2, 3, 4, 6, 9, 14), 0.8, 0.9)
    below, share = nodes.between()
    hits, m = np.array(nodes.hits), np.arange(15)
    assert ((share >= 0) & (share <= 1)).all()
    for albedo in (0.3, 0.6, 0.8, 0.9):
        q = albedo / 0.8
        told = (1 - share) * q ** hits[below].astype(float) + share * q ** hits[below + 1].astype(float)
        if albedo >= 0.8:
            assert told == pytest.approx(q**m, rel=1e-12)
        told, right = (v * 0.8**m for v in (told, q**m))  # of light that the trace's walls have dimmed
        assert (np.abs(told - right) < 0.02 * 0.9**m).all()
