"""A small basis for all beams a fit may try, so that a tally by direction of emission stays small and fast.

A tally split over the directions of emission is linear in the beam. Directions are a grid of (theta, phi) nodes, some two
hundred; the beams that occur in practice (any width, exponent, skirt, tilt and ellipticity within reason) span far fewer
dimensions. The basis is the leading singular vectors of a random family of such beams; what a beam loses by projection is
measured for every beam that is evaluated.
"""

from __future__ import annotations

from math import pi

import numpy as np

from lightfield.lamps.profile import relative_intensity
from lightfield.render.grid import AngleNodes
from lightfield.scene import Lamp

RANK = 48
FAMILY = 1500
FINE = 5


class BeamBasis:
    """Nodes over the direction of emission and the basis of beams on them.

    Parameters
    ----------
    nodes : AngleNodes
    hwhm_deg : float
        Typical width of the beams that will be asked for.
    """

    def __init__(self, nodes: AngleNodes, hwhm_deg: float) -> None:
        self.nodes = nodes
        theta = nodes.theta_rad
        # Fine angles and their hat-function weights: nodes follow the beam's curvature (see `coefficients`).
        step = np.arange(FINE) / FINE
        self.fine = np.concatenate(
            [theta[:-1, None] + np.diff(theta)[:, None] * step, theta[-1:, None]], axis=None
        )
        hats = np.array([np.interp(self.fine, theta, row) for row in np.eye(len(theta))])
        width = np.gradient(self.fine) * np.maximum(np.sin(self.fine), 0.2 * np.sin(theta[1]))
        self.hat_mean = hats * width / (hats * width).sum(axis=1, keepdims=True)
        phi = 2 * pi * np.arange(nodes.n_phi) / nodes.n_phi
        self.theta_grid, self.phi_grid = np.meshgrid(self.fine, phi, indexing="ij")
        areas = np.repeat(np.gradient(theta) * np.sin(np.maximum(theta, 0.3 * theta[1])), nodes.n_phi)
        self.scale = np.sqrt(areas)
        family = np.array([self._on_nodes(lamp) for lamp in _family(hwhm_deg)]) * self.scale
        family /= np.linalg.norm(family, axis=1, keepdims=True)
        self.vectors = np.linalg.svd(family, full_matrices=False)[2][:RANK]

    def compress(self, tally: np.ndarray) -> np.ndarray:
        """Tally over nodes, shape (rows, nodes, cells), to a tally over the basis, shape (RANK, rows, cells)."""
        return np.ascontiguousarray(np.einsum("kn,rnc->krc", self.vectors / self.scale, tally, optimize=True))

    def coefficients(self, lamp: Lamp) -> tuple[np.ndarray, float]:
        """Beam in the basis, shape (RANK,), and the relative error (in power) that the projection makes."""
        beam = self._on_nodes(lamp) * self.scale
        c = self.vectors @ beam
        return c, float(np.linalg.norm(beam - c @ self.vectors) / np.linalg.norm(beam))

    def _on_nodes(self, lamp: Lamp) -> np.ndarray:
        """Node values whose piecewise linear interpolant has the beam's power, shape (nodes,)."""
        x, y = beam_angles(lamp, self.theta_grid, self.phi_grid)
        fine = relative_intensity(lamp, x, y)
        at_nodes = fine[::FINE]
        # Interpolation overshoots a convex beam by h^2 I''/12, the mean over the hat by as much: twice the value minus
        # that mean cancels it.
        return np.asarray(2 * at_nodes - self.hat_mean @ fine).ravel()


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


def _family(hwhm_deg: float) -> list[Lamp]:
    rng = np.random.default_rng(7)
    beams = []
    for _ in range(FAMILY):
        values = {
            "hwhm_deg": hwhm_deg * np.exp(rng.uniform(-0.7, 0.7)),
            "shape_exponent": np.exp(rng.uniform(np.log(1.0), np.log(6.0))),
            "skirt_fraction": rng.choice([0.0, 1.0]) * rng.uniform(0, 0.5),
            "skirt_hwhm_deg": hwhm_deg * np.exp(rng.uniform(0.3, 2.0)),
            "ellipticity": np.exp(rng.uniform(-0.5, 0.5)),
            "tilt_x_deg": rng.normal(0, 0.35 * hwhm_deg),
            "tilt_y_deg": rng.normal(0, 0.35 * hwhm_deg),
        }
        beams.append(Lamp.model_construct(**{**Lamp().__dict__, **{k: float(v) for k, v in values.items()}}))
    return beams
