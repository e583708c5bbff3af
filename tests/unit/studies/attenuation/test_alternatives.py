"""Amounts that stand for each other: grey water that sediment imitates; the excess of light is given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lightfield.readings import Readings
from lightfield.scene import Scene, Water
from lightfield.studies.attenuation import constituents
from lightfield.studies.attenuation.constituents import (
    CONSTITUENTS,
    EXTRA,
    Alternatives,
    Amount,
    Constituents,
    fit_constituents,
    other_slope,
)
from lightfield.studies.attenuation.excess import NODES_A, NODES_B, Excess
from lightfield.studies.attenuation.ratios import ratios_of
from lightfield.studies.attenuation.scattered import Stack
from lightfield.studies.attenuation.study import Attenuation, Content, beer_lambert_is_off, only_without_grey
from lightfield.studies.attenuation.text import as_data, as_text

COLOURS, DISTANCES = np.linspace(420.0, 660.0, 9), np.array([2.0, 3.0, 4.0, 5.0])
PURE = Water(base="pure")
CDOM, GREY, SEDIMENT = "cdom_440_per_m", "scattering_per_m", "sediment_g_per_m3"
#: So much of what is scattered arrives all the same.
ARRIVES = 0.67


def stack_of(**water: float) -> Stack:
    """Noiseless readings, errors 0.3 %: a + 0.33 b is told at every colour, and nothing else."""
    z, colour, medium = (v.ravel() for v in np.meshgrid(DISTANCES, COLOURS, ["water", "air"], indexing="ij"))
    value = np.exp(-np.where(medium == "water", 0.1, 0.0) * z)
    table = Readings.from_arrays(
        z_m=z, wavelength_nm=colour, medium=medium, value=value, stderr=0.003 * value,
        plane_gain_percent=0.1, position_mm=0.0, common_percent=np.zeros(len(z)),
    )  # fmt: skip
    coefficients = np.zeros((NODES_A, NODES_B, len(DISTANCES)))
    coefficients[0, :2] = 0.5 * ARRIVES * DISTANCES
    ratios = ratios_of(table, Scene.from_dict({"water": {"base": "pure"}}))
    stack = Stack([ratios], [Excess(1.0, 1.0, coefficients, np.zeros((len(DISTANCES), 0)))])
    return replace(stack, tables=[replace(ratios, y=stack.of_water(Water(base="pure", **water)))])


@pytest.mark.slow
def test_sediment_or_grey_scattering_is_one_of_both() -> None:
    """Each may be nothing: sediment, as grey scattering made the light, and that, as sediment imitates it."""
    loose = fit_constituents(stack_of(**{CDOM: 0.05, GREY: 0.08}), PURE, grey=True)
    assert loose.amounts[CDOM].found
    assert not loose.amounts[SEDIMENT].found and not loose.amounts[GREY].found
    (one,) = loose.alternatives
    assert one.names == (SEDIMENT, GREY) and loose.instead_of(SEDIMENT) == [GREY]


@pytest.fixture
def only_cdom_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the search for ends of intervals, which takes most of the time."""

    def profile(sought, best, k, times, name, unit) -> Amount:
        low = 0.04 if name.startswith("CDOM") else 0.0
        return Amount(name, unit, float(best.u[k]), 0.01, low, 0.1, low, 0.1)

    monkeypatch.setattr(constituents, "_profile", profile)


@pytest.mark.usefixtures("only_cdom_is_found")
def test_the_smallest_sets_that_are_not_all_nothing() -> None:
    """Chlorophyll scatters too, and takes the place of both so badly that they are excluded without it."""
    (one,) = fit_constituents(stack_of(**{CDOM: 0.05, GREY: 0.08}), PURE, grey=True).alternatives
    assert one.names == (SEDIMENT, GREY)
    assert 5.99 < one.rise < 30  # 95 % of chi-square, two degrees of freedom; without chlorophyll it is 570


