"""MuJoCo from Python: its compiled Newton-Euler on the cut tree, the closure in NumPy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from .base import PythonPeer
from .closure import Closure
from .mechanism import Array, read
from .mjcf import mjcf


class MujocoPython(PythonPeer):
    """The tree of `native/mujoco_tree.cpp`."""

    name = "MuJoCo, Python"
    packages = ("mujoco",)

    def _prepare(self, mechanism: dict[str, Any], workdir: Path) -> None:
        import mujoco

        numbers = read(mechanism)
        self._mujoco = mujoco
        self._closure = Closure(numbers)
        self._model = mujoco.MjModel.from_xml_string(mjcf(numbers, "tree"))
        self._data = mujoco.MjData(self._model)
        self._turn = np.zeros(4)
        self._force = np.zeros(self._model.nv)

    def torques(self, q: Array, qd: Array, qdd: Array, F: Array) -> Array:
        closure, mujoco, model, data = self._closure, self._mujoco, self._model, self._data
        b = closure.place(q, qd, qdd)
        c = closure.move(b)
        mujoco.mju_mat2Quat(self._turn, b.R.ravel())
        theta = np.arctan2(c.sin_theta, c.cos_theta)
        # The slides lie along the axes of N_i0.
        ends = np.stack([c.P, c.P_d, c.P_dd], axis=1) @ closure.N
        for tree, platform, shafts, end, turns in (
            (data.qpos, (b.p, self._turn), theta, ends[:, 0], c.angles),
            (data.qvel, (b.v, b.omega @ b.R), c.theta_d, ends[:, 1], c.angles_d),
            (data.qacc, (b.a, b.alpha @ b.R), c.theta_dd, ends[:, 2], c.angles_dd),
        ):
            tree[:] = np.concatenate([*platform, shafts, np.hstack([end, turns]).ravel()])
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 1, self._force)
        force = self._force
        wrench = np.concatenate([force[:3], b.R @ force[3:6]])
        couplers = force[12:].reshape(6, 5)
        at_joints = (closure.N @ couplers[:, :3, None])[:, :, 0]
        return closure.project(b, c, wrench, at_joints, couplers[:, 3:], force[6:12], F)
