"""Poses of the Jaw Tracking System (HDF5), as markers of the frames that they are of.

A group is a frame over time: `translations` (F, 3) and `rotations`, quaternions (F, 4), scalar
first, or matrices (F, 3, 3), with the attributes `sample_rate` [Hz] and `unit`. In the place of the
frame stand four markers, its origin and the points `ARM` along its axes: `<group>_O`, `_X`, `_Y`
and `_Z`. The frame that the poses are in, of the upper teeth, has `base_O` and so on, at rest.
"""

from __future__ import annotations

import math
import os
from mmap import ACCESS_READ, mmap
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, brief, join, short
from ..files.limits import LABELS, RECORDING, SAMPLES, TEXT
from ..files.netcdf import check_chunks, check_stored, check_text, check_total
from ..files.reading import digest, require_file
from ..mechanism.quantities import LONGEST
from .recording import FASTEST, SLOWEST, Recording, unit_of
from .rigid import quaternion_rotations

if TYPE_CHECKING:
    import h5py

ENDINGS = ".h5", ".hdf5"
# As its authors state them: of places [m], and of turns [rad].
PRECISION, TURN_PRECISION = 0.18e-3, math.radians(0.13)
ARM = 0.05  # m
BASE = "base"
_TIPS = np.vstack([np.zeros(3), ARM * np.eye(3)])
_OFF = 1e-3  # by which a rotation may miss one


def read_jts(path: str | os.PathLike[str], unit: str | None = None) -> Recording:
    """Read a file of the Jaw Tracking System.

    Args:   unit: of its translations, in place of what it says itself.
    Raises: InputError: for another file, and what is larger than it can be.
    """
    import h5py

    require_file(path)
    RECORDING.check(os.path.getsize(path), str(path))
    try:
        with h5py.File(path, "r") as file, np.errstate(all="ignore"):
            return _read(file, path, unit)
    except InputError as error:
        said = str(error)
        raise InputError(said if said.startswith(str(path)) else f"{path}: {said}") from None
    except Exception as error:  # of h5py, for which there is no list
        why = short(" ".join(str(error).split()), 200)
        raise InputError(f"{path}: is broken, or no file of the Jaw Tracking System ({why})") from (
            error
        )


def _read(file: h5py.File, path: str | os.PathLike[str], unit: str | None) -> Recording:
    if file.id.get_create_plist().get_sizes() != (8, 8):
        raise InputError("its addresses are not of 8 bytes")
    groups = _groups(file)
    LABELS.check(len(_TIPS) * (len(groups) + 1), "markers of its frames")
    with open(path, "rb") as raw, mmap(raw.fileno(), 0, access=ACCESS_READ) as data:
        about = {name: _attributes(name, group, data) for name, group in groups.items()}
    frames = {name: len(group["translations"]) for name, group in groups.items()}
    for what, values in (
        ("rates [Hz]", [rate for rate, _ in about.values()]),
        ("units", [said for _, said in about.values()]),
        ("frames", [*frames.values()]),
    ):
        if len({*values}) > 1:
            raise InputError(f"its groups have different {what}: {join(map(str, values))}")
    (rate, said), count = next(iter(about.values())), next(iter(frames.values()))
    if not SLOWEST <= rate <= FASTEST:
        raise InputError(f"got a rate of {rate:g} frames a second (sample_rate)")
    if count < 2:
        raise InputError(f"holds {count} frames, expected more")
    unit, metres, assumed = unit_of(path, said, unit, "unit")
    points = [np.broadcast_to(_TIPS, (count, *_TIPS.shape))]
    for name, group in groups.items():
        places = np.asarray(group["translations"], dtype=float) * metres
        places[~np.isfinite(places).all(axis=1)] = np.nan
        if np.nanmax(np.abs(places), initial=0.0) > LONGEST:
            raise InputError(f'"{name}/translations": a frame is farther than {LONGEST:g} m away')
        turned = _TIPS @ _matrices(name, group["rotations"]).transpose(0, 2, 1)
        points.append(places[:, None] + turned)
    return Recording(
        source=os.path.basename(path),
        sha256=digest(path),
        rate=rate,
        first_frame=1,
        t=np.arange(count) / rate,
        unit=unit,
        metres=metres,
        labels=tuple(f"{name}_{axis}" for name in (BASE, *groups) for axis in "OXYZ"),
        points=np.concatenate(points, axis=1),
        channels=(),
        channel_units=(),
        samples=np.empty((count, 1, 0)),
        warnings=tuple(assumed),
    )