@pytest.mark.usefixtures("only_cdom_is_found")
def test_where_nothing_scatters_there_are_no_alternatives() -> None:
    assert fit_constituents(stack_of(**{CDOM: 0.05}), PURE, grey=True).alternatives == ()


def answer(alternatives: tuple[Alternatives, ...] = (), **low_95: float) -> Constituents:
    """0.1 (0.09 to 0.11) of each, or up to 0.12 where no lower end is given."""
    amounts = {}
    for name, low in low_95.items():
        unit, words, *_ = (CONSTITUENTS | EXTRA)[name]
        amounts[name] = Amount(words, unit, 0.1, 0.01, 0.09 * bool(low), 0.11, low, 0.12)
    return Constituents(amounts, alternatives, PURE, 60.0, 50)


def test_words_do_not_deny_both_nor_measure_beer_lambert_by_one() -> None:
    either = (Alternatives((SEDIMENT, GREY), 300.0),)
    formula = answer(**{CDOM: 0.08, SEDIMENT: 0.08})
    formula.amounts.update({name: replace(one, value=0.03) for name, one in formula.amounts.items()})
    traced = answer(**{CDOM: 0.08, SEDIMENT: 0.08})
    content = Content(traced, answer(either, **{CDOM: 0.08, SEDIMENT: 0.0, GREY: 0.0}), formula, {})
    assert only_without_grey(content) == [SEDIMENT] and list(beer_lambert_is_off(content)) == [CDOM]
    study = Attenuation((), None, content, ())
    words = as_text(study)
    assert "none found" not in words and "0 to 0.12, or grey scattering" in words
    assert "Sediment or grey scattering: these readings cannot tell them apart" in words
    assert "hold only if nothing but the constituents scatters: its sediment is no yardstick" in words
    assert "Beer-Lambert finds CDOM at 440 nm 70 % low, 7.0 of its stated errors;" in words
    data = as_data(study)["constituents"]
    assert data["grey_scattering_free"]["alternatives"] == [{"names": (SEDIMENT, GREY), "rise": 300.0}]
    assert data["traced"]["alternatives"] == []


def test_what_is_found_either_way_measures_beer_lambert() -> None:
    formula = answer(**{SEDIMENT: 0.08})
    formula.amounts[SEDIMENT] = replace(formula.amounts[SEDIMENT], value=0.03)
    content = Content(answer(**{SEDIMENT: 0.08}), answer(**{SEDIMENT: 0.08, GREY: 0.0}), formula, {})
    words = as_text(Attenuation((), None, content, ()))
    assert "Constituents (intervals of 68 %, limits of 95 %):" in words
    assert "Beer-Lambert finds sediment 70 % low" in words and "none found: < 0.12" in words
    assert "cannot tell" not in words and "hold only" not in words


@pytest.mark.usefixtures("only_cdom_is_found")
def test_cdom_of_another_slope_than_the_scenes_is_told() -> None:
    """Of 0.018 per nm beside 0.014, which does not fit: as readings say, and what chi-square would be."""
    steep = stack_of(**{CDOM: 0.3, "cdom_slope_per_nm": 0.018})
    traced = fit_constituents(steep, PURE)
    assert traced.rejected
    other = other_slope(steep, PURE, traced)
    assert other is not None and other.fits and other.held_per_nm == 0.014
    assert other.slope_per_nm == pytest.approx(0.018, abs=1e-4)
    content = Content(traced, traced, traced, {}, other)
    told = as_text(Attenuation((), None, content, ()))
    assert "by 0.0180 per nm it would fit" in told and "water.cdom_slope_per_nm" in told
    assert as_data(Attenuation((), None, content, ()))["constituents"]["other_slope"]["held_per_nm"] == 0.014


@pytest.mark.usefixtures("only_cdom_is_found")
def test_a_slope_that_fits_leaves_nothing_to_be_told() -> None:
    right = stack_of(**{CDOM: 0.3})
    assert other_slope(right, PURE, fit_constituents(right, PURE)) is None
