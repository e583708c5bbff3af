"""Tables of many readings: diagnosed, with a word of what goes on, or refused with one."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from analytic_readings import many_lines

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.problem.setup import source_of
from lightfield.diagnosis.verdict.ladder import bright
from lightfield.errors import FitError
from lightfield.scene import Scene


def test_many_readings_find_the_effect_and_say_what_goes_on() -> None:
    """600 readings, whitened in blocks: a beam 2 cm off the axis is told from a tilted one."""
    readings, believed = many_lines(600, 5, **{"lamp.offset_x_m": 0.02})
    stages: list[str] = []
    found = diagnose(
        readings, believed, diffuse=None, only=["beam_offset", "beam_tilt", "background"], advise=False,
        progress=stages.append,
    )  # fmt: skip
    assert found.verdict.effects == ["beam_offset"]
    error = found.verdict.explanations[0].parameters["lamp.offset_x_m"]
    assert error.stderr is not None and abs(error.value - 0.02) < 4 * error.stderr
    assert stages[:3] == ["noise and outliers of 600 readings", "the base model", "one effect at a time"]


@pytest.mark.parametrize(("n", "distances"), [(20_005, 5), (3000, 1000)])
def test_too_many_readings_are_refused_with_a_word(n: int, distances: int) -> None:
    readings, believed = many_lines(n, distances)
    with pytest.raises(FitError, match="too many readings") as refused:
        diagnose(readings, believed, diffuse=None)
    assert str(n) in str(refused.value) and f"at {distances} distances" in str(refused.value)


def test_many_channels_of_one_distance_are_not_those_of_the_next() -> None:
    """Every reading is the only one of its channel at its distance, and so the brightest there."""
    z, wavelength = (v.ravel() for v in np.meshgrid([4.0, 5.0], np.linspace(400, 700, 1500), indexing="ij"))
    n = len(z)
    layout = layout_of(
        SimpleNamespace(
            x_m=np.zeros(n), y_m=np.zeros(n), z_m=z, time_s=np.full(n, np.nan), wavelength_nm=wavelength,
            medium=np.full(n, "water"), visit=np.full(n, np.nan),
            repeat=np.full(n, np.nan), common_percent=np.full(n, np.nan),
        )
    )  # fmt: skip
    value = np.where(z < 4.5, 1.0, 0.01)
    forward = SimpleNamespace(readings=SimpleNamespace(stderr=np.full(n, np.nan)))
    assert bright(SimpleNamespace(layout=layout, value=value, keep=np.ones(n), forward=forward)).all()


def test_light_is_not_traced_in_too_many_cells() -> None:
    """Without scattering in the scene the effects that need a trace are named as not tested; a scene that
    scatters cannot be done without, and is refused. Many readings in few planes, and on a track, take no more
    cells."""

    def never(*_: object, **__: object) -> None:
        raise AssertionError("traced")

    track, believed = many_lines(520, 520)
    assert source_of(believed, never, track) == (never, None)
    aside = np.random.default_rng(1).uniform(-8.0, 8.0, (2, 520))
    readings = replace(track, x_m=aside[0], y_m=aside[1])
    source, reason = source_of(believed, never, readings)
    assert source is None and "of at most 3000" in str(reason)
    with pytest.raises(FitError, match="too many places"):
        diagnose(readings, believed.with_values({"water.scattering_per_m": 0.05}), diffuse=never)
    for n in (600, 3005, 15_005):
        few, believed = many_lines(n, 5)
        assert source_of(believed, never, few) == (never, None)


def test_many_readings_where_the_scene_scatters_and_reflects_are_refused() -> None:
    """Each of the two alone is taken; both together are within the limit, and not beyond."""
    murky = {"tank.wall_albedo": 0.2, "water.scattering_per_m": 0.1}
    for n, hidden, taken in (
        (4005, murky, False),
        (4000, murky, True),
        (4005, {"tank.wall_albedo": 0.2}, True),
    ):
        readings, believed = many_lines(n, 5)
        there = Scene.from_dict({**believed.model_dump(), "tank": {}}).with_values(hidden)
        if taken:
            source_of(there, "trace", readings)
        else:
            with pytest.raises(FitError, match="rule: at most 4000"):
                source_of(there, "trace", readings)
