"""What an instrument makes of light, and what light it was that an instrument shows so."""

from __future__ import annotations

import numpy as np
import pytest
from perturbed import TAKEN, changed

from lightfield.formula.readout import immersed, readout, signal_of
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import paths_on

LIGHT = np.array([0.3, 0.7, 1.0])


@pytest.mark.parametrize("path", paths_on(Acts.READOUT))
def test_every_readout_can_be_undone(path: str) -> None:
    """All that the instrument does, whatever it is; the immersion factor stays, as in readings in water."""
    scene = changed(Scene.from_dict({"detector": {"background": 0.1}}), path)
    read = readout(scene, LIGHT, 1.0, TAKEN)
    assert read != pytest.approx(readout(Scene(), LIGHT, 1.0, TAKEN), rel=1e-6)
    light, _ = signal_of(scene, read, 1.0, TAKEN)
    assert light == pytest.approx(LIGHT * immersed(scene, TAKEN.in_air), rel=1e-6)
