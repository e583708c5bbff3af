"""Effects of the water: what it scatters, how it changes along the tank and in time, and its colour.

Scattering follows the phase function of Henyey and Greenstein (1941), or that of Fournier and Forand (1994)
in a scene that states it, `scene/water/phase/`, and is traced by `render/diffuse`. Attenuation along a ray is
in `formula/path.py`, its change in time in `scene/water/ageing.py`. What is in the water, with sources, is in
`scene/water/constituents.py`: chlorophyll after Bricaud et al. (1998) and Loisel and Morel (1998), dissolved
matter after Bricaud, Morel and Prieur (1981), mineral particles after Gege (2021) and Babin et al. (2003).
"""

from __future__ import annotations

from lightfield.fitting.effects.effect import Effect, Form, Free

EFFECTS = (
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
            # In a scene that has this phase function: its index as stated, its slope free.
            Form(
                "Fournier-Forand",
                (Free("water.scattering_per_m", 0.0, 4.0, 0.02),),
                # Traced from 3.3 to 4.1, `render.diffuse.between_g`.
                (Free("water.phase.mu", 3.25, 4.15, 0.05, grid=(3.5835, 3.35, 3.9)),),
            ),
        ),
        "Particles turn light out of the beam and some of it back onto the detector.",
        "A halo that grows with distance: excess off the axis, wider at far planes.",
        "Measure at several ranges off axis; compare with filtered water; narrow the acceptance.",
        needs=("water",),
    ),
    Effect(
        "scattering_slope",
        "diffuse light",
        (Form("of wavelength", (Free("water.scattering_slope", -2.0, 4.0, 0.2),)),),
        "The particles scatter one colour more than another: small ones blue, by 1 / wavelength in open sea.",
        "A halo that is another part of the light in each band, beside scattering alone.",
        "Measure the scattering of a sample in both colours, or filter in two steps: what is small passes "
        "the first.",
        needs=("water", "two_colours"),
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
        (Form("second order", (Free("water.hardening_per_m", 0.0, 1.0, 0.09, per="spread", square=True),)),),
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
        "stratification",
        "path and attenuation",
        (
            Form("linear in y", (Free("water.height_gradient_per_m2", -0.2, 0.2, 0.005),)),
            Form(
                "bottom layer",
                (Free("water.bottom_layer_absorption_per_m", -0.5, 1.0, 0.02),),
                (Free("water.bottom_layer_top_m", 0.0, 1.0, 0.1, per="heights", grid=(0.2, 0.5, 0.8)),),
            ),
        ),
        "Turbid or warm water lies in layers: it is clearer above than below, or the other way round.",
        "Bright above and dark below the axis, or the reverse, as of a beam that curves: it grows with the "
        "cube of the distance where a tilted beam's shift grows with the distance itself. At one distance "
        "these are one.",
        "Sample the water at three heights; stir; turn the lamp by 180 degrees about its axis: a tilt turns "
        "with it.",
        needs=("vary_y", "vary_z", "water"),
    ),
    Effect(
        "water_drift",
        "time",
        # Tanks change by 1 to 5 % of c per hour, and by a quarter after the water was stirred.
        (Form("linear", (Free("water.drift_per_m_per_hour", -0.5, 0.5, 0.01, per="attenuation"),)),),
        "The water clears, or becomes turbid, while the scan runs (fine particles, bubbles, growth).",
        "A change in time that grows with the distance; the same factor at each distance. Of planes read one "
        "after the other it is a curved decay, as of a gradient; at one distance it is a drift of the lamp.",
        "Repeat two reference positions, one near and one far, every few minutes; read in random order.",
        needs=("time", "vary_z", "water"),
    ),
    Effect(
        "settling",
        "time",
        (
            Form(
                "exponential",
                (Free("water.settling_per_m", 0.0, 1.0, 0.02),),
                (Free("water.settling_time_s", 0.1, 1.0, 0.1, per="seconds", grid=(0.3, 0.8)),),
            ),
        ),
        "Particles scatter the light and sink to the floor, or bubbles rise, while the scan runs.",
        "A halo and a loss that grow with the distance and fade in time. Where it fades little it is "
        "scattering, and where no halo is seen a drift of the water.",
        "Measure the same place at once and again after some hours; let the water rest before a scan.",
        needs=("time", "water"),
    ),
)
