"""What a flight can meet: nothing in open water, the walls of a box, or any shapes of a Mitsuba scene.

The tank of a scene is a box, and where a ray leaves a box from inside takes a few multiplications; the search
of a ray tracer through six rectangles took a quarter of the photon walk. Both are here, side by side, and
`tests/physics/transport/test_surfaces.py` holds them together.
"""

from __future__ import annotations

from math import radians, sqrt, tan
from typing import Any, NamedTuple, Protocol

import drjit as dr
import mitsuba as mi

from lightfield.render.tracer.planes import Planes
from lightfield.scene.tank import PANE_INDEX, WATER_INDEX, Tank

FAR = 1e7  # m, where nothing is hit
#: A photon that bounced off a shape starts so far inside it, m: single precision is 1e-6 of ten metres. In a
#: box it starts at the wall, which is not ahead of it then: 0.1 mm inside made what mirrors send by one
#: reflection 0.06 % too bright at 1.5 m.
_OFF_THE_WALL = 1e-4
#: Light that flies level still sees the facets before it: sine of the angle to the surface at least.
_LEAST_SINE = 1e-4
#: The largest random number that there is.
_BELOW_ONE = 1 - 2.0**-24


class Met(NamedTuple):
    """The next surface along a flight: how far on; or that the flight leads away from everything.

    `hit` is what the surface needs to know again when the photon bounces.
    """

    distance: mi.Float
    leaves: mi.Bool
    hit: Any = None


class Bounce(NamedTuple):
    """Reflected part of the light, whether mirrored (or diffuse), the next flight, and whether by a pane."""

    reflected: mi.Float
    smooth: mi.Bool
    position: mi.Point3f
    direction: mi.Vector3f
    pane: mi.Bool


class Surfaces(Protocol):
    """Everything in the water that light can meet."""

    reflecting: bool

    def meet(self, position: mi.Point3f, direction: mi.Vector3f, active: mi.Bool) -> Met:
        """The next surface along a flight."""

    def bounce(
        self, met: Met, position: mi.Point3f, direction: mi.Vector3f, turn: mi.Point2f, active: mi.Bool
    ) -> Bounce:
        """What becomes of light that has met a surface, at `position`; asked only where `reflecting`."""


class OpenWater:
    """No surface: light that is far out is not followed any more."""

    reflecting = False

    def __init__(self, planes: Planes) -> None:
        self.planes = planes

    def meet(self, position: mi.Point3f, direction: mi.Vector3f, active: mi.Bool) -> Met:
        return Met(self.planes.way_out(position, direction), mi.Bool(True))

    def bounce(
        self, met: Met, position: mi.Point3f, direction: mi.Vector3f, turn: mi.Point2f, active: mi.Bool
    ) -> Bounce:
        raise AssertionError("there is nothing to bounce off in open water")


class Shapes:
    """Any shapes of a Mitsuba scene; a dielectric reflects, smooth or rough, what it transmits is lost.

    A rough one also loses what facets before it shade on its way out (Smith), which `Box` keeps.
    """

    reflecting = True

    def __init__(self, scene: mi.Scene) -> None:
        self.scene = scene
        self.context = mi.BSDFContext(mi.TransportMode.Importance)
        kinds = mi.BSDFFlags.DeltaReflection, mi.BSDFFlags.GlossyReflection, mi.BSDFFlags.DiffuseReflection
        self.context.type_mask = sum(int(kind) for kind in kinds)

    def meet(self, position: mi.Point3f, direction: mi.Vector3f, active: mi.Bool) -> Met:
        ray = mi.Ray3f(position, direction)
        # Neighbouring lanes fly in unrelated directions: packets of coherent rays would make them wait.
        flags = mi.RayFlags.Minimal | mi.RayFlags.ShadingFrame
        hit = self.scene.ray_intersect(ray, ray_flags=flags, coherent=False, active=active)
        return Met(dr.select(hit.is_valid(), hit.t, FAR), ~hit.is_valid(), hit)

    def bounce(
        self, met: Met, position: mi.Point3f, direction: mi.Vector3f, turn: mi.Point2f, active: mi.Bool
    ) -> Bounce:
        hit = met.hit
        sample, factor = hit.bsdf().sample(self.context, hit, 0.5, turn, active)
        smooth = mi.has_flag(sample.sampled_type, mi.BSDFFlags.DeltaReflection)
        smooth |= mi.has_flag(sample.sampled_type, mi.BSDFFlags.GlossyReflection)
        inwards = dr.select(dr.dot(hit.n, direction) < 0, _OFF_THE_WALL, -_OFF_THE_WALL)
        return Bounce(factor[0], smooth, hit.p + hit.n * inwards, hit.to_world(sample.wo), mi.Bool(False))


def beckmann(tank: Tank) -> float:
    """Width alpha of the distribution of facets: its square is twice the variance of their slopes."""
    return sqrt(2.0) * tan(radians(tank.surface_slope_deg))


def pane_fresnel(cosine: mi.Float) -> mi.Float:
    """Reflectance of a pane for unpolarised light from water; as `render.reflected.panes.reflectance`."""
    sine2 = WATER_INDEX**2 * dr.maximum(1 - cosine * cosine, 0)
    inside = dr.sqrt(1 - sine2 / PANE_INDEX**2)
    outside = dr.sqrt(dr.maximum(1 - sine2, 0))
    total = mi.Float(0)
    for power in (1, -1):  # s, p: indices multiply the cosines, or divide them
        water, pane = WATER_INDEX**power * cosine, PANE_INDEX**power * inside
        first, second = ((a - b) / (a + b) for a, b in ((water, pane), (pane, outside)))
        first, second = first * first, second * second
        total += 0.5 * (first + second - 2 * first * second) / (1 - first * second)
    return dr.select(sine2 >= 1, 1, total)


