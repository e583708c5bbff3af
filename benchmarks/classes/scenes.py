"""Fifteen scenes as the package reads them, and the same as lines for the walking program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

#: Classes of light of the package, whose numbers begin with -1 for direct light. They are the first ones of
#: `walk.c`, which tells light that met walls twice and the surface, the last two, from that which did not.
#: Mirrors are the surface and panes.
CLASSES = ("direct", "scattered", "walls", "walls, scattered", "mirrors", "mirrors, scattered")
FIRST_CLASS, WALKED_CLASSES = -1, 8
#: Refractive index of water under air at 525 nm, to three digits (Quan and Fry 1995, Appl. Opt. 34, 3477).
WATER_INDEX = 1.34
#: The same of panes, which are of glass.
GLASS_INDEX = 1.5
ALL_ROUND = ("x", "y")
Parts = dict[str, dict[str, Any]]


@dataclass(frozen=True)
class Case:
    """One scene.

    Parameters
    ----------
    name : str
    parts : dict
        Sections of the scene file; whatever the light depends on is stated, nothing is left to a default.
    photons : float
        Photons to walk.
    mirrored : tuple of str
        Axes, "x" or "y", in which the light is its own mirror image.
    """

    name: str
    parts: Parts
    photons: float
    mirrored: tuple[str, ...] = ALL_ROUND

    @property
    def planes_m(self) -> tuple[float, ...]:
        """Distances of the planes."""
        return tuple(self.parts["detector"]["planes_m"])

    @property
    def cells(self) -> int:
        """Cells along a side of the square planes."""
        return int(self.parts["detector"]["pixels"])

    def walked(self, photons: float, seed: int, batches: int) -> str:
        """The scene as lines for `walk.c`, from the same numbers but not by the package's code."""
        water, lamp, detector = self.parts["water"], self.parts["lamp"], self.parts["detector"]
        phase = water["phase"]
        lines: dict[str, float] = {
            "photons": photons,
            "seed": seed,
            "batches": batches,
            "hwhm_deg": lamp["hwhm_deg"],
            "offset_x": lamp.get("offset_x_m", 0.0),
            "offset_y": lamp.get("offset_y_m", 0.0),
            "tilt_x_deg": lamp.get("tilt_x_deg", 0.0),
            "tilt_y_deg": lamp.get("tilt_y_deg", 0.0),
            "behind": lamp.get("apparent_distance_m", 0.0),
            "radius": lamp.get("radius_m", 0.0),
            "a": water["absorption_per_m"],
            "b": water["scattering_per_m"],
            "g": phase.get("g", 0.0),
            "ff_n": phase.get("n", 0.0),
            "ff_mu": phase.get("mu", 0.0),
            "gradient": water.get("gradient_per_m2", 0.0),
            "gradient_centre": water.get("gradient_centre_m", 0.0),
            "half": 0.5 * detector["width_m"],
            "cells": detector["pixels"],
            "acceptance_deg": detector.get("acceptance_hwhm_deg", 0.0),
        }
        if tank := self.parts.get("tank"):
            panes, bare = tank.get("panes", "none"), tank.get("pane_reflectance", 0.0)
            lines |= {
                "tank": 1,
                "width": tank["width_m"],
                "depth": tank["depth_m"],
                "length": tank["length_m"],
                "back": tank["behind_lamp_m"],
                "lamp_depth": tank["lamp_depth_m"],
                "wall": tank["wall_albedo"],
                "floor": min(tank["wall_albedo"] * tank.get("floor_over_walls", 1.0), 1.0),
                "surface": float(tank["surface"] == "flat"),
                "slope_deg": tank.get("surface_slope_deg", 0.0),
                "index": WATER_INDEX,
                "glass_sides": bare if panes != "none" else 0.0,
                "glass_others": bare if panes == "all" else 0.0,
                "glass": GLASS_INDEX,
            }
        places = [f"planes {len(self.planes_m)}", "z " + " ".join(f"{z!r}" for z in self.planes_m)]
        return "\n".join([*(f"{name} {value!r}" for name, value in lines.items()), *places, ""])


def _water(a: float, b: float, g: float = 0.924, **more: float) -> dict[str, Any]:
    phase = {"type": "henyey-greenstein", "g": g}
    return {"absorption_per_m": a, "scattering_per_m": b, "phase": phase, **more}


def _tank(
    size_m: tuple[float, float, float],
    lamp_depth_m: float,
    albedo: float,
    surface: str = "none",
    **more: float | str,
) -> dict[str, Any]:
    """Width, depth and length; half a metre of water behind the lamp."""
    width, depth, length = size_m
    return {
        "width_m": width, "depth_m": depth, "length_m": length, "behind_lamp_m": 0.5,
        "lamp_depth_m": lamp_depth_m, "wall_albedo": albedo, "surface": surface, **more,
    }  # fmt: skip


def _planes(planes_m: tuple[float, ...], width_m: float, pixels: int, **more: float) -> dict[str, Any]:
    return {"planes_m": list(planes_m), "width_m": width_m, "pixels": pixels, **more}


