"""How sure an effect is: one that was found, and one that readings not yet taken would show."""

from __future__ import annotations

from lightfield.wording import Word


class _Level(Word):
    @property
    def is_claimed(self) -> bool:
        """Is it the answer, or the simplest one?"""
        return self in (Certainty.CERTAIN, Certainty.SIMPLEST)


class Certainty(_Level):
    """How sure an effect of the best set is; the surest first where nothing stays unexplained."""

    CERTAIN = "certain"
    SIMPLEST = "simplest"
    ONE_OF = "one of"
    PARTIAL = "partial"


class Outlook(_Level):
    """How much a diagnosis would know of an effect; of the first two what `Certainty` says of one found."""

    CERTAIN = Certainty.CERTAIN.value
    SIMPLEST = Certainty.SIMPLEST.value
    PERHAPS = "perhaps"
    NO = "no"
    NOT_SEEN = "not seen"
