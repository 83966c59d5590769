"""Results: one labelled dataset with units, and the files it becomes."""

from __future__ import annotations

import json
import os
from base64 import b64encode
from collections.abc import Callable
from contextlib import ExitStack
from html import escape
from io import BytesIO
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5netcdf
import numpy as np
import xarray as xr
from pydantic import BaseModel, JsonValue, TypeAdapter

from ..errors import InputError, UnsupportedError, brief
from ..extras import require
from ..files.atomic import ending_of, replacing
from ..markers import MeasuredChannels
from ..mechanism.files import recall
from ..mechanism.mechanism import Mechanism
from ..motion import write_table
from ..progress import step
from ..quantities import QUANTITIES, named_columns, variables
from ..quantities.entries import AXES, OF_RESULTS, chain_units
from .contact_lifts import ContactLift, contact_lifts
from .contacts import contact_loss, contact_loss_columns
from .dataset_kind import Kind, json_of, open_netcdf
from .failed_samples import Failure, complete_dataset, failures, status_columns
from .mat_file import dataset_variables, write_mat
from .warnings import Notice

if TYPE_CHECKING:
    from ..report.figures.registry import Plots

# An attribute that only maps or only sweeps have; the others are solutions.
KINDS = {"held": "map", "study": "sweep"}
# Variables of older files.
RENAMED = {
    "torque": "effort", "torque_quantile": "effort_quantile", "lift_off": "contact_loss"
}  # fmt: skip
QUANTILE = "_quantile"  # end of the names of bands


class Results:
    """Accessor of datasets of results: `solution.condyle.mechanism`.

    A solution is inverse dynamics along a motion, or a simulation. Its dimensions are time, chain,
    contact, coordinate, part and axis; its variables and their units are in the documentation's
    table of results, and each has the attributes `units` and `long_name`. Maps and sweeps have
    `save`, `columns` and `plot` too.

    As the last line of a notebook's cell, `dataset.condyle` is a picture and a table.
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    @property
    def kind(self) -> str:
        """solution, map or sweep."""
        marks = self._dataset.attrs
        return next((kind for mark, kind in KINDS.items() if mark in marks), "solution")

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism that was solved.

        In the place of a surface written in Python is an `Unknown` one, which has no equation.

        Raises: InputError: if the dataset does not say.
        """
        text = self._attribute("mechanism")
        return recall(text, str(self._dataset.attrs.get("mechanism_name", "mechanism")))

    @property
    def warnings(self) -> list[str]:
        """Warnings of the run, as text."""
        return json.loads(self._attribute("warnings", "[]"))

    @property
    def notices(self) -> list[Notice]:
        """The same as data: kind, owner, time, value and bound."""
        if "notices" not in self._dataset.attrs:  # written before warnings were data
            return [Notice("other", text) for text in self.warnings]
        return [Notice(**facts) for facts in json.loads(self._attribute("notices"))]

    @property
    def failures(self) -> list[Failure]:
        """Samples in a row that could not be computed, with their cause; of maps, poses in the
        order of the file, and of sweeps, variants."""
        with complete_dataset():
            return failures(self._dataset)

    @property
    def options(self) -> dict[str, Any]:
        """How the solution was made: formulation, route, sources, seconds."""
        return json.loads(self._attribute("options", "{}"))

    @property
    def events(self) -> list[dict[str, Any]]:
        """Events of a simulation: time, kind, owner, text, state, ends; else none."""
        return json.loads(self._attribute("events", "[]"))

    @property
    def contact_lifts(self) -> dict[str, dict[str, Any]]:
        """How contacts that lift were open, by name: `count`, seconds `open` in all, `first` and
        `last` instant [s], `landing_speed` at most [m/s], and `point`, the ball's centre in {S}
        at first [m]."""
        return contact_lifts(self._dataset)

    @property
    def plot(self) -> Plots:
        """Figures, by name: `solution.condyle.plot.effort()`, `map.condyle.plot.ratio()`."""
        require("matplotlib", "figures")
        if self.kind == "map":
            from ..report.figures.map_figures import map_plots

            return map_plots(self._dataset)
        if self.kind == "sweep":
            from ..report.figures.sweep_figures import sweep_plots

            return sweep_plots(self._dataset)
        from ..report.figures import solution_plots

        return solution_plots(self._dataset)

    def with_measured(self, measured: MeasuredChannels | str | os.PathLike[str]) -> xr.Dataset:
        """The solution with what was measured beside the motion, for report, figures and view.

        Args:   measured: markers and EMG (`motion_from_c3d(...).channels`), or their table's file.
        Raises: InputError: for other columns, chains that are not there, or other times.
        """
        from .measured import with_measured

        return with_measured(self._dataset, measured)

    def save(self, *paths: str | Path) -> None:
        """Write as NetCDF (.nc), CSV, Parquet or MATLAB (.mat): every file whole, or none."""
        with step("writing results"), ExitStack() as stack:
            for path in paths:
                write = WRITERS[ending_of(path, WRITERS)]
                write(self._dataset, stack.enter_context(replacing(path)))

    def columns(self) -> dict[str, np.ndarray | list[str]]:
        """Columns of the CSV: of a solution t and those of the table of quantities.

        Then reactions, if there are any, contact_loss_<contact> (0 or 1) of unilateral contacts,
        and, if a sample failed, status, cause and, with efforts within limits, shortfall. Maps and
        sweeps have a row for each pose or variant.
        """
        with complete_dataset():
            return (solution_columns if self.kind == "solution" else row_columns)(self._dataset)

    def __repr__(self) -> str:
        with complete_dataset():
            if self.kind == "map":
                from ..report.map_text import map_table

                return map_table(self._dataset)
            if self.kind == "sweep":
                from ..report.tables.sweep_tables import sweep_text

                return sweep_text(self._dataset)
            from .summary import summarize

            return str(summarize(self._dataset))

    def _repr_html_(self) -> str:
        """A picture, where there is matplotlib and something to draw, and the table."""
        table = f"<pre>{escape(repr(self))}</pre>"
        try:
            image = self.plot._repr_png_()
        except UnsupportedError:
            image = None
        if image is None:
            return table
        return f'<img src="data:image/png;base64,{b64encode(image).decode("ascii")}">{table}'

    def _attribute(self, name: str, missing: str | None = None) -> str:
        found = self._dataset.attrs.get(name, missing)
        if found is None:
            raise InputError(f'this dataset has no "{name}": is it a result of condyle?')
        return found


