"""Local unknowns: a dip across the beam, a plume, a step, a dip or a ripple in time, a cloud that passes,
ripples over angles, a beam with four corners, a gain that steps with the reading; few numbers each.

What no named effect explains may be one of these: they say where it is, how wide and how large, not what.
They are effects of the user's own, ready to be tested, renamed and made better. The shadow of a strut that
moves with the detector is a dip, that of one which stands in the tank, and of bubbles that rise, a plume; of
bubbles that come and go, a cloud.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from lightfield.arrays import Array
from lightfield.readings import Readings
from lightfield.readings.columns import LINE_DECIMALS
from lightfield.scene import Scene
from lightfield.scene.lamp.frame import angle_from_axis
from lightfield.scene.own.own_effect import OwnEffect, OwnParameter, Stage

FAMILY = "local unknown"
#: What shades what passes through it, told where that is read at the farthest distance.
PLUME, CLOUD = "plume", "passing_cloud"
#: What makes a beam another one in every direction about its axis.
SQUARE = "square_beam"
#: At half the angle that is read farthest out its corners are brighter than a round beam by e to so much at
#: most, and that grows with such a power of the angle. Chosen: of exp(-ln2 (|x|^p + |y|^p) / hwhm^p), read to
#: three half widths, it is 0.9 for p = 4 and 3.0 for p = 6. By no more than e^13: all that a formula may.
_CORNERS, _POWERS, _BRIGHTEST = 6.0, (1.0, 8.0), 13
#: A square has so many sides. Derived.
_SIDES = 4
#: Turned by an eighth a square's sides are its corners: a cosine of four times the direction is known where
#: it varies by so much. Chosen: half of all it can.
_TURNS_SHOWN = 1.0
#: Added to a squared distance from the axis, m^2, where its direction is asked. Derived: far below a reading.
_ON_AXIS = "1e-12"
#: Where a gain steps readings change from one to the other within this part of the level: sudden, and with a
#: slope for a fit. So many readings at least are below and above. Chosen.
_EDGE_OF_GAIN, _FEWEST_OF_GAIN = 0.03, 5
#: Half widths from that of a rod of 1 cm to a quarter of a scan; times as parts of it; periods from two
#: readings to the whole range of angles. Chosen: between ranges from 2 cm on, depths of 0.9 at most, and the
#: shadow of a bar of 2.4 cm scattering stood in for the rest of it, for sure.
_NARROWEST_M, _WIDEST_PART = 0.005, 0.25
#: Largest part of the light that is taken, largest that is added, and typical; largest that swings. Derived:
#: all of it; chosen: half of it between top and bottom.
_TAKEN, _ADDED, _TYPICAL, _SWING = 1.0, 0.9, 0.05, 0.4
#: Beyond a plume light is dimmed within so many metres: less than two planes are apart. Chosen.
_EDGE_M = 0.1
#: What their amplitudes are called, 0 where there is nothing (test_shadows.py).
AMPLITUDES = ("depth", "size", "a", "b")
#: What stands before the first plane shades the same rays at all of them, wherever it stands. Derived: so
#: many edges before it a plume is whole, to a per cent.
_BEFORE = 3.0
#: A ripple over the angle has so many periods within the readings at most, and so many angles that differ in
#: a period. Chosen: a scan of forty points; derived: through fewer angles slower ripples go as well.
_RIPPLES, _ANGLES_IN_A_PERIOD = 20, 2
#: Decimals in degrees to which angles are the same: of a ray that was read at several distances. Chosen.
_ANGLE_DECIMALS = 3
#: What takes so little of the time between two readings is sudden: shorter times are all alike. Chosen.
_SUDDEN = 0.02
#: A ripple in time has so many readings in a period, and so many periods, at least; and no more than these.
#: Chosen: what is slower is a drift.
_IN_A_PERIOD, _FEWEST_PERIODS, _MOST_PERIODS = 3.0, 2.0, 100.0


def local_unknowns(readings: Readings) -> tuple[OwnEffect, ...]:
    """Those of which readings may tell, in ranges that are theirs."""
    return tuple(_found(readings))


def _found(readings: Readings) -> Iterator[OwnEffect]:
    for axis in ("x", "y"):
        at = np.asarray(getattr(readings, f"{axis}_m"), float)
        if (span := float(np.ptp(at))) > 2 * _NARROWEST_M / _WIDEST_PART:
            yield OwnEffect(
                name=f"dip_in_{axis}",
                family=FAMILY,
                stage="path",
                formula=f"1 - depth*exp(-(({axis} - {axis}0)/width)**2)",
                parameters={
                    "depth": _depth(),
                    f"{axis}0": _within("m", at, "its middle"),
                    "width": _between("m", _NARROWEST_M, _WIDEST_PART * span, "its half width at 1/e"),
                },
                physics=f"Something at one {axis} dims (or brightens) the light that comes straight.",
                laboratory=f"Look along the beam for what stands at this {axis}; move the stage, read again.",
            )
    time = np.asarray(readings.time_s, float)
    if np.isfinite(time).all() and (span := float(np.ptp(time))) > 0:
        least = _SUDDEN * span / len(time)
        yield OwnEffect(
            name="step_in_time",
            family=FAMILY,
            stage="source",
            formula="1 + size*(1 + tanh((time - time0)/duration))/2",
            parameters={
                "size": _part(-_TAKEN, _ADDED),
                "time0": _within("s", time, "when"),
                "duration": _between("s", least, _WIDEST_PART * span, "how long it takes"),
            },
            physics="All light changes from one level to another while the scan runs.",
            laboratory="Repeat a reference position every few minutes; ask what was switched then.",
        )
        yield OwnEffect(
            name="dip_in_time",
            family=FAMILY,
            stage="source",
            formula="1 - depth*exp(-((time - time0)/duration)**2)",
            parameters=_for_a_while(time),
            physics="For a while all light is dimmer (or brighter): a bubble on a window, fish that pass.",
            laboratory="Read those places again; watch the window of lamp and receiver.",
        )
        if periods_s := ripple_periods_s(time):
            yield _ripple(
                "ripple_in_time", "source", "time", "s", periods_s,
                physics="The lamp's power, and all light with it, swings: a supply or a thermostat.",
                laboratory="Watch one receiver that stands still for some minutes, or the lamp's voltage.",
            )  # fmt: skip
    if (planes := np.unique(np.round(readings.z_m, LINE_DECIMALS))).size > 2:
        near, far = float(planes[0]) - _BEFORE * _EDGE_M, float(planes[-2])
        if np.isfinite(time).all() and float(np.ptp(time)) > 0:
            yield OwnEffect(
                name=CLOUD,
                family=FAMILY,
                stage="receiver",
                formula=f"1 - depth*exp(-((time - time0)/duration)**2)*(1 + tanh((z - z0)/{_EDGE_M:g}))/2",
                parameters={
                    **_for_a_while(time),
                    "z0": OwnParameter(
                        unit="m",
                        range=(float(planes[0]), far),
                        meaning="its distance: nearer is light as ever",
                    ),
                },
                physics="For a while something in the water dims all light that is read beyond it.",
                laboratory="Read those places again; look into the water between planes for what drifts.",
            )
        x = np.asarray(readings.x_m, float)
        if (span := float(np.ptp(x))) > 2 * _NARROWEST_M / _WIDEST_PART:
            yield OwnEffect(
                name=PLUME,
                family=FAMILY,
                stage="path",
                formula=f"1 - depth*exp(-((x*z0/z - x0)/width)**2)*(1 + tanh((z - z0)/{_EDGE_M:g}))/2",
                parameters={
                    "depth": _depth(),
                    "x0": _within("m", 0.5 * x, "its middle, where it rises"),
                    "z0": OwnParameter(
                        unit="m", range=(near, far), meaning="its distance, or before all readings"
                    ),
                    "width": _between("m", _NARROWEST_M, _WIDEST_PART * span, "its half width at 1/e"),
                },
                physics="Something rises at one distance and dims what passes through it: the rays beyond.",
                laboratory="Look down into the tank at that distance; read again when it is gone. One that "
                "stands before all readings may be dirt on the lamp's window: wipe it.",
            )
    if levels := _levels(readings):
        yield OwnEffect(
            name="gain_step",
            family=FAMILY,
            stage="readout",
            formula=f"signal*(1 + size*(1 + tanh((level - signal)/({_EDGE_OF_GAIN:g}*level)))/2)",
            parameters={
                "size": _part(-_SWING, _SWING),
                "level": OwnParameter(range=levels, meaning="below it, over the largest reading"),
            },
            physics="Dim readings have another gain than bright ones: the detector changes its range.",
            laboratory="Read one place in both ranges, or with a known grey filter at the brightest.",
        )
    theta = np.degrees(angle_from_axis(readings.x_m, readings.y_m, readings.z_m))
    if shows_corners(readings.x_m, readings.y_m):
        yield _square(0.5 * float(theta.max()))
    if periods_deg := _ripple_periods_deg(theta):
        yield _ripple(
            "ripple_over_angle", "source", "theta", "deg", periods_deg,
            physics="Rings of the lamp's optics: its intensity ripples over the angle from its axis.",
            laboratory="Measure the lamp in air at one range with a fine angular step.",
        )  # fmt: skip
        yield _ripple(
            "ripple_at_receiver", "receiver", "(180/pi)*atan(sqrt(x**2 + y**2)/z)", "deg", periods_deg,
            physics="Interference in the receiver's window: what is read ripples over the angle of arrival.",
            laboratory="Turn the receiver by some degrees, read again at one place: the ripple turns too.",
        )  # fmt: skip


#: Along what each of them is drawn.
ALONG = {
    "dip_in_x": "x", "dip_in_y": "y", PLUME: "x", "step_in_time": "time",
    "dip_in_time": "time", CLOUD: "time", "ripple_over_angle": "angle",
    "ripple_at_receiver": "angle", "ripple_in_time": "time", "gain_step": "signal", SQUARE: "azimuth",
}  # fmt: skip


def _levels(readings: Readings) -> tuple[float, float] | None:
    """Lowest and highest level at which a gain may step, over the largest reading; None: too few readings."""
    value = np.sort(np.asarray(readings.value, float)[~np.asarray(readings.saturated, bool)])
    if len(value) <= 2 * _FEWEST_OF_GAIN or value[-1] <= 0:
        return None
    low, high = value[_FEWEST_OF_GAIN] / value[-1], value[-_FEWEST_OF_GAIN] / value[-1]
    return (float(low), float(high)) if 0 < low < high else None


def shows_corners(x_m: Array, y_m: Array) -> bool:
    """Are there readings in directions about the axis that are alike in no square?"""
    off = np.hypot(x_m, y_m) > _NARROWEST_M
    four = turns_of_a_square(x_m[off], y_m[off])
    return bool(off.any() and max(np.ptp(np.cos(four)), np.ptp(np.sin(four))) > _TURNS_SHOWN)


def turns_of_a_square(x_m: Array, y_m: Array) -> Array:
    """Direction about the axis, rad, so often that a square is the same again after 2 pi, shape (n,)."""
    return np.asarray(_SIDES * np.arctan2(y_m, x_m))


def _square(halfway_deg: float) -> OwnEffect:
    """A beam with four corners, about the tank's axis: which depart the more, the farther out."""
    square = f"(x**2 + y**2 + {_ON_AXIS})**2"
    corners, turned = f"(8*(x*y)**2/{square} - 1)", f"4*x*y*(x**2 - y**2)/{square}"
    return OwnEffect(
        name=SQUARE,
        family=FAMILY,
        stage="path",
        formula=f"exp(min((a*{corners} + b*{turned})*(theta/{halfway_deg:.4g})**power, {_BRIGHTEST}))",
        parameters={
            "a": _part(-_CORNERS, _CORNERS),
            "b": _part(-_CORNERS, _CORNERS),
            "power": OwnParameter(range=_POWERS, meaning="of the angle, with which the corners grow"),
        },
        physics="The lamp lights a square, as some LED modules and projectors do, or has four lobes.",
        laboratory="Look at its spot on a white wall; turn the lamp by 45 degrees and read again.",
    )


