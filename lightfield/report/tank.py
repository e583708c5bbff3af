"""The tank from above and from the side, with the beam, the readings and where to measure next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from lightfield.report.style import DATA, FORMULA, MUTED, RENDER, WIDTH, figure, label

SHOWN_BEHIND_M, SHOWN_BEYOND_M = 0.8, 1.5  # of a long tank only the part with readings is drawn


def tank_figure(
    x_m: np.ndarray,
    y_m: np.ndarray,
    z_m: np.ndarray,
    tank: Mapping[str, float] | None = None,
    spots: Sequence[Mapping[str, Any]] = (),
    hwhm_deg: float = 3.81,
) -> Figure:
    """Plan and side view.

    Parameters
    ----------
    x_m, y_m, z_m : arrays, shape (n,), m
        Readings taken.
    tank : mapping, optional
        width_m, depth_m, length_m, behind_lamp_m, lamp_depth_m; without it the water has no walls.
    spots : sequence of mappings
        Readings to take: x_m, y_m, z_m, repeats.
    hwhm_deg : float
        Half width of the beam.
    """
    far = float(max([z_m.max(initial=1.0), *(spot["z_m"] for spot in spots)]))
    reach = (
        min(far + SHOWN_BEYOND_M, tank["length_m"] - tank["behind_lamp_m"]) if tank else far + SHOWN_BEYOND_M
    )
    side = float(max(1.2 * np.abs(x_m).max(initial=0.5), 1.2 * np.abs(y_m).max(initial=0.5), 1.0))
    with figure(WIDTH, 4.6) as fig:
        above, beside = fig.subplots(2, 1, sharex=True)
        for axis, across, name, title in (
            (above, x_m, "x_m", "From above"),
            (beside, y_m, "y_m", "From the side"),
        ):
            low, high = _walls(tank, name) if tank else (-side, side)
            if tank:
                start = -tank["behind_lamp_m"]
                axis.add_patch(
                    Rectangle(
                        (start, low),
                        tank["length_m"],
                        high - low,
                        facecolor=RENDER,
                        alpha=0.08,
                        edgecolor="none",
                    )
                )
                axis.add_patch(
                    Rectangle(
                        (start, low), tank["length_m"], high - low, fill=False, edgecolor=MUTED, linewidth=1.4
                    )
                )
            _beam(axis, reach, hwhm_deg)
            axis.plot(z_m, across, "o", color=DATA, markersize=3, label="readings taken")
            _spots(axis, spots, name)
            axis.set_xlim(-SHOWN_BEHIND_M, reach)
            axis.set_ylim(low - 0.12 * (high - low), high + 0.12 * (high - low))
            axis.grid(False)
            label(axis, "", f"{name[0]} (m)", title)
        beside.set_xlabel("z (m), from the lamp")
        if tank:
            top = tank["lamp_depth_m"]
            beside.annotate(
                "water surface", (reach, top), (-4, 3), textcoords="offset points", ha="right", color=MUTED
            )
        handles, names = above.get_legend_handles_labels()
        fig.legend(handles, names, loc="outside lower center", ncols=3)
    return fig


def _walls(tank: Mapping[str, float], name: str) -> tuple[float, float]:
    if name == "x_m":
        return -tank["width_m"] / 2, tank["width_m"] / 2
    return tank["lamp_depth_m"] - tank["depth_m"], tank["lamp_depth_m"]


def _beam(axis: Axes, reach: float, hwhm_deg: float) -> None:
    wide = reach * np.tan(np.radians(min(hwhm_deg, 80.0)))
    axis.add_patch(
        Polygon(
            [(0, 0), (reach, wide), (reach, -wide)],
            closed=True,
            facecolor="#f2b632",
            alpha=0.28,
            edgecolor="none",
            label=f"beam to half intensity, ±{hwhm_deg:.3g}°",
        )
    )
    axis.plot([0], [0], marker=">", color=MUTED, markersize=11, linestyle="none")


def _spots(axis: Axes, spots: Sequence[Mapping[str, Any]], name: str) -> None:
    if not spots:
        return
    z, across = [spot["z_m"] for spot in spots], [spot[name] for spot in spots]
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
        if int(spot.get("repeats", 1)) > 1:
            axis.annotate(
                f"{int(spot['repeats'])} times",
                (x, y),
                (9, 6),
                textcoords="offset points",
                fontsize=9,
                color=FORMULA,
            )
