"""What a scene says about the follower: detectors, place, task. Nothing of it changes the light."""

from __future__ import annotations

from math import hypot
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from lightfield.errors import RuleError
from lightfield.scene.acts import Acts
from lightfield.scene.parameters import Part, TablePath, declare, number
from lightfield.storage.tables import read_rows, readable

#: Neither array nor follower acts on the light or on the scene's own detectors.
_NOTHING = Acts(0)
#: More would take minutes and gigabytes, and tell no more (Eren 2015: nothing gained beyond 7 x 7).
_MOST_ELEMENTS = 2500
#: Farther out is no vehicle's array (chosen: as far as a grid may reach).
_MOST_REACH_M = 10.0
COLUMNS = ("x_m", "y_m", "z_m", "nx", "ny", "nz")
WAY_COLUMNS = ("time_s", "x_m", "y_m", "z_m")
Count = Annotated[int, Field(strict=True, ge=1, le=1000)]


class DetectorArray(Part):
    """Cosine receivers on the follower, looking along its axis; flat, on a sphere, or one by one."""

    layout: Literal["grid", "ring", "hemisphere", "table"] = declare(
        "grid", "rows and columns, rings, spread evenly over a half sphere, or a table", _NOTHING
    )
    table: TablePath | None = declare(None, f"CSV of layout table: {', '.join(COLUMNS)}", _NOTHING)
    count: tuple[Count, Count] = declare(
        (5, 5),
        "of a grid columns and rows, of rings elements and rings; a hemisphere has the product",
        _NOTHING,
    )
    size_m: float = number(
        0.6, "m", "from the first to the last element of a row, diameter of a ring",
        _NOTHING, above=0.0, high=10.0,
    )  # fmt: skip
    radius_m: float = number(
        0.0, "m", "of the sphere that the elements lie on; 0: they lie flat", _NOTHING, low=0.0, high=100.0,
        neutral=0.0,
    )  # fmt: skip
    element_area_mm2: float = number(13.0, "mm2", "light-sensitive area", _NOTHING, above=0.0, high=1e6)
    responsivity_a_per_w: float = number(0.25, "A/W", "current per light", _NOTHING, above=0.0, high=10.0)
    gain: float = number(
        1.0, "reading m2", "reading per irradiance over the lamp's intensity on its axis", _NOTHING, above=0.0
    )
    noise_percent: float = number(
        1.0, "%", "noise of every reading, of the brightest element's",
        _NOTHING, low=0.0, high=100.0, neutral=0.0,
    )  # fmt: skip
    gain_mismatch_percent: float = number(
        0.8, "%", "scatter of the elements' gains", _NOTHING, low=0.0, high=100.0, neutral=0.0
    )
    gain_drift_percent: float = number(
        5.0, "%", "how well the gain common to all elements, or the lamp's power, is known; 0: exactly",
        _NOTHING, low=0.0, high=1e6, neutral=0.0,
    )  # fmt: skip
    read_noise_a_per_sqrt_hz: float = number(
        5e-12, "A/Hz^0.5", "noise of the amplifier", _NOTHING, low=0.0, high=1.0, neutral=0.0
    )
    dark_current_a: float = number(
        2e-9, "A", "without light; its shot noise counts", _NOTHING, low=0.0, high=1.0, neutral=0.0
    )
    adc_bits: int = number(
        10, "1", "of a converter that the brightest element fills; 0: exact",
        _NOTHING, low=0, high=32, neutral=0,
    )  # fmt: skip
    sample_hz: float = number(
        10.0, "Hz", "readings of the whole array a second", _NOTHING, above=0.0, high=1e6
    )

    @model_validator(mode="after")
    def _can_be_built(self) -> DetectorArray:
        if self.layout == "table" and self.table is None:
            raise RuleError("layout table needs a table", f"give table = a CSV of {', '.join(COLUMNS)}")
        if self.layout == "table" and self.table is not None:
            readable(read_rows, self.table, COLUMNS)
            *places, nx, ny, nz = read_rows(self.table, COLUMNS)
            if len(nx) > _MOST_ELEMENTS:
                elements = {f"elements in {self.table}": len(nx)}
                raise RuleError(f"at most {_MOST_ELEMENTS} elements", "leave some out", found=elements)
            farthest = max(float(abs(v).max()) for v in places)
            if farthest > _MOST_REACH_M:
                raise RuleError(
                    f"elements within {_MOST_REACH_M:g} m of the follower",
                    "places in metres, not in millimetres",
                    found={f"farthest in {self.table}, m": farthest},
                )  # fmt: skip
            if not (nx**2 + ny**2 + nz**2 > 0).all():
                raise RuleError("no normal of length zero", "say where every element faces", found=self.table)
            if not (nz < 0).any():
                raise RuleError(
                    "some element faces forward: nz < 0", "turn the normals outward, away from the follower",
                    found={f"smallest nz in {self.table}": float(nz.min())},
                )  # fmt: skip
        if self.layout == "hemisphere" and not self.radius_m:
            raise RuleError("a hemisphere needs a radius", "give radius_m")
        if self.count[0] * self.count[1] > _MOST_ELEMENTS:
            raise RuleError(
                f"at most {_MOST_ELEMENTS} elements", "a smaller count", found={"count": [*self.count]}
            )
        steps = max(self.count) - 1
        diagonal = hypot(self.count[0] - 1, self.count[1] - 1) / steps if steps else 0.0
        reach = 0.5 * self.size_m * (diagonal if self.layout == "grid" else 1.0)
        if self.layout in ("grid", "ring") and self.radius_m and reach >= self.radius_m:
            raise RuleError(
                f"an array reaches less far from its middle ({reach:.4g} m) than the sphere that it lies on",
                "a larger radius, or a smaller size",
                found={"size_m": self.size_m, "radius_m": self.radius_m},
            )
        return self


