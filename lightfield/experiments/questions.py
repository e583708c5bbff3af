"""What has to be asked about a tank of one's own, and how numbers in the answers are read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lightfield.errors import UsageError


@dataclass(frozen=True)
class Question:
    """Something that the scene has to know.

    Parameters
    ----------
    text : str
        The question.
    form : str
        How the answer is written.
    default : str
        What is taken where nobody answers; "" for what follows from the other answers.
    """

    name: str
    text: str
    form: str
    default: str


# fmt: off
QUESTIONS = (
    Question(
        "tank", "Width, depth and length of the water, m",
        "WxDxL, the beam runs along L; or none for open water", "2x1x6",
    ),
    Question("lamp_depth", "Lamp below the surface, m", "a number; half the depth if not given", ""),
    Question(
        "walls", "Part of the light that walls and floor send back",
        "0 to 1: black cloth 0.02, dark paint 0.1, white tiles 0.7", "0.1",
    ),
    Question(
        "panes", "Are walls bare glass with air behind",
        "no, all (sides, floor and ends), or sides (of a flume)", "no",
    ),
    Question("surface", "Is there a free water surface above", "yes or no", "yes"),
    Question(
        "lamp", "Spectrum of the lamp",
        "a name such as led-green, or PEAK/WIDTH in nm, or several such with + between", "led-green",
    ),
    Question("beam", "Half width of the beam at half maximum, degrees", "a number", "10"),
    Question("power", "Light of the lamp, W (not the electrical power)", "a number", "10"),
    Question("water", "Water", "A,B: absorption and scattering in 1/m, pure, or a preset", "0.1,0"),
    Question("quantity", "What the detector reads", "irradiance, scalar_irradiance, radiance", "irradiance"),
    Question("band", "Wavelengths that it sees, nm", "LOW:HIGH, or several with commas between", ""),
    Question("planes", "Distances from the lamp to read at, m", "Z,Z,...", ""),
    Question("points", "Readings at each distance, across the beam", "a whole number, 1 to 201", "11"),
)
# fmt: on


def typed_number(text: str, where: str) -> str:
    """A number as it was written."""
    typed_numbers(text, where, None)
    return text.strip()


def typed_numbers(text: str, where: str, separator: str | None, *, whole: bool = False) -> list[float]:
    """Numbers between separators.

    Raises
    ------
    UsageError
        Something else.
    """
    try:
        parts = [text] if separator is None else text.split(separator)
        found = [float(int(part) if whole else float(part)) for part in parts]
        if not np.isfinite(found).all():
            raise ValueError
    except ValueError:
        rule = next(q.form for q in QUESTIONS if q.name == where)
        remedy = f"write numbers with {separator!r} between" if separator else "write a number"
        raise UsageError("not understood", where=where, found=text, rule=rule, remedy=remedy) from None
    return found
