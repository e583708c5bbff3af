"""The width of a beam, however it is stated, where cells and steps are made by it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lightfield.render import at_readings
from lightfield.scene import Scene
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.lamp.width import core_width_deg, lobe_width_deg, stated_width_deg
from lightfield.studies.link import arrival


class _AskedError(Exception):
    """Ends what asks for cells, with the half width that it asks for."""


def _asked(*places: object, **_: object) -> None:
    raise _AskedError(places[4])


@pytest.fixture
def table(tmp_path: Path) -> Lamp:
    """Half as bright at 1 degree."""
    (tmp_path / "beam.csv").write_text("angle_deg,intensity\n0,1\n2,0\n90,0\n")
    return Lamp(profile="table", intensity_table=str(tmp_path / "beam.csv"))


def test_a_skirt_widens_a_beam_and_not_its_core(table: Lamp) -> None:
    """Of (core + skirt) / 2 half is left where the two sum to 1."""
    skirt = Lamp(hwhm_deg=2.0, skirt_fraction=1.0, skirt_hwhm_deg=15.0)
    theta = stated_width_deg(skirt)
    parts = np.exp(-np.log(2) * (theta / np.array([2.0, 15.0])) ** 2)
    assert parts.sum() == pytest.approx(1.0, abs=1e-3) and core_width_deg(skirt) == 2.0
    for width in (stated_width_deg, core_width_deg):
        assert width(table) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("rise", [41.3, 44.0])
def test_what_a_fitted_curve_does_between_readings_is_not_the_width_of_its_beam(rise: float) -> None:
    """Far out one of a lamp with dark rings rose to more than half, or beyond all: 33 degrees, not 4."""
    spiked = ((0.0, 0.0), (30.0, 0.0), (31.0, rise), (32.0, 0.0))
    read = np.radians([0.0, 1.0, 2.0, 30.0, 32.0])
    assert stated_width_deg(Lamp(hwhm_deg=4.0, profile_departure=spiked)) > 30
    assert lobe_width_deg(Lamp(hwhm_deg=4.0, profile_departure=spiked), read) == pytest.approx(4.0, rel=1e-5)
    even = Lamp(hwhm_deg=90.0, profile_departure=((0.0, 0.0), (90.0, 0.5)))
    assert lobe_width_deg(even, read) == 90.0 and lobe_width_deg(Lamp(hwhm_deg=4.0), read) == 4.0


def test_cells_are_as_fine_as_the_beam_of_a_table(table: Lamp, monkeypatch: pytest.MonkeyPatch) -> None:
    """About readings, and along the axis of a link."""
    scene = Scene.from_dict({"water": {"scattering_per_m": 0.1}}).model_copy(update={"lamp": table})
    z = np.array([4.5, 6.5])
    for module, ask in (
        (at_readings, lambda: at_readings._traced(scene, 0 * z, 0 * z, z)),
        (arrival, lambda: arrival._late_light(scene, arrival.Colours.of(scene), z, None, {})),  # type: ignore[arg-type]
    ):
        monkeypatch.setattr(module, "positions_grid", _asked)
        with pytest.raises(_AskedError) as found:
            ask()
        assert found.value.args[0] == pytest.approx(1.0, abs=1e-3)
