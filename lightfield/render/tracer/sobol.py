"""Low-discrepancy points whose errors can be trusted: the plane's Sobol sequence, Owen-scrambled by hashing.

A lattice that is only shifted at random covers the beam as evenly, but then two numbers per batch decide the
errors of all detector cells at once. Owen's scrambling keeps the points stratified and makes the errors of
different cells as good as independent, so that the chi-square of a map means what it says.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

_BUTTERFLY = ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF), (16, 0x0000FFFF))


class ScrambledSobol:
    """Points of one batch.

    Parameters
    ----------
    seed : int
        Batches of different seeds are independent.
    """

    def __init__(self, seed: int) -> None:
        keys = np.random.default_rng([seed, 0x6C616D70]).integers(0, 2**32, (2, 2, 3), dtype=np.uint32)
        odd_plain_even = (keys | np.array([1, 0, 0], np.uint32)) & ~np.array([0, 0, 1], np.uint32)
        self.keys = [
            [[dr.opaque(mi.UInt32, int(key)) for key in keys_of_round] for keys_of_round in keys_of_axis]
            for keys_of_axis in odd_plain_even
        ]

    def point(self, index: mi.UInt32) -> tuple[mi.Float, mi.Float]:
        """Two coordinates in [0, 1] of the points number `index`."""
        # The matrix of the second axis, Pascal's triangle modulo 2, is a Kronecker power: five steps do it.
        second = mi.UInt32(index)
        for distance, mask in _BUTTERFLY:
            second ^= (second >> distance) & mi.UInt32(mask)
        return self._scrambled(mi.UInt32(index), 0), self._scrambled(second, 1)

    def _scrambled(self, bits: mi.UInt32, axis: int) -> mi.Float:
        """Coordinate, given with reversed bits, under Owen's scrambling (after Burley 2020, JCGT 9, 4).

        Each step is a permutation in which a bit depends on lower bits only. With constants drawn anew for
        every batch the errors of distant cells are uncorrelated; with Burley's fixed ones they are not.
        """
        for odd, plain, even in self.keys[axis]:
            bits = bits * odd + plain
            bits ^= bits * even
        return mi.Float(dr.brev(bits)) * 2.0**-32
