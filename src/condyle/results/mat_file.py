"""Results for MATLAB: one struct a variable, with its unit, its meaning and its dimensions.

    s = load("run.mat");  plot(s.time.values, s.effort.values);  legend(s.chain)

`values` has the shape of the labelled array, time first. Names along a dimension are cell arrays of
their own (`chain`, `contact`, `coordinate`); `info` says what the file is. Version 7 of the
format, which MATLAB since 2004 and Octave read.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..errors import InputError
from ..mechanism.mechanism import Mechanism
from ..quantities import variables
from ..quantities.entries import AXES, labels_of

LONGEST = 63  # letters of a name
LARGEST = 2**31  # bytes of a variable, which the format counts with 32 bits


def dataset_variables(dataset: xr.Dataset) -> dict[str, Any]:
    """What a file has of a solution, or of any labelled dataset."""
    structs: dict[str, Any] = {"info": _info(dataset.attrs)}
    for name, array in {**dataset.coords, **dataset.data_vars}.items():
        labels = name in dataset.coords and array.dtype.kind in "OUST"
        dims = tuple(map(str, array.dims))
        made = cells(array.values) if labels else entry(array.values, dims, array.attrs)
        structs[matlab_name(str(name))] = made
    return structs


def table_variables(mechanism: Mechanism, columns: Mapping[str, Any]) -> dict[str, Any]:
    """What a file has of the columns of `condyle solve`: those of a variable stand side by side."""
    labels = labels_of(mechanism)
    info = {"title": f"Inverse dynamics of {mechanism.name}", "mechanism_name": mechanism.name}
    structs: dict[str, Any] = {"info": _info(info)} | {n: cells(v) for n, v in labels.items()}
    rest = dict(columns)
    for variable in variables().values():
        if variable.column is None or len(variable.dims) < 2:
            continue
        names = [f"{variable.column}{label}" for label in labels.get(variable.dims[1], ())]
        if names and all(name in rest for name in names):
            values = np.column_stack([rest.pop(name) for name in names])
            attributes = variable.attributes(mechanism)
            structs[variable.variable] = entry(values, ("row", variable.dims[1]), attributes)
    for name in [n for n in rest if n.startswith("reaction_") and n.endswith(f"_{AXES[0]}")]:
        stem = name.removesuffix(AXES[0])
        values = np.column_stack([rest.pop(f"{stem}{axis}") for axis in AXES])
        unit = "N m" if "moment" in stem or "torque" in stem else "N"
        structs[matlab_name(stem.rstrip("_"))] = entry(values, ("row", "axis"), {"units": unit})
    for name, column in rest.items():
        values = np.asarray(column)
        structs[matlab_name(name)] = (
            cells(values) if values.dtype.kind in "OU" else entry(values, ("row",), {})
        )
    return structs


def write_mat(path: Path, variables: Mapping[str, Any]) -> None:
    """Write a file of named variables.

    Raises: OSError: if it cannot be written.
    """
    from scipy.io import savemat

    savemat(
        str(path),
        dict(variables),
        appendmat=False,
        long_field_names=True,
        do_compression=True,
        oned_as="column",
    )


def entry(
    values: np.ndarray, dims: tuple[str, ...], attributes: Mapping[str, Any]
) -> dict[str, np.ndarray | str]:
    """The struct of one variable.

    Raises: InputError: for one of more than 2 GiB, which the format cannot hold.
    """
    if values.nbytes >= LARGEST:
        raise InputError("a variable of a .mat file has at most 2 GiB; write NetCDF (.nc) instead")
    values = values.astype(float) if values.dtype.kind in "biu" else values
    text = {key: str(attributes.get(key, "")) for key in ("units", "long_name")}
    flags = {"flag_meanings": attributes["flag_meanings"]} if "flag_meanings" in attributes else {}
    return {"values": values, **text, "dims": cells(dims), **flags}


def cells(texts: Any) -> np.ndarray:
    """A column of texts as a cell array."""
    column = np.empty((len(texts), 1), dtype=object)
    column[:, 0] = [str(text) for text in texts]
    return column


def matlab_name(name: str) -> str:
    """A name that MATLAB takes: letters, digits and underscores, a letter first."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    if not plain[:1].isalpha():
        plain = f"x{plain}"
    return plain[:LONGEST]


def _info(attributes: Mapping[str, Any]) -> dict[str, str]:
    return {matlab_name(str(key)): str(value) for key, value in attributes.items()}
