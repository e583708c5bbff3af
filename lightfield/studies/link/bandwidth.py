"""Bandwidth that the lengths of the traced paths leave: where 3 dB, electrical, of the transfer are lost.

    H(f) = [D + sum over paths  S(e) exp(-2 pi i f n_g e / c_0)] / [D + sum S(e)],   |H(f_3dB)| = 1 / sqrt(2)

D is the light that comes straight, S(e) what was scattered, by its path in excess of the straight line. Where
less than 1 - 1 / sqrt(2) of the light was scattered, what comes straight is enough: there is no limit.

Its error has three parts: photons (jackknife over the batches of the trace), the steps in which paths are
tallied (a tally twice as coarse, whose error is four times as large, differs by three errors), and what lies
between the distances that were asked at.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from lightfield.arrays import TINY, Array, jackknife_stderr

#: Speed of light in m/s (exact in the SI).
LIGHT_M_PER_S = 299792458.0
#: Group index of water, n - w dn/dw: by it travels what is sent, by the refractive index only the phase. At
#: 500 nm, to 1.2 % from 450 to 600 nm and from fresh to sea water (Quan & Fry 1995, Appl. Opt. 34, 3477; see
#: `water.molecular.refractive_index`).
GROUP_INDEX = 1.36
#: Steps in which paths are tallied: at an excess of a centimetre a step is a quarter of it, which leaves 1 %
#: of the bandwidth (tests/unit/studies/link/test_bandwidth.py). Odd: every second one makes a tally too.
PATH_NODES = 201
#: Electrical bandwidth: where the impulse response has lost half of its electrical power.
HALF_POWER = np.sqrt(0.5)
#: Frequencies at which that is looked for, Hz.
_FREQUENCIES = np.geomspace(1e4, 1e12, 1200)
#: Of a second-order interpolation: a step twice as wide errs by this much more.
_COARSER = 3.0


def bandwidth_of(direct: Array, by_path: Array, excess_m: Array) -> tuple[Array, Array]:
    """Bandwidth and its standard error at n places, Hz; infinite, and NaN, where there is no limit.

    Parameters
    ----------
    direct : array, shape (n,)
    by_path : array, shape (n_batches, n_steps, n)
        Scattered light by independent parts of a trace, at the steps of the path.
    excess_m : array, shape (n_steps,), m
        Rising; the path in excess of the straight line.
    """
    if not len(excess_m):  # nothing that was scattered arrived
        return np.full(len(direct), np.inf), np.full(len(direct), np.nan)
    whole = by_path.mean(axis=0)
    found = _three_db(direct, whole, excess_m)
    count = len(by_path)
    parts = np.array([_three_db(direct, (count * whole - one) / (count - 1), excess_m) for one in by_path])
    halves, steps = coarser(whole, excess_m)
    with np.errstate(invalid="ignore"):
        photons = jackknife_stderr(parts)
        tallied = np.abs(_three_db(direct, halves, steps) - found) / _COARSER
        return found, np.hypot(photons, tallied)


def coarser(by_path: Array, excess_m: Array) -> tuple[Array, Array]:
    """The tally that every second step alone would have made, by linear sharing, and these steps.

    Parameters
    ----------
    by_path : array, shape (n_steps, n)
    """
    kept = np.arange(0, len(excess_m), 2)
    if kept[-1] != len(excess_m) - 1:
        kept = np.append(kept, len(excess_m) - 1)
    steps = excess_m[kept]
    low = np.clip(np.searchsorted(steps, excess_m, side="right") - 1, 0, len(steps) - 2)
    share = (excess_m - steps[low]) / (steps[low + 1] - steps[low])
    out = np.zeros((len(steps), by_path.shape[1]))
    np.add.at(out, low, (1 - share)[:, None] * by_path)
    np.add.at(out, low + 1, share[:, None] * by_path)
    return out, steps


def _three_db(direct: Array, by_path: Array, excess_m: Array) -> Array:
    """Frequency at which every place's transfer first falls below half power, Hz, shape (n,)."""
    turn = np.exp(-2j * np.pi * np.outer(_FREQUENCIES, excess_m * GROUP_INDEX / LIGHT_M_PER_S))
    transfer = np.abs(direct + turn @ by_path) / np.maximum(direct + by_path.sum(axis=0), TINY)
    # At frequencies that the steps do not resolve they must not make a limit where there is none.
    limited = direct < HALF_POWER * (direct + by_path.sum(axis=0))
    found = [_first_below(c) if ends else np.inf for c, ends in zip(transfer.T, limited, strict=True)]
    return np.array(found)


def _first_below(transfer: Array) -> float:
    below = np.flatnonzero(transfer < HALF_POWER)
    if not below.size:
        return float("inf")
    k = int(below[0])
    if k == 0:
        return float(_FREQUENCIES[0])
    return float(np.exp(np.interp(HALF_POWER, transfer[[k, k - 1]], np.log(_FREQUENCIES[[k, k - 1]]))))


def between_nodes(z_m: Array, nodes_m: Array, bandwidth_hz: Array, stderr_hz: Array) -> tuple[Array, Array]:
    """Bandwidth between the distances it was asked at, and its error with that of the interpolation.

    Without a limit up to the first distance that has one: no curve leads there. The farther, the more is
    scattered: a distance beyond it without a limit had too few photons; beyond the last with one nothing is
    known: NaN.

    Parameters
    ----------
    z_m, nodes_m : array, m
        Distances asked for, and asked at.
    bandwidth_hz, stderr_hz : array, shape of `nodes_m`, Hz
    """
    limited = np.isfinite(bandwidth_hz)
    values, error = np.full(len(z_m), np.inf), np.full(len(z_m), np.nan)
    at, width = np.log(nodes_m[limited]), np.log(bandwidth_hz[limited])
    if len(at) < 2:
        return values, error
    first, last = nodes_m[limited][[0, -1]]
    values[z_m > last] = np.nan
    inside = (z_m >= first) & (z_m <= last)
    where = np.log(z_m[inside])
    curve = PchipInterpolator(at, width)(where)
    # Between the nodes: as much as a cubic and a straight line part.
    relative = np.interp(where, at, np.nan_to_num(stderr_hz[limited] / bandwidth_hz[limited]))
    between = np.abs(curve - np.interp(where, at, width))
    values[inside] = np.exp(curve)
    error[inside] = values[inside] * np.hypot(relative, between)
    return values, error
