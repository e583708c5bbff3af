"""What is left over each coordinate, where nothing explains it."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.report.diagnosis.rest import means_of_neighbours, rest_figure
from lightfield.report.diagnosis.view import DrawnReadings, Prediction, ReadingsView

N = 90


def example(timed: bool = True) -> ReadingsView:
    """Readings that swing with a period of 900 s, by twice their error; one of them is left out."""
    rng = np.random.default_rng(2)
    time = 20.0 * np.arange(N)
    model = rng.uniform(0.1, 1.0, N)
    value = model + 0.01 * (2 * np.sin(2 * np.pi * time / 900) + rng.standard_normal(N))
    value[7] = 9.0
    x, z = rng.uniform(-0.5, 0.5, N), rng.choice([2.0, 3.0, 4.0], N)
    readings = DrawnReadings(
        x, 0 * x, z, 0 * x + 525, value, 0.01 + 0 * x, ["water"] * N, np.arange(N) == 7,
        time if timed else np.full(N, np.nan),
    )  # fmt: skip
    return ReadingsView(readings, [Prediction("base", model)])


@pytest.mark.parametrize("narrow", [False, True])
def test_a_swing_shows_over_time_and_along_no_other_coordinate(narrow: bool) -> None:
    panels = {axis.get_xlabel(): axis for axis in rest_figure(example(), narrow).axes}
    assert list(panels) == ["time (minutes)", "angle (degrees)", "z (m)", "signal (over the largest)"]
    means = {name: np.abs(axis.lines[-1].get_ydata()).max() for name, axis in panels.items()}
    assert means.pop("time (minutes)") > 1.2 and max(means.values()) < 1.2
    assert all(np.abs(axis.lines[1].get_ydata()).max() < 6 for axis in panels.values())


def test_what_is_not_known_or_does_not_vary_has_no_panel() -> None:
    assert [a.get_xlabel()[:4] for a in rest_figure(example(False)).axes] == ["angl", "z (m", "sign"]


def test_means_have_the_error_of_their_own_scatter() -> None:
    """Means of nothing lie within four standard errors; readings of one place are not parted."""
    rng = np.random.default_rng(0)
    _, mean, stderr = means_of_neighbours(rng.uniform(0, 1, 6000), 3.0 * rng.standard_normal(6000))
    assert len(mean) == 12 and (np.abs(mean) < 4 * stderr).all()
    np.testing.assert_allclose(stderr, 3.0 / np.sqrt(500), rtol=0.2)
    place = np.repeat([1.0, 2.0, 3.0], 30)
    middle, mean, _ = means_of_neighbours(place, place)
    np.testing.assert_allclose(middle, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(mean, middle)
