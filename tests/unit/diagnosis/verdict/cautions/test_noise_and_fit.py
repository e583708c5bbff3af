"""What is said of a fit beside its verdict."""

from __future__ import annotations

import numpy as np
from analytic_readings import scene

from lightfield.diagnosis.problem.setup import problem_of
from lightfield.diagnosis.verdict.cautions.noise_and_fit import of_single_readings
from lightfield.fitting import effects
from lightfield.fitting.forward import SceneForward
from lightfield.readings import Readings


def test_a_gain_of_one_reading_is_told_to_be_read_again() -> None:
    """A bubble dimmed the one reading at 5.5 m by a quarter, and its plane had a gain for sure."""
    rng = np.random.default_rng(0)
    z = np.r_[np.repeat([4.5, 6.5, 8.5], 11), 5.5, 7.5]
    x = np.r_[np.tile(np.linspace(-0.8, 0.8, 11), 3), 0.0, 0.0]
    r = np.hypot(x, z)
    light = np.exp(-np.log(2) * (np.degrees(np.arctan2(x, z)) / 4) ** 2 - 0.12 * r) * z / r**3
    light = light / light.max() * np.where(z == 5.5, 0.75, 1.0)
    stderr = np.hypot(0.005 * light, 1e-3)
    table = Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=light + stderr * rng.standard_normal(len(x)), stderr=stderr,
        quantity="irradiance",
    )  # fmt: skip
    made, _ = problem_of(SceneForward(scene(), table), table, [effects.get("plane_gain")], None)
    base, gains = (made.fit(some, lambda a: (a.T / stderr).T, [made.model(some).start])
                   for some in ((), made.curves[-1:]))  # fmt: skip
    assert of_single_readings(made, base) == []
    (told,) = of_single_readings(made, gains)
    assert (told.values["planes"], told.values["z_m"]) == (2, 5.5)
    assert 23 < told.values["percent"] < 27
    assert told.sentence.startswith("gains of 2 of the planes rest on one reading each, where a slip")
    assert "read again first at z = 5.5 m, which is 25 % off its neighbours" in told.sentence
