"""What is said of a fit beside its verdict."""

from __future__ import annotations

from types import SimpleNamespace as Some

import numpy as np
import pytest
from analytic_readings import readings, scene

from lightfield.diagnosis.adequacy.templates import smooth_unknowns
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.problem.setup import problem_of
from lightfield.diagnosis.verdict.cautions.noise_and_fit import of_single_readings, ordered
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


@pytest.mark.parametrize(
    ("chi2", "p", "worst", "about"),
    [
        (98.0, 0.001, "~time", "the time"),
        (98.0, 0.001, ("beam_tilt", "two angles"), "beam tilt"),
        (98.0, 0.2, "~time", None),
        (400.0, 0.001, "~time", None),
    ],
)
def test_what_is_small_and_not_random_is_told_to_have_an_order(
    chi2: float, p: float, worst: object, about: str | None
) -> None:
    """A fit at the noise was "unexplained", and nothing said why."""
    adequacy = Some(p=p, tests={"~x": 0.3, worst: 2e-6}, critical_p=1e-4)
    fit = Some(chi2=chi2, u=np.zeros(2))
    level = Some(base=fit, adequacy=adequacy, bench=Some(test=Some(scale=1.0)))
    prepared = Some(problem=Some(keep=np.ones(100)), errors_stated=True)
    told = ordered(prepared, Some(level=level, closest=None))  # type: ignore[arg-type]
    assert [one.about for one in told] == ([] if about is None else [about])
    if told:
        assert "hardly larger than the errors (1 times)" in told[0].sentence
        assert f"goes with {about} (p = 2e-06; below 0.0001 is no chance)" in told[0].sentence


def test_every_unknown_of_the_tests_has_words() -> None:
    layout = layout_of(readings(layout="grid")[0])
    known = smooth_unknowns(layout, np.ones(layout.size), np.ones(layout.size))
    fit, prepared = Some(chi2=98.0, u=np.zeros(2)), Some(problem=Some(keep=np.ones(100)), errors_stated=True)
    for name in [*known, "all"]:
        adequacy = Some(p=0.001, tests={f"~{name}": 2e-6}, critical_p=1e-4)
        level = Some(base=fit, adequacy=adequacy, bench=Some(test=Some(scale=1.0)))
        (told,) = ordered(prepared, Some(level=level, closest=None))  # type: ignore[arg-type]
        assert told.about
