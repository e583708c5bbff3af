"""The link: errors per bit by closed forms, ranges by a prototype, bandwidth by photons walked in NumPy."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr
from plain_walk import Arrived, walk
from scipy.optimize import brentq
from scipy.special import erfc

from lightfield.errors import SceneError, UsageError
from lightfield.formula.closed_form import direct_field
from lightfield.report.link import link_page
from lightfield.robots.field_file import Asked, field_dataset
from lightfield.scene import Scene
from lightfield.scene.lamp.profile import solid_angle_sr
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.link import arrival
from lightfield.studies.link.bandwidth import GROUP_INDEX, HALF_POWER, LIGHT_M_PER_S
from lightfield.studies.link.receiver import SEEN_SNR, Receiver
from lightfield.studies.link.study import Link, _reach, link
from lightfield.studies.link.text import as_data, as_text, surely
from lightfield.studies.photocurrent import ELECTRON_C
from lightfield.studies.working_range.reaches import Reach
from lightfield.studies.working_range.study import working_range

HALF = np.radians(3.81)
#: All of its power lies in the band.
LINE = {"peak_nm": 525.0, "fwhm_nm": 1.0}
#: Receivers to which photons are walked in NumPy, m.
WALKED_TO = (10.0, 20.0)


def scene(a: float = 0.05, b: float = 0.15, **lamp) -> Scene:
    phase = {"type": "henyey-greenstein", "g": 0.92}
    water = {"absorption_per_m": a, "scattering_per_m": b, "phase": phase}
    line = {"hwhm_deg": 3.81, "power_w": 10.0, "spectrum": LINE, **lamp}
    return Scene.from_dict({"lamp": line, "water": water})


@pytest.fixture(scope="module")
def clear() -> Link:
    """Nothing is scattered: nothing is traced."""
    return link(scene(0.2, 0.0), waters={"c = 0.1": (0.1, 0.0), "c = 0.35": (0.35, 0.0)})


@pytest.fixture(scope="module")
def murky() -> Link:
    return link(scene(), waters={}, max_photons=8e5, rel_error=1e-3)


def test_where_a_lamp_points_in_its_tank_is_of_no_account_in_open_water(clear) -> None:
    """Beside a beam of 3.8 degrees that is tilted by 6 a receiver straight ahead had a sixth of the light."""
    tilted = scene(0.2, 0.0, tilt_x_deg=6.0, tilt_y_deg=-2.0, offset_x_m=0.3)
    found = link(tilted, waters={"c = 0.1": (0.1, 0.0)})
    for name in ("scene", "c = 0.1"):
        assert found.reaches[name].data_m == pytest.approx(clear.reaches[name].data_m, rel=1e-6)
        assert found.reaches[name].seen_m == pytest.approx(clear.reaches[name].seen_m, rel=1e-6)


def test_an_error_rate_of_1e_6_is_a_Q_of_4_75() -> None:
    assert Receiver().needed_q == pytest.approx(4.753, abs=1e-3)


def test_errors_per_bit_by_hand() -> None:
    """Thermal noise alone: Q = i1 / (2 i_n sqrt(B)); shot noise of the mark alone: Q = sqrt(i1 / (2 q B))."""
    B, power = 5e5, np.array([1e-9])
    mark = 2 * 0.25 * power
    thermal = Receiver(noise_a_per_sqrt_hz=1e-11).q(power)
    assert thermal == pytest.approx(mark / (2 * 1e-11 * np.sqrt(B)), rel=1e-4)
    shot = Receiver(noise_a_per_sqrt_hz=1e-25).q(power)
    assert shot == pytest.approx(np.sqrt(mark / (2 * ELECTRON_C * B)), rel=1e-6)
    assert Receiver().error_rate(power) == pytest.approx(0.5 * erfc(Receiver().q(power) / np.sqrt(2)))
    ambient = 2 * ELECTRON_C * 1e-3 + 25e-24
    assert Receiver(background_a=1e-3).q(power) == pytest.approx(mark / (2 * np.sqrt(ambient * B)), rel=1e-4)
    assert Receiver().q(power, 0.5) == pytest.approx(0.5 * Receiver().q(power))


def test_range_of_the_formula_solves_its_equation(clear) -> None:
    """P = P_lamp ln2 / (pi h^2) exp(-cz) A / z^2; prototype at 1 Mbit/s: 40.6, 25.1 and 16.7 m."""
    receiver = Receiver()
    for name, c, prototype in (("c = 0.1", 0.1, 40.6), ("scene", 0.2, 25.1), ("c = 0.35", 0.35, 16.7)):

        def short(z: float, c: float = c) -> float:
            intensity = 10.0 * np.log(2) / (np.pi * HALF**2)
            power = intensity * np.exp(-c * z) / z**2 * 13e-6
            return float(receiver.q(np.array(power))) - receiver.needed_q

        reach = clear.reaches[name]
        assert reach.data_m == reach.data_formula_m
        assert reach.data_m == pytest.approx(brentq(short, 5, 60), rel=3e-3)  # a beam of small angle
        assert reach.data_m == pytest.approx(prototype, abs=0.15)


def test_ten_times_the_rate_shortens_it() -> None:
    """Prototype at 10 Mbit/s: 33.2, 21.1 and 14.3 m by exp(-cz)."""
    waters = {"c = 0.1": (0.1, 0.0), "c = 0.35": (0.35, 0.0)}
    found = link(scene(0.2, 0.0), Receiver(bit_rate_per_s=1e7), waters=waters)
    ranges = [found.reaches[name].data_m for name in ("c = 0.1", "scene", "c = 0.35")]
    assert ranges == pytest.approx([33.2, 21.1, 14.3], abs=0.15)


def test_scattered_light_carries_data(murky) -> None:
    """Prototype of 8e6 photons: 38.1 m against 25.1 m by exp(-cz); its 3 % of light there are 0.2 m.

    Scattered over direct light is 4.3 at 20 m.
    """
    reach, data = murky.reaches["scene"], murky.dataset.isel(water=0)
    assert reach.data_formula_m == pytest.approx(25.1, abs=0.15)
    assert 0 < reach.data_stderr_m < 1
    assert reach.data_m == pytest.approx(38.1, abs=3 * np.hypot(reach.data_stderr_m, 0.2))
    at = data.interp(z_m=20.0)
    relative = float(at.power_stderr_w / at.power_w)
    assert 0 < relative < 0.05
    assert float(at.scattered_over_direct) == pytest.approx(4.3, abs=0.05 + 3 * 4.3 * 1.25 * relative)


def test_behind_a_collimator_the_lamp_gives_the_power_that_it_gives_without(clear) -> None:
    """It takes all that comes straight along the axis; a radiance is that over the cone of 2 degrees."""
    narrow = {"quantity": "radiance", "full_angle_deg": 2.0}
    seen = Scene.from_dict({**scene(0.2, 0.0).model_dump(exclude_none=True), "detector": narrow})
    found, plain = (one.dataset.power_w.sel(water="scene").values for one in (link(seen, waters={}), clear))
    np.testing.assert_allclose(found, plain, rtol=1e-6)


def test_where_no_data_come_through_nothing_is_said_of_nearer() -> None:
    found = link(scene(30.0, 0.0), waters={}, to_m=6.0)
    nowhere = "nowhere from 4 m on"
    assert as_text(found).startswith(
        f"1 Mbit/s reach {nowhere} in the scene's water; exp(−cz) says {nowhere}."
    )


def test_scattered_light_that_is_not_known_tells_no_bandwidth(monkeypatch) -> None:
    """Of three distances the last two have too few photons, or none: not light that comes without delay."""
    nodes, none = np.array([4.0, 6.0, 8.0]), np.full(3, np.inf)
    late = arrival._Late(np.array([1e-3, 1e-4, 0.0]), np.array([0.01, 0.5, 0.0]), none, none, np.ones(3))
    monkeypatch.setattr(arrival, "_late_light", lambda *_: late)
    found = arrival.along_axis(scene(), Receiver(), nodes, np.array([4.0, 5.0, 8.0]), {})
    assert found.bandwidth_hz.values.tolist() == pytest.approx([np.inf, np.nan, np.nan], nan_ok=True)


@pytest.mark.usefixtures("undrawn")
def test_layers_that_are_left_out_are_told(clear) -> None:
    layered = scene(0.2, 0.0).with_values({"water.layer_absorption_per_m": 2.0})
    found = link(layered, waters={})
    assert found.reaches["scene"].data_m == clear.reaches["scene"].data_m
    assert "gradients, layers and hardening of its absorption are left out" in as_text(found)
    assert "are left out" in link_page(found) and "layers" not in as_text(clear)


def test_a_formula_of_the_beam_shares_its_power_anew() -> None:
    """I0 is the power over the integral of the beam that the formula makes, as a render has it."""
    ring = {
        "name": "ring", "stage": "source", "formula": "1 + a*theta/5",
        "parameters": {"a": {"range": [0.0, 5.0], "neutral": 0.0, "value": 2.0}},
    }  # fmt: skip
    lamp = Scene.from_dict({**scene(0.2, 0.0).model_dump(), "effect": [ring], "array": {}})
    theta = np.linspace(0.0, 0.5, 20001)
    beam = np.exp(-np.log(2) * (theta / HALF) ** 2) * (1 + 2.0 * np.degrees(theta) / 5)
    intensity = 10.0 / float(np.trapezoid(2 * np.pi * np.sin(theta) * beam, theta))
    found, z = link(lamp, waters={}, to_m=12.0), 10.0
    power = float(found.dataset.power_w.isel(water=0).interp(z_m=z))
    assert power == pytest.approx(intensity * 13e-6 * np.exp(-0.2 * z) / z**2, rel=2e-3)
    assert found.in_band_w == pytest.approx(10.0, rel=1e-4)
    array = lamp.array
    assert array is not None
    current = array.responsivity_a_per_w * 1e-6 * array.element_area_mm2 * intensity
    assert SensorNoise.of_scene(lamp).ampere == pytest.approx(current, rel=2e-3)
    field = field_dataset(lamp, Asked(0.2, 4.0, 6.0), photons=0)
    assert field.attrs["radiant_intensity_on_axis_w_per_sr"] == pytest.approx(intensity, rel=2e-3)


def halogen_w(response=None, absorption=0.1, z_m=0.0) -> float:
    """Watts of a halogen lamp of 1 W, 2900 K, from 500 to 550 nm, after so much water; by Planck's law."""
    w = np.linspace(500.0, 550.0, 5001) * 1e-9
    h, c, k, sigma = 6.62607015e-34, 299792458.0, 1.380649e-23, 5.670374419e-8
    radiance = 2 * h * c**2 / w**5 / np.expm1(h * c / (w * k * 2900.0))
    seen = np.ones_like(w) if response is None else response(w * 1e9)
    a = absorption(w * 1e9) if callable(absorption) else absorption
    per_m = np.pi * radiance / (sigma * 2900.0**4) * seen / seen.mean() * np.exp(-a * z_m)
    return float(np.trapezoid(per_m, w))


