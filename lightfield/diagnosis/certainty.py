"""How sure an effect is: one that was found, and one that readings not yet taken would show."""

from __future__ import annotations

from lightfield.wording import Word

#: Relative evidence that makes one of several accepted explanations the answer: odds of 19, where evidence
#: begins to be called strong (20; Kass and Raftery 1995, doi:10.1080/01621459.1995.10476572).
CONVINCING = 0.95


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
