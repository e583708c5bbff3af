"""What may be asked of a trace: one range of each number, wherever it is asked."""

from __future__ import annotations


class Allowed:
    """Least and most, as they are said."""

    def __init__(self, low: str, high: str) -> None:
        self.low, self.high, self.rule = float(low), float(high), f"{low} to {high}"

    def holds(self, value: float) -> bool:
        """Whether a number is one of those."""
        return self.low <= value <= self.high


REL_ERROR, PHOTONS, SEED = Allowed("1e-5", "1"), Allowed("1e3", "1e12"), Allowed("0", "2147483647")
