"""Water's coefficients and phase functions against published numbers."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scattered_back import backscatter_ratio
from scipy.integrate import trapezoid

from lightfield.errors import SceneError
from lightfield.scene import Water
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.scene.water.constituents import (
    cdom_absorption_per_m,
    chlorophyll_absorption_per_m,
    chlorophyll_scattering_per_m,
    sediment_absorption_per_m,
    sediment_scattering_per_m,
)
from lightfield.scene.water.library import columns_of, list_presets
from lightfield.scene.water.molecular import molecular_scattering_per_m, refractive_index
from lightfield.scene.water.phase.henyey_greenstein import HenyeyGreensteinPhase, TwoTermHenyeyGreensteinPhase
from lightfield.scene.water.phase.tabulated import FournierForandPhase, TabulatedPhase, petzold

NAMES = ("jerlov-II", "jerlov-measured-II")


def table(path: Path) -> dict[str, np.ndarray]:
    """Columns of a reference CSV; empty cells are NaN."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    rows = [line.split(",") for line in lines[1:]]
    columns = {}
    for k, name in enumerate(lines[0].split(",")):
        try:
            columns[name] = np.array([float(row[k]) if row[k] else np.nan for row in rows])
        except ValueError:
            continue
    return columns


def test_pure_water_absorption() -> None:
    """Pope & Fry (1997), Appl. Opt. 36, 8710, table 3: 0.00635 at 440, 0.0434 at 530, 0.0565 at 550, 0.340 at
    650 nm.
    """
    a = absorption_per_m(Water(base="pure"), [440.0, 530.0, 550.0, 650.0])
    np.testing.assert_allclose(a, [0.00635, 0.0434, 0.0565, 0.340], rtol=0.01)


def test_temperature_changes_red_absorption_only() -> None:
    """Absorption rises with temperature in the vibration band near 740 nm (Pegau et al. 1997) and hardly
    below 550.
    """
    warm, cool = Water(base="pure", temperature_c=25), Water(base="pure", temperature_c=15)
    w = np.arange(400.0, 800.0)
    change = (absorption_per_m(warm, w) - absorption_per_m(cool, w)) / 10
    assert 730 <= w[change.argmax()] <= 745
    assert np.abs(change[w < 550]).max() < 0.02 * change.max()


def test_molecular_scattering(reference: Path) -> None:
    """Zhang et al. (2009), fresh and sea water, against an independent implementation of the equations."""
    known = table(reference / "reference" / "water_scattering.csv")
    w = known["wavelength_nm"]
    np.testing.assert_allclose(molecular_scattering_per_m(w, 20, 0), known["b_zhang2009_S0_T20"], rtol=1e-5)
    np.testing.assert_allclose(molecular_scattering_per_m(w, 20, 35), known["b_zhang2009_S35_T20"], rtol=1e-5)


def test_molecular_scattering_against_older_tables() -> None:
    """Smith & Baker (1981) list 0.0103 per m at 350 nm for fresh water; Zhang is 10-15 % lower, salt adds
    about 30 %.
    """
    fresh, sea = (float(molecular_scattering_per_m(350.0, 20, s)) for s in (0, 35))
    assert 0.85 < fresh / 0.0103 < 0.90
    assert 1.28 < sea / fresh < 1.33


def test_refractive_index() -> None:
    """Quan & Fry (1995): 1.349283 in fresh and 1.356154 in sea water at 350 nm, 20 degC; 1.34 is good to 0.5
    % at 525 nm.
    """
    np.testing.assert_allclose(refractive_index(350.0, 20, 0), 1.349283, atol=1e-6)
    np.testing.assert_allclose(refractive_index(350.0, 20, 35), 1.356154, atol=1e-6)
    assert float(refractive_index(525.0, 20, 0)) == pytest.approx(1.34, rel=5e-3)


def test_chlorophyll_absorption(reference: Path) -> None:
    """The packaged fit against the coefficients of Bricaud et al. (1998) themselves: within the 2 and 4 % it
    states.
    """
    known = table(reference / "reference" / "phytoplankton_bricaud.csv")
    there = np.isfinite(known["A_phi_m2_per_mg"])
    w, a, e = (known[k][there] for k in ("wavelength_nm", "A_phi_m2_per_mg", "E_phi"))
    for chlorophyll, limit in ((0.1, 0.04), (1.0, 0.02), (10.0, 0.04)):
        ratio = chlorophyll_absorption_per_m(chlorophyll, w) / (a * chlorophyll**e)
        assert np.abs(ratio - 1).max() < limit


