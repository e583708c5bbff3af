"""Effects of the tank: what walls (Lambertian), surface and panes (Fresnel) send back; `render/reflected`."""

from __future__ import annotations

from lightfield.fitting.effects.effect import Effect, Form, Free

EFFECTS = (
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
        "floor_reflection",
        "diffuse light",
        (Form("other albedo", (Free("tank.floor_over_walls", 0.0, 20.0, 0.5, lowest="none"),)),),
        "The floor reflects more than the walls (sand, concrete, paint that has come off), or less (silt).",
        "Beside reflecting walls: an excess from below, which grows towards the floor. On one line at one "
        "height nearly the same as brighter walls.",
        "Lay black cloth on the floor; read at several heights.",
        needs=("tank",),
    ),
    Effect(
        "end_reflection",
        "diffuse light",
        (Form("other albedo", (Free("tank.end_over_walls", 0.0, 20.0, 0.5, lowest="none"),)),),
        "The far end reflects more than the walls (a white screen, a door), or less (a black curtain).",
        "Beside reflecting walls: more or less light that comes back from where the beam ends; of a narrow "
        "beam in a short tank that is most of what walls send.",
        "Hang a black cloth on the far end, or take it away; read near the far end and near the lamp.",
        needs=("tank",),
    ),
    Effect(
        "surface_reflection",
        "diffuse light",
        # Were its end where water has it, fits of a plain surface would lie there, without an error.
        (Form("Fresnel", (Free("tank.surface_reflectance", 0.0, 1.3, 0.1, real=1.0),)),),
        "The water surface mirrors the beam, totally beyond the critical angle.",
        "An excess near the surface, as from a second lamp above it.",
        "Float a dark sheet on the water; lower the lamp; read at several depths.",
        needs=("tank",),
    ),
    Effect(
        "pane_reflection",
        "diffuse light",
        (Form("bare glass", (Free("tank.pane_reflectance", 0.0, 1.1, 0.1, real=1.0),)),),
        "Panes of bare glass with air behind mirror the beam, totally beyond the critical angle.",
        "An excess that grows along the tank and towards its sides, where the beam has come to them: light "
        "falls too slowly with distance, and spots are flat.",
        "Hold black cloth to the inside of the panes; a lamp that is aimed at a side shows its image in it.",
        needs=("tank", "panes"),
    ),
    Effect(
        "waves",
        "diffuse light",
        (Form("mean slope", (Free("tank.surface_slope_deg", 0.0, 144.0, 25.0, square=True),)),),
        "Waves tilt the water surface, and smear and dim the lamp's image in it (their mean over a reading).",
        "Beside a surface that mirrors: less light near the surface and far away, where the image stood, a "
        "little more deep below. At one depth hardly told from a surface that mirrors less.",
        "Wait until the water is still, or float a dark sheet on it; film the image of a lamp from below.",
        needs=("tank", "mirror"),
    ),
)
