"""What a diagnosis would know of several effects that act at once: as data and in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

from lightfield.diagnosis.certainty import Outlook
from lightfield.diagnosis.problem.assumed import Assumed
from lightfield.diagnosis.search.pool.evidence import NAMED_GAP
from lightfield.diagnosis.verdict.speech import in_unit, join
from lightfield.fitting.curves import field_of, is_amplitude

#: Chances from which on an effect "would be certain", and up to which it would not. Chosen.
LIKELY, _UNLIKELY = 0.9, 0.1
#: Amplitudes of a curve that are told one by one, at most. Chosen: words alone.
_LONG = 5
HEAD = ("effect", "sigma", "gap", "certain", "named", "why", "at which size")
ABOUT = (
    "sigma: by how much the others, refitted, are worse without it. gap: what the best set without it costs",
    f"more, in chi-square: {NAMED_GAP:g} beyond its noise, and it is named. certain, named: the chance",
    "that it would be certain; that it would be certain or the simplest explanation.",
)
_CURVES = (
    "Sizes of a curve are amplitudes of its functions, as rms of the logarithm of light, the finest last.",
    "It is one curve of many: another one may leave less to know of the others.",
)


@dataclass(frozen=True)
class Expected:
    """What a diagnosis would know of one of the effects.

    Parameters
    ----------
    values : mapping
        Scene parameters at the size that was asked about.
    sigma : float
        By how much the others, refitted, are worse without it.
    gap : float
        Cost of the best set without it above that of those effects that are worth their price, without noise.
    certain, named : float
        Chances, under noise of the stated size, that it would be certain; and that it would be that or the
        simplest explanation, which only sets of more parameters do without.
    rival : tuple of str
        The set without it that stands most in its way.
    another_lamp : bool
        A lamp whose beam has another shape would do what it and others do, so that it is never certain.
    """

    effect: str
    values: Mapping[str, float]
    sigma: float
    gap: float
    certain: float
    named: float
    rival: tuple[str, ...]
    another_lamp: bool = False

    @property
    def level(self) -> Outlook:
        """How much; "no": other effects do as well."""
        if self.certain >= LIKELY:
            return Outlook.CERTAIN
        if self.named >= LIKELY:
            return Outlook.SIMPLEST
        if self.gap <= 0:
            return Outlook.NOT_SEEN
        return Outlook.PERHAPS if self.named > _UNLIKELY else Outlook.NO

    def in_words(self, whole: Sequence[str]) -> str:
        """Would it be certain, and what stands in the way?"""
        others = [name for name in self.rival if name not in whole]
        if self.level == Outlook.SIMPLEST and self.another_lamp:
            return "the simplest explanation; a lamp of another shape would do as well"
        how = f"{join(others)} in its place" if others else "the others without it"
        instead = f"not named: {how} would do as well"
        return {
            Outlook.CERTAIN: "certain",
            Outlook.SIMPLEST: f"the simplest explanation; {how} would do as well",
            Outlook.PERHAPS: f"perhaps named; {how} comes near",
            Outlook.NO: instead,
            Outlook.NOT_SEEN: instead if others else "not seen beside the others",
        }[self.level]


@dataclass(frozen=True)
class Together:
    """What a layout tells of several effects that act at once.

    Parameters
    ----------
    expected : list of Expected
        In the order asked for.
    """

    expected: list[Expected]
    readings: int
    units: Mapping[str, str]
    assumed: tuple[Assumed, ...]

    def of_level(self, *levels: Outlook) -> list[str]:
        """Effects that would be known so well."""
        return [one.effect for one in self.expected if one.level in levels]

    @property
    def headline(self) -> str:
        """The answer."""
        parts = (
            ("would be certain", self.of_level(Outlook.CERTAIN)),
            ("would be the simplest explanation", self.of_level(Outlook.SIMPLEST)),
            ("would perhaps be named", self.of_level(Outlook.PERHAPS)),
            ("would not be named", self.of_level(Outlook.NO, Outlook.NOT_SEEN)),
        )
        told = [f"{join(names)} {words}" for words, names in parts if names]
        return f"With these {self.readings} readings {'; '.join(told)}."

    @property
    def about_curves(self) -> tuple[str, ...]:
        """What a reader has to know of the curves that were asked about."""
        curved = any(is_amplitude(path) for one in self.expected for path in one.values)
        return _CURVES if curved else ()

    def sizes(self, one: Expected) -> str:
        """Parameters with units; of a long curve the first three amplitudes and the last."""
        told = []
        for field, paths in groupby(one.values, field_of):
            every = list(paths)
            values = [f"{one.values[path]:.3g}" for path in every]
            if len(every) > _LONG:
                values[3:-1] = ["..."]
            what = f"{every[0]} to {every[-1].removeprefix(field)}" if len(every) > 1 else every[0]
            told.append(in_unit(f"{what} = {', '.join(values)}", self.units.get(every[0], "1")))
        return ", ".join(told)

    def rows(self) -> list[tuple[str, ...]]:
        """Effect, sigma, gap, chances of certain and of named in per cent, why, size; one line for each."""
        whole = [one.effect for one in self.expected]
        return [
            (
                one.effect, f"{one.sigma:.1f}", f"{round(one.gap, 1) + 0.0:.1f}",  # 0.0, not -0.0
                f"{100 * one.certain:.0f} %", f"{100 * one.named:.0f} %",
                one.in_words(whole), self.sizes(one),
            )
            for one in self.expected
        ]  # fmt: skip

    def as_text(self) -> str:
        """For people, several lines."""
        lines = [self.headline, ""]
        for row in (HEAD, *self.rows()):
            lines.append("{:<20} {:>7} {:>9} {:>8} {:>7}  {}; {}".format(*row))
        return "\n".join([*lines, "", *ABOUT, *self.about_curves, *(f"assumed: {a}" for a in self.assumed)])

    def as_data(self) -> dict[str, object]:
        """The same as plain data."""
        whole = [one.effect for one in self.expected]
        return {
            "readings": self.readings,
            "certain": self.of_level(Outlook.CERTAIN),
            "simplest": self.of_level(Outlook.SIMPLEST),
            "effects": [
                {
                    "effect": one.effect,
                    "values": dict(one.values),
                    "units": {path: self.units.get(path, "1") for path in one.values},
                    "sigma_to_remove": one.sigma,
                    "gap": one.gap,
                    "chance_of_certain": one.certain,
                    "chance_of_certain_or_simplest": one.named,
                    "level": one.level.value,
                    "set_without": list(one.rival),
                    "in_words": one.in_words(whole),
                }
                for one in self.expected
            ],
            "assumed": [str(a) for a in self.assumed],
            "assumptions": [a.as_data() for a in self.assumed],
        }
