"""Maps from files, and what they went over."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import TypeAdapter

from ...errors import InputError
from ...mechanism.home import independent_coordinates
from ...mechanism.mechanism import COORDINATES
from ...model.model import Model
from ...quantities import QUANTITIES as ROWS
from ...quantities.entries import DIMENSIONS
from ...results.dataset_kind import AXES_OF_STATUS, Kind, json_of, numbers, open_netcdf
from .axes import Axis, Grid
from .map_quantities import ALWAYS, QUANTITIES
from .reach import Reach

if TYPE_CHECKING:
    import xarray as xr


def _dimensions(name: str) -> tuple[str, ...] | None:
    """Dimensions of a variable of maps, or None if they have none of that name."""
    known = (ROWS[own] for one in (ALWAYS, *QUANTITIES.values()) for own in one.values)
    return next(((AXES_OF_STATUS, *row.entries) for row in known if row.variable == name), None)


MAP = Kind(
    "map",
    _dimensions,
    lambda name: name if name in (*COORDINATES, *DIMENSIONS) else None,
    {
        "held": json_of(TypeAdapter(dict[str, float])),
        **dict.fromkeys(("load", "stroke_low", "stroke_high"), numbers),
    },
)


def open_map(path: str | os.PathLike[str]) -> xr.Dataset:
    """A map that was written as NetCDF, by whomever.

    Raises: InputError: if the file is missing or is no map.
    """
    dataset = open_netcdf(path, MAP)
    if not is_map(dataset):
        raise InputError(f"{path} is not a map; `condyle map` writes them")
    if why := _objection(dataset):
        raise InputError(f"{path}: {why}")
    return dataset


def is_map(data: Any) -> bool:
    """Whether a dataset is a map."""
    return "held" in getattr(data, "attrs", ()) and "cause" in data


def _objection(dataset: xr.Dataset) -> str | None:
    """Why a dataset is no map over independent coordinates, or None."""
    machine = dataset.condyle.mechanism
    free, held = independent_coordinates(machine), json.loads(dataset.attrs["held"])
    axes = [str(dim) for dim in dataset["status"].dims] if "status" in dataset else []
    if not 1 <= len(axes) <= 3 or sorted([*axes, *held]) != sorted(free):
        return f"it goes over {', '.join(axes) or 'nothing'}; expected one to three of {free}"
    for name in axes:
        values = dataset[name].values
        if len(values) < 2 or not np.isfinite(values).all() or not (np.diff(values) > 0).all():
            return f'"{name}": expected finite values that rise'
    if not np.isfinite([*held.values()]).all():
        return "its held coordinates are not finite"
    sizes = {"load": 9, "stroke_low": len(machine.chains), "stroke_high": len(machine.chains)}
    for name, size in sizes.items():
        if len(dataset.attrs.get(name, ())) != size:
            return f'its attribute "{name}" has not {size} numbers'
    return None


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
