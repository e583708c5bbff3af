"""What a scene refuses, and which layouts are said to make a diagnosis blind."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from lightfield.errors import MeasurementError
from lightfield.readings import Readings, read_table, write_table
from lightfield.readings.columns import LAYOUT
from lightfield.readings.load_warning import Remarks
from lightfield.scene import Scene, Tank

TANK = Tank(width_m=3.66, depth_m=2.44, length_m=12.0, behind_lamp_m=0.5, lamp_depth_m=1.0)


def scene(tank=TANK, bands=((500, 550),), quantity="irradiance"):
    detector = SimpleNamespace(bands_nm=bands, quantity=quantity)
    lamp = SimpleNamespace(least_distance_m=0.0, drift_per_hour=0.0)
    return SimpleNamespace(tank=tank, detector=detector, lamp=lamp)


def readings(**given) -> Readings:
    return Readings.from_arrays(**{"z_m": [4.5, 5.5], "value": [1.0, 0.5], **given})


# --- against a scene: tank x = -1.83..1.83, y = -1.44 (floor)..1 (surface), z up to 11.5 m


def test_the_scenes_single_band_and_quantity_are_filled_in():
    fitted = readings().check_against(scene())
    assert fitted.wavelength_nm.tolist() == [525, 525]
    assert fitted.quantity == "irradiance"


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"x_m": [0, 1.84]}, "x_m is outside the tank"),
        ({"x_m": [0, -1.84]}, "x_m is outside the tank"),
        ({"y_m": [0, 1.01]}, "y_m is outside the tank"),
        ({"y_m": [0, -1.45]}, "y_m is outside the tank"),
        ({"z_m": [4.5, 11.6]}, "z_m is outside the tank"),
        ({"wavelength_nm": [525, 560]}, "outside the scene's bands"),
    ],
)
def test_what_does_not_fit_names_the_reading(given, word):
    with pytest.raises(MeasurementError, match=f"reading 2: .*{word}"):
        readings(**given).check_against(scene())


def test_a_lamp_that_fades_ends_at_nothing():
    """A tenth less each hour: after ten hours it is dark, and would have less than no light."""
    fading, hours = Scene.from_dict({"lamp": {"drift_per_hour": -0.1}}), 3600.0
    readings(time_s=[0.0, 9.9 * hours]).check_against(fading)
    for end in (10 * hours, 20 * hours):
        with pytest.raises(MeasurementError, match="reading 2: the lamp has no light left"):
            readings(time_s=[0.0, end]).check_against(fading)
    with pytest.raises(MeasurementError, match="reading 1: the lamp has no light left"):
        readings(time_s=[-11 * hours, np.nan]).check_against(
            Scene.from_dict({"lamp": {"drift_per_hour": 0.1}})
        )


@pytest.mark.parametrize("time_s", [-3e9, 1.7e9, 1.7e12])
def test_times_are_seconds_since_the_lamp_was_switched_on(time_s):
    """A warm-up seen from a century before it is beyond any number; 1.7e12 is milliseconds since 1970."""
    with pytest.raises(MeasurementError, match="reading 2: time_s is impossible"):
        readings(time_s=[0.0, time_s])
    readings(time_s=[0.0, 9e6])
    readings(time_s=[-600.0, 0.0])


@pytest.mark.parametrize("slip", [9.2e18, -8e9])
def test_one_value_beyond_all_others_is_a_slip(slip):
    """Squares of it drown all others, so that nothing could be said about them."""
    with pytest.raises(MeasurementError, match="reading 3: value is beyond all others"):
        readings(z_m=[4.5, 5.5, 6.5], value=[1.0, 0.5, slip]).check_against(scene())
    readings(z_m=[4.5, 5.5, 6.5], value=[1.0, 1e-8, 1e-20]).check_against(scene())
    readings(z_m=[4.5, 5.5, 6.5], value=[1e8, 0.5, 0.3]).check_against(scene())


def test_an_error_of_next_to_nothing_is_none():
    """Its square is zero, and the weight of its reading infinite."""
    with pytest.raises(MeasurementError, match="reading 2: stderr is smaller than any instrument's"):
        readings(stderr=[0.01, 1e-320]).check_against(scene())
    readings(stderr=[1e-9, 1e-9]).check_against(scene())


def test_corners_of_the_tank_belong_to_it():
    readings(x_m=[1.83, -1.83], y_m=[1.0, -1.44], z_m=[11.5, 0.1]).check_against(scene())


def test_unbounded_water_and_air_have_no_walls():
    readings(x_m=[0, 50]).check_against(scene(tank=None))
    readings(x_m=[0, 50], medium=["water", "air"]).check_against(scene())


def test_exchanged_columns_are_proposed_where_they_would_fit_the_tank():
    with pytest.raises(MeasurementError, match="exchanged, x_m and y_m would lie inside"):
        readings(x_m=[0, 0], y_m=[0, 1.8]).check_against(scene(tank=TANK.model_copy(update={"width_m": 4.0})))
    with pytest.raises(MeasurementError) as caught:
        readings(x_m=[0, 5], y_m=[0, 5]).check_against(scene())
    assert "exchanged" not in str(caught.value)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"z_m": [120.0, 290.0]}, "look like centimetres: give metres, z_m over 100"),
        ({"x_m": [-250.0, 250.0]}, "look like millimetres: give metres, x_m over 1000"),
        ({"z_m": [4.5, 11.6]}, "positions are in metres"),
    ],
)
def test_positions_in_another_unit_are_told_by_the_tank(given, said):
    """A slip by a few centimetres is none."""
    with pytest.raises(MeasurementError, match=said):
        readings(**given).check_against(scene())


@pytest.mark.parametrize(
    ("given", "code"),
    [
        ({"z_m": [100.0, 150.0]}, Remarks.FAR_PLACES),
        ({"x_m": [-60.0, 60.0]}, Remarks.FAR_PLACES),
        ({"time_s": [0.0, 0.1]}, Remarks.FAST_TIMES),
        ({"time_s": [0.0, 20000.0]}, Remarks.SLOW_TIMES),
        ({"time_s": [0.0, 20.0]}, None),
        ({"time_s": [36000.0, 36020.0]}, Remarks.LATE_TIMES),
        ({"time_s": [90.0, 110.0]}, None),
    ],
)
def test_numbers_that_are_hardly_in_metres_and_seconds_are_warned_of(given, code):
    units = (Remarks.FAR_PLACES, Remarks.LATE_TIMES, Remarks.FAST_TIMES, Remarks.SLOW_TIMES)
    found = [w.code for w in readings(**given).warnings if w.code in units]
    assert found == ([] if code is None else [code])


def test_from_the_part_that_is_told_on_no_drift_makes_a_lamp_grow_so_much() -> None:
    """The power 1 + d t of the physics, at the ends of readings that begin late, for any d above 0."""
    time = np.array([36000.0, 37500.0])
    (late,) = (w for w in readings(time_s=time).warnings if w.code is Remarks.LATE_TIMES)
    steep = np.geomspace(1e-3, 1e6, 200)[:, None]
    first, last = (1 + steep * time / 3600).T
    grown = 100 * (last / first - 1)
    assert grown.max() == pytest.approx(late.values["percent"], rel=0.02)


@pytest.mark.parametrize(("value", "stderr", "warned"), [(1.0, 0.01, False), (0.01, 1.0, True)])
def test_errors_larger_than_all_light_are_warned_of(value: float, stderr: float, warned: bool) -> None:
    """Dark places may have larger errors than light; the brightest have not, unless columns are exchanged."""
    z = np.linspace(2, 8, 30)
    light = np.where(np.arange(30) % 3, 1e-6, value / z**2)
    table = Readings.from_arrays(z_m=z, value=light, stderr=np.full(30, stderr))
    assert any(w.code is Remarks.LARGE_ERRORS for w in table.warnings) is warned


def decibels(values) -> Readings:
    table = Readings.from_arrays(z_m=np.arange(1.0, 1.0 + len(values)), value=values)
    return table.check_against(scene(tank=None))


@pytest.mark.parametrize("values", [[-10.0, -15.5, -30.0], [3.0, -4.0, -12.0], [-1e-3, -2e-3]])
def test_negative_light_is_refused_with_what_to_do(values):
    with pytest.raises(
        MeasurementError, match=r"negative.*dark signal was subtracted once.*10\^\(value / 10\)"
    ):
        decibels(values)


def test_decibels_are_told_by_their_unit_too():
    for unit in ("dB", "dBm", "dB re 1 uW"):
        with pytest.raises(MeasurementError, match="decibels"):
            readings(units=unit).check_against(scene())


def test_noise_below_zero_and_one_slip_are_readings():
    assert len(decibels([1.0, 0.5, -0.01, -0.02])) == 4
    assert len(decibels([1.0, 0.9, 0.8, 0.7, -3.0])) == 5


def test_another_quantity_is_refused():
    with pytest.raises(MeasurementError, match="another quantity"):
        readings(quantity="radiance").check_against(scene())


def test_with_several_bands_each_reading_must_say_its_own():
    bands = ((500, 550), (600, 620))
    assert readings(wavelength_nm=[525, 610]).check_against(scene(bands=bands)).wavelength_nm.tolist() == [
        525,
        610,
    ]
    with pytest.raises(MeasurementError, match="reading 2: no wavelength"):
        readings(wavelength_nm=[525, np.nan]).check_against(scene(bands=bands))


def test_problems_of_file_and_scene_come_together_with_lines(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("z_m,value,x_m\n1,2,0\n1.5,nan,0\n2,2,7\n")
    with pytest.raises(MeasurementError) as caught:
        read_table(path, scene())
    assert [one.lines for one in caught.value.problems] == [(3,), (4,)]


# --- blindness


def good(**changes) -> Readings:
    """Five planes, both sides, random order, repeats, two exposures, errors, a budget: nothing to warn of."""
    z, x = (a.ravel() for a in np.meshgrid([4.5, 5.5, 6.5, 7.5, 8.5], [-0.4, 0.0, 0.4], indexing="ij"))
    z, x = np.r_[z, 4.5, 4.5], np.r_[x, 0.0, 0.0]
    order = np.random.default_rng(1).permutation(len(z))
    given = {
        "z_m": z,
        "x_m": x,
        "value": 1 / z**2,
        "stderr": 0.001,
        "time_s": 20.0 * order,
        "integration_time_s": np.where(z > 6, 0.2, 0.1),
        "plane_gain_percent": 0.2,
        "position_mm": 1.0,
    }
    return Readings.from_arrays(**{**given, **changes})


def codes(table: Readings) -> set[str]:
    return {warning.code for warning in table.warnings}


def test_a_good_layout_has_no_warning():
    assert codes(good()) == set()


def test_each_blindness_is_told_alone_and_with_its_remedy():
    n = len(good())
    cases = {
        "scan_order": {"time_s": np.argsort(np.argsort(good().z_m, kind="stable")) * 20.0},
        "x_one_side": {"x_m": np.abs(good().x_m) + np.arange(n) * 0.0, "repeat": np.arange(n)},
        "on_axis_only": {"x_m": 0.0},
        "constant_integration_time": {"integration_time_s": 0.1},
        "no_stderr": {"stderr": np.nan},
        "no_error_budget": {"position_mm": None},
        "no_time": {"time_s": np.nan, "repeat": np.arange(n)},
        "few_planes": {"z_m": np.where(good().z_m > 6, 8.5, good().z_m)},
        "saturated": {"saturated": np.arange(n) == 3},
        "tiny_errors": {"stderr": 9e-6 * good().value},
        "exact_zeros": {"value": np.where(np.arange(n) < 3, 0.0, good().value)},
    }
    for code, changes in cases.items():
        table = good(**changes)
        assert codes(table) == {code}, code
        assert table.warnings[0].sentence and table.warnings[0].remedy


def test_falling_planes_are_plane_order_too_and_coming_back_is_not():
    z = good().z_m
    falling = np.argsort(np.argsort(-z, kind="stable"), kind="stable") * 20.0
    assert codes(good(time_s=falling)) == {"scan_order"}
    falling[np.flatnonzero(z == 8.5)[0]] = 1e4
    assert codes(good(time_s=falling)) == set()


def test_unknown_exposures_count_as_constant():
    assert codes(good(integration_time_s=np.nan)) == {"constant_integration_time"}


def test_no_repeats():
    table = good().subset(np.arange(15))
    assert codes(table) == {"no_repeats"}


def test_two_wavelengths_at_one_place_are_no_repeat():
    z, w = [1, 2, 3, 4, 1, 2, 3, 4], [500] * 4 + [600] * 4
    assert "no_repeats" in codes(Readings.from_arrays(z_m=z, value=1.0 / np.array(z), wavelength_nm=w))


def test_a_subset_forgets_warnings_that_no_longer_hold():
    table = good(saturated=np.arange(17) == 3)
    assert codes(table.usable()) == set() and len(table.usable()) == 16


# --- units


@pytest.mark.parametrize(
    ("text", "factor"),
    [
        ("W m^-2 nm^-1", 1.0),
        ("uW/cm^2/nm", 1e-2),  # 1e-6 W / 1e-4 m^2
        ("µW cm⁻² nm⁻¹", 1e-2),
        ("mW m-2 nm-1", 1e-3),
        ("W/m2/um", 1e-3),
        ("W/(m^2 nm)", 1.0),
    ],
)
def test_units_of_irradiance(text, factor):
    from lightfield.readings.units import to_si

    assert to_si(text, "irradiance") == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize("text", ["W m^-2", "W m^-2 sr^-1 nm^-1", "lx", "m", "counts", "W m^-3 nm^-1", ""])
def test_what_is_no_spectral_irradiance(text):
    from lightfield.readings.units import to_si

    with pytest.raises(ValueError):
        to_si(text, "irradiance")


# --- readings from an independent simulator, where they are at hand


def test_independent_readings_load_and_fit_their_scenes(reference):
    from lightfield.scene import Scene

    folders = sorted((reference / "hidden_effects").glob("*/data.csv"))
    if not folders:
        pytest.skip(f"no hidden_effects cases at {reference}")
    for path in folders:
        table = read_table(path, Scene.load(path.parent / "scene.toml"))
        rows = [line for line in path.read_text().splitlines() if line and not line.startswith("#")]
        assert len(table) == len(rows) - 1
        last = dict(zip(rows[0].split(","), rows[-1].split(","), strict=True))
        for name in ("x_m", "z_m", "value", "stderr", "time_s"):
            assert getattr(table, name)[-1] == float(last[name])


def test_readings_of_a_band_are_written_as_such(tmp_path: Path) -> None:
    """The middle of the band, where they are put, is none of their wavelengths."""
    first, again = tmp_path / "first.csv", tmp_path / "again.csv"
    head = '# quantity = "irradiance"\n# scale = "absolute"\n# units = "W m^-2 nm^-1"\n'
    first.write_text(head + "z_m,value\n5,1\n6,0.7\n", encoding="utf-8")
    readings = read_table(first, Scene())
    assert readings.of_band and np.isfinite(readings.wavelength_nm).all()
    write_table(readings, again)
    assert "wavelength_nm" not in again.read_text(encoding="utf-8")
    assert read_table(again, Scene()).of_band


def test_a_layout_without_a_place_is_refused(tmp_path: Path) -> None:
    """In a scene, too, in whose every band its places would be read."""
    path = tmp_path / "layout.csv"
    path.write_text("z_m,x_m\n", encoding="utf-8")
    with pytest.raises(MeasurementError, match="no reading"):
        read_table(path, Scene(), LAYOUT)
