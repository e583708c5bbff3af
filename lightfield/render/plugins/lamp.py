"""Mitsuba plugin `lightfield_lamp`: the lamp of a scene, for stock integrators and for `photon_tracer`."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from lightfield.render.tracer.emission import Emission
from lightfield.scene import Lamp

NUMBERS = (
    "hwhm_deg",
    "shape_exponent",
    "skirt_fraction",
    "skirt_hwhm_deg",
    "ellipticity",
    "offset_x_m",
    "offset_y_m",
    "tilt_x_deg",
    "tilt_y_deg",
    "apparent_distance_m",
    "radius_m",
)
WORDS = ("profile", "intensity_table")


class LightfieldLamp(mi.Emitter):
    """Point-like lamp at the origin, shining along +z, of unit on-axis radiant intensity times `intensity`.

    Properties have the names and units of the `[lamp]` section: hwhm_deg, shape_exponent, skirt_fraction,
    skirt_hwhm_deg, ellipticity, offset_x_m, offset_y_m, tilt_x_deg, tilt_y_deg, apparent_distance_m,
    radius_m, profile, intensity_table; and `intensity`, the on-axis radiant intensity in W/sr/nm. Nest or
    refer to the water's medium.

    Stock integrators see a lamp without area: `apparent_distance_m` and `radius_m` act in `photon_tracer`
    only.
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        values: dict[str, object] = {name: float(props[name]) for name in NUMBERS if name in props}
        values |= {name: str(props[name]) for name in WORDS if name in props}
        self.lamp = Lamp.model_validate(values)
        self.intensity = float(props.get("intensity", 1.0))
        self.m_flags = int(mi.EmitterFlags.DeltaPosition)
        self.m_needs_sample_2, self.m_needs_sample_3 = False, True
        self.emission = Emission(self.lamp, cone_rad=0.3, wide_share=0.0)

    def _frame(self) -> tuple[mi.Point3f, mi.Vector3f, mi.Vector3f, mi.Vector3f]:
        beam = self.emission
        return mi.Point3f(self.lamp.offset_x_m, self.lamp.offset_y_m, 0), beam.right, beam.up, beam.axis

    def _towards(self, direction: mi.Vector3f) -> mi.Float:
        """Radiant intensity relative to the axis in a world direction."""
        _, right, up, axis = self._frame()
        x, y, z = dr.dot(direction, right), dr.dot(direction, up), dr.dot(direction, axis)
        sine = dr.sqrt(x * x + y * y)
        theta = dr.atan2(sine, z)
        scale = dr.select(sine > 1e-9, theta / dr.maximum(sine, 1e-9), 1)
        return self.emission.intensity(x * scale, y * scale)

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
        origin, right, up, axis = self._frame()
        direction = dr.normalize(right * local.x + up * local.y + axis * local.z)
        wavelengths, spectrum = self.sample_wavelengths(dr.zeros(mi.SurfaceInteraction3f), sample1, active)
        return mi.Ray3f(origin, direction, time, wavelengths), spectrum * weight * self.intensity

    def sample_direction(
        self, it: mi.Interaction3f, sample: mi.Point2f, active: mi.Bool = True
    ) -> tuple[mi.DirectionSample3f, mi.Spectrum]:
        """The one direction from a point to the lamp; intensity over distance squared."""
        origin, *_ = self._frame()
        ds = dr.zeros(mi.DirectionSample3f)
        ds.p, ds.time, ds.delta, ds.pdf = origin, it.time, True, 1
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
