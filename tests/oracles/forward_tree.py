"""Forward dynamics on the cut-open tree: joint-space matrices of an engine, loops as constraints.

    [M  -L^T  -D] [a     ]   [S^T (effort - losses) + load - h]
    [L   0     0] [mu    ] = [- L' v                          ]
    [C   0     0] [lambda]   [- C' X'                         ]

with all coordinates of the tree in a, the loops' closing forces mu and the contacts' lambda; D is
the wrench of the contacts under a pattern of friction's signs. Nothing is eliminated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from .closure import complete_state, contact_normals, contact_rows, independent_coordinates
from .description import COORDINATES, Raw, read
from .mujoco_engine import MujocoEngine
from .pinocchio_engine import WORLD, PinocchioEngine
from .rotations import platform_motion
from .rubbing import losses, touching

Array = np.ndarray


@dataclass(frozen=True)
class Joints:
    """M: (nv, nv); h: (nv,); L: (rows, nv), its drift L' v: (rows,); v: (nv,)."""

    M: Array
    h: Array
    L: Array
    drift: Array
    v: Array


class PinocchioTree(PinocchioEngine):
    """By crba and nonLinearEffects."""

    def joints(self, pose: Array, rate: Array) -> Joints:
        model, data = self.model, self.data
        q = self.coordinates(pose)
        pin.computeJointJacobians(model, data, q)

        def rows(frame: int) -> Array:
            return pin.getFrameJacobian(model, data, frame, WORLD)[:3]

        L = np.vstack([rows(a) - rows(b) for a, b in self.closed])
        v = np.concatenate([rate, -np.linalg.solve(L[:, 6:], L[:, :6] @ rate)])
        M = np.triu(pin.crba(model, data, q))
        M = M + np.triu(M, 1).T
        h = pin.nonLinearEffects(model, data, q, v).copy()
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        pin.updateFramePlacements(model, data)

        def drift(frame: int) -> Array:
            return pin.getFrameClassicalAcceleration(model, data, frame, WORLD).linear.copy()

        return Joints(M, h, L, np.concatenate([drift(a) - drift(b) for a, b in self.closed]), v)


class MujocoTree(MujocoEngine):
    """By mj_crb and mj_rne."""

    def joints(self, pose: Array, rate: Array) -> Joints:
        model, data = self.model, self.data
        data.qpos[:] = self.coordinates(pose)
        for compute in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_crb):
            compute(model, data)
        L = np.vstack([self._jacobian(a) - self._jacobian(b) for a, b in self.closed])
        data.qvel[:] = v = np.concatenate([rate, -np.linalg.solve(L[:, 6:], L[:, :6] @ rate)])
        mujoco.mj_comVel(model, data)
        M, h = np.zeros((model.nv, model.nv)), np.zeros(model.nv)
        for column, unit in zip(M, np.eye(model.nv), strict=True):
            mujoco.mj_mulM(model, data, column, unit)
        mujoco.mj_rne(model, data, 0, h)
        rates = [self._jacobian_rate(a) - self._jacobian_rate(b) for a, b in self.closed]
        return Joints(M, h, L, np.vstack(rates) @ v, v)


@dataclass(frozen=True)
class Found:
    """X_EE'', (6,), and the contact forces, (k,), of a consistent pattern."""

    acceleration: Array
    force: Array


def forward_dynamics(
    engine: PinocchioTree | MujocoTree,
    raw: Raw,
    pose: Array,
    rate: Array,
    effort: Array,
    wrench: Array,
    load_point: str | Array | None,
) -> list[Found]:
    """The motion of every consistent pattern: one, unless the mechanism jams.

    Args: wrench: force and moment on the platform at `load_point`, (6,) in {S}.
    """
    d, j = read(raw), engine.joints(pose, rate)
    motion = platform_motion(pose, rate)
    nv, rows, k = len(j.v), len(j.L), len(d.contacts)
    M, right = j.M.copy(), -j.h
    rotor = losses(raw, np.zeros(len(effort)), np.ones(len(effort)))
    right[engine.drives] += effort - losses(raw, j.v[engine.drives], np.zeros(len(effort)))
    M[engine.drives, engine.drives] += rotor
    right[:6] += motion.jacobian(d.load_point(load_point)).T @ wrench[:3]
    right[3:6] += motion.axes.T @ wrench[3:]
    C = contact_rows(d, motion)
    # C X'' + C' X' = 0 of any motion on the contacts gives C' X'.
    names = independent_coordinates(d)
    free = [COORDINATES.index(name) for name in names]
    bias = -C @ complete_state(d, names, pose[free], rate[free], np.zeros(len(free)))[2]
    touch, _, drag = touching(d, raw, pose, rate)
    N, T = np.zeros((2, nv, k))
    for i, (contact, n) in enumerate(zip(d.contacts, contact_normals(d, motion), strict=True)):
        N[:6, i] = motion.jacobian(contact.point).T @ n
        T[:3, i], T[3:6, i] = drag[i], motion.axes.T @ np.cross(touch[i], drag[i])
    found = []
    for sigma in _patterns(drag):
        A = np.zeros((nv + rows + k, nv + rows + k))
        A[:nv, :nv], A[:nv, nv : nv + rows], A[:nv, nv + rows :] = M, -j.L.T, T * sigma - N
        A[nv : nv + rows, :nv], A[nv + rows :, :6] = j.L, C
        x = _solved(A, np.concatenate([right, -j.drift, -bias]))
        force = x[nv + rows :]
        if (sigma * force >= 0).all():
            found.append(Found(x[:6], force))
    return found


def _patterns(drag: Array) -> Any:
    """Signs of the contact forces, (k,) each; 0 where nothing rubs."""
    rubs = [i for i, u in enumerate(drag) if np.any(u)]
    for number in range(2 ** len(rubs)):
        sigma = np.zeros(len(drag))
        sigma[rubs] = [1.0 if number >> i & 1 else -1.0 for i in range(len(rubs))]
        yield sigma


def _solved(A: Array, b: Array) -> Array:
    """A^-1 b; rows and columns are first made of one size, and one step refines."""
    columns = np.abs(A).max(axis=0)
    A = A / columns
    rows = np.abs(A).max(axis=1)
    A, b = A / rows[:, None], b / rows
    x = np.linalg.solve(A, b)
    return (x + np.linalg.solve(A, b - A @ x)) / columns
