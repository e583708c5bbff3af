"""What a study of attenuation assumed or left out: a record, and its words."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any


class Studied(str, Enum):
    """What became of readings or of a part of the study; stable names, for programs."""

    STDERR_FROM_REPEATS = "stderr_from_repeats"
    STDERR_ASSUMED = "stderr_assumed"
    GAIN_ASSUMED = "gain_assumed"
    SHARED_FROM_SCATTER = "shared_from_scatter"
    FAINT = "faint"
    NEGATIVE = "negative"
    NOT_IN_AIR = "not_in_air"
    FEW_DISTANCES = "few_distances"
    BANDS = "bands"
    NOT_TRACED = "not_traced"
    FEW_COLOURS = "few_colours"
    NO_CONSTITUENTS = "no_constituents"
    GROWS = "grows"
    DARK_LEFT = "dark_left"
    READOUT_LEFT = "readout_left"
    SET_ASIDE = "set_aside"
    BESIDE_BEAM = "beside_beam"


@dataclass(frozen=True)
class Remark:
    """One thing that was assumed or left out.

    Parameters
    ----------
    count, among : int, optional
        Readings, pairs or wavelengths that it is about, and of how many.
    limit : float, optional
        Which they miss.
    percent : float, optional
        The error that was taken.
    first : str, optional
        Where the first of them was read.
    why : str, optional
        The error that ended a part of the study; what of the scene was left in the readings.
    """

    studied: Studied
    count: int | None = None
    among: int | None = None
    limit: float | None = None
    percent: float | None = None
    first: str | None = None
    why: str | None = None

    def __str__(self) -> str:
        return _WORDS[self.studied].format(**vars(self))

    def as_data(self) -> dict[str, Any]:
        """The record for programs: what it does not have is left out."""
        return {name: value for name, value in asdict(self).items() if value is not None}


_WORDS = {
    Studied.STDERR_FROM_REPEATS: "{count} readings without stderr: {percent:.2g} % from their repeats",
    Studied.STDERR_ASSUMED: "{count} readings without stderr: {percent:g} % assumed",
    Studied.GAIN_ASSUMED: "plane_gain_percent = {percent:.2g} assumed for every stay at a distance",
    Studied.SHARED_FROM_SCATTER: "the bands of a place scatter less about each other than their standard "
    "errors say, and the table does not state common_percent: {percent:.2g} % is taken for an error that all "
    "bands of a place share",
    Studied.FAINT: "{count} of {among} pairs are fainter than {limit:g} of their errors, the first at "
    "{first}: left out",
    Studied.NEGATIVE: "{count} of {among} pairs have a reading below zero by more than {limit:g} of its "
    "errors, which no light is, the first at {first}: left out; is it their sign, or a dark signal taken off "
    "twice?",
    Studied.NOT_IN_AIR: "{count} readings in water have none in air at their place and wavelength, the first "
    "at {first}: left out",
    Studied.FEW_DISTANCES: "{count} wavelengths were not read at {limit:g} distances: left out",
    Studied.BANDS: "{count} of {among} wavelengths stand for bands (up to {limit:g} nm wide): constituents "
    "are looked for in means over them, weighed by the scene's lamp and detector. K of a band falls with "
    "distance, as what is dimmed most is gone first: by pure water alone it lies up to {percent:.2g} % below "
    "the band's mean attenuation here",
    Studied.NOT_TRACED: "scattered light could not be traced: {why}",
    Studied.FEW_COLOURS: "constituents need {limit:g} wavelengths",
    Studied.GROWS: "at {count} of {among} wavelengths light in water grows with distance against its "
    "reference (K below zero by more than {limit:g} of its errors), which no water does: are water and air "
    "exchanged in the column medium, or distances?",
    Studied.DARK_LEFT: "`import` found dark spectra missing, or with the lamp's light in them: a dark signal "
    "that is left in the readings makes K too small far away",
    Studied.READOUT_LEFT: "{why} of the scene is not taken out of the readings: K is off by what it does to "
    "them, and its error does not know of it",
    Studied.SET_ASIDE: "one ratio of readings is left out, without which the others lie on straight lines: "
    "{why}",
    Studied.BESIDE_BEAM: "K is that of the {count} of {among} places nearest to the beam's axis, which lie "
    "on straight lines: those beside it do not, as where scattered light is much of what is read",
    Studied.NO_CONSTITUENTS: "constituents were not looked for: {why}",
}
