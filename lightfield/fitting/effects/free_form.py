"""Free-form effects: curves, of which named effects are special cases, tried where those do not suffice.

What they are made of is in `fitting/curves.py`: amplitudes count in rms departures of the logarithm of light.
Readings that tell of fewer functions than a form has make a form of those there are.
"""

from __future__ import annotations

from collections.abc import Iterable

from lightfield.fitting.effects.effect import Effect, Form, Free

#: An amplitude that is large: a lamp that is a Gaussian no more. Chosen.
_LARGE, _TYPICAL = 2.5, 0.02


def _forms(field: str, sizes: Iterable[int]) -> tuple[Form, ...]:
    return tuple(
        Form(
            f"{size} functions",
            tuple(Free(f"{field}.{k}", -_LARGE, _LARGE, _TYPICAL) for k in range(1, size + 1)),
        )
        for size in sizes
    )


EFFECTS = (
    Effect(
        "beam_profile",
        "beam shape",
        _forms("lamp.profile_departure", (2, 4, 7, 11)),
        "The beam has a shape of its own, which no formula describes: rings, a flat top, a peak, a hole.",
        "A function of the angle from the beam's axis alone, the same at every distance.",
        "Measure the lamp in air at one range with a fine angular step and use that table.",
        needs=("off_axis",),
        contains=("beam_shape", "beam_skirt"),
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
)
