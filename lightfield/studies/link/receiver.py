"""What turns light into bits: photocurrent, its noise, errors per bit.

    i1 = 2 R P, i0 = 0                          photocurrent of a mark and of a space (on-off keying)
    sigma^2 = 2 q (i + i_b) B + i_n^2 B         shot noise, background, amplifier; B = bit rate / 2
    Q = (i1 - i0) / (sigma1 + sigma0),  BER = erfc(Q / sqrt(2)) / 2

(Agrawal 2010, Fiber-Optic Communication Systems, 4th ed., eq. 4.6.8 to 4.6.11.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.errors import UsageError
from lightfield.studies import photocurrent

#: A lamp is seen where its signal is so many times the noise in this bandwidth (20 readings a second).
SEEN_SNR, SEEN_HZ = 10.0, 10.0
#: What receivers there are, and room beside them: what it is called, least, largest and unit.
_RANGES = {
    "area_mm2": ("area", 1e-6, 1e8, "mm²"),
    "responsivity_a_per_w": ("responsivity", 1e-6, 1e9, "A/W"),
    "noise_a_per_sqrt_hz": ("amplifier noise", 1e-30, 1.0, "A/√Hz"),
    "background_a": ("background", 0.0, 1e3, "A"),
    "bit_rate_per_s": ("bit rate", 1e-3, 1e12, "bit/s"),
}


@dataclass(frozen=True)
class Receiver:
    """What turns light into bits.

    Parameters
    ----------
    area_mm2 : float
        Of the photodiode.
    responsivity_a_per_w : float
        Mean over the band; the scene's `detector.response` says how wavelengths count within it.
    noise_a_per_sqrt_hz : float
        Of the amplifier, referred to its input.
    background_a : float
        Photocurrent of ambient light, and dark current.
    bit_rate_per_s : float
    ber : float
        Errors per bit that are accepted.
    """

    area_mm2: float = 13.0
    responsivity_a_per_w: float = 0.25
    noise_a_per_sqrt_hz: float = 5e-12
    background_a: float = 0.0
    bit_rate_per_s: float = 1e6
    ber: float = 1e-6

    def __post_init__(self) -> None:
        for name, (called, low, high, unit) in _RANGES.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise UsageError(
                    "impossible number",
                    where=called,
                    found=value,
                    rule=f"{low:g} to {high:g} {unit}",
                    remedy="a number in that range",
                )
        if not 0 < self.ber < 0.5:
            raise UsageError("impossible number", where="ber", found=self.ber, rule="above 0, below 0.5",
                             remedy="1e-6 is usual")  # fmt: skip

    def q(self, power_w: Array, eye: Array | float = 1.0) -> Array:
        """Q of received power, W; `eye` is the part of the swing that neighbouring bits leave."""
        B = self.bit_rate_per_s / 2
        mark = 2 * self.responsivity_a_per_w * power_w
        one, zero = (np.sqrt(self._variance(i, B)) for i in (mark, 0.0 * mark))
        return np.asarray(mark * eye / (one + zero))

    def error_rate(self, power_w: Array) -> Array:
        """Errors per bit."""
        from scipy.special import erfc

        return np.asarray(0.5 * erfc(self.q(power_w) / np.sqrt(2)))

    @property
    def needed_q(self) -> float:
        """Q that the accepted error rate asks for."""
        from scipy.special import erfcinv

        return float(np.sqrt(2) * erfcinv(2 * self.ber))

    def seen_snr(self, power_w: Array) -> Array:
        """Signal over noise of a slow reading."""
        current = self.responsivity_a_per_w * power_w
        return np.asarray(current / np.sqrt(self._variance(current, SEEN_HZ)))

    def _variance(self, current: Array, bandwidth: float) -> Array:
        return photocurrent.variance(current, self.background_a, self.noise_a_per_sqrt_hz, bandwidth)
