"""Contributions of photons to the errors of readings, a few readings at a time."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array

from lightfield.render.diffuse import trace_errors
from lightfield.render.diffuse.between_g import PassedOn
from lightfield.render.diffuse.trace_errors import ClassLight, TraceErrors, relative_modes

READINGS, CELLS, SETS = 11, 9, 3


@pytest.mark.parametrize("at_once", [1, 4, READINGS, 100])
def test_each_reading_has_the_errors_of_its_cells(at_once: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two waters; errors that light passes on as they are: shares times light times roots, added up over the
    cells that share their photons."""
    monkeypatch.setattr(trace_errors, "_AT_ONCE", at_once)
    rng = np.random.default_rng(0)
    shares, light = rng.random((READINGS, CELLS)), rng.random((2, CELLS)) + 0.1
    roots, images = 0.1 * rng.random((2, 2, CELLS)), rng.random((CELLS, SETS)) < 0.5
    channel = rng.integers(0, 2, READINGS)
    plain = PassedOn(np.ones(CELLS), np.zeros(CELLS), np.zeros(CELLS), eye_array(CELLS, format="csr"))
    parts = {
        0: ClassLight(
            light, [TraceErrors([plain, plain], roots, csr_array(images, dtype=float))], np.zeros_like(light)
        )
    }
    shift = SimpleNamespace(shares=csr_array(shares), asked=READINGS)
    found = relative_modes(shift, parts, light, eye_array(CELLS, format="csr"), channel)
    for row, water in enumerate(channel):
        expected = np.hstack([(shares[row] / light[water] * root) @ images for root in roots[water]])
        expected /= max(np.linalg.norm(expected), 1)
        np.testing.assert_allclose(found[row], expected, rtol=1e-12)
