"""The table of effects. One entry per effect; nothing here is code."""

from __future__ import annotations

from lightfield.fitting.effects.effect import Effect, Form, Free

EFFECTS: tuple[Effect, ...] = (
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
        (Form("point behind the window", (Free("lamp.apparent_distance_m", 0.0, 8.0, 0.3),)),),
        "The light diverges from a point behind the window (reflector, lens, or a wrong range scale), "
        "so it falls more slowly than the inverse square of the distance from the window.",
        "Far planes too bright and too narrow for the near ones.",
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
                    Free("lamp.tilt_x_deg", -6.0, 6.0, 0.2, needs=("vary_x",)),
                    Free("lamp.tilt_y_deg", -6.0, 6.0, 0.2, needs=("vary_y",)),
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
        "Measure the lamp in air at one range with a fine angular step and use that table.",
        needs=("off_axis",),
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
        needs=("off_axis",),
    ),
    Effect(
        "beam_ellipticity",
        "beam shape",
        (Form("elliptic", (Free("lamp.ellipticity", 0.4, 2.5, 0.05),)),),
        "The beam is wider along one transverse axis than along the other.",
        "Too bright along x where it is too dark along y.",
        "Turn the lamp by 90 degrees about its axis: the pattern turns with it.",
        needs=("vary_x", "vary_y"),
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
        "scattering",
        "diffuse light",
        (
            Form(
                "Henyey-Greenstein",
                (Free("water.scattering_per_m", 0.0, 2.0, 0.02),),
                # Traced from 0.75 to 0.97; extrapolated light is 3 % off at 0.98.
                (Free("water.phase.g", 0.7, 0.98, 0.02, grid=(0.924, 0.8, 0.97)),),
            ),
        ),
        "Particles turn light out of the beam and some of it back onto the detector.",
        "A halo that grows with distance: excess off the axis, wider at far planes.",
        "Measure at several ranges off axis; compare with filtered water; narrow the acceptance.",
        needs=("water",),
    ),
    Effect(
        "water_gradient",
        "path and attenuation",
        (
            Form("linear in z", (Free("water.gradient_per_m2", -0.06, 0.06, 0.002),)),
            Form(
                "layer",
                (Free("water.layer_absorption_per_m", 0.0, 1.0, 0.02),),
                (Free("water.layer_centre_m", 0.0, 1.0, 0.1, per="range", grid=(0.2, 0.5, 0.8)),),
            ),
        ),
        "The water is not the same along the tank (settling, inflow, a cloud).",
        "A function of distance alone: curvature or a step in the logarithm of the axial decay.",
        "Stir; take samples at three ranges; measure the decay again after an hour.",
        needs=("vary_z", "water"),
    ),
    Effect(
        "spectral_hardening",
        "path and attenuation",
        (Form("second order", (Free("water.hardening_per_m", 0.0, 0.001, 0.0003, per="band"),)),),
        "In a wide band the strongly absorbed wavelengths go first, so the rest decays more slowly.",
        "The decay on the axis flattens with distance, at all angles alike.",
        "Use a narrower filter: the curvature falls with the square of the band width.",
        needs=("vary_z", "water"),
    ),
    Effect(
        "cdom",
        "path and attenuation",
        (
            Form(
                "exponential",
                (Free("water.cdom_440_per_m", 0.0, 5.0, 0.02),),
                (Free("water.cdom_slope_per_nm", 0.008, 0.025, 0.001, grid=(0.014,)),),
            ),
        ),
        "Dissolved organic matter absorbs blue light.",
        "Extra decay that rises towards the blue.",
        "Filter a sample (0.2 micrometre) and measure its absorption at 440 nm.",
        needs=("vary_z", "water", "spectral", "known_base"),
    ),
    Effect(
        "chlorophyll",
        "path and attenuation",
        (Form("phytoplankton", (Free("water.chlorophyll_mg_per_m3", 0.0, 100.0, 0.2),)),),
        "Phytoplankton absorbs near 440 and 675 nm, and scatters.",
        "Extra decay in the blue and in a narrow band of the red, with a halo.",
        "Filter a sample and extract its pigment, or use a fluorometer.",
        needs=("vary_z", "water", "spectral", "known_base"),
    ),
    Effect(
        "sediment",
        "path and attenuation",
        (Form("mineral", (Free("water.sediment_g_per_m3", 0.0, 100.0, 0.2),)),),
        "Mineral particles absorb, mostly in the blue, and scatter.",
        "Extra decay at all wavelengths, stronger in the blue, with a halo.",
        "Let the water settle overnight, or filter a sample and weigh the residue.",
        needs=("vary_z", "water", "spectral", "known_base"),
    ),
    Effect(
        "wall_reflection",
        "diffuse light",
        (Form("Lambertian", (Free("tank.wall_albedo", 0.0, 1.0, 0.05),)),),
        "Walls and floor of the tank send light back.",
        "A nearly uniform excess that grows with the flux that reaches the walls.",
        "Hang black cloth on the walls; a white card beside the beam shows how strong it is.",
        needs=("tank",),
    ),
    Effect(
        "surface_reflection",
        "diffuse light",
        (Form("Fresnel", (Free("tank.surface_reflectance", 0.0, 1.0, 0.1),)),),
        "The water surface mirrors the beam, totally beyond the critical angle.",
        "An excess near the surface, as from a second lamp above it.",
        "Float a dark sheet on the water; lower the lamp; read at several depths.",
        needs=("tank",),
    ),
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
        "window_refraction",
        "beam shape",
        (Form("flat window", (Free("lamp.window_index", 0.9, 1.6, 0.05),)),),
        "Behind a flat window the beam is narrower and brighter on the axis in water than in air.",
        "Readings in air: wider and weaker than those in water predict.",
        "Measure the beam in air and in water at one range.",
        needs=("air_and_water",),
    ),
)
