"""Which pose do these readings come from, how well is it known, and what else could it be?

One reading at a time, by maximum likelihood over the light that the follower believes in; a sequence besides
by a filter that knows that a vehicle does not jump (`tracking`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.stats import chi2 as chi2_distribution

from lightfield.arrays import Array, Mask
from lightfield.scene import Scene
from lightfield.studies.follower.array_light import LAMP_TILTS, ArrayModel, Light, Space, pose_names
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.elements import Elements, elements_of
from lightfield.studies.follower.estimation.posterior import Reading
from lightfield.studies.follower.frames import AXES, POSE, UNKNOWN_VARIANCE, in_degrees, in_frame, pose_of
from lightfield.studies.follower.information import Bound, bound_pair, is_told, nuisances_of
from lightfield.studies.follower.pose_search import Minima, box_of, find_minima, starts_in
from lightfield.studies.follower.rival_poses import RivalPose, distinct, nearest_alike, others
from lightfield.studies.follower.survey import array_of
from lightfield.wording import with_error

#: Poses a first search starts from: one in every eighth of the formation space.
_FIRST_STARTS = 8
#: Readings that are this unlikely do not come from the light that is believed in (as of a diagnosis: 1 %).
_UNLIKELY = 0.01
#: Readings so much less probable, so many in a row, are no accident: the light is another than is believed.
DOUBTFUL, IN_A_ROW = 1e-3, 3
#: Light is lost where the brightest element is less than this many sigma of darkness (Rose 1948: 5).
LOST_SIGMA = 5.0
#: Poses that explain readings equally well, in sigma: the nearer to the last one is taken.
_ALIKE_SIGMA = 1.0
#: Up to here another pose is not excluded (95 %): which of the two it is, these readings do not tell.
_AMBIGUOUS_SIGMA = 2.0


@dataclass(frozen=True)
class PoseEstimate:
    """A pose from one reading of an array.

    Parameters
    ----------
    pose : array, shape (6,), m and rad
        NaN where light is lost.
    gain : float
        Common gain that goes with it.
    chi2, probability : float
        Sum of squared residuals, and how probable one as large is if the light is right.
    noise_only : Bound or None
        What noise scatters from one reading to the next; None where light is lost.
    total : Bound or None
        With gain, water and lamp unknown as far as the scene says; its covariance is the mean square distance
        of all poses that the reading leaves open, see `posterior`.
    rivals : list of RivalPose
        Other minima within 5 sigma.
    lost : bool
    edge : bool
        At the edge of where it was looked for: the light is another, or the follower is beyond.
    """

    pose: Array
    gain: float
    chi2: float
    probability: float
    noise_only: Bound | None
    total: Bound | None
    rivals: list[RivalPose] = field(default_factory=list)
    lost: bool = False
    edge: bool = False

    @property
    def fits(self) -> bool:
        return not self.lost and not self.edge and self.probability >= _UNLIKELY

    @property
    def ambiguous(self) -> bool:
        """Another pose explains the readings as well, within `_AMBIGUOUS_SIGMA`."""
        return any(rival.sigma < _AMBIGUOUS_SIGMA for rival in self.rivals)

    @property
    def status(self) -> str:
        """In words."""
        if self.lost:
            return "light lost"
        if self.edge:
            return "at the edge of the space looked in"
        return "found" if self.fits else "readings do not fit the light"

    def as_data(self) -> dict[str, Any]:
        if self.lost or self.total is None:
            return {"status": self.status}
        frames = {frame: in_frame(self.pose, frame) for frame in AXES}
        return {
            "status": self.status,
            **self.total.as_data(),
            "covariance_m_rad": np.where(
                np.isfinite(self.total.covariance), self.total.covariance, UNKNOWN_VARIANCE
            ).tolist(),
            "gain": self.gain,
            "chi2": self.chi2,
            "probability": self.probability,
            "ambiguous": self.ambiguous,
            "rivals": [rival.as_data() for rival in self.rivals],
            "frames": {
                name: {"position_m": one.position_m.tolist(), "quaternion_xyzw": one.quaternion.tolist()}
                for name, one in frames.items()
            },
        }

    def as_text(self) -> str:
        """One line."""
        if self.lost or self.total is None:
            return "light lost: no element reads more than darkness"
        values, sigma = in_degrees(self.pose), self.total.sigma
        words = []
        for name, value in zip(POSE, values, strict=True):
            if name in sigma and not is_told(name, sigma[name]):
                words.append(f"{name} unknown")
            elif name in sigma:
                unit, s = ("m", sigma[name]) if name in POSE[:3] else ("deg", np.degrees(sigma[name]))
                words.append(f"{name} {with_error(value, s)} {unit}")
        tested = len(self.total.readings) > len(sigma)
        fit = (
            f"chi2 {self.chi2:.0f}, probability {self.probability:.2g}"
            if tested
            else "as many unknowns as readings"
        )
        line = f"{', '.join(words)}; {fit}"
        if not self.fits:
            line += f": {self.status}"
        if not self.rivals:
            return line
        doubt = "ambiguous, " if self.ambiguous else ""
        count = f"{len(self.rivals)} rival{'s' * (len(self.rivals) > 1)}"
        return f"{line}; {doubt}{count}, {self.rivals[0]}"


@dataclass(frozen=True)
class Estimator:
    """Poses from readings, one after the other or each by itself.

    Parameters
    ----------
    model : ArrayModel
        Light that is believed in, and elements.
    noise : SensorNoise
    names : tuple of str
        Coordinates that are sought.
    nuisances : mapping of str to float
        What is not known exactly, and sought with the pose.
    space : Space
        Where the follower may be.
    roll_rad : float
        How it leans, where the light does not tell.
    """

    model: ArrayModel
    noise: SensorNoise
    names: tuple[str, ...]
    nuisances: Mapping[str, float]
    space: Space
    roll_rad: float = 0.0

    @classmethod
    def of_scene(cls, scene: Scene, light: Light, space: Space) -> Estimator:
        """As the scene's array, follower and lamp say."""
        model = ArrayModel(light, elements_of(array_of(scene)))
        noise, roll = SensorNoise.of_scene(scene), float(pose_of(scene.follower_here)[POSE.index("roll")])
        return cls(model, noise, pose_names(scene), nuisances_of(scene), space, roll)

    @property
    def least_light(self) -> float:
        """Reading, 1/m^2, of the brightest element up to which light is lost."""
        dark = np.sqrt(self.noise.variance(np.zeros(len(self.model.elements))))
        return LOST_SIGMA * max(float(dark.max()), float(np.finfo(float).tiny))

    def starts(self) -> Array:
        """Poses of a first search: the corners of the formation space, and rolls where they count."""
        s = self.space
        places = [
            (x, y, z)
            for z in (s.near_m + 0.25 * (s.far_m - s.near_m), s.near_m + 0.75 * (s.far_m - s.near_m))
            for x in (-0.5 * s.half_width_m, 0.5 * s.half_width_m)
            for y in (-0.5 * s.half_width_m, 0.5 * s.half_width_m)
        ]
        poses = np.zeros((_FIRST_STARTS, len(POSE)))
        poses[:, :3] = places
        sought = "roll" in self.names
        poses[:, 5] = np.linspace(-0.5 * np.pi, 0.5 * np.pi, _FIRST_STARTS) if sought else self.roll_rad
        return poses

    def fit(self, readings: Array, starts: Array, again: int = 0) -> Minima:
        """Minima from the starts, best first; see `find_minima`.

        The water is sought from where the pose is best with it as believed, and from the first starts
        `again`: two minima of another water may be one of that believed in.
        """
        box, variance = box_of(self.space), self.noise.variance(readings)
        gain = {name: sigma for name, sigma in self.nuisances.items() if name == "gain"}
        search = partial(find_minima, self.model, readings, variance, self.names, box=box)
        found = search(starts, nuisances=gain).best_first()
        if self.nuisances.keys() - gain.keys() - LAMP_TILTS.keys():
            begin = np.concatenate([distinct(found.poses), starts[:again]])
            found = search(begin, nuisances=self.nuisances).best_first()
        return found

    def estimate(
        self, readings: Array, last: Array | None = None, *, more_starts: int = 0, seed: int = 0
    ) -> PoseEstimate:
        """Pose of one reading: the best that is found from all over the space, as if it were the only one.

        Parameters
        ----------
        readings : array, shape (n_elements,), 1/m^2
            NaN of an element that was not read: it tells nothing.
        last : array, shape (6,), optional
            A pose to start from besides; of poses that explain the reading equally well the nearest to it is
            taken.
        more_starts : int
            Random starts beside.
        """
        readings = np.asarray(readings, float)
        read = np.isfinite(readings)
        if not read.all() and read.any():
            return self._of(read).estimate(readings[read], last, more_starts=more_starts, seed=seed)
        if not readings.max() > self.least_light:
            return PoseEstimate(np.full(len(POSE), np.nan), np.nan, np.nan, 0.0, None, None, lost=True)
        free = max(len(readings) - len(self.names), 1)
        begin = [self.starts()]
        if more_starts:
            begin.append(starts_in(box_of(self.space), self.names, more_starts, seed, self.roll_rad))
        if last is not None:
            last = np.where(np.isin(POSE, self.names), last, begin[0][0])
            begin.append(last[None])
        # On the way, ten times a second, what the last pose leads to is enough.
        again = _FIRST_STARTS if last is None or more_starts else 0
        found = self.fit(readings, np.concatenate(begin), again)
        best, k = float(found.chi2[0]), nearest_alike(found, last, _ALIKE_SIGMA)
        pose, chi2 = found.poses[k], float(found.chi2[k])
        alone, total = bound_pair(self.model, pose, self.names, self.noise, self.nuisances)
        rivals = others(found, pose, best)
        return PoseEstimate(
            pose,
            float(found.gains[k]),
            chi2,
            float(chi2_distribution.sf(chi2, free)),
            alone,
            self._with_all_left_open(total, (chi2 - best) ** 0.5, rivals, readings),
            rivals,
            edge=self._at_edge(pose),
        )

    def _of(self, read: Mask) -> Estimator:
        """By some of the elements alone."""
        elements = self.model.elements
        some = Elements(elements.place_m[read], elements.normal[read])
        return replace(self, model=replace(self.model, elements=some))

    def _with_all_left_open(
        self, total: Bound, sigma: float, rivals: Sequence[RivalPose], readings: Array
    ) -> Bound:
        """A bound at a pose so many sigma from the best with the errors of all poses that are left open."""
        variance, box = self.noise.variance(readings), box_of(self.space)
        reading = Reading(self.model, readings, variance, self.names, self.nuisances, box)
        minima = [(total.pose, sigma), *((one.pose, one.sigma) for one in rivals)]
        covariances = [total.covariance]
        for one in rivals:
            pair = bound_pair(self.model, one.pose, self.names, self.noise, self.nuisances)
            covariances.append(pair[1].covariance)
        return replace(total, covariance=reading.spread_about(minima, covariances))

    def _at_edge(self, pose: Array) -> bool:
        low, high = box_of(self.space)
        at = [POSE.index(name) for name in self.names if name != "roll"]
        return bool(((pose <= low) | (pose >= high))[at].any())
