"""What every field of a scene says that it acts on is what it changes: nothing less, and nothing more.

The lists that the program works with (what a trace depends on, what is weighed afterwards, what makes light
diffuse, what is read out) are derived from these declarations.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from perturbed import FIELDS, changed, scenes_of_every_field

from lightfield.fitting.diffuse_light import has_diffuse_light
from lightfield.fitting.forward import SceneForward
from lightfield.formula.closed_form import points_of_window, receiver, source
from lightfield.formula.path import Ray, optical_depth, rays
from lightfield.formula.readout import Halves, Taken, readout, time_factor
from lightfield.readings import Readings
from lightfield.render.maps import transport_key
from lightfield.render.response.beam_tallies import BEAM
from lightfield.render.response.grid import detector_grid, scene_grid
from lightfield.render.response.response import Reference
from lightfield.render.response.response_cache import digest_of
from lightfield.scene import Lamp, Scene, Tank
from lightfield.scene.acts import DIFFUSE, TRACED, Acts
from lightfield.scene.all_parameters import (
    PARTS,
    acts_on,
    chosen_by,
    neutral,
    only,
    paths_on,
    without,
    without_effect,
)
from lightfield.scene.bands import middles_nm
from lightfield.scene.lamp.colour import wider_in_colour
from lightfield.scene.lamp.frame import source_point
from lightfield.scene.lamp.section import effective_angles
from lightfield.scene.lamp.spectrum import spectral_power
from lightfield.scene.parameters import Part, acts_of
from lightfield.scene.water.ageing import growth_per_m
from lightfield.scene.water.coefficients import absorption_per_m, is_grey, scattering_per_m
from lightfield.scene.water.layers import is_layered
from lightfield.scene.water.phase.of_scene import phase_function

X, Y, Z = np.meshgrid([-0.6, 0.1, 0.9], [-0.4, 0.2], [2.0, 6.6])
TURNS = np.radians([0.0, 50.0, 90.0, 200.0, 300.0])
WAVELENGTHS = np.array([450.0, 520.0, 650.0])


@pytest.fixture(scope="module")
def bases(tmp_path_factory: pytest.TempPathFactory) -> list[Scene]:
    return scenes_of_every_field(tmp_path_factory.mktemp("tables"))


#: Readings of one spectrum, the last at twice a wavelength between the others.
TAKEN = Taken(
    spectrum=np.zeros(3, int),
    time_s=np.array([0.0, 900.0, 1800.0]),
    halves=Halves(np.array([2]), np.array([0]), np.array([1]), np.array([0.5])),
    z_m=np.array([4.5, 5.5, 6.5]),
)
#: Of what the scene scatters itself.
COLOUR_OF_NOTHING = ("water.scattering_slope", "water.scattering_departure")
#: Which wavelengths are read is no matter of a trace.
BANDS = ("detector.bands_nm", "detector.wavelength_shift_nm")


# -- one number, or several, for every stage of the light's way ----------------------------------------


def _beam(scene: Scene) -> Any:
    ray = rays(Lamp(apparent_distance_m=scene.lamp.apparent_distance_m), X, Y, Z)
    return source(scene.lamp, ray)


def _source(scene: Scene) -> Any:
    return np.array([(*source_point(scene.lamp), *point) for point in points_of_window(scene.lamp)])


def _air(scene: Scene) -> Any:
    lamp = scene.lamp.model_copy(update={"profile": "isotropic"})
    return source(lamp, rays(Lamp(), X, Y, Z), np.full(X.shape, True)).mean()


def _along(scene: Scene, metres: float, z_m: float) -> float:
    """Optical depth of so long a way in the water to a receiver at z."""
    one = np.ones(1)
    ray = Ray(0 * one, 0 * one, one, one, metres * one, -0.29 * one)
    return float(optical_depth(scene.water, ray, z_m * one, 520.0)[0])


def _hardening(scene: Scene) -> Any:
    return _along(scene, 3.0, 4.0) - 2 * _along(scene, 2.0, 4.0) + _along(scene, 1.0, 4.0)


def _layers(scene: Scene) -> Any:
    """What the optical depth of 2 m has beyond that of uniform water."""
    uniform = sum(float(f(scene.water, 520.0)) for f in (absorption_per_m, scattering_per_m))
    return [_along(scene, 2.0, z) - 2.0 * uniform - 2.0 * _hardening(scene) for z in (2.0, 6.2, 7.1, 9.0)]


def _receiver(scene: Scene) -> Any:
    bare = scene.model_copy(update={"lamp": Lamp()})
    return receiver(bare, rays(Lamp(), X, Y, Z), X, Y, Z)


def _places(scene: Scene) -> Any:
    grid = scene_grid(scene)
    return [np.concatenate([grid.z_m, grid.x_m, grid.y_m, middles_nm(scene).ravel()])]


def _motion(scene: Scene) -> Any:
    """Where it reads while it moves: by a lamp whose light tells the place, the same in every scene."""
    row = np.linspace(-0.4, 0.4, 5)
    table = Readings.from_arrays(
        x_m=np.concatenate([row, row[::-1]]), z_m=np.full(10, 4.5), value=np.ones(10), time_s=np.arange(10.0)
    )
    lag = Scene().with_values({"detector.lag_m": scene.detector.lag_m})
    return SceneForward(lag, table).predict({})


OBSERVED: dict[Acts, Callable[[Scene], Any]] = {
    Acts.POWER: lambda s: [spectral_power(s.lamp, WAVELENGTHS), s.detector.spectral_response.at(WAVELENGTHS)],
    Acts.TIME: lambda s: time_factor(s, np.array([0.0, 300.0, 3000.0])),
    Acts.BEAM: _beam,
    Acts.SECTION: lambda s: effective_angles(s.lamp, np.cos(TURNS), np.sin(TURNS)),
    Acts.SOURCE: _source,
    Acts.BEAM_COLOUR: lambda s: wider_in_colour(s.lamp, WAVELENGTHS),
    Acts.AIR: _air,
    Acts.ABSORPTION: lambda s: absorption_per_m(s.water, WAVELENGTHS),
    Acts.SCATTERING: lambda s: scattering_per_m(s.water, WAVELENGTHS),
    Acts.HARDENING: _hardening,
    Acts.LAYERS: _layers,
    Acts.AGEING: lambda s: growth_per_m(s.water, np.array([0.0, 600.0, 3000.0])),
    Acts.PHASE: lambda s: phase_function(s.water.phase).pdf(np.array([0.9, 0.0, -0.5])),
    Acts.BOX: lambda s: s.tank.box_m,
    Acts.REFLECTION: lambda s: (s.tank.wall_albedo, s.tank.surface_reflectance),
    Acts.FACES: lambda s: (s.tank.floor_share, s.tank.end_share),
    Acts.PANES: lambda s: s.tank.panes_at,
    Acts.WAVES: lambda s: s.tank.surface_slope_deg,
    Acts.RECEIVER: _receiver,
    Acts.MOTION: _motion,
    Acts.PLACES: _places,
    Acts.READOUT: lambda s: readout(s, np.array([0.1, 0.5, 1.0]), 1.0, TAKEN),
}


def differ(one: Any, other: Any) -> bool:
    a, b = np.asarray(one, float), np.asarray(other, float)
    return a.shape != b.shape or not np.allclose(a, b, rtol=1e-9, atol=1e-12)


@pytest.fixture(scope="module")
def seen(bases: list[Scene]) -> list[dict[Acts, Any]]:
    """What is observed of every scene as it is."""
    return [{stage: observed(scene) for stage, observed in OBSERVED.items()} for scene in bases]


@pytest.mark.parametrize("path", FIELDS)
def test_a_field_changes_what_it_acts_on_and_nothing_else(
    path: str, bases: list[Scene], seen: list[dict[Acts, Any]]
) -> None:
    found = Acts(0)
    for scene, before in zip(bases, seen, strict=True):
        other = changed(scene, path)
        for stage, observed in OBSERVED.items():
            if differ(before[stage], observed(other)):
                found |= stage
    assert found == acts_on(path) & ~(Acts.COLOUR | Acts.BASE)
    assert found


@pytest.mark.parametrize("path", FIELDS)
def test_what_is_derived_from_that_holds_for_every_field(path: str, bases: list[Scene]) -> None:
    """The key of a trace, the key of a beam, and a scene without or with only what acts on some stage."""
    for scene in bases:
        other = changed(scene, path)
        kinds = acts_on(path)

        def key(one: Scene) -> str:
            return digest_of(transport_key(one, scene_grid(one), Reference(0.1, 0.1, 0.2)))

        if not kinds & (TRACED | Acts.PLACES | Acts.REFLECTION) or path in BANDS:
            assert key(other) == key(scene)
        elif other != scene and kinds & (TRACED | Acts.PLACES) and path != "detector.planes_m":
            assert key(other) != key(scene)
        if not kinds & (Acts.PLACES | Acts.BOX):
            one, two = detector_grid(scene), detector_grid(other)
            assert all(np.array_equal(getattr(one, v), getattr(two, v)) for v in ("z_m", "x_m", "y_m"))
        assert (BEAM(other.lamp) == BEAM(scene.lamp)) == (other == scene or not kinds & Acts.BEAM)
        assert without(other, kinds) == without(scene, kinds)
        assert only(other, ~kinds & ~Acts(0)).get(path) == only(scene, ~kinds).get(path)


#: Choices beside which other fields count or do not.
CHOICES = {
    "profile": ("gaussian", "super-gaussian", "two-component", "table", "isotropic"),
    "spectrum": ("planck", "cie-a", "table", "led-blue"),
    "base": ("none", "pure", "table"),
    "response": ("silicon", "table"),
}


@pytest.mark.parametrize(
    ("part", "name"), [(part, name) for part, model in PARTS.items() for name in chosen_by(model)]
)
def test_a_field_counts_beside_the_choices_that_it_says(part: str, name: str, bases: list[Scene]) -> None:
    """And is told as stated without effect beside all others."""
    choice, uses = chosen_by(PARTS[part])[name]
    path, tables = f"{part}.{name}", bases[1]
    for one in CHOICES[choice]:
        scene = tables.with_values({f"{part}.{choice}": one, path: tables.get(path)}, validate=False)
        other = changed(scene, path)
        seen = [observed for stage, observed in OBSERVED.items() if stage & acts_on(path)]
        assert any(differ(f(scene), f(other)) for f in seen) == (one in uses), one
        assert (without_effect(scene).get(path) == choice) == (one not in uses), one


@pytest.mark.parametrize("path", paths_on(Acts.READOUT))
def test_a_field_of_the_readout_acts_whether_the_instrument_saturates_or_not(
    path: str, bases: list[Scene]
) -> None:
    read = OBSERVED[Acts.READOUT]
    assert [differ(read(scene), read(changed(scene, path))) for scene in bases] == [True] * len(bases)


def test_a_new_field_must_say_what_it_acts_on() -> None:
    for part, model in PARTS.items():
        assert [name for name in model.model_fields if not acts_of(model, name)] == [], part
    assert acts_on("water.phase.g") == Acts.PHASE
    assert acts_on("water.absorption_at.450nm") == Acts.ABSORPTION | Acts.COLOUR
    assert acts_on("lamp.hwhm_dge") == acts_on("nothing") == Acts(0)
    assert set(paths_on(~Acts(0))) == set(FIELDS)


def test_a_part_that_forgets_to_say_it_is_no_part() -> None:
    from lightfield.scene.parameters import number

    with pytest.raises(TypeError, match="acts_on"):
        number(0.0, "1/m", "something new")  # type: ignore[call-arg]

    class Named(Part):
        name: str = ""

    assert acts_of(Named, "name") == Acts(0)


@pytest.mark.parametrize("path", [path for path in FIELDS if path.startswith(("water", "tank"))])
def test_water_that_is_called_grey_or_dark_is(path: str) -> None:
    """From clear water in a black tank, one field at a time."""
    scene = changed(Scene(tank=Tank()), path)
    if path == "tank.surface":
        scene = Scene(tank=Tank()).with_values({"tank.surface": "flat"})
    coefficients = [f(scene.water, WAVELENGTHS) for f in (absorption_per_m, scattering_per_m)]
    flat = all(np.ptp(c) == 0 for c in coefficients)
    # A preset may know one wavelength only, and what nothing scatters has no colour.
    assert is_grey(scene.water) == (flat and path not in ("water.base", *COLOUR_OF_NOTHING))
    assert is_layered(scene.water) == differ(_layers(scene), _layers(Scene()))
    assert scene.tank is not None
    lit = coefficients[1].max() > 0 or scene.reflects
    lit = lit or path in COLOUR_OF_NOTHING  # a trace that finds nothing does no harm
    assert has_diffuse_light(scene) == lit == (not neutral(scene, DIFFUSE))
