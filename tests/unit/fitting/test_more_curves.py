"""Gains of planes, and spectra of lamp and water, that no formula names: found, shown, written, hidden; and
the end of a lamp's curve in the dark.

Readings come from closed forms and sums written here, not from the curves of the fit.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from beams import flood
from scipy.stats import chi2

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.setup import problem_of, spectral
from lightfield.diagnosis.problem.untestable import Hinders, Hindrance
from lightfield.diagnosis.verdict.ladder import held_out
from lightfield.experiments.hide import draw_effect
from lightfield.fitting import effects
from lightfield.fitting.curves import BEYOND, PROFILE
from lightfield.fitting.fitted_curves import FittedCurve, fitted_curves, save_spectrum
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.scene.lamp.profile import radial_intensity
from lightfield.scene.lamp.spectrum import axial_intensity

HWHM, PER_M, SURE = 4.6, 0.105, 1e-4
COLOURS = np.array([440.0, 470.0, 500.0, 530.0, 560.0, 590.0, 620.0])


def places(planes: int, rng: np.random.Generator, across: int = 11) -> tuple[np.ndarray, ...]:
    """x, z and time: a line across every plane, in random order."""
    z, x = (v.ravel() for v in np.meshgrid(np.linspace(4.5, 8.5, planes), np.linspace(-0.6, 0.6, across)))
    return x, z, 20.0 * rng.permutation(z.size)


def light(x: np.ndarray, z: np.ndarray, per_m: np.ndarray | float = PER_M) -> np.ndarray:
    r, theta = np.hypot(x, z), np.degrees(np.arctan2(np.abs(x), z))
    return np.exp(-np.log(2) * (theta / HWHM) ** 2 - per_m * r) * z / r**3


def noisy(value: np.ndarray, rng: np.random.Generator, noise: float = 0.005, **columns: object) -> Readings:
    stderr = np.hypot(noise * value, 0.1 * noise * value.max())
    shown = value + stderr * rng.standard_normal(value.size)
    return Readings.from_arrays(value=shown, stderr=stderr, **columns)


def believed(**water: object) -> Scene:
    return Scene.from_dict({"lamp": {"hwhm_deg": 4.0}, "water": {"absorption_per_m": 0.12, **water}})


def fitted(table: Readings, scene: Scene, name: str) -> tuple[Problem, Fit, FittedCurve]:
    """The largest form of a curve, from where nothing departs."""
    scene = spectral(scene, table)
    found, why = problem_of(SceneForward(scene, table), table, [effects.get(name)], None)
    assert not why, why

    def whiten(columns: np.ndarray) -> np.ndarray:
        return (columns.T / table.stderr).T

    base = found.fit((), whiten, [found.model().start])
    chosen = found.curves[-1]
    fit = found.fit((chosen,), whiten, [np.r_[base.u, np.zeros(len(chosen.amplitudes))]])
    (curve,) = fitted_curves(found.forward, fit)
    return found, fit, curve


def likely(squares: np.ndarray, of: int) -> bool:
    return bool(chi2.ppf(SURE / 2, of) < np.sum(squares) < chi2.ppf(1 - SURE / 2, of))


def test_gains_of_planes_are_found_up_to_gain_and_absorption() -> None:
    """Of five planes: their logarithms, less the straight line that gain and water make of them."""
    pulls = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        x, z, time = places(5, rng)
        true = 0.03 * rng.standard_normal(5)
        table = noisy(
            light(x, z) * np.exp(true)[np.rint(z - 4.5).astype(int)], rng, x_m=x, z_m=z, time_s=time
        )
        found, fit, curve = fitted(table, believed(), "plane_gain")
        # No plane tells of the gain of another one: no error of planes held out.
        assert np.isnan(held_out(found, (found.curves[-1],), fit, lambda columns: columns))
        off, error = np.log(curve.value) - true, curve.stderr / curve.value
        line = np.stack([np.ones(5), curve.at - 6.5], axis=1)
        # What the weights of the readings call a straight line is another one: both are taken away.
        rest = off - line @ np.linalg.lstsq(line, off, rcond=None)[0]
        pulls.append(rest / error)
        assert likely(np.array([fit.chi2]), len(table.value) - len(fit.u))
    assert np.abs(pulls).max() < 5.0
    assert np.sqrt(np.mean(np.square(pulls))) > 0.1  # the errors are not made large


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_planes_of_a_long_campaign_that_have_a_gain_each_are_told(seed: int) -> None:
    """By 4 % and more, up and down: water that did it would have to amplify."""
    rng = np.random.default_rng(seed)
    x, z, time = places(15, rng)
    gains = np.exp(0.05 * rng.standard_normal(15))[np.rint((z - 4.5) * 3.5).astype(int)]
    table = noisy(light(x, z) * gains, rng, x_m=x, z_m=z, time_s=time)
    verdict = diagnose(table, believed(), diffuse=None, advise=False, seed=seed).verdict
    assert (verdict.verdict, verdict.certain) == ("identified", ["plane_gain"])


@pytest.mark.slow
def test_clouds_along_the_tank_are_not_called_gains_of_planes() -> None:
    """Two clouds dim more by what lies beyond them: gains can follow that, but water can too."""
    rng = np.random.default_rng(0)
    x, z, time = places(15, rng)
    depth = 0.3 * np.clip(z - 5.2, 0, 0.4) + 0.5 * np.clip(z - 7.3, 0, 0.3)
    dimmed = light(x, z) * np.exp(-depth * np.hypot(x, z) / z)
    table = noisy(dimmed, rng, x_m=x, z_m=z, time_s=time)
    verdict = diagnose(table, believed(), diffuse=None, advise=False).verdict
    assert "plane_gain" not in [*verdict.certain, *verdict.simplest]
    assert verdict.verdict != "identified" or "plane_gain" not in verdict.best_set


def coloured(
    rng: np.random.Generator, more: np.ndarray, power: np.ndarray | None = None
) -> dict[str, object]:
    """Places, colours and light of water whose absorption is a table's with something more."""
    x, z, time = places(5, rng, across=5)
    n = len(COLOURS)
    x, z, time = (np.repeat(v, n) for v in (x, z, time))
    wave = np.tile(COLOURS, z.size // n)
    lit = light(x, z, np.tile(base_of(COLOURS) + more, z.size // n))
    gain = np.ones(n) if power is None else power
    return {
        "x_m": x,
        "z_m": z,
        "time_s": time,
        "wavelength_nm": wave,
        "lit": lit * np.tile(gain, z.size // n),
    }


def base_of(wavelength: np.ndarray) -> np.ndarray:
    return np.interp(wavelength, [400.0, 500.0, 600.0, 700.0], [0.05, 0.04, 0.25, 0.6])


def with_base(folder: Path, **lamp: object) -> Scene:
    """The scene of that table."""
    rows = [f"{w},{a},0" for w, a in zip([400, 500, 600, 700], [0.05, 0.04, 0.25, 0.6], strict=True)]
    head = "wavelength_nm,absorption_per_m,scattering_per_m"
    (folder / "water.csv").write_text("\n".join([head, *rows]) + "\n")
    water = {"base": "table", "table": str(folder / "water.csv")}
    bands = {"bands_nm": [[420.0, 640.0]]}
    return Scene.from_dict({"lamp": {"hwhm_deg": 4.0, **lamp}, "water": water, "detector": bands})


def dye(wavelength: np.ndarray) -> np.ndarray:
    """Absorption of a dye, which no constituent of the table has."""
    return 0.06 * np.exp(-(((wavelength - 525.0) / 30.0) ** 2))


def test_an_attenuation_spectrum_is_found(tmp_path: Path) -> None:
    """A dye at 525 nm in water of a known base: K at every wavelength within its errors."""
    pulls = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        made = coloured(rng, dye(COLOURS), power=np.linspace(1.0, 0.5, len(COLOURS)))
        lit = made.pop("lit")
        found, fit, curve = fitted(noisy(lit, rng, **made), with_base(tmp_path), "attenuation_spectrum")
        there = [np.abs(curve.at - w).argmin() for w in COLOURS]
        true = base_of(curve.at[there]) + dye(curve.at[there])
        pulls.append((curve.value[there] - true) / curve.stderr[there])
        assert [len(c.amplitudes) for c in found.curves] == [2, 4, 6]
        # Seven wavelengths have six functions, but each has readings at several distances to contradict it.
        assert not any(c.is_hardly_tested for c in found.curves)
        assert likely(np.array([fit.chi2]), len(lit) - len(fit.u))
    assert likely(np.square(pulls), np.size(pulls))


@pytest.mark.slow
def test_a_dye_is_called_by_its_spectrum_and_dissolved_matter_by_its_name(tmp_path: Path) -> None:
    """Named forms win where they suffice."""
    verdicts = {}
    for name, more in {"dye": dye(COLOURS), "cdom": 0.3 * np.exp(-0.014 * (COLOURS - 440.0))}.items():
        rng = np.random.default_rng(2)
        made = coloured(rng, more)
        lit = made.pop("lit")
        table = noisy(lit, rng, **made)
        verdicts[name] = diagnose(table, with_base(tmp_path), diffuse=None, advise=False).verdict
    assert verdicts["dye"].best_set == verdicts["dye"].certain == ["attenuation_spectrum"]
    assert verdicts["cdom"].best_set == ["cdom"]


def test_a_lamp_spectrum_is_found_and_is_a_lamp_for_every_scene(tmp_path: Path) -> None:
    """Absolute readings of a lamp brighter in the green than a black body; its table gives them again."""
    scene = with_base(tmp_path, power_w=50.0)
    theta = (np.arange(200_000) + 0.5) * (0.5 * np.pi / 200_000)
    beam = (
        2
        * np.pi
        * np.sum(np.exp(-np.log(2) * (np.degrees(theta) / HWHM) ** 2) * np.sin(theta))
        * theta[0]
        * 2
    )
    x5 = 1.438776877e7 / (COLOURS * 2900.0)
    planck = 15 / np.pi**4 * x5**5 / np.expm1(x5) / (1.438776877e7 / 2900.0)  # 1/nm
    bump = 0.3 * np.exp(-(((COLOURS - 520.0) / 45.0) ** 2))
    pulls = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        made = coloured(rng, 0.0 * COLOURS, power=50.0 * planck * np.exp(bump) / beam)
        lit = made.pop("lit")
        table = noisy(lit, rng, **made)
        table = replace(table, scale="absolute", units="W m-2 nm-1")
        _, fit, curve = fitted(table, scene, "lamp_spectrum")
        there = [np.abs(curve.at - w).argmin() for w in COLOURS]
        ratio = np.log(curve.value / curve.without)[there] - bump
        # A factor on all of it is the calibration's.
        pulls.append((ratio - ratio.mean()) / (curve.stderr / curve.value)[there])
        assert likely(np.array([fit.chi2]), len(lit) - len(fit.u))
    assert np.abs(pulls).max() < 5.0
    forward = SceneForward(scene, table)
    path = save_spectrum(forward, fit, tmp_path)
    assert path == tmp_path / "lamp_spectrum.csv"
    lamp = forward.scenes.at(fit.values).lamp
    (power,) = (float(line.split("=")[1]) for line in path.read_text().splitlines() if "power_w" in line)
    written = {"spectrum": "table", "spectrum_table": str(path), "power_w": power, "hwhm_deg": lamp.hwhm_deg}
    again = Scene.from_dict({"lamp": written}).lamp
    fine = np.linspace(410.0, 660.0, 200)
    np.testing.assert_allclose(axial_intensity(again, fine), axial_intensity(lamp, fine), rtol=1e-3)
    assert save_spectrum(forward, replace(fit, model=found_base(forward, table)), tmp_path) is None


def daylight(made: dict[str, object], of_brightest: np.ndarray) -> np.ndarray:
    """What each reading of a campaign has from above, whatever the lamp does."""
    return np.tile(of_brightest, len(made["lit"]) // len(COLOURS)) * np.max(made["lit"])


#: Blue from above, and red: over the brightest reading.
SKY = 0.02 * (440.0 / COLOURS) ** 4
DUSK = 0.012 * ((COLOURS - 440.0) / 180.0) ** 2


@pytest.mark.parametrize("sky", [SKY, DUSK])
def test_a_background_with_a_colour_is_found(sky: np.ndarray, tmp_path: Path) -> None:
    """Daylight: at every wavelength within its errors."""
    pulls = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        made = coloured(rng, 0.0 * COLOURS, power=np.linspace(1.0, 0.5, len(COLOURS)))
        above = daylight(made, sky)
        lit = made.pop("lit")
        table = noisy(lit + above, rng, **made)
        found, fit, curve = fitted(table, with_base(tmp_path), "background_spectrum")
        there = [np.abs(curve.at - w).argmin() for w in COLOURS]
        true = np.interp(curve.at[there], COLOURS, sky) * lit.max()
        pulls.append((curve.value[there] - true) / curve.stderr[there])
        assert [len(c.amplitudes) for c in found.curves] == [2, 4, 7]
        assert not any(c.is_hardly_tested for c in found.curves)
        assert likely(np.array([fit.chi2]), len(lit) - len(fit.u))
        changed = np.sqrt(np.sum((above / table.stderr) ** 2) / np.sum(((lit + above) / table.stderr) ** 2))
        assert curve.rms == pytest.approx(changed, rel=0.1)
    assert likely(np.square(pulls), np.size(pulls))


@pytest.mark.slow
def test_daylight_is_called_by_its_spectrum_and_dark_signal_by_its_name(tmp_path: Path) -> None:
    """Named forms win where they suffice."""
    verdicts = {}
    for name, sky in {"daylight": SKY, "dark signal": np.full(len(COLOURS), 0.01)}.items():
        rng = np.random.default_rng(2)
        made = coloured(rng, 0.0 * COLOURS)
        above = daylight(made, sky)
        lit = made.pop("lit")
        table = noisy(lit + above, rng, **made)
        verdicts[name] = diagnose(table, with_base(tmp_path), diffuse=None, advise=False).verdict
    assert verdicts["daylight"].best_set == verdicts["daylight"].certain == ["background_spectrum"]
    assert verdicts["dark signal"].best_set == verdicts["dark signal"].certain == ["background"]


def found_base(forward: SceneForward, table: Readings) -> object:
    return problem_of(forward, table, [], None)[0].model()


def test_relative_readings_have_the_spectrum_in_their_gains(tmp_path: Path) -> None:
    made = coloured(np.random.default_rng(0), 0.0 * COLOURS)
    lit = made.pop("lit")
    table = noisy(lit, np.random.default_rng(0), **made)
    _, why = problem_of(SceneForward(with_base(tmp_path), table), table, [effects.get("lamp_spectrum")], None)
    assert why == {"lamp_spectrum": (Hindrance(Hinders.RELATIVE),)}


def test_a_range_scale_that_reads_too_long_is_a_source_in_front_of_the_window() -> None:
    """Its zero lies behind the window: absorption and the rest are what they were."""
    too_long_m = 0.06
    rng = np.random.default_rng(1)
    z, x = (v.ravel() for v in np.meshgrid(np.linspace(1.5, 6.0, 6), np.linspace(-0.5, 0.5, 13)))
    lit = light(x - 0.02, z - too_long_m)
    table = noisy(lit + 0.01 * lit.max(), rng, x_m=x, z_m=z, time_s=20.0 * rng.permutation(z.size))
    verdict = diagnose(table, believed(), diffuse=None, advise=False).verdict
    assert set(verdict.best_set) == {"apparent_source", "beam_offset", "background"} == set(verdict.certain)
    fitted = verdict.ladder[-1].parameters
    for path, true in (("lamp.apparent_distance_m", -too_long_m), ("water.absorption_per_m", PER_M)):
        assert fitted[path].value == pytest.approx(true, abs=3 * fitted[path].stderr), path
        assert fitted[path].stderr < 0.2 * abs(true)


def test_one_reading_for_each_distance_tells_no_gain_of_planes() -> None:
    z = np.linspace(4.5, 8.5, 30)
    table = noisy(light(0 * z, z), np.random.default_rng(0), x_m=0 * z, z_m=z)
    _, why = problem_of(SceneForward(believed(), table), table, [effects.get("plane_gain")], None)
    assert "plane_gain" in why


@pytest.mark.parametrize(
    ("name", "field"),
    [
        ("plane_gain", "detector.plane_departure"),
        ("attenuation_profile", "water.absorption_departure"),
        ("lamp_power_curve", "lamp.power_departure"),
        ("attenuation_spectrum", "water.colour_departure"),
        ("scattering_spectrum", "water.scattering_departure"),
        ("background_spectrum", "detector.background_departure"),
    ],
)
def test_a_curve_is_hidden_by_its_name(name: str, field: str, tmp_path: Path) -> None:
    """Of the size that is asked for: the rms of its nodes; five times as much of ln as of absorption,
    and ten times as much of that of scattering, of which readings are no multiple."""
    rng = np.random.default_rng(0)
    made = coloured(rng, 0.0 * COLOURS)
    lit = made.pop("lit")
    table, scene = noisy(lit, rng, **made), with_base(tmp_path)
    values = draw_effect(scene, table, name, rng, 3.0)
    ((path, nodes),) = values.items()
    size = np.sqrt(np.mean([value**2 for _, value in nodes]))
    unit = 0.2 if path in ("water.colour_departure", "water.absorption_departure") else 1.0
    unit = {"background_spectrum": 0.1, "scattering_spectrum": 10.0}.get(name, unit)
    assert path == field and size == pytest.approx(0.06 * unit)
    assert scene.with_values(values).digest() != scene.digest()
    # A slope that the scene states stays, with the same curve on it.
    stating = scene.with_values({field: ((0.0, 0.1), (1000.0, 0.3))})
    (drawn,), (both,) = (
        draw_effect(one, table, name, np.random.default_rng(5), 3.0).values() for one in (scene, stating)
    )
    at = np.array([place for place, _ in drawn])
    alone, summed = (np.interp(at, *zip(*its, strict=True)) for its in (drawn, both))
    np.testing.assert_allclose(summed, alone + np.interp(at, [0.0, 1000.0], [0.1, 0.3]))


@pytest.mark.parametrize("seed", range(3))
def test_a_lamp_whose_axis_was_not_read_is_shown_over_what_was(seed: int) -> None:
    """Over its axis, which is a guess, all of it is as uncertain as that; the nearest angle is 2 degrees."""
    rng = np.random.default_rng(seed)
    x, z, time = places(9, rng, across=41)
    far = np.degrees(np.arctan2(np.abs(x), z))
    x, z, time, far = (v[far > 2.0] for v in (x, z, time, far))
    value = flood(far / HWHM) * np.exp(-PER_M * np.hypot(x, z)) * z / np.hypot(x, z) ** 3
    table = noisy(value, rng, x_m=x, y_m=0 * x, z_m=z, time_s=time, quantity="irradiance")
    _, _, curve = fitted(table, believed(), "beam_profile")
    nearest = float(far.min())
    assert curve.quantity == f"intensity / that at {nearest:.2g} deg"
    read = curve.at > 2.2
    off = curve.value - flood(curve.at / HWHM) / flood(np.array([nearest / HWHM]))
    assert np.all(np.abs(off[read]) < 4 * curve.stderr[read])
    assert curve.stderr[read].max() < 0.02 < curve.stderr[0]


def test_a_curve_ends_in_the_dark_where_the_table_does(tmp_path: Path) -> None:
    """A noisy table is dark at the largest angle read, not beyond: no scene took a curve of e^-700 there."""
    x, z, _ = places(3, np.random.default_rng(0))
    table = Readings.from_arrays(x_m=x, z_m=z, value=light(x, z), quantity="irradiance")
    last = float(SceneForward(believed(), table).scenes.curves.bases[PROFILE].place[-1]) / BEYOND
    rows = f"0,1\n{HWHM},0.5\n{last - 1},0\n{last + 0.2},0\n{last + 0.4},0.01\n60,0.001\n"
    (tmp_path / "lamp.csv").write_text(f"angle_deg,intensity\n{rows}")
    text = '[lamp]\nprofile = "table"\nintensity_table = "lamp.csv"\n'
    scenes = SceneForward(Scene.from_toml(text, folder=tmp_path), table).scenes
    lamp = scenes.at({scenes.curves.bases[PROFILE].paths[0]: 0.3}).lamp
    assert radial_intensity(lamp, np.radians([last + 0.5, 1.2 * last]) ** 2).max() < 1e-99
