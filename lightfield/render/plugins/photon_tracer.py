"""Mitsuba plugin `photon_tracer`: forward light transport onto detector planes, from any Mitsuba scene."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from lightfield.errors import RenderError
from lightfield.render.plugins.detector_plane import DetectorPlane
from lightfield.render.plugins.lamp import LightfieldLamp
from lightfield.render.response.grid import Grid
from lightfield.render.tracer.absorption import ReferenceWater
from lightfield.render.tracer.flight import TransportProblem
from lightfield.render.tracer.histories import Histories, TallyLayout
from lightfield.render.tracer.planes import Planes
from lightfield.render.tracer.scattering import by_plugin
from lightfield.render.tracer.surfaces import OpenWater, Shapes
from lightfield.render.tracer.walk import counted, trace

_BATCHES = 8
_LARGEST_LAUNCH = 1 << 16  # photons; single precision drops what adds little to a large sum


class PhotonTracer(mi.ad.integrators.common.ADIntegrator):
    """Irradiance, scalar irradiance or collimated radiance on every `detector_plane` of a scene, in one pass.

    The estimator is that of `lightfield.render.tracer.walk`: for every flight of every photon after the
    first, the expected power through each plane that it would cross; beside it that of `straight` for direct
    light. The scene holds one `lightfield_lamp` with a homogeneous medium, any diffuse or smooth dielectric
    surfaces, and `detector_plane` sensors of the same size.

    Properties: `photons` (default 1e6; `spp` times the cells of the film, when `mi.render` is given `spp`).

    Not supported: several lamps or media, spectrally varying media (render one wavelength at a time), rough
    dielectrics, derivatives.
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.photons = int(props.get("photons", 1_000_000))

    def render(
        self,
        scene: mi.Scene,
        sensor: mi.Sensor | int = 0,
        seed: int = 0,
        spp: int = 0,
        develop: bool = True,
        evaluate: bool = True,
    ) -> mi.TensorXf:
        """Map of one sensor, shape (n_y, n_x, 2): value, standard error; row 0 is the top, column 0 is -x."""
        sensors = scene.sensors()
        mean, stderr = self.render_all(scene, int(seed), spp)
        # By identity: in a scene read from XML, sensors share an empty id.
        index = sensor if isinstance(sensor, int) else next(i for i, s in enumerate(sensors) if s is sensor)
        image = np.stack([mean[index], stderr[index]], axis=-1)[::-1]
        return mi.TensorXf(np.ascontiguousarray(image, dtype=np.float32))

    def render_all(self, scene: mi.Scene, seed: int = 0, spp: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """All sensors at once: mean and standard error, shape (n_sensors, n_y, n_x), y ascending."""
        lamp, sensors = _lamp(scene), _sensors(scene)
        medium = lamp.get_medium()
        if medium is None:
            raise RenderError(
                "the lamp is not in water",
                rule="a lightfield_lamp refers to the medium around it",
                remedy="nest <ref> to the medium in the emitter",
            )
        order = np.argsort([s.z_m for s in sensors])
        x, y = sensors[0].centres()
        pitch_x, pitch_y = sensors[0].width_m / len(x), sensors[0].height_m / len(y)
        grid = Grid(np.array([sensors[i].z_m for i in order]), x, y, pitch_x, pitch_y)
        water = _coefficients(medium)
        histories = Histories(TallyLayout(0, path_nodes=2))
        position = (lamp.lamp.offset_x_m, lamp.lamp.offset_y_m, 0.0)
        planes = Planes(grid, sensors[0].receiver, position, lamp.lamp.apparent_distance_m)
        surfaces = Shapes(scene) if scene.shapes() else OpenWater(planes)
        turn = by_plugin(medium.phase_function())
        problem = TransportProblem(surfaces, turn, lamp.emission, planes, histories, water)
        photons = max(spp * len(x) * len(y) or self.photons, _BATCHES) // _BATCHES
        maps = []
        for batch in range(_BATCHES):
            total = np.zeros(grid.shape)
            for first in range(0, photons, _LARGEST_LAUNCH):
                launch = min(_LARGEST_LAUNCH, photons - first)
                counts, _ = trace(problem, launch, seed * 1009 + batch, first=first)
                total += counts.sum(axis=0).reshape(grid.shape) * (launch / photons / counted(launch))
            maps.append(total * lamp.intensity)
        back = np.argsort(order)
        return np.mean(maps, axis=0)[back], (np.std(maps, axis=0, ddof=1) / np.sqrt(_BATCHES))[back]

    def to_string(self) -> str:
        """Readable summary."""
        return f"PhotonTracer[{self.photons} photons]"


def _lamp(scene: mi.Scene) -> LightfieldLamp:
    lamps = [emitter for emitter in scene.emitters() if isinstance(emitter, LightfieldLamp)]
    if len(lamps) != 1:
        raise RenderError(
            "cannot tell where the photons start",
            found=len(lamps),
            rule="exactly one lightfield_lamp in the scene",
        )
    return lamps[0]


def _sensors(scene: mi.Scene) -> list[DetectorPlane]:
    sensors = scene.sensors()
    wrong = [s for s in sensors if not isinstance(s, DetectorPlane)]
    if wrong or not sensors:
        raise RenderError("photon_tracer reads detector planes only", rule="every sensor is a detector_plane")

    def kind(s: DetectorPlane) -> tuple[object, ...]:
        return tuple(s.film().size()), s.width_m, s.height_m, s.receiver

    if any(kind(s) != kind(sensors[0]) for s in sensors):
        raise RenderError(
            "the detector planes differ",
            rule="one pass needs planes of equal size, cells and quantity",
            remedy="render scenes with equal planes one after the other",
        )
    return list(sensors)


def _coefficients(medium: mi.Medium) -> ReferenceWater:
    interaction = dr.zeros(mi.MediumInteraction3f)
    scattering, _, extinction = medium.get_scattering_coefficients(interaction)
    b, c = (np.array(v).ravel() for v in (scattering, extinction))
    if np.ptp(b) > 1e-6 or np.ptp(c) > 1e-6:
        raise RenderError(
            "the medium varies over the spectrum",
            rule="photon_tracer walks one wavelength at a time",
            remedy="give sigma_t and albedo as numbers",
        )
    return ReferenceWater(float(c[0] - b[0]), float(b[0]))
