"""Luminaire files: IES LM-63 and EULUMDAT as intensity against angle from the nadir, averaged around it.

Own readers: of the public ones, one needs Python 3.11 and another fills up files that are cut short.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lightfield.arrays import Array
from lightfield.storage.tables import LARGEST


class Luminaire(NamedTuple):
    """Intensity of a luminaire, averaged around its axis.

    Parameters
    ----------
    angle_deg : array, shape (n,)
        From the nadir, rising.
    intensity : array, shape (n,)
        Mean over the half planes; cd, or cd per kilolumen.
    asymmetry : float
        Largest difference of a half plane from that mean, as a part of the largest mean.
    """

    angle_deg: Array
    intensity: Array
    asymmetry: float


def read_ies(text: str) -> Luminaire:
    """Type C photometry of an IES LM-63 file (1986 to 2019).

    Parameters
    ----------
    text : str
        Content of the file.

    Raises
    ------
    ValueError
        Not such a file, cut short, or another photometric type.
    """
    lines = text.splitlines()
    start = next((k for k, line in enumerate(lines) if line.strip().upper().startswith("TILT=")), None)
    if start is None:
        raise ValueError("no TILT= line")
    take = _Taker([word for line in lines[start + 1 :] for word in line.replace(",", " ").split()])
    if lines[start].strip().upper() == "TILT=INCLUDE":
        take(1)
        take(2 * int(take(1)[0]))
    _, _, multiplier, n_vertical, n_horizontal, kind = take(6)
    take(4 + 3)
    if kind != 1:
        raise ValueError(
            f"photometric type {'?CBA'[int(kind)] if 1 <= kind <= 3 else kind}, only type C is known"
        )
    vertical, horizontal = take(int(n_vertical)), take(int(n_horizontal))
    candela = np.array(take(int(n_vertical) * int(n_horizontal))).reshape(int(n_horizontal), int(n_vertical))
    return _averaged(vertical, multiplier * candela, horizontal)


def read_eulumdat(text: str) -> Luminaire:
    """EULUMDAT file (Stockmar 1990), any of its symmetries.

    Parameters
    ----------
    text : str
        Content of the file.

    Raises
    ------
    ValueError
        Not such a file, or cut short.
    """
    lines = [line.strip().replace(",", ".") for line in text.splitlines()]
    if len(lines) < 30:
        raise ValueError(f"{len(lines)} lines, the head alone has 26")
    symmetry, planes, angles = int(lines[2]), int(lines[3]), int(lines[5])
    sets = int(lines[25])
    take = _Taker([word for line in lines[26 + 6 * sets :] for word in line.split()])
    take(10)
    c, gamma = np.array(take(planes)), take(angles)
    first, stored = {
        0: (0, planes),
        1: (0, 1),
        2: (0, planes // 2 + 1),
        3: (planes // 4, planes // 2 + 1),
        4: (0, planes // 4 + 1),
    }[symmetry]
    candela: Array = np.array(take(stored * angles)).reshape(stored, angles)
    return _averaged(gamma, candela, c[first : first + stored].tolist())


class _Taker:
    """Hands out numbers in the order of the file, and notices its end."""

    def __init__(self, words: list[str]) -> None:
        self.numbers, self.at = [float(word) for word in words], 0
        for word, value in zip(words, self.numbers, strict=True):
            if not abs(value) <= LARGEST:
                raise ValueError(f"{word} is no number that a lamp can have")

    def __call__(self, count: int) -> list[float]:
        part = self.numbers[self.at : self.at + count]
        if count < 1 or len(part) < count:
            raise ValueError(f"cut short: {count} numbers expected, {len(part)} left")
        self.at += count
        return part


def _averaged(angle_deg: list[float], candela: Array, plane_deg: list[float]) -> Luminaire:
    """Mean over the turn of half planes at `plane_deg`; candela has shape (n_planes, n_angles).

    The planes span one symmetric part of the turn (0, 90, 180 or 360 degrees), so that the trapezoid over
    them is the mean. Where they go round, files may leave out the last one, which is the first.
    """
    planes = _rising(plane_deg)
    if 180.0 < planes[-1] - planes[0] < 360.0:
        planes, candela = np.append(planes, planes[0] + 360.0), np.vstack([candela, candela[:1]])
    mean = candela[0]
    if len(planes) > 1:
        steps = np.diff(planes)
        mean = steps @ (0.5 * (candela[1:] + candela[:-1])) / steps.sum()
    spread = float(np.abs(candela - mean).max())
    return Luminaire(_rising(angle_deg), mean, spread / float(mean.max()) if mean.max() > 0 else 0.0)


def _rising(angles: list[float]) -> Array:
    result = np.array(angles)
    if np.any(np.diff(result) <= 0):
        raise ValueError("angles do not rise")
    return result
