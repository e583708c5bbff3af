"""Angular shape of the beam: relative radiant intensity, and solid angle."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lightfield.arrays import Array
from lightfield.errors import SceneError
from lightfield.scene.curve import value_at
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.lamp.photometry import BeamTable, beam_table
from lightfield.scene.lamp.section import effective_angles, is_even, is_lopsided, oval, oval_widths
from lightfield.storage.tables import kept_by_tables

LN2 = math.log(2.0)
HALF_PI = 0.5 * math.pi
_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(24)
#: Nodes between the angles of a table, where it is linear; turns over a quarter of an oval beam, or all of a
#: lopsided one. Measured: 4e-7 of the solid angle at the ends of all ranges at once, with half of them 4e-5.
_FEW, _OF_OVAL = np.polynomial.legendre.leggauss(6), 128


def relative_intensity(lamp: Lamp, theta_x_rad: ArrayLike, theta_y_rad: ArrayLike) -> Array:
    """Radiant intensity over that on the beam axis, I / I(0).

    Gaussian family: exp(-ln2 (theta/hwhm)^m) + f exp(-ln2 (theta/hwhm_s)^2), over 1 + f; the paper's eq. 1 is
    m = 2, f = 0 with B = ln2 / hwhm^2. A departure multiplies it, on the axis too. Zero behind the
    lamp (theta > 90 deg), except for the isotropic lamp.

    Parameters
    ----------
    lamp : Lamp
        Profile, half width, shape, skirt, ellipticity, asymmetry.
    theta_x_rad, theta_y_rad : array, rad
        Beam-frame angles theta (cos phi, sin phi), broadcast against each other.

    Returns
    -------
    array
        In the broadcast shape.
    """
    x, y = np.asarray(theta_x_rad, dtype=float), np.asarray(theta_y_rad, dtype=float)
    if lamp.profile == "isotropic":
        return np.ones(np.broadcast_shapes(x.shape, y.shape))
    squared = x * x + y * y
    if lamp.profile == "pencil":
        return np.asarray((squared == 0.0).astype(float))
    across, up = effective_angles(lamp, x, y)
    stretched = squared if is_even(lamp) else across * across + up * up
    table = table_of(lamp)
    if table is None or table.is_round:
        light = radial_intensity(lamp, stretched)
    else:
        around = table.at(np.sqrt(stretched), np.arctan2(up, across))
        light = _departing(lamp, around, stretched)
    return np.asarray(light * (squared <= HALF_PI * HALF_PI))


def table_of(lamp: Lamp) -> BeamTable | None:
    """The measured beam, as wide as it is now; None of a lamp that is a formula."""
    if lamp.profile != "table":
        return None
    return beam_table(str(lamp.intensity_table)).wider(lamp.table_width)


def radial_intensity(lamp: Lamp, theta_squared: Array) -> Array:
    """I / I(0) against the squared effective angle, see `effective_angles`, without the cut at 90 deg.

    Of a table that is not round, the average around the axis.

    Parameters
    ----------
    lamp : Lamp
        Gaussian family or table.
    theta_squared : array, rad^2
        Squared effective angle.
    """
    return _departing(lamp, _without_departure(lamp, theta_squared), theta_squared)


def _departing(lamp: Lamp, shape: Array, theta_squared: Array) -> Array:
    if not lamp.profile_departure:
        return shape
    return shape * np.exp(value_at(lamp.profile_departure, np.degrees(np.sqrt(theta_squared))))


def _without_departure(lamp: Lamp, theta_squared: Array) -> Array:
    if (table := table_of(lamp)) is not None:
        return np.interp(np.sqrt(theta_squared), table.angle_rad, table.mean, right=0.0)
    q = theta_squared * (1.0 / math.radians(lamp.hwhm_deg) ** 2)
    if lamp.shape_exponent != 2.0:
        q = q ** (0.5 * lamp.shape_exponent)
    core = np.exp(-LN2 * q)
    if lamp.skirt_fraction == 0.0:
        return np.asarray(core)
    skirt = np.exp(theta_squared * (-LN2 / math.radians(lamp.skirt_hwhm_deg) ** 2))
    return np.asarray((core + lamp.skirt_fraction * skirt) / (1.0 + lamp.skirt_fraction))


def sections_of(lamp: Lamp, theta_rad: Array) -> tuple[Array, Array]:
    """Half planes of a beam as an even one: turns, rad, shape (k,), and I / I(0) in each, (k, n).

    Parameters
    ----------
    theta_rad : array, shape (n,), rad
        Angles from the axis.
    """
    table, squared = table_of(lamp), theta_rad * theta_rad
    if table is None or table.is_round:
        return np.zeros(1), radial_intensity(lamp, squared)[None]
    around = table.at(theta_rad, table.turn_rad[:, None])
    return table.turn_rad, _departing(lamp, around, squared)


@kept_by_tables(256)
def solid_angle_sr(lamp: Lamp) -> float:
    """Integral of the relative intensity over all directions: beam power over axial intensity, in sr.

    Parameters
    ----------
    lamp : Lamp
        Any profile with extent.

    Raises
    ------
    SceneError
        For a pencil beam, whose intensity is infinite.
    """
    if lamp.profile == "isotropic":
        return 4.0 * math.pi
    if lamp.profile == "pencil":
        raise SceneError(
            "a pencil beam has no solid angle", where="lamp.profile", rule="intensity is finite",
            remedy='use profile = "gaussian" with a small hwhm_deg',
        )  # fmt: skip
    theta, weight = _quadrature(lamp)
    if is_even(lamp):  # the average around the axis is all that counts
        return float(2.0 * math.pi * (radial_intensity(lamp, theta * theta) @ (weight * np.sin(theta))))
    phi, share = _turns(lamp)
    value = relative_intensity(lamp, np.outer(np.cos(phi), theta), np.outer(np.sin(phi), theta))
    return float(2.0 * math.pi * (share @ (value @ (weight * np.sin(theta)))))


def _turns(lamp: Lamp) -> tuple[Array, Array]:
    """Turns about the axis, rad, that stand for all, and the share of each."""
    table = table_of(lamp)
    if table is not None and not table.is_round:
        # Two Gauss nodes between half planes, where the table is linear.
        xx, xy, yy = oval(lamp)
        across, up = np.cos(table.turn_rad), np.sin(table.turn_rad)
        edges = np.unwrap(np.arctan2(xy * across + yy * up, xx * across + xy * up))
        if is_lopsided(lamp):  # between them the width changes too
            edges = np.unique(np.concatenate([edges, edges[0] + 2.0 * math.pi * np.arange(65) / 64]))
        half, middle = 0.5 * np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
        phi = middle[:, None] + half[:, None] * np.array([-1.0, 1.0]) / math.sqrt(3.0)
        return phi.ravel(), np.repeat(half / (2.0 * math.pi), 2)
    round_ = 4.0 if is_lopsided(lamp) or lamp.ellipticity_diagonal != 1.0 else 1.0
    return (np.arange(_OF_OVAL) + 0.5) * (round_ * HALF_PI / _OF_OVAL), np.full(_OF_OVAL, 1.0 / _OF_OVAL)


def _quadrature(lamp: Lamp) -> tuple[Array, Array]:
    """Gauss-Legendre nodes on pieces that follow the beam's scales, 0 to 90 degrees."""
    lopsided = math.hypot(lamp.asymmetry_x, lamp.asymmetry_y)
    sections = np.unique([1.0, *oval_widths(lamp), 1.0 - lopsided, 1.0 + lopsided])
    if (table := table_of(lamp)) is not None:
        edges: NDArray[Any] = np.outer(sections, table.angle_rad).ravel()
    else:
        steps = np.array(
            [0.25, 0.5, 0.75, 0.9, 0.95, 1.0, 1.05, 1.1, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 10.0]
        )
        widths = math.radians(lamp.hwhm_deg) * sections
        edges = np.concatenate([np.outer(widths, steps).ravel(), math.radians(lamp.skirt_hwhm_deg) * steps])
    if lamp.profile_departure:
        kinks = np.radians([angle for angle, _ in lamp.profile_departure if angle > 0])
        edges = np.concatenate([edges, np.outer(sections, kinks).ravel()])
    pieces = np.unique(np.concatenate([[0.0], edges[edges < HALF_PI], [HALF_PI]]))
    half: NDArray[Any] = 0.5 * np.diff(pieces)
    middle: NDArray[Any] = 0.5 * (pieces[1:] + pieces[:-1])
    x, w = (_GAUSS_X, _GAUSS_W) if table is None else _FEW
    return (middle[:, None] + half[:, None] * x).ravel(), (half[:, None] * w).ravel()