def ripple_periods_s(time_s: Array) -> tuple[float, float] | None:
    """Shortest and longest period of a ripple that readings at these times show, s; None: none."""
    span = float(np.ptp(time_s)) if np.isfinite(time_s).all() else 0.0
    most = min(len(np.unique(time_s)) / _IN_A_PERIOD, _MOST_PERIODS)
    return (span / most, span / _FEWEST_PERIODS) if span > 0 and most > _FEWEST_PERIODS else None


def _ripple_periods_deg(theta: Array) -> tuple[float, float] | None:
    """Shortest and longest period of a ripple over the angle that readings show; None: none."""
    widest, angles = float(theta.max()), len(np.unique(np.round(theta, _ANGLE_DECIMALS)))
    most = min(angles / _ANGLES_IN_A_PERIOD, _RIPPLES)
    return (widest / most, widest) if widest > 0 and most > 1 else None


def _ripple(
    name: str,
    stage: Stage,
    along: str,
    unit: str,
    periods: tuple[float, float],
    physics: str,
    laboratory: str,
) -> OwnEffect:
    return OwnEffect(
        name=name,
        family=FAMILY,
        stage=stage,
        formula=f"1 + a*cos(2*pi*{along}/period) + b*sin(2*pi*{along}/period)",
        parameters={
            "a": _part(-_SWING, _SWING),
            "b": _part(-_SWING, _SWING),
            "period": _between(unit, *periods, "of the ripple"),
        },
        physics=physics,
        laboratory=laboratory,
    )


def _for_a_while(time_s: Array) -> dict[str, OwnParameter]:
    """Depth, middle and duration of a dip in time."""
    span = float(np.ptp(time_s))
    duration = _between("s", span / len(time_s), _WIDEST_PART * span, "its half width at 1/e")
    return {"depth": _depth(), "time0": _within("s", time_s, "its middle"), "duration": duration}


def _part(least: float, most: float) -> OwnParameter:
    return OwnParameter(range=(least, most), neutral=0.0, typical=_TYPICAL)


def _depth() -> OwnParameter:
    return _part(-_ADDED, _TAKEN)


def _within(unit: str, at: Array, meaning: str) -> OwnParameter:
    return OwnParameter(unit=unit, range=(float(at.min()), float(at.max())), meaning=meaning)


def _between(unit: str, low: float, high: float, meaning: str) -> OwnParameter:
    return OwnParameter(unit=unit, range=(low, high), meaning=meaning)


def as_file(unknowns: Iterable[OwnEffect]) -> str:
    """Effects of the user's own as the text of a file of effects."""
    return Scene(effect=tuple(unknowns)).to_toml()
