"""Beams that are not round, as files, and one that is round and no Gaussian."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

#: A Gaussian of this half width whose middle lies so far beside the axis of the beam.
HWHM_DEG, ASIDE_DEG = 5.0, (1.5, 0.8)
ANGLES_DEG = np.concatenate([np.arange(0.0, 50.0, 0.25), np.arange(50.0, 91.0, 5.0)])
Shape = Callable[[np.ndarray, np.ndarray], np.ndarray]


def aside(theta_x_rad: np.ndarray, theta_y_rad: np.ndarray) -> np.ndarray:
    """Intensity over that on the axis."""
    (x0, y0), h = np.radians(ASIDE_DEG), np.radians(HWHM_DEG)
    away = (theta_x_rad - x0) ** 2 + (theta_y_rad - y0) ** 2 - x0 * x0 - y0 * y0
    return np.asarray(0.5 ** (away / h**2))


def flood(q: np.ndarray) -> np.ndarray:
    """A flat top with a wide, weak skirt; q is the angle over the half width."""
    top = (1 + np.exp(-1 / 0.16)) / (1 + np.exp((q - 1) / 0.16))
    return 0.93 * top + 0.07 * np.exp(-np.log(2) * (q / 3) ** 2)


def phi_table(path: Path, shape: Shape, phi_deg: np.ndarray) -> Path:
    """A CSV of angle_deg, phi_deg and intensity."""
    rows = ["angle_deg,phi_deg,intensity"]
    for phi in phi_deg:
        rows += [f"{a:.6g},{phi:.6g},{v:.9g}" for a, v in zip(ANGLES_DEG, _along(shape, phi), strict=True)]
    path.write_text("\n".join(rows) + "\n")
    return path


def ies(path: Path, shape: Shape, planes_deg: np.ndarray) -> Path:
    """A made-up luminaire file, IES LM-63, type C."""
    lines = ["IESNA:LM-63-2002", "[TEST] made up", "TILT=NONE"]
    lines += [f"1 1000 1.0 {len(ANGLES_DEG)} {len(planes_deg)} 1 2 0.1 0.1 0", "1.0 1.0 50"]
    lines += [" ".join(f"{v:.6g}" for v in angles) for angles in (ANGLES_DEG, planes_deg)]
    lines += [" ".join(f"{700 * v:.9g}" for v in _along(shape, plane)) for plane in planes_deg]
    path.write_text("\n".join(lines) + "\n")
    return path


def _along(shape: Shape, turn_deg: float) -> np.ndarray:
    theta, turn = np.radians(ANGLES_DEG), np.radians(turn_deg)
    return shape(theta * np.cos(turn), theta * np.sin(turn))