# xarray's own decorator keeps the accessor in the dataset, a circle of references that would hold
# the arrays of every dataset until Python collects garbage.
xr.Dataset.condyle = property(Results)  # type: ignore[attr-defined]


def solution_columns(d: xr.Dataset) -> dict[str, np.ndarray | list[str]]:
    """Columns of a solution, as `Results.columns` says."""
    columns: dict[str, np.ndarray | list[str]] = {"t": d["time"].values}
    labels = {str(name): coordinate.values for name, coordinate in d.coords.items()}
    for name, quantity in variables().items():
        if name in d:
            columns |= quantity.table(d[name].values, labels)
    for name in map(str, d.data_vars):
        if name.startswith("reaction_") or name == "contact_force_vector":
            entries, values = d[d[name].dims[1]].values, d[name].values
            prefix = "reaction_contact" if name == "contact_force_vector" else name
            for i, axis in enumerate(AXES):
                of_axis = named_columns(f"{prefix}_", entries, values[:, :, i])
                columns |= {f"{column}_{axis}": array for column, array in of_axis.items()}
    if "bound" in d and "max_error" in d["bound"].attrs:
        columns["bound"] = d["bound"].values
    mechanism = d.condyle.mechanism
    columns |= contact_loss_columns(mechanism, d["contact_loss"].values)
    if (status := d["status"].values).any():
        cause = d["cause"].values if "cause" in d else np.zeros_like(status)
        shortfall = d["shortfall"].values if "shortfall" in d else None
        columns |= status_columns(mechanism, status, cause, shortfall)
    return columns


def row_columns(d: xr.Dataset) -> dict[str, np.ndarray | list[str]]:
    """A row for each entry of `status`: where it is, then the variables, one column an entry."""
    dims, rows = d["status"].dims, d["status"].size
    axes = [str(dim) for dim in dims if dim in d.coords]
    grid = np.meshgrid(*(d[axis].values for axis in axes), indexing="ij")
    columns = {axis: a.ravel() for axis, a in zip(axes, grid, strict=True)}
    for name, variable in d.data_vars.items():
        own = [d[dim].values for dim in variable.dims[len(dims) :]]
        names = ["_".join(map(str, [name, *entry])) for entry in product(*own)]
        columns |= dict(zip(names, variable.values.reshape(rows, -1).T, strict=True))
    return {**columns}


class EventRecord(BaseModel):
    """An event as JSON."""

    time: float = 0.0
    kind: str = ""
    text: str = ""
    owner: str = ""
    ends: bool = False
    state: dict[str, float] = {}
    force: float | None = None


class SolutionOptions(BaseModel):
    """What every solution says of how it was made."""

    formulation: str
    route: str
    motion: str
    load: str
    landmark: str | None
    load_point: str | None
    solve_seconds: float
    motion_kind: str | None = None


class Bands(BaseModel):
    """The variants that quantiles are of."""

    study: dict[str, JsonValue]
    variants: int
    failed: int
    session: dict[str, JsonValue] = {}


