"""Effects of the lamp: how bright it is, where it stands and looks, its beam, its changes in time.

The formulas are in `scene/lamp/` (frame, profile, spectrum), the inverse square from the apparent source in
`formula/path.py`, the change in time in `formula/readout.py`.
"""

from __future__ import annotations

from lightfield.fitting.effects.effect import Effect, Form, Free

EFFECTS = (
    Effect(
        "lamp_power",
        "lamp power",
        (Form("factor", (Free("lamp.power_w", 1e-4, 1e4, 0.1, per="power"),)),),
        "The lamp gives more or less light than the scene says, or the readings are in another unit.",
        "All readings too bright or too dark by one factor.",
        "Measure the lamp with a calibrated meter; check the readings' unit and the detector's calibration.",
        needs=("absolute",),
        instead_of=("gain",),
    ),
    Effect(
        "apparent_source",
        "path and attenuation",
        (
            Form("point behind the window", (Free("lamp.apparent_distance_m", 0.0, 8.0, 0.3),)),
            # Chosen: to a tenth it did what scattering does, in two of 22 independent campaigns.
            Form(
                "point in front of the window",
                (Free("lamp.apparent_distance_m", -0.05, 0.0, 0.02, per="nearest"),),
            ),
        ),
        "The light diverges from a point behind the window (reflector, lens, or a wrong range scale), "
        "so it falls more slowly than the inverse square of the distance from the window; from one in front "
        "of it (a range scale that reads too long, a lens) it falls faster.",
        "Far planes too bright and too narrow for the near ones, or too dark and too wide.",
        "Measure the beam radius at three ranges and extrapolate to zero; check the range scale's origin.",
        needs=("vary_z",),
    ),
    Effect(
        "beam_offset",
        "pointing",
        (
            Form(
                "shift",
                (
                    Free("lamp.offset_x_m", -0.3, 0.3, 0.01, needs=("vary_x",)),
                    Free("lamp.offset_y_m", -0.3, 0.3, 0.01, needs=("vary_y",)),
                ),
            ),
        ),
        "The lamp stands beside the origin of the position scale.",
        "Antisymmetric across the beam, the same shift in metres at every plane.",
        "Scan both sides of the axis at two ranges; re-zero the stage on the lamp.",
        needs=("off_axis",),
    ),
    Effect(
        "beam_tilt",
        "pointing",
        (
            Form(
                "tilt",
                (
                    Free("lamp.tilt_x_deg", -10.0, 10.0, 0.2, needs=("vary_x",)),
                    Free("lamp.tilt_y_deg", -10.0, 10.0, 0.2, needs=("vary_y",)),
                ),
            ),
        ),
        "The beam is not parallel to the range scale.",
        "Antisymmetric across the beam, a shift that grows with the distance.",
        "Scan both sides of the axis at two ranges; turn the lamp by 180 degrees about its axis and repeat.",
        needs=("off_axis",),
    ),
    Effect(
        "beam_shape",
        "beam shape",
        (Form("super-Gaussian", (Free("lamp.shape_exponent", 1.0, 8.0, 0.1),)),),
        "The beam is flatter or more peaked than a Gaussian.",
        "A function of the angle alone: sign changes at the half-width, largest in the wings.",
        "Measure the lamp in air at one range with a fine angular step and use that table; behind a flat "
        "window its angles are 1.34 times those in water (lamp.table_width = 0.746).",
        needs=("off_axis", "formula_beam"),
    ),
    Effect(
        "table_width",
        "beam shape",
        (Form("wider than its table", (Free("lamp.table_width", 0.5, 2.0, 0.02),)),),
        "The beam is wider or narrower than its table by one factor: it is of air, or of another lamp.",
        "A function of the angle alone: largest where the beam is steepest.",
        "Measure the half width at one distance; a table measured in air, of a lamp behind a flat window, "
        "has angles 1.34 times those in water (lamp.table_width = 0.746).",
        needs=("off_axis", "table_beam"),
    ),
    Effect(
        "beam_skirt",
        "beam shape",
        (
            Form(
                "second Gaussian",
                (Free("lamp.skirt_fraction", 0.0, 0.8, 0.02),),
                (Free("lamp.skirt_hwhm_deg", 1.15, 12.0, 1.0, per="hwhm", grid=(1.5, 2.5, 4.0, 7.0)),),
            ),
        ),
        "Light that misses the reflector or is scattered in the lamp adds a wide, weak beam.",
        "A function of the angle alone: excess in the wings.",
        "Measure the lamp in air at large angles; a baffle tube removes it.",
        needs=("off_axis", "formula_beam"),
    ),
    Effect(
        "beam_ellipticity",
        "beam shape",
        (
            Form("elliptic", (Free("lamp.ellipticity", 0.4, 2.5, 0.05),)),
            Form(
                "turned",
                (
                    Free("lamp.ellipticity", 0.4, 2.5, 0.05, needs=("oblique",)),
                    Free("lamp.ellipticity_diagonal", 0.4, 2.5, 0.05, needs=("oblique",)),
                ),
            ),
        ),
        "The beam is wider along one direction across its axis than along the other, as a filament is long.",
        "Too bright along one direction across the beam where it is too dark along the other.",
        "Turn the lamp by 90 degrees about its axis: the pattern turns with it.",
        needs=("vary_x", "vary_y"),
    ),
    Effect(
        "beam_asymmetry",
        "beam shape",
        (
            Form(
                "lopsided",
                (
                    Free("lamp.asymmetry_x", -0.6, 0.6, 0.03, needs=("vary_x",)),
                    Free("lamp.asymmetry_y", -0.6, 0.6, 0.03, needs=("vary_y",)),
                ),
            ),
        ),
        "The filament or the emitter stands beside the reflector's axis: the beam is wider on one side.",
        "Antisymmetric across the beam, growing with the angle's square; the same angles at every plane.",
        "Turn the lamp by 180 degrees about its axis: the pattern turns with it, that of a tilt does not.",
        needs=("off_axis",),
    ),
    Effect(
        "beam_colour",
        "beam shape",
        (Form("wider with the wavelength", (Free("lamp.width_slope", -1.0, 1.0, 0.05),)),),
        "The beam is wider in one colour than in another: a phosphor around a blue chip, a dichroic "
        "reflector, a lens that bends red less.",
        "In the wings of one band too bright where in those of another it is too dark, at the same angles.",
        "Look at a white wall near the lamp: its edge is coloured. Measure the lamp in air in two bands.",
        needs=("off_axis", "two_colours", "relative"),
    ),
    Effect(
        "lamp_drift",
        "time",
        (
            Form("linear", (Free("lamp.drift_per_hour", -0.9, 0.9, 0.02, per="inverse_hours"),)),
            Form(
                "warm-up",
                (Free("lamp.warmup_fraction", -0.9, 0.9, 0.02),),
                (Free("lamp.warmup_time_s", 0.03, 3.0, 0.1, per="seconds", grid=(0.1, 0.35, 1.0)),),
            ),
        ),
        "The lamp (or its supply, or the sensor's temperature) changes while the scan runs.",
        "A smooth function of time; of distance too when the planes were read one after the other.",
        "Repeat a reference position every few minutes; warm up longer; read in random order.",
        needs=("time",),
    ),
    Effect(
        "lamp_size",
        "beam shape",
        # Squares of the radius: up to 25 cm, as panels have; 3 cm is worth asking about.
        (Form("uniform disc", (Free("lamp.radius_m", 0.0, 0.0625, 0.0009, square=True),)),),
        "The window is no point: light from its rim arrives from another angle, and from another place.",
        "Near planes too wide and rounded, by the same metres at every plane; far ones right. A source that "
        "lies behind the window does nearly the same to the widths, and changes the decay too.",
        "Stop the window down with a hole in a sheet, and see whether the near planes become narrower.",
        needs=("off_axis", "vary_z"),
    ),
)
