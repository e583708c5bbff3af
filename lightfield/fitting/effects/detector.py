"""Effects of the detector: what it adds to the light and makes of it, and how it sees different directions.

The formulas are in `formula/readout.py` and `scene/receiver.py`.
"""

from __future__ import annotations

from lightfield.fitting.effects.effect import Effect, Form, Free

#: Ambient light before the moment, and what is added then. Chosen: as that of a background is.
_LEVELS = (
    Free("detector.background", -0.5, 0.5, 0.002, per="signal", needs=("time",)),
    Free("detector.background_step", -0.5, 0.5, 0.002, per="signal", needs=("time",)),
)
#: When it is switched, sought at parts of the scan. Chosen: a fit moves it across the readings between.
_BEGINS = Free(
    "detector.background_step_s", 0.05, 0.95, 0.02, per="moment",
    grid=tuple((k + 0.5) / 10 for k in range(10)),
)  # fmt: skip
#: How long it stays. Chosen: of less than a tenth of the scan outliers in a row may be the cause; with two
#: lengths in place of three one of thirteen draws ended in another valley.
_LASTS = Free("detector.background_step_for_s", 0.1, 0.9, 0.02, per="seconds", grid=(0.12, 0.25, 0.5))
#: A switch over this part of the time between readings is sudden. Derived: half of that time before and after
#: the moment all but 2 % of it, tanh(2), is done.
SUDDEN = 0.25
#: Light is switched from one reading to the next, or comes within some. Chosen: what takes longer is a drift.
_OVER = Free(
    "detector.background_step_over_s", SUDDEN, 10.0, 1.0, per="interval", grid=(1.0,), lowest="sudden"
)

EFFECTS = (
    Effect(
        "background",
        "additive signal",
        (
            Form("constant", (Free("detector.background", -0.5, 0.5, 0.002, per="signal"),)),
            Form(
                "drifting",
                (Free("detector.background", -0.5, 0.5, 0.002, per="signal", needs=("time",)),),
                # From all of it to nothing, and to several times as much, while the readings are taken.
                (
                    Free(
                        "detector.background_drift_per_hour",
                        -1.2,
                        12.0,
                        0.2,
                        per="inverse_hours",
                        grid=(-0.8, 4.0),
                    ),
                ),
            ),
            Form("switched", _LEVELS, (_BEGINS, _OVER), at_any_time=True),
            Form("on for a while", _LEVELS, (_BEGINS, _LASTS, _OVER), at_any_time=True),
        ),
        "Ambient light, or a dark signal left in (or over-subtracted from) the readings.",
        "The same amount everywhere: dominates far off the axis and at far planes. Ambient light changes "
        "with the hour, or when it is switched, and a dark signal with the temperature, at bright and dark "
        "places alike.",
        "Read with the lamp off and with the detector capped: the first is ambient, the second dark signal. "
        "Do so again at the end. Ask who switched the light of the hall.",
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
        "cosine_error",
        "receiver angle",
        (Form("growing with 1 - cos", (Free("detector.cosine_error", -0.3, 0.3, 0.02),)),),
        "The collector does not follow the cosine: 2 to 10 % too little or too much of light from the side.",
        "Off the axis too dark or too bright by an even function of the angle of arrival; of a narrow beam "
        "alone nearly the same as another width, and of light from walls and water as another amount of it.",
        "Turn the detector before a lamp far away and record its response up to 85 degrees.",
        needs=("off_axis",),
    ),
    Effect(
        "lag",
        "position",
        (Form("along the motion", (Free("detector.lag_m", -0.05, 0.05, 0.001),)),),
        "The places that are read lie behind those stated: a slow detector on a stage that moves on, or play "
        "in the stage.",
        "A slope across the beam whose sign changes with the direction of the motion. Where rows alternate "
        "a lamp that changes in time, with water or an offset that undo it from row to row, is nearly alike.",
        "Read one row both ways: two curves that are apart along it by twice the lag.",
        needs=("to_and_fro",),
    ),
    Effect(
        "immersion",
        "detector response",
        (Form("factor", (Free("detector.immersion_factor", 0.6, 2.0, 0.02),)),),
        "A collector under water sends more light back out than in air, so it reads less there: 1.3 to 1.4 "
        "times less for a cosine collector.",
        "All readings in water too dark beside those in air by one factor, wherever they are. On the axis "
        "alone window refraction (1/n^2) looks the same; the width of the beam in air tells.",
        "Read a steady lamp above the water, lower the water to and fro over the collector, and extrapolate "
        "to no depth; or use the factor of the collector's calibration.",
        needs=("air_and_water",),
    ),
    Effect(
        "stray_light",
        "additive signal",
        (Form("uniform", (Free("detector.stray_light", 0.0, 0.05, 0.001),)),),
        "Light of all other wavelengths is scattered inside the spectrometer, 0.1 to 0.5 % in good ones.",
        "Where the water takes a wavelength most it takes it least: the decay flattens far away, towards a "
        "part of the mean over the spectrum. At few wavelengths a background does nearly the same. It is "
        "that of readings as the spectrometer gives them, not of each wavelength scaled by itself.",
        "Hold a long-pass filter in the light: what is left at the wavelengths it blocks is stray.",
        needs=("spectral", "vary_z", "water"),
    ),
    Effect(
        "second_order",
        "additive signal",
        (Form("of half the wavelength", (Free("detector.second_order", 0.0, 0.5, 0.005),)),),
        "A grating sends light of half the wavelength to where it sends a wavelength: without a filter that "
        "blocks it, part of the blue is read in the near infrared.",
        "Where the water takes a wavelength most and half of it least, the decay flattens far away, towards "
        "that of half the wavelength. At few overlapping wavelengths background and stray light do the same.",
        "Hold a long-pass filter in the light: what it takes of wavelengths that it passes is second order.",
        needs=("overlap", "vary_z", "water"),
    ),
    Effect(
        "wavelength_shift",
        "wavelength",
        (Form("shift", (Free("detector.wavelength_shift_nm", -5.0, 5.0, 0.2),)),),
        "The spectrometer's wavelength scale is off, by temperature, a knock or an old calibration.",
        "Extra decay where the water's absorption rises with the wavelength, less where it falls: 5 % per nm "
        "at 575 to 600 nm over 8.5 m. At three or four wavelengths dissolved or suspended matter can look "
        "alike.",
        "Point the spectrometer at a mercury or neon lamp and compare the lines.",
        needs=("vary_z", "water", "spectral", "known_base"),
    ),
)
