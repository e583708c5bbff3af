"""One exploration: what every request does to it. No server and no browser are known here."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from lightfield.errors import FitError, UsageError
from lightfield.explorer import protocol
from lightfield.explorer.beside import EndedError, Tell, elsewhere, silent
from lightfield.explorer.described import effects_in_words, experiment_data, state_data, unfitted
from lightfield.explorer.dropped import dropped
from lightfield.explorer.evaluation import Evaluation, Evaluator
from lightfield.explorer.experiment import Experiment, all_lit, candidate_of, explored
from lightfield.explorer.fits import Fits, Fitted
from lightfield.explorer.state import History, State
from lightfield.fitting.diffuse_light import DiffuseSource, remembered
from lightfield.fitting.effects.registry import effect_name
from lightfield.fitting.parameter import FitParameter
from lightfield.memory import Latest
from lightfield.readings import Readings
from lightfield.render.diffuse.directed import Keeper
from lightfield.render.diffuse.source import response_for
from lightfield.scene import Scene
from lightfield.scene.listed import OWN_FIELD
from lightfield.scene.tank import OPENS_THE_TOP
from lightfield.wording import plain

#: Errors with one effect more or less that are kept: of some sixty effects beside the last sets.
_SURVEYED = 4096


@dataclass
class Session:
    """An exploration.

    Parameters
    ----------
    diffuse : "trace", None or callable
        As `explored` takes it.

    Attributes
    ----------
    verdict : mapping, optional
        Of the last diagnosis, as the page shows it.
    report, comparison : str, optional
        Report of the last diagnosis, and of what was shown when one was asked for; HTML.
    say : callable
        Follows what takes a while; what it raises ends that.
    maps_ready : bool
        The light of the maps was traced, and does not keep anybody waiting.
    """

    scene: Scene
    readings: Readings | None = None
    diffuse: DiffuseSource | str | None = "trace"
    dense_per_m: float | None = None
    verdict: Mapping[str, Any] | None = None
    report: str | None = None
    comparison: str | None = None
    say: Tell = silent
    maps_ready: bool = False
    plane: int = 0
    channel: int = 0
    history: History = field(default_factory=lambda: History([State((), {})]))
    survey: dict[tuple[tuple[str, ...], str], float] = field(default_factory=lambda: Latest(_SURVEYED))
    experiment: Experiment = field(init=False)
    fits: Fits = field(init=False)
    evaluator: Evaluator = field(init=False)
    _source: DiffuseSource | None = None
    _before: State | None = None
    _dragged: State = field(default_factory=lambda: State((), {}))

    def __post_init__(self) -> None:
        # One memory of traces for all experiments with these scene and places. What is traced is traced in
        # another process: Mitsuba and its tallies would stay in this one's memory.
        given, beside = self.diffuse, Keeper(elsewhere=self._elsewhere)
        if given == "trace":
            given = partial(response_for, keeper=beside)
        if self._source is None:  # a session that follows another has the other's
            self._source = remembered(None if isinstance(given, str) else given)

    def _elsewhere(self, work: Callable[..., None]) -> None:
        elsewhere(self.say)(work)

    def begin(self, history: History | None = None) -> None:
        """Make the model; from a former history where it fits.

        Raises
        ------
        LightfieldError
            As `explored`.
        """
        experiment = explored(self.scene, self.readings, self._source, self.dense_per_m, self.say)
        self.experiment, self.fits = experiment, Fits(experiment)
        self.evaluator = Evaluator(self.fits)
        self.survey = Latest(_SURVEYED)
        self.plane, self.channel = len(experiment.places.z_m) // 2, 0
        self.maps_ready = not experiment.has_data or self._source is None
        first, former = self._first(), history or History([])
        kept = [s for s in former.states if self._suits(s)]
        at = sum(map(self._suits, former.states[: former.at + 1])) - 1
        names_kept = {n: s for n, s in former.snapshots.items() if self._suits(s)}
        self.history = History(kept or [first], max(at, 0), names_kept)

    def _anew(self, history: History | None = None, **given: Any) -> Session:
        """This session with another scene, readings or traces, begun aside: nothing has changed here."""
        other = replace(self, **given)
        other.begin(history)
        return other

    def _become(self, other: Session) -> None:
        """At once and whole: nobody meets the scene of one and the model of the other."""
        vars(self).update(vars(other))  # in one step, which a field after the other would not be

    def trace_at(self, dense_per_m: float) -> None:
        """Make the model again, with a trace in water that scatters so much too.

        Raises
        ------
        LightfieldError
            As `explored`; nothing has changed then.
        """
        self._settle()
        other, old = self._anew(self.history, dense_per_m=dense_per_m), self.experiment.gain
        if old and (new := other.experiment.gain):  # the render, which stands for readings, is another
            other.history = other.history.brighter(other.experiment.forward.gains.names, new / old)
        self._become(other)

    def _first(self) -> State:
        e = self.experiment
        base = self.fits.of(())
        if e.gain is not None:
            own = (p for key in e.switched_on for p in e.candidates[key].parameters)
            # A fit may start elsewhere than where the scene is.
            known = {
                p.path: e.parameters[p.path].value for p in (*e.problem.base, *own) if p.path in e.parameters
            }
            known |= dict.fromkeys(e.forward.gains.names, e.gain)
            return State(e.switched_on, known | dict(e.stated), "the scene as it stands")
        if not e.switched_on:
            return State((), dict(base.values), "fit of gain, width and absorption")
        fitted = self.fits.base(e.switched_on, e.stated)
        return State(
            e.switched_on, dict(fitted.values), "the scene's effects, gain, width and absorption fitted"
        )

    def _suits(self, state: State) -> bool:
        base = {p.path for p in self.experiment.problem.base}
        known = set(state.effects) <= self.experiment.candidates.keys() and base <= state.values.keys()
        needed = [p.path for k in state.effects if known for p in self.experiment.candidates[k].parameters]
        return known and set(needed) <= state.values.keys()

    # -- what is asked for ---------------------------------------------------------------------

    @property
    def now(self) -> State:
        """The state that is shown."""
        return self.history.now if self._before is None else self._dragged

    def act(self, request: protocol.Request) -> None:
        """Do what a request asks for; jobs and views of the server's own are not done here.

        Raises
        ------
        LightfieldError
            It cannot be done; nothing has changed then.
        """
        match request:
            case protocol.View(plane=plane, channel=channel):
                self.plane = min(plane, len(self.experiment.places.z_m) - 1)
                self.channel = min(channel, len(self.experiment.maps) - 1)
            case protocol.Set(values=values, done=done):
                self._set(values, done)
            case protocol.Switch(effect=effect, on=on):
                self._switch(effect, on)
            case protocol.Named(do="keep", name=name):
                self.history.keep(name)
            case protocol.Named(name=name):
                self._settle()
                self.history.back_to(name)
            case protocol.At(do=do, at=at):
                self._settle()
                self._go(do, at)
            case protocol.Own():
                self._add_own(request)
            case protocol.Plain(do="undo"):
                self._settle()
                self.history.step(-1)
            case protocol.Plain(do="redo"):
                self._settle()
                self.history.step(1)
            case protocol.Plain(do="fit"):
                self._settle()
                self._fit()
            case _:
                raise UsageError("this is not done by a session", found=request.do)

    def _set(self, values: Mapping[str, float], done: bool) -> None:
        now = self.now
        known = self.parameters()
        for path, value in values.items():
            if path not in known:
                raise UsageError("no such parameter here", found=path, remedy="switch its effect on first")
            p = known[path]
            u = p.coordinate_of(value) if p.coordinate != "log" or value > 0 else p.low - 1
            room = 1e-6 * (p.high - p.low)
            if not p.low - room <= u <= p.high + room:
                ends = sorted((p.value(p.low), p.value(p.high)))
                raise UsageError(
                    "this value is out of range",
                    where=path,
                    found=value,
                    rule=f"{ends[0] + 0.0:.4g} to {ends[1] + 0.0:.4g}",
                )
        self._dragged = replace(now, values={**now.values, **values}, did=f"{', '.join(values)} by hand")
        self._before = self._before or self.history.now
        if done:
            self._settle()

    def _settle(self) -> None:
        """What was dragged becomes a state."""
        if self._before is not None:
            self._before = None
            if self._dragged.values != self.history.now.values:
                self.history.add(self._dragged)

    def _switch(self, key: str, on: bool) -> None:
        name = candidate_of(self.experiment, key).name
        self._settle()
        if on == (key in self.now.effects):
            return
        others = tuple(k for k in self.now.effects if effect_name(k) != name)
        effects = (*others, key) if on else others
        word = f"{plain(name)} {'on' if on else 'off'}"
        if not self.experiment.has_data:
            # Against the render nothing is fitted: what the scene has is worth what it costs to leave it out.
            self.fits.explanation(effects)
            values = self._usual(key) | dict(self.now.values)
            self.history.add(State(effects, values, word))
            return
        self._rungs(effects)
        fitted = self._fitted(effects)
        self.history.add(State(effects, {**self.now.values, **fitted.values}, f"{word}, fitted"))

    def _usual(self, key: str) -> dict[str, float]:
        """Values of an effect that was never on: the scene's, or a size worth asking about."""
        one, stated = self.experiment.candidates[key], self.experiment.stated
        sized = zip(one.amplitudes, one.typical, strict=True)
        values = {p.path: p.value(min(p.start + typical, p.high)) for p, typical in sized}
        values |= {p.path: p.value(p.start) for p in one.shapes}
        return {path: stated.get(path, value) for path, value in values.items()}

    def _fit(self) -> None:
        if self.experiment.has_data:
            self._rungs(self.now.effects)
        near = self._fitted(self.now.effects, self.now.values)
        self.history.add(replace(self.now, values={**self.now.values, **near.values}, did="fitted"))

    def _rungs(self, effects: tuple[str, ...]) -> None:
        self.fits.explanation(effects)
        for k in range(len(effects)):
            self._fitted(effects[:k])

    def _fitted(self, effects: tuple[str, ...], near: Mapping[str, float] | None = None) -> Fitted:
        """A fit that says how far it is."""
        stage = f"fitting {effects_in_words(effects) or 'gain, width and absorption'}"
        return self.fits.of(effects, near, lambda part: self.say(stage, part))

    def _go(self, do: str, at: int) -> None:
        if do == "state":
            self.history.at = min(at, len(self.history.states) - 1)
        elif do == "rung":
            effects = self.now.effects[:at]
            fitted = self._fitted(effects).values if self.experiment.has_data else {}
            rung = effects_in_words(effects[-1:]) or "base"
            self.history.add(State(effects, {**self.now.values, **fitted}, f"rung {rung}"))
        else:
            self.accept(at)

    def accept(self, at: int) -> None:
        """Take over an explanation of the verdict.

        Raises
        ------
        FitError
            There is no such explanation.
        """
        offered = list(self.verdict["explanations"]) if self.verdict else []
        if at >= len(offered):
            raise FitError("there is no such explanation", found=at, remedy="diagnose first")
        one = offered[at]
        effects = self.experiment.beside_own(one["keys"])
        self._rungs(effects)
        self._fitted(effects)
        fitted = self._fitted(effects, {**self.now.values, **one["values"]})
        did = f"accepted: {effects_in_words(one['keys'])}"
        self.history.add(State(effects, {**self.now.values, **fitted.values}, did))

    def _add_own(self, own: protocol.Own) -> None:
        parameters = {
            p.name: {"unit": p.unit, "range": [p.low, p.high]}
            | ({} if p.neutral is None else {"neutral": p.neutral})
            for p in own.parameters
        }
        table = {"name": own.name, "stage": own.stage, "formula": own.formula, "parameters": parameters}
        scene = Scene.from_dict(
            {**self.scene.to_dict(), OWN_FIELD: [*self.scene.to_dict().get(OWN_FIELD, []), table]}
        )
        self._settle()
        other = self._anew(self.history, scene=scene)
        other._switch(next(k for k, c in other.experiment.candidates.items() if c.name == own.name), True)
        self._become(other)

    def drop(self, files: Sequence[protocol.File], units: str = "") -> None:
        """Explore other readings: a reading table, or an index with the spectrometer files that it names.

        Raises
        ------
        LightfieldError
            They cannot be read, or do not belong to the scene; nothing has changed then.
        """
        readings = dropped(files, units, self.scene)
        self._settle()
        self._become(self._anew(readings=readings, verdict=None, report=None, comparison=None))

    def parameters(self) -> dict[str, FitParameter]:
        """What may be set now, by path."""
        e = self.experiment
        chosen = [e.candidates[key] for key in self.now.effects]
        return {p.path: p for p in (*e.problem.base, *(p for c in chosen for p in c.parameters))}

    # -- what is shown -------------------------------------------------------------------------

    def evaluation(self) -> Evaluation:
        """Numbers and arrays of the state that is shown."""
        return self.evaluator.of(self.now, self.plane, self.channel, self.maps_ready)

    def ready_maps(self) -> None:
        """Fetch what the maps need, which takes seconds the first time; may be done beside all else.

        But for light under a water surface that the scene has not: that is as large again, and is fetched
        when the surface is switched on.
        """
        e = self.experiment
        lit = {path: v for path, v in all_lit(e).items() if path in e.stated or path != OPENS_THE_TOP}
        e.maps[0].predict({p.path: p.value(p.start) for p in e.problem.base} | lit)

    def experiment_data(self) -> dict[str, object]:
        """What does not change while one experiment is explored."""
        return experiment_data(self.experiment, self.fits)

    def state_data(self) -> dict[str, Any]:
        """Effects, parameters, ladder and history."""
        here = {key: error for (effects, key), error in self.survey.items() if effects == self.now.effects}
        history = self.history
        return state_data(self.fits, self.now, here) | {
            "history": [s.did for s in history.states],
            "at": history.at,
            "can_undo": history.at > 0,
            "can_redo": history.at < len(history.states) - 1,
            "snapshots": list(history.snapshots),
            "plane": self.plane,
            "channel": self.channel,
            "verdict": self.verdict,
            "compared": self.comparison is not None,
        }

    def survey_next(self, ends: Callable[[], None] = lambda: None) -> bool:
        """Work out, for one effect more, the error with it switched the other way; was any left?

        Raises
        ------
        EndedError
            Somebody ended it, as `ends` may: what it was at is still left.
        LightfieldError
            What it was at cannot be worked out, and is not tried again.
        """
        on = self.now.effects
        for effect in self.state_data()["effects"]:
            if (on, effect["key"]) not in self.survey:
                self._survey(on, effect["key"], effect["on"], ends)
                return True
        return False

    def _survey(self, on: tuple[str, ...], key: str, is_on: bool, ends: Callable[[], None]) -> None:
        self.survey[on, key] = float("nan")  # stays where there is no number, and nobody ended the search
        turned = tuple(k for k in on if k != key) if is_on else (*on, key)
        try:
            if self.experiment.has_data:
                self.survey[on, key] = self.fits.of(turned, ends=ends).score.error_percent
            elif is_on:
                self.survey[on, key] = unfitted(self.fits, turned, self.now.values).error_percent
        except FitError:
            pass  # these effects cannot be fitted together here
        except EndedError:
            del self.survey[on, key]
            raise
