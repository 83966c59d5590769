"""Results: one labelled dataset with units, and the files it becomes."""

from __future__ import annotations

import json
import os
from contextlib import ExitStack
from io import BytesIO
from pathlib import Path
from typing import Any

import h5netcdf
import numpy as np
import xarray as xr

from ..accessors import extend
from ..atomic import replacing
from ..errors import InputError, no_such_file
from ..extras import require
from ..markers import MeasuredChannels
from ..mechanism.files import recall
from ..mechanism.mechanism import Mechanism
from ..motion import write_table
from ..progress import step
from .contacts import AXES, BOUND_TOLERANCE, bound_margins, lift_off, lift_off_columns
from .failed_samples import Failure, failures, status_columns
from .mat_file import dataset_variables, write_mat
from .variables import VARIABLES, WRENCH, named_columns, variable_columns
from .warnings import Notice

__all__ = [
    "AXES",
    "BOUND_TOLERANCE",
    "WRENCH",
    "Solution",
    "bound_margins",
    "lift_off",
    "lift_off_columns",
    "named_columns",
    "open_solution",
]


class Solution(xr.Dataset):
    """Inverse dynamics along a motion, or a simulation; it knows its mechanism.

    An `xarray.Dataset`. Dimensions time, chain, contact, coordinate, part, axis. The variables and
    their units are in the documentation's table of results; each has the attributes `units` and
    `long_name`.
    """

    __slots__ = ()

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism that was solved.

        In the place of a surface written in Python is an `Unknown` one, which has no equation.
        """
        return recall(self.attrs["mechanism"], self.attrs["mechanism_name"])

    @property
    def warnings(self) -> list[str]:
        """What the run had to say, for people."""
        return json.loads(self.attrs["warnings"])

    @property
    def notices(self) -> list[Notice]:
        """The same as data: kind, whose, when, how much, and the bound."""
        if "notices" not in self.attrs:  # written before warnings were data
            return [Notice("other", text) for text in self.warnings]
        return [Notice(**facts) for facts in json.loads(self.attrs["notices"])]

    @property
    def failures(self) -> list[Failure]:
        """Intervals of samples that could not be computed, each with its cause."""
        return failures(self)

    @property
    def options(self) -> dict[str, Any]:
        """How the solution was made: formulation, route, sources, seconds."""
        return json.loads(self.attrs["options"])

    @property
    def events(self) -> list[dict[str, Any]]:
        """What happened in a simulation: time, kind, owner, text, state, ends; else nothing."""
        return json.loads(self.attrs.get("events", "[]"))

    @property
    def plot(self) -> Any:  # type: ignore[override]
        """Figures: `solution.plot.torque()` and friends; xarray's own are there too."""
        require("matplotlib", "figures")
        return extend("solution.plot", self)

    def with_measured(self, measured: MeasuredChannels | str | os.PathLike[str]) -> Solution:
        """The solution with what was measured beside the motion, for report, figures and view.

        Args:   measured: markers and EMG (`motion_from_c3d(...).channels`), or their table's file.
        Raises: InputError: for other columns, chains that are not there, or other times.
        """
        from .measured import with_measured

        return with_measured(self, measured)

    def save(self, *paths: str | Path) -> None:
        """Write as NetCDF (.nc), CSV, Parquet or MATLAB (.mat): every file whole, or none."""
        with step("writing results"), ExitStack() as stack:
            for path in paths:
                suffix = Path(path).suffix.lower()
                if suffix not in (".nc", ".csv", ".parquet", ".mat"):
                    raise InputError(
                        f"{path}: expected a name that ends in .nc, .csv, .parquet or .mat, got "
                        f'"{suffix}"'
                    )
                temporary = stack.enter_context(replacing(path))
                if suffix == ".nc":
                    write_netcdf(self, temporary)
                elif suffix == ".mat":
                    write_mat(temporary, dataset_variables(self))
                else:
                    write_table(temporary, self.columns(), parquet=suffix == ".parquet")

    def columns(self) -> dict[str, np.ndarray | list[str]]:
        """Columns of the CSV: t, and those of `VARIABLES`.

        Then reactions, if there are any, lift_off_<contact> (0 or 1) of one-sided contacts, and
        status, cause and, where efforts were chosen within limits, shortfall, if a sample failed.
        """
        columns: dict[str, np.ndarray | list[str]] = {"t": self["time"].values}
        labels = {str(name): along.values for name, along in self.coords.items()}
        for variable in VARIABLES:
            if variable.column is not None and variable.name in self:
                columns |= variable_columns(variable, self[variable.name].values, labels)
        for name in map(str, self.data_vars):
            if name.startswith("reaction_") or name == "contact_force_vector":
                entries, values = self[self[name].dims[1]].values, self[name].values
                prefix = "reaction_contact" if name == "contact_force_vector" else name
                for i, axis in enumerate(AXES):
                    along = named_columns(f"{prefix}_", entries, values[:, :, i])
                    columns |= {f"{column}_{axis}": one for column, one in along.items()}
        columns |= lift_off_columns(self.mechanism, self["lift_off"].values)
        if (status := self["status"].values).any():
            cause = self["cause"].values if "cause" in self else np.zeros_like(status)
            shortfall = self["shortfall"].values if "shortfall" in self else None
            columns |= status_columns(self.mechanism, status, cause, shortfall)
        return columns


def open_solution(path: str | Path) -> Solution:
    """Read a solution that was saved as NetCDF.

    Raises: InputError: if the file is missing or is not a condyle solution.
    """
    if Path(path).is_dir():
        raise InputError(f"{path}: is a folder; give the name of a solution (.nc) in it")
    try:
        dataset = xr.load_dataset(path, engine="h5netcdf")
    except FileNotFoundError:
        raise no_such_file(path) from None
    except Exception as error:
        raise InputError(f"{path} is not a NetCDF solution: {error}") from None
    if "mechanism" not in dataset.attrs or "torque" not in dataset:
        raise InputError(f"{path} is NetCDF, but not a condyle solution")
    solution = Solution(dataset.data_vars, dataset.coords, dataset.attrs)
    if "lift_off" not in solution:  # written before there were one-sided contacts
        variable = next(v for v in VARIABLES if v.name == "lift_off")
        lifted = lift_off(solution.mechanism, solution["contact_force"].values)
        solution["lift_off"] = variable.dims, lifted, variable.attributes(solution.mechanism)
    return solution


def write_netcdf(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset as NetCDF-4.

    HDF5 ends the whole process where it cannot finish a file. It sees memory alone, so that a full
    disk or a signal is met by Python's own writing. Takes as much memory as the file is large.

    Raises: OSError: if the file cannot be written.
    """
    image = BytesIO()
    with h5netcdf.File(image, "w") as file:
        dataset.dump_to_store(xr.backends.H5NetCDFStore(file))
    path.write_bytes(image.getbuffer())
