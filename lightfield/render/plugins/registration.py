"""Which modules make Mitsuba plugins; they are made again for another variant."""

from __future__ import annotations

import importlib
import sys

import mitsuba as mi

_MODULES = (
    "tracer.sobol",
    "tracer.emission",
    "tracer.planes",
    "tracer.histories",
    "tracer.flight",
    "tracer.straight",
    "tracer.walk",
    "plugins.phase",
    "plugins.lamp",
    "plugins.detector_plane",
    "tracer.build",
    "tracer.accumulate",
    "plugins.photon_tracer",
)
_variant: str | None = None


def register() -> None:
    """Register our emitter, phase function, sensor and integrator with Mitsuba's variant.

    Needed once after every `mi.set_variant`; `use_backend()` does it. A plugin class belongs to the variant
    that it was made under, so another variant means making the classes again.
    """
    global _variant
    if _variant == mi.variant():
        return
    stale = _variant is not None
    for name in _MODULES:
        full = f"lightfield.render.{name}"
        if stale and full in sys.modules:
            importlib.reload(sys.modules[full])
    from lightfield.render.plugins.detector_plane import DetectorPlane
    from lightfield.render.plugins.lamp import LightfieldLamp
    from lightfield.render.plugins.phase import LightfieldPhase
    from lightfield.render.plugins.photon_tracer import PhotonTracer

    mi.register_emitter("lightfield_lamp", LightfieldLamp)
    mi.register_phase("lightfield_phase", LightfieldPhase)
    mi.register_sensor("detector_plane", DetectorPlane)
    mi.register_integrator("photon_tracer", PhotonTracer)
    _variant = mi.variant()
