"""A beam on the nodes of a tally that was kept by direction of emission.

Photons are shared between the nodes with the weights of B-splines, so the tally times the spline coefficients
of a beam is the light of that beam. The coefficients come from a least-squares fit, weighed so that the far
tail counts too.
"""

from __future__ import annotations

from math import pi

import numpy as np

from lightfield.render.response.grid import AngleNodes
from lightfield.scene import Lamp
from lightfield.scene.lamp.frame import beam_angles, is_round
from lightfield.scene.lamp.profile import relative_intensity

_FINE = 5  # angles per ring at which a beam is looked at
_FINE_PHI = 4  # azimuths per sector, likewise
_TAIL = 1e-3  # relative intensity below which a misfit no longer counts relatively


class BeamNodes:
    """Spline coefficients of beams.

    Parameters
    ----------
    hwhm_deg : float
        Typical width; decides how the fit is weighed.
    """

    def __init__(self, nodes: AngleNodes, hwhm_deg: float) -> None:
        self.nodes = nodes
        t = (np.arange((nodes.n_theta - 2) * _FINE) + 0.5) / _FINE
        theta = nodes.scale_rad * np.sinh(t * nodes.step)
        splines = ring_weights(t, nodes.n_theta)
        weight = 1 / (0.5 ** np.minimum((theta / np.radians(1.3 * hwhm_deg)) ** 2, 40) + _TAIL)
        self.fit = np.linalg.lstsq(splines * weight[:, None], np.diag(weight), rcond=1e-8)[0]
        phi = 2 * pi * np.arange(_FINE_PHI * nodes.n_phi) / (_FINE_PHI * nodes.n_phi)
        self.theta = theta
        across, along = np.sin(theta)[:, None], np.cos(theta)[:, None]
        self.directions = across * np.cos(phi), across * np.sin(phi), along
        # Linear interpolation damps the k-th harmonic of phi by sinc^2(k h / 2).
        # (The highest is its own alias and damped half as much, but rfft gives it half the weight as well.)
        self.damping = np.sinc(np.arange(nodes.n_phi // 2 + 1) / nodes.n_phi) ** 2

    def values(self, lamp: Lamp, stretch: float = 1.0) -> np.ndarray:
        """Coefficients of a beam's relative intensity, shape (nodes.size,); one per ring for a round beam.

        Parameters
        ----------
        stretch : float
            Of the beam with all its angles so much larger, its tilt too.
        """
        n_phi = self.nodes.n_phi
        if is_round(lamp):
            theta = self.theta / stretch
            return np.asarray(self.fit @ relative_intensity(lamp, theta, np.zeros_like(theta)))
        tilt = {name: stretch * getattr(lamp, name) for name in ("tilt_x_deg", "tilt_y_deg")}
        angles = beam_angles(lamp.model_copy(update=tilt), *self.directions)
        beam = relative_intensity(lamp, *(angle / stretch for angle in angles))
        # Harmonics that the sectors cannot hold are dropped here, not aliased.
        harmonics = np.fft.rfft(beam, axis=1)[:, : n_phi // 2 + 1] / (_FINE_PHI * self.damping)
        beam = np.fft.irfft(harmonics, n_phi, axis=1)
        return np.asarray(self.fit @ beam).ravel()


def ring_weights(t: np.ndarray, n_theta: int) -> np.ndarray:
    """Cubic B-splines of all rings at coordinates t (in knots), even about 0; shape (len(t), n_theta)."""
    low = np.floor(t).astype(int)
    f = t - low
    shares = (1 - f) ** 3, 3 * f**3 - 6 * f**2 + 4, -3 * f**3 + 3 * f**2 + 3 * f + 1, f**3
    weights = np.zeros((len(t), n_theta))
    for offset, share in zip((-1, 0, 1, 2), shares, strict=True):
        np.add.at(weights, (np.arange(len(t)), np.abs(low + offset)), share / 6)
    return weights