def _groups(file: h5py.File) -> dict[str, h5py.Group]:
    """The groups that are frames over time, all of whose arrays can be read.

    Raises: InputError: where there is none, and where reading would leave the file, or take more
            than is there.
    """
    import h5py

    LABELS.check(len(file), "groups")
    groups, total, size = dict[str, h5py.Group](), 0, os.path.getsize(file.filename)
    for name in file:
        if not isinstance(file.get(name, getlink=True), h5py.HardLink):
            raise InputError(f'"{name}" is a link; expected groups in the file itself')
        group = file[name]
        if not isinstance(group, h5py.Group) or not {"translations", "rotations"} & {*group}:
            continue
        for part, shapes in (("translations", [(3,)]), ("rotations", [(4,), (3, 3)])):
            where = f"{name}/{part}"
            if not isinstance(group.get(part, getlink=True), h5py.HardLink):
                raise InputError(f'"{where}" is missing, or a link; expected it in the group')
            item = group[part]
            if not isinstance(item, h5py.Dataset) or item.dtype.kind != "f":
                raise InputError(f'"{where}" holds no decimal numbers')
            if item.shape is None or item.shape[1:] not in shapes:
                wanted = " or ".join(f"(F, {', '.join(map(str, s))})" for s in shapes)
                raise InputError(f'"{where}" has shape {item.shape}, expected {wanted}')
            SAMPLES.check(len(item), f'"{where}"')
            check_stored(where, item)
            check_chunks(item, size)
            total += item.size * item.dtype.itemsize
        if len(group["translations"]) != len(group["rotations"]):
            raise InputError(f'"{name}" has translations and rotations of different frames')
        groups[name] = group
    if not groups:
        raise InputError(
            "holds no frame over time: expected groups with translations and rotations"
        )
    check_total(total, size)
    return groups


def _attributes(name: str, group: h5py.Group, data: mmap) -> tuple[float, str]:
    """Its rate [Hz] and unit."""
    import h5py

    values: dict[str, Any] = {}
    for key in ("sample_rate", "unit"):
        if key not in group.attrs:
            raise InputError(f'"{name}": its attribute "{key}" is missing')
        attribute = h5py.h5a.open(group.id, key.encode())
        count = attribute.get_space().get_simple_extent_npoints()
        TEXT.check(count * attribute.get_type().get_size(), f'its attribute "{key}"')
        if attribute.dtype.kind == "O":
            check_text(key, data)
        values[key] = group.attrs[key]
    rate, unit = values["sample_rate"], values["unit"]
    if np.ndim(rate) or not np.issubdtype(np.asarray(rate).dtype, np.number):
        raise InputError(f'"{name}": sample_rate: expected a number, got {brief(rate)}')
    unit = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else unit
    if not isinstance(unit, str):
        raise InputError(f'"{name}": unit: expected text, got {brief(unit)}')
    return float(rate), unit


def _matrices(name: str, item: h5py.Dataset) -> np.ndarray:
    """Rotation matrices (F, 3, 3); NaN where the frame was not seen.

    Raises: InputError: for numbers that are no rotations.
    """
    given = np.asarray(item, dtype=float)
    seen = np.isfinite(given.reshape(len(given), -1)).all(axis=1)
    if given.ndim == 2:
        size = np.linalg.norm(given, axis=1)
        off = np.abs(size - 1)
        unit = given / np.where(size > 0, size, 1.0)[:, None]
        found = quaternion_rotations(np.roll(unit, -1, axis=1))
    else:
        found = given
        gram = given @ given.transpose(0, 2, 1)
        off = np.abs(gram - np.eye(3)).max(axis=(1, 2)) + (np.linalg.det(given) < 0)
    if (bad := np.flatnonzero(seen & ~(off <= _OFF))).size:
        what = "quaternion of length 1" if given.ndim == 2 else "rotation"
        raise InputError(f'"{name}/rotations": frame {bad[0] + 1} is no {what}')
    return np.where(seen[:, None, None], found, np.nan)
