"""`plan_path`: a motion through poses, or the fastest along a given path."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..backends.choose import BackendName
from ..errors import InputError, join
from ..mechanism import as_mechanism
from ..mechanism.chain import limits
from ..mechanism.mechanism import Mechanism
from ..mechanism.study_file import (
    NONE,
    REFERENCE,
    LoadName,
    MotionName,
    NotNegative,
    Positive,
    Share,
    StudyFile,
    require_known,
)
from ..mechanism.table import Table
from ..model.model import Model, derive
from ..motion import Motion, as_load, load_place, motion_and_load
from ..results.study_answer import StudyAnswer, limit_data, limit_lines
from .blended import RATE, blended
from .fastest import Planner
from .path_limits import TraversalLimits, bound_shares, speed_shares
from .periodic_path import periodic
from .point_to_point import point_to_point

RIPPLE = 1e-3  # by which the spline through samples may exceed what they keep
BOUNDS = ("speed", "acceleration", "jerk")


class TraversalTable(Table):
    """A path whose times are sought, and what limits them beside efforts and speeds."""

    motion: MotionName = Field(default=REFERENCE, description="a motion file beside the study")
    landmark: str | None = Field(default=None, description="whose path x, y, z are")
    load: LoadName = Field(default=NONE, description='a load file beside the study, or "reference"')
    load_point: str | None = Field(default=None, description="where the load acts")
    closed: bool = Field(default=False, description="a cycle, passed without stopping")
    contact_force: dict[str, Positive] = Field(default={}, description="contact -> greatest [N]")
    preload: NotNegative = Field(default=0.0, description="least force of one-sided contacts [N]")
    share: Share = Field(
        default=0.9,
        description="part of each limit that is used; least efforts above zero and preload stay",
    )
    blend: Positive | None = Field(
        default=None,
        description="over which accelerations change [s]; default: 1/200 of the least time",
    )
    intervals: Annotated[int, Field(strict=True, ge=20, le=5000)] = Field(
        default=400, description="of the path, each with one acceleration along it"
    )


class PathStudy(StudyFile):
    """Poses, and how they are joined; or a path, and what limits its traversal."""

    kind: Literal["point_to_point", "periodic", "fastest"] = Field(
        default="point_to_point",
        description="at rest in each pose, one closed smooth cycle, or a given path in least time",
    )
    pose: tuple[dict[str, float], ...] = Field(
        default=(),
        description="column of a motion file -> value [m, rad], the same columns in each pose",
    )
    along: TraversalTable | None = Field(default=None, description="of the fastest traversal")
    speed: dict[str, Positive] = Field(default={}, description="bound by column [m/s, rad/s]")
    acceleration: dict[str, Positive] = Field(
        default={}, description="bound by column [m/s^2, rad/s^2]"
    )
    jerk: dict[str, Positive] = Field(default={}, description="bound by column [m/s^3, rad/s^3]")
    period: Positive | None = Field(default=None, description="of the cycle, if periodic [s]")
    rate: Positive | None = Field(
        default=None,
        description="samples a second of the motion [Hz]; default: 1000, more for a short blend",
    )


@dataclass(frozen=True, eq=False)
class PlannedPath(StudyAnswer):
    """A motion, and what it takes.

    motion: at the study's rate;  at: time of each pose [s];  used: limit -> the largest share of
    it that is used, and when [s]: bounds of the study, and efforts and speeds of the mechanism.
    binds: of the fastest traversal, from when to when [s] which limits bind.
    """

    kind = "path"
    motion: Motion
    at: tuple[float, ...]
    used: dict[str, tuple[float, float]]
    warnings: tuple[str, ...] = ()
    binds: tuple[tuple[float, float, tuple[str, ...]], ...] = ()

    def __str__(self) -> str:
        lines = limit_lines(self.used)
        if self.binds:
            lines += ["what binds, for how much of the time:", *self._binding()]
        over = [name for name, (share, _) in self.used.items() if share > 1 + RIPPLE]
        lines.append(f"{self.motion.t[-1]:.4g} s; beyond their limits: {', '.join(over) or 'none'}")
        return "\n".join(lines)

    def _binding(self) -> list[str]:
        """Limits that bind, longest first."""
        total: dict[str, float] = {}
        for start, end, names in self.binds:
            for name in names or ("none: between two limits",):
                total[name] = total.get(name, 0.0) + (end - start) / self.binds[-1][1]
        order = sorted(total.items(), key=lambda one: -one[1])
        return [f"  {share:6.1%}  {name}" for name, share in order]

    @property
    def data(self) -> dict[str, Any]:
        entry: dict[str, Any] = {"duration": float(self.motion.t[-1]), "at": list(self.at)}
        entry["limits"] = limit_data(self.used)
        if self.binds:
            entry["binds"] = [
                {"from": a, "to": b, "limits": [*names]} for a, b, names in self.binds
            ]
        return entry


def plan_path(
    mechanism: Mechanism | str | os.PathLike[str],
    study: PathStudy | Mapping[str, Any] | str | os.PathLike[str],
    *,
    motion: Motion | str | os.PathLike[str] | None = None,
    backend: BackendName = "auto",
) -> PlannedPath:
    """A motion through poses or along a path, and which share of each limit it uses.

    Point to point it is at rest in each pose, on straight lines of the coordinates, as fast as
    bounds of speed, acceleration and jerk allow. Periodic it is the closed quintic spline through
    the poses, evenly spaced in time. The fastest traversal keeps a path and finds its times,
    within limits of efforts, speeds, accelerations and contact forces, efforts chosen for it.

    Args:   study: a path study (TOML), or its tables: poses with bounds or a period, or a path.
            motion: the path of the fastest traversal, in the place of the study's.
    Raises: InputError: where a study does not fit; UnreachableError: between poses;
            UnsupportedError: the fastest, for muscles and contacts with friction.
    """
    machine = as_mechanism(mechanism)
    checked = PathStudy.read(study)
    if checked.kind == "fastest":
        return _traversal(derive(machine, backend=backend), checked, motion)
    if motion is not None or checked.along is not None:
        raise InputError(
            f'{"along" if motion is None else "motion"}: is a key of kind = "fastest", got kind = '
            f'"{checked.kind}"'
        )
    names, poses = _poses(checked)
    rate = checked.rate or RATE
    if checked.kind == "periodic":
        if checked.period is None:
            raise InputError("period: expected the time of the cycle [s], got none")
        t, values, at = periodic(poses, checked.period, rate)
    else:
        if checked.period is not None:
            raise InputError('period: is a key of kind = "periodic"; the bounds set the time here')
        t, values, at = point_to_point(poses, _bounds(checked, names, poses), rate)
    motion = Motion.from_arrays(t, values, names, source="path")
    model = derive(machine, backend=backend, distribution="minimum_norm")
    solution = model.solve(motion)
    used = _used(machine, motion, checked, solution)
    said = tuple(dict.fromkeys([*motion.warnings, *solution.condyle.warnings]))
    return PlannedPath(motion, tuple(map(float, at)), used, said)


def _traversal(model: Model, study: PathStudy, motion: Any) -> PlannedPath:
    """The fastest traversal of a path, as a motion at even times."""
    machine, table = model.mechanism, study.along or TraversalTable()
    if study.pose or study.jerk or study.period is not None:
        raise InputError('pose, jerk and period: are keys of other kinds, got kind = "fastest"')
    if motion is None and table.motion != REFERENCE:
        motion = table.motion
    force = {REFERENCE: None, NONE: as_load(None)}.get(table.load, table.load)
    path, load = motion_and_load(machine, motion, force, landmark=table.landmark)
    for key in ("speed", "acceleration"):
        require_known(getattr(study, key), path.names, key)
    require_known(table.contact_force, machine.contact_names, "contact_force")
    points = machine.platform.points
    at = None
    if load is not None and table.load != NONE:
        at = load_place(table.load_point, points)
    bounds = TraversalLimits(
        study.speed, study.acceleration, table.contact_force, table.share, table.preload
    )
    planner = Planner(model, path, bounds, load, at, closed=table.closed, intervals=table.intervals)
    traversal = blended(planner, path, table.blend, study.rate)
    chosen = model.with_distribution(
        "bounded" if any(limits(c).limited for c in machine.chains) else "minimum_norm"
    )
    solution = chosen.solve(traversal.motion, flag=True)
    warnings = [*traversal.motion.warnings, *solution.condyle.warnings]
    if not traversal.keeps:
        warnings.append(
            f"the motion needs {traversal.largest * table.share:.1%} of a limit, of which "
            f"{table.share:.0%} may be used: between samples its spline swings about the planned "
            "accelerations. Raise blend or rate, or lower share"
        )
    return PlannedPath(
        traversal.motion, (), _peaks(traversal.t, traversal.used), tuple(dict.fromkeys(warnings)),
        traversal.traversal.segments(),
    )  # fmt: skip


def _poses(study: PathStudy) -> tuple[tuple[str, ...], np.ndarray]:
    """Columns (m,) and poses (K, m)."""
    least = 3 if study.kind == "periodic" else 2
    if len(study.pose) < least:
        raise InputError(f"pose: expected at least {least}, got {len(study.pose)}")
    names = tuple(study.pose[0])
    for k, pose in enumerate(study.pose):
        if {*pose} != {*names}:
            raise InputError(
                f"pose {k + 1}: expected {join(names)} as in the first pose, got {join([*pose])}"
            )
    for key in BOUNDS:
        require_known(getattr(study, key), names, key)
    poses = np.array([[pose[name] for name in names] for pose in study.pose])
    if not np.isfinite(poses).all():
        raise InputError("pose: expected finite numbers")
    return names, poses


def _bounds(study: PathStudy, names: tuple[str, ...], poses: np.ndarray) -> np.ndarray:
    """Bounds of speed, acceleration, jerk, (3, m); infinite where a coordinate does not move."""
    bounds = np.full((len(BOUNDS), len(names)), np.inf)
    moves = np.ptp(poses, axis=0) > 0
    for row, key in zip(bounds, BOUNDS, strict=True):
        own = getattr(study, key)
        if missing := [n for n, m in zip(names, moves, strict=True) if m and n not in own]:
            raise InputError(f"{key}: expected a bound of each column that moves, {join(missing)}")
        row[:] = [own.get(name, np.inf) for name in names]
    return bounds


def _used(
    machine: Mechanism, motion: Motion, asked: PathStudy, solution: Any
) -> dict[str, tuple[float, float]]:
    """Largest share of each limit, and when."""
    shares = bound_shares(motion, asked.speed, asked.acceleration)
    for chain, effort in zip(machine.chains, solution["effort"].values.T, strict=True):
        shares[f"effort of {chain.name}"] = limits(chain).used(effort)
    shares |= speed_shares(machine, solution["joint_rate"].values)
    return _peaks(motion.t, shares)


def _peaks(t: np.ndarray, shares: dict[str, np.ndarray]) -> dict[str, tuple[float, float]]:
    """Largest of each, and when; without those that have no limit."""
    peaks = {}
    for name, share in shares.items():
        if not np.isnan(share).all():
            k = int(np.nanargmax(share))
            peaks[name] = float(share[k]), float(t[k])
    return peaks
