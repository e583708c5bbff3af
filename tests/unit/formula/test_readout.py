"""What an instrument makes of light, and what light it was that an instrument shows so."""

from __future__ import annotations

import numpy as np
import pytest
from perturbed import changed

from lightfield.formula.readout import Halves, Taken, immersed, readout, signal_of
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import paths_on

#: Three colours of one spectrum, the last with one of half its wavelength.
TAKEN = Taken(
    spectrum=np.zeros(3, int),
    wavelength_nm=np.array([450.0, 500.0, 900.0]),
    time_s=np.array([0.0, 900.0, 1800.0]),
    halves=Halves(np.array([2]), np.array([0]), np.array([1]), np.array([0.5])),
    z_m=np.array([4.5, 5.5, 6.5]),
)
LIGHT = np.array([0.3, 0.7, 1.0])


@pytest.mark.parametrize("path", paths_on(Acts.READOUT))
def test_every_readout_can_be_undone(path: str) -> None:
    """All that the instrument does, whatever it is; the immersion factor stays, as in readings in water."""
    scene = changed(Scene.from_dict({"detector": {"background": 0.1}}), path)
    read = readout(scene, LIGHT, 1.0, TAKEN)
    assert read != pytest.approx(readout(Scene(), LIGHT, 1.0, TAKEN), rel=1e-6)
    light, _ = signal_of(scene, read, 1.0, TAKEN)
    assert light == pytest.approx(LIGHT * immersed(scene, TAKEN.in_air), rel=1e-6)
