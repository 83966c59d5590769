"""Inverse dynamics by Pinocchio: recursive Newton-Euler on the cut-open tree, then projected.

Each chain is cut at its spherical joints. The platform is Translation, Rx, Ry, Rz, so that its
velocity is X_EE'. A crank or slider is a branch of its own; its rod is a branch Translation, Ry, Rz
in the *base* frame N_i0: a universal joint fixed on the crank would be another mechanism.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from .closure import complete_state, contact_normals, distribute
from .description import Chain, Description, Raw, joint, read, rod_angles
from .rotations import platform_motion

__all__ = ["PinocchioEngine", "complete_state", "inverse_dynamics"]

Array = np.ndarray
WORLD = pin.LOCAL_WORLD_ALIGNED
FIXED, ORIGIN = np.eye(3), np.zeros(3)


class PinocchioEngine:
    """The tree of one mechanism; one call, one sample."""

    def __init__(self, description: Raw | Description) -> None:
        self.d = d = read(description)
        self.model = pin.Model()
        self.model.gravity.linear = d.gravity
        self.closed: list[tuple[int, int]] = []  # pairs of frames that must coincide
        at = self._joint(0, pin.JointModelTranslation())
        for kind in (pin.JointModelRX(), pin.JointModelRY(), pin.JointModelRZ()):
            at = self._joint(at, kind)
        self.platform = at
        self._body(at, d.mass, 0.0, d.inertia)
        self.contacts = [self._frame(at, c.point) for c in d.contacts]
        self.drives = [self._chain(chain) for chain in d.chains]  # velocity index of each drive
        self.data = self.model.createData()

    def _joint(self, parent: int, kind: Any, R: Array = FIXED, at: Array = ORIGIN) -> int:
        place = pin.SE3(R, at)
        return self.model.addJoint(parent, kind, place, f"joint {self.model.njoints}")

    def _body(self, at: int, mass: float, along: float, inertia: Array) -> None:
        body = pin.Inertia(float(mass), along * np.eye(3)[0], inertia)
        self.model.appendBodyToJoint(at, body, pin.SE3.Identity())

    def _frame(self, at: int, point: Array) -> int:
        name = f"frame {self.model.nframes}"
        place = pin.SE3(np.eye(3), point)
        return self.model.addFrame(pin.Frame(name, at, 0, place, pin.FrameType.OP_FRAME))

    def _chain(self, chain: Chain) -> int:
        end = np.array([chain.length, 0, 0])
        if chain.kind == "SPS":
            cylinder, piston = chain.rods
            at = self._joint(0, pin.JointModelRY(), chain.N0, chain.S)
            at = self._joint(at, pin.JointModelRZ())
            self._body(at, cylinder.mass, cylinder.com, cylinder.inertia)
            drive = at = self._joint(at, pin.JointModelPX(), at=end)
            self._body(at, piston.mass, -piston.com, piston.inertia)
            tip = self._frame(at, np.zeros(3))
        else:
            if chain.kind == "RSS":
                drive = self._joint(0, pin.JointModelRevoluteUnaligned(chain.axis), at=chain.G)
                about = chain.drive * np.outer(chain.axis, chain.axis)
                self._body(drive, 0.0, 0.0, about)
                S = self._frame(drive, chain.S - chain.G)
            else:
                drive = self._joint(0, pin.JointModelPrismaticUnaligned(chain.axis), at=chain.S)
                self._body(drive, chain.drive, 0.0, np.zeros((3, 3)))
                S = self._frame(drive, np.zeros(3))
            at = self._joint(0, pin.JointModelTranslation(), at=chain.S)
            self.closed.append((S, self._frame(at, np.zeros(3))))
            at = self._joint(at, pin.JointModelRY(), chain.N0)
            at = self._joint(at, pin.JointModelRZ())
            (rod,) = chain.rods
            self._body(at, rod.mass, rod.com, rod.inertia)
            tip = self._frame(at, end)
        self.closed.append((tip, self._frame(self.platform, chain.M)))
        return self.model.joints[drive].idx_v

    def coordinates(self, pose: Array) -> Array:
        """All tree coordinates, with the loops closed to rounding; ValueError if out of reach."""
        motion, parts = platform_motion(pose), [pose]
        for chain in self.d.chains:
            P = motion.point(chain.M)[0]
            travel, S = joint(chain, P)
            angles = rod_angles(chain, P - S)
            if chain.kind == "SPS":
                parts.append(np.array([*angles, travel]))
            else:
                parts.append(np.array([travel, *(S - chain.S), *angles]))
        q = np.concatenate(parts)
        pin.framesForwardKinematics(self.model, self.data, q)
        frames = self.data.oMf
        gaps = [frames[a].translation - frames[b].translation for a, b in self.closed]
        if not np.abs(gaps).max() < 1e-12 * max(1, self.d.size):
            raise ValueError("the pose is out of reach")
        return q

    def inverse_dynamics(
        self,
        pose: Array,
        pose_rate: Array,
        pose_acceleration: Array,
        wrench: Array,
        load_point: str | Array | None = "right_molar",
    ) -> dict[str, Array]:
        """Minimum-norm torques, contact forces and joint motion, SI.

        Args:    wrench: force and moment on the platform at `load_point`, (6,) in {S}.
        Returns: tau; joint, beta_i, gamma_i, each also with `_rate` and `_acceleration`, (n,);
                 contact, (k,): force of the surface on the platform along the unit normal;
                 Q, (6,): generalized force dual to X_EE'; J_theta, (n, 6); C_normal, (k, 6);
                 tree_q, tree_v: all coordinates and rates of the tree.
        """
        model, data = self.model, self.data
        q = self.coordinates(np.asarray(pose, float))
        jacobians = pin.computeJointJacobians(model, data, q)
        assert jacobians.shape == (6, model.nv)

        def rows(frame: int) -> Array:
            return pin.getFrameJacobian(model, data, frame, WORLD)[:3]

        closed = np.vstack([rows(a) - rows(b) for a, b in self.closed])
        K = -np.linalg.solve(closed[:, 6:], closed[:, :6])  # chain rates per X_EE'
        points = np.array([rows(frame)[:, :6] for frame in self.contacts]).reshape(-1, 3, 6)
        v = np.concatenate([pose_rate, K @ pose_rate])
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        pin.updateFramePlacements(model, data)

        def drift(frame: int) -> Array:
            return pin.getFrameClassicalAcceleration(model, data, frame, WORLD).linear.copy()

        bias = np.concatenate([drift(a) - drift(b) for a, b in self.closed])
        a = K @ pose_acceleration - np.linalg.solve(closed[:, 6:], bias)
        a = np.concatenate([pose_acceleration, a])
        forces = pin.rnea(model, data, q, v, a)
        motion = platform_motion(np.asarray(pose, float))
        arm = motion.jacobian(self.d.load_point(load_point))
        turning = np.hstack([np.zeros((3, 3)), motion.axes])
        Q = forces[:6] + K.T @ forces[6:] - arm.T @ wrench[:3] - turning.T @ wrench[3:]
        J = K[[drive - 6 for drive in self.drives]]
        N = np.einsum("ki,kij->kj", contact_normals(self.d, motion), points)
        tau, contact = distribute(Q, J, N, self.d.size)
        result = {"tau": tau, "contact": contact, "Q": Q, "J_theta": J, "C_normal": N}
        return result | {"tree_q": q, "tree_v": v} | self._named(q, v, a)

    def _named(self, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """Joint coordinate, beta_i and gamma_i of each chain with their derivatives."""
        kinds = [chain.kind for chain in self.d.chains]
        ahead = [-2 if kind == "SPS" else 4 for kind in kinds]  # from the drive to beta_i
        swing = [i + step for i, step in zip(self.drives, ahead, strict=True)]
        places = {"joint": self.drives, "beta_i": swing, "gamma_i": [i + 1 for i in swing]}
        sorts = {"": q, "_rate": v, "_acceleration": a}
        return {name + s: x[i] for name, i in places.items() for s, x in sorts.items()}


def inverse_dynamics(
    description: Raw | Description,
    pose: Array,
    pose_rate: Array,
    pose_acceleration: Array,
    wrench: Array,
    load_point: str | Array | None = "right_molar",
) -> dict[str, Array]:
    """One sample; see PinocchioEngine.inverse_dynamics."""
    engine = PinocchioEngine(description)
    return engine.inverse_dynamics(pose, pose_rate, pose_acceleration, wrench, load_point)
