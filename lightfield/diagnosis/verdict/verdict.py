"""The verdict of a diagnosis: what `lightfield diagnose --json` writes, with its JSON Schema."""

from __future__ import annotations

from typing import Any

from pydantic import computed_field

from lightfield.diagnosis.problem.untestable import in_words
from lightfield.diagnosis.verdict.verdict_data import VerdictData
from lightfield.diagnosis.verdict.words.doubt import doubt
from lightfield.diagnosis.verdict.words.effects import unnamed_sentences
from lightfield.diagnosis.verdict.words.headline import words_of


class Verdict(VerdictData):
    """Everything a diagnosis says: data, and the words that follow from it."""

    @computed_field(description="the verdict in words")
    @property
    def sentence(self) -> str:
        return words_of(self).sentence

    @computed_field(description="what was found, alone")
    @property
    def headline(self) -> str:
        return words_of(self).headline

    @computed_field(description="how sure that is, and what took no part, apart from the headline")
    @property
    def support(self) -> list[str]:
        return list(words_of(self).support)

    @computed_field(description="why nothing is named or ruled out whatever was found")
    @property
    def doubt(self) -> str | None:
        return None if self.reason_to_doubt is None else doubt(self.reason_to_doubt, self.asked)

    @computed_field(description="`hindrances` in words")
    @property
    def untestable(self) -> dict[str, str]:
        return {name: in_words(why) for name, why in self.hindrances.items()}

    @computed_field(description="`assumptions` in words")
    @property
    def assumed(self) -> list[str]:
        return [str(one) for one in self.assumptions]

    @computed_field(description="those of `warnings` that speak of a mistake")
    @property
    def check_first(self) -> list[str]:
        return [one.sentence for one in self.cautions if one.speaks_of_a_mistake]

    @computed_field(description="`cautions` and `unnamed` in words")
    @property
    def warnings(self) -> list[str]:
        best = self.explanations[0].parameters if self.explanations else {}
        return [*(one.sentence for one in self.cautions), *unnamed_sentences(self.unnamed, best)]


def json_schema() -> dict[str, Any]:
    """JSON Schema (2020-12) of the verdict."""
    return Verdict.model_json_schema(mode="serialization")
