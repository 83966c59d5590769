"""NetCDF files of strangers, opened after their header is checked and before any array is read.

Nothing leads out of the file, and what is read fits the file and memory: HDF5 itself makes room for
whatever a header claims.
"""

from __future__ import annotations

import math
import os
import struct
import zlib
from collections.abc import Callable
from itertools import accumulate
from mmap import ACCESS_READ, mmap
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError, as_path, short
from .limits import ATTRIBUTE, DENSITY, ENTRIES, LABELS, TEXT
from .memory import byte_text, require_memory
from .reading import require_file

if TYPE_CHECKING:
    import h5py
    import xarray as xr

SMALL = 1 << 26  # bytes that a file of any size may stand for
PACKED, CHECKSUM = 1032, 64  # bytes that a byte of gzip stands for at most; bytes beside a block
# How a file has a text or references of any number: where they are, after their length.
TEXT_AT = np.dtype([("length", "<u4"), ("heap", "<u8"), ("index", "<u4")])
FILTERS = {1: "gzip", 2: "shuffle", 3: "fletcher32"}


def open_checked(
    path: str | os.PathLike[str],
    noun: str,
    reads: Callable[[str], bool],
    check: Callable[[xr.Dataset], xr.Dataset],
    lazy: bool = False,
) -> xr.Dataset:
    """A dataset in a NetCDF file, whoever wrote it.

    Args:   noun: what the file is, for messages;  reads: whether a variable is read, by its name;
            check: makes the dataset that is given out of what was read;
            lazy: leave arrays in the file until they are read; the caller closes it.
    Raises: InputError: if the file is missing or of another kind.
    """
    import h5py
    import xarray as xr

    name = as_path(path)
    if os.path.isdir(name):
        raise InputError(f"{path}: is a folder; give the name of a {noun} (.nc) in it")
    require_file(name)
    try:
        with h5py.File(name, "r") as file:
            shapes = _check_header(file, name, reads, lazy)
        dataset = xr.open_dataset(
            name,
            engine="h5netcdf",
            cache=not lazy,
            drop_variables=[label for label, shape in shapes.items() if shape is None],
            mask_and_scale=False,
            decode_times=False,
            concat_characters=False,
            decode_coords=False,
            phony_dims="sort",
        )
        try:
            for label, variable in (dataset if lazy else dataset.load()).variables.items():
                sizes = tuple(dataset.sizes[dim] for dim in variable.dims)
                if not variable.shape == sizes == shapes[str(label)]:
                    raise InputError(f'"{label}" does not fit its dimensions')
            checked = check(dataset)
        finally:
            if not lazy:
                dataset.close()
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except Exception as error:  # of h5py, h5netcdf and xarray, for which there is no list
        why = short(" ".join(str(error).split()), 200)
        if "signature not found" in why:  # HDF5's words
            why = "it does not begin as one; expected a .nc file that condyle wrote"
        raise InputError(f"{path} is not a NetCDF {noun}: {why}") from None
    checked.set_close(dataset.close)
    return checked


def _check_header(
    file: h5py.File, path: str, reads: Callable[[str], bool], lazy: bool
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
            item = file[name]
            if not isinstance(item, h5py.Dataset):
                raise InputError(f'"{name}" is a group; expected variables')
            filters = check_stored(name, item)
            texts |= _texts_of(item)
            if not reads(name):
                shapes[name] = None
                continue
            shapes[name] = item.shape
            if h5py.check_string_dtype(item.dtype) is not None:
                _check_labels(item, data, bool(filters))
            elif item.dtype.kind in "fiu":
                total += item.size * item.dtype.itemsize
                check_chunks(item, size)
            else:
                raise InputError(f'"{name}" holds {item.dtype}, expected numbers or texts')
        for name in texts:
            check_text(name, data)
    check_total(total, size, lazy)
    return shapes


def check_total(total: int, size: int, lazy: bool = False) -> None:
    """Raises InputError for more bytes of arrays than the file can stand for, or memory holds."""
    if total > SMALL:
        DENSITY.check(total / size, f"{byte_text(total)} of arrays in a file of {byte_text(size)}")
    if not lazy:
        require_memory(total, "its arrays take")


def check_stored(name: str, item: h5py.Dataset) -> list[int]:
    """Its filters.

    Raises: InputError: for arrays of another file, and those that are packed in other ways.
    """
    if item.is_virtual or item.external:
        raise InputError(f'"{name}" is stored in another file; expected all in this one')
    plan = item.id.get_create_plist()
    filters = [plan.get_filter(i)[0] for i in range(plan.get_nfilters())]
    if len({*FILTERS} & {*filters}) < len(filters):
        raise InputError(f'"{name}" is packed; expected at most {", ".join(FILTERS.values())}')
    return filters


def _texts_of(item: h5py.File | h5py.Dataset) -> set[str]:
    """The attributes that hold texts or references of a length of their own.

    Raises: InputError: for attributes too large to be read.
    """
    import h5py

    names = set()
    for name in item.attrs:
        attribute = h5py.h5a.open(item.id, name.encode("utf-8", "surrogateescape"))
        count, each = (
            attribute.get_space().get_simple_extent_npoints(),
            attribute.get_type().get_size(),
        )
        TEXT.check(count * each, f'its attribute "{name}"')
        if attribute.dtype.kind == "O":
            names.add(name)
            ENTRIES.check(count, f'its attribute "{name}"')
        elif attribute.dtype.hasobject and name != "REFERENCE_LIST":
            raise InputError(f'its attribute "{name}" holds {attribute.dtype}')
    return names


def check_text(name: str, data: mmap) -> None:
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


def _check_labels(variable: h5py.Dataset, data: mmap, packed: bool) -> None:
    """Raises InputError for labels too many or too long, before any is read."""
    import h5py

    LABELS.check(variable.size, f'"{variable.name}"')
    if variable.dtype.kind != "O":
        TEXT.check(variable.size * variable.dtype.itemsize, f'"{variable.name}"')
        return
    if packed or variable.id.get_create_plist().get_layout() == h5py.h5d.COMPACT:
        raise InputError(f'"{variable.name}": its labels are packed')
    blocks = [(variable.id.get_offset(), variable.size * TEXT_AT.itemsize)]
    if variable.chunks is not None:
        infos = map(variable.id.get_chunk_info, range(variable.id.get_num_chunks()))
        blocks = [(info.byte_offset, info.size) for info in infos]
    for at, size in blocks:
        if at is not None:  # nothing was ever written
            texts = np.frombuffer(data[at : at + size], TEXT_AT)
            TEXT.check(int(texts["length"].sum()), f'"{variable.name}"')


def check_chunks(variable: h5py.Dataset, size: int) -> None:
    """Raises InputError for blocks that are larger, once unpacked, than the file can stand for."""
    if variable.chunks is None:
        return
    each, room = (
        math.prod(variable.chunks) * variable.dtype.itemsize,
        max(SMALL, DENSITY.most * size),
    )
    if each > room:
        raise InputError(f'"{variable.name}" is in blocks of {byte_text(each)}: it is damaged')
    if variable.compression is None:
        return
    for i in range(variable.id.get_num_chunks()):
        info = variable.id.get_chunk_info(i)
        if info.size * PACKED > room:
            _, packed = variable.id.read_direct_chunk(info.chunk_offset)
            unpacked = zlib.decompressobj()
            unpacked.decompress(packed, each + CHECKSUM)
            if unpacked.unconsumed_tail:
                raise InputError(f'"{variable.name}" has a block larger than {byte_text(each)}')
