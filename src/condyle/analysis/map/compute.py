"""A map as a labelled dataset, computed block by block."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...backends.threads import workers as processors
from ...errors import InputError, as_path, brief, did_you_mean, texts_of
from ...files.atomic import make_folder
from ...files.memory import require_memory
from ...mechanism import dumps
from ...mechanism.mechanism import COORDINATES, Mechanism
from ...model.given import as_model
from ...model.model import Contacts, Model, inverse_of
from ...motion import load_place
from ...motion.column_units import FORCE, MOMENT
from ...motion.written_values import Values, number, values_of
from ...progress import step
from ...quantities import QUANTITIES as ROWS
from ...quantities.entries import labels_of
from ...results.solution import Results
from ...version import __version__
from ..workers import check_scheduler, run_parts
from .axes import Grid, Over, grid_of
from .block import Block, Setup
from .map_quantities import Mapped, chosen, described, require_used
from .reach import Reach, Strokes

if TYPE_CHECKING:
    import xarray as xr

BLOCK = 1 << 16  # poses at a time
COPIES = 3  # of a map in memory: its arrays, its file before it is on disk, and one to work on


def workspace_map(
    model: Model | Mechanism | str | os.PathLike[str],
    over: Over | None = None,
    quantities: str | Sequence[str] = "ratio",
    hold: Values = "",
    load: Values = "",
    load_point: str | None = None,
    direction: str | Sequence[float] | None = None,
    stiffness: float | Mapping[str, float] | None = None,
    stroke: Strokes = (),
    out: str | os.PathLike[str] | None = None,
    threads: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    contacts: Contacts = "kept",
) -> xr.Dataset:
    """Quantities at rest over one, two or three of the independent coordinates.

        condyle.workspace_map("masticatory", ["X=-5:5:200 mm", "beta=-5:20:200 deg"], "ratio")

    Args:   model: a model, whose distribution gives the efforts; or a mechanism, its file or name.
            over: such texts, or {"X": (low, high, count)} [m, rad]. Default: the first two
            coordinates, half a characteristic length or half a radian to either side of home.
            quantities: one or more of `condyle.analysis.map.QUANTITIES`.
            hold: the other coordinates, "Y=1 mm,alpha=2 deg" or {"Y": 1e-3}; by default 0.
            load: on the platform, "Fz=-50 N" or {"Fz": -50.0} [N, N m], in {S}.
            load_point: the platform point that it acts at; by default as for `solve`.
            direction: of the additional load of quantities `load_limit` and `lift_load`, in {S}:
            "0,0,-1".
            stiffness: of every actuator, or by chain [N m/rad or N/m], in place of the file's.
            stroke: "leg_*=-200:300 mm": range of joint coordinates that counts as reach.
            out: file (NetCDF), to which .nc is added unless it ends so. It appears whole or not
            at all; its folder is made.
            threads: maximum number of threads.
            workers, scheduler: as in `condyle.sweep`: processes, threads, or the address of a
            Dask scheduler. Default: this process. Same numbers.
            contacts: kept, or compliant: efforts, contact forces, stiffness, deflection and
            frequencies where those with compliance yield.
    Returns: a dataset with a dimension for each axis, `status` and `cause` always; its `encoding`
            names the file as "source".
    Raises: InputError: for any argument that cannot be used, and for more points than memory
            holds, before the computation starts.
    """
    made = as_model(model)
    grid = grid_of(made.mechanism, over, hold)
    setup = setup_of(made, load, load_point, direction, stiffness, stroke, threads, contacts)
    names = texts_of("quantities", quantities)
    wanted = chosen(names, setup)
    given = {"load": load, "direction": direction, "stiffness": stiffness}
    require_used(names, given | {"contacts": "" if contacts == "kept" else contacts})
    check_scheduler(workers, scheduler)
    work = Blocks(setup, grid, wanted, BLOCK, workers, scheduler)
    _require_room(work)
    file = None if out is None else _file(out)
    dataset = _computed(work)
    if file is not None:
        Results(dataset).save(file)
        dataset.encoding["source"] = str(file)
    return dataset


def setup_of(
    model: Model,
    load: Values = "",
    load_point: str | None = None,
    direction: str | Sequence[float] | None = None,
    stiffness: float | Mapping[str, float] | None = None,
    stroke: Strokes = (),
    threads: int | None = None,
    contacts: Contacts = "kept",
) -> Setup:
    """What holds for every pose, checked; arguments as in `workspace_map`."""
    wrench = values_of(load, (*FORCE, *MOMENT), "load")
    force = [wrench.get(name, 0.0) for name in (*FORCE, *MOMENT)]
    points = model.mechanism.platform.points
    point: Sequence[float] = (0.0, 0.0, 0.0)  # O_M, without a load or in a mechanism without points
    acts = bool(wrench) or direction is not None
    if load_point is not None or (points and acts):
        point = load_place(load_point, points).tolist()
    if load_point is not None and not acts:
        raise InputError("load_point: requires load or direction, which act there")
    processors(threads)
    inverse_of(model, contacts)  # which contacts with compliance have to be there for
    return Setup(
        model,
        Reach.of(model, stroke, threads),
        np.array([*force, *point]),
        _direction(direction),
        _per_chain(model.mechanism, stiffness),
        contacts,
    )


def _file(out: str | os.PathLike[str]) -> Path:
    """The file of a map, its folder made."""
    file = Path(as_path(out, "out"))
    if file.suffix != ".nc":
        file = file.with_name(f"{file.name}.nc")
    make_folder(file.parent)
    return file


@dataclass(frozen=True)
class Blocks:
    """A map in blocks of `size` poses, and who evaluates them."""

    setup: Setup
    grid: Grid
    mapped: tuple[Mapped, ...]
    size: int
    workers: int | None = None
    scheduler: str | None = None

    def ends(self, number: int) -> tuple[int, int]:
        """The first pose of a block, and the first after it."""
        start = number * self.size
        return start, min(start + self.size, self.grid.size)


def evaluated(blocks: Blocks, number: int) -> dict[str, np.ndarray]:
    """All variables at the poses of one block."""
    wanted = frozenset(name for quantity in blocks.mapped for name in quantity.needs)
    here = Block(blocks.setup, blocks.grid.block(*blocks.ends(number)), wanted)
    with np.errstate(invalid="ignore"):
        return {
            ROWS[name].variable: of(here)
            for quantity in blocks.mapped
            for name, of in quantity.values.items()
        }


def fill(blocks: Blocks, targets: Mapping[str, np.ndarray]) -> None:
    """Evaluate all poses, block by block, into arrays (N, ..) by name."""
    count = -(-blocks.grid.size // blocks.size)
    with step("mapping", blocks.grid.size) as advance:
        for number, arrays in run_parts(
            blocks, evaluated, range(count), blocks.workers, blocks.scheduler
        ):
            start, stop = blocks.ends(number)
            for name, target in targets.items():
                target[start:stop] = arrays[name]
            advance(stop - start)


def _require_room(blocks: Blocks) -> None:
    """Raises InputError for more than memory holds."""
    shapes = _like(blocks).values()
    size = sum(np.dtype(dtype).itemsize * math.prod(shape) for _, shape, dtype, _ in shapes)
    require_memory(
        COPIES * size,
        f"a map of {blocks.grid.size} points takes",
        "choose fewer points or quantities, or map parts of the range one after the other",
    )


def _computed(blocks: Blocks) -> xr.Dataset:
    grid, like = blocks.grid, _like(blocks)
    arrays = {name: np.empty(shape, dtype) for name, (_, shape, dtype, _) in like.items()}
    flat = {n: a.reshape(grid.size, *a.shape[len(grid.axes) :]) for n, a in arrays.items()}
    fill(blocks, flat)
    made = {name: (like[name][0], a, like[name][3]) for name, a in arrays.items()}
    return _frame(blocks, like).assign(made)


def _frame(blocks: Blocks, like: Mapping[str, Any]) -> xr.Dataset:
    """Coordinates and attributes."""
    import xarray as xr

    axes = blocks.grid.axes
    own = dict.fromkeys(dim for dims, *_ in like.values() for dim in dims[len(axes) :])
    coordinates: dict[str, Any] = {
        a.name: (a.name, a.values, {"units": "m" if a.name in COORDINATES[:3] else "rad"})
        for a in axes
    }
    entries = labels_of(blocks.setup.model.mechanism, *own) if own else {}
    coordinates |= {dim: (dim, np.array(labels)) for dim, labels in entries.items()}
    return xr.Dataset(coords=coordinates, attrs=_attributes(blocks.setup, blocks.grid))


def _like(blocks: Blocks) -> dict[str, Any]:
    """Dimensions, shape, type and attributes of every variable, by name."""
    mechanism, names = blocks.setup.model.mechanism, [axis.name for axis in blocks.grid.axes]
    return {
        name: ((*names, *dims), (*blocks.grid.shape, *shape), dtype, about)
        for name, (dims, shape, dtype, about) in described(blocks.mapped, mechanism).items()
    }


def _attributes(setup: Setup, grid: Grid) -> dict[str, Any]:
    model, moved = setup.model, [axis.name for axis in grid.axes]
    held = {n: value for n, value in zip(grid.names, grid.held, strict=True) if n not in moved}
    return {
        "title": "map of a mechanism at rest",
        "mechanism": dumps(model.mechanism),
        "mechanism_name": model.mechanism.name,
        "held": json.dumps(held),
        "load": setup.load.tolist(),
        "stroke_low": setup.reach.low.tolist(),
        "stroke_high": setup.reach.high.tolist(),
        "distribution": model.distribution.name,
        "condyle_version": __version__,
    }


def _direction(given: str | Sequence[float] | None) -> np.ndarray | None:
    if given is None:
        return None
    parts = given.split(",") if isinstance(given, str) else given
    if not isinstance(parts, Sequence | np.ndarray) or np.shape(parts) != (3,):
        raise InputError(f'direction: expected three numbers, as in "0,0,-1", got {brief(given)}')
    vector = np.array([number(part, "direction") for part in parts])
    if not (size := np.linalg.norm(vector)):
        raise InputError(f'direction: expected a length, as in "0,0,-1", got {brief(given)}')
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
    values = np.array([number(table[name], "stiffness") for name in names])
    if not (values > 0).all():
        raise InputError(f"stiffness: expected numbers above 0, got {values.min():g}")
    return values
