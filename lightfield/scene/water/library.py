"""Tables that come with the package: pure water, and named waters with their sources."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

import numpy as np

from lightfield.arrays import Array

_STATIONS = {"clear": "AUTEC 8", "coastal": "HAOCE 11", "harbor": "NUC 2040"}
_FAMILIES = {
    "petzold": (
        "petzold_stations.csv",
        "Petzold 1972, SIO report 72-78, 530 nm; used as grey (one wavelength was measured)",
    ),
    "jerlov": (
        "jerlov_solonenko_mobley_2015.csv",
        "Solonenko & Mobley 2015, Appl. Opt. 54, 5392: inverted from diffuse attenuation, not measured",
    ),
    "jerlov-measured": (
        "jerlov_williamson_hollins_2022.csv",
        "Williamson & Hollins 2022, Appl. Opt. 61, 9951: measured; (c) Crown copyright Dstl, OGL v3.0",
    ),
}


@dataclass(frozen=True)
class Preset:
    """A named water.

    Parameters
    ----------
    name : str
        As in `water.base`.
    family : str
        "petzold", "jerlov" or "jerlov-measured". The families disagree about waters of one type
        (inverted against measured, ocean stations against types): compare within one.
    source : str
        Where the numbers come from.
    wavelength_nm, absorption_per_m, scattering_per_m : array, shape (n,)
        One row for a grey water.
    """

    name: str
    family: str
    source: str
    wavelength_nm: Array
    absorption_per_m: Array
    scattering_per_m: Array


def rows_of(name: str) -> list[dict[str, str]]:
    """Rows of a packaged table.

    Parameters
    ----------
    name : str
        File name in the package's data folder.
    """
    text = files("lightfield.scene.water").joinpath("data").joinpath(name).read_text(encoding="utf-8")
    return list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))


def columns_of(name: str, *columns: str) -> tuple[Array, ...]:
    """Columns of a packaged table as numbers.

    Parameters
    ----------
    name : str
        File name.
    *columns : str
        Column names.
    """
    rows = rows_of(name)
    return tuple(np.array([float(row[column]) for row in rows]) for column in columns)


@lru_cache(maxsize=1)
def pure_water_absorption() -> tuple[Array, Array, Array]:
    """Wavelength in nm, absorption at 20 degC in 1/m, its temperature gradient in 1/m/degC (WASI 6)."""
    table = columns_of(
        "pure_water_absorption.csv", "wavelength_nm", "absorption_per_m", "gradient_per_m_per_degc"
    )
    return table[0], table[1], table[2]


@lru_cache(maxsize=1)
def list_presets() -> dict[str, Preset]:
    """Every named water by name, in the order of the sources."""
    presets: dict[str, Preset] = {}
    for family, (file, source) in _FAMILIES.items():
        grouped: dict[str, list[dict[str, str]]] = {}
        for row in rows_of(file):
            grouped.setdefault(row.get("water_type") or row["station"], []).append(row)
        for key, rows in grouped.items():
            w, a, b = (
                np.array([float(row[column]) for row in rows])
                for column in ("wavelength_nm", "absorption_per_m", "scattering_per_m")
            )
            names = [
                f"{family}-{key.lower().replace(' ', '-')}" if family == "petzold" else f"{family}-{key}"
            ]
            names += [f"petzold-{alias}" for alias, station in _STATIONS.items() if station == key]
            for name in names:
                presets[name] = Preset(name, family, f"{key}: {source}", w, a, b)
    return presets


def preset_name(text: str) -> str:
    """A water's name as the sources write it, of one in capital or small letters; other words as they are."""
    return {name.casefold(): name for name in list_presets()}.get(text.casefold(), text)
