"""A solution's file, read when and as far as it is asked for."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ...results.solution import Solution

NEEDED = ("torque", "lift_off", "status")


@contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[Solution]:
    """The solution in a NetCDF file, whose arrays stay there until they are read.

    Raises: InputError: if the file is missing or is not a condyle solution.
    """
    import xarray as xr

    from ...results.solution import Solution, open_solution

    try:
        dataset = xr.open_dataset(path, engine="h5netcdf", cache=False)
    except Exception:
        yield open_solution(str(path))  # which says what is wrong
        return
    with dataset:
        if "mechanism" in dataset.attrs and all(name in dataset for name in NEEDED):
            yield Solution(dataset.data_vars, dataset.coords, dataset.attrs)
        else:
            yield open_solution(str(path))
