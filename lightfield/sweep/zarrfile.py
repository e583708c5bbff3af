"""Zarr stores written chunk by chunk, each chunk whole or not at all and on the disk before anybody says so.

Version 2 of the format by its specification (zarr-specs.readthedocs.io, 2019), which every zarr library and
xarray read. The library's own writer promises neither fsync nor, in older versions, a rename.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numcodecs import Blosc

from lightfield.storage.files import atomic_path

DIMENSIONS = "_ARRAY_DIMENSIONS"  # where xarray looks for the names of the dimensions


@dataclass(frozen=True)
class Variable:
    """Declaration of one array.

    Parameters
    ----------
    dims : tuple of str
    shape, chunks : tuple of int
    dtype : str
        NumPy's name. Chunks of floats that were never written read as NaN.
    attrs : mapping
        CF attributes.
    """

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    chunks: tuple[int, ...]
    dtype: str
    attrs: Mapping[str, Any] = field(default_factory=dict)

    def metadata(self) -> dict[str, Any]:
        """Content of `.zarray`."""
        dtype = np.dtype(self.dtype)
        return {
            "zarr_format": 2,
            "shape": list(self.shape),
            "chunks": [max(1, c) for c in self.chunks],
            "dtype": dtype.str,
            "order": "C",
            "filters": None,
            "dimension_separator": ".",
            "compressor": _codec(dtype).get_config(),
            "fill_value": "NaN" if dtype.kind == "f" else None,
        }


def create(path: Path, variables: Mapping[str, Variable], attrs: Mapping[str, Any]) -> None:
    """Lay out an empty store; the consolidated metadata come last and make it one."""
    metadata: dict[str, Any] = {".zgroup": {"zarr_format": 2}, ".zattrs": dict(attrs)}
    for name, variable in variables.items():
        metadata[f"{name}/.zarray"] = variable.metadata()
        metadata[f"{name}/.zattrs"] = {**variable.attrs, DIMENSIONS: list(variable.dims)}
    for key, content in metadata.items():
        _write_json(path / key, content)
    _write_json(path / ".zmetadata", {"zarr_consolidated_format": 1, "metadata": metadata})


def set_attrs(path: Path, attrs: Mapping[str, Any]) -> None:
    """Add attributes to the store."""
    whole = json.loads((path / ".zmetadata").read_text())
    whole["metadata"][".zattrs"] |= attrs
    _write_json(path / ".zattrs", whole["metadata"][".zattrs"])
    _write_json(path / ".zmetadata", whole)


def write_chunk(path: Path, name: str, variable: Variable, index: Sequence[int], values: np.ndarray) -> int:
    """Write one chunk; at the far edges, values may be smaller than a chunk. Returns the bytes on disk."""
    dtype = np.dtype(variable.dtype)
    whole = np.ascontiguousarray(values, dtype=dtype)
    if whole.shape != tuple(variable.chunks):
        fill = np.nan if dtype.kind == "f" else np.zeros((), dtype)
        padded = np.full(variable.chunks, fill, dtype)
        padded[tuple(slice(n) for n in whole.shape)] = whole
        whole = padded
    packed = bytes(_codec(dtype).encode(whole))
    with atomic_path(path / name / ".".join(map(str, index or (0,)))) as temporary:
        temporary.write_bytes(packed)
    return len(packed)


def write_whole(path: Path, name: str, variable: Variable, values: np.ndarray) -> int:
    """Write an array that is one chunk."""
    return write_chunk(path, name, variable, [0] * len(variable.shape), values)


def remove_leftovers(path: Path) -> None:
    """Remove what a killed process left of chunks that it had not finished."""
    for leftover in path.rglob(".*.*"):
        if leftover.is_dir():
            shutil.rmtree(leftover, ignore_errors=True)


def size_on_disk(path: Path) -> int:
    """Bytes of all files of a store."""
    return sum(file.stat().st_size for file in path.rglob("*") if file.is_file())


def _codec(dtype: np.dtype[Any]) -> Blosc:
    return Blosc(cname="zstd", clevel=3, shuffle=Blosc.BITSHUFFLE if dtype.kind == "f" else Blosc.SHUFFLE)


def _write_json(path: Path, content: Any) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1), encoding="utf-8")
