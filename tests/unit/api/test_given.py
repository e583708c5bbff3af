"""What users give in place of what functions take."""

from __future__ import annotations

import pytest

import lightfield as lf
from lightfield.api.given import named


@pytest.mark.parametrize("given", ["scattering,walls", " scattering , walls,", ["scattering", "walls"]])
def test_names_in_one_string_are_those_of_the_command_line(given) -> None:
    assert named(given) == ["scattering", "walls"]


def test_a_name_alone_is_not_taken_letter_by_letter() -> None:
    scene = lf.Scene.model_validate(
        {"water": {"absorption_per_m": 0.1}, "detector": {"planes_m": [1.0, 2.0]}}
    )
    with pytest.raises(lf.LightfieldError, match="no_such_effect"):
        lf.hide(scene, effect="no_such_effect")


@pytest.mark.parametrize("given", [{"rel_error": "5%"}, {"max_photons": "many"}, {"rel_error": True}])
def test_a_number_that_is_none_is_said_to_be_none(given: dict[str, object]) -> None:
    (name,) = given
    with pytest.raises(lf.LightfieldError, match=f"{name}.*a number, 1e"):
        lf.render(lf.Scene.from_dict({"name": "a pool"}), **given)  # type: ignore[arg-type]
