"""What the page shows now, and how it came there: states, undo, redo, snapshots."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

from lightfield.errors import UsageError

#: States to go back to, and snapshots, at most. Chosen.
MOST_STATES, MOST_SNAPSHOTS = 200, 50


@dataclass(frozen=True)
class State:
    """Effects that are on, and values of all parameters.

    Parameters
    ----------
    effects : tuple of str
        "effect:form", in the order in which they were switched on.
    values : mapping
        By path; effects that are off keep theirs, which do not count.
    did : str
        What led here, for people.
    """

    effects: tuple[str, ...]
    values: Mapping[str, float]
    did: str = "start"


@dataclass
class History:
    """States in order, the one that is shown, and those that were given a name."""

    states: list[State]
    at: int = 0
    snapshots: dict[str, State] = field(default_factory=dict)

    @property
    def now(self) -> State:
        """The state that is shown."""
        return self.states[self.at]

    def brighter(self, gains: Collection[str], times: float) -> History:
        """The same where readings are so many times as bright, by their gains."""

        def of(state: State) -> State:
            values = {path: v * times if path in gains else v for path, v in state.values.items()}
            return replace(state, values=values)

        named = {name: of(state) for name, state in self.snapshots.items()}
        return History(list(map(of, self.states)), self.at, named)

    def add(self, state: State) -> None:
        """Go on to a state; what was undone is forgotten."""
        kept = [*self.states[: self.at + 1], state]
        self.states = kept[-MOST_STATES:]
        self.at = len(self.states) - 1

    def step(self, by: int) -> None:
        """Undo (-1) or redo (+1), as far as there is something."""
        self.at = min(max(self.at + by, 0), len(self.states) - 1)

    def keep(self, name: str) -> None:
        """Give the state that is shown a name.

        Raises
        ------
        UsageError
            Too many have one.
        """
        if name not in self.snapshots and len(self.snapshots) >= MOST_SNAPSHOTS:
            raise UsageError(
                "too many snapshots", found=len(self.snapshots), rule=f"at most {MOST_SNAPSHOTS}",
                remedy="use a name again",
            )  # fmt: skip
        self.snapshots[name] = self.now

    def back_to(self, name: str) -> None:
        """Go on to a state that has a name.

        Raises
        ------
        UsageError
            None has this one.
        """
        if name not in self.snapshots:
            raise UsageError("no such snapshot", found=name, rule=f"one of {', '.join(self.snapshots)}")
        self.add(replace(self.snapshots[name], did=f"snapshot {name}"))
