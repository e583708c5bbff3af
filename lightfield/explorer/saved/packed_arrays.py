"""Numbers in a page: arrays of few bits, each once."""

from __future__ import annotations

import base64
import hashlib

import numpy as np
from numpy.typing import ArrayLike


class PackedArrays:
    """Arrays of a page: their bytes one after the other, and where each lies; equal ones are kept once."""

    def __init__(self) -> None:
        self.bytes = bytearray()
        self._known: dict[bytes, int] = {}

    def add(self, array: ArrayLike, kind: str = "f4") -> list[object]:
        """Keep an array of 32-bit floats (f4), 16-bit ones scaled row by row (f2), or whole numbers (u4)."""
        array = np.asarray(array)
        scale = None
        if kind == "f2":
            top = np.abs(array).max(axis=-1, keepdims=True, initial=0)
            scale = np.where(top > 0, top / 60000.0, 1.0)
            array = array / scale
        content = np.ascontiguousarray(array, f"<{kind}").tobytes()
        digest = hashlib.blake2b(content, digest_size=16).digest()
        at = self._known.setdefault(digest, len(self.bytes))
        if at == len(self.bytes):
            self.bytes += content + bytes(-len(content) % 4)
        scales = None if scale is None else self.add(scale.ravel())
        return [kind, at, list(array.shape), scales]

    @property
    def text(self) -> str:
        """All of them, base 64."""
        return base64.b64encode(bytes(self.bytes)).decode("ascii")
