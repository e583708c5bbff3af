"""Lamps that are oval at an angle, or wider than their table: found with their sizes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.readings import Readings
from lightfield.scene import Scene

PLANES_M = (3.0, 4.0, 5.0, 6.0, 7.0)
ABSORPTION = 0.085
#: Half width, deg, and how much longer than wide the beam is.
ALONG_DEG, RATIO = 5.0, 1.5


def light(intensity, x, y, z):
    r = np.sqrt(x**2 + y**2 + z**2)
    return intensity(np.degrees(np.arccos(z / r)), np.arctan2(y, x)) * z / r**3 * np.exp(-ABSORPTION * r)


def verdict_on(intensity, x_m, y_m, lamp: dict[str, object], seed: int) -> Verdict:
    """Of readings with errors of 0.5 % and a floor."""
    rng = np.random.default_rng(seed)
    x, z = (v.ravel() for v in np.meshgrid(x_m, PLANES_M, indexing="ij"))
    y = np.repeat(np.broadcast_to(y_m, np.shape(x_m)), len(PLANES_M))
    value = light(intensity, x, y, z)
    value = value / value.max()
    sigma = 0.005 * value + 2e-4
    read = Readings.from_arrays(
        x_m=x, y_m=y, z_m=z, value=value + sigma * rng.standard_normal(len(x)), stderr=sigma, scale="relative"
    )
    scene = Scene.from_dict({"lamp": lamp, "water": {"absorption_per_m": 0.07}})
    return diagnose(read, scene, diffuse=None, advise=False).verdict


def sizes_of(verdict: Verdict) -> dict[str, tuple[float, float]]:
    """Value and standard error of what the whole explanation frees, by name."""
    named = verdict.ladder[-1].parameters
    return {path.partition(".")[2]: (one.value, one.stderr) for path, one in named.items()}


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
@pytest.mark.parametrize("turn_deg", [45.0, pytest.param(-20.0, marks=pytest.mark.slow)])
def test_an_oval_beam_that_is_turned_is_named_with_its_size(turn_deg: float, seed: int) -> None:
    """On a grid; along its length the half width is that of a Gaussian of 5 degrees."""
    turn = np.radians(turn_deg)

    def oval(theta, phi):
        off = np.hypot(np.cos(phi - turn), RATIO * np.sin(phi - turn))
        return np.exp2(-((theta * off / ALONG_DEG) ** 2))

    x, y = (v.ravel() for v in np.meshgrid(np.linspace(-0.7, 0.7, 7), np.linspace(-0.7, 0.7, 7)))
    verdict = verdict_on(oval, x, y, {"hwhm_deg": 5.0}, seed)
    assert verdict.certain == verdict.best_set == ["beam_ellipticity"]
    found, size = sizes_of(verdict), np.log(RATIO)
    # ln of the two is a vector of the length ln(ratio), at twice the turn from the direction of -ln e.
    right = {
        "ellipticity": np.exp(-size * np.cos(2 * turn)),
        "ellipticity_diagonal": np.exp(size * np.sin(2 * turn)),
    }
    right["hwhm_deg"] = ALONG_DEG / np.sqrt(RATIO * right["ellipticity"])
    for name, true in right.items():
        value, error = found[name]
        assert abs(value - true) < 3.5 * error < 0.02, name


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
@pytest.mark.parametrize("wider", [1.03, 1 / 1.34])
def test_a_lamp_wider_than_its_table_is_no_lamp_of_its_own(wider: float, seed: int, tmp_path: Path) -> None:
    """One factor on its angles, as where the table is of air, takes no curve of eleven functions."""

    def flat(theta, phi=0.0):
        return 1 / (1 + np.exp((theta - 5.0) / 0.7)) + 0.02 * np.exp2(-((theta / 12) ** 2))

    angle = np.arange(0.0, 60.1, 0.1)
    rows = "\n".join(f"{a:.1f},{flat(a):.8g}" for a in angle)
    (tmp_path / "lamp.csv").write_text(f"angle_deg,intensity\n{rows}\n")
    lamp = {"profile": "table", "intensity_table": str(tmp_path / "lamp.csv")}
    x = np.linspace(-0.8, 0.8, 13)
    verdict = verdict_on(lambda theta, phi: flat(theta / wider), x, 0.0, lamp, seed)
    assert verdict.certain == verdict.best_set == ["table_width"]
    value, error = sizes_of(verdict)["table_width"]
    assert abs(value - wider) < 3.5 * error < 0.005