class StoredTable(BaseModel):
    """A table that a solution keeps."""

    name: str
    title: str
    columns: list[str]
    rows: list[list[str]]
    notes: list[str]


def _dimensions(name: str) -> tuple[str, ...] | None:
    """Dimensions of a variable of solutions, or None if they have none of that name."""
    name = RENAMED.get(name, name)
    known = variables()
    if name.endswith(QUANTILE) and (own := known.get(name.removesuffix(QUANTILE))):
        return ("quantile", *own.dims)
    if name == "contact_force_vector":
        return ("time", "contact", "axis")
    if name.startswith("reaction_"):
        return ("time", "chain*", "axis")
    return known[name].dims if name in known else None


def _label_dimension(name: str) -> str | None:
    """The dimension that labels of solutions are along."""
    if name.startswith("chain_"):  # of some families alone
        return name
    return LABELS.get(name)


LABELS = {n: n for n in (*OF_RESULTS, "quantile")} | {
    "effort_unit": "chain", "joint_unit": "chain", "marker_body": "marker"
}  # fmt: skip
# Those that every solution has.
NEEDED = (
    *("effort", "contact_force", "pose", "joint", "joint_rate", "bound_margin", "load"),
    *("singularity_ratio", "condition", "singularity"),
)
SOLUTION = Kind(
    "solution",
    _dimensions,
    _label_dimension,
    {
        "options": json_of(TypeAdapter(SolutionOptions)),
        "warnings": json_of(TypeAdapter(list[str])),
        "notices": json_of(TypeAdapter(list[Notice])),
        "events": json_of(TypeAdapter(list[EventRecord])),
        "contact_lifts": json_of(TypeAdapter(dict[str, ContactLift])),
        "bands": json_of(TypeAdapter(Bands)),
        "tables": json_of(TypeAdapter(list[StoredTable])),
    },
)


def open_solution(path: str | os.PathLike[str], lazy: bool = False) -> xr.Dataset:
    """Read a solution that was saved as NetCDF, by whomever.

    Names that no solution has are not read.

    Args:   lazy: leave arrays in the file until they are read; it is to be closed.
    Raises: InputError: if the file is missing or is not a condyle solution.
    """
    found = open_netcdf(path, SOLUTION, lazy)
    old = {old: new for old, new in RENAMED.items() if old in found and new not in found}
    solution = found.drop_vars({*RENAMED} - {*old}, errors="ignore").rename(old)
    solution.set_close(found.close)
    there = {*solution.variables, *solution.attrs}
    if missing := [name for name in (*NEEDED, "status", "options") if name not in there]:
        raise InputError(f'{path} is NetCDF, but not a condyle solution: it has no "{missing[0]}"')
    for name in {"notices", "events"} & {*solution.attrs}:
        solution.attrs[name] = solution.attrs[name].replace('"lift_off"', '"contact_loss"')
    # What the mechanism says too, other programs may leave out.
    machine = solution.condyle.mechanism
    solution.attrs.setdefault("mechanism_name", machine.name)
    for kind in ("effort", "joint"):
        if f"{kind}_unit" not in solution.coords:
            solution.coords[f"{kind}_unit"] = "chain", chain_units(machine, kind)
    if "contact_loss" not in solution:  # written before there were unilateral contacts
        variable = QUANTITIES["contact_loss"]
        lost = contact_loss(machine, solution["contact_force"].values)
        solution["contact_loss"] = variable.dims, lost, variable.attributes(machine)
    return solution


def as_kind(given: Any, kind: str, argument: str) -> xr.Dataset:
    """A dataset of one kind: a solution, a map or a sweep.

    Raises: InputError: for anything else.
    """
    made = isinstance(given, xr.Dataset) and {"mechanism", "study"} & {*given.attrs}
    if made and Results(given).kind == kind:
        return given
    raise InputError(f"{argument}: expected a {kind} of condyle, got {brief(given)}")


def write_netcdf(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset as NetCDF-4.

    HDF5 ends the whole process where it cannot finish a file. It sees memory alone, so that a full
    disk or a signal is met by Python's own writing. Takes as much memory as the file is large.

    Raises: OSError: if the file cannot be written.
    """
    image = BytesIO()
    with h5netcdf.File(image, "w") as file:
        dataset.dump_to_store(xr.backends.H5NetCDFStore(file))
    with image.getbuffer() as written, path.open("wb") as out:
        out.write(written)


# How a dataset is written, by the ending of the file.
WRITERS: dict[str, Callable[[xr.Dataset, Path], None]] = {
    ".nc": write_netcdf,
    ".csv": lambda d, path: write_table(path, d.condyle.columns(), parquet=False),
    ".parquet": lambda d, path: write_table(path, d.condyle.columns(), parquet=True),
    ".mat": lambda d, path: write_mat(path, dataset_variables(d)),
}
