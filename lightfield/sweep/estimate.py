"""What a plan will cost, said before it starts."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from lightfield.memory import byte_size
from lightfield.progress import duration
from lightfield.render.settings import PATH_NODES, batches_of
from lightfield.sweep.sharing import Trace
from lightfield.sweep.sweep_plan import SweepPlan

# Of one core of an ordinary machine; they serve the estimate alone.
#: Where light meets much and where it meets little. Measured: 7e5 a second in dense water between white walls
#: and 1.6e6 in open water; a slower core, and larger maps, take up to four times as long.
_PHOTONS_PER_SECOND = (1.5e5, 1.5e6)
#: Of a case, and of a value of its maps: evaluated, beside its formula, measured, compressed. Measured of 5
#: planes of 33 to 129 cells a side.
_SECONDS_PER_CASE, _SECONDS_PER_VALUE = 0.02, 2.6e-6
_BYTES_PER_VALUE = 3.3  # of a map on disk, after compression
_PROGRAM_BYTES = 450e6


@dataclass(frozen=True)
class Cost:
    """Seconds on one core, at least (with every budget of photons spent) and at most; bytes on disk, and of
    memory per worker."""

    least_trace_seconds: float
    trace_seconds: float
    block_seconds: float
    disk_bytes: float
    memory_bytes: float


def sweep_cost(plan: SweepPlan) -> Cost:
    """Cost of a plan, photon budgets spent in full."""
    values = float(plan.cases.count) * plan.cells * plan.bands
    maps = 2 * _BYTES_PER_VALUE * values if plan.settings.maps else 0.0
    derived = 10 * 8.0 * plan.cases.count * plan.bands * plan.grids[0].shape[0]
    tally = max((_tally_bytes(plan, trace) for trace in plan.traces), default=0.0)
    slow, fast = (len(plan.traces) * plan.settings.max_photons / rate for rate in _PHOTONS_PER_SECOND)
    return Cost(
        fast,
        slow,
        plan.cases.count * _SECONDS_PER_CASE + values * _SECONDS_PER_VALUE,
        maps + derived,
        # The sums, and twice the response while it is taken from them.
        _PROGRAM_BYTES + 3 * tally,
    )


def _tally_bytes(plan: SweepPlan, trace: Trace) -> float:
    mean = trace.reference.scattering_per_m * float(plan.grids[0].z_m.max()) * 1.2
    channels = mean + 4 * sqrt(mean) + 2 + (18 if trace.reference.wall_albedo > 0 else 0)
    rows = PATH_NODES * channels
    return batches_of(plan.cells, rows) * 4.0 * plan.cells * rows


def as_text(plan: SweepPlan) -> str:
    """The plan in a few lines for people."""
    cost, cases = sweep_cost(plan), plan.cases
    axes = " x ".join(f"{axis.name} ({axis.size})" for axis in cases.axes)
    lines = [f"cases: {cases.count} = {axes}"]
    if plan.problems:
        are = "is" if len(plan.problems) == 1 else "are"
        lines.append(f"       {len(plan.problems)} of them {are} impossible and will be recorded as failed")
    each = (cases.count - len(plan.problems)) / max(1, len(plan.traces))
    lines.append(f"traces: {len(plan.traces)}, {each:.4g} cases evaluated from each")
    for trace, own in zip(plan.traces[:_SHOWN], _own_values(plan), strict=True):
        r = trace.reference
        lines.append(
            f"  {trace.number + 1:4d}  a = {r.absorption_per_m:.4g} /m, b = {r.scattering_per_m:.4g} /m, "
            f"wall albedo {r.wall_albedo:.3g}{own}: {trace.cases} case{'s' * (trace.cases != 1)}"
        )
    if len(plan.traces) > _SHOWN:
        lines.append(f"  ... and {len(plan.traces) - _SHOWN} more")
    lines.append(f"blocks: {len(plan.blocks)} of up to {max(len(b.cases) for b in plan.blocks)} cases")
    lines.append(
        f"estimate for one core: tracing {duration(cost.least_trace_seconds)} to "
        f"{duration(cost.trace_seconds)} ({plan.settings.max_photons:.3g} photons each; less where the error "
        "asked for is reached before), "
        f"evaluating {duration(cost.block_seconds)}; store {byte_size(cost.disk_bytes)}; "
        f"memory {byte_size(cost.memory_bytes)} per worker"
    )
    return "\n".join(lines)


#: So many traces have a line, and what it says already.
_SHOWN = 8
_SAID = ("water.absorption_per_m", "water.scattering_per_m", "tank.wall_albedo")


def _own_values(plan: SweepPlan) -> list[str]:
    """What the cases of a trace have in common, beside what its line says; of the first traces."""
    found = []
    for number in range(min(len(plan.traces), _SHOWN)):
        first, *others = (plan.cases.values(int(k)) for k in np.flatnonzero(plan.trace_of_case == number))
        alike = {p: v for p, v in first.items() if p not in _SAID and all(v == other[p] for other in others)}
        told = (f"{v:g}" if isinstance(v, float) else str(v) for v in alike.values())
        found.append("".join(f", {path} = {text}" for path, text in zip(alike, told, strict=True)))
    return found
