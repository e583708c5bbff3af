"""Wall-clock and processor time. On a busy machine only the second can be compared. Standard library only."""

from __future__ import annotations

import resource
import time


class Clock:
    """Seconds since it was made: `wall` as the clock on the wall, `cpu` of all threads of this process."""

    def __init__(self) -> None:
        self._wall, self._cpu = time.perf_counter(), self._used()

    @staticmethod
    def _used() -> float:
        usage = resource.getrusage(resource.RUSAGE_SELF)
        return usage.ru_utime + usage.ru_stime

    def read(self) -> dict[str, float]:
        """Both times since the start."""
        return {"wall": time.perf_counter() - self._wall, "cpu": self._used() - self._cpu}
