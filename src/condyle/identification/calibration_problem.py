"""The equations of a calibration: residuals of measured poses, and slopes by all unknowns.

Of every row the machine's own coordinates q are unknown too: readings and the measured target are
both functions of them,

    reading = joint(q; numbers) + zero,     measured = B P(q; numbers) G,

with P the platform's pose, B the place of {S} in the measuring frame and G the target's in {M}.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import InputError, join
from ..markers.rigid import fit
from ..mechanism.coordinates import COORDINATES, bryant_angles, rotations
from ..mechanism.mechanism import Mechanism
from ..model.model import Model, derive
from ..motion.number_table import AXES
from ..motion.table_reader import read_table
from ..questions.number_paths import FileNumbers
from ..questions.structure import walls_of
from .calibration_study import CalibrationStudy, Markers
from .marked_poses import marked_points

LEAST_ROWS = 4
# Residual, slopes by numbers and by q, noise, and slopes by frames and points.
Block = tuple[np.ndarray, np.ndarray, np.ndarray, float, dict[str, np.ndarray]]


@dataclass(frozen=True)
class MeasuredPoses:
    """Poses measured on a machine.

    joint: (N, n);  pose: X .. gamma of the target (N, 6), or None;
    points: name of a point on the platform -> its places, (N, 3); NaN where it was not seen.
    notes: what the reader should know.
    """

    source: str
    joint: np.ndarray
    pose: np.ndarray | None
    points: dict[str, np.ndarray]
    notes: tuple[str, ...] = ()

    def rows(self, chosen: np.ndarray) -> MeasuredPoses:
        pose = None if self.pose is None else self.pose[chosen]
        points = {name: places[chosen] for name, places in self.points.items()}
        return MeasuredPoses(self.source, self.joint[chosen], pose, points, self.notes)

    @property
    def unseen(self) -> int:
        """Coordinates of points that were not seen."""
        return sum(int(np.isnan(places).sum()) for places in self.points.values())


def read_poses(mechanism: Mechanism, path: Any, markers: Markers | None = None) -> MeasuredPoses:
    """A table (CSV, Parquet): joint_<chain>, and X .. gamma of a target, or NAME_x, NAME_y, NAME_z
    of points on the platform, or t, when a recording in `folder` saw markers on it.

    A point of the file's is where the file says; any other is found with the rest.
    """
    table = read_table(path)
    joints = table.require(f"joint_{name}" for name in mechanism.chain_names)
    pose = None
    if any(name in table.columns for name in COORDINATES):
        pose = table.require(COORDINATES)
    names = [n.removesuffix("_x") for n in table.columns if n.endswith("_x")]
    points = {name: table.require(f"{name}_{axis}" for axis in AXES) for name in names}
    notes: tuple[str, ...] = ()
    if markers is not None:
        marked, notes = marked_points(markers, table.require(["t"])[:, 0])
        points |= marked
    if pose is None and not points:
        raise InputError(
            f"{table.source}: expected X .. gamma of a target, or NAME_x, NAME_y, NAME_z of points "
            f"on the platform, beside the joints, or t, with [markers] in the study; got "
            f"{join(table.columns)}"
        )
    if table.rows < LEAST_ROWS:
        raise InputError(f"{table.source}: {table.rows} rows, expected at least {LEAST_ROWS}")
    return MeasuredPoses(table.source, joints, pose, points, notes)


@dataclass(frozen=True)
class Linear:
    """Residuals of all rows about a state, whitened: r + J dx + L dq.

    r: (N, R);  J: (N, R, X), by unknowns, frames and points;  L: (N, R, m).
    """

    r: np.ndarray
    J: np.ndarray
    L: np.ndarray

    def reduced(self) -> tuple[np.ndarray, np.ndarray]:
        """The part of J and r, rows of all samples, that q does not explain."""
        Q, _ = np.linalg.qr(self.L, mode="complete")
        rest = Q[:, :, self.L.shape[2] :].swapaxes(1, 2)
        J, r = rest @ self.J, rest @ self.r[..., None]
        return J.reshape(-1, J.shape[2]), r.ravel()


class CalibrationProblem:
    """Unknowns x: numbers of the file, then the frames' six each, then points of the platform."""

    def __init__(
        self, mechanism: Mechanism, study: CalibrationStudy, measured: MeasuredPoses
    ) -> None:
        self.start: Mechanism = mechanism
        self.study: CalibrationStudy = study
        self.measured: MeasuredPoses = measured
        structure = derive(mechanism, backend="numpy").system.unreduced.structure
        known = FileNumbers(mechanism, structure, walls_of(mechanism, structure))
        each = known.at(list(study.numbers))
        self.owners: list[str] = [entry.path for entry in each for _ in entry.slots]
        self.names: list[str] = [known.names[slot] for entry in each for slot in entry.slots]
        self.units: list[str] = [entry.unit for entry in each for _ in entry.slots]
        frames = study.frames
        self.free: dict[str, bool] = {
            "measuring": frames.measuring == "estimate",
            "target": frames.target == "estimate" and measured.pose is not None,
        }
        self.lost: list[str] = [n for n in measured.points if n not in mechanism.platform.points]
        self.columns: dict[str, slice] = {"numbers": slice(0, len(self.names))}
        at = len(self.names)
        for name in (n for n, free in self.free.items() if free):
            self.columns[name] = slice(at, at + 6)
            at += 6
        for name in self.lost:
            self.columns[f"point {name}"] = slice(at, at + 3)
            at += 3
        self.size = at

    @cached_property
    def nominal(self) -> np.ndarray:
        """Numbers of the file, (U,)."""
        return np.array([float(self.start.get(name)) for name in self.names])

    @cached_property
    def prior(self) -> tuple[np.ndarray, np.ndarray]:
        """As `NumbersStudy.priors`."""
        return self.study.priors(self.nominal, self.owners)

    def machine(self, x: np.ndarray) -> Mechanism:
        """The mechanism with these numbers; axes of cranks stay perpendicular to them."""
        changes: dict[str, Any] = dict(zip(self.names, map(float, x), strict=False))
        for chain in self.start.chains:
            if chain.kind != "RSS":
                continue
            path = f"chain.{chain.name}"
            base, tip, axis = (
                np.array([changes.get(f"{path}.{key}[{i}]", x) for i, x in enumerate(own)])
                for key, own in (
                    ("base", chain.base),
                    ("crank_tip", chain.crank_tip),
                    ("axis", chain.axis),
                )
            )
            if any(name.startswith((f"{path}.base", f"{path}.crank_tip")) for name in changes):
                crank = (tip - base) / np.linalg.norm(tip - base)
                axis = axis - (axis @ crank) * crank
                for i in range(3):
                    changes.pop(f"{path}.axis[{i}]", None)
                changes[f"{path}.axis"] = tuple(map(float, axis / np.linalg.norm(axis)))
        return self.start._set(changes, "home")

    def model(self, x: np.ndarray) -> Model:
        return derive(self.machine(x[: len(self.names)]), backend="numpy")

    # -- frames ------------------------------------------------------------------------------

    def frame(self, name: str, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Place and rotation of the frame."""
        if self.free.get(name):
            six = x[self.columns[name]]
        else:
            given = getattr(self.study.frames, name)
            six = np.zeros(6) if given == "estimate" else np.array(given)
        return six[:3], rotations(six[3:])

    def first_guess(self, pose: np.ndarray) -> np.ndarray:
        """Unknowns with frames from the poses, (N, 6), of the file's machine."""
        x = np.zeros(self.size)
        x[: len(self.names)] = self.prior[0]
        place, R = pose[:, :3], rotations(pose[:, 3:])
        measured = self.measured.pose
        if measured is not None:
            seen = rotations(measured[:, 3:])
            B, G = self.frame("measuring", x)[1], self.frame("target", x)[1]
            for _ in range(50):
                if self.free["measuring"]:
                    B = _mean(seen @ (R @ G).swapaxes(1, 2))
                if self.free["target"]:
                    G = _mean((B @ R).swapaxes(1, 2) @ seen)
            # Linear in the two places: measured = b + B (place + R g).
            rows = np.concatenate([np.broadcast_to(np.eye(3), (len(R), 3, 3)), B @ R], axis=2)
            free = [self.free["measuring"]] * 3 + [self.free["target"]] * 3
            offsets = np.concatenate([self.frame(n, x)[0] for n in ("measuring", "target")])
            right = measured[:, :3] - place @ B.T - rows @ offsets
            if any(free):
                found = np.linalg.lstsq(
                    rows[:, :, free].reshape(-1, sum(free)), right.ravel(), rcond=None
                )[0]
                offsets[free] += found
            for name, turn, own in (("measuring", B, offsets[:3]), ("target", G, offsets[3:])):
                if self.free[name]:
                    x[self.columns[name]] = [*own, *bryant_angles(turn)]
            return x
        return self._guess_by_points(x, place, R)

    def _guess_by_points(self, x: np.ndarray, place: np.ndarray, R: np.ndarray) -> np.ndarray:
        """Frames and unknown points, in turns."""
        spots = {name: np.zeros(3) for name in self.lost}
        spots |= {
            name: np.array(self.start.platform.points[name])
            for name in self.measured.points
            if name not in spots
        }
        b, B = self.frame("measuring", x)
        for _ in range(200):
            own = {name: place + R @ g for name, g in spots.items()}
            if self.free["measuring"]:
                here = np.concatenate([own[name] for name in spots])
                seen = np.concatenate([self.measured.points[name] for name in spots])
                body = fit(here, seen[None])
                b, B = body.position[0], body.rotation[0]
            for name in self.lost:
                back = (self.measured.points[name] - b) @ B - place
                spots[name] = np.nanmean(np.einsum("tji,tj->ti", R, back), axis=0)
            if not self.lost:
                break
        if self.free["measuring"]:
            x[self.columns["measuring"]] = [*b, *bryant_angles(B)]
        for name in self.lost:
            x[self.columns[f"point {name}"]] = spots[name]
        return x

    # -- residuals ---------------------------------------------------------------------------

    def linear(self, model: Model, x: np.ndarray, q: np.ndarray) -> Linear:
        """Residuals about x and q, whitened."""
        noise, U = self.study.noise, len(self.names)
        others = [p for p in self.study.numbers if not p.endswith("actuator.zero")]
        at = model.inverse_kinematics(q)
        slopes = model.derivatives(("pose", "joint"), ("q", *others), q=q, zeros=True)
        N, n = at.joint.shape
        by_numbers = {"pose": np.zeros((N, 6, U)), "joint": np.zeros((N, n, U))}
        for i, (name, path) in enumerate(zip(self.names, self.owners, strict=True)):
            if path not in others:
                by_numbers["joint"][:, self.start.chain_names.index(name.split(".")[1]), i] = 1.0
        for path in others:
            own = [i for i, owner in enumerate(self.owners) if owner == path]
            for of, into in by_numbers.items():
                into[:, :, own] = slopes[of, path].reshape(N, into.shape[1], len(own))
        read = at.joint + model.mechanism.zeros - self.measured.joint
        blocks: list[Block] = [(read, by_numbers["joint"], slopes["joint", "q"], noise.encoder, {})]
        blocks += self._targets(x, at.pose, by_numbers["pose"], slopes["pose", "q"])
        r, J, L = [], [], []
        for value, numbers, by_q, size, more in blocks:
            slope = np.zeros((*value.shape, self.size))
            slope[..., :U] = numbers
            for name, by_frame in more.items():
                if name in self.columns:
                    slope[..., self.columns[name]] = by_frame
            seen = np.isfinite(value)
            r.append(np.where(seen, value, 0.0) / size)
            J.append(np.where(seen[..., None], slope, 0.0) / size)
            L.append(np.where(seen[..., None], by_q, 0.0) / size)
        return Linear(np.concatenate(r, 1), np.concatenate(J, 1), np.concatenate(L, 1))

    def off(
        self, measured: MeasuredPoses, pose: np.ndarray, x: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Distances [m] and angles [rad] of what was measured from poses of the platform, flat."""
        b, B = self.frame("measuring", x)
        R, places, angles = rotations(pose[:, 3:]), [], [np.zeros(0)]
        for name, seen in measured.points.items():
            spot = self._spot(name, x)
            places.append(np.linalg.norm(b + (pose[:, :3] + R @ spot) @ B.T - seen, axis=1))
        if measured.pose is not None:
            g, G = self.frame("target", x)
            here = b + (pose[:, :3] + R @ g) @ B.T
            places.append(np.linalg.norm(here - measured.pose[:, :3], axis=1))
            off = B @ R @ G @ rotations(measured.pose[:, 3:]).swapaxes(1, 2)
            cosine = (np.trace(off, axis1=1, axis2=2) - 1) / 2
            sine = np.linalg.norm(off - off.swapaxes(1, 2), axis=(1, 2)) / np.sqrt(8)
            angles.append(np.arctan2(sine, cosine))
        return np.concatenate(places), np.concatenate(angles)

    def _spot(self, name: str, x: np.ndarray) -> np.ndarray:
        """A point on the platform in {M}, (3,)."""
        if name in self.lost:
            return x[self.columns[f"point {name}"]]
        return np.array(self.start.platform.points[name])

    def _targets(
        self, x: np.ndarray, pose: np.ndarray, by_numbers: np.ndarray, by_q: np.ndarray
    ) -> list[Block]:
        """Residuals of poses and points: slopes by numbers and q, noise, slopes by the rest."""
        noise = self.study.noise
        b, B = self.frame("measuring", x)
        R = rotations(pose[:, 3:])
        turns = _turns(pose[:, 3:])
        blocks: list[Block] = []

        def place(spot: np.ndarray, seen: np.ndarray, name: str, of_spot: np.ndarray) -> None:
            arm = R @ spot
            here = pose[:, :3] + arm
            # Place of the spot by the pose, (N, 3, 6).
            slope = np.concatenate(
                [np.broadcast_to(np.eye(3), R.shape), -_cross(arm) @ turns], axis=2
            )
            more = {
                "measuring": np.concatenate(
                    [
                        np.broadcast_to(np.eye(3), R.shape),
                        -_cross(here @ B.T) @ _turns(_angles(self, "measuring", x)),
                    ],
                    axis=2,
                ),
                name: B @ R @ of_spot,
            }
            blocks.append(
                (
                    b + here @ B.T - seen,
                    B @ slope @ by_numbers,
                    B @ slope @ by_q,
                    noise.position,
                    more,
                )
            )

        for name, seen in self.measured.points.items():
            place(self._spot(name, x), seen, f"point {name}", np.eye(3))
        if self.measured.pose is not None:
            g, G = self.frame("target", x)
            own = np.concatenate([np.eye(3), np.zeros((3, 3))], axis=1)
            place(g, self.measured.pose[:, :3], "target", own)
            seen = rotations(self.measured.pose[:, 3:])
            off = B @ R @ G @ seen.swapaxes(1, 2)
            value = Rotation.from_matrix(off).as_rotvec()
            more = {
                "measuring": _with_zero_places(_turns(_angles(self, "measuring", x)), R),
                "target": _with_zero_places(B @ R @ _turns(_angles(self, "target", x)), R),
            }
            turned = np.concatenate([np.zeros(R.shape), B @ turns], axis=2)
            blocks.append((value, turned @ by_numbers, turned @ by_q, noise.angle, more))
        return blocks


def _with_zero_places(slope: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Slopes by a frame's place, which are zero, and by its angles: (N, 3, 6)."""
    return np.concatenate([np.zeros(like.shape), np.broadcast_to(slope, like.shape)], axis=2)


def _angles(problem: CalibrationProblem, name: str, x: np.ndarray) -> np.ndarray:
    if problem.free.get(name):
        return x[problem.columns[name]][3:]
    given = getattr(problem.study.frames, name)
    return np.zeros(3) if given == "estimate" else np.array(given)[3:]


def _turns(angles: np.ndarray) -> np.ndarray:
    """Angular velocity by rates of the angles, (..., 3, 3), in the frame's parent."""
    (ca, cb, _), (sa, sb, _) = (np.moveaxis(f(angles), -1, 0) for f in (np.cos, np.sin))
    one, zero = np.ones_like(ca), np.zeros_like(ca)
    rows = [[one, zero, sb], [zero, ca, -sa * cb], [zero, sa, ca * cb]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def _cross(v: np.ndarray) -> np.ndarray:
    """[v], (..., 3, 3): [v] w = v x w."""
    x, y, z = np.moveaxis(v, -1, 0)
    o = np.zeros_like(x)
    return np.moveaxis(np.array([[o, -z, y], [z, o, -x], [-y, x, o]]), (0, 1), (-2, -1))


def _mean(R: np.ndarray) -> np.ndarray:
    """The mean of rotations (N, 3, 3)."""
    return np.asarray(Rotation.from_matrix(R).mean().as_matrix())
