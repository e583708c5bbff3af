"""Free-form effects: curves, of which named effects are special cases, tried where those do not suffice.

What they are made of is in `fitting/curves.py`: amplitudes count in rms departures of the logarithm of light,
of a background in parts of the brightest reading.
Readings that tell of fewer functions than a form has make a form of those there are.
"""

from __future__ import annotations

from collections.abc import Iterable

from lightfield.fitting.effects.effect import Effect, Form, Free

#: An amplitude that is large: water or a lamp's power that is another one. Of a beam three times that: a flat
#: top with a steep edge ended at 2.5 amid a valley, chi-square twice that of its floor. Chosen.
_LARGE, _OF_BEAM, _TYPICAL = 2.5, 7.0, 0.02
#: Of which a lamp table is made.
BEAM_PROFILE = "beam_profile"


def _forms(
    field: str,
    sizes: Iterable[int],
    refining: Iterable[int] = (),
    large: float = _LARGE,
    typical: float = _TYPICAL,
) -> tuple[Form, ...]:
    found = [(size, False) for size in sizes] + [(size, True) for size in refining]
    return tuple(
        Form(
            f"{size} functions",
            tuple(Free(f"{field}.{k}", -large, large, typical) for k in range(1, size + 1)),
            refines=refines,
        )
        for size, refines in found
    )


EFFECTS = (
    Effect(
        BEAM_PROFILE,
        "beam shape",
        _forms("lamp.profile_departure", (2, 4, 7, 11), refining=(19, 31, 51), large=_OF_BEAM),
        "The beam has a shape of its own, which no formula describes: rings, a flat top, a peak, a hole.",
        "A function of the angle from the beam's axis alone, the same at every distance.",
        "Measure the lamp in air at one range with a fine angular step and use that table; behind a flat "
        "window its angles are 1.34 times those in water (lamp.table_width = 0.746).",
        needs=("off_axis",),
        contains=("beam_shape", "table_width", "beam_skirt"),
    ),
    Effect(
        "attenuation_profile",
        "path and attenuation",
        _forms("water.absorption_departure", (2, 4)),
        "The attenuation of the water changes along the tank: K(z).",
        "A function of the distance alone, the same across the beam.",
        "Sample the water at several distances; stir, wait, and repeat.",
        needs=("vary_z", "water"),
        contains=("water_gradient", "spectral_hardening"),
    ),
    Effect(
        "lamp_power_curve",
        "time",
        _forms("lamp.power_departure", (3, 6)),
        "The lamp's power changes in its own way while the scan runs.",
        "A function of time alone; of distance too when the planes were read one after the other.",
        "Repeat a reference position every few minutes, or watch the lamp with a second detector.",
        needs=("time",),
        contains=("lamp_drift",),
    ),
    Effect(
        "plane_gain",
        "detector response",
        _forms("detector.plane_departure", (30,)),
        "Each distance has a gain of its own: the stage, fibre or integration time was set anew there.",
        "A factor on all readings at one distance, in air as in water, with no order from plane to plane; at "
        "five distances an attenuation that changes along the tank, at every number of them one that jumps, "
        "and a lamp that changes while planes are read in turn, do the same.",
        "Return to the first plane at the end, or read all planes twice in another order; read a fixed lamp.",
        needs=("vary_z",),
        contains=("water_gradient", "spectral_hardening", "attenuation_profile"),
    ),
    Effect(
        "attenuation_spectrum",
        "path and attenuation",
        _forms("water.colour_departure", (2, 4, 8)),
        "The water has a colour of its own: K(wavelength) departs from that of its base.",
        "Extra decay at some wavelengths, less at others, the same along the tank. In water without a base "
        "the absorption is free at every wavelength in any case.",
        "Measure a sample in a spectrophotometer, filtered and unfiltered, and use that table as the base.",
        needs=("vary_z", "water", "spectral", "known_base"),
        contains=("cdom", "chlorophyll", "sediment", "wavelength_shift"),
    ),
    Effect(
        "scattering_spectrum",
        "diffuse light",
        # Of the logarithm of scattering: a factor of 1.2, and one of 30.
        _forms("water.scattering_departure", (2, 4, 8), large=3.5, typical=0.2),
        "The particles scatter by a spectrum of their own, which is no power of the wavelength: pigments do, "
        "and what is about as large as the wavelength.",
        "A halo that is another part of the light in each band, without an order from blue to red.",
        "Measure the scattering of a sample in every band.",
        needs=("water", "two_colours"),
        contains=("scattering_slope",),
    ),
    Effect(
        "lamp_spectrum",
        "lamp power",
        _forms("lamp.spectrum_departure", (2, 4, 8)),
        "The lamp has a spectrum of its own, which is not that of the scene.",
        "A factor on all readings of a wavelength, wherever they are: also that of a detector whose response "
        "is calibrated wrongly over the spectrum. On a relative scale it is part of the gains.",
        "Measure the lamp's spectrum in air with a calibrated spectrometer and use that table.",
        needs=("spectral", "absolute"),
    ),
    Effect(
        "background_spectrum",
        "additive signal",
        # Of the brightest reading, as `background`.
        _forms("detector.background_departure", (2, 4, 8), large=0.5, typical=0.002),
        "Ambient light has a colour of its own: each wavelength has a background of another size.",
        "The same amount at all places of one wavelength, another at the next: what is far and off the axis "
        "has the colour of daylight, or of lamps in the room.",
        "Read the spectrum with the lamp off, at every stay, and take it from the readings there.",
        contains=("background",),
        kind_of=("background",),
    ),
    Effect(
        "background_curve",
        "additive signal",
        _forms("detector.background_course", (3, 6, 12), refining=(24,), large=0.5, typical=0.002),
        "Ambient light comes and goes while the scan runs: clouds before the sun, lamps in the room.",
        "The same amount at bright and dark places, another from one time to the next.",
        "Read with the lamp off every few minutes, or leave a second detector where the lamp does not shine.",
        needs=("time",),
        contains=("background",),
        apart_from=("background_spectrum",),
        kind_of=("background",),
    ),
)
