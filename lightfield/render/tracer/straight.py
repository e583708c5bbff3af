"""Light that has met nothing, at every detector cell: by lines to places in the cells and by first flights.

The light along a straight line is known, and the mean over a cell is that over places in it. Of a beam that
is wide against the cells few lines to each tell more than many photons do, which cross it by chance; of a
narrow beam only photons find the cells that are lit. Both are lines between the window and a place, drawn
with known densities, and are added up by the power heuristic (Veach and Guibas 1995, SIGGRAPH, 419): a line
counts the more where it is drawn as others are drawn there less. Lines to cells, which are evenly spread, are
worth more than their number.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, log, pi, radians, sqrt

import drjit as dr
import mitsuba as mi
import numpy as np

from lightfield.render.tracer.absorption import Absorption
from lightfield.render.tracer.flight import TransportProblem, deposit, from_lamp, tally_flight
from lightfield.render.tracer.planes import Crossing
from lightfield.render.tracer.sobol import ScrambledSobol
from lightfield.scene.lamp.frame import beyond_window
from lightfield.scene.lamp.profile import solid_angle_sr

#: Lines to places are as many as photons of a launch; but to a cell at least so many, and at most: in single
#: precision a sum of many equal numbers drifts.
_FEWEST_LINES, _MOST_LINES = 4, 256
#: A line to a cell is worth as many photons that cross it, times the square of the beam's width in cells and
#: the root of the number of lines: in cells of 3 cm at 4.5 m four lines tell as much as photons do of a beam
#: of 1 degree. Chosen; `tests/physics/light/test_straight.py` compares both from 0.2 to 30 degrees.
_WORTH = 8
#: Where photons across the brightest cell are worth less than this part of its lines, none are drawn. Chosen.
_LEAST_WORTH = 0.3
#: Lines to cells do not find light that comes from a small part of a window, wider than so many half widths
#: of the beam where it is nearest. The view of a collimator, which ends sharply, counts as so many times less
#: solid angle. Chosen.
_WIDE_WINDOW, _EDGE = 0.2, 10.0


@dataclass(frozen=True)
class Launch:
    """What is to be tallied, and into what: the light that the first flights of so many photons bring.

    Parameters
    ----------
    seed, first : int
        As `walk.trace` takes them: other photons, other lines.
    mirror_x : bool
        The tally is of twice as many photons, each at its mirror image, too.
    digits : int
        Two to the power of it lines lead to every cell.
    worth : float
        Photons across a cell that tell as much as one of its lines. 0: photons tell all; infinite: lines do.
    """

    tally: mi.Float
    problem: TransportProblem
    absorption: Absorption
    b0: mi.Float
    photons: int
    seed: int
    first: int
    mirror_x: bool
    digits: int = 0
    worth: float = 0.0

    @property
    def counted(self) -> int:
        """Photons that the tally is of."""
        return self.photons * (2 if self.mirror_x else 1)

    @property
    def tallied(self) -> mi.Float:
        """The same as a variable: another launch needs no new kernel."""
        return dr.opaque(mi.Float, self.counted)

    @property
    def lines_per_area(self) -> mi.Float:
        """Lines to cells, 1/m^2."""
        return dr.opaque(mi.Float, 1 << self.digits) * self.problem.planes.per_area

    def told_by_lines(self, per_place: mi.Float) -> mi.Float:
        """The part of a line of light that counts where lines to cells draw it; the rest where photons do.

        Parameters
        ----------
        per_place : mi.Float
            Density of one photon's crossings there, 1/m^2.
        """
        photons = self.tallied * per_place / (dr.opaque(mi.Float, self.worth) * self.lines_per_area)
        return dr.rcp(1 + photons * photons)

    def add(
        self, crossing: Crossing, start: mi.Point3f, direction: mi.Vector3f, light: mi.Float, u: mi.Float
    ) -> None:
        """Tally the light of a line, times m^2 and without its attenuation, where it ends."""
        planes, histories, none = self.problem.planes, self.problem.histories, mi.UInt32(0)
        responses, straight = planes.reading(crossing, direction)
        depth = self.absorption.depth(start, direction, crossing.distance)
        value = light * dr.exp(-depth - self.b0 * crossing.distance)
        excess = dr.maximum(crossing.distance - straight, 0)
        row = histories.row(histories.channel(none, none, none, none, mi.Float(0)), excess, u, none)
        deposit(self.tally, row, planes, crossing.cell, value, responses, crossing.hits)
        if self.mirror_x:
            deposit(self.tally, row, planes, crossing.mirror_cell, value, responses, crossing.mirror_hits)


def tally_straight(launch: Launch) -> None:
    """Add to the tally what first flights bring, on average: by lines to cells, by flights, or by both."""
    problem, planes = launch.problem, launch.problem.planes
    assert problem.emission.nodes is None, "direct light is not told apart by its direction"
    if problem.emission.lamp.profile == "pencil":
        by_flights(launch)
        return
    lines = min(max(launch.photons // len(planes.listed), _FEWEST_LINES), _MOST_LINES)
    digits = lines.bit_length() - 1
    worth = _worth(problem) * 2 ** (0.5 * digits)
    nearest = planes.nearest_m + problem.emission.lamp.apparent_distance_m
    brightest = launch.counted * problem.emission.density.max() / nearest**2 * planes.cell_m2
    if brightest < _LEAST_WORTH * worth * 2**digits:
        worth = inf
    launch = replace(launch, digits=digits, worth=worth)
    if worth > 0:
        _to_cells(launch)
    if worth < inf:
        _of_photons(launch)


def _worth(problem: TransportProblem) -> float:
    """What a line to a cell is worth if it is the only one: by the width of the light that is seen.

    Nothing where it is not beam and view that make it what it is on the planes, but the window.
    """
    lamp, planes, receiver = problem.emission.lamp, problem.planes, problem.planes.receiver
    narrow = pi / solid_angle_sr(lamp)  # 1/rad^2
    distance = planes.nearest_m + lamp.apparent_distance_m
    if lamp.radius_m > _WIDE_WINDOW * distance / sqrt(narrow):
        return 0.0
    if receiver.acceptance_hwhm_deg:
        narrow += log(2) / radians(receiver.acceptance_hwhm_deg) ** 2
    if receiver.quantity == "radiance":
        narrow += _EDGE / radians(0.5 * receiver.full_angle_deg) ** 2
    return _WORTH * (distance / planes.pitch_m) ** 2 / narrow


def by_flights(launch: Launch) -> None:
    """The same by first flights alone: of a beam without width no line from a place in a cell finds any."""
    problem = launch.problem
    index = dr.arange(mi.UInt32, launch.photons) + dr.opaque(mi.UInt32, launch.first)
    rng = _streams(launch.seed, launch.first, index)
    photon = from_lamp(problem.emission.sample(index, ScrambledSobol(launch.seed), rng))
    reach = problem.surfaces.meet(photon.position, photon.direction, mi.Bool(True)).distance
    tally_flight(launch.tally, problem, launch.absorption, launch.b0, photon, reach, launch.mirror_x, rng)


def _to_cells(launch: Launch) -> None:
    """Lines that lead to places in every cell."""
    emission, planes, digits = launch.problem.emission, launch.problem.planes, launch.digits
    index = dr.arange(mi.UInt32, len(planes.listed) << digits)
    # As variables: another number of lines, as for other cells, needs no new kernel.
    shift, within = dr.opaque(mi.UInt32, digits), dr.opaque(mi.UInt32, (1 << digits) - 1)
    number = dr.gather(mi.UInt32, planes.listed, index >> shift)
    rng = _streams(launch.seed, launch.first, index)
    turns = mi.sample_tea_32(dr.opaque(mi.UInt32, _key(launch.seed, launch.first)), number)
    u, v = _spread(index & within, digits, turns, rng)
    place, cell = planes.place(number, u, v)
    ray = place - emission.on_window(rng.next_float32(), rng.next_float32())
    full = dr.norm(ray)
    direction = mi.Vector3f(ray / full)
    in_water = beyond_window(full, place.z, planes.apparent)
    start = mi.Point3f(place.x - direction.x * in_water, place.y - direction.y * in_water, 0)
    reach = launch.problem.surfaces.meet(start, direction, mi.Bool(True)).distance
    crossing = planes.straight_to(place, cell, direction, reach)
    per_place = direction.z / (full * full)  # solid angle of a square metre
    part = launch.told_by_lines(emission.density_towards(direction) * per_place)
    light = emission.towards(direction) * per_place * part * launch.tallied / launch.lines_per_area
    # A cell's image has lines of its own.
    replace(launch, mirror_x=False).add(crossing, start, direction, light, rng.next_float32())


@dr.syntax
def _of_photons(launch: Launch) -> None:
    """Lines on which photons leave the lamp, to every plane."""
    problem, mirror_x, add, told = launch.problem, launch.mirror_x, launch.add, launch.told_by_lines
    emission, planes = problem.emission, problem.planes
    index = dr.arange(mi.UInt32, launch.photons) + dr.opaque(mi.UInt32, launch.first)
    rng = _streams(launch.seed, launch.first, index)
    begun = emission.sample(index, ScrambledSobol(launch.seed), rng)
    start, direction, weight = (
        mi.Point3f(begun.position),
        mi.Vector3f(begun.direction),
        mi.Float(begun.weight),
    )
    reach = problem.surfaces.meet(start, direction, mi.Bool(True)).distance
    density = emission.density_towards(direction)
    plane = mi.UInt32(0)
    while plane < planes.count:
        crossing = planes.first_crossing(plane, start, direction, reach, mirror_x)
        if (weight > 0) & (crossing.hits | crossing.mirror_hits):
            full = crossing.distance + planes.apparent / direction.z
            per_place = density * direction.z / (full * full)
            add(crossing, start, direction, weight * (1 - told(per_place)), rng.next_float32())
        plane += 1


def _spread(
    index: mi.UInt32, digits: int, turns: tuple[mi.UInt32, mi.UInt32], rng: mi.PCG32
) -> tuple[mi.Float, mi.Float]:
    """Points number `index` of 2^digits in the unit square, evenly spread.

    Hammersley's: every rectangle of one part in so many has one, here anywhere in it. Which has which is
    drawn anew for every cell and launch, by its `turns`: errors are independent.
    """
    shift, kept = (dr.opaque(mi.UInt32, n) for n in (32 - digits, ((1 << digits) - 1) << (32 - digits)))
    plain = index << shift, dr.brev(index)
    u, v = (mi.Float((at ^ turn) & kept) * 2.0**-32 for at, turn in zip(plain, turns, strict=True))
    part = dr.opaque(mi.Float, 2.0**-digits)
    return u + part * rng.next_float32(), v + part * rng.next_float32()


def _streams(seed: int, first: int, index: mi.UInt32) -> mi.PCG32:
    """Random numbers of their own for every line."""
    low, high = mi.sample_tea_32(dr.opaque(mi.UInt32, _key(seed, first)), index)
    return mi.PCG32(
        size=dr.width(index), initstate=(mi.UInt64(high) << 32) + mi.UInt64(low), initseq=mi.UInt64(index)
    )


def _key(*numbers: int) -> int:
    """A hash that no stream of the walk has."""
    return int(np.random.SeedSequence([0x6C696E65, *numbers]).generate_state(1)[0])