def test_of_the_lamp_that_counts_which_is_read_in_the_band() -> None:
    """0.9 % of a halogen lamp: all of its power would be 109 times as much."""
    lamp = scene(0.2, 0.0, power_w=50.0, spectrum="planck", temperature_k=2900.0)
    found, z = link(lamp, waters={}, to_m=20.0), 10.0
    share = halogen_w()
    assert 1 / share == pytest.approx(109, abs=1)
    assert found.in_band_w == pytest.approx(50.0 * share, rel=1e-5)
    intensity = 50.0 * share / solid_angle_sr(lamp.lamp)
    power = float(found.dataset.power_w.isel(water=0).interp(z_m=z))
    assert power == pytest.approx(intensity * 13e-6 * np.exp(-0.2 * z) / z**2, rel=1e-3)
    assert "50 W lamp, of which 0.461 W count, from 500 to 550 nm" in as_text(found)
    assert as_data(found)["lamp_in_band_w"] == found.in_band_w


def test_water_and_detector_count_at_every_wavelength_of_the_band() -> None:
    """The integral of spectrum, response over its mean, and transmission, on a fine grid."""
    lamp = scene(0.0, 0.0, power_w=50.0, spectrum="planck", temperature_k=2900.0)
    water = {"absorption_per_m": 0.05, "absorption_at": [[500.0, 0.0], [550.0, 0.3]]}
    detector = {"response": {"peak_nm": 540.0, "fwhm_nm": 30.0}}
    told = lamp.model_dump(include={"lamp"}, exclude_unset=True)
    coloured = Scene.from_dict({**told, "water": water, "detector": detector})
    data = link(coloured, waters={}, to_m=20.0).dataset.isel(water=0)

    def response(w: np.ndarray) -> np.ndarray:
        return np.exp(-4 * np.log(2) * ((w - 540.0) / 30.0) ** 2)

    for z in (4.0, 8.0, 16.0):
        known = halogen_w(response, lambda w: 0.05 + 0.006 * (w - 500.0), z)
        known *= 50.0 / solid_angle_sr(lamp.lamp) * 13e-6 / z**2
        assert float(data.power_w.interp(z_m=z)) == pytest.approx(known, rel=0.01)


