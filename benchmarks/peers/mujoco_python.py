"""MuJoCo from Python: its compiled Newton-Euler on the cut tree, the closure in NumPy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from .base import PythonPeer
from .closure import Chains, Closure, Platform
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
        self._states = (self._data.qpos, self._data.qvel, self._data.qacc)
        self._couplers = [state[-30:].reshape(6, 5) for state in self._states]
        self._turn = np.zeros(4)
        self._force = np.zeros(self._model.nv)

    def torques(self, q: Array, qd: Array, qdd: Array, F: Array) -> Array:
        closure, mujoco, model, data = self._closure, self._mujoco, self._model, self._data
        b = closure.place(q, qd, qdd)
        c = closure.move(b)
        self._fill(b, c)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 1, self._force)
        force = self._force
        force[3:6] = b.R @ force[3:6]
        couplers = force[12:].reshape(6, 5)
        ends = (closure.N @ couplers[:, :3, None])[:, :, 0]
        return closure.project(b, c, force[:12], ends, couplers[:, 3:], F)

    def _fill(self, b: Platform, c: Chains) -> None:
        self._mujoco.mju_mat2Quat(self._turn, b.R.ravel())
        theta = np.arctan2(c.sin_theta, c.cos_theta)
        turning = np.array((b.omega, b.alpha)) @ b.R
        ends = c.motion.reshape(6, 3, 3) @ self._closure.N  # the slides lie along N_i0
        (q, v, a), (q_c, v_c, a_c) = self._states, self._couplers
        q[:3], q[3:7], q[7:13] = b.p, self._turn, theta
        v[:3], v[3:6], v[6:12] = b.v, turning[0], c.theta_d
        a[:3], a[3:6], a[6:12] = b.a, turning[1], c.theta_dd
        for k, tree in enumerate((q_c, v_c, a_c)):
            tree[:, :3], tree[:, 3:] = ends[:, k], c.turns[k].T
