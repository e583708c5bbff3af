"""Light at places: what the detector sees of the band, against spectral light that is summed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.scene import Scene, Water
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.studies.light_at import light_at
from lightfield.studies.working_range.study import working_range

Z = np.array([2.0, 4.0, 6.0])
PEAK = {"peak_nm": 600.0, "fwhm_nm": 15.0}


def scene(**detector) -> Scene:
    return Scene.from_dict(
        {
            "lamp": {"hwhm_deg": 5.0, "temperature_k": 3000.0},
            "water": {"base": "pure"},
            "detector": {"bands_nm": [[560.0, 620.0]], **detector},
        }
    )


def by_hand(low: float, high: float, seen) -> np.ndarray:
    """sum P R exp(-c z) / z^2 over sum P R, steps of 0.2 nm, P of Planck's law at 3000 K."""
    at = np.arange(low + 0.1, high, 0.2)
    weight = at**-5.0 / np.expm1(1.438776877e7 / (at * 3000.0)) * seen(at)
    pure = Water(base="pure")
    c = absorption_per_m(pure, at) + scattering_per_m(pure, at)
    return np.array([(weight * np.exp(-c * z)).sum() / weight.sum() / z**2 for z in Z])


def filtered(at: np.ndarray) -> np.ndarray:
    return np.exp(-4 * np.log(2) * ((at - PEAK["peak_nm"]) / PEAK["fwhm_nm"]) ** 2)


@pytest.mark.parametrize(
    "detector, band, seen",
    [
        ({}, (560.0, 620.0), np.ones_like),
        ({"response": PEAK}, (560.0, 620.0), filtered),
        ({"wavelength_shift_nm": -20.0}, (540.0, 600.0), np.ones_like),
        ({"response": PEAK, "wavelength_shift_nm": 10.0}, (570.0, 630.0), filtered),
    ],
)
def test_it_is_the_mean_over_the_band_as_it_is_read(detector, band, seen) -> None:
    """To 0.5 %, where response or shift change it by 10 % and more."""
    found = light_at(scene(**detector), 0 * Z, 0 * Z, Z, None).direct
    assert found == pytest.approx(by_hand(*band, seen), rel=5e-3)
    if detector:
        plain = light_at(scene(), 0 * Z, 0 * Z, Z, None).direct
        assert np.abs(found / plain - 1).max() > 0.1


def test_range_goes_by_the_light_that_the_detector_sees() -> None:
    """Where light falls to a fifth of that at the first plane: a filter at 600 nm sees it end earlier."""
    reach = {
        name: next(r.z_m for r in working_range(scene(**more), None).reaches if r.name == "light")
        for name, more in (("all", {}), ("filtered", {"response": PEAK}))
    }
    assert reach["filtered"] < reach["all"] - 0.05


class Sent:
    """A trace that keeps what it is asked: the scene that photons are sent in, and that of the light."""

    def __init__(self) -> None:
        self.scenes: list[Scene] = []

    def __call__(self, scene: Scene, *places: np.ndarray, **_: float) -> Sent:
        self.scenes.append(scene)
        return self

    def light(self, scene: Scene, colours: list[float]) -> np.ndarray:
        self.scenes.append(scene)
        return np.ones((len(colours), len(Z)))

    def errors(self, scene: Scene, colours: list[float], which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self.scenes.append(scene)
        return np.zeros((len(Z), 1)), np.zeros(len(Z))


def test_scattered_light_is_that_of_the_beam_with_the_users_own_formulas() -> None:
    """One of the angle is in the lamp wherever light is asked for, and photons are sent as wide as it is."""
    wider = {"name": "wider", "stage": "source", "formula": "exp(a*theta**2)"}
    wider["parameters"] = {"a": {"range": [0.0, 0.1], "neutral": 0.0, "value": 0.75 * np.log(2) / 25}}
    sent = Sent()
    light_at(Scene.from_dict({**scene().model_dump(), "effect": [wider]}), 0 * Z, 0 * Z, Z, sent)
    assert all(one.lamp.profile_departure and not one.effect for one in sent.scenes) and len(sent.scenes) == 3
    assert sent.scenes[0].lamp.hwhm_deg == pytest.approx(10.0, rel=2e-3)
