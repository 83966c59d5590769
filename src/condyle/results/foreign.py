"""The one door for datasets from files, which may be anybody's.

The header is checked before any array is read: nothing leads out of the file, and what is read
fits the file and memory. Only known names are read, and their dimensions, labels and attributes
are those of the mechanism in the file. What is shown of it can neither move a cursor nor format.
"""

from __future__ import annotations

import json
import math
import os
import struct
import zlib
from collections.abc import Callable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import accumulate
from mmap import ACCESS_READ, mmap
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from ..errors import InputError, as_path, printable, require_file, shortened
from ..limits import ATTRIBUTE, DENSITY, ENTRIES, LABELS, TEXT
from ..mechanism.files import recall
from ..mechanism.home import independent_coordinates
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..motion.memory import byte_text, require_memory
from ..quantities import QUANTITIES
from ..quantities.entries import labels_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    import h5py
    import xarray as xr

SMALL = 1 << 26  # bytes that a file of any size may stand for
PACKED, CHECKSUM = 1032, 64  # bytes that a byte of gzip stands for at most; bytes beside a block
# How a file has a text or references of any number: where they are, after their length.
TEXT_AT = np.dtype([("length", "<u4"), ("heap", "<u8"), ("index", "<u4")])
FILTERS = {1: "gzip", 2: "shuffle", 3: "fletcher32"}
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


def open_netcdf(path: str | os.PathLike[str], kind: Kind, lazy: bool = False) -> xr.Dataset:
    """A dataset in a NetCDF file, whoever wrote it.

    Args:   lazy: leave arrays in the file until they are read; the caller closes it.
    Raises: InputError: if the file is missing or of another kind.
    """
    import h5py
    import xarray as xr

    name = as_path(path)
    if os.path.isdir(name):
        raise InputError(f"{path}: is a folder; give the name of a {kind.name} (.nc) in it")
    require_file(name)
    try:
        with h5py.File(name, "r") as file:
            shapes = _check_header(file, name, kind, lazy)
        dataset = xr.open_dataset(
            name,
            engine="h5netcdf",
            cache=not lazy,
            drop_variables=[one for one, shape in shapes.items() if shape is None],
            mask_and_scale=False,
            decode_times=False,
            concat_characters=False,
            decode_coords=False,
            phony_dims="sort",
        )
        try:
            for one, variable in (dataset if lazy else dataset.load()).variables.items():
                sizes = tuple(dataset.sizes[dim] for dim in variable.dims)
                if not variable.shape == sizes == shapes[str(one)]:
                    raise InputError(f'"{one}" does not fit its dimensions')
            checked = _checked(dataset, kind)
        finally:
            if not lazy:
                dataset.close()
    except _NotOursError as error:
        raise InputError(f"{path} is NetCDF, but not a condyle {kind.name}: {error}") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except Exception as error:  # of h5py, h5netcdf and xarray, for which there is no list
        why = shortened(printable(" ".join(str(error).split()), lines=False), LONE)
        raise InputError(f"{path} is not a NetCDF {kind.name}: {why}") from None
    checked.set_close(dataset.close)
    return checked


class _NotOursError(Exception):
    """What a dataset of this kind has, and this one has not."""


def _check_header(
    file: h5py.File, path: str, kind: Kind, lazy: bool
) -> dict[str, tuple[int, ...] | None]:
    """Shapes of the variables by name; None for one that is not read.

    Raises: InputError: where reading would leave the file, or take more than is there.
    """
    import h5py

    if file.id.get_create_plist().get_sizes() != (8, 8):
        raise InputError("its addresses are not of 8 bytes")
    shapes, total, size = dict[str, tuple[int, ...] | None](), 0, os.path.getsize(path)
    texts = _texts_of(file)
    with open(path, "rb") as raw, mmap(raw.fileno(), 0, access=ACCESS_READ) as data:
        for name in file:
            if not isinstance(file.get(name, getlink=True), h5py.HardLink):
                raise InputError(f'"{name}" is a link; expected variables in the file itself')
            found = file[name]
            if not isinstance(found, h5py.Dataset):
                raise InputError(f'"{name}" is a group; expected variables')
            if found.is_virtual or found.external:
                raise InputError(f'"{name}" is stored in another file; expected all in this one')
            texts |= _texts_of(found)
            plan = found.id.get_create_plist()
            filters = [plan.get_filter(i)[0] for i in range(plan.get_nfilters())]
            if len({*FILTERS} & {*filters}) < len(filters):
                raise InputError(
                    f'"{name}" is packed; expected at most {", ".join(FILTERS.values())}'
                )
            if kind.variables(name) is None and kind.labels(name) is None:
                shapes[name] = None
                continue
            shapes[name] = found.shape
            if h5py.check_string_dtype(found.dtype) is not None:
                _check_labels(found, data, bool(filters))
            elif found.dtype.kind in "fiu":
                total += found.size * found.dtype.itemsize
                _check_chunks(found, size)
            else:
                raise InputError(f'"{name}" holds {found.dtype}, expected numbers or texts')
        for name in texts:
            _check_text(name, data)
    if total > SMALL:
        DENSITY.check(total / size, f"{byte_text(total)} of arrays in a file of {byte_text(size)}")
    if not lazy:
        require_memory(total, "its arrays take")
    return shapes


