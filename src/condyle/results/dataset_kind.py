"""Kinds of dataset in files, which may be anybody's: what they may hold.

Only known names are read, and their dimensions, labels and attributes are those of the mechanism in
the file. What is shown of it can neither move a cursor nor format.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from ..errors import InputError, printable, short
from ..files.limits import TEXT
from ..files.netcdf import open_checked
from ..mechanism.files import recall
from ..mechanism.home import independent_coordinates
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..quantities import QUANTITIES
from ..quantities.entries import labels_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr

TEXTS = "OUT"  # kinds of dtypes: as objects, of one width, numpy's own
LONE = 200  # characters of a line that is shown
AXES_OF_STATUS = ".."


@dataclass(frozen=True)
class Kind:
    """A kind of dataset.

    name:       for messages.
    variables:  name -> its dimensions, or None for a name that is not read; AXES_OF_STATUS stands
                for those of `status`, and "chain*" for what begins so.
    labels:     name -> the dimension that these values are along, or None if they are no labels.
    attributes: name -> how its text or array is checked, besides `COMMON`.
    """

    name: str
    variables: Callable[[str], tuple[str, ...] | None]
    labels: Callable[[str], str | None]
    attributes: Mapping[str, Callable[[Any], Any]]

    def reads(self, name: str) -> bool:
        """Whether a variable of this name is read."""
        return self.variables(name) is not None or self.labels(name) is not None


def open_netcdf(path: str | os.PathLike[str], kind: Kind, lazy: bool = False) -> xr.Dataset:
    """A dataset of a kind in a NetCDF file, whoever wrote it.

    Args:   lazy: leave arrays in the file until they are read; the caller closes it.
    Raises: InputError: if the file is missing or of another kind.
    """
    return open_checked(path, kind.name, kind.reads, partial(_checked, kind=kind), lazy)


def _checked(dataset: xr.Dataset, kind: Kind) -> xr.Dataset:
    """The dataset with known names alone, their labels as coordinates."""
    machine = _mechanism(dataset, kind)
    _check_all_labels(dataset, machine)
    names = [str(name) for name in dataset.data_vars]
    for name in names:
        if kind.labels(name) is None:
            _check_variable(dataset, name, kind, machine)
    result = dataset.set_coords([name for name in names if kind.labels(name) is not None])
    for key, variable in result.variables.items():
        name = str(key)
        dimension = kind.labels(name)
        if name in result.coords and variable.dims != (dimension,):
            raise InputError(f'"{name}": expected one value for each "{dimension}"')
        variable.attrs, variable.encoding = _about(name, variable.attrs), {}
    attributes = {"mechanism": dataset.attrs["mechanism"], "mechanism_name": machine.name}
    for name, check in {**COMMON, **kind.attributes}.items():
        if name in dataset.attrs:
            with _attribute(name):
                attributes[name] = check(dataset.attrs[name])
    result.attrs = {n: attributes[n] for n in dataset.attrs if n in attributes}
    return result


def _mechanism(dataset: xr.Dataset, kind: Kind) -> Mechanism:
    text = dataset.attrs.get("mechanism")
    if not isinstance(text, str):
        raise InputError(f"is NetCDF, but not a condyle {kind.name}: it has no mechanism")
    return recall(text, short(dataset.attrs.get("mechanism_name", "mechanism"), 60))


def _check_all_labels(dataset: xr.Dataset, machine: Mechanism) -> None:
    """Raises InputError for labels that are not those of the mechanism, or cannot be shown."""
    dims = ("chain", "contact", "ligament", "wall", "coordinate", "axis", "component")
    known = labels_of(machine, *dims) | {"independent": _independent(machine, dataset)}
    for name, right in known.items():
        got = dataset[name].values.ravel().tolist() if name in dataset.variables else [*right]
        if got != [*right]:
            raise InputError(
                f'"{name}" is along {short(got, LONE)}, expected '
                f"{', '.join(right) or 'nothing'}, as its mechanism has it"
            )
    for key, variable in dataset.variables.items():
        if variable.dtype.kind in TEXTS:
            texts = variable.values.ravel().tolist()
            if not all(isinstance(t, str) and t.isprintable() and len(t) <= LONE for t in texts):
                raise InputError(f'"{key}" has labels that cannot be shown')
    if "time" in dataset.variables:
        time = dataset["time"].values
        good = time.ndim == 1 and time.size and time.dtype.kind == "f" and np.isfinite(time).all()
        if not (good and (np.diff(time) >= 0).all()):
            raise InputError('"time": expected finite times that rise')


def _independent(machine: Mechanism, dataset: xr.Dataset) -> tuple[str, ...]:
    """Names of q; where a surface was written in Python, which no file has, those that stand."""
    try:
        return independent_coordinates(machine)
    except InputError:
        named = dataset["independent"].values.tolist() if "independent" in dataset.variables else []
        return tuple(name for name in COORDINATES if name in named)


def _check_variable(dataset: xr.Dataset, name: str, kind: Kind, machine: Mechanism) -> None:
    variable, right = dataset[name], kind.variables(name)
    assert right is not None
    if right[0] == AXES_OF_STATUS and "status" in dataset:
        right = (*map(str, dataset["status"].dims), *right[1:])
    if not fnmatchcase(" ".join(map(str, variable.dims)), " ".join(right)):
        got = ", ".join(printable(dim, lines=False) for dim in variable.dims)
        raise InputError(f'"{name}" is over ({got[:LONE]}), expected ({", ".join(right)})')
    if missing := [dim for dim in variable.dims if dim not in dataset.variables]:
        raise InputError(f'"{name}" is over "{missing[0]}", whose values are missing')
    if variable.dtype.kind not in "fiub":
        raise InputError(f'"{name}" holds {variable.dtype}, expected numbers')
    coded = next((row for row in QUANTITIES.values() if row.variable == name and row.flags), None)
    if coded is not None:
        count = len(coded.attributes(machine)["flag_meanings"].split())
        if variable.dtype.kind not in "iu":
            raise InputError(f'"{name}" holds {variable.dtype}, expected whole numbers')
        if variable.size and not 0 <= int(variable.min()) <= int(variable.max()) < count:
            raise InputError(f'"{name}" has codes beyond 0 to {count - 1}')


def _about(name: str, given: Mapping[str, Any]) -> dict[str, str]:
    """Attributes of a variable that are kept: lines that can be shown, also as a figure's title."""
    attributes = {}
    for key in ("units", "long_name", "flag_meanings"):
        text = given.get(key)
        if text is None:
            continue
        long = TEXT.most if key == "flag_meanings" else LONE
        if not isinstance(text, str) or len(text) > long or not text.isprintable() or "$" in text:
            raise InputError(f'the {key} of "{name}" cannot be shown: expected a short line')
        attributes[key] = text
    return attributes


