"""What is asked of readings, and what is known of them at any time of a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.untestable import Hindrance, Untestable
from lightfield.diagnosis.search.better_light.settled import settled
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.many import beyond_two, levelled
from lightfield.diagnosis.search.pool.any_number import Data, Ends, never
from lightfield.diagnosis.search.preparation import Prepared
from lightfield.diagnosis.search.search_progress import Progress
from lightfield.diagnosis.verdict.trust import Trust, says_nothing, trust_of
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.fitting.effects import Effect
from lightfield.readings import Readings
from lightfield.scene import Scene


@dataclass(frozen=True)
class Inquiry:
    """What is asked of readings.

    Parameters
    ----------
    scene : Scene
        What the experimenter believes.
    source, without_diffuse
        What gives scattered and reflected light, or why nothing does.
    effects : sequence of Effect
        That are considered.
    is_settled_after : bool
        Light is traced by the renderer: what is found is settled with light traced for it.
    alpha : float
        Family-wise false-alarm probability of the test of the base model.
    seed : int
        Of the bootstrap, and of the traces that scattered light is settled with.
    progress : Progress
        Told what begins, and the best set so far.
    asked : sequence of str
        Names of `effects`, where not all that are known were asked for.
    """

    readings: Readings
    scene: Scene
    source: DiffuseSource | None
    without_diffuse: Hindrance | None
    effects: Sequence[Effect]
    is_settled_after: bool
    alpha: float
    seed: int
    progress: Progress
    asked: Sequence[str] = ()


@dataclass(frozen=True)
class Knowledge:
    """What is known of the readings so far.

    Parameters
    ----------
    problem : Problem
        As the table poses it, with the gain in its range.
    untestable : dict
        Effects that cannot be tested here, with reasons.
    data : Data
        Every usable reading, with every candidate.
    prepared, finding
        Noise and outliers; what was found.
    rng : Generator
        Of the bootstrap, as far as it was used.
    is_settled : bool
        The finding rests on light traced for it.
    """

    inquiry: Inquiry
    problem: Problem
    untestable: Untestable
    data: Data
    prepared: Prepared
    finding: SearchResult
    rng: np.random.Generator
    is_settled: bool = False

    def now(self, prepared: Prepared, finding: SearchResult) -> Knowledge:
        """The same with another finding, and the noise that it was judged beside."""
        return replace(self, prepared=prepared, finding=finding)

    def in_its_light(self) -> Knowledge:
        """The same with every usable reading in the light that the finding rests on."""
        problem = replace(self.data.problem, forward=self.prepared.problem.forward)
        return replace(self, data=replace(self.data, problem=problem))

    def levelled(self) -> Knowledge:
        """The same with how sure each of one or two effects is."""
        return self.now(self.prepared, levelled(self.data, self.prepared, self.finding))

    def with_more_effects(self, ends: Ends = never) -> Knowledge:
        """What any number of effects explain, unless nothing would be believed."""
        if says_nothing(self.prepared, self.finding):
            return self
        asked, now = self.inquiry, (self.data, self.prepared, self.finding)
        return self.now(*beyond_two(*now, asked.alpha, asked.seed, asked.progress, ends))

    def in_traced_light(self) -> Knowledge:
        """What was found, in light traced for it."""
        asked, now = self.inquiry, (self.data, self.prepared, self.finding)
        return self.now(*settled(*now, self.rng, asked.alpha, asked.progress, asked.seed))

    def trust(self, rng: np.random.Generator) -> Trust:
        """How far the finding may be believed."""
        return trust_of(self.prepared, self.finding, np.asarray(self.inquiry.readings.saturated, bool), rng)