def _texts_of(item: h5py.File | h5py.Dataset) -> set[str]:
    """The attributes that hold texts or references of a length of their own.

    Raises: InputError: for attributes too large to be read.
    """
    import h5py

    names = set()
    for name in item.attrs:
        found = h5py.h5a.open(item.id, name.encode("utf-8", "surrogateescape"))
        count, each = found.get_space().get_simple_extent_npoints(), found.get_type().get_size()
        TEXT.check(count * each, f'its attribute "{name}"')
        if found.dtype.kind == "O":
            names.add(name)
            ENTRIES.check(count, f'its attribute "{name}"')
        elif found.dtype.hasobject and name != "REFERENCE_LIST":
            raise InputError(f'its attribute "{name}" holds {found.dtype}')
    return names


def _check_text(name: str, data: mmap) -> None:
    """Raises InputError for texts of an attribute that are too long, before HDF5 makes room for
    them: the length stands in the message of the attribute, wherever the file has one of the name.
    """
    key, at, seen = name.encode("utf-8", "surrogateescape") + b"\0", -1, 0
    while (at := data.find(key, at + 1)) >= 0:
        head = next((n for n, v in ((8, b"\1\2"), (9, b"\3")) if data[max(at - n, 0)] in v), 0)
        sizes = struct.unpack_from("<3H", data, at - head + 2) if 0 < head <= at else (0,)
        if sizes[0] != len(key):
            continue
        whole = 8 if data[at - head] == 1 else 1  # bytes to which the first version rounds up
        _, space, end = (at + n for n in accumulate(-(-n // whole) * whole for n in sizes))
        dims = space + (8 if data[space] == 1 else 4)
        count = math.prod(struct.unpack_from(f"<{data[space + 1]}Q", data, dims))
        ENTRIES.check(count, f'its attribute "{name}"')
        texts = np.frombuffer(data[end : end + count * TEXT_AT.itemsize], TEXT_AT)
        ATTRIBUTE.check(int(texts["length"].sum()), f'its attribute "{name}"')
        seen += 1
    if not seen:
        raise InputError(f'its attribute "{name}" is not where it is expected')


def _check_labels(found: h5py.Dataset, data: mmap, packed: bool) -> None:
    """Raises InputError for labels too many or too long, before any is read."""
    import h5py

    LABELS.check(found.size, f'"{found.name}"')
    if found.dtype.kind != "O":
        TEXT.check(found.size * found.dtype.itemsize, f'"{found.name}"')
        return
    if packed or found.id.get_create_plist().get_layout() == h5py.h5d.COMPACT:
        raise InputError(f'"{found.name}": its labels are packed')
    blocks = [(found.id.get_offset(), found.size * TEXT_AT.itemsize)]
    if found.chunks is not None:
        infos = map(found.id.get_chunk_info, range(found.id.get_num_chunks()))
        blocks = [(info.byte_offset, info.size) for info in infos]
    for at, size in blocks:
        if at is not None:  # nothing was ever written
            texts = np.frombuffer(data[at : at + size], TEXT_AT)
            TEXT.check(int(texts["length"].sum()), f'"{found.name}"')


def _check_chunks(found: h5py.Dataset, size: int) -> None:
    """Raises InputError for blocks that are larger, once unpacked, than the file can stand for."""
    if found.chunks is None:
        return
    each, room = math.prod(found.chunks) * found.dtype.itemsize, max(SMALL, DENSITY.most * size)
    if each > room:
        raise InputError(f'"{found.name}" is in blocks of {byte_text(each)}: it is damaged')
    if found.compression is None:
        return
    for i in range(found.id.get_num_chunks()):
        info = found.id.get_chunk_info(i)
        if info.size * PACKED > room:
            _, packed = found.id.read_direct_chunk(info.chunk_offset)
            unpacked = zlib.decompressobj()
            unpacked.decompress(packed, each + CHECKSUM)
            if unpacked.unconsumed_tail:
                raise InputError(f'"{found.name}" has a block larger than {byte_text(each)}')


def _checked(found: xr.Dataset, kind: Kind) -> xr.Dataset:
    """The dataset with known names alone, their labels as coordinates."""
    machine = _mechanism(found)
    _check_all_labels(found, machine)
    names = [str(name) for name in found.data_vars]
    for name in names:
        if kind.labels(name) is None:
            _check_variable(found, name, kind, machine)
    result = found.set_coords([name for name in names if kind.labels(name) is not None])
    for key, variable in result.variables.items():
        name = str(key)
        along = kind.labels(name)
        if name in result.coords and variable.dims != (along,):
            raise InputError(f'"{name}": expected one value for each "{along}"')
        variable.attrs, variable.encoding = _about(name, variable.attrs), {}
    attributes = {"mechanism": found.attrs["mechanism"], "mechanism_name": machine.name}
    for name, check in {**COMMON, **kind.attributes}.items():
        if name in found.attrs:
            with _attribute(name):
                attributes[name] = check(found.attrs[name])
    result.attrs = {n: attributes[n] for n in found.attrs if n in attributes}
    return result


def _mechanism(found: xr.Dataset) -> Mechanism:
    text = found.attrs.get("mechanism")
    if not isinstance(text, str):
        raise _NotOursError("it has no mechanism")
    return recall(text, shortened(printable(found.attrs.get("mechanism_name", "mechanism")), 60))


def _check_all_labels(found: xr.Dataset, machine: Mechanism) -> None:
    """Raises InputError for labels that are not those of the mechanism, or cannot be shown."""
    dims = ("chain", "contact", "ligament", "wall", "coordinate", "axis", "component")
    known = labels_of(machine, *dims) | {"independent": _independent(machine, found)}
    for name, right in known.items():
        got = found[name].values.ravel().tolist() if name in found.variables else [*right]
        if got != [*right]:
            raise InputError(
                f'"{name}" is along {shortened(printable(got, lines=False), LONE)}, expected '
                f"{', '.join(right) or 'nothing'}, as its mechanism has it"
            )
    for key, variable in found.variables.items():
        if variable.dtype.kind in TEXTS:
            texts = variable.values.ravel().tolist()
            if not all(isinstance(t, str) and t.isprintable() and len(t) <= LONE for t in texts):
                raise InputError(f'"{key}" has labels that cannot be shown')
    if "time" in found.variables:
        time = found["time"].values
        good = time.ndim == 1 and time.size and time.dtype.kind == "f" and np.isfinite(time).all()
        if not (good and (np.diff(time) >= 0).all()):
            raise InputError('"time": expected finite times that rise')


def _independent(machine: Mechanism, found: xr.Dataset) -> tuple[str, ...]:
    """Names of q; where a surface was written in Python, which no file has, those that stand."""
    try:
        return independent_coordinates(machine)
    except InputError:
        said = found["independent"].values.tolist() if "independent" in found.variables else []
        return tuple(name for name in COORDINATES if name in said)


def _check_variable(found: xr.Dataset, name: str, kind: Kind, machine: Mechanism) -> None:
    variable, right = found[name], kind.variables(name)
    assert right is not None
    if right[0] == AXES_OF_STATUS and "status" in found:
        right = (*map(str, found["status"].dims), *right[1:])
    if not fnmatchcase(" ".join(map(str, variable.dims)), " ".join(right)):
        got = ", ".join(printable(dim, lines=False) for dim in variable.dims)
        raise InputError(f'"{name}" is over ({got[:LONE]}), expected ({", ".join(right)})')
    if missing := [dim for dim in variable.dims if dim not in found.variables]:
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
    kept = {}
    for key in ("units", "long_name", "flag_meanings"):
        text = given.get(key)
        if text is None:
            continue
        long = TEXT.most if key == "flag_meanings" else LONE
        if not isinstance(text, str) or len(text) > long or not text.isprintable() or "$" in text:
            raise InputError(f'the {key} of "{name}" cannot be shown: expected a short line')
        kept[key] = text
    return kept


@contextmanager
def _attribute(name: str) -> Iterator[None]:
    try:
        yield
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(map(str, first["loc"]))
        why = f"{place}: {first['msg']}" if place else first["msg"]
        raise InputError(
            f'its attribute "{name}" is damaged: {shortened(printable(why, lines=False), LONE)}'
        ) from None


def line(value: Any) -> str:
    """A text that is shown in one line."""
    return shortened(printable(STRING.validate_python(value), lines=False), LONE)


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
