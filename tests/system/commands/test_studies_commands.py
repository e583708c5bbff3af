"""From instrument files to pages by the command line: import, attenuation, range, band."""

from __future__ import annotations

import json
from pathlib import Path

import campaign
import numpy as np
import pytest
import xarray as xr

from lightfield import cli

SCENE = '[lamp]\nhwhm_deg = 3.81\n[water]\nbase = "pure"\n[detector]\nbands_nm = [[400, 700]]\n'
BANDS = [(460, 470), (480, 490), (500, 510), (520, 530), (540, 550), (560, 570)]


def loss_per_m(wavelength: np.ndarray) -> np.ndarray:
    """Falls, then rises, as that of water with some dissolved matter."""
    return 0.06 + 2e-5 * (wavelength - 500) ** 2


@pytest.fixture
def readings(tmp_path: Path, monkeypatch) -> Path:
    """Jaz files at five distances in both media, three spectra each, imported by the command line."""
    monkeypatch.chdir(tmp_path)
    rng, rows = np.random.default_rng(3), []
    for z in (4.5, 5.5, 6.5, 7.5, 8.5):
        for medium in ("air", "water"):
            for again in range(3):
                left = np.exp(-loss_per_m(campaign.WAVELENGTH) * z) if medium == "water" else 1.0
                light = campaign.rate(campaign.WAVELENGTH, (4.5 / z) ** 2 * left)
                name = f"{medium}_{z}_{again}.jaz"
                signal = campaign.DARK + 0.05 * light * (1 + 0.002 * rng.standard_normal())
                campaign.jaz(tmp_path / name, campaign.DARK, signal)
                rows.append(f"{name},{z},{medium}")
    campaign.write_index(tmp_path, rows, "file,z_m,medium")
    (tmp_path / "scene.toml").write_text(SCENE)
    bands = [word for low, high in BANDS for word in ("--band", f"{low}:{high}")]
    asked = ["--quantity", "irradiance", "--units", "counts", "--plane-gain-percent", "0.2"]
    assert cli.main(["import", "index.csv", *asked, *bands, "-o", "readings.csv"]) == 0
    return tmp_path / "readings.csv"


def test_from_jaz_files_to_a_page_of_attenuation(readings, capsys) -> None:
    words = "attenuation readings.csv --scene scene.toml --no-trace --json k.json --report k.html -o k.nc"
    assert cli.main(words.split()) == 0, capsys.readouterr().err
    printed = capsys.readouterr().out
    assert "against readings in air" in printed and "Beer-Lambert" in printed
    found = json.loads(readings.with_name("k.json").read_text())["apparent"][0]
    K, error = np.array(found["attenuation"]), np.array(found["attenuation_stderr"])
    truth = loss_per_m(np.mean(BANDS, axis=1))
    assert found["wavelength_nm"] == np.mean(BANDS, axis=1).tolist()
    assert np.abs((K - truth) / error).max() < 4 and error.max() < 0.005
    with xr.open_dataset(readings.with_name("k.nc")) as kept:
        assert kept.attenuation.values == pytest.approx(K)
    page = readings.with_name("k.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 2 * 3 and "http://" not in page.replace("http://www.w3.org", "")


def test_real_jaz_files_go_all_the_way(reference, tmp_path, monkeypatch, capsys) -> None:
    """One spectrum of a real instrument at three distances in both media: nothing is lost."""
    monkeypatch.chdir(tmp_path)
    source = reference / "reference" / "spectrometer" / "jazspec.jaz"
    rows = []
    for z in (4.5, 6.5, 8.5):
        for medium in ("air", "water"):
            (tmp_path / f"{medium}{z}.jaz").write_bytes(source.read_bytes())
            rows.append(f"{medium}{z}.jaz,{z},{medium}")
    campaign.write_index(tmp_path, rows, "file,z_m,medium")
    (tmp_path / "scene.toml").write_text(SCENE)
    asked = "import index.csv --quantity irradiance --units counts --band 500:510 --band 540:550 -o r.csv"
    assert cli.main(asked.split()) == 0
    assert cli.main(["attenuation", "r.csv", "--scene", "scene.toml", "--no-trace", "--json", "k.json"]) == 0
    found = json.loads((tmp_path / "k.json").read_text())["apparent"][0]
    assert found["attenuation"] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert found["reference"] == "air" and min(found["attenuation_stderr"]) > 0


@pytest.mark.parametrize(
    "words",
    [
        "range scene.toml --no-trace --json out.json --report out.html",
        "band scene.toml --no-trace --distances 4.5,8.5 --width 30 --json out.json --report out.html",
        pytest.param(
            "link scene.toml --water pure=0.05,0 --max-photons 1e4 --to 20 --json out.json --report out.html",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_studies_of_a_scene_write_their_page_and_numbers(words, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE)
    assert cli.main(words.split()) == 0, capsys.readouterr().err
    assert json.loads((tmp_path / "out.json").read_text())
    page = (tmp_path / "out.html").read_text(encoding="utf-8")
    assert "</html>" in page and "<svg" in page
    assert page.split("<h1>")[1].split("<")[0] and capsys.readouterr().out.strip()
