"""`pose estimate`: the poses of a table of readings, one by one or through the filter."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any

import numpy as np
import pandas as pd

from lightfield.arrays import Array
from lightfield.errors import MeasurementError
from lightfield.render.limits import FIELD_PHOTONS
from lightfield.scene import Scene
from lightfield.studies.follower.array_light import MARGIN_M, Space, light_of
from lightfield.studies.follower.elements import elements_of
from lightfield.studies.follower.estimation.pose import DOUBTFUL, IN_A_ROW, Estimator, PoseEstimate
from lightfield.studies.follower.estimation.table import read_samples
from lightfield.studies.follower.estimation.tracking import Tracked, Tracker
from lightfield.studies.follower.frames import POSE, UNKNOWN_VARIANCE, in_degrees
from lightfield.studies.follower.information import is_told
from lightfield.studies.follower.pose_search import MOST_TURNED
from lightfield.studies.follower.survey import array_of
from lightfield.wording import capital, minus

#: Random starts that look for rivals of a pose.
_RIVAL_STARTS = 32
#: Readings so many times brighter than the space allows are in another unit: the lamp's power, or the gain,
#: is hardly known worse.
_FAR_BRIGHTER = 10.0
#: Errors of less are told as this in a sentence of centimetres.
_LEAST_TOLD_M = 0.01
#: Samples that a text shows.
SHOWN = 12


#: What to do about poses at the edge of where they are looked for.
_ROOM = (
    f" (looked {MARGIN_M:g} m beyond detector.planes_m and the half width, and up to "
    f"{np.degrees(MOST_TURNED):.0f} degrees of yaw and pitch: the follower may be farther)"
)


#: What to do about readings far too bright, or too dim.
_STATE_GAIN = "state array.gain: what is read for 1 W/m2 of a lamp of 1 W/sr on its axis"


class Lost(str, Enum):
    """What a stretch of readings lacks; its words are its name for programs."""

    LIGHT = "light lost"
    BELIEF = "another light"
    SPACE = "at the edge of the space looked in"


@dataclass(frozen=True)
class Loss:
    """A stretch without light, or with light that is not the one believed in.

    Parameters
    ----------
    from_s, to_s : float, s
        Its first and last reading.
    why : Lost
    sigma_m : (float, float) or None
        Error along the beam that the filter states before and at its end; None without a filter.
    found_s : float or None
        First good reading after it; None: never.
    """

    from_s: float
    to_s: float
    why: Lost
    sigma_m: tuple[float, float] | None
    found_s: float | None

    def __str__(self) -> str:
        found = "it does not come back" if self.found_s is None else f"found again at {self.found_s:.2f} s"
        grown = ""
        if self.sigma_m is not None:
            grown = "; meanwhile the filter's error along the beam goes from {:.3f} to {:.3f} m".format(
                *self.sigma_m
            )
        room = _ROOM if self.why is Lost.SPACE else ""
        return f"{self.why.value} from {self.from_s:.2f} to {self.to_s:.2f} s{grown}; {found}{room}"


@dataclass(frozen=True)
class Poses:
    """Poses of a sequence.

    Parameters
    ----------
    scene : Scene
    names : tuple of str
    time_s : array, shape (n,)
    estimates : list of PoseEstimate
    tracked : list of Tracked or None
        With the filter.
    traced : bool
        Light that was believed in: traced, or the formula.
    silent : tuple of str
        Columns that are zero in every line, and without which a reading fits that does not with them.
    dim : bool
        All elements read something in every line, and none of it is more than darkness.
    below : int
        Lines in which all elements read less than darkness, by more than its noise.
    """

    scene: Scene
    names: tuple[str, ...]
    time_s: Array
    estimates: list[PoseEstimate]
    tracked: list[Tracked] | None
    traced: bool
    silent: tuple[str, ...] = ()
    dim: bool = False
    below: int = 0

    @property
    def last_known(self) -> str:
        """Where the follower was seen last, as a sentence; nothing where no reading fits the light."""
        times = zip(self.time_s, self.estimates, strict=True)
        seen = [(time, one.pose, one.total) for time, one in times if one.fits and one.total is not None]
        if not seen:
            return ""
        time, pose, total = seen[-1]
        at = f"At {time:.1f} s " if len(self.estimates) > 1 else ""
        told = " and ".join(
            f"{minus(f'{value:.2f}')} ± {max(sigma, _LEAST_TOLD_M):.2f} m {where}"
            if is_told(name, sigma := total.sigma[name])
            else f"at an unknown place {where}"
            for name, value, where in (("z", pose[2], "along the beam"), ("x", pose[0], "aside"))
        )
        return f"{at}{told}. "

    @property
    def lost(self) -> int:
        return sum(one.lost for one in self.estimates)

    @property
    def misfits(self) -> int:
        return sum(not one.lost and not one.fits for one in self.estimates)

    @property
    def ambiguous(self) -> int:
        return sum(one.ambiguous for one in self.estimates)

    @property
    def doubts(self) -> str:
        """What is to be done about readings that look dead, too dim or negative, or nothing."""
        if self.below:
            return (
                f"every element reads less than 0 by more than noise in {self.below} of "
                f"{len(self.estimates)} lines: was more taken away than is read in the dark, or is the sign "
                "turned?"
            )
        if self.dim:
            return (
                "every element reads something throughout, though no more than darkness makes: are these "
                f"readings in another unit? {capital(_STATE_GAIN)}"
            )
        if not self.silent:
            return ""
        what, read, them = (
            ("element", "reads", "it") if len(self.silent) == 1 else ("elements", "read", "them")
        )
        return (
            f"{what} {', '.join(self.silent)} {read} 0 throughout, and readings that do not fit do without "
            f"{them}: leave the cells of a dead element empty"
        )

    @property
    def losses(self) -> list[Loss]:
        """Every darkness, and every three or more readings in a row that do not fit, or lie at the edge."""
        dark = [one.lost for one in self.estimates]
        edge = [not one.lost and one.edge for one in self.estimates]
        strange = [not one.lost and not one.edge and one.probability < DOUBTFUL for one in self.estimates]
        found = []
        kinds = ((dark, 1, Lost.LIGHT), (strange, IN_A_ROW, Lost.BELIEF), (edge, IN_A_ROW, Lost.SPACE))
        for flags, least, why in kinds:
            edges = np.flatnonzero(np.diff([False, *flags, False]))
            for first, after in zip(edges[::2], edges[1::2], strict=True):
                if after - first >= least:
                    found.append(self._loss(int(first), int(after), why))
        return sorted(found, key=lambda one: one.from_s)

    def _loss(self, first: int, after: int, why: Lost) -> Loss:
        good = (k for k in range(after, len(self.estimates)) if self.estimates[k].fits)
        again, sigma = next(good, None), None
        if self.tracked is not None and first > 0:
            z = self.names.index("z")
            before, then = (float(np.sqrt(self.tracked[k].covariance[z, z])) for k in (first - 1, after - 1))
            sigma = (before, then) if np.isfinite(before + then) else None
        time = self.time_s
        return Loss(
            float(time[first]),
            float(time[after - 1]),
            why,
            sigma,
            None if again is None else float(time[again]),
        )

    def as_data(self) -> dict[str, Any]:
        found: list[dict[str, Any]] = []
        for k, one in enumerate(self.estimates):
            row = {"time_s": float(self.time_s[k]), **one.as_data()}
            if self.tracked is not None and np.isfinite(self.tracked[k].pose).all():
                state = self.tracked[k]
                known = np.isfinite(state.total)
                row["filtered"] = {
                    "pose_m_deg": dict(zip(POSE, in_degrees(state.pose).tolist(), strict=True)),
                    "rate_m_deg_per_s": dict(zip(POSE, in_degrees(state.rate).tolist(), strict=True)),
                    "covariance_m_rad": np.where(known, state.total, UNKNOWN_VARIANCE).tolist(),
                    "used": state.used,
                }
            found.append(row)
        light = "traced field" if self.traced else "formula"
        losses = [asdict(one) for one in self.losses]
        return {"light": light, "losses": losses, "silent": list(self.silent), "samples": found}

    def as_text(self) -> str:
        """One line per sample, and what did not go well."""
        lines = [f"light believed in: {'traced field' if self.traced else 'formula'}"]
        for k, one in enumerate(self.estimates[:SHOWN]):
            lines.append(f"{self.time_s[k]:8.2f} s  {one.as_text()}")
        if len(self.estimates) > SHOWN:
            lines.append(f"and {len(self.estimates) - SHOWN} more")
        if self.tracked is not None and np.isfinite(self.tracked[-1].pose).all():
            x, y, z, yaw, pitch, _ = in_degrees(self.tracked[-1].pose)
            lines.append(
                f"filtered, at the end: x {x:.3f}, y {y:.3f}, z {z:.3f} m, yaw {yaw:.2f}, pitch "
                f"{pitch:.2f} deg"
            )
        lines += [str(one) for one in self.losses]
        lines += [self.doubts] if self.doubts else []
        lines.append(
            f"{len(self.estimates)} samples, {self.lost} without light, {self.misfits} that do not fit, "
            f"{self.ambiguous} ambiguous"
        )
        return "\n".join(lines)


def poses_of(
    readings: str | os.PathLike[str] | pd.DataFrame,
    scene: Scene,
    space: Space,
    *,
    filtered: bool = False,
    photons: float = FIELD_PHOTONS,
    seed: int = 0,
) -> Poses:
    """Poses of the samples of a table.

    Parameters
    ----------
    readings : path-like or DataFrame
        See `table.read_samples`.
    scene : Scene
        With an array.
    space : Space
        Formation space: where the follower may be.
    filtered : bool
        Let the filter go over them, too.
    photons : float
        Of the trace; zero: believe the formula.

    Raises
    ------
    SceneError, MeasurementError, RenderError
        No array, a table that is none, a space that is not in the water.
    """
    array = array_of(scene)
    elements = elements_of(array)
    samples = read_samples(readings, len(elements), array.sample_hz)
    estimator = Estimator.of_scene(scene, light_of(scene, space, elements, photons=photons, seed=seed), space)
    light = samples.readings / array.gain
    _refuse_another_unit(
        light, estimator, "readings" if isinstance(readings, pd.DataFrame) else str(readings)
    )
    tracked = None
    if filtered:
        tracker = Tracker(estimator)
        tracked = [tracker.update(one, float(t)) for one, t in zip(light, samples.time_s, strict=True)]
        estimates = [one.estimate for one in tracked]
    else:
        estimates, last = [], None
        for one in light:
            found = estimator.estimate(one, last, more_starts=_RIVAL_STARTS, seed=seed)
            last = None if found.lost else found.pose
            estimates.append(found)
    silent = _silent(light, estimator, estimates)
    dim = all(one.lost for one in estimates) and bool((light > 0).all())
    below = int((np.nanmax(light, axis=1) < -estimator.least_light).sum())
    told = bool(photons), silent, dim, below
    return Poses(scene, estimator.names, samples.time_s, estimates, tracked, *told)


def _silent(readings: Array, estimator: Estimator, estimates: Sequence[PoseEstimate]) -> tuple[str, ...]:
    """Elements that read nothing in any sample, and without which the first fits that does not fit."""
    zero = (readings == 0).all(axis=0)
    wrong = next((k for k, one in enumerate(estimates) if not one.lost and not one.fits), None)
    if wrong is None or not zero.any():
        return ()
    if not estimator.estimate(np.where(zero, np.nan, readings[wrong])).fits:
        return ()
    return tuple(f"e{k + 1}" for k in np.flatnonzero(zero))


def _refuse_another_unit(readings: Array, estimator: Estimator, where: str) -> None:
    """Refuse readings far brighter than any in the space, which no pose explains."""
    nearest = np.zeros((1, len(POSE)))
    nearest[0, 2] = estimator.space.near_m
    most, brightest = (
        float(np.median(np.nanmax(readings, axis=1))),
        float(estimator.model.readings(nearest).max()),
    )
    if most > _FAR_BRIGHTER * brightest:
        raise MeasurementError(
            "the readings are far brighter than the array's could be anywhere in its space",
            where=where,
            found=f"{most:.3g} 1/m2 (the brightest of a sample, over array.gain)",
            rule=f"up to about {brightest:.3g} 1/m2, at {estimator.space.near_m:g} m",
            remedy=_STATE_GAIN,
        )
