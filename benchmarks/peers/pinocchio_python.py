"""Pinocchio from Python: its compiled RNEA on the cut tree, the closure in NumPy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from .base import PythonPeer
from .closure import Chains, Closure, Platform, cross
from .mechanism import Array, Mechanism, read


class PinocchioPython(PythonPeer):
    """The tree of `native/pinocchio_tree.cpp`."""

    name = "Pinocchio, Python"
    packages = ("pin",)

    def _prepare(self, mechanism: dict[str, Any], workdir: Path) -> None:
        import pinocchio

        numbers = read(mechanism)
        self._rnea = pinocchio.rnea
        self._closure = Closure(numbers)
        self._model = _tree(pinocchio, numbers)
        self._data = self._model.createData()
        self._q = np.zeros(self._model.nq)
        self._v, self._a = np.zeros(self._model.nv), np.zeros(self._model.nv)
        trees = (self._q[19:], self._v[12:], self._a[12:])
        self._couplers = [tree.reshape(6, 5) for tree in trees]
        self._turn = pinocchio.Quaternion

    def torques(self, q: Array, qd: Array, qdd: Array, F: Array) -> Array:
        b = self._closure.place(q, qd, qdd)
        c = self._closure.move(b)
        self._fill(b, c)
        tau = self._rnea(self._model, self._data, self._q, self._v, self._a)
        tau[:6] = (tau[:6].reshape(2, 3) @ b.R.T).ravel()
        couplers = tau[12:].reshape(6, 5)
        return self._closure.project(b, c, tau[:12], couplers[:, :3], couplers[:, 3:], F)

    def _fill(self, b: Platform, c: Chains) -> None:
        q, v, a = self._q, self._v, self._a
        # A free flyer's rates have components in {M}; so its acceleration lacks omega x v.
        w_v = cross(b.omega, b.v)
        apparent = (b.a[0] - w_v[0], b.a[1] - w_v[1], b.a[2] - w_v[2])
        local = np.array((b.v, b.omega, apparent, b.alpha)) @ b.R
        q[:3], q[3:7] = b.p, self._turn(b.R).coeffs()
        v[:6], a[:6] = local[:2].ravel(), local[2:].ravel()
        q[7:19:2], q[8:19:2] = c.cos_theta, c.sin_theta
        v[6:12], a[6:12] = c.theta_d, c.theta_dd
        for k, tree in enumerate(self._couplers):
            tree[:, :3], tree[:, 3:] = c.motion[:, 3 * k : 3 * k + 3], c.turns[k].T


def _tree(pin: Any, m: Mechanism) -> Any:
    model = pin.Model()
    model.gravity.linear = m.gravity
    here = pin.SE3.Identity()
    platform = model.addJoint(0, pin.JointModelFreeFlyer(), here, "platform")
    model.appendBodyToJoint(platform, pin.Inertia(m.mass, np.zeros(3), m.inertia), here)
    for i, c in enumerate(m.chains):
        frame = pin.SE3(np.column_stack([c.u, c.w, np.cross(c.u, c.w)]), c.base)
        crank = model.addJoint(0, pin.JointModelRUBZ(), frame, f"crank{i}")
        inertia = pin.Inertia(0.0, np.zeros(3), c.crank_inertia * np.eye(3))
        model.appendBodyToJoint(crank, inertia, here)
    y, z = np.eye(3)[1:]
    for i, c in enumerate(m.chains):
        end = model.addJoint(0, pin.JointModelTranslation(), here, f"end{i}")
        home = pin.SE3(c.N, np.zeros(3))
        turn = model.addJoint(end, pin.JointModelUniversal(y, z), home, f"coupler{i}")
        lever = np.array([(c.com - 1) * c.coupler, 0.0, 0.0])
        moments = np.diag([c.axial, c.transverse, c.transverse])
        model.appendBodyToJoint(turn, pin.Inertia(c.mass, lever, moments), here)
    return model
