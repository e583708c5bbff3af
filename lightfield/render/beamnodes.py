"""A beam on the nodes of a tally that was kept by direction of emission.

Photons are shared between the nodes of a (theta, phi) grid with the weights of linear interpolation, so the
tally times the node values is the light of the beam's interpolant. Plain node values would make that
interpolant too wide (by h^2 I''/12 on average); the values used here are corrected for it.
"""

from __future__ import annotations

from math import pi

import numpy as np

from lightfield.lamps.profile import relative_intensity
from lightfield.render.grid import AngleNodes
from lightfield.scene import Lamp

FINE = 4  # steps between two polar nodes


class BeamNodes:
    """Beam values on emission nodes.

    Parameters
    ----------
    nodes : AngleNodes
    """

    def __init__(self, nodes: AngleNodes) -> None:
        self.nodes = nodes
        theta = nodes.theta_rad
        step = np.arange(FINE) / FINE
        self.fine = np.concatenate(
            [theta[:-1, None] + np.diff(theta)[:, None] * step, theta[-1:, None]], axis=None
        )
        hats = np.array([np.interp(self.fine, theta, row) for row in np.eye(len(theta))])
        area = hats * np.gradient(self.fine) * np.maximum(np.sin(self.fine), 0.1 * np.sin(theta[1]))
        self.hat_mean = area / area.sum(axis=1, keepdims=True)
        phi = 2 * pi * np.arange(nodes.n_phi) / nodes.n_phi
        self.theta_grid, self.phi_grid = np.meshgrid(self.fine, phi, indexing="ij")
        # Linear interpolation damps the k-th harmonic of phi by sinc^2(k h / 2).
        harmonic = np.fft.fftfreq(nodes.n_phi, 1 / nodes.n_phi)
        self.damping = np.sinc(harmonic / nodes.n_phi) ** 2

    def values(self, lamp: Lamp) -> np.ndarray:
        """Corrected relative intensity of a beam on the nodes, shape (nodes.size,)."""
        x, y = beam_angles(lamp, self.theta_grid, self.phi_grid)
        fine = relative_intensity(lamp, x, y)
        polar = 2 * fine[::FINE] - self.hat_mean @ fine
        if np.ptp(polar, axis=1).max() > 1e-12:
            polar = np.fft.ifft(np.fft.fft(polar, axis=1) / self.damping, axis=1).real
        return np.asarray(polar).ravel()


def beam_angles(lamp: Lamp, theta: np.ndarray, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Beam-frame angles (theta_x, theta_y), rad, of directions given in the frame of the tank."""
    if lamp.tilt_x_deg == 0 and lamp.tilt_y_deg == 0:
        return theta * np.cos(phi), theta * np.sin(phi)
    direction = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    axis = np.array([np.tan(np.radians(lamp.tilt_x_deg)), np.tan(np.radians(lamp.tilt_y_deg)), 1.0])
    axis /= np.linalg.norm(axis)
    right = np.array([axis[2], 0.0, -axis[0]]) / np.hypot(axis[0], axis[2])
    x, y, z = np.tensordot(np.array([right, np.cross(axis, right), axis]), direction, axes=1)
    sine = np.hypot(x, y)
    scale = np.where(sine > 1e-12, np.arctan2(sine, z) / np.maximum(sine, 1e-12), 1.0)
    return x * scale, y * scale
