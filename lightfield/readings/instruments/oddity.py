"""What is odd about an instrument's file but does not prevent its use: a record, and its words."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Odd(str, Enum):
    """What is odd; stable names, for programs."""

    CUT_LINE = "cut_line"
    MORE_PIXELS = "more_pixels"
    END_UNKNOWN = "end_unknown"
    EXPOSURE_UNKNOWN = "exposure_unknown"
    DAMAGED_FRAMES = "damaged_frames"
    PHOTONS = "photons"
    SPHERE = "sphere"
    NO_CALIBRATION = "no_calibration"
    CALLED_SATURATED = "called_saturated"


@dataclass(frozen=True)
class Oddity:
    """One thing that is odd about a file.

    Parameters
    ----------
    count, announced : int, optional
        Pixels or frames that it is about; how many its header says there are.
    label, why : str, optional
        Of an exposure that is not known: its line in the header, and what is wrong with it.
    """

    odd: Odd
    count: int | None = None
    announced: int | None = None
    label: str | None = None
    why: str | None = None

    def __str__(self) -> str:
        return _WORDS[self.odd].format(**vars(self))


_WORDS = {
    Odd.CUT_LINE: "the file ends within a line; what stands last is not used",
    Odd.MORE_PIXELS: "{count} pixels, though the header says {announced} (spliced from two spectrometers?)",
    Odd.END_UNKNOWN: "no end marker and no number of pixels: whether the file is complete cannot be told",
    Odd.EXPOSURE_UNKNOWN: "the exposure is not known: {label!r} {why}",
    Odd.DAMAGED_FRAMES: "{count} damaged frames are left out",
    Odd.PHOTONS: "it counts photons of 400-700 nm, which the colour of the water changes otherwise than "
    "power",
    Odd.SPHERE: "taken with an integrating sphere: P is not an irradiance",
    Odd.NO_CALIBRATION: "no calibration block",
    Odd.CALLED_SATURATED: "the program calls it saturated",
}
