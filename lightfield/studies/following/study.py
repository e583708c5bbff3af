"""How does a follower fare that believes in this light, in that water? Runs of a closed loop, compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from lightfield.arrays import Array, Mask, finite
from lightfield.errors import SceneError
from lightfield.progress import step
from lightfield.render.limits import FIELD_PHOTONS
from lightfield.scene import Scene
from lightfield.scene.follower import Mission
from lightfield.studies.defaults import RUNS
from lightfield.studies.follower.calibration import CLEAR_PER_M
from lightfield.studies.follower.elements import elements_of
from lightfield.studies.follower.frames import POSE, in_degrees
from lightfield.studies.follower.survey import DOCKING, array_of
from lightfield.studies.following.leader import beyond_walls, check_way
from lightfield.studies.following.loop import Track, run_loop
from lightfield.studies.following.metrics import (
    COUNTED,
    METRICS,
    OverRuns,
    metrics_of,
    on_their_way,
    spreads_of,
)
from lightfield.studies.following.truth_and_belief import densest_per_m, light_of_mission
from lightfield.studies.one_number import refuse_several
from lightfield.wording import capital, plain

#: In words, what a follower believes.
BELIEFS = {
    "field": "the traced field",
    "fitted": "the formula, K and gain fitted in this water",
    "exact": "the formula, exact c and lamp power",
    "clear": "the formula, K and gain from clear water",
    "relative": "the formula, relative readings only",
}
#: The same, for legends.
_SHORT = {
    "field": "field", "fitted": "formula fitted here", "exact": "formula, exact c",
    "clear": "formula from home", "relative": "formula, relative",
}  # fmt: skip
#: Distance, m, by which a follower may miss what was asked for: what docking allows along the beam.
_ALLOWED_M = DOCKING["z"]
#: More readings of all runs together would take an hour and a gigabyte: an hour at 10 Hz in eight runs.
_MOST_READINGS = 300_000
#: Samples of a run in JSON.
SHOWN = 241


@dataclass(frozen=True)
class Followed:
    """Runs of one follower in one scene.

    Parameters
    ----------
    name : str
        Of the scene.
    scene : Scene
    track : Track
    runs : dict of str to array, shape (runs,)
        Metrics, see `METRICS`.
    traced : bool
    """

    name: str
    scene: Scene
    track: Track
    runs: dict[str, Array]
    traced: bool

    @property
    def mission(self) -> Mission:
        return self.scene.follower_here.mission

    @property
    def spreads(self) -> dict[str, OverRuns]:
        """Every metric over the runs that kept their way."""
        return spreads_of(self.runs)

    @property
    def lost(self) -> Mask:
        """Which runs lost their way, shape (runs,); who docks has none to keep."""
        return np.asarray(self.runs.get("lost", np.zeros(len(self.track.contact))) > 0)

    @property
    def typical(self) -> int:
        """Number of the run that ends nearest to where they end in the middle; none that lost its way."""
        last = self.track.pose[-1, :, 2] if self.mission.task == "follow" else self.track.contact[:, 0]
        kept = np.flatnonzero(self.lost == self.lost.all())
        known = np.where(np.isfinite(last), last, np.inf)[kept]
        return int(kept[np.argsort(known, kind="stable")[(len(known) - 1) // 2]])

    @property
    def believed(self) -> str:
        """What it believes, in words."""
        return "the formula, as is true here" if self._knows_the_formula else BELIEFS[self.mission.believes]

    @property
    def believed_short(self) -> str:
        """The same, for legends."""
        return "formula, true here" if self._knows_the_formula else _SHORT[self.mission.believes]

    @property
    def _knows_the_formula(self) -> bool:
        return self.mission.believes == "field" and not self.traced

    @property
    def through_walls(self) -> int:
        """Runs in which the middle of the array leaves the tank."""
        places = self.track.pose[..., :3] + self.track.leader_m[:, None]
        return int(beyond_walls(places, self.scene.tank).any(axis=0).sum())

    @property
    def verdict(self) -> str:
        """One sentence."""
        return f"{self.name}: {self.told}"

    @property
    def told(self) -> str:
        """The same without the scene's name."""
        found, mission = self.spreads, self.mission
        believes = f"a follower that believes {self.believed}"
        count = len(self.track.contact)
        if mission.task == "dock":
            docked = int(self.runs["docked"].sum())
            reached = found["contact_time"].runs
            still = int(on_their_way(self.track).sum())
            over = f"on their way when their {mission.duration_s:g} s were over"
            if docked:
                late = f"; {still} were {over}" if still else ""
                return f"{believes} docks in {docked} of {count} runs{late}"
            if reached:
                return f"{believes} misses the dock"
            ends = float(np.linalg.norm(self.track.pose[-1, :, :3], axis=-1).mean())
            if still:
                return (
                    f"{believes} has not come to the dock yet: {still} of {count} runs were {over}, "
                    f"{ends:.1f} m from the lamp"
                )
            return (
                f"{believes} never comes to the dock: after {mission.duration_s:g} s it is {ends:.1f} m "
                "from the lamp"
            )
        if not np.isfinite(self.runs["belief_less_truth"]).any():
            return f"{believes} never learns where it is: no reading of the array tells its whole pose"
        if self.lost.all():
            return f"{believes} loses its way in each of {count} runs"
        z = self.kept
        off = z.mean - mission.standoff_m
        stands = f"{believes} stands at {z} m where {mission.standoff_m:g} m was asked"
        if self.astray:
            return f"{stands}, and {', and '.join(self.astray)}"
        if abs(off) <= _ALLOWED_M:
            return stands
        return f"{stands}: {abs(off):.1f} m too {'far' if off > 0 else 'near'}"

    @property
    def kept(self) -> OverRuns:
        """The distance that it keeps, m: at the end, where water or light changes on the way."""
        changes = self.mission.turbid_factor != 1 or self.mission.dark_for_s > 0
        return self.spreads["standoff_at_end" if changes else "standoff"]

    def stands(self, about: list[str]) -> str:
        """Where it stands, with what is said about it in brackets."""
        beside = ", ".join([*about, *self.astray])
        return ("no distance" if self.lost.all() else f"{self.kept} m") + f" ({beside})" * bool(beside)

    @property
    def astray(self) -> list[str]:
        """What it does that it should not, beside standing too far or too near; each a verb and on."""
        count, lost = len(self.lost), int(self.lost.sum())
        found = []
        if lost:
            found.append(f"loses its way in {lost} of {count} runs")
        if self.through_walls:
            found.append(f"drives through a wall of the tank in {self.through_walls} of {count} runs")
        elif self.spreads["outside"].mean > 0:
            found.append("leaves the light that is known")
        return found

    def as_data(self) -> dict[str, Any]:
        mission, track = self.mission, self.track
        every = max(1, -(-len(track.time_s) // SHOWN))
        return {
            "scene": self.name,
            "scattering_per_m": densest_per_m(self.scene) / max(1.0, mission.turbid_factor),
            "believes": mission.believes,
            "task": mission.task,
            "law": mission.law,
            "vehicle": mission.vehicle,
            "degrees_of_freedom": mission.degrees_of_freedom,
            "runs": len(track.contact),
            "runs_through_walls": self.through_walls,
            "runs_lost": int(self.lost.sum()),
            "light": "traced field" if self.traced else "formula",
            "verdict": self.verdict,
            "metrics": {
                name: {
                    "unit": METRICS[name][0],
                    "meaning": METRICS[name][1],
                    "mean": finite(one.mean),
                    "scatter_between_runs": finite(one.scatter),
                    "standard_error": finite(one.error),
                    "by_run": [finite(v) for v in self.runs[name]],
                }
                for name, one in self.spreads.items()
            },
            "typical_run": {
                "time_s": track.time_s[::every].tolist(),
                "pose_m_deg": in_degrees(track.pose[::every, self.typical]).round(6).tolist(),
                "believed_m_deg": _listed(in_degrees(track.estimate[::every, self.typical])),
                "leader_m": track.leader_m[::every].round(6).tolist(),
            },
        }

    def as_text(self) -> str:
        """A line per metric: mean, scatter from run to run, error of the mean."""
        mission = self.mission
        lines = [
            f"{self.name}: {len(self.track.contact)} runs of {mission.duration_s:g} s, {mission.task}, "
            f"{mission.law}, {mission.vehicle} with {mission.degrees_of_freedom} degrees of freedom; "
            f"believes {self.believed}"
        ]
        for name, one in self.spreads.items():
            unit, meaning = METRICS[name]
            if name in COUNTED:
                text = f"{int(self.runs[name].sum())} of {len(self.runs[name])}"
            elif not one.runs:
                text = "no run left" if self.lost.all() else "never"
            else:
                text = f"{one} {unit}"
                if np.isfinite(one.error):
                    text += f" (mean ± {one.error:.2g})"
            lines.append(f"  {plain(name):<18} {text:<36} {meaning}")
        return "\n".join(lines)

    def dataset(self) -> xr.Dataset:
        """Everything over time, dimensions (time_s, run, coordinate)."""
        track, mission = self.track, self.mission
        dims = ("time_s", "run", "coordinate")
        about = {
            "pose": (dims, track.pose, {"long_name": "true pose from the lamp", "units": "m, rad"}),
            "estimate": (dims, track.estimate, {"long_name": "pose believed", "units": "m, rad"}),
            "estimate_stderr": (dims, track.sigma, {"long_name": "its error by noise", "units": "m, rad"}),
            "speed": (dims[:2], track.speed, {"units": "m s-1", "long_name": "past the lamp"}),
            "force": ((*dims[:2], "thrust"), track.force, {"units": "N, N m"}),
            "brightest": (dims[:2], track.brightest, {"units": "m-2", "long_name": "brightest reading"}),
            "goal": (dims[:2], track.goal_m, {"units": "m", "long_name": "distance asked for"}),
            "leader": (("time_s", "axis"), track.leader_m, {"units": "m"}),
        }
        flags = {
            name: (dims[:2], getattr(track, name).astype("i1")) for name in ("lit", "doubtful", "inside")
        }
        metrics = {
            name: (("run",), values, {"units": METRICS[name][0], "long_name": METRICS[name][1]})
            for name, values in self.runs.items()
        }
        return xr.Dataset(
            {**about, **flags, **metrics},
            coords={
                "time_s": ("time_s", track.time_s, {"units": "s"}),
                "coordinate": list(POSE),
                "thrust": ["surge", "sway", "heave", "yaw"],
                "axis": list("xyz"),
            },
            attrs={"scene_toml": self.scene.to_toml(), "believes": mission.believes, "title": self.verdict},
        )


@dataclass(frozen=True)
class Following:
    """Several followers, or one.

    Parameters
    ----------
    cases : list of Followed
    """

    cases: list[Followed]

    @property
    def verdict(self) -> str:
        """One sentence for all."""
        asked = {one.mission.standoff_m for one in self.cases}
        docks = any(one.mission.task == "dock" for one in self.cases)
        if len(self.cases) == 1 or docks or len(asked) > 1:
            names = [one.name for one in self.cases]  # of cases in a row it is told once
            pairs = zip(["", *names], self.cases, strict=False)
            return ". ".join(capital(one.told) if one.name == last else one.verdict for last, one in pairs)
        parts, several = [], len({one.name for one in self.cases}) > 1
        for believes in dict.fromkeys(one.mission.believes for one in self.cases):
            alike = [one for one in self.cases if one.mission.believes == believes]
            stands = ", ".join(one.stands([one.name] * several) for one in alike)
            parts.append(f"who believes {alike[0].believed} stands at {stands}")
        return f"Asked for {asked.pop():g} m: " + "; ".join(parts)

    def as_data(self) -> dict[str, Any]:
        return {"verdict": self.verdict, "cases": [one.as_data() for one in self.cases]}

    def as_text(self) -> str:
        return "\n".join([*(one.as_text() for one in self.cases), self.verdict])


def follow(
    scenes: Mapping[str, Scene],
    believes: Sequence[str] = (),
    *,
    runs: int = RUNS,
    seed: int = 0,
    photons: float = FIELD_PHOTONS,
    densest: float | None = None,
) -> Following:
    """Let followers run the missions of scenes.

    Parameters
    ----------
    scenes : mapping of str to Scene
        By name; each with an array.
    believes : sequence of str
        Every scene is run with each of these (`BELIEFS`); by default with what it says itself.
    runs : int
        Of every follower, with noise, gain, water and lamp's direction of their own, as far as the scene says
        that they are not known.
    seed : int
    photons : float
        Of a trace, which scenes share that differ in their water alone; zero: only the formula.
    densest : float, 1/m, optional
        Most scattering of all scenes that should share it.

    Raises
    ------
    SceneError, RenderError
        No array; a follower or a way of the leader that is not in the water.
    """
    cases = []
    whole = [(name, with_belief(scene, b)) for name, scene in scenes.items() for b in believes or ("",)]
    if densest is None and len(scenes) > 1:
        densest = max(map(densest_per_m, scenes.values()))
    for k, (name, scene) in enumerate(whole):
        elements = elements_of(array_of(scene))
        _check_length(scene, runs)
        check_way(scene.follower_here.mission, scene.tank)
        with step(2 * k, 2 * len(whole), f"light of {name}"):
            light = light_of_mission(scene, elements, photons=photons, seed=seed, densest=densest)
        with step(2 * k + 1, 2 * len(whole), f"runs of {name}"):
            track = run_loop(scene, light, elements, runs=runs, seed=seed)
        mission = scene.follower_here.mission
        cases.append(Followed(name, scene, track, metrics_of(track, mission), bool(photons)))
    return Following(cases)


def _check_length(scene: Scene, runs: int) -> None:
    mission, rate = scene.follower_here.mission, array_of(scene).sample_hz
    if runs * mission.duration_s * rate > _MOST_READINGS:
        raise SceneError(
            "too many readings", where="follower.mission.duration_s",
            found=f"{mission.duration_s:g} s at {rate:g} Hz in {runs} runs", rule=f"at most {_MOST_READINGS}",
            remedy="a shorter mission, fewer runs, or a lower array.sample_hz",
        )  # fmt: skip


def with_belief(scene: Scene, believes: str) -> Scene:
    """The scene with a follower that believes otherwise.

    Raises
    ------
    SceneError
        Water whose scattering is not one number can neither be cleared nor become turbid.
    """
    if scene.follower is None:
        scene = scene.model_copy(update={"follower": scene.follower_here})
    if believes:
        scene = scene.with_values({"follower.mission.believes": believes})
    mission = scene.follower_here.mission
    if mission.believes == "clear":
        others = [name for name in BELIEFS if name != "clear"]
        refuse_several(
            scene, where="follower.mission.believes", found='believes = "clear"',
            rule=f"clear water is this water with scattering_per_m = {CLEAR_PER_M:g}, its only scattering",
            otherwise=f"; or believe {', '.join(others[:-1])} or {others[-1]}",
        )  # fmt: skip
    if mission.turbid_factor != 1:
        refuse_several(
            scene, where="follower.mission.turbid_factor", found=f"turbid_factor = {mission.turbid_factor:g}",
            rule="it multiplies water.scattering_per_m, the only scattering",
            otherwise="; or set turbid_factor = 1",
        )  # fmt: skip
    return scene


def _listed(values: Array) -> list[list[float | None]]:
    return [[finite(round(float(v), 6)) for v in row] for row in values]
