"""The photon walk: one Dr.Jit loop through water and whatever surfaces there are.

What is estimated, at every detector cell, is the power of the light that crosses it, split by its history:

    R[h] = sum over flights  W  T(t)  1[flight crosses the cell, history h] / A
    W    = w_0  rho_0^m  exp(-a_0 L)

A photon flies freely with the *reference* scattering coefficient b_0; absorption never ends a walk but
weighs it by exp(-a_0 L). Each flight after the first, of which `straight` knows better, is tallied at every
plane that it would cross before the next surface, with the expected value T(t) = exp(-b_0 t) instead of the
yes or no of a real crossing. Histories are the numbers of scatterings n, wall hits m, surface reflections k,
the excess path over the straight line, and (for fits) the direction of emission.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, wraps
from typing import NamedTuple, ParamSpec, TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np

from lightfield.render.response.bookkeeping import Bookkeeping
from lightfield.render.tracer.absorption import Absorption
from lightfield.render.tracer.flight import (
    Ledger,
    Photon,
    TransportProblem,
    after,
    first_free_flight,
    free_flight,
    from_lamp,
    tally_flight,
)
from lightfield.render.tracer.sobol import ScrambledSobol
from lightfield.render.tracer.straight import Launch, tally_straight

_MAX_FLIGHTS = 4000
PHOTONS_PER_LANE = 64
Given = ParamSpec("Given")
Walked = TypeVar("Walked")


class _Start(NamedTuple):
    """What a launch begins with."""

    tally: mi.Float  # of every history in every cell
    number: mi.UInt32  # of each lane's first photon
    stride: mi.UInt32  # to the number of its next
    rng: mi.PCG32
    points: ScrambledSobol


def _as_raised(walk: Callable[Given, Walked]) -> Callable[Given, Walked]:
    """Interrupts come out of a loop as such: Dr.Jit turns whatever stops one into an error of its own."""

    @wraps(walk)
    def walked(*args: Given.args, **settings: Given.kwargs) -> Walked:
        try:
            return walk(*args, **settings)
        except RuntimeError as error:
            cause: BaseException | None = error
            while isinstance(cause, RuntimeError):
                cause = cause.__cause__
            if isinstance(cause, KeyboardInterrupt | SystemExit):
                raise cause from None
            raise

    return walked


@_as_raised
@dr.syntax
def trace(
    problem: TransportProblem,
    photons: int,
    seed: int,
    first: int = 0,
    mirror_x: bool = False,
    direct: bool = True,
) -> tuple[np.ndarray, Bookkeeping]:
    """Trace one batch of photons.

    Parameters
    ----------
    photons : int
        Number of photons of the batch.
    seed : int
        Same seed, same result.
    first : int
        Number of the first photon: a longer batch can be traced in parts.
    mirror_x : bool
        Also tally the mirror image at -x (only right in a scene that is symmetric in x).
    direct : bool
        Tally light that has met nothing.

    Returns
    -------
    sums : array, shape (histories.size, planes.cells), per m^2 (per m^2 sr for radiance)
        For unit on-axis radiant intensity, summed over as many photons as `counted` says.
    bookkeeping : Bookkeeping
        Per photon.
    """
    each, lanes = _launch(photons)
    tally, number, stride, rng, points = _start(
        problem.histories.size * problem.planes.cells, lanes, seed, first
    )
    absorption, b0 = Absorption(problem.water), dr.opaque(mi.Float, problem.water.scattering_per_m)
    if direct:
        tally_straight(Launch(tally, problem, absorption, b0, each * lanes, seed, first, mirror_x))
    emission, planes, surfaces = problem.emission, problem.planes, problem.surfaces
    # What is no variable of the loop: Dr.Jit would take the parts of a problem for such.
    tally_along = partial(tally_flight, tally, problem, absorption, b0)
    then = partial(after, problem, absorption)

    # -------------------------------------------------------------- loop state
    started = mi.UInt32(0)  # photons that this lane has begun: a lane never waits for its neighbours
    alive = dr.zeros(mi.Bool, lanes)  # the lane's photon is under way
    photon = dr.zeros(Photon, lanes)
    flights = mi.UInt32(0)
    emitted, unfinished = mi.Float(0), mi.Float(0)
    ledger = dr.zeros(Ledger, lanes)

    while alive | (started < each):
        # ---------------------------------------------------------- a new photon, and its first flight
        if ~alive:
            photon = from_lamp(emission.sample(started * stride + number, points, rng))
            emitted += photon.weight
            started += 1
            flights = mi.UInt32(1)
            met = surfaces.meet(photon.position, photon.direction, mi.Bool(True))
            ahead = planes.ahead(photon.position, photon.direction)
            free, bias = first_free_flight(b0, ahead, met.distance, rng.next_float32())
            ledger.invented += photon.weight * (bias - 1)
            photon.weight *= bias
            photon, ledger = then(photon, ledger, met, free, rng)

        met = surfaces.meet(photon.position, photon.direction, photon.weight > 0)
        free = free_flight(b0, rng.next_float32())
        tally_along(photon, met.distance, mirror_x, rng)
        photon, ledger = then(photon, ledger, met, free, rng)
        flights += 1
        unfinished += dr.select(flights >= _MAX_FLIGHTS, photon.weight, 0)
        alive = (photon.weight > 0) & (flights < _MAX_FLIGHTS)

    # All outputs in one kernel: a sum asked for alone would walk every photon again.
    outputs = (emitted, ledger.absorbed, ledger.at_walls, ledger.escaped, unfinished, ledger.invented)
    dr.eval(tally, *outputs)
    books = [float(dr.sum(v)[0]) / (lanes * each) for v in outputs]
    sums = tally.numpy().reshape(problem.histories.size, planes.cells)  # no copy
    if planes.images is not None:
        sums /= planes.images.astype(np.float32)
    return sums, Bookkeeping(*books)


def _launch(photons: int) -> tuple[int, int]:
    """Photons of each lane, and lanes."""
    each = min(PHOTONS_PER_LANE, photons)
    return each, -(-photons // each)


def _start(size: int, lanes: int, seed: int, first: int) -> _Start:
    """The tally, all photons' numbers and all random numbers of a launch."""
    tally = dr.zeros(mi.Float, size)
    # A literal would be written out anew for every launch, and copied to be read.
    dr.make_opaque(tally)
    # What differs from batch to batch or from layout to layout is a variable: one kernel serves them all.
    number = dr.arange(mi.UInt32, lanes) + dr.opaque(mi.UInt32, first)
    stride = dr.opaque(mi.UInt32, lanes)
    # Hashed, because neighbouring streams of this generator are not independent in their first numbers.
    low, high = mi.sample_tea_32(
        dr.opaque(mi.UInt32, int(np.random.SeedSequence(seed).generate_state(1)[0])), number
    )
    rng = mi.PCG32(size=lanes, initstate=(mi.UInt64(high) << 32) + mi.UInt64(low), initseq=mi.UInt64(number))
    return _Start(tally, number, stride, rng, ScrambledSobol(seed))


def counted(photons: int, mirror_x: bool = False) -> int:
    """What to divide the sums of `trace` by: photons that a launch really traces, and their images."""
    each, lanes = _launch(photons)
    return each * lanes * (2 if mirror_x else 1)
