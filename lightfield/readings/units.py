"""Units of readings: counts, or a spectral irradiance or radiance in any spelling."""

from __future__ import annotations

import re

_COUNTS = ("counts", "counts/s")
RELATIVE = "relative"

SI = {"irradiance": "W m^-2 nm^-1", "scalar_irradiance": "W m^-2 nm^-1", "radiance": "W m^-2 sr^-1 nm^-1"}
CHOICES = "counts, counts/s, relative, or for example 'W m^-2 nm^-1', 'uW/cm^2/nm', 'mW m^-2 sr^-1 nm^-1'"

_POWER = {"W": 1.0, "mW": 1e-3, "uW": 1e-6, "nW": 1e-9, "kW": 1e3}
_LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
_WAVELENGTH = {"nm": 1.0, "um": 1e3}
_SUPERSCRIPT = str.maketrans({"⁻": "-", "¹": "1", "²": "2", "³": "3", "µ": "u", "μ": "u", "−": "-"})
#: What a file may call numbers that are logarithms, and units of what is no light per nm.
_LOGARITHM = re.compile(
    r"(?:^|\W)(dbm?|decibels?|absorban[cz]\w*|extinktion|o\.?d\.?|optical density|"
    r"log(?:10|e|arithm\w*)?)(?:\W|$)"
)
_OTHER = re.compile(r"%|percent|[umnpk\u00b5\u03bc]?[wva]|[umn\u00b5\u03bc]?j", re.IGNORECASE)
_FACTOR = re.compile(r"([A-Za-z]+)\^?([+-]?[0-9]{1,2})?")


def canonical(text: str) -> str:
    """The spelling used in files: `counts`, `counts/s`, `relative`, or the text with single spaces.

    Raises
    ------
    ValueError
        Neither counts nor a spectral irradiance or radiance.
    """
    plain = " ".join(text.split())
    low = plain.lower()
    if low in ("count", "counts", "dn", "adu"):
        return "counts"
    if low in ("counts/s", "counts s^-1", "counts per second", "counts/sec", "cps", "counts s-1"):
        return "counts/s"
    if low in (RELATIVE, "1", "dimensionless", "none"):
        return RELATIVE
    if re.search(r"[uµμm]?mol\b|photons", low):
        raise ValueError("photons of a band have no spectrum: import them as relative")
    for quantity in SI:
        try:
            to_si(plain, quantity)
        except ValueError:
            continue
        return plain
    raise ValueError(f"unknown unit; choose {CHOICES}")


def is_absolute(text: str) -> bool:
    """Is this (canonical) unit one of power, not of counts?"""
    return text not in (*_COUNTS, RELATIVE)


def stated(text: str) -> str:
    """The canonical spelling of a unit that a file states; "" of what is no unit of light."""
    try:
        found = canonical(text)
    except ValueError:
        return ""
    return "" if found == RELATIVE else found


def of_column(name: str, unit: str) -> str:
    """The unit of a column as `stated`; as it is written where it is another, or a logarithm; "" unknown."""
    if found := _LOGARITHM.search(f"{name} {unit}".lower()):
        return found[1]
    return stated(unit) or (unit if _OTHER.fullmatch(unit) else "")


def is_logarithmic(text: str) -> bool:
    """Is this unit one of logarithms?"""
    return _LOGARITHM.search(text.lower()) is not None


def to_si(text: str, quantity: str) -> float:
    """Factor that turns a number in this unit into SI per nm.

    Parameters
    ----------
    text : str
        "uW/cm^2/nm", "W m-2 nm-1", "µW cm⁻² nm⁻¹", ...
    quantity : str
        "irradiance", "scalar_irradiance" or "radiance".

    Raises
    ------
    ValueError
        It is not a unit of this quantity.
    """
    factor = 1.0
    powers = {"power": 0, "area": 0, "wavelength": 0, "sr": 0}
    sign = 1
    for token in re.findall(r"/|[^\s*·/()]+", text.translate(_SUPERSCRIPT)):
        if token == "/":
            sign = -1
            continue
        match = _FACTOR.fullmatch(token)
        if not match:
            raise ValueError(f"{token!r} is not a unit")
        name, power = match[1], sign * int(match[2] or 1)
        name = "sr" if name.lower() == "sr" else name  # some programs write Sr
        for kind, table in (
            ("power", _POWER),
            ("area", _LENGTH),
            ("wavelength", _WAVELENGTH),
            ("sr", {"sr": 1.0}),
        ):
            if name in table:
                powers[kind] += power
                factor *= table[name] ** power
                break
        else:
            raise ValueError(f"{name!r} is not a unit of {quantity}")
        if "(" not in text:
            sign = 1
    wanted = {"power": 1, "area": -2, "wavelength": -1, "sr": -1 if quantity == "radiance" else 0}
    if powers != wanted:
        raise ValueError(f"not a unit of {quantity}, which is {SI[quantity]}")
    return factor