class Box:
    """The tank of a scene: Lambertian sides, floor and ends, on top the same or a water surface.

    Panes mirror a part of the light that meets them, and what does not stay behind is diffuse as of a wall.

    Light inside meets a wall wherever it flies. Of a surface with waves it meets a facet: its slope is drawn
    from those that it sees (Beckmann's distribution: a normal one in slope), all at the level of the surface.
    What flies up still meets the next facet at once.

    Parameters
    ----------
    wall_albedo : float
        Of floor and far end as many times more as the tank says.
    surface_reflectance : float, optional
        Factor on the Fresnel reflectance of the water surface; None: a lid like the walls.
    """

    def __init__(self, tank: Tank, wall_albedo: float, surface_reflectance: float | None) -> None:
        self.reflecting = wall_albedo > 0 or bool(surface_reflectance) or tank.pane_reflectance > 0
        self.has_surface = surface_reflectance is not None
        # In variables, not literals: another tank needs no new kernel.
        low, high = zip(*tank.box_m, strict=True)
        self.low = mi.Point3f(*(dr.opaque(mi.Float, float(v)) for v in low))
        self.high = mi.Point3f(*(dr.opaque(mi.Float, float(v)) for v in high))
        self.albedo = dr.opaque(mi.Float, float(wall_albedo))
        self.floor = dr.opaque(mi.Float, float(wall_albedo) * tank.floor_share)
        self.end = dr.opaque(mi.Float, float(wall_albedo) * tank.end_share)
        self.surface = dr.opaque(mi.Float, float(surface_reflectance or 0.0))
        self.has_panes = tank.pane_reflectance > 0
        self.panes = mi.Point3f(*(dr.opaque(mi.Float, float(v)) for v in tank.panes_at))
        wavy = self.has_surface and tank.surface_slope_deg > 0
        self.rough = dr.opaque(mi.Float, beckmann(tank)) if wavy else None

    def meet(self, position: mi.Point3f, direction: mi.Vector3f, active: mi.Bool) -> Met:
        ahead = dr.select(direction > 0, self.high, self.low) - position
        # A flight along a wall never meets it; one that has rounded out of the box is at its wall.
        reach = dr.select(direction == 0, FAR, dr.maximum(ahead / direction, 0))
        distance = dr.minimum(dr.minimum(reach.x, reach.y), reach.z)
        return Met(distance, mi.Bool(False), reach)

    def bounce(
        self, met: Met, position: mi.Point3f, direction: mi.Vector3f, turn: mi.Point2f, active: mi.Bool
    ) -> Bounce:
        reach = met.hit
        side = reach.x <= met.distance
        lid_or_floor = ~side & (reach.y <= met.distance)
        back_or_end = ~side & ~lid_or_floor
        axis = mi.Vector3f(dr.select(side, 1, 0), dr.select(lid_or_floor, 1, 0), dr.select(back_or_end, 1, 0))
        normal = -axis * dr.sign(direction)  # into the water
        wall = dr.select(direction > 0, self.high, self.low)
        at = mi.Point3f(dr.select(axis > 0, wall, position))
        diffuse = mi.Frame3f(normal).to_world(mi.warp.square_to_cosine_hemisphere(turn))
        albedo = dr.select(lid_or_floor & (direction.y < 0), self.floor, self.albedo)
        albedo = dr.select(back_or_end & (direction.z > 0), self.end, albedo)
        lid = lid_or_floor & (direction.y > 0)
        pane = mi.Bool(False)
        if self.has_panes:
            cosine = dr.abs(dr.dot(axis, direction))
            mirrors = dr.select(lid, 0, dr.dot(axis, self.panes)) * pane_fresnel(cosine)
            both = mirrors + dr.maximum(1 - mirrors, 0) * albedo
            share = mirrors / dr.maximum(both, 1e-30)
            pane = turn.x < share
            rest = mi.Point2f((turn.x - share) / dr.maximum(1 - share, 1e-6), turn.y)
            turn = mi.Point2f(dr.select(pane, turn, dr.clip(rest, 0, _BELOW_ONE)))
            diffuse = mi.Frame3f(normal).to_world(mi.warp.square_to_cosine_hemisphere(turn))
            diffuse = mi.Vector3f(
                dr.select(pane, direction - 2 * dr.dot(direction, normal) * normal, diffuse)
            )
            albedo = both
        if not self.has_surface:
            return Bounce(albedo, pane, at, diffuse, pane)
        smooth = lid
        cosine, mirrored = dr.abs(direction.y), mi.Vector3f(direction.x, -direction.y, direction.z)
        if self.rough is not None:
            facets = mi.MicrofacetDistribution(mi.MicrofacetType.Beckmann, self.rough, sample_visible=True)
            # In the facets' own frame: the third component is the depth.
            back = mi.Vector3f(-direction.x, -direction.z, dr.maximum(direction.y, _LEAST_SINE))
            normal, _ = facets.sample(dr.normalize(back), turn)
            cosine = dr.dot(back, normal)
            onward = 2 * cosine * normal - back
            mirrored = mi.Vector3f(onward.x, -onward.z, onward.y)
        fresnel, _, _, _ = mi.fresnel(cosine, 1 / WATER_INDEX)
        return Bounce(
            dr.select(smooth, fresnel * self.surface, albedo),
            smooth | pane,
            at,
            dr.select(smooth, mirrored, diffuse),
            pane,
        )
