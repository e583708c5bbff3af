"""Mitsuba plugin `lightfield_lamp`: the lamp of a scene, for stock integrators and for `photon_tracer`."""

from __future__ import annotations

import json

import drjit as dr
import mitsuba as mi

from lightfield.render.tracer.emission import Emission
from lightfield.scene import Lamp
from lightfield.scene.acts import Acts
from lightfield.scene.parameters import fields_on

PROPERTIES = fields_on(Lamp, Acts.BEAM | Acts.SOURCE)
#: What Mitsuba knows no kind of property for is given as text.
CURVES = ("profile_departure",)


class LightfieldLamp(mi.Emitter):
    """Point-like lamp at the origin, shining along +z, of unit on-axis radiant intensity times `intensity`.

    Properties have the names and units of the `[lamp]` section, those of them that make the beam and where it
    starts (`PROPERTIES`); profile_departure is given as text: [[0, 0.0], ...]. And `intensity`, the on-axis
    radiant intensity in W/sr/nm. Nest or refer to the water's medium.

    Stock integrators see a lamp without area: `apparent_distance_m` and `radius_m` act in `photon_tracer`
    only.
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        given = {name: props[name] for name in PROPERTIES if name in props}
        self.lamp = Lamp.model_validate(
            {name: json.loads(v) if name in CURVES else v for name, v in given.items()}
        )
        self.intensity = float(props.get("intensity", 1.0))
        self.m_flags = int(mi.EmitterFlags.DeltaPosition)
        self.m_needs_sample_2, self.m_needs_sample_3 = False, True
        self.emission = Emission(self.lamp, cone_rad=0.3, wide_share=0.0)

    def _place(self) -> mi.Point3f:
        return mi.Point3f(self.lamp.offset_x_m, self.lamp.offset_y_m, 0)

    def _towards(self, direction: mi.Vector3f) -> mi.Float:
        """Radiant intensity relative to the axis in a world direction."""
        return self.emission.towards(direction)

    def sample_ray(
        self,
        time: mi.Float,
        sample1: mi.Float,
        sample2: mi.Point2f,
        sample3: mi.Point2f,
        active: mi.Bool = True,
    ) -> tuple[mi.Ray3f, mi.Spectrum]:
        """Ray drawn after the beam's shape, weighted to W for unit on-axis intensity."""
        local, weight, _ = self.emission.draw(sample3.x, sample3.y)
        direction = self.emission.in_tank(local)
        wavelengths, spectrum = self.sample_wavelengths(dr.zeros(mi.SurfaceInteraction3f), sample1, active)
        return mi.Ray3f(self._place(), direction, time, wavelengths), spectrum * weight * self.intensity

    def sample_direction(
        self, it: mi.Interaction3f, sample: mi.Point2f, active: mi.Bool = True
    ) -> tuple[mi.DirectionSample3f, mi.Spectrum]:
        """The one direction from a point to the lamp; intensity over distance squared."""
        ds = dr.zeros(mi.DirectionSample3f)
        ds.p, ds.time, ds.delta, ds.pdf = self._place(), it.time, True, 1
        ds.emitter = mi.EmitterPtr(self)
        path = ds.p - it.p
        ds.dist = dr.norm(path)
        ds.d = path / ds.dist
        ds.n = -ds.d
        value = self._towards(-ds.d) * self.intensity / (ds.dist * ds.dist)
        return ds, mi.Spectrum(dr.select(active, value, 0))

    def pdf_direction(
        self, it: mi.Interaction3f, ds: mi.DirectionSample3f, active: mi.Bool = True
    ) -> mi.Float:
        """A direction drawn by chance never meets a point."""
        return mi.Float(0)

    def eval_direction(
        self, it: mi.Interaction3f, ds: mi.DirectionSample3f, active: mi.Bool = True
    ) -> mi.Spectrum:
        """Intensity over distance squared along a direction from `sample_direction`."""
        return mi.Spectrum(self._towards(-ds.d) * self.intensity / (ds.dist * ds.dist))

    def eval(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Spectrum:
        """A point has no surface to be seen."""
        return mi.Spectrum(0)

    def sample_wavelengths(
        self, si: mi.SurfaceInteraction3f, sample: mi.Float, active: mi.Bool = True
    ) -> tuple[mi.Wavelength, mi.Spectrum]:
        """Wavelengths for a lamp that is flat over the spectrum."""
        if dr.hint(mi.is_spectral, mode="scalar"):
            return mi.sample_rgb_spectrum(mi.sample_shifted(sample))
        return mi.Wavelength(), mi.Spectrum(1)

    def bbox(self) -> mi.ScalarBoundingBox3f:
        """The lamp's own place."""
        return mi.ScalarBoundingBox3f(mi.ScalarPoint3f(self.lamp.offset_x_m, self.lamp.offset_y_m, 0))

    def traverse(self, callback: mi.TraversalCallback) -> None:
        """Nothing to differentiate."""

    def to_string(self) -> str:
        """Readable summary."""
        return f"LightfieldLamp[{self.lamp.profile}, hwhm {self.lamp.hwhm_deg} deg]"