SIDEWAYS = ("x",)
SCENES = (
    Case(
        "clear open water, narrow beam",
        {
            "water": _water(0.05, 0.05),
            "lamp": {"hwhm_deg": 2.0},
            "detector": _planes((2.0, 5.0, 9.0), 0.9, 9),
        },
        1e8,
    ),
    Case(
        "turbid open water",
        {
            "water": _water(0.1, 0.7, 0.95),
            "lamp": {"hwhm_deg": 4.0},
            "detector": _planes((2.0, 4.0, 6.0), 1.4, 7),
        },
        4e7,
    ),
    Case(
        "light turned back, wide lamp",
        {
            "water": _water(0.1, 0.4, 0.5),
            "lamp": {"hwhm_deg": 25.0},
            "detector": _planes((1.5, 3.0, 4.5), 2.0, 5),
        },
        4e7,
    ),
    Case(
        "dark tow tank under waves of 5 deg",
        {
            "water": _water(0.08, 0.15),
            "lamp": {"hwhm_deg": 14.0},
            "tank": _tank((3.66, 2.44, 12.0), 0.8, 0.0, "flat", surface_slope_deg=5.0),
            "detector": _planes((2.0, 4.5, 7.0), 1.4, 7),
        },
        1.2e8,
        SIDEWAYS,
    ),
    Case(
        "tow tank, walls 0.3, flat surface",
        {
            "water": _water(0.1, 0.3),
            "lamp": {"hwhm_deg": 6.0},
            "tank": _tank((3.66, 2.44, 12.0), 1.22, 0.3, "flat"),
            "detector": _planes((2.0, 4.5, 7.0), 1.8, 9),
        },
        1.2e8,
        SIDEWAYS,
    ),
    Case(
        "narrow bright tank, walls 0.8",
        {
            "water": _water(0.1, 0.2),
            "lamp": {"hwhm_deg": 8.0},
            "tank": _tank((1.2, 1.2, 8.0), 0.6, 0.8),
            "detector": _planes((2.0, 4.0, 6.0), 1.2, 9),
        },
        8e7,
    ),
    Case(
        "shallow absorbing tank under a mirror",
        {
            "water": _water(0.4, 0.2, 0.9),
            "lamp": {"hwhm_deg": 12.0},
            "tank": _tank((3.0, 1.0, 8.0), 0.4, 0.2, "flat"),
            "detector": _planes((1.5, 3.0, 4.5), 0.7, 7),
        },
        1.6e8,
        SIDEWAYS,
    ),
    Case(
        "short tank, wide lamp",
        {
            "water": _water(0.15, 0.4, 0.85),
            "lamp": {"hwhm_deg": 30.0},
            "tank": _tank((2.0, 2.0, 4.0), 1.0, 0.6),
            "detector": _planes((1.0, 2.0, 3.4), 2.0, 7),
        },
        8e7,
    ),
    Case(
        "floor ten times the walls",
        {
            "water": _water(0.1, 0.2),
            "lamp": {"hwhm_deg": 12.0},
            "tank": _tank((3.0, 2.0, 9.0), 1.0, 0.08, floor_over_walls=10.0),
            "detector": _planes((2.0, 4.0, 6.0), 1.4, 7),
        },
        1.2e8,
        SIDEWAYS,
    ),
    Case(
        "lamp off the middle and tilted",
        {
            "water": _water(0.1, 0.25, 0.9),
            "lamp": {
                "hwhm_deg": 8.0,
                "offset_x_m": 0.4,
                "offset_y_m": -0.2,
                "tilt_x_deg": 6.0,
                "tilt_y_deg": 4.0,
            },
            "tank": _tank((3.0, 2.0, 9.0), 0.9, 0.4, "flat"),
            "detector": _planes((2.0, 4.0, 6.0), 1.4, 7),
        },
        1.2e8,
        (),
    ),
    Case(
        "source 1.5 m behind the window, Fournier-Forand",
        {
            "water": {
                "absorption_per_m": 0.1,
                "scattering_per_m": 0.4,
                "phase": {"type": "fournier-forand", "n": 1.1, "mu": 3.5835},
            },
            "lamp": {"hwhm_deg": 6.0, "apparent_distance_m": 1.5},
            "detector": _planes((2.0, 4.0, 6.0), 1.4, 7),
        },
        3e7,
    ),
    Case(
        "window of 0.3 m radius, receiver of 20 deg",
        {
            "water": _water(0.1, 0.5, 0.8),
            "lamp": {"hwhm_deg": 5.0, "radius_m": 0.3},
            "detector": _planes((1.0, 3.0, 5.0), 1.4, 7, acceptance_hwhm_deg=20.0),
        },
        4e7,
    ),
    Case(
        "dark tank, absorption grows along it",
        {
            "water": _water(0.15, 0.3, gradient_per_m2=0.03, gradient_centre_m=3.25),
            "lamp": {"hwhm_deg": 10.0},
            "tank": _tank((2.5, 2.0, 10.0), 1.0, 0.0),
            "detector": _planes((2.0, 4.0, 6.0), 1.4, 7),
        },
        6e7,
    ),
    Case(
        "tank of glass, wide lamp",
        {
            "water": _water(0.15, 0.4, 0.85),
            "lamp": {"hwhm_deg": 25.0},
            "tank": _tank((1.4, 1.0, 3.2), 0.45, 0.0, "flat", panes="all", pane_reflectance=1.0),
            "detector": _planes((0.8, 1.6, 2.4), 0.84, 7),
        },
        1.2e8,
        SIDEWAYS,
    ),
    Case(
        "flume with sides of glass, lamp off the middle",
        {
            "water": _water(0.1, 0.3, 0.9),
            "lamp": {"hwhm_deg": 12.0, "offset_x_m": 0.12, "offset_y_m": 0.05},
            "tank": _tank((1.0, 0.8, 6.0), 0.35, 0.3, "flat", panes="sides", pane_reflectance=0.9),
            "detector": _planes((1.5, 3.0, 4.5), 0.7, 7),
        },
        1.2e8,
        (),
    ),
)
