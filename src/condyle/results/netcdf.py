"""NetCDF by way of memory: HDF5 ends the whole process where it cannot finish a file."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import h5netcdf
import xarray as xr


def write_netcdf(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset as NetCDF-4.

    HDF5 sees memory alone, so that a full disk or a signal is met by Python's own writing, which
    can fail in peace. Takes as much memory as the file is large.

    Raises: OSError: if the file cannot be written.
    """
    image = BytesIO()
    with h5netcdf.File(image, "w") as file:
        dataset.dump_to_store(xr.backends.H5NetCDFStore(file))
    path.write_bytes(image.getbuffer())