@pytest.mark.slow
def test_scattered_light_knows_the_colour_of_the_lamp() -> None:
    """A line at 510 nm in water whose absorption there is 0.05 per m, in the middle of the band 0.2."""
    grey = link(scene(0.05, 0.15), waters={}, to_m=20.0, max_photons=2e5, rel_error=1e-3)
    told = scene(0.0, 0.15, spectrum={"peak_nm": 510.0, "fwhm_nm": 1.0}).model_dump(exclude_unset=True)
    told["water"]["absorption_at"] = [[510.0, 0.05], [525.0, 0.2]]
    line = link(Scene.from_dict(told), waters={}, to_m=20.0, max_photons=2e5, rel_error=1e-3)
    for name in ("power_w", "scattered_over_direct"):
        one, other = (found.dataset[name].isel(water=0).interp(z_m=10.0) for found in (grey, line))
        assert float(other) == pytest.approx(float(one), rel=0.02)


def test_a_lamp_with_no_light_in_the_band_is_refused() -> None:
    with pytest.raises(UsageError, match=r"lamp.spectrum: no light.*500 to 550 nm.*remedy"):
        link(scene(0.1, 0.0, spectrum={"peak_nm": 1500.0, "fwhm_nm": 1.0}), waters={})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("b", "slow_m", "fast_m", "scattered_over_direct"),
    [(0.05, 50.1, 40.2, 0.7), (0.15, 38.1, 30.7, 4.3), (0.30, 29.8, 24.0, 36.0)],
)
def test_how_far_scattered_light_carries_data(b, slow_m, fast_m, scattered_over_direct) -> None:
    """Prototype of 8e6 photons, 1 and 10 Mbit/s: 3 % of its light there are 0.2 to 0.3 m; light at 20 m."""
    for rate, prototype in ((1e6, slow_m), (1e7, fast_m)):
        receiver = Receiver(bit_rate_per_s=rate)
        found = link(scene(0.05, b), receiver, waters={}, max_photons=8e6, rel_error=1e-3)
        reach, data = found.reaches["scene"], found.dataset.isel(water=0).interp(z_m=20.0)
        assert reach.data_stderr_m < 1
        assert reach.data_m == pytest.approx(prototype, abs=3 * np.hypot(reach.data_stderr_m, 0.3))
    relative = float(data.power_stderr_w / data.power_w)
    assert float(data.scattered_over_direct) == pytest.approx(
        scattered_over_direct, abs=0.05 + 3 * scattered_over_direct * np.hypot(1.25 * relative, 0.03)
    )


