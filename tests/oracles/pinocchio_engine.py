"""The cut-open tree in Pinocchio: recursive Newton-Euler, composite rigid bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from .cut_tree import CutTree
from .description import Chain, Description, Raw

pin = pytest.importorskip("pinocchio", minversion="3", reason="needs pin, of the `test` extra")

Array = np.ndarray
WORLD = pin.LOCAL_WORLD_ALIGNED
FIXED, ORIGIN = np.eye(3), np.zeros(3)


class PinocchioEngine(CutTree):
    def __init__(self, description: Raw | Description, free: bool = False) -> None:
        """Args: free: with a free base, whose velocities come first."""
        super().__init__(description)
        d = self.d
        self.model = pin.Model()
        self.model.gravity.linear = d.gravity
        self.closed: list[tuple[int, int]] = []  # pairs of frames that must coincide
        self.root = 0
        if free:
            self.root = self._joint(0, pin.JointModelFreeFlyer())
        at = self._joint(self.root, pin.JointModelTranslation())
        for kind in (pin.JointModelRX(), pin.JointModelRY(), pin.JointModelRZ()):
            at = self._joint(at, kind)
        self.platform = at
        self._body(at, d.mass, d.com, d.inertia)
        self.contacts = [self._frame(at, c.point) for c in d.contacts]
        self.drives = [self._chain(chain) for chain in d.chains]  # velocity index of each drive
        self.data = self.model.createData()

    def _joint(self, parent: int, kind: Any, R: Array = FIXED, at: Array = ORIGIN) -> int:
        place = pin.SE3(R, at)
        return self.model.addJoint(parent, kind, place, f"joint {self.model.njoints}")

    def _body(self, at: int, mass: float, centre: float | Array, inertia: Array) -> None:
        """Args: centre: its place, or how far along X it is."""
        place = centre if isinstance(centre, np.ndarray) else centre * np.eye(3)[0]
        body = pin.Inertia(float(mass), place, inertia)
        self.model.appendBodyToJoint(at, body, pin.SE3.Identity())

    def _frame(self, at: int, point: Array) -> int:
        name = f"frame {self.model.nframes}"
        place = pin.SE3(np.eye(3), point)
        return self.model.addFrame(pin.Frame(name, at, 0, place, pin.FrameType.OP_FRAME))

    def _chain(self, chain: Chain) -> int:
        end = np.array([chain.length, 0, 0])
        if chain.kind == "SPS":
            cylinder, piston = chain.rods
            at = self._joint(self.root, pin.JointModelRY(), chain.N0, chain.S)
            at = self._joint(at, pin.JointModelRZ())
            self._body(at, cylinder.mass, cylinder.com, cylinder.inertia)
            drive = at = self._joint(at, pin.JointModelPX(), at=end)
            self._body(at, piston.mass, -piston.com, piston.inertia)
            tip = self._frame(at, np.zeros(3))
        else:
            if chain.kind == "RSS":
                drive = self._joint(
                    self.root, pin.JointModelRevoluteUnaligned(chain.axis), at=chain.G
                )
                about = chain.drive * np.outer(chain.axis, chain.axis)
                m, com = chain.drive_mass, chain.drive_com
                about -= m * (com @ com) * np.outer(chain.axis, chain.axis)
                self._body(drive, m, com, about)
                S = self._frame(drive, chain.S - chain.G)
            else:
                drive = self._joint(
                    self.root, pin.JointModelPrismaticUnaligned(chain.axis), at=chain.S
                )
                self._body(drive, chain.drive, 0.0, np.zeros((3, 3)))
                S = self._frame(drive, np.zeros(3))
            at = self._joint(self.root, pin.JointModelTranslation(), at=chain.S)
            self.closed.append((S, self._frame(at, np.zeros(3))))
            at = self._joint(at, pin.JointModelRY(), chain.N0)
            at = self._joint(at, pin.JointModelRZ())
            (rod,) = chain.rods
            self._body(at, rod.mass, rod.com, rod.inertia)
            tip = self._frame(at, end)
        self.closed.append((tip, self._frame(self.platform, chain.M)))
        return self.model.joints[drive].idx_v

    def place(self, q: Array) -> Array:
        pin.computeJointJacobians(self.model, self.data, q)
        pin.framesForwardKinematics(self.model, self.data, q)
        frames = self.data.oMf
        return np.array([frames[a].translation - frames[b].translation for a, b in self.closed])

    def _rows(self, frame: int) -> Array:
        return pin.getFrameJacobian(self.model, self.data, frame, WORLD)[:3]

    def loops(self) -> Array:
        return np.vstack([self._rows(a) - self._rows(b) for a, b in self.closed])

    def points(self) -> Array:
        return np.array([self._rows(f)[:, :6] for f in self.contacts]).reshape(-1, 3, 6)

    def drift(self, q: Array, v: Array) -> Array:
        pin.forwardKinematics(self.model, self.data, q, v, np.zeros(self.model.nv))
        pin.updateFramePlacements(self.model, self.data)

        def of(frame: int) -> Array:
            found = pin.getFrameClassicalAcceleration(self.model, self.data, frame, WORLD)
            return found.linear.copy()

        return np.concatenate([of(a) - of(b) for a, b in self.closed])

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        return pin.rnea(self.model, self.data, q, v, a)

    def matrices(self, q: Array, v: Array) -> tuple[Array, Array]:
        M = np.triu(pin.crba(self.model, self.data, q))
        h = pin.nonLinearEffects(self.model, self.data, q, v).copy()
        return M + np.triu(M, 1).T, h


class OnMovingBase(PinocchioEngine):
    """On a base that passes the resting frame, with its acceleration, angular velocity and
    acceleration, (9,)."""

    def __init__(self, description: Raw | Description, base: Array, gravity: Array) -> None:
        super().__init__(description)
        self.base = base
        self.whole = PinocchioEngine(description, free=True)
        self.whole.model.gravity.linear = gravity

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        still, rest = np.array([0.0, 0, 0, 0, 0, 0, 1]), np.zeros(3)
        acceleration, w, w_rate = self.base.reshape(3, 3)
        model, data = self.whole.model, self.whole.data
        return pin.rnea(
            model,
            data,
            np.append(still, q),
            np.concatenate([rest, w, v]),
            np.concatenate([acceleration, w_rate, a]),
        )[6:]
