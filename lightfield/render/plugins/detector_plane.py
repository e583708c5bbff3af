"""Mitsuba plugin `detector_plane`: a plane of small receivers, or a wall of collimators, as a sensor."""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from lightfield.render.response.grid import cell_centres
from lightfield.scene import Detector
from lightfield.scene.receiver import RECEIVER


class DetectorPlane(mi.Sensor):
    """Plane perpendicular to z that faces the lamp (-z); read by the `photon_tracer` integrator.

    Properties: `z_m`, `width_m`, `height_m` (default: the width), `quantity` ("irradiance",
    "scalar_irradiance", "radiance"), `full_angle_deg`, `aim` ("axis" or "lamp"), `acceptance_hwhm_deg`,
    `cosine_error`, `tilt_x_deg`; a nested film gives the number of cells. Row 0 of the image is the top (+y),
    column 0 is -x: as seen from the lamp with +x to the right.

    Not supported: camera-type integrators (there is no ray to start), other orientations.
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.z_m = float(props["z_m"])
        self.width_m = float(props.get("width_m", 2.0))
        self.height_m = float(props.get("height_m", self.width_m))
        self.receiver = Detector.model_validate({name: props[name] for name in RECEIVER if name in props})

    def centres(self) -> tuple[np.ndarray, np.ndarray]:
        """Cell centres x_m (n_x,) and y_m (n_y,), both ascending."""
        nx, ny = self.film().size()
        return cell_centres(self.width_m, nx), cell_centres(self.height_m, ny)

    def bbox(self) -> mi.ScalarBoundingBox3f:
        """Extent of the plane."""
        x, y = 0.5 * self.width_m, 0.5 * self.height_m
        return mi.ScalarBoundingBox3f(mi.ScalarPoint3f(-x, -y, self.z_m), mi.ScalarPoint3f(x, y, self.z_m))

    def traverse(self, callback: mi.TraversalCallback) -> None:
        """Nothing to differentiate."""

    def to_string(self) -> str:
        """Readable summary."""
        return f"DetectorPlane[z {self.z_m} m, {self.width_m} x {self.height_m} m, {self.receiver.quantity}]"