def walked(arrived: Arrived, direct: float, receiver: int) -> tuple[float, float]:
    """Bandwidth and error from each photon's own path: nothing is binned but delays within 0.5 %."""
    delay = arrived.excess_m * GROUP_INDEX / LIGHT_M_PER_S
    kind = np.round(np.log(np.maximum(delay, 1e-18)) / 5e-3).astype(int)
    f = np.geomspace(1e8, 1e10, 250)

    def of(some: np.ndarray, scale: float) -> float:
        at, which = np.unique(kind[some], return_inverse=True)
        weight = scale * np.bincount(which, arrived.weight[some])
        turned = np.exp(-2j * np.pi * np.outer(f, np.exp(5e-3 * at))) @ weight
        transfer = np.abs(direct + turned) / (direct + weight.sum())
        k = int(np.flatnonzero(transfer < HALF_POWER)[0])
        return float(np.exp(np.interp(HALF_POWER, transfer[[k, k - 1]], np.log(f[[k, k - 1]]))))

    mine, n = arrived.receiver == receiver, arrived.batches
    parts = [of(mine & (arrived.batch != k), n / (n - 1)) for k in range(n)]
    return of(mine, 1.0), float(np.sqrt((n - 1) / n * np.sum((parts - np.mean(parts)) ** 2)))


