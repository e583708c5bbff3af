"""Effects of the detector: what it adds to the light and makes of it, and how it sees different directions.

The formulas are in `formula/readout.py` and `scene/receiver.py`.
"""

from __future__ import annotations

from lightfield.fitting.effects.effect import Effect, Form, Free

EFFECTS = (
    Effect(
        "background",
        "additive signal",
        (Form("constant", (Free("detector.background", -0.5, 0.5, 0.002, per="signal"),)),),
        "Ambient light, or a dark signal left in (or over-subtracted from) the readings.",
        "The same amount everywhere: dominates far off the axis and at far planes.",
        "Read with the lamp off and with the detector capped: the first is ambient, the second dark signal.",
    ),
    Effect(
        "saturation",
        "detector response",
        (
            Form("hyperbolic", (Free("detector.saturation", 0.0, 2.0, 0.02),)),
            Form("quadratic", (Free("detector.saturation_quadratic", 0.0, 0.45, 0.02),)),
        ),
        "The detector or its electronics respond less than proportionally to bright light.",
        "A function of the reading alone: bright readings too low.",
        "Halve the integration time, or put in a known neutral filter, at the brightest place.",
    ),
    Effect(
        "acceptance",
        "receiver angle",
        (
            Form(
                "Gaussian acceptance",
                (Free("detector.acceptance_hwhm_deg", 0.0, 25.0, 0.2, inverse_square=True),),
            ),
        ),
        "The receiver accepts light only from within a cone about its axis.",
        "Too dark off the axis; nearly the same as a narrower beam.",
        "Turn the detector on the axis and record its response against the angle.",
        needs=("off_axis",),
    ),
    Effect(
        "detector_tilt",
        "receiver angle",
        (Form("tilt", (Free("detector.tilt_x_deg", -15.0, 15.0, 1.0),)),),
        "The receiver does not face the lamp squarely.",
        "A slope across the beam that depends on the direction of arrival.",
        "Turn the detector by 180 degrees about its axis and repeat: the slope changes sign.",
        needs=("vary_x", "off_axis"),
    ),
    Effect(
        "immersion",
        "detector response",
        (Form("factor", (Free("detector.immersion_factor", 0.6, 2.0, 0.02),)),),
        "A collector under water sends more light back out than in air, so it reads less there: 1.3 to 1.4 "
        "times less for a cosine collector.",
        "All readings in water too dark beside those in air by one factor, wherever they are. On the axis "
        "alone window refraction (1/n^2) and a wrong distance look the same; the width of the beam in air "
        "tells.",
        "Read a steady lamp above the water, lower the water to and fro over the collector, and extrapolate "
        "to no depth; or use the factor of the collector's calibration.",
        needs=("air_and_water",),
    ),
)
