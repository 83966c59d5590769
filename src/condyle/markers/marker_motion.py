"""From markers to motion: two rigid bodies, the base taken out, the rest a pose in {S}.

Of the poses on the contacts it is the one nearest to the platform's markers.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
from pydantic import ValidationError

from ..errors import InputError, brief, quoted
from ..mechanism import as_mechanism
from ..mechanism.mechanism import Mechanism
from ..mechanism.vocabulary import words_of
from ..motion.arrays import as_number
from ..motion.column_units import POSE
from ..motion.nearest_pose import NearestPoses, nearest_poses
from ..motion.path import Motion
from .emg import above_greatest, envelopes, with_mvc
from .forces import measured_load
from .marker_bodies import Bodies, MarkerBody, find_bodies
from .marker_checks import exchanged_and_loose, odd_sizes, off_contacts, why_none
from .marker_file import Forces, MarkerFile, Place
from .marker_gaps import Keep, close_gaps, filled
from .marker_report import MarkerMotion, MarkerResidual
from .measured_channels import MeasuredChannels
from .recorded_tables import read_recording
from .recording import Recording, find_label
from .registration import Registration, register
from .rigid import continuous_angles
from .vertical import base_motion

F = TypeVar("F", bound=MarkerFile)

MAX_RESIDUAL = 2e-3  # m
MAX_GAP = 0.1  # s


def motion_from_c3d(
    path: str | os.PathLike[str],
    markers: str | os.PathLike[str] | Mapping[str, Any] | MarkerFile,
    model: Any,
    *,
    max_residual: float = MAX_RESIDUAL,
    max_gap: float = MAX_GAP,
    longest: bool = False,
    unit: str | None = None,
    force: Sequence[str] | None = None,
    cutoff: float | str | None = None,
) -> MarkerMotion:
    """A motion from recorded markers: C3D, TRC, a table (CSV, Parquet), or JTS (HDF5).

    Args:   path: the recording; a table has `t` [s] and `<marker>_x`, `_y`, `_z` [m, or as
                `_x [mm]` says].
            markers: a marker file (TOML), or its tables.
            model: whose points are registered: a model or mechanism, its file or bundled name.
            max_residual: a frame in which a marker has a larger residual in its body [m] is a
                gap.
            max_gap: longest gap to fill by a cubic spline [s].
            longest: if a gap is too long to fill, keep the longest gap-free interval.
            unit: of lengths, in place of what the file says: m, cm, mm or um.
            force: channels with the components of a force along the laboratory's axes, in place
                of [forces] of the marker file.
            cutoff: smooth the motion, as of `Motion.from_arrays`.
    Raises: InputError: for files that cannot be used, and gaps that are too long.
    """
    for name, value, unit_of in (("max_residual", max_residual, "m"), ("max_gap", max_gap, "s")):
        as_number(value, name, f"a number of at least 0 [{unit_of}]", lambda x: x >= 0)
    machine = as_mechanism(model)
    file, recording = with_mvc(MarkerFile.read(markers)), read_recording(path, unit)
    static = None if file.static is None else read_recording(file.static.file, unit)
    return motions_of(
        recording, file, machine, static=static, max_residual=max_residual, max_gap=max_gap,
        keep="longest" if longest else "one", force=force, cutoff=cutoff,
    )[0]  # fmt: skip


def motions_of(
    recording: Recording,
    file: MarkerFile,
    machine: Mechanism,
    *,
    static: Recording | None = None,
    max_residual: float = MAX_RESIDUAL,
    max_gap: float = MAX_GAP,
    keep: Keep = "one",
    force: Sequence[str] | None = None,
    cutoff: float | str | None = None,
    trim: float = 0.0,
    on_contacts: bool = True,
) -> list[MarkerMotion]:
    """The same of recordings that were read, of each interval that is kept, in their order.

    They differ in motion, measured, vertical, channels and load; residuals and gaps are of all.

    Args: static: the trial that `file.static` names;  keep: of gaps that are too long;
          trim: taken off both ends of each interval, once it was smoothed [s].
          on_contacts: False leaves the poses as the markers have them.
    """
    forces = file.forces if force is None else _three(force)
    activity = {} if file.emg is None else envelopes(file.emg, recording, machine)
    bodies = find_bodies(recording, file, static)

    registration = register(file, machine, partial(_place, bodies.home))
    R, p = registration.pose(bodies.platform.fit.rotation, bodies.platform.fit.position)
    worst = np.maximum(*(body.fit.largest() for body in bodies.both))  # NaN where either is
    used = worst <= max_residual
    checks = exchanged_and_loose(recording, bodies, ~used & np.isfinite(worst))

    free = np.where(used[:, None], np.hstack([p, continuous_angles(R)]), np.nan)
    fitted = NearestPoses.unmoved(tuple(bodies.platform.names), free)
    if on_contacts:
        fitted = _on_contacts(machine, bodies, registration, file, free)
    lost = used & ~fitted.determined

    def why(run: slice) -> str:
        if lost[run].any():
            return "no pose on the contacts is near the platform's markers"
        return why_none(bodies, max_residual, run)

    used, pose = used & fitted.determined, fitted.pose
    try:
        intervals, gaps = close_gaps(recording.source, recording.t, pose, max_gap, keep, why, trim)
        verticals = [
            base_motion(file.vertical, bodies, registration, machine, interval)
            for interval, _ in intervals
        ]
    except InputError as error:
        if not (said := [*registration.warnings, *checks]):
            raise
        raise InputError(f"{'. '.join(said)}. {error.message}", error.hint) from None
    at = np.zeros_like(used)
    for interval, _ in intervals:
        at[interval] = used[interval]
    off = off_contacts(machine, R[at], p[at])
    markers_there = np.concatenate([body.points for body in bodies.both], axis=1)
    places = registration.to_base(bodies.steadied(markers_there))
    residual = np.hstack([body.fit.residual for body in bodies.both])
    motions = []
    for (interval, whole), vertical in zip(intervals, verticals, strict=True):
        columns = dict(zip(POSE, whole.T, strict=True)) | vertical.columns()
        t = recording.t[interval]
        smoothed: Any = {"cutoff": cutoff, "trim": trim, "source": recording.source}
        motion = Motion.from_arrays(t, columns, **smoothed)
        as_seen = dict(zip(POSE, filled(t - t[0], free[interval]).T, strict=True))
        as_seen_motion = Motion.from_arrays(t, as_seen, **smoothed)
        first = int(np.searchsorted(t, motion.t[0]))
        vertical = vertical.at(slice(first, first + len(motion)))
        interval = slice(interval.start + first, interval.start + first + len(motion))
        load = None
        if forces is not None:
            pose_kept = interval, motion.value
            load = measured_load(forces, recording, bodies, registration, machine, pose_kept)
        texts = (
            *recording.warnings,
            *bodies.warnings,
            *odd_sizes(recording, bodies),
            *above_greatest(file.emg, activity),
            *registration.warnings,
            *checks,
            *vertical.warnings,
            *motion.warnings,
            *(() if load is None else load.warnings),
        )
        warnings = tuple(map(words_of(machine), texts))
        channels = MeasuredChannels(
            t=motion.t,
            names=tuple(name for body in bodies.both for name in body.names),
            bodies=tuple(body.what for body in bodies.both for _ in body.names),
            points=places[interval],
            residual=residual[interval],
            emg={chain: values[interval] for chain, values in activity.items()},
            source=recording.source,
        )
        motions.append(
            MarkerMotion(
                mechanism=machine,
                motion=replace(
                    motion,
                    sha256=recording.sha256,
                    warnings=warnings,
                    contact_fit=fitted.moved_by(at) if machine.contacts else None,
                ),
                measured=used[interval],
                free=as_seen_motion.value,
                residuals=tuple(r for body in bodies.both for r in _residuals(recording, body, at)),
                gaps=tuple(gaps),
                registration=registration,
                off_contacts={n: (_rms(d), float(np.abs(d).max())) for n, d in off.items()},
                fitted=fitted,
                markers_moved=fitted.summary(at),
                home_places={
                    body.what: dict(zip(body.names, registration.to_base(body.shape), strict=True))
                    for body in bodies.both
                },
                static=_held(bodies),
                vertical=vertical,
                channels=channels,
                load=load,
                recording=recording,
                warnings=warnings,
            )
        )
    return motions


def _held(bodies: Bodies) -> dict[str, Any] | None:
    """The static trial, and how far the head, and the platform at home, are from it."""
    if bodies.static is None:
        return None
    way, turn = bodies.head_moved()
    found: dict[str, Any] = {
        "source": bodies.static.recording.source, "head_moved": way, "head_turned": turn,
    }  # fmt: skip
    return found | ({"platform_moved": bodies.off_static()} if bodies.at_home.any() else {})


def _on_contacts(
    machine: Mechanism,
    bodies: Bodies,
    registration: Registration,
    file: MarkerFile,
    free: np.ndarray,
) -> NearestPoses:
    """The poses on the contacts that are nearest to the platform's markers.

    Args: free: the poses that fit without contacts, (F, 6); NaN where there is none.
    """
    platform = bodies.platform
    points = dict(zip(platform.names, registration.to_base(platform.shape), strict=True))
    weights = np.array([file.weights.get(name, 1.0) for name in platform.names])
    measured = registration.to_base(bodies.steadied(platform.points))
    return nearest_poses(machine, points, measured, free, weights)


def registered_places(
    recording: Recording, file: MarkerFile, machine: Mechanism, static: Recording | None = None
) -> tuple[dict[str, np.ndarray], Registration]:
    """Points that the file registers, where they are in {S} at home, (3,) [m] each.

    {S} is where all of them are nearest to their places in the mechanism, which is still to be
    scaled to them.

    Raises: InputError: where directions stand in the place of points; as of `motion_of`.
    """
    if file.directed:
        raise InputError(
            "scale: [register] gives directions; a mechanism is scaled to places of its points"
        )
    place = partial(_place, find_bodies(recording, file, static).home)
    found = register(file, machine, place, any_size=True)
    return {n: found.to_base(place(where, n)) for n, where in file.places.items()}, found


@dataclass(frozen=True)
class MovedPlaces:
    """Errors of registered points in the laboratory at home.

    offsets: by point, (3,) [m];  turn: of all together about their mean, a rotation vector [rad].
    """

    offsets: Mapping[str, np.ndarray]
    turn: np.ndarray = field(default_factory=lambda: np.zeros(3))


def with_moved_places(
    file: F, recording: Recording, static: Recording | None, moved: MovedPlaces
) -> F:
    """The file with places of registered points as numbers, moved."""
    home = find_bodies(recording, file, static).home
    there = np.array([_place(home, where, name) for name, where in file.places.items()])
    offsets = np.array([moved.offsets[name] for name in file.places])
    if moved.turn.any():
        from scipy.spatial.transform import Rotation

        own = there - there.mean(axis=0)
        offsets = offsets + Rotation.from_rotvec(moved.turn).apply(own) - own
    places = ((there + offsets) / home.recording.metres).tolist()
    return file.model_copy(
        update={"places": dict(zip(file.places, map(tuple, places), strict=True))}
    )


def places_at_home(
    places: Mapping[str, Place],
    motion: MarkerMotion,
    file: MarkerFile,
    static: Recording | None = None,
) -> dict[str, np.ndarray]:
    """Other points, where they are in {S} at home, (3,) [m] each."""
    home = find_bodies(motion.recording, file, static).home
    return {n: motion.registration.to_base(_place(home, where, n)) for n, where in places.items()}


def _three(channels: Sequence[str]) -> Forces:
    if not isinstance(channels, list | tuple):
        raise InputError(f"force: expected the labels of three channels, got {brief(channels)}")
    if len(channels) != 3:
        raise InputError(f"force: got {len(channels)} channels, expected three: along X, Y, Z")
    try:
        return Forces.model_validate({"channels": tuple(channels)})
    except ValidationError:
        raise InputError(
            f"force: got {quoted(map(str, channels))}, expected the labels of three channels"
        ) from None


def _place(bodies: Bodies, where: Place, key: str) -> np.ndarray:
    """Where a marker is at home on the mean, or what numbers in the file's unit say, (3,) [m]."""
    recording = bodies.recording
    if not isinstance(where, str):
        return np.array(where) * recording.metres
    label = find_label(where, recording.labels, f"register: {key}: {recording.source}")
    there = bodies.steadied(recording.points[:, [label]])[bodies.at_home, 0]
    there = there[np.isfinite(there).all(axis=1)]
    if not len(there):
        raise InputError(
            f'register: {key}: marker "{where}" is not seen in {recording.source} while the '
            "mechanism is at home"
        )
    return there.mean(axis=0)


def _residuals(recording: Recording, body: MarkerBody, used: np.ndarray) -> list[MarkerResidual]:
    residuals = []
    for name, residual in zip(body.names, body.fit.residual.T, strict=True):
        known = np.flatnonzero(used & np.isfinite(residual))
        seen, about = len(known) / max(int(used.sum()), 1), (math.nan,) * 3
        if len(known):
            worst = known[np.argmax(residual[known])]
            about = _rms(residual[known]), float(residual[worst]), float(recording.t[worst])
        residuals.append(MarkerResidual(name, body.what, seen, *about))
    return residuals


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