@pytest.fixture(scope="module")
def arrived() -> Arrived:
    return walk(0.05, 0.15, 0.92, WALKED_TO, 3.81, 50_000, seed=2)


@pytest.mark.parametrize("receiver", [0, 1])
def test_bandwidth_of_photons_walked_in_numpy(murky, arrived, receiver) -> None:
    """In steps that absorption asks for it was 10 % off, and stated 1 %."""
    direct = direct_field(scene(), np.zeros(1), np.zeros(1), np.array([WALKED_TO[receiver]]))
    right, error = walked(arrived, float(direct[0]), receiver)
    at = murky.dataset.isel(water=0).interp(z_m=WALKED_TO[receiver])
    found, stated = float(at.bandwidth_hz), float(at.bandwidth_stderr_hz)
    assert abs(found - right) < 3.5 * np.hypot(error, stated)
    assert stated < 0.1 * found and error < 0.05 * right


def test_late_light_narrows_the_band_and_closes_the_eye(murky) -> None:
    data = murky.dataset.isel(water=0)
    near, far = (data.interp(z_m=z) for z in (10.0, 40.0))
    assert float(near.bandwidth_hz) > 2 * float(far.bandwidth_hz) > 0
    assert 0 < float(far.bandwidth_stderr_hz) < float(far.bandwidth_hz)
    fast = link(scene(), Receiver(bit_rate_per_s=1e9), waters={}, max_photons=8e5, rel_error=1e-3)
    slow = float(far.eye)
    assert 0.9 < slow < 1 and float(fast.dataset.isel(water=0).interp(z_m=40.0).eye) < 0.6 * slow
    assert murky.reaches["scene"].data_with_echoes_m <= murky.reaches["scene"].data_m


def test_docking_reaches_as_far_as_the_pose_is_known(clear) -> None:
    """One definition: where `range` has it in that water.

    By size of the light alone it would end at (0.05^2 + (0.2 c z)^2)^(1/2) / (2 / z + c) = 0.3 m; the width
    of the beam tells some of the distance, too. Its own closed forms: working_range/test_study.
    """
    for name, c in (("c = 0.1", 0.1), ("c = 0.35", 0.35)):
        by_size = brentq(lambda z, c=c: np.hypot(0.05, 0.2 * c * z) / (2 / z + c) - 0.3, 2, 20)
        docking = clear.reaches[name].docking
        assert docking.z_m == docking.formula_m and docking.stderr_m == 0
        there = scene(c, 0.0).with_values({"detector.planes_m": [4.0, 8.0]})
        asked = working_range(there, None, to_m=20.0).reaches
        assert docking.z_m == pytest.approx(next(r for r in asked if r.name == "pose").z_m, rel=0.01)
        assert docking.z_m > by_size


