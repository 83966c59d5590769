"""`plan_path`: a motion from poses, at rest in each of them or as one smooth cycle."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import InputError, few
from ..mechanism import as_mechanism
from ..mechanism.chain import limits
from ..mechanism.mechanism import Mechanism
from ..mechanism.study_file import StudyFile
from ..mechanism.table_schema import schema_of
from ..model.model import derive
from ..motion import Motion
from ..motion.table_writer import TableWriter
from .periodic_path import periodic
from .point_to_point import point_to_point

Positive = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]
RIPPLE = 1e-3  # by which the spline through samples may exceed what they keep
BOUNDS = ("speed", "acceleration", "jerk")


class PathStudy(StudyFile):
    """Poses, and how they are joined."""

    kind: Literal["point_to_point", "periodic"] = Field(
        default="point_to_point", description="at rest in each pose, or one closed smooth cycle"
    )
    pose: tuple[dict[str, float], ...] = Field(
        description="column of a motion file -> value [m, rad], the same columns in each pose"
    )
    speed: dict[str, Positive] = Field(default={}, description="bound by column [m/s, rad/s]")
    acceleration: dict[str, Positive] = Field(
        default={}, description="bound by column [m/s^2, rad/s^2]"
    )
    jerk: dict[str, Positive] = Field(default={}, description="bound by column [m/s^3, rad/s^3]")
    period: Positive | None = Field(default=None, description="of the cycle, if periodic [s]")
    rate: Positive = Field(default=1000.0, description="samples a second of the motion [Hz]")


@dataclass(frozen=True, eq=False)
class PlannedPath:
    """A motion, and what it takes.

    motion: at the study's rate;  at: time of each pose [s];  used: limit -> the largest share of
    it that is used, and when [s]: bounds of the study, and efforts and speeds of the mechanism.
    """

    motion: Motion
    at: tuple[float, ...]
    used: dict[str, tuple[float, float]]
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        wide = max(map(len, self.used), default=1)
        lines = [f"{n:{wide}}  {share:6.1%} at {t:.3f} s" for n, (share, t) in self.used.items()]
        over = [name for name, (share, _) in self.used.items() if share > 1 + RIPPLE]
        lines.append(f"{self.motion.t[-1]:.4g} s; beyond their limits: {', '.join(over) or 'none'}")
        return "\n".join(lines)

    @property
    def data(self) -> dict[str, Any]:
        """The same for programs."""
        used = {name: {"share": share, "t": t} for name, (share, t) in self.used.items()}
        return {"duration": float(self.motion.t[-1]), "at": list(self.at), "limits": used}

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the motion file (.csv or .parquet)."""
        with TableWriter(path) as out:
            out.write(self.motion.columns)


def plan_path(
    mechanism: Mechanism | str | os.PathLike[str],
    study: PathStudy | Mapping[str, Any] | str | os.PathLike[str],
    *,
    backend: str = "auto",
) -> PlannedPath:
    """A motion through poses, and which share of each limit it uses.

    Point to point it is at rest in each pose, on straight lines of the coordinates, as fast as
    bounds of speed, acceleration and jerk allow. Periodic it is the closed quintic spline through
    the poses, evenly spaced in time.

    Args:   study: poses and bounds: see the guide on paths.
    Raises: InputError: where a study does not fit; UnreachableError: between poses.
    """
    machine = as_mechanism(mechanism)
    asked, _ = PathStudy.read(study)
    names, poses = _poses(asked)
    if asked.kind == "periodic":
        if asked.period is None:
            raise InputError("period: expected the time of the cycle [s], got none")
        t, values, at = periodic(poses, asked.period, asked.rate)
    else:
        if asked.period is not None:
            raise InputError('period: is of kind = "periodic"; point to point, bounds set the time')
        t, values, at = point_to_point(poses, _bounds(asked, names, poses), asked.rate)
    motion = Motion.from_arrays(t, values, names, source="path")
    model = derive(machine, backend=backend, distribution="minimum_norm")
    solution = model.solve(motion)
    used = _used(machine, motion, asked, solution)
    said = tuple(dict.fromkeys([*motion.warnings, *solution.condyle.warnings]))
    return PlannedPath(motion, tuple(map(float, at)), used, said)


def _poses(asked: PathStudy) -> tuple[tuple[str, ...], np.ndarray]:
    """Columns (m,) and poses (K, m)."""
    least = 3 if asked.kind == "periodic" else 2
    if len(asked.pose) < least:
        raise InputError(f"pose: expected at least {least}, got {len(asked.pose)}")
    names = tuple(asked.pose[0])
    for k, pose in enumerate(asked.pose):
        if {*pose} != {*names}:
            raise InputError(
                f"pose {k + 1}: expected {few(names)} as in the first pose, got {few([*pose])}"
            )
    for key in BOUNDS:
        if unknown := [name for name in getattr(asked, key) if name not in names]:
            raise InputError(f"{key}: {few(unknown)} not among the poses' {few(names)}")
    poses = np.array([[pose[name] for name in names] for pose in asked.pose])
    if not np.isfinite(poses).all():
        raise InputError("pose: expected finite numbers")
    return names, poses


def _bounds(asked: PathStudy, names: tuple[str, ...], poses: np.ndarray) -> np.ndarray:
    """Of speed, acceleration, jerk, (3, m); infinite where a coordinate does not move."""
    found = np.full((len(BOUNDS), len(names)), np.inf)
    moves = np.ptp(poses, axis=0) > 0
    for row, key in zip(found, BOUNDS, strict=True):
        own = getattr(asked, key)
        if missing := [n for n, m in zip(names, moves, strict=True) if m and n not in own]:
            raise InputError(f"{key}: expected a bound of each column that moves, {few(missing)}")
        row[:] = [own.get(name, np.inf) for name in names]
    return found


def _used(
    machine: Mechanism, motion: Motion, asked: PathStudy, solution: Any
) -> dict[str, tuple[float, float]]:
    """Largest share of each limit, and when."""
    found: dict[str, tuple[float, float]] = {}

    def add(name: str, share: np.ndarray) -> None:
        k = int(np.argmax(share))
        found[name] = float(share[k]), float(motion.t[k])

    for key, values in (("speed", motion.rate), ("acceleration", motion.acceleration)):
        for name, column in zip(motion.names, values.T, strict=True):
            if name in getattr(asked, key):
                add(f"{key} of {name}", np.abs(column) / getattr(asked, key)[name])
    for i, chain in enumerate(machine.chains):
        own = limits(chain)
        effort = solution["effort"].values[:, i]
        size = np.where(effort >= 0, own.high, own.low)
        if np.isfinite(size).all() and (size != 0).all():
            add(f"effort of {chain.name}", effort / size)
        if np.isfinite(own.speed):
            rate = np.abs(solution["joint_rate"].values[:, i])
            add(f"speed of {chain.name}", rate / own.speed)
    return found


def json_schema() -> dict[str, Any]:
    """The JSON schema of path studies, for editors."""
    return {**schema_of(PathStudy), "title": "condyle path"}
