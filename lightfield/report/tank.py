"""The tank from above and from the side, with the beam, the readings and where to measure next."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from lightfield.diagnosis.verdict.parts import PlaceToRead
from lightfield.report.style import DATA, FORMULA, MUTED, NARROW, RENDER, WIDTH, figure, label
from lightfield.scene import Tank

_SHOWN_BEHIND_M, _SHOWN_BEYOND_M = 0.8, 1.5  # of a long tank only the part with readings is drawn


def tank_figure(
    x_m: np.ndarray,
    y_m: np.ndarray,
    z_m: np.ndarray,
    tank: Tank | None = None,
    spots: Sequence[PlaceToRead] = (),
    hwhm_deg: float = 3.81,
    narrow: bool = False,
) -> Figure:
    """Plan and side view.

    Parameters
    ----------
    x_m, y_m, z_m : arrays, shape (n,), m
        Readings taken.
    tank : Tank, optional
        Without it the water has no walls.
    spots : sequence of PlaceToRead
        Readings to take: x_m, y_m, z_m, repeats.
    hwhm_deg : float
        Half width of the beam.
    """
    far = float(max([z_m.max(initial=1.0), *(spot.z_m for spot in spots)]))
    side = float(max(1.2 * np.abs(x_m).max(initial=0.5), 1.2 * np.abs(y_m).max(initial=0.5), 1.0))
    # x, y, z of what is drawn of unbounded water
    walls = tank.box_m if tank else ((-side, side), (-side, side), (0.0, np.inf))
    start, end = walls[2]
    reach = min(far + _SHOWN_BEYOND_M, end)
    with figure(*((NARROW, 5.0) if narrow else (WIDTH, 4.6))) as fig:
        above, beside = fig.subplots(2, 1, sharex=True)
        for axis, across, (low, high), name, title in (
            (above, x_m, walls[0], "x_m", "From above"),
            (beside, y_m, walls[1], "y_m", "From the side"),
        ):
            beam = _beam(axis, reach, hwhm_deg)
            if tank:
                box = (start, low), end - start, high - low
                water = Rectangle(*box, facecolor=RENDER, alpha=0.08, edgecolor="none")
                axis.add_patch(water)
                axis.add_patch(Rectangle(*box, fill=False, edgecolor=MUTED, linewidth=1.4))
                beam.set_clip_path(water)  # it ends at the walls
            axis.plot(z_m, across, "o", color=DATA, markersize=3, label="readings taken")
            _spots(axis, spots, name)
            axis.set_xlim(-_SHOWN_BEHIND_M, reach)
            axis.set_ylim(low - 0.12 * (high - low), high + 0.12 * (high - low))
            axis.grid(False)
            label(axis, "", f"{name[0]} (m)", title)
        beside.set_xlabel("z (m), from the lamp")
        if tank:
            at = reach, walls[1][1]
            above_it = "lid" if tank.surface == "none" else "water surface"
            beside.annotate(above_it, at, (-4, 3), textcoords="offset points", ha="right", color=MUTED)
        handles, names = above.get_legend_handles_labels()
        fig.legend(handles, names, loc="outside lower center", ncols=1 if narrow else 3)
    return fig


def _beam(axis: Axes, reach: float, hwhm_deg: float) -> Polygon:
    wide = reach * np.tan(np.radians(min(hwhm_deg, 80.0)))
    beam = Polygon(
        [(0, 0), (reach, wide), (reach, -wide)],
        closed=True,
        facecolor="#f2b632",
        alpha=0.28,
        edgecolor="none",
        label=f"beam to half intensity, ±{hwhm_deg:.3g}°",
    )
    axis.add_patch(beam)
    axis.plot([0], [0], marker=">", color=MUTED, markersize=11, linestyle="none")
    return beam


def _spots(axis: Axes, spots: Sequence[PlaceToRead], name: str) -> None:
    if not spots:
        return
    z, across = [spot.z_m for spot in spots], [getattr(spot, name) for spot in spots]
    axis.plot(
        z,
        across,
        "*",
        color=FORMULA,
        markersize=15,
        markeredgecolor="white",
        linestyle="none",
        label="measure here next",
    )
    for spot, x, y in zip(spots, z, across, strict=True):
        if spot.repeats > 1:
            axis.annotate(
                f"{spot.repeats} times", (x, y), (9, 6), textcoords="offset points", fontsize=9, color=FORMULA
            )
