"""Luminaire files: IES LM-63 and EULUMDAT as intensity against angle from the nadir and turn about it.

Own readers: of the public ones, one needs Python 3.11 and another fills up files that are cut short.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lightfield.arrays import Array
from lightfield.storage.tables import LARGEST

#: Half planes go round if from the last to the first it is no more than so many of the largest steps.
#: Chosen: files leave out one plane.
_LARGEST_GAP = 1.5
#: Planes nearer to each other are one.
_SAME_DEG = 1e-6


class Luminaire(NamedTuple):
    """Intensity of a luminaire.

    Parameters
    ----------
    angle_deg : array, shape (n_angles,)
        From the nadir, rising.
    plane_deg : array, shape (n_planes,)
        Turn of the half planes about it, from 0 to 360, both included; of one half plane 0 alone.
    intensity : array, shape (n_planes, n_angles)
        cd, or cd per kilolumen.
    """

    angle_deg: Array
    plane_deg: Array
    intensity: Array


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
    return Luminaire(_rising(vertical), *all_around(_rising(horizontal), multiplier * candela))


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
    # The half of a beam that is alike on both sides of C90-C270 is stored from C270 over C0 to C90.
    c = np.concatenate([c, c + 360.0])
    first, stored = {
        0: (0, planes),
        1: (0, 1),
        2: (0, planes // 2 + 1),
        3: (3 * planes // 4, planes // 2 + 1),
        4: (0, planes // 4 + 1),
    }[symmetry]
    candela: Array = np.array(take(stored * angles)).reshape(stored, angles)
    return Luminaire(_rising(gamma), *all_around(_rising(c[first : first + stored].tolist()), candela))


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


def all_around(plane_deg: Array, intensity: Array) -> tuple[Array, Array]:
    """Half planes all around the axis, from 0 to 360 degrees, both included, and the intensity in each.

    Files give the planes of one symmetric part of the turn (0, 90, 180 or 360 degrees): the rest are its
    mirror images. Where planes go round, files may leave out the last one, which is the first.

    Parameters
    ----------
    plane_deg : array, shape (k,)
        Rising.
    intensity : array, shape (k, n_angles)

    Raises
    ------
    ValueError
        The planes are no such part.
    """
    first, span = float(plane_deg[0]), float(plane_deg[-1] - plane_deg[0])
    if len(plane_deg) == 1:
        return np.zeros(1), intensity
    gaps = np.append(np.diff(plane_deg), 360.0 - span)
    if span > 180.0 + _SAME_DEG and gaps[-1] <= _LARGEST_GAP * gaps[:-1].max():
        if span < 360.0 - _SAME_DEG:
            plane_deg, intensity = np.append(plane_deg, first + 360.0), np.vstack([intensity, intensity[:1]])
        images = 1
    else:
        images = round(360.0 / span)
        if images % 2 or abs(images * span - 360.0) > _SAME_DEG:
            parts = [p for p in plane_deg.tolist() if p - first in (90.0, 180.0)]
            without = f"; without those beyond {parts[-1]:g} deg they are one" if parts else ""
            raise ValueError(
                f"half planes from {first:g} to {plane_deg[-1]:g} deg are no symmetric part of the turn"
                + without
            )
    ways = plane_deg - first, plane_deg[-1] - plane_deg
    nodes = np.concatenate([first + k * span + ways[k % 2] for k in range(images)])
    nodes = np.unique(np.round(np.concatenate([[0.0, 360.0], nodes % 360.0]), 9))
    along = (nodes - first) % 360.0
    if images > 1:
        along = along % (2 * span)
        along = np.minimum(along, 2 * span - along)
    values = [np.interp(along, plane_deg - first, column) for column in intensity.T]
    return nodes, np.stack(values, axis=1)


def _rising(angles: list[float]) -> Array:
    result = np.array(angles)
    if np.any(np.diff(result) <= 0):
        raise ValueError("angles do not rise")
    return result