def test_constituents_at_their_reference_wavelengths() -> None:
    """Bricaud 440 nm: 0.0378 Chl^0.627; Loisel & Morel 550 nm: 0.416 Chl^0.766; WASI: 0.041 m^2/g; Babin: 0.5
    m^2/g.
    """
    assert float(chlorophyll_absorption_per_m(1, 440.0)) == pytest.approx(0.0378, rel=0.01)
    assert float(chlorophyll_absorption_per_m(4, 440.0)) == pytest.approx(0.0378 * 4**0.627, rel=0.02)
    assert float(chlorophyll_scattering_per_m(3, 550.0)) == pytest.approx(0.416 * 3**0.766)
    assert float(cdom_absorption_per_m(0.2, 0.014, 540.0)) == pytest.approx(0.2 * math.exp(-1.4))
    assert float(sediment_absorption_per_m(2, 440.0)) == pytest.approx(0.082)
    assert float(sediment_scattering_per_m(2, 555.0)) == pytest.approx(1.0)


def test_parts_add_up() -> None:
    """Coefficients of what is in the water add; nothing is scaled by anything else."""
    w = np.array([450.0, 525.0, 600.0])
    mixed = Water(
        base="pure", absorption_per_m=0.01, scattering_per_m=0.02, chlorophyll_mg_per_m3=0.7,
        cdom_440_per_m=0.1,
        sediment_g_per_m3=0.3,
    )  # fmt: skip
    a = (
        absorption_per_m(Water(base="pure"), w) + 0.01 + chlorophyll_absorption_per_m(0.7, w)
        + cdom_absorption_per_m(0.1, 0.014, w) + sediment_absorption_per_m(0.3, w)
    )  # fmt: skip
    b = (
        molecular_scattering_per_m(w) + 0.02 + chlorophyll_scattering_per_m(0.7, w)
        + sediment_scattering_per_m(0.3, w)
    )  # fmt: skip
    np.testing.assert_allclose(absorption_per_m(mixed, w), a, rtol=1e-12)
    np.testing.assert_allclose(scattering_per_m(mixed, w), b, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "a", "b"),
    [("petzold-clear", 0.114, 0.037), ("petzold-coastal", 0.179, 0.219), ("petzold-harbor", 0.366, 1.824)],
)
def test_petzold_stations(name: str, a: float, b: float) -> None:
    """The three waters of Petzold (1972) at 530 nm: c = 0.151, 0.398 and 2.190 per m."""
    assert float(absorption_per_m(Water(base=name), 525.0)) == pytest.approx(a)
    assert float(scattering_per_m(Water(base=name), 525.0)) == pytest.approx(b)


def test_presets_name_their_sources() -> None:
    """Families that contradict each other keep different names, so that none is taken for the other."""
    presets = list_presets()
    assert {p.family for p in presets.values()} == {"petzold", "jerlov", "jerlov-measured"}
    for name, preset in presets.items():
        assert name.startswith(preset.family)
        assert any(year in preset.source for year in ("1972", "2015", "2022"))
        assert np.all(preset.absorption_per_m > 0) and np.all(preset.scattering_per_m > 0)
        assert np.all(np.diff(preset.wavelength_nm) > 0)
    inverted, measured = (float(scattering_per_m(Water(base=n), 530.0)) for n in NAMES)
    assert abs(inverted / measured - 1) > 0.1, "the families do disagree; if not, they could be one"


def test_wavelength_outside_a_table() -> None:
    """Type 5C is printed up to 575 nm only; nothing is extrapolated."""
    with pytest.raises(SceneError, match=r"jerlov-5C.*300 to 575 nm.*remedy"):
        absorption_per_m(Water(base="jerlov-5C"), [500.0, 650.0])
    with pytest.raises(SceneError, match="350 to 900 nm"):
        absorption_per_m(Water(base="pure"), 950.0)


def test_petzold_average_moments() -> None:
    """Literature: g = 0.924, backscatter ratio 0.0183 (Mobley 1994), half of the scattering within about 4.7
    degrees.
    """
    average = petzold("average")
    assert average.mean_cosine() == pytest.approx(0.924, abs=5e-4)
    assert backscatter_ratio(average) == pytest.approx(0.0183, abs=5e-5)
    assert float(average.cdf(math.radians(4.7))) == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(
    ("column", "norm", "g", "backscatter"),
    [
        ("average_per_sr", 1.0, 0.9247, 0.01813),
        ("clear_per_m_sr", 0.0375, 0.873, 0.0438),
        ("coastal_per_m_sr", 0.221, 0.948, 0.0133),
        ("harbor_per_m_sr", 1.836, 0.9205, 0.0198),
    ],
)
def test_petzold_tables_by_the_trapezoidal_rule(
    column: str, norm: float, g: float, backscatter: float
) -> None:
    """The packaged tables, integrated as others did (trapezoid in angle, power law below 0.1 deg), give their
    moments.
    """
    angle, p = columns_of("petzold_phase.csv", "angle_deg", column)
    psi = np.radians(angle)
    slope = math.log(p[1] / p[0]) / math.log(psi[1] / psi[0])
    first = 2 * math.pi * p[0] * psi[0] ** 2 / (2 + slope)
    ring = 2 * math.pi * p * np.sin(psi)
    total = first + trapezoid(ring, psi)
    back = psi >= 0.5 * math.pi - 1e-9
    assert total == pytest.approx(norm, rel=2e-3)
    assert (first + trapezoid(ring * np.cos(psi), psi)) / total == pytest.approx(g, abs=6e-4)
    assert trapezoid(ring[back], psi[back]) / total == pytest.approx(backscatter, rel=5e-3)


