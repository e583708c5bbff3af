"""The pose of least chi-square from many starts at once, against SciPy's from each of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize

from lightfield.scene import Scene
from lightfield.studies.follower.array_light import ArrayModel, FormulaLight, Space
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.elements import grid, on_sphere
from lightfield.studies.follower.frames import POSE
from lightfield.studies.follower.pose_search import box_of, find_minima, starts_in

SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 3.81},
        "water": {"absorption_per_m": 0.05, "scattering_per_m": 0.05},
        "array": {"size_m": 0.26, "radius_m": 0.19},
    }
)
MODEL = ArrayModel(FormulaLight(SCENE), on_sphere(grid((5, 5), 0.26), 0.19))
NOISE, FIVE, BOX = SensorNoise(brightest=0.01), POSE[:5], box_of(Space(0.4, 4.5, 8.5))


def scipys(readings: np.ndarray, variance: np.ndarray, start: np.ndarray, prior: float) -> float:
    """Least chi-square from one start; the logarithm of the gain is held, known so well, or free."""

    def residuals(q: np.ndarray) -> np.ndarray:
        """Of several at once, shape (n, 5 or 6)."""
        gain = q[:, 5:] if prior else np.zeros((len(q), 1))
        read = MODEL.readings(np.column_stack([q[:, :5], np.zeros(len(q))]))
        known = gain / prior if prior else gain
        return np.column_stack([(readings - np.exp(gain) * read) / np.sqrt(variance), known])

    def slopes(q: np.ndarray) -> np.ndarray:
        """Central differences, of all coordinates at once: SciPy asks for one reading after the other."""
        step = np.cbrt(np.finfo(float).eps) * np.maximum(np.abs(q), 1.0)
        around = residuals(np.concatenate([q + np.diag(step), q - np.diag(step)]))
        return ((around[: len(q)] - around[len(q) :]) / (2 * step[:, None])).T

    low, high = BOX[0][:5], BOX[1][:5]
    if prior:
        low, high = np.append(low, -50.0), np.append(high, 50.0)
    found = optimize.least_squares(
        lambda q: residuals(q[None])[0], np.append(start[:5], [0.0] if prior else []), slopes,
        bounds=(low, high), x_scale="jac", xtol=1e-12, ftol=1e-12, gtol=1e-12, max_nfev=300,
    )  # fmt: skip
    return float(2 * found.cost)


@pytest.mark.parametrize("beyond", [False, True])
@pytest.mark.parametrize("seed", range(42))
def test_the_best_of_some_starts_is_no_worse_than_scipys(seed: int, beyond: bool) -> None:
    """To a hundredth of sigma^2; the gain is known, known to 10 %, or free. Beyond a side of where a pose is
    looked for, it is the best at that side: it was up to 6 of chi-square worse, for the other coordinates."""
    rng, prior = np.random.default_rng(seed), (0.0, 0.1, np.inf)[seed % 3]
    truth = rng.uniform(-1, 1, 6) * np.array([0.4, 0.4, 0.0, 0.3, 0.3, 0.0])
    truth[2] = rng.uniform(4.5, 8.5)
    if beyond:
        truth[seed % 2] = 0.78 * rng.choice([-1, 1])
    clean = MODEL.readings(truth[None])[0]
    variance = NOISE.variance(clean)
    readings = clean + np.sqrt(variance) * rng.standard_normal(len(clean))
    near = truth + rng.standard_normal(6) * np.array([0.1, 0.1, 0.5, 0.1, 0.1, 0.0])
    starts = np.vstack([np.clip(near, *BOX), starts_in(BOX, FIVE, 2, seed)])
    found = find_minima(
        MODEL, readings, variance, FIVE, starts, nuisances={"gain": prior} if prior else {}, box=BOX
    )
    least = min(scipys(readings, variance, start, prior) for start in starts)
    assert found.chi2.min() <= least + 0.01
    assert ((found.poses >= BOX[0]) & (found.poses <= BOX[1])).all()
