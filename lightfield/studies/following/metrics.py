"""How well a run went, in numbers: one row for every run, and their mean with its error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.scene.follower import Mission
from lightfield.studies.follower.survey import DOCKING
from lightfield.studies.following.loop import CONE, Track
from lightfield.wording import with_error

#: Part of a run after which it counts as settled (chosen; a third, as the leader then has turned once).
_SETTLED = 1 / 3
#: Length of the end of a run, s.
_END_S = 10.0
#: A vehicle has found back where it is this near to where it should be, m: across, and along the beam (what
#: docking asks for).
_BACK_M = np.array([DOCKING["x"], DOCKING["z"]])
#: Name, unit and meaning of every metric.
METRICS: dict[str, tuple[str, str]] = {
    "standoff": ("m", "distance from the lamp along the beam, after the first third"),
    "standoff_at_end": ("m", f"the same in the last {_END_S:g} s"),
    "standoff_rms": ("m", "root mean square of distance kept less distance asked for, after the first third"),
    "across_rms": ("m", "root mean square of the distance from the axis, after the first third"),
    "yaw_rms": ("deg", "root mean square of the turn away from the lamp, after the first third"),
    "belief_less_truth": ("m", "distance believed less true distance, mean after the first third"),
    "belief_scatter": ("m", "scatter of that from reading to reading"),
    "overshoot": (
        "m",
        "farthest beyond the distance asked for in the first third; on either side where it begins there",
    ),
    "nearest": ("m", "least distance from the lamp"),
    "effort": ("N", "root mean square of the horizontal thrust, after the first third"),
    "without_light": ("s", "time in which no element saw light"),
    "lost": (
        "1",
        "lost its way: after the first third behind the lamp or turned from it by over 90 degrees, or at the "
        "end without light; the other numbers are those of runs that kept theirs",
    ),
    "doubtful": ("%", "readings that do not fit the light that is believed in, three in a row"),
    "outside": ("s", "time outside the space in which the light is known: numbers of such a run mean little"),
    "back_after": ("s", "from the return of the light until it is in its place again"),
    "docked": (
        "1",
        f"within {CONE[0]:g} m, {np.degrees(CONE[1]):g} degrees and {CONE[2]:g} m/s at the dock's mouth",
    ),
    "contact_time": ("s", "when it came to the dock's mouth"),
    "contact_across": ("m", "distance from the dock's axis there"),
    "contact_yaw": ("deg", "turn there"),
    "contact_speed": ("m/s", "speed there"),
}
OF_FOLLOWING = (
    "standoff", "standoff_at_end", "standoff_rms", "across_rms", "yaw_rms", "belief_less_truth",
    "belief_scatter", "overshoot", "nearest", "effort", "lost", "back_after",
)  # fmt: skip
OF_DOCKING = ("docked", "contact_time", "contact_across", "contact_yaw", "contact_speed")
#: Metrics that are 0 or 1 in a run, which are counted.
COUNTED = ("docked", "lost")


@dataclass(frozen=True)
class OverRuns:
    """A metric over several runs.

    Parameters
    ----------
    mean : float
        NaN where no run has it.
    scatter : float
        Standard deviation from run to run; NaN of a single one.
    error : float
        Standard error of the mean.
    runs : int
        Those that have it.
    """

    mean: float
    scatter: float
    error: float
    runs: int

    def __str__(self) -> str:
        """Mean ± scatter, to two digits of the scatter."""
        return with_error(self.mean, self.scatter)

    @classmethod
    def of(cls, values: Array) -> OverRuns:
        known = values[np.isfinite(values)]
        if not len(known):
            return cls(np.nan, np.nan, np.nan, 0)
        scatter = float(known.std(ddof=1)) if len(known) > 1 else np.nan
        return cls(float(known.mean()), scatter, scatter / np.sqrt(len(known)), len(known))


def spreads_of(runs: dict[str, Array]) -> dict[str, OverRuns]:
    """Every metric over the runs that kept their way, and over all how many lost it.

    Parameters
    ----------
    runs : dict of str to array, shape (runs,)
        See `metrics_of`.
    """
    lost = runs.get("lost")
    if lost is None:
        return {name: OverRuns.of(values) for name, values in runs.items()}
    return {name: OverRuns.of(v if name == "lost" else v[lost == 0]) for name, v in runs.items()}


def metrics_of(track: Track, mission: Mission) -> dict[str, Array]:
    """Every metric that a task has, shape (runs,) each."""
    time, pose = track.time_s, track.pose
    step = float(time[1] - time[0]) if len(time) > 1 else 0.0
    late, end = _late_and_end(track)
    z, across = pose[..., 2], np.hypot(pose[..., 0], pose[..., 1])
    missed = track.estimate[..., 2] - z
    beyond = _overshoot((z - track.goal_m)[~late])
    found = {
        "without_light": step * (~track.lit).sum(axis=0),
        "doubtful": 100 * track.doubtful.mean(axis=0),
        "outside": step * (~track.inside).sum(axis=0),
    }
    if mission.task == "follow":
        found = {
            "standoff": z[late].mean(axis=0),
            "standoff_at_end": z[end].mean(axis=0),
            "standoff_rms": _rms((z - track.goal_m)[late]),
            "across_rms": _rms(across[late]),
            "yaw_rms": np.degrees(_rms(pose[late, :, 3])),
            "belief_less_truth": missed[late].mean(axis=0),
            "belief_scatter": missed[late].std(axis=0),
            "overshoot": beyond,
            "nearest": np.linalg.norm(pose[..., :3], axis=-1).min(axis=0),
            "effort": _rms(np.hypot(track.force[late, :, 0], track.force[late, :, 1])),
            **found,
            "lost": _lost(track, mission).astype(float),
        }
    if mission.dark_for_s > 0 and mission.task == "follow":
        found["back_after"] = _back_after(track, mission.dark_from_s + mission.dark_for_s)
    if mission.task == "dock":
        when, aside, yaw, speed = track.contact.T
        # A vehicle that never came to the dock has not docked.
        with np.errstate(invalid="ignore"):
            well = (aside <= CONE[0]) & (yaw <= CONE[1]) & (speed <= CONE[2])
        values = (well.astype(float), when, aside, np.degrees(yaw), speed)
        found |= dict(zip(OF_DOCKING, values, strict=True))
    return found


def _overshoot(error: Array) -> Array:
    """Largest error on the side away from where a run began; on either side where it began in its place.

    The overshoot of control is of a step, beyond the new value (Ogata 2010, Modern Control Engineering,
    section 5-3). Who has no step to make and swings all the same answers a disturbance: its peak counts.

    Parameters
    ----------
    error : array, shape (n_t, runs)
    """
    if not len(error):
        return np.zeros(error.shape[1])
    side = np.sign(error[0])
    beyond = np.where(side == 0, np.abs(error), -side * error)
    return np.asarray(np.maximum(beyond.max(axis=0), 0.0))


def _lost(track: Track, mission: Mission) -> Mask:
    """Which runs lost their way: no lamp shines backwards, and no array sees one behind its back.

    Darkness alone does not count: who sees nothing in it may find back.
    """
    late, end = _late_and_end(track)
    dark = (track.time_s >= mission.dark_from_s) & (track.time_s < mission.dark_from_s + mission.dark_for_s)
    behind = (track.pose[late, :, 2] <= 0).any(axis=0)
    away = (np.abs(track.pose[late, :, 3]) > np.pi / 2).any(axis=0)
    blind = bool((end & ~dark).any()) & ~track.lit[end & ~dark].any(axis=0)
    return np.asarray(behind | away | blind)


def on_their_way(track: Track) -> Mask:
    """Which runs end while they come nearer to a dock that they have not reached, shape (runs,)."""
    _, end = _late_and_end(track)
    nearer = track.goal_m[-1] < track.goal_m[end][0]
    return np.asarray(np.isnan(track.contact[:, 0]) & nearer & track.lit[-1])


def _late_and_end(track: Track) -> tuple[Mask, Mask]:
    time = track.time_s
    return time >= _SETTLED * time[-1], time >= time[-1] - _END_S


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt((values**2).mean(axis=0)))


def _back_after(track: Track, since_s: float) -> Array:
    """Time from the light's return until the vehicle is in its place for good; NaN: never."""
    after = track.time_s >= since_s
    across = np.hypot(track.pose[after, :, 0], track.pose[after, :, 1])
    along = np.abs(track.pose[after, :, 2] - track.goal_m[after])
    away = (across > _BACK_M[0]) | (along > _BACK_M[1])
    time = track.time_s[after] - since_s
    found = np.full(track.pose.shape[1], np.nan)
    for k in range(len(found)):
        out = np.flatnonzero(away[:, k])
        last = int(out[-1]) + 1 if len(out) else 0
        if last < len(time):
            found[k] = time[last]
    return found
