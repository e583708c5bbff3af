"""What a parameter of a scene acts on: declared once, with the field; every list is derived from that."""

from __future__ import annotations

from enum import Flag, auto


class Acts(Flag):
    """Stages of the way from the lamp to a reading; a field acts on one or several of them."""

    # Every combination exists once. Enum's own hash is slow, and a fit looks lists up by it all the time.
    __hash__ = object.__hash__

    POWER = auto()  #: spectral power of the lamp, and the response to it: all light alike
    TIME = auto()  #: lamp power over its value at time zero
    BEAM = auto()  #: radiant intensity over directions, as planes at some distance see it
    SECTION = auto()  #: how much wider the beam is in some directions about its axis than its profile says
    BEAM_COLOUR = auto()  #: how the width of the beam changes with the wavelength
    SOURCE = auto()  #: from where light starts
    AIR = auto()  #: light at readings in air, and at no other
    STRAIGHT = auto()  #: light that comes straight from the lamp, and no other
    ABSORPTION = auto()  #: absorption coefficient of the water, the same everywhere
    BASE = auto()  #: the water that all else is added to
    SCATTERING = auto()  #: scattering coefficient of the water, the same everywhere
    COLOUR = auto()  #: how these two change with the wavelength
    HARDENING = auto()  #: spread of the attenuation within a band
    LAYERS = auto()  #: attenuation that changes along the tank
    AGEING = auto()  #: how the water changes in time
    PHASE = auto()  #: phase function
    BOX = auto()  #: where walls, floor, ends and top are
    REFLECTION = auto()  #: how much light walls and surface send back
    FACES = auto()  #: how much floor and far end send back beside the walls
    PANES = auto()  #: how much light bare glass mirrors
    WAVES = auto()  #: how the water surface is tilted
    RECEIVER = auto()  #: response to the direction of arrival
    MOTION = auto()  #: how far from where they are said to be places are read while the detector moves
    PLACES = auto()  #: where and in which bands light is read
    READOUT = auto()  #: from light to the number that is read


#: What a photon's walk and its tally depend on; all else is weighed afterwards, or is the reference water.
_IN_TANK = Acts.BOX | Acts.FACES | Acts.PANES | Acts.WAVES
TRACED = Acts.BEAM | Acts.SOURCE | Acts.LAYERS | Acts.PHASE | _IN_TANK | Acts.RECEIVER
#: What makes scattered and reflected light.
DIFFUSE = Acts.SCATTERING | Acts.PHASE | Acts.REFLECTION | Acts.PANES
#: What dims the light on its way, wherever it goes.
ATTENUATION = Acts.ABSORPTION | Acts.SCATTERING | Acts.HARDENING
#: What water takes on the way, whatever it is made of.
IN_WATER = ATTENUATION | Acts.LAYERS | Acts.COLOUR | Acts.BASE
#: What acts when the light has arrived, or on all light alike.
AFTERWARDS = Acts.POWER | Acts.TIME | Acts.READOUT