#: Nearest to the lamp that a distance is kept, m.
LEAST_STANDOFF_M = 1.0


class Mission(Part):
    """A run: what the follower should do and believes, and how leader, water and lamp change."""

    task: Literal["follow", "dock"] = declare("follow", "keep a distance, or come home to the lamp", _NOTHING)
    believes: Literal["field", "fitted", "exact", "clear", "relative"] = declare(
        "field",
        "light that the follower believes in: the traced field of the scene; or the formula, with K and gain "
        "fitted in this water, with the true c and lamp power, with K and gain from clear water, or with K "
        "fitted and only relative readings. In the field it learns gain and water on its way, as far "
        "as they are not known; by the formula it takes every reading by itself",
        _NOTHING,
    )
    law: Literal["pid", "sliding", "lqr"] = declare("pid", "of control", _NOTHING)
    vehicle: Literal["bluerov2-heavy", "bluerov2-benchmark"] = declare(
        "bluerov2-heavy", "parameters of Oregon State University, or of von Benzon et al. 2022", _NOTHING
    )
    degrees_of_freedom: Literal[4, 6] = declare(6, "4: roll and pitch are held at zero", _NOTHING)
    duration_s: float = number(120.0, "s", "of a run", _NOTHING, above=0.0, high=3600.0)
    standoff_m: float = number(
        6.5, "m", "distance to keep, along the beam", _NOTHING, low=LEAST_STANDOFF_M, high=1e3
    )
    dock_m: float = number(
        1.5, "m", "distance of the dock from the lamp, along the beam", _NOTHING, low=0.5, high=1e3
    )
    approach_m_per_s: float = number(
        0.08, "m/s", "speed of the way home, while it is straight ahead", _NOTHING, above=0.0, high=2.0
    )
    leader: Literal["still", "sway", "lawnmower", "table"] = declare(
        "sway", "how the leader moves, its lamp always ahead", _NOTHING
    )
    leader_table: TablePath | None = declare(None, f"CSV of leader table: {', '.join(WAY_COLUMNS)}", _NOTHING)
    current_x_m_per_s: float = number(
        0.0, "m/s", "of the water, across", _NOTHING, low=-2.0, high=2.0, neutral=0.0
    )
    current_y_m_per_s: float = number(0.0, "m/s", "upwards", _NOTHING, low=-2.0, high=2.0, neutral=0.0)
    current_z_m_per_s: float = number(
        0.0, "m/s", "away from the leader", _NOTHING, low=-2.0, high=2.0, neutral=0.0
    )
    current_from_s: float = number(0.0, "s", "when it sets in", _NOTHING, low=0.0, high=3600.0)
    dark_from_s: float = number(60.0, "s", "when the lamp goes dark", _NOTHING, low=0.0, high=3600.0)
    dark_for_s: float = number(0.0, "s", "how long it is dark", _NOTHING, low=0.0, high=3600.0, neutral=0.0)
    turbid_factor: float = number(
        1.0, "1", "scattering at the end, over that of the scene", _NOTHING, low=0.0, high=100.0, neutral=1.0
    )
    turbid_from_s: float = number(
        40.0, "s", "when the water begins to change", _NOTHING, low=0.0, high=3600.0
    )
    turbid_for_s: float = number(20.0, "s", "how long it changes", _NOTHING, above=0.0, high=3600.0)

    @model_validator(mode="after")
    def _can_be_done(self) -> Mission:
        if self.leader == "table" and self.leader_table is None:
            raise RuleError(
                "leader table needs a table", f"give leader_table = a CSV of {', '.join(WAY_COLUMNS)}"
            )
        if self.leader_table is not None:
            readable(read_rows, self.leader_table, WAY_COLUMNS)
            time, *_ = read_rows(self.leader_table, WAY_COLUMNS)
            if not (np.diff(time) > 0).all():
                raise RuleError("times rise", "sort the rows by time_s", found=self.leader_table)
        if self.task == "dock" and self.dock_m >= self.standoff_m:
            raise RuleError(
                "dock_m is less than standoff_m", "begin the way home farther from the lamp than the dock",
                found={"dock_m": self.dock_m, "standoff_m": self.standoff_m},
            )  # fmt: skip
        return self