@contextmanager
def _attribute(name: str) -> Iterator[None]:
    try:
        yield
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(map(str, first["loc"]))
        why = f"{place}: {first['msg']}" if place else first["msg"]
        raise InputError(f'its attribute "{name}" is damaged: {short(why, LONE)}') from None


def line(value: Any) -> str:
    """A text that is shown in one line."""
    return short(STRING.validate_python(value), LONE)


def json_of(adapter: TypeAdapter[Any]) -> Callable[[Any], str]:
    """A check of JSON that an adapter must take, and of which every text can be shown."""

    def check(value: Any) -> str:
        adapter.validate_json(STRING.validate_python(value))
        for text in _texts(json.loads(value)):
            if not text.replace("\n", "").isprintable():
                raise InputError(f'a text in it cannot be shown: "{line(text)}"')
        return str(value)

    return check


def _texts(value: Any) -> Iterator[str]:
    """Every text in what JSON holds, names of entries too."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, list | dict):
        for one in value:
            yield from _texts(one)
            if isinstance(value, dict):
                yield from _texts(value[one])


def numbers(value: Any) -> np.ndarray:
    """A row of numbers."""
    return np.array(ROW.validate_python(np.atleast_1d(value).tolist()))


STRING, ROW = TypeAdapter(str), TypeAdapter(list[float])
COMMON: dict[str, Callable[[Any], Any]] = dict.fromkeys(
    ("title", "source", "condyle_version", "distribution"), line
)
