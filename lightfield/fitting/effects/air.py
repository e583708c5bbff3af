"""Effects on readings in air: the window bends the beam, I(theta / n) / n^2 (`formula/closed_form.py`)."""

from __future__ import annotations

from lightfield.fitting.effects.effect import Effect, Form, Free

EFFECTS = (
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
