"""What no linearisation finds: effects that act only together, and then like another one.

Each equivalence has a closed form from which the fit begins; what shows only beside another effect begins
from typical sizes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.diagnosis.problem.candidates import Candidate, go_together
from lightfield.diagnosis.search.pool.fitted_sets import Pool
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.fitting.beam_width import WIDTH
from lightfield.scene.water.constituents import (
    REFERENCE_NM,
    chlorophyll_scattering_per_m,
    sediment_scattering_per_m,
)

#: Turns of the receiver, in degrees, from which a fit begins. Chosen: a start alone.
_TURNS_DEG = (6.0, 12.0)
#: The acceptance of a receiver is wider than the beam by this factor in its square, at least, and by the
#: other where it would not be; a tilt has this size at least. Chosen: a start alone.
_WIDER, _MUCH_WIDER, _LEAST_TILT_DEG = 1.05, 1.3, 0.02

#: A peaked beam is a Gaussian of so many of its half widths, on top of it so much of one as wide as a skirt
#: may be at least, seen through an acceptance of so many half widths. Chosen: starts alone.
_BROAD, _FRACTION, _NARROW, _ACCEPTED = (1.7, 2.8), 0.35, 1.2, 1.2

#: Wavelengths between which the slope of a constituent's scattering is taken, nm. Chosen: a start alone.
_BLUE_NM, _RED_NM = 450.0, 650.0
_SCATTERING, _SLOPE = "water.scattering_per_m", "water.scattering_slope"

#: Coordinate of a width in the fit: (10 / degrees)^2. Chosen: of order one.
_INVERSE_SQUARE = 100.0


@dataclass(frozen=True)
class Equivalence:
    """Effects that together do what another does.

    Parameters
    ----------
    single : str
        The effect that they imitate.
    together : tuple of str
    starts : callable
        From the scene values of a fit with `single`, and the half width of the beam, deg: coordinates by
        path, several of them.
    """

    single: str
    together: tuple[str, ...]
    starts: Callable[[Mapping[str, float], float], list[dict[str, float]]]


def _turned_receiver(values: Mapping[str, float], h: float) -> list[dict[str, float]]:
    """A Gaussian acceptance of width A about an axis turned by t, times a Gaussian beam of width h0, is a
    beam of width h that is tilted by -t (h / A)^2, where 1/h^2 = 1/h0^2 + 1/A^2.

    The beam of a table keeps its width.
    """
    tilt = values.get("lamp.tilt_x_deg", 0.0)
    out = []
    for turn in _TURNS_DEG:
        square = turn * h**2 / max(abs(tilt), _LEAST_TILT_DEG)
        if square <= _WIDER * h**2:
            square = _MUCH_WIDER * h**2
        beam = 1 / np.sqrt(1 / h**2 - 1 / square)
        begin = {
            "detector.acceptance_hwhm_deg": _INVERSE_SQUARE / square,
            "detector.tilt_x_deg": float(-tilt * square / h**2),
        }
        out.append(begin | ({WIDTH: float(np.log(beam))} if WIDTH in values else {}))
    return out


def _skirt_in_acceptance(values: Mapping[str, float], h: float) -> list[dict[str, float]]:
    """A beam that falls more and more slowly, exp(-ln2 (theta/h)^m) with m < 2, is the sum of two Gaussians,
    the wider one cut by an acceptance."""
    narrow = {
        "lamp.skirt_fraction": _FRACTION,
        "lamp.skirt_hwhm_deg": _NARROW * h,
        "detector.acceptance_hwhm_deg": _INVERSE_SQUARE / (_ACCEPTED * h) ** 2,
    }
    return [narrow | ({WIDTH: float(np.log(broad * h))} if WIDTH in values else {}) for broad in _BROAD]


def _scatters_alone(
    of: Callable[[float, ArrayLike], Array], path: str
) -> Callable[[Mapping[str, float], float], list[dict[str, float]]]:
    """Matter in the water scatters by a power of the wavelength; what it absorbs, others in the water do.

    Parameters
    ----------
    of : callable
        Its scattering, 1/m, by how much of it there is and the wavelength, nm.
    path : str
        How much there is.
    """

    def starts(values: Mapping[str, float], _: float) -> list[dict[str, float]]:
        middle, blue, red = of(values.get(path, 0.0), np.array([REFERENCE_NM, _BLUE_NM, _RED_NM]))
        if not middle > 0:
            return []
        slope = np.log(blue / red) / np.log(_RED_NM / _BLUE_NM)
        return [{_SCATTERING: float(values.get(_SCATTERING, 0.0) + middle), _SLOPE: float(slope)}]

    return starts


#: Every product of two effects that `benchmarks/imitations` finds to imitate a third, by fits of all of them,
#: and to which no linear model leads.
TABLE = (
    Equivalence("beam_tilt", ("acceptance", "detector_tilt"), _turned_receiver),
    Equivalence("beam_shape", ("beam_skirt", "acceptance"), _skirt_in_acceptance),
    *(
        Equivalence(name, ("scattering", "scattering_slope"), _scatters_alone(of, path))
        for name, of, path in (
            ("sediment", sediment_scattering_per_m, "water.sediment_g_per_m3"),
            ("chlorophyll", chlorophyll_scattering_per_m, "water.chlorophyll_mg_per_m3"),
        )
    ),
)

#: Effects that show only beside another one, which hides them by its own size while they are small: waves
#: dim what a surface mirrors, and at small slopes a surface that mirrors less is all that is seen of them;
#: scattering has a colour where there is some.
_BESIDE = {
    "waves": "surface_reflection",
    "scattering_slope": "scattering",
    "scattering_spectrum": "scattering",
}
#: Such a fit begins at so many typical sizes. Chosen.
_SIZES = (1.0, 3.0)


def try_beside(pool: Pool, node: FittedSet, candidate: Candidate) -> None:
    """Fit a set without one of its effects, with what shows only beside another one that it holds."""
    rest = tuple(c for c in node.explanation if c is not candidate)
    have = {c.name for c in node.explanation}
    for new in pool.problem.candidates:
        whole = (*rest, new)
        shows = _BESIDE.get(new.name) in {c.name for c in rest} and new.name not in have
        if not (shows and go_together(whole) and pool.affordable(whole)):
            continue
        known = node.fit.by_path
        sizes = [
            {
                p.path: float(np.clip(p.start + size * typical, p.low, p.high))
                for p, typical in zip(new.amplitudes, new.typical, strict=True)
            }
            for size in _SIZES
        ]
        pool.fit(whole, [Begin(known | start) for start in sizes])


def try_declared(pool: Pool, node: FittedSet, candidate: Candidate) -> None:
    """Fit what is known to do the same as one of the effects of a set, in its place."""
    rest = tuple(c for c in node.explanation if c is not candidate)
    for line in TABLE:
        if line.single != candidate.name:
            continue
        have = {c.name for c in rest}
        new = [c for c in pool.problem.candidates if c.name in line.together and c.name not in have]
        whole = (*rest, *new)
        found = {c.name for c in whole} >= set(line.together)
        if found and new and go_together(whole) and pool.affordable(whole):
            known, values = node.fit.by_path, node.fit.values
            width = values.get(WIDTH, pool.problem.forward.light.diffuse.width_deg)
            starts = [Begin(known | start) for start in line.starts(values, width)]
            if not starts:
                continue
            fitted = pool.fit(whole, starts, promised=pool.cost(node))
            pool.also_from(fitted.explanation, starts)  # where it was fitted before, from elsewhere
            _without_what_is_needless(pool, pool.nodes[fitted.key], rest, pool.cost(node))


def _without_what_is_needless(
    pool: Pool, fitted: FittedSet, others: tuple[Candidate, ...], most: float
) -> None:
    """Fit a set less one of some effects where that promises to cost no more than the one that it replaces:
    what helped an imitation, the truth does without."""
    for other in others:
        rest = [c for c in fitted.explanation if c is not other]
        if pool.promised_without(fitted, other) < most and pool.affordable(rest):
            pool.drop(fitted, other)
