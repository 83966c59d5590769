"""An exported model in MuJoCo's hands: placed at poses, asked for forces, played."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
from oracles.rotations import bryant

Array = np.ndarray


class Player:
    """A model, its data, and its platform."""

    def __init__(self, text: str, platform: str = "platform") -> None:
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        self.platform = self.model.body(platform).id

    def position(self) -> Array:
        """O_M, (3,)."""
        return self.data.xpos[self.platform].copy()

    def equations(self) -> tuple[Array, Array]:
        """Violation of every equation between bodies, and its rows on the rates."""
        m, d = self.model, self.data
        mujoco.mj_fwdPosition(m, d)
        J = np.zeros((d.nefc, m.nv))
        if mujoco.mj_isSparse(m):
            mujoco.mju_sparse2dense(J, d.efc_J, d.efc_J_rownnz, d.efc_J_rowadr, d.efc_J_colind)
        else:
            J[:] = d.efc_J.reshape(J.shape)
        return d.efc_pos[: d.ne].copy(), J[: d.ne]

    def jacobian(self, point: Array) -> Array:
        """Rows of a twist of the platform at a point of {S}, (6, nv)."""
        J = np.zeros((2, 3, self.model.nv))
        mujoco.mj_jac(self.model, self.data, J[0], J[1], point, self.platform)
        return J.reshape(6, -1)

    def place(self, pose: Array) -> Array:
        """Bring the platform to X_EE with all loops shut; returns qpos.

        By Newton's method on the equations and the platform's frame, from where things are.
        """
        R = bryant(pose[3:])
        for _ in range(40):
            gaps, J = self.equations()
            at = self.position()
            turn = R @ self.data.xmat[self.platform].reshape(3, 3).T
            off = np.array(
                [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
            )
            right = np.concatenate([-gaps, pose[:3] - at, off / 2])
            step = np.linalg.lstsq(np.vstack([J, self.jacobian(at)]), right, rcond=1e-12)[0]
            mujoco.mj_integratePos(self.model, self.data.qpos, step, 1.0)
            if np.abs(step).max() < 1e-13:
                break
        self.off = float(np.abs(right).max())
        return self.data.qpos.copy()

    def free(self) -> Array:
        """Rates that break no equation, (nv, freedoms)."""
        J = self.equations()[1]
        if not len(J):
            return np.eye(self.model.nv)
        scale = np.sqrt(self.model.dof_invweight0)  # makes columns alike
        _, sigma, rows = np.linalg.svd(J * scale)
        rank = int((sigma > 1e-8 * sigma[0]).sum())
        basis = scale[:, None] * rows[rank:].T
        return basis / np.linalg.norm(basis, axis=0)

    def needed(self, rate: Array | None = None, acceleration: Array | None = None) -> Array:
        """What mj_inverse wants of the actuators, (nv,); equations are left out."""
        m, d = self.model, self.data
        d.qvel[:] = 0 if rate is None else rate
        d.qacc[:] = 0 if acceleration is None else acceleration
        m.opt.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        mujoco.mj_inverse(m, d)
        m.opt.disableflags = 0
        return d.qfrc_inverse.copy()

    def given(self, efforts: Array) -> Array:
        """What the actuators do at these efforts, (nv,)."""
        m, d = self.model, self.data
        moment = np.zeros((m.nu, m.nv))
        mujoco.mju_sparse2dense(
            moment, d.actuator_moment, d.moment_rownnz, d.moment_rowadr, d.moment_colind
        )
        return moment.T @ efforts

    def play(self, seconds: float, control: Callable[[], None]) -> list[int]:
        """Step with a control; returns how often MuJoCo warned, by kind."""
        end = self.data.time + seconds
        while self.data.time < end:
            control()
            mujoco.mj_step(self.model, self.data)
        return [int(w.number) for w in self.data.warning]
