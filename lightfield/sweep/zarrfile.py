"""Zarr stores written chunk by chunk, each chunk whole or not at all and on the disk before anybody says so.

Version 2 of the format by its specification (zarr-specs.readthedocs.io, 2019), which every zarr library and
xarray read. The library's own writer promises neither fsync nor, in older versions, a rename.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numcodecs import Blosc

from lightfield.errors import OutputError
from lightfield.storage.files import atomic_path
from lightfield.sweep.journal import digest

CONSOLIDATED = ".zmetadata"
_DIMENSIONS = "_ARRAY_DIMENSIONS"  # where xarray looks for the names of the dimensions
_DTYPE = re.compile(r"[<>]f[48]|[<>|]i[1248]|[<>]U[1-9]\d{0,5}")


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
            "compressor": {"id": Blosc.codec_id, **_compression(dtype), "blocksize": 0},
            "fill_value": "NaN" if dtype.kind == "f" else None,
        }


def metadata_files(variables: Mapping[str, Variable], attrs: Mapping[str, Any]) -> dict[str, bytes]:
    """Files that make a folder a store, by name; the consolidated metadata come last."""
    metadata: dict[str, Any] = {".zgroup": {"zarr_format": 2}, ".zattrs": dict(attrs)}
    for name, variable in variables.items():
        metadata[f"{name}/.zarray"] = variable.metadata()
        metadata[f"{name}/.zattrs"] = {**variable.attrs, _DIMENSIONS: list(variable.dims)}
    whole = {"zarr_consolidated_format": 1, "metadata": metadata}
    return {key: as_json(content) for key, content in {**metadata, CONSOLIDATED: whole}.items()}


def refuse_foreign_metadata(path: Path) -> None:
    """Raise unless a store declares only what this module writes; to be called before any library opens it.

    Codecs and filters of the zarr format are named in the metadata, and some of them (`pickle`) run code that
    stands in the chunks. Hence every array must be declared word for word as `Variable.metadata` does.

    Raises
    ------
    OutputError
        Another codec, filter, type or version of the format, or metadata that contradict each other.
    """
    try:
        whole = _read_json(path / CONSOLIDATED)
        metadata = dict(whole["metadata"])
        if whole != {"zarr_consolidated_format": 1, "metadata": metadata}:
            raise ValueError("not consolidated metadata")
        for key, content in metadata.items():
            if not _is_ours(key, content):
                raise ValueError(f"{key} declares what a sweep does not write")
            if _read_json(path / key) != content:
                raise ValueError(f"{key} says something else than {CONSOLIDATED}")
        if (path / "zarr.json").exists():
            raise ValueError("zarr.json, of version 3 of the format, which a sweep does not write")
    except (OSError, ValueError, LookupError, TypeError, RecursionError) as error:
        raise OutputError(
            "the metadata of this store are not those of a sweep",
            where=str(path),
            found=str(error),
            rule="codecs and types as a sweep writes them; nothing else is opened",
            remedy="run its sweep again, or do not trust this store",
        ) from error


def _is_ours(key: str, content: Any) -> bool:
    name, _, kind = key.rpartition("/")
    if "/" in name or name.startswith("."):
        return False
    if kind == ".zarray" and name:
        numbers = [*content["shape"], *content["chunks"]]
        if not _DTYPE.fullmatch(content["dtype"]) or not all(type(n) is int and n >= 0 for n in numbers):
            return False
        declared = Variable((), tuple(content["shape"]), tuple(content["chunks"]), content["dtype"])
        return bool(content == declared.metadata())
    if kind == ".zattrs":
        return isinstance(content, dict)
    return bool(key == ".zgroup" and content == {"zarr_format": 2})


def chunk_name(name: str, index: Sequence[int]) -> str:
    """File of a chunk, relative to the store."""
    return f"{name}/{'.'.join(map(str, index or (0,)))}"


def encoded(variable: Variable, values: np.ndarray) -> bytes:
    """Content of a chunk's file; at the far edges, values may be smaller than a chunk."""
    dtype = np.dtype(variable.dtype)
    whole = np.ascontiguousarray(values, dtype=dtype)
    if whole.shape != tuple(variable.chunks):
        fill = np.nan if dtype.kind == "f" else np.zeros((), dtype)
        padded = np.full(variable.chunks, fill, dtype)
        padded[tuple(slice(n) for n in whole.shape)] = whole
        whole = padded
    return bytes(Blosc(**_compression(dtype)).encode(whole))


def write_chunk(
    path: Path, name: str, variable: Variable, index: Sequence[int], values: np.ndarray
) -> tuple[str, str]:
    """Write one chunk; returns the name of its file in the store and its digest."""
    file, packed = chunk_name(name, index), encoded(variable, values)
    with atomic_path(path / file) as temporary:
        temporary.write_bytes(packed)
    return file, digest(packed)


def remove_unfinished_chunks(path: Path) -> None:
    """Remove what a killed process left of chunks that it had not finished."""
    for leftover in path.rglob(".*.*"):
        if leftover.is_dir():
            shutil.rmtree(leftover, ignore_errors=True)


def size_on_disk(path: Path) -> int:
    """Bytes of all files of a store."""
    return sum(file.stat().st_size for file in path.rglob("*") if file.is_file())


def _compression(dtype: np.dtype[Any]) -> dict[str, Any]:
    """Settings of the compressor."""
    shuffle = Blosc.BITSHUFFLE if dtype.kind == "f" else Blosc.SHUFFLE
    return {"cname": "zstd", "clevel": 3, "shuffle": shuffle}


def as_json(content: Any) -> bytes:
    """Content of a file that people may read, too."""
    return json.dumps(content, indent=1).encode()


def _read_json(file: Path) -> Any:
    if not file.is_file():
        raise ValueError(f"{file.name} is missing")
    return json.loads(file.read_bytes())
