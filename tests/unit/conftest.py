"""A rendering made with NumPy, so that outputs are tested against known light and without Mitsuba."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.axis import Axis
from matplotlib.text import Text

from lightfield.render.response.bookkeeping import Bookkeeping
from lightfield.scene import Scene

LOG2 = np.log(2)


def gaussian_light(scene, x, y, z):
    """Gaussian x inverse square x Beer-Lambert, written out a second time: unit on-axis intensity, 1/m^2."""
    lamp, water = scene.lamp, scene.water
    attenuation = water.absorption_per_m + water.scattering_per_m
    dx, dy = x - lamp.offset_x_m, y - lamp.offset_y_m
    r = np.sqrt(dx**2 + dy**2 + z**2)
    theta_x, theta_y = np.degrees(np.arctan2(dx, z)), np.degrees(np.arctan2(dy, z)) / lamp.ellipticity
    beam = np.exp(-LOG2 * (theta_x**2 + theta_y**2) / lamp.hwhm_deg**2)
    return beam * np.exp(-attenuation * r) / r**2 * z / r


@dataclass(frozen=True)
class StandIn:
    """Direct light by the formula, a known glow as diffuse light, and honest noise."""

    scene: Scene
    grid: SimpleNamespace
    glow: float = 0.0
    noise: float = 0.01
    seed: int = 3
    reached: float = 0.01

    @property
    def settings(self):
        return SimpleNamespace(seed=self.seed, rel_error=0.02)

    @property
    def response(self):
        return SimpleNamespace(photons=5_000_000_000)

    @property
    def energy(self):
        return Bookkeeping(0.0182, 0.011, 0.006, 0.0012, unfinished=0.0, roulette=0.0)

    def truth(self, part="all"):
        z, y, x = np.meshgrid(self.grid.z_m, self.grid.y_m, self.grid.x_m, indexing="ij")
        direct = gaussian_light(self.scene, x, y, z)
        diffuse = self.glow * np.exp(-LOG2 * (x**2 + y**2) / 0.8**2) / z**2
        return {"all": direct + diffuse, "direct": direct, "diffuse": diffuse}[part][None]

    def maps(self, wavelengths_nm=None, part="all"):
        n = len(self.scene.detector.bands_nm) if wavelengths_nm is None else len(wavelengths_nm)
        truth = np.repeat(self.truth(part), n, axis=0)
        stderr = self.noise * truth
        deviate = np.random.default_rng(self.seed).standard_normal(truth.shape)
        return truth + stderr * deviate, stderr


@pytest.fixture(scope="session")
def make():
    """Function that makes a stand-in rendering: `make(pixels=65, glow=..., noise=..., **scene values)`."""

    def build(pixels=65, planes=(4.5, 6.5, 8.5), width=2.0, glow=0.0, noise=0.01, **values):
        scene = Scene.from_dict(
            {
                "name": "stand-in",
                "lamp": {"profile": "gaussian", "hwhm_deg": 3.81},
                "water": {"absorption_per_m": 0.1},
                "detector": {"planes_m": list(planes), "width_m": width, "pixels": pixels},
            }
        ).with_values({path.replace("__", "."): value for path, value in values.items()})
        cells = (np.arange(pixels) + 0.5) * width / pixels - width / 2
        grid = SimpleNamespace(x_m=cells, y_m=cells, z_m=np.array(planes, float), pitch_x_m=width / pixels)
        return StandIn(scene, grid, glow, noise)

    return build


@pytest.fixture(scope="session")
def light():
    return gaussian_light


@pytest.fixture(scope="session")
def words_alone():
    """Function that replaces drawing on a `MonkeyPatch`: only the words of figures reach a page."""

    def said(part):
        """Of an axis its label alone: what stands at its ticks is known once it is drawn."""
        if isinstance(part, Axis):
            yield part.label.get_text()
            return
        if isinstance(part, Text):
            yield part.get_text()
        for inner in part.get_children():
            yield from said(inner)

    def words(figure, name):
        return f"<svg>{' '.join(said(figure))}</svg>"

    return lambda patch: patch.setattr("lightfield.report.page.to_svg", words)


@pytest.fixture
def undrawn(monkeypatch, words_alone):
    """Figures are made, but only their words reach the page: drawing takes most of a page's time."""
    words_alone(monkeypatch)


@pytest.fixture(scope="session", autouse=True)
def few_replicates():
    """A diagnosis draws fewer readings here, on whose number no answer hangs (`search/test_cascade.py`).

    They take a tenth of its time. Tests of the physics and of the whole program draw all of them.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("lightfield.diagnosis.search.preparation.REPLICATES", 199)
        yield
