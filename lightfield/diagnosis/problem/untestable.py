"""Why readings cannot show an effect: a record, and its words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum


class Hinders(str, Enum):
    """What stands in the way of a test."""

    ONE_X = "one x"
    ONE_Y = "one y"
    ON_A_CROSS = "x or y zero"
    ONE_DISTANCE = "one distance"
    ON_AXIS = "on the axis only"
    NO_TIMES = "no times"
    ONE_WAY = "not read to and fro"
    NO_TANK = "no tank"
    NARROW_VIEW = "surface seen in part"
    NO_PANES = "no panes"
    NO_WATER = "none in water"
    NOT_BOTH_MEDIA = "not in air and water"
    FEW_WAVELENGTHS = "fewer than three wavelengths"
    ONE_WAVELENGTH = "one wavelength"
    NO_OVERTONE = "no wavelength twice another"
    RELATIVE = "relative scale"
    ABSOLUTE = "absolute scale"
    TABLE_BEAM = "beam is a table"
    FORMULA_BEAM = "beam is no table"
    ABSORPTION_FREE = "absorption free at every wavelength"
    NOT_TRACED = "not traced"
    LAMP = "light of this lamp cannot be followed"
    MANY_CELLS = "too many cells to trace"
    DIFFUSE = "diffuse light of unknown direction"
    FEW_PLACES = "too few places or times"
    FREE_ALREADY = "free in the base model, or unknown to the scene"
    ABSORBED = "absorbed by the base model"
    ABSORBED_IN_LAYOUT = "absorbed by the base model in this layout"
    NOTHING_THERE = "nothing there that it acts on"
    NO_EFFECT = "no effect of the table"
    NOT_ASKED = "not considered"


@dataclass(frozen=True)
class Hindrance:
    """One reason why an effect cannot be tested.

    Parameters
    ----------
    hinders : Hinders
    profile : str, optional
        The lamp's, where its light cannot be followed.
    cells, most : int, optional
        Of traced light: how many it would take, how many there may be.
    """

    hinders: Hinders
    profile: str | None = None
    cells: int | None = None
    most: int | None = None

    def __str__(self) -> str:
        return _WORDS[self.hinders].format(profile=self.profile, cells=self.cells, most=self.most)


#: Effects that cannot be tested, by name, with all that stands in the way.
Untestable = Mapping[str, tuple[Hindrance, ...]]


def in_words(hindrances: Iterable[Hindrance]) -> str:
    """All that stands in the way of one effect."""
    return "; ".join(map(str, hindrances))


_WORDS = {
    Hinders.ONE_X: "all readings have the same x",
    Hinders.ONE_Y: "all readings have the same y",
    Hinders.ON_A_CROSS: "no reading is off the axis in x and in y at once",
    Hinders.ONE_DISTANCE: "all readings are at one distance",
    Hinders.ON_AXIS: "all readings are on the axis",
    Hinders.NO_TIMES: "the readings carry no times",
    Hinders.ONE_WAY: "needs readings taken on the way, some one way and some the other, with their times",
    Hinders.NO_TANK: "the scene has no [tank]",
    Hinders.NARROW_VIEW: "what this detector sees of the surface is traced, with waves as the scene "
    "states them",
    Hinders.NO_PANES: 'the scene does not say that the tank has panes of glass (tank.panes = "all" or '
    '"sides"; with pane_reflectance = 0 they are looked for)',
    Hinders.NO_WATER: "no reading was taken in water",
    Hinders.NOT_BOTH_MEDIA: "needs readings in air and in water",
    Hinders.FEW_WAVELENGTHS: "needs readings at three wavelengths or more",
    Hinders.ONE_WAVELENGTH: "needs readings at two wavelengths or more",
    Hinders.NO_OVERTONE: "no wavelength is twice another, or more",
    Hinders.RELATIVE: "the readings are on a relative scale",
    Hinders.ABSOLUTE: "the readings are on an absolute scale, where the lamp's spectrum is asked about; say "
    "that they are relative",
    Hinders.FORMULA_BEAM: "the scene's beam is no table; its width is free",
    Hinders.TABLE_BEAM: "the scene's beam is a table, which is no Gaussian; how it differs is beam_profile",
    Hinders.ABSORPTION_FREE: "the absorption is free at every wavelength; give the scene a base water "
    "spectrum",
    Hinders.NOT_TRACED: "scattered and reflected light was not traced",
    Hinders.LAMP: "the scattered light of a lamp that is {profile} cannot be followed",
    Hinders.MANY_CELLS: "scattered and reflected light would have to be traced in {cells} cells around the "
    "readings, of at most {most}",
    Hinders.DIFFUSE: "the scene has diffuse light, whose direction of arrival is not known",
    Hinders.FEW_PLACES: "the readings are at too few different places, times or wavelengths",
    Hinders.FREE_ALREADY: "its parameters are free in the base model, or this scene has none of them",
    Hinders.ABSORBED: "absorbed by gain, beam width and absorption with these readings",
    Hinders.ABSORBED_IN_LAYOUT: "absorbed by gain, beam width and absorption in this layout",
    Hinders.NOTHING_THERE: "changes nothing in this scene, which has none of what it acts on",
    Hinders.NO_EFFECT: "no effect of the table sets it free",
    Hinders.NOT_ASKED: "not among the effects that were considered",
}
