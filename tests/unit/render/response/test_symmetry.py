"""What breaks a mirror image is told: without it two cells would share photons that are not alike.

For every field of a scene that a trace depends on: where light that is known without photons, direct and
reflected, is not the same at -x or at -y, `symmetric` says so, and where it is the same it says that too.
"""

from __future__ import annotations

import numpy as np
import pytest
from beams import aside, phi_table
from perturbed import changed

from lightfield.formula.closed_form import direct_field
from lightfield.render.reflected.reflected_light import ReflectedLight
from lightfield.render.response.symmetry import symmetric
from lightfield.scene import Scene
from lightfield.scene.acts import TRACED, Acts
from lightfield.scene.all_parameters import paths_on

#: A place, and its images at -x and at -y.
AT = np.array([[0.3, 0.4, 3.0], [-0.3, 0.4, 3.0], [0.3, -0.4, 3.0]]).T
#: Reflected light is worked out in single precision.
ALIKE = 1e-5
MIRRORED = {
    "lamp": {
        "profile": "two-component", "hwhm_deg": 12.0, "skirt_fraction": 0.1, "ellipticity": 1.2,
        "apparent_distance_m": 0.3, "radius_m": 0.05,
    },
    "water": {"gradient_per_m2": 0.01, "layer_absorption_per_m": 0.1, "layer_centre_m": 2.0},
    "tank": {
        "wall_albedo": 0.5, "width_m": 2.0, "depth_m": 2.0, "lamp_depth_m": 1.0, "length_m": 8.0,
    },
    "detector": {"planes_m": [3.0], "acceptance_hwhm_deg": 60.0, "cosine_error": 0.1},
}  # fmt: skip


@pytest.fixture(scope="module")
def bases(tmp_path_factory: pytest.TempPathFactory) -> list[Scene]:
    """Symmetric scenes; a quarter of a measured beam has a half of one beside it, or all of one."""
    plain, folder = Scene.from_dict(MIRRORED), tmp_path_factory.mktemp("beams")
    found = [plain]
    for name, to_deg in (("half", 180.0), ("whole", 360.0)):
        for of, end in (("one", 90.0), ("two", to_deg)):
            file = phi_table(folder / f"{name}_{of}.csv", aside, np.arange(0.0, end + 1, 15.0))
            if of == "one":
                beam = {"lamp.profile": "table", "lamp.intensity_table": str(file)}
                found.append(plain.with_values(beam))
    return found


def images_alike(scene: Scene) -> tuple[bool, bool]:
    """Is the light the same at -x, and at -y?"""
    reflected = ReflectedLight.at(scene, *AT).evaluate(scene, 0.1)
    here = np.array([direct_field(scene, *AT), reflected])
    return (
        np.allclose(here[:, 0], here[:, 1], rtol=ALIKE, atol=0),
        np.allclose(here[:, 0], here[:, 2], rtol=ALIKE, atol=0),
    )


@pytest.fixture
def few_patches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Walls of few patches have the mirror images of many."""
    for name, number in (("_FEWEST_PATCHES", 100), ("_MOST_PATCHES", 100), ("_MOST_PARTS", 2)):
        monkeypatch.setattr(f"lightfield.render.reflected.room.{name}", number)


@pytest.mark.usefixtures("few_patches")
@pytest.mark.parametrize("path", paths_on(TRACED | Acts.REFLECTION))
def test_a_broken_mirror_image_is_told(path: str, bases: list[Scene]) -> None:
    for scene in bases:
        assert symmetric(scene) == (True, True)
        other = changed(scene, path)
        assert symmetric(other) == images_alike(other)
