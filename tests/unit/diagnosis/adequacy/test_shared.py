"""What bands of a spectrum share of their errors, told from their scatter."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.shared import _apart, shared_part
from lightfield.diagnosis.adequacy.subspace import orthonormal

SPECTRA, BANDS, COLUMNS = 30, 5, 12
OF = np.repeat(np.arange(SPECTRA), BANDS)
#: Readings over their errors of 0.8 % and a floor, from the axis to far beside it.
LIGHT = np.exp(-np.linspace(0.0, 4.0, SPECTRA * BANDS))
SIGMA = np.hypot(0.008 * LIGHT, 0.001)
#: Smooth columns that a model can move.
RICH = orthonormal(np.vander(np.linspace(-1, 1, SPECTRA * BANDS), COLUMNS) / SIGMA[:, None])


def told(part: float, seed: int, stated: bool = True, more: Array | float = 0.0) -> float:
    """The share of errors of which a part of the light is common, in whole errors of SIGMA."""
    rng = np.random.default_rng(seed)
    own = np.sqrt(SIGMA**2 - (part * LIGHT) ** 2)
    error = own * rng.standard_normal(OF.size) + part * LIGHT * rng.standard_normal(SPECTRA)[OF] + more
    scale = 1.0 if stated else 3.0  # assumed, and too large
    sigma, one = scale * SIGMA, np.ones(OF.size)
    return shared_part(error / sigma, RICH, one, OF, LIGHT / sigma, 0 * one, stated)


@pytest.mark.parametrize("stated", [True, False])
def test_a_flicker_is_told_with_its_size(stated: bool) -> None:
    """0.6 % of errors of 0.8 %: in 20 of 20 tables, and on average right to a tenth."""
    found = [told(0.006, seed, stated) for seed in range(20)]
    assert min(found) > 0.003 and np.mean(found) == pytest.approx(0.006, rel=0.1)


def test_independent_errors_share_nothing() -> None:
    """Beyond two standard deviations by chance: in no more than one table of ten."""
    assert sum(told(0.0, seed) > 0 for seed in range(40)) <= 4


def test_what_is_larger_than_the_errors_is_no_error() -> None:
    """A shadow of a fifth of the light over three places in all bands: a finding, not noise."""
    shadow = np.where(np.isin(OF, (8, 9, 10)), -0.2 * LIGHT, 0.0)
    assert told(0.0, 0, more=shadow) <= 1.5 * (SIGMA / LIGHT).min() + 1e-12


def test_what_is_known_of_the_place_is_not_told_once_more() -> None:
    """Of errors that share a known part nothing is left to be told, in nine tables of ten."""
    some = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        known = 0.008 * LIGHT / SIGMA
        error = rng.standard_normal(OF.size) + known * rng.standard_normal(SPECTRA)[OF]
        some += shared_part(error, RICH, np.ones(OF.size), OF, LIGHT / SIGMA, known, True) > 0
    assert some <= 2


def test_the_whitening_undoes_the_covariance() -> None:
    """As a Cholesky factor of the whole matrix does, up to a rotation."""
    of, rng = np.array([0, 1, 0, 2, 1, 0]), np.random.default_rng(1)
    part, known = rng.uniform(0, 1.2, 6), rng.uniform(0, 0.5, 6)
    own = np.maximum(1 - part**2, 0.2**2)
    along = np.hypot(part, known)
    covariance = np.diag(own) + np.outer(along, along) * (of[:, None] == of)
    white, log_root = _apart(np.eye(6), of, part, known)
    assert white @ covariance @ white.T == pytest.approx(np.eye(6), abs=1e-12)
    assert log_root == pytest.approx(0.5 * np.linalg.slogdet(covariance)[1])
