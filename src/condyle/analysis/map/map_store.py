"""Where a map's numbers go: to memory, or piece by piece to a Zarr folder that appears whole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

Arrays = Mapping[str, np.ndarray]
MARK = ".zgroup"  # a file that every such folder has


@dataclass(frozen=True)
class Kept:
    """An array to be: its dimensions, shape, type, and attributes."""

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: str
    attributes: Mapping[str, Any]


class Sink(Protocol):
    """What takes blocks."""

    def write(self, start: int, stop: int, arrays: Arrays) -> None:
        """Values (stop - start, ...) of the points from `start` on, the last axis fastest."""
        ...


class Memory:
    """All arrays at once."""

    def __init__(self, kept: Mapping[str, Kept], points: Sequence[int]) -> None:
        self._points, self._kept = tuple(points), kept
        size = int(np.prod(self._points))
        self._flat = {
            name: np.empty((size, *k.shape[len(self._points) :]), dtype=k.dtype)
            for name, k in kept.items()
        }

    def write(self, start: int, stop: int, arrays: Arrays) -> None:
        for name, flat in self._flat.items():
            flat[start:stop] = arrays[name]

    def arrays(self) -> dict[str, np.ndarray]:
        """In their shapes."""
        return {name: self._flat[name].reshape(k.shape) for name, k in self._kept.items()}


class Zarr:
    """Arrays of a Zarr group; blocks are whole rows of the first axis, and so are its chunks."""

    def __init__(
        self,
        folder: Path,
        kept: Mapping[str, Kept],
        points: Sequence[int],
        rows: int,
        coordinates: Mapping[str, tuple[Any, Mapping[str, Any]]],
        attributes: Mapping[str, Any],
    ) -> None:
        """Args: rows: of the first axis in a block.  coordinates: (values, attributes)."""
        import zarr

        self._row, self._points = int(np.prod(points[1:])), tuple(points)
        group = zarr.open_group(str(folder), mode="w", zarr_format=2, attributes=dict(attributes))
        for name, (values, about) in coordinates.items():
            values = np.asarray(values)
            if values.dtype.kind == "U":
                values = values.astype(f"U{max(values.dtype.itemsize // 4, 1)}")
            made = group.create_array(
                name, shape=values.shape, dtype=values.dtype, chunks=values.shape, fill_value=None
            )
            made[...] = values
            made.attrs.update({"_ARRAY_DIMENSIONS": [name], **about})
        self._arrays: dict[str, Any] = {}
        for name, k in kept.items():
            chunks = (min(rows, k.shape[0]), *k.shape[1:])
            made = group.create_array(
                name, shape=k.shape, dtype=k.dtype, chunks=chunks, fill_value=None
            )
            made.attrs.update({"_ARRAY_DIMENSIONS": list(k.dims), **k.attributes})
            self._arrays[name] = made

    def write(self, start: int, stop: int, arrays: Arrays) -> None:
        first, last = start // self._row, stop // self._row
        for name, target in self._arrays.items():
            target[first:last] = arrays[name].reshape(last - first, *target.shape[1:])
