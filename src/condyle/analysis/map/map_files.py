"""Maps from files, and Zarr folders that are filled block by block."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from ...model.model import Model
from ...results.solution import read_dataset
from .axes import Axis, Grid
from .reach import Reach

if TYPE_CHECKING:
    import xarray as xr

MARK = ".zgroup"  # a file that every Zarr folder has


def open_map(path: str | os.PathLike[str]) -> xr.Dataset:
    """A map that was written as NetCDF or as Zarr.

    Raises: InputError: if the file is missing or is no map.
    """
    dataset = read_dataset(path, "map", MARK)
    if not is_map(dataset):
        raise InputError(f"{path} is not a map; `condyle map` writes them")
    return dataset


def is_map(data: Any) -> bool:
    """Whether a dataset is a map."""
    return "held" in getattr(data, "attrs", ()) and "cause" in data


def zarr_arrays(folder: Path, frame: xr.Dataset, like: Mapping[str, Any], rows: int) -> Any:
    """Arrays of a new Zarr group by name, to be filled by so many rows of the first axis.

    Args: frame: its coordinates and attributes.
          like: name -> (dimensions, shape, type, attributes).
    """
    import zarr

    group = zarr.open_group(str(folder), mode="w", zarr_format=2, attributes=dict(frame.attrs))

    def made(
        name: str, dims: Any, shape: Any, dtype: Any, about: Mapping[str, Any], chunks: Any
    ) -> Any:
        array = group.create_array(name, shape=shape, dtype=dtype, chunks=chunks, fill_value=None)
        array.attrs.update({"_ARRAY_DIMENSIONS": list(dims), **about})
        return array

    for name, c in frame.coords.items():
        made(str(name), c.dims, c.shape, c.dtype, c.attrs, c.shape)[...] = c.values
    return {
        name: made(name, dims, shape, dtype, about, (min(rows, shape[0]), *shape[1:]))
        for name, (dims, shape, dtype, about) in like.items()
    }


def grid_and_reach(dataset: xr.Dataset, model: Model) -> tuple[Grid, Reach]:
    """What it goes over, and what it took for reach."""
    names, held = model.independent, json.loads(dataset.attrs["held"])
    axes = []
    for name in map(str, dataset["status"].dims):
        values = dataset[name].values
        axes.append(Axis(name, float(values[0]), float(values[-1]), len(values)))
    grid = Grid(names, tuple(axes), tuple(held.get(name, 0.0) for name in names))
    low, high = (np.array(dataset.attrs[f"stroke_{end}"], dtype=float) for end in ("low", "high"))
    return grid, Reach(model, low, high)