@pytest.mark.parametrize(("water", "b"), [("clear", 0.037), ("coastal", 0.219), ("harbor", 1.824)])
def test_petzold_scattering_coefficient(water: str, b: float) -> None:
    """The integral of each measured volume scattering function is the scattering coefficient that Petzold
    printed.
    """
    assert petzold(water).integral == pytest.approx(b, rel=7e-3)


@pytest.mark.parametrize(
    ("n", "mu", "backscatter"),
    [(1.10, 3.5835, 0.01831), (1.0664, 3.3656, 0.005), (1.0903, 3.5208, 0.0133), (1.1325, 3.7943, 0.0438)],
)
def test_fournier_forand_moments(n: float, mu: float, backscatter: float) -> None:
    """(1.10, 3.5835) has 0.0183 (Mobley et al. 2002, on their line n = 1.01 + 0.1542 (mu - 3)).

    Mean cosine against quadrature of the density from 1e-7 rad; what lies below is forward to all digits.
    """
    phase = FournierForandPhase(n, mu)
    assert backscatter_ratio(phase) == pytest.approx(backscatter, rel=1e-3)
    log = np.linspace(math.log(1e-7), math.log(math.pi), 200_001)
    psi = np.exp(log)
    ring = 2 * math.pi * np.sin(psi) * psi * phase.pdf(1 - 2 * np.sin(psi / 2) ** 2)
    missing = 1 - trapezoid(ring, log)
    assert 0 <= missing < 1e-2
    assert phase.mean_cosine() == pytest.approx(trapezoid(ring * np.cos(psi), log) + missing, abs=1e-6)


def test_fournier_forand_values(reference: Path) -> None:
    """Density and distribution against a table that was computed from the formula elsewhere."""
    known = table(reference / "reference" / "fournier_forand.csv")
    phase, psi = FournierForandPhase(1.1000, 3.5834), np.radians(known["angle_deg"])
    np.testing.assert_allclose(phase.pdf(np.cos(psi)), known["ff_B0.0183_per_sr"], rtol=2e-3)
    np.testing.assert_allclose(phase.cdf(psi), known["cdf_B0.0183"], rtol=2e-3)


def test_henyey_greenstein_backscatter() -> None:
    """Closed form (1 - g)/(2 g) ((1 + g)/sqrt(1 + g^2) - 1): 0.0170 at g = 0.924, 0.5 for isotropic
    scattering.
    """
    assert backscatter_ratio(HenyeyGreensteinPhase(0.924)) == pytest.approx(0.0170, abs=5e-5)
    assert backscatter_ratio(HenyeyGreensteinPhase(0.0)) == pytest.approx(0.5)
    both = TwoTermHenyeyGreensteinPhase(0.9305, -0.502, 0.9967)
    assert both.mean_cosine() == pytest.approx(0.9257, abs=1e-4)
    assert backscatter_ratio(both) == pytest.approx(0.0182, abs=1e-4)


def test_table_of_a_known_function() -> None:
    """A Henyey-Greenstein function, tabulated as an instrument would, keeps its mean cosine and backscatter
    ratio.
    """
    angle = np.radians(np.concatenate([np.geomspace(0.01, 10, 400), np.arange(10.5, 180.1, 0.5)]))
    exact = HenyeyGreensteinPhase(0.9)
    again = TabulatedPhase(angle, 7.0 * exact.pdf(np.cos(angle)))
    assert again.integral == pytest.approx(7, rel=1e-4)
    assert again.mean_cosine() == pytest.approx(0.9, abs=1e-4)
    assert backscatter_ratio(again) == pytest.approx(backscatter_ratio(exact), rel=1e-3)


def test_water_table(tmp_path: Path) -> None:
    """A spectral table is interpolated linearly, and the grey parts come on top."""
    file = tmp_path / "water.csv"
    file.write_text("wavelength_nm,absorption_per_m,scattering_per_m\n500,0.1,0.2\n600,0.3,0.1\n")
    water = Water(base="table", table=str(file), absorption_per_m=0.01)
    np.testing.assert_allclose(absorption_per_m(water, [525.0, 600.0]), [0.16, 0.31])
    np.testing.assert_allclose(scattering_per_m(water, [525.0, 600.0]), [0.175, 0.1])
