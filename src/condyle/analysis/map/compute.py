"""A map as a labelled dataset: in memory, or streamed to a folder where it would not fit."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...atomic import replacing_folder
from ...errors import InputError, did_you_mean
from ...extras import require
from ...mechanism import dumps
from ...mechanism.mechanism import COORDINATES, Mechanism
from ...model.model import Model
from ...motion.column_units import FORCE, MOMENT
from ...progress import step
from ...version import __version__
from ..workers import check_scheduler, run_parts
from .axes import Grid, Over, Values, grid_of, number, values_of
from .block import Asked, Block
from .map_files import MARK, zarr_arrays
from .map_quantities import Quantity, chosen, variables
from .reach import Reach, Strokes

if TYPE_CHECKING:
    import xarray as xr

BLOCK = 1 << 16  # poses at a time


def workspace_map(
    model: Model,
    over: Over,
    quantity: str | Sequence[str] = "ratio",
    hold: Values = "",
    load: Values = "",
    load_point: str | None = None,
    direction: str | Sequence[float] | None = None,
    stiffness: float | Mapping[str, float] | None = None,
    strokes: Strokes = (),
    store: str | os.PathLike[str] | None = None,
    threads: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> xr.Dataset:
    """Quantities at rest over one, two or three of the independent coordinates.

        condyle.workspace_map(model, ["X=-5:5:200 mm", "beta=-5:20:200 deg"], "ratio")

    Args:   model: of `condyle.derive`; its distribution chooses the efforts.
            over: such texts, or {"X": (low, high, count)} [m, rad].
            quantity: one or more of `condyle.analysis.map.QUANTITIES`.
            hold: the other coordinates, "Y=1 mm,alpha=2 deg" or {"Y": 1e-3}; by default 0.
            load: on the platform, "Fz=-50 N" or {"Fz": -50.0} [N, N m], in {S}.
            load_point: where it acts; by default as for `solve`.
            direction: of the further load that quantity `load_limit` looks for, in {S}: "0,0,-1".
            stiffness: of every actuator, or by chain [N m/rad or N/m].
            strokes: "leg_*=-200:300 mm": ranges of joint coordinates that count as reach.
            store: a folder (.zarr) to stream to, for more than memory holds; it appears whole or
            not at all.  threads: at most so many.
            workers, scheduler: as of `condyle.sweep`: processes, threads, dask, or the address of
            a Dask scheduler; by default this process alone, with its threads. Same numbers.
    Returns: a dataset with a dimension for each axis; `status` and `cause` always.
    Raises: InputError: for anything that cannot be used as given, before any work.
    """
    grid = grid_of(model.mechanism, over, hold)
    asked = asked_of(model, load, load_point, direction, stiffness, strokes, threads)
    quantities = chosen((quantity,) if isinstance(quantity, str) else tuple(quantity), asked)
    if scheduler is not None:
        check_scheduler(workers, scheduler)
    return mapped(asked, grid, quantities, store, workers, scheduler)


def asked_of(
    model: Model,
    load: Values = "",
    load_point: str | None = None,
    direction: str | Sequence[float] | None = None,
    stiffness: float | Mapping[str, float] | None = None,
    strokes: Strokes = (),
    threads: int | None = None,
) -> Asked:
    """What does not change from pose to pose, checked; arguments as of `workspace_map`."""
    wrench = values_of(load, (*FORCE, *MOMENT))
    point = np.zeros(3)
    if wrench or direction is not None or load_point is not None:
        point = _point(model, load_point)
    force = [wrench.get(name, 0.0) for name in (*FORCE, *MOMENT)]
    reach = Reach.of(model, strokes, threads)
    return Asked(
        model,
        reach,
        np.array([*force, *point]),
        _direction(direction),
        _per_chain(model.mechanism, stiffness),
    )


def mapped(
    asked: Asked,
    grid: Grid,
    quantities: tuple[Quantity, ...],
    store: str | os.PathLike[str] | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> xr.Dataset:
    """The map itself."""
    import xarray as xr

    like, entries = _like(asked, grid, quantities), _entries(asked)
    used = {dim for dims, *_ in like.values() for dim in dims}
    coordinates: dict[str, Any] = {a.name: (a.name, a.values, _unit(a.name)) for a in grid.axes}
    coordinates |= {dim: (dim, np.array(entries[dim])) for dim in entries if dim in used}
    frame = xr.Dataset(coords=coordinates, attrs=_attributes(asked, grid))
    if store is None:
        arrays = {name: np.empty(shape, dtype) for name, (_, shape, dtype, _) in like.items()}
        flat = {n: a.reshape(grid.size, *a.shape[len(grid.axes) :]) for n, a in arrays.items()}
        fill(Pieces(asked, grid, quantities, BLOCK), flat, 1, workers, scheduler)
        return frame.assign({n: (like[n][0], a, like[n][3]) for n, a in arrays.items()})
    require("zarr", "maps")
    row = grid.size // grid.shape[0]
    rows = max(BLOCK // row, 1)
    with replacing_folder(store, MARK) as folder:
        targets = zarr_arrays(folder, frame, like, rows)
        fill(Pieces(asked, grid, quantities, rows * row), targets, row, workers, scheduler)
    return xr.open_zarr(Path(store), chunks=None, consolidated=False)


def size_of(asked: Asked, grid: Grid, quantities: tuple[Quantity, ...]) -> int:
    """Bytes that a map takes."""
    like = _like(asked, grid, quantities).values()
    return sum(np.dtype(dtype).itemsize * math.prod(shape) for _, shape, dtype, _ in like)


@dataclass(frozen=True)
class Pieces:
    """A map in blocks of so many poses."""

    asked: Asked
    grid: Grid
    quantities: tuple[Quantity, ...]
    block: int

    def ends(self, piece: int) -> tuple[int, int]:
        """The first pose of a piece, and the first after it."""
        start = piece * self.block
        return start, min(start + self.block, self.grid.size)


def evaluated(pieces: Pieces, piece: int) -> dict[str, np.ndarray]:
    """All variables at the poses of one piece."""
    wanted = frozenset(name for quantity in pieces.quantities for name in quantity.needs)
    here = Block(pieces.asked, pieces.grid.block(*pieces.ends(piece)), wanted)
    with np.errstate(invalid="ignore"):
        return {v.name: v.values(here) for v in variables(pieces.quantities)}


def fill(
    pieces: Pieces,
    targets: Mapping[str, Any],
    row: int,
    workers: int | None = None,
    scheduler: str | None = None,
) -> None:
    """Evaluate all poses, block by block, here or where `scheduler` says.

    Args: targets: what takes the values, by name;  row: poses in one entry of theirs.
    """
    count = -(-pieces.grid.size // pieces.block)
    with step("mapping", pieces.grid.size) as advance:
        for piece, arrays in run_parts(pieces, evaluated, range(count), workers, scheduler):
            start, stop = pieces.ends(piece)
            for name, target in targets.items():
                shape = (stop - start) // row, *target.shape[1:]
                target[start // row : stop // row] = arrays[name].reshape(shape)
            advance(stop - start)


def _like(asked: Asked, grid: Grid, quantities: tuple[Quantity, ...]) -> dict[str, Any]:
    """Dimensions, shape, type and attributes of every variable, by name."""
    entries, names = _entries(asked), [axis.name for axis in grid.axes]
    return {
        v.name: (
            (*names, *v.dims),
            (*grid.shape, *(len(entries[dim]) for dim in v.dims)),
            v.dtype,
            v.attributes(asked.model.mechanism),
        )
        for v in variables(quantities)
    }


def _entries(asked: Asked) -> dict[str, list[Any]]:
    """What stands along each dimension but the axes."""
    mechanism, names = asked.model.mechanism, list(asked.model.independent)
    return {
        "chain": list(mechanism.chain_names),
        "contact": list(mechanism.contact_names),
        "coordinate": list(COORDINATES),
        "mode": list(range(1, len(names) + 1)),
        "row": names,
        "column": names,
    }


def _unit(name: str) -> dict[str, str]:
    return {"units": "m" if name in COORDINATES[:3] else "rad"}


def _attributes(asked: Asked, grid: Grid) -> dict[str, Any]:
    model, moved = asked.model, [axis.name for axis in grid.axes]
    held = {n: value for n, value in zip(grid.names, grid.held, strict=True) if n not in moved}
    return {
        "title": "map of a mechanism at rest",
        "mechanism": dumps(model.mechanism),
        "mechanism_name": model.mechanism.name,
        "held": json.dumps(held),
        "load": asked.load.tolist(),
        "stroke_low": asked.reach.low.tolist(),
        "stroke_high": asked.reach.high.tolist(),
        "distribution": model.policy.objective,
        "condyle": __version__,
    }


def _point(model: Model, name: str | None) -> np.ndarray:
    """Where a load acts; O_M in a mechanism without points."""
    if name is None and not model.mechanism.platform.points:
        return np.zeros(3)
    return model.load_point(name)


def _direction(given: str | Sequence[float] | None) -> np.ndarray | None:
    if given is None:
        return None
    parts = given.split(",") if isinstance(given, str) else list(given)
    if len(parts) != 3:
        raise InputError(f'direction "{given}": expected three numbers, as in "0,0,-1"')
    vector = np.array([number(part, f"direction {given}") for part in parts])
    if not (size := np.linalg.norm(vector)):
        raise InputError(f'direction "{given}": has no length; expected such as "0,0,-1"')
    return vector / size


def _per_chain(
    mechanism: Mechanism, given: float | Mapping[str, float] | None
) -> np.ndarray | None:
    if given is None:
        return None
    names = mechanism.chain_names
    table = given if isinstance(given, Mapping) else dict.fromkeys(names, given)
    for name in table:
        if name not in names:
            raise InputError(f'stiffness: no chain "{name}".{did_you_mean(name, names)}')
    if missing := [name for name in names if name not in table]:
        raise InputError(f"stiffness: {', '.join(missing)} have none; give one for every chain")
    values = np.array([number(table[name], f"stiffness {table[name]}") for name in names])
    if not (values > 0).all():
        raise InputError(f"stiffness: expected numbers above 0, got {values.min():g}")
    return values
