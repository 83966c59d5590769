"""NetCDF files, altered as a stranger or an accident would."""

from __future__ import annotations

import random
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np

TEXTS = [
    *("", "[]", "{}", "null", "days since 1900-01-01", "![x](http://example.org/x.png)"),
    *("<iframe src='http://example.org'></iframe>", "\x1b[31m", "\u202e", "$\\frac$", "x" * 5000),
    *("[" * 5000, '{"formulation": 3}', '[{"kind": []}]', "name = 3"),
]
VALUES: list[Any] = [*TEXTS, 0, -1, 1e300, np.nan, np.arange(5), np.zeros((3, 0)), b"\xff\xfe"]
VALUES += [np.array(TEXTS[:4], dtype=object), np.bool_(True), 2**63, np.float16(1)]


def altered(rng: random.Random, path: Path) -> None:
    """Change a file in one to three places."""
    if rng.random() < 0.3:
        return _bytes(rng, path)
    with h5py.File(path, "r+") as file:
        for _ in range(rng.choice((1, 1, 2, 3))):
            # An earlier change may be in the way.
            with suppress(RuntimeError, LookupError, OSError, ValueError):
                rng.choice(CHANGES)(rng, file, path)
    return None


def _bytes(rng: random.Random, path: Path) -> None:
    data = bytearray(path.read_bytes())
    if rng.random() < 0.2:
        del data[rng.randrange(len(data)) :]
    for _ in range(rng.choice((1, 1, 2, 5, 40))):
        if data:
            reach = rng.choice((100, 3000, len(data)))
            at = rng.randrange(min(reach, len(data)))
            new = rng.choice((b"\x00", b"\xff", b"\x7f", rng.randbytes(1), rng.randbytes(8)))
            data[at : at + len(new)] = new
    path.write_bytes(bytes(data))


def _variable(rng: random.Random, file: h5py.File) -> str:
    return rng.choice([*file] or ["none"])


def _lose(rng: random.Random, file: h5py.File, path: Path) -> None:
    name = _variable(rng, file)
    if name in file:
        del file[name]


def _attribute(rng: random.Random, file: h5py.File, path: Path) -> None:
    name = _variable(rng, file)
    found = rng.choice([file, file.get(name)])
    if found is None:
        return
    names = [n for n in found.attrs if n not in ("DIMENSION_LIST", "REFERENCE_LIST")]
    key = rng.choice([*names, "units", "_FillValue", "scale_factor", "coordinates", "dtype"])
    if rng.random() < 0.3:
        found.attrs.pop(key, None)
    else:
        found.attrs[key] = rng.choice(VALUES)


def _resize(rng: random.Random, file: h5py.File, path: Path) -> None:
    name = _variable(rng, file)
    if not isinstance(file.get(name), h5py.Dataset):
        return
    old = file[name]
    kept = dict(old.attrs)
    shape = [*old.shape]
    if shape:
        shape[rng.randrange(len(shape))] = rng.choice((0, 1, 2, 7, 10**6, 10**10))
    if rng.random() < 0.2:
        shape.append(2)
    dtype = rng.choice((old.dtype, old.dtype, "f4", "i8", "S3", "c16", h5py.string_dtype()))
    del file[name]
    chunks = tuple(max(min(n, 16), 1) for n in shape) or None
    large = np.prod(shape or [1], dtype=float) > 1e6
    made = file.create_dataset(name, shape, dtype, chunks=chunks if large else None)
    for key in rng.sample([*kept], rng.randrange(len(kept) + 1)):
        try:
            made.attrs[key] = kept[key]
        except TypeError:
            continue


def _values(rng: random.Random, file: h5py.File, path: Path) -> None:
    name = _variable(rng, file)
    found = file.get(name)
    if isinstance(found, h5py.Dataset) and found.size and found.size < 1e6:
        if found.dtype.kind in "fiu":
            new = rng.choice((0, 1, 100, -1 if found.dtype.kind != "u" else 255))
            found[...] = new if rng.random() < 0.5 else np.full(found.shape, new)
        elif h5py.check_string_dtype(found.dtype):
            found[rng.randrange(len(found))] = rng.choice(TEXTS)


def _link(rng: random.Random, file: h5py.File, path: Path) -> None:
    name = _variable(rng, file)
    if name in file:
        del file[name]
    kind = rng.randrange(4)
    if kind == 0:
        file[name] = h5py.ExternalLink("/etc/passwd", "/x")
    elif kind == 1:
        file[name] = h5py.SoftLink(f"/{name}")
    elif kind == 2:
        file.create_dataset(name, (9,), "u1", external=[("/etc/passwd", 0, 9)])
    else:
        layout = h5py.VirtualLayout((9,), "f8")
        layout[:] = h5py.VirtualSource(str(path), "time", (9,))
        file.create_virtual_dataset(name, layout)


def _group(rng: random.Random, file: h5py.File, path: Path) -> None:
    name = rng.choice(["a", "effort2", "reaction_", "chain_RSS", _variable(rng, file)])
    if name not in file:
        file.create_group(name).attrs["x"] = rng.choice(VALUES)


def _rename(rng: random.Random, file: h5py.File, path: Path) -> None:
    name, other = _variable(rng, file), _variable(rng, file)
    if name in file and other in file:
        file.move(name, "temporary")
        file.move(other, name)
        if "temporary" in file:
            file.move("temporary", rng.choice((other, "torque", "reaction_x", "another")))


CHANGES = (_lose, _attribute, _attribute, _attribute, _resize, _resize, _values, _link, _group)
CHANGES += (_rename,)
