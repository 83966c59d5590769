"""The load from analogue channels, turned and carried into the mechanism's frame."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError, join, quoted, short
from ..mechanism.coordinates import rotations
from ..motion.column_units import Dimension, unit_factor
from ..motion.platform_load import Load
from ..motion.points import DEFAULT_LOAD_POINT, resolve_load_point
from .marker_bodies import Bodies
from .marker_file import Forces
from .plates import CHANNELS, Plate
from .recording import Recording, find_label
from .registration import Registration

if TYPE_CHECKING:
    from ..mechanism.mechanism import Mechanism

_FORCE, _MOMENT, _LENGTH = ("force", 0), ("moment", 0), ("length", 0)
_OF_PLATE: dict[int, tuple[Dimension, ...]] = {
    1: (_FORCE,) * 3 + (_LENGTH,) * 2 + (_MOMENT,),
    2: (_FORCE,) * 3 + (_MOMENT,) * 3,
    3: (_FORCE,) * 8,
}


def measured_load(
    table: Forces,
    recording: Recording,
    bodies: Bodies,
    registration: Registration,
    mechanism: Mechanism,
    pose: tuple[slice, np.ndarray],
) -> Load:
    """The load on the platform; where the base is not seen, linear between its neighbours.

    Three channels are a force at a point. A plate's wrench keeps its line of action, through the
    centre of pressure, by its moment about the point where loads act by default; unless a point is
    named: then the force acts there.

    Args:   pose: frames of the motion, and X_EE at them, (K, 6) [m, rad].
    Raises: InputError: for channels, plates or points that are not there, and wrong units.
    """
    points = mechanism.platform.points
    if table.point is not None and table.point not in points:
        resolve_load_point(table.point, points)  # which says what there is
    if table.plate is None:
        force = np.stack([_channel(recording, n, _FORCE) for n in table.channels or ()], axis=-1)
        force = _about_zero(table, recording, force.mean(axis=1))
        in_base = _turned(table, force, bodies) @ registration.rotation.T
        return _load(table, recording, recording.t, in_base, table.point)
    plate, assumed = _plate(recording, table.plate)
    if plate.unloaded is not None and table.zero is None:
        first, last = plate.unloaded
        start, end = ((frame - 1) / recording.rate for frame in plate.unloaded)
        assumed += (
            f"{recording.source}: FORCE_PLATFORM:ZERO names frames {first} to {last} as without "
            f"load; nothing was subtracted. zero = [{start:.6g}, {end:.6g}] in [forces] subtracts "
            "their mean",
        )
    force, moment = (w.mean(axis=1) @ plate.axes.T for w in _wrench(recording, plate))
    both = _about_zero(table, recording, np.hstack([force, moment]))
    base = bodies.fixed.fit
    force, moment = (
        _back(base.rotation, v) @ registration.rotation.T for v in np.split(both, 2, 1)
    )
    if table.point is not None:
        return _load(table, recording, recording.t, force, table.point, assumed)
    run, X = pose
    # About any point the wrench is the same one; that of `condyle run` needs no option there.
    name = DEFAULT_LOAD_POINT if DEFAULT_LOAD_POINT in points else next(iter(points), None)
    at = rotations(X[:, 3:]) @ np.array(points[name] if name else (0.0, 0.0, 0.0)) + X[:, :3]
    middle = registration.to_base(
        bodies.steadied(np.tile(plate.centre, (len(base.position), 1, 1)))
    )
    arm = middle[run, 0] - at
    wrench = np.hstack([force[run], moment[run] + np.cross(arm, force[run])])
    return _load(table, recording, recording.t[run], wrench, name, assumed)


def _load(
    table: Forces,
    recording: Recording,
    t: np.ndarray,
    wrench: np.ndarray,
    point: str | None,
    assumed: tuple[str, ...] = (),
) -> Load:
    known = np.isfinite(wrench).all(axis=1)  # not where the base is not seen
    signed = -wrench[known] if table.reverse else wrench[known]
    load = Load.from_arrays(t[known], signed, point=point, source=recording.source)
    return replace(load, warnings=(*assumed, *load.warnings))


def _turned(table: Forces, force: np.ndarray, bodies: Bodies) -> np.ndarray:
    """Forces, (F, 3), along the laboratory's axes at home, the base's turn taken out."""
    if table.axes == "fixed":
        return force
    if table.axes == "platform":
        return np.einsum("fij,fj->fi", bodies.platform.fit.rotation, force)
    return _back(bodies.fixed.fit.rotation, force)


def _back(rotation: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("fji,fj->fi", rotation, vectors)


def _about_zero(table: Forces, recording: Recording, values: np.ndarray) -> np.ndarray:
    """Values less their mean while there is no load."""
    if table.zero is None:
        return values
    start, end = table.zero
    within = (recording.t >= start - 1e-9) & (recording.t <= end + 1e-9)
    if not within.any():
        raise InputError(
            f"forces: zero: {recording.source} has no frame from {start:g} to {end:g} s; it runs "
            f"from {recording.t[0]:.6g} to {recording.t[-1]:.6g} s"
        )
    return values - values[within].mean(axis=0)


def _plate(recording: Recording, number: int) -> tuple[Plate, tuple[str, ...]]:
    """The plate of that number, and what had to be assumed of it.

    Raises: InputError: if there is none, or the file does not say enough of it.
    """
    source, plates = recording.source, recording.plates
    if number > len(plates):
        there = f"has {len(plates)}" if plates else "has no force plate (FORCE_PLATFORM:USED)"
        other = "; name three channels instead" if not plates else ""
        raise InputError(f"{source}: forces: plate {number} asked for, and it {there}{other}")
    plate = plates[number - 1]
    where = f"{source}: force plate {number}"
    if plate.type not in CHANNELS:
        raise InputError(
            f"{where} is of type {plate.type}, expected {join(map(str, CHANNELS))}. Name "
            "three channels instead"
        )
    wanted, count = CHANNELS[plate.type], len(recording.channels)
    if len(plate.channels) < wanted or not all(0 <= c < count for c in plate.channels):
        named = ", ".join(str(c + 1) for c in plate.channels) or "none"
        raise InputError(
            f"{where} (type {plate.type}) needs {wanted} of the file's {count} channels; "
            f"FORCE_PLATFORM:CHANNEL names {named}"
        )
    if not plate.stands:
        raise InputError(f"{where}: its corners (FORCE_PLATFORM:CORNERS) span no surface")
    if plate.type == 4 and not plate.matrix.any():
        raise InputError(f"{where} is of type 4 and has no FORCE_PLATFORM:CAL_MATRIX")
    assumed = []
    if plate.type in (2, 4) and plate.origin[2] > 0:
        assumed.append(
            f"{where}: FORCE_PLATFORM:ORIGIN has z above 0, as if the sensor were above the "
            "surface; its sign was turned over"
        )
        plate = replace(plate, origin=-plate.origin)
    moments = [] if plate.type == 3 else plate.channels[-1 if plate.type == 1 else 3 :]
    if plate.type != 4 and not all(recording.channel_units[c] for c in moments):
        assumed.append(f"{where}: moments without a unit; N {recording.unit} was assumed")
    return plate, tuple(assumed)


def _wrench(recording: Recording, plate: Plate) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment about the middle of the surface, (F, n, 3) each, in the plate's axes."""
    names = [recording.channels[c] for c in plate.channels]
    kinds = _OF_PLATE.get(plate.type)
    if kinds is None:  # the matrix gives newtons, and moments in the file's length
        signals = _finite(recording, recording.samples[..., list(plate.channels)], names)
        scale = np.repeat([1.0, recording.metres], 3)[:, None]
        return replace(plate, matrix=plate.matrix * scale).wrench(signals)
    columns = [_values(recording, c, kind) for c, kind in zip(plate.channels, kinds, strict=True)]
    return plate.wrench(np.stack(columns, axis=-1))


def _channel(recording: Recording, name: str, kind: Dimension) -> np.ndarray:
    """Samples of a channel, (F, n), in SI."""
    at = find_label(name, recording.channels, f"{recording.source}: forces", "channel")
    return _values(recording, at, kind)


def _values(recording: Recording, at: int, kind: Dimension) -> np.ndarray:
    """Samples of the channel of that number, (F, n), in SI; without a unit N, and the file's
    length."""
    name, unit = recording.channels[at], recording.channel_units[at]
    factor = 1.0 if kind == _FORCE else recording.metres
    if unit.strip(" .*-_"):
        factor = unit_factor(unit, kind, f'{recording.source}: channel "{short(name)}": ')
    return _finite(recording, recording.samples[..., at], [name]) * factor


def _finite(recording: Recording, samples: np.ndarray, names: list[str]) -> np.ndarray:
    if not np.isfinite(samples).all():
        raise InputError(
            f"{recording.source}: channel {quoted(names)} has samples that are no numbers"
        )
    return samples
