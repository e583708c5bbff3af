"""What a plan promises of readings to add: the same in any unit, and true once the layout has them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lightfield.diagnosis.plan import LayoutPlan, as_text, plan
from lightfield.diagnosis.planned import planned
from lightfield.fitting.forward import SceneForward
from lightfield.readings import Readings
from lightfield.scene import Scene

SCENE = Scene.from_dict({"lamp": {"hwhm_deg": 4.0}, "water": {"absorption_per_m": 0.12}})
#: Part of the brightest planned reading that the dark error is, over the relative one.
DARK = 0.1


def layout(**more: object) -> Readings:
    """Seven places on a line at three distances, read in random order."""
    z, x = (a.ravel() for a in np.meshgrid([4.5, 6.5, 8.5], np.linspace(-0.9, 0.9, 7), indexing="ij"))
    order = np.random.default_rng(1).permutation(21)
    return Readings.from_arrays(
        x_m=x[order], z_m=z[order], time_s=20.0 * np.arange(21), repeat=0.0, value=np.ones(21),
        quantity="irradiance", **more,
    )  # fmt: skip


def known(table: Readings, error: float, brightest: float) -> Readings:
    """With errors in per cent and of the dark, which belongs to a brightest reading."""
    value = planned(table, SceneForward(SCENE, table)).value
    full = brightest * value.max()
    return replace(table, stderr=np.hypot(error * value, DARK * error * full))


def with_advice(table: Readings, made: LayoutPlan, k: int) -> Readings:
    """The layout with the readings that one advice asks for, repeated as it says, at the end."""
    advice, n = made.helpful[k].advice, len(table)
    rows = np.r_[np.arange(n), np.zeros(len(advice.places.x_m) * advice.repeats, int)]
    x, y, z = (
        np.r_[getattr(table, name), np.repeat(getattr(advice.places, name), advice.repeats)]
        for name in ("x_m", "y_m", "z_m")
    )
    time = np.r_[table.time_s, np.full(len(rows) - n, table.time_s.max())]
    repeat = np.r_[np.zeros(n), np.tile(1.0 + np.arange(advice.repeats), len(advice.places.x_m))]
    return replace(table.subset(rows), x_m=x, y_m=y, z_m=z, time_s=time, repeat=repeat)


@pytest.mark.parametrize(
    ("error", "stays"),
    [(0.01, {}), (0.03, {}), (0.005, {"plane_gain_percent": 2.0}), (0.005, {"position_mm": 5.0})],
)
def test_what_is_promised_of_more_readings_comes_true(error: float, stays: dict[str, float]) -> None:
    """The plan of the layout with them has the distance that was promised, at the sizes of the first."""
    table = layout()
    table = replace(table, budget=replace(table.budget, **stays))
    made = plan(known(table, error, 1.0), SCENE)
    first = made.isolability
    assert made.helpful
    for k, helpful in enumerate(made.helpful):
        more = with_advice(table, made, k)
        value = planned(more, SceneForward(SCENE, more)).value
        later = plan(known(more, error, value[: len(table)].max() / value.max()), SCENE).isolability
        now, then = [], []
        for one, two in (helpful.between, helpful.between[::-1]):
            a, b = first.names.index(one), first.names.index(two)
            i, j = later.names.index(one), later.names.index(two)
            now.append(first.D[a, b])
            then.append(later.D[i, j] * first.sizes[a] / later.sizes[i])
        assert helpful.advice.now_sigma == pytest.approx(min(now), rel=0.02), helpful.between
        assert helpful.advice.predicted_sigma == pytest.approx(min(then), rel=0.1), helpful.between


@pytest.mark.parametrize("units", ["W m^-2 nm^-1", "uW/cm^2/nm"])
def test_it_is_promised_in_any_unit(units: str) -> None:
    """But for what is hardly worth the advice: the calibration of absolute readings is known besides."""

    def promised(**scale: str) -> dict[tuple[str, str], float]:
        made = plan(layout(wavelength_nm=525.0, **scale), SCENE)
        sigmas = {one.between: one.advice.predicted_sigma for one in made.helpful}
        return {pair: sigma for pair, sigma in sigmas.items() if sigma > 5}

    relative = promised(scale="relative")
    assert len(relative) == 2
    assert promised(scale="absolute", units=units) == pytest.approx(relative, rel=0.02)


@pytest.mark.parametrize("unit", [1e3, 1e-3])
def test_a_table_that_was_read_is_planned_for_in_its_own_unit(unit: float) -> None:
    """Values that the scene misses by up to a fifth tell the unit of the errors, and nothing else."""
    table = layout()
    light = planned(table, SceneForward(SCENE, table)).value
    missed = 1.0 + 0.2 * np.sin(table.z_m)
    once = plan(replace(table, value=missed * light, stderr=0.01 * light + 1e-3), SCENE)
    read = plan(replace(table, value=unit * missed * light, stderr=unit * (0.01 * light + 1e-3)), SCENE)
    assert read.largest == pytest.approx(unit * once.largest) and 0.8 < once.largest < 1.25
    for name, limit in once.limits.items():
        factor = unit if limit.path == "detector.background" else 1.0
        assert read.limits[name].value == pytest.approx(factor * limit.value, rel=1e-6), name
    bare = plan(replace(table, stderr=0.01 * light + 1e-3), SCENE)
    assert bare.largest == 1.0 and "the largest reading of this layout is 1)" in as_text(bare)


def test_readings_to_add_say_in_which_band_they_are_judged() -> None:
    """Of several bands the first one of the table; of one there is nothing to say."""
    one = layout(scale="relative")
    n = len(one)
    both = replace(one.subset(np.tile(np.arange(n), 2)), wavelength_nm=np.repeat([443.0, 550.0], n))
    scene = Scene.from_dict({**SCENE.to_dict(), "detector": {"bands_nm": [[442, 444], [549, 551]]}})
    made = plan(both, scene)
    assert made.helpful and {extra.advice.places.at_nm for extra in made.helpful} == {443.0}
    assert "readings each, of 443 nm, at x = " in as_text(made)
    alone = plan(one, SCENE)
    assert alone.helpful and " nm," not in as_text(alone)


def test_a_formula_does_not_do_what_all_its_shapes_would_together() -> None:
    """A bright spot at any place and of any width, beside a beam that is flatter: a hundred spots make any
    curve, one does not."""
    spot = {
        "name": "spot", "stage": "path", "formula": "1 + g*exp(-((x/z - s)/w)**2)",
        "parameters": {
            "g": {"range": [-0.5, 0.5], "neutral": 0.0, "typical": 0.03},
            "s": {"range": [-0.25, 0.25]}, "w": {"range": [0.01, 0.1]},
        },
    }  # fmt: skip
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-0.9, 0.9, 21), [3.0, 4.0, 5.0, 6.0, 7.0]))
    table = Readings.from_arrays(x_m=x, z_m=z, value=np.ones(x.size), quantity="irradiance")
    believed = Scene.model_validate(SCENE.model_dump(exclude_unset=True) | {"effect": [spot]})
    found = plan(known(table, 0.004, 1.0), believed).isolability
    k, names = found.names.index("spot"), list(found.names)
    for other in ("beam_shape", "beam_skirt", "beam_offset"):
        assert found.D[names.index(other), k] > 2.5, other