def test_a_lamp_is_seen_farther_than_it_talks(clear) -> None:
    for reach in clear.reaches.values():
        assert reach.seen_formula_m > reach.data_formula_m


@pytest.mark.parametrize(
    ("wrong", "called"),
    [
        ({"ber": 0.6}, "ber"), ({"area_mm2": 0.0}, "area"), ({"background_a": -1.0}, "background"),
        ({"bit_rate_per_s": np.nan}, "bit rate"), ({"area_mm2": 1e-300}, "area"),
        ({"bit_rate_per_s": 1e30}, "bit rate"), ({"noise_a_per_sqrt_hz": 2.0}, "amplifier noise"),
    ],
)  # fmt: skip
def test_receivers_that_make_no_sense(wrong, called) -> None:
    with pytest.raises(UsageError, match=f"^{called}: impossible number"):
        Receiver(**wrong)


def test_distances_waters_and_lamps_that_make_no_sense() -> None:
    with pytest.raises(UsageError, match=r"impossible farthest distance; found '3 m'.*above 4 m"):
        link(scene(), to_m=3.0)
    with pytest.raises(UsageError, match="at most 1000 m"):
        link(scene(), to_m=1e9)
    with pytest.raises(UsageError, match=r"water turbid: no light is left so far.*nearer distance"):
        link(scene(0.05, 0.05), to_m=1000.0)
    with pytest.raises(UsageError, match="impossible water"):
        link(scene(), waters={"ice": (-1.0, 0.1)})
    with pytest.raises(SceneError, match=r"pencil beam.*remedy"):
        link(scene(profile="pencil"))


def test_what_lies_beyond_the_farthest_distance_was_not_asked() -> None:
    near = link(scene(0.06, 0.0), waters={}, to_m=5.0)
    assert as_data(near)["reaches"]["scene"]["docking"]["z_m"] is None
    assert as_text(near).count("> 5 m") > 6 and "9." not in as_text(near).splitlines()[3]
    assert "in the scene's water: no limit at 5 m." in as_text(near)


@pytest.mark.usefixtures("undrawn")
def test_words_data_and_page(clear) -> None:
    data = json.loads(json.dumps(as_data(clear)))
    assert data["reaches"]["c = 0.1"]["data_m"] == pytest.approx(40.6, abs=0.15)
    docking = data["reaches"]["c = 0.1"]["docking"]
    assert (docking["name"], docking["rule"]) == ("pose", "all that docking asks of a pose")
    assert "10 to 15 m (turbid bay; Cowen" in as_text(clear)
    page = link_page(clear)
    assert all("a one has twice that power" in told for told in (page, as_text(clear)))
    assert "first source" in page and page.count("<svg") == 2 * 2


@pytest.mark.parametrize(("part", "sure"), [(0.01, False), (0.7, True)])
def test_what_few_photons_tell_of_far_light_is_not_known_to_be_seen(part: float, sure: bool) -> None:
    """Power of (8 ± 5.6)e-10 W at the end, where 6.3e-10 W are needed."""
    z, receiver = np.linspace(4.0, 60.0, 18), Receiver(noise_a_per_sqrt_hz=5e-12)
    needed = brentq(lambda w: float(receiver.seen_snr(np.array(w))) - SEEN_SNR, 1e-15, 1e-3)
    power = needed * np.geomspace(1e4, 1.3, len(z))
    error = power * np.linspace(0, part, len(z))
    light = {"power_w": power, "power_stderr_w": error, "power_formula_w": power, "eye": np.ones(len(z))}
    data = xr.Dataset({name: ("z_m", value) for name, value in light.items()}, {"z_m": z})
    found = _reach(data, receiver, Reach("pose", 6.0, 0.1, 6.0))
    assert np.isinf(found.seen_m) and np.isfinite(found.seen_sure_m) == sure
    if sure:
        lit = power - 2 * error > needed
        assert z[lit].max() <= found.seen_sure_m <= z[~lit].min()
        assert surely("> 60 m", found.seen_sure_m) == f"> 60 m ({found.seen_sure_m:.1f} m for sure)"