class Follower(Part):
    """Pose of the array's middle, and what the follower knows of the water and the lamp.

    Lamp at the origin, z along the tank's axis, x horizontal, y up. At rest the array looks along -z; yaw
    turns it towards +x, pitch lifts it, roll leans it to +x; in this order, about its own axes.
    """

    x_m: float = number(0.0, "m", "across, horizontally", _NOTHING, low=-1e4, high=1e4, neutral=0.0)
    y_m: float = number(0.0, "m", "across, upwards", _NOTHING, low=-1e4, high=1e4, neutral=0.0)
    z_m: float = number(6.5, "m", "along the beam", _NOTHING, above=0.0, high=1e4)
    yaw_deg: float = number(0.0, "deg", "turned towards +x", _NOTHING, low=-180.0, high=180.0, neutral=0.0)
    pitch_deg: float = number(0.0, "deg", "looking up", _NOTHING, low=-90.0, high=90.0, neutral=0.0)
    roll_deg: float = number(0.0, "deg", "leaning to +x", _NOTHING, low=-180.0, high=180.0, neutral=0.0)
    water_known_percent: float = number(
        20.0, "%", "how well it knows absorption and scattering; 0: exactly",
        _NOTHING, low=0.0, high=1e6, neutral=0.0,
    )  # fmt: skip
    lamp_tilt_known_deg: float = number(
        0.0, "deg", "how well it knows where the lamp points; 0: exactly",
        _NOTHING, low=0.0, high=90.0, neutral=0.0,
    )  # fmt: skip
    mission: Mission = Field(default_factory=Mission, description="what it does")
