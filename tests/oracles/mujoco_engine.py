"""Inverse dynamics by MuJoCo: mj_inverse on the cut-open tree, projected on the constraints.

The same cut as in pinocchio_engine.py, but rod positions are measured along N_i0, and the loops
are closed by point Jacobians and mj_jacDot.
"""

from __future__ import annotations

import mujoco
import numpy as np

from .closure import contact_normals, distribute
from .description import Chain, Description, Raw, Rod, joint, read, rod_angles
from .rotations import platform_motion

Array = np.ndarray
TINY = 1e-14  # MuJoCo refuses massless bodies


def _text(values: Array | list[float]) -> str:
    return " ".join(repr(float(v)) for v in np.ravel(values))


def _quaternion(R: Array) -> str:
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(R).ravel())
    return _text(quaternion)


def _inertial(mass: float, com: Array | list[float], inertia: Array) -> str:
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    mass, moments = max(mass, TINY), np.maximum(moments, TINY)
    return (
        f'<inertial mass="{mass!r}" pos="{_text(com)}" quat="{_quaternion(axes)}"'
        f' diaginertia="{_text(moments)}"/>'
    )


def _joints(kind: str, axes: Array) -> str:
    return "".join(f'<joint type="{kind}" axis="{_text(axis)}"/>' for axis in axes)


def _rod(rod: Rod, sign: float = 1.0) -> str:
    return _inertial(rod.mass, [sign * rod.com, 0, 0], rod.inertia)


def _chain(i: int, chain: Chain) -> str:
    end, turned = _text([chain.length, 0, 0]), f'quat="{_quaternion(chain.N0)}"'
    swing = _joints("hinge", np.eye(3)[1:])
    if chain.kind == "SPS":
        cylinder, piston = chain.rods
        return f"""<body pos="{_text(chain.S)}" {turned}>{swing}{_rod(cylinder)}
          <body pos="{end}">{_joints("slide", np.eye(3)[:1])}{_rod(piston, -1)}
            <site name="tip {i}"/></body></body>"""
    if chain.kind == "RSS":  # any mass on the shaft and any inertia across it do nothing
        where, arm, sort = chain.G, chain.S - chain.G, "hinge"
        body = _inertial(1.0, [0, 0, 0], chain.drive * np.eye(3))
    else:
        where, arm, sort = chain.S, np.zeros(3), "slide"
        body = _inertial(chain.drive, [0, 0, 0], np.eye(3))
    drive = _joints(sort, chain.axis[None]) + body
    return f"""<body pos="{_text(where)}">{drive}<site name="S {i}" pos="{_text(arm)}"/></body>
      <body pos="{_text(chain.S)}" {turned}>
        {_joints("slide", np.eye(3))}{swing}{_rod(chain.rods[0])}
        <site name="rod {i}"/><site name="tip {i}" pos="{end}"/></body>"""


def mjcf(d: Description) -> str:
    """The cut-open tree as MJCF."""
    sites = [(f"M {i}", c.M) for i, c in enumerate(d.chains)]
    sites += [(f"contact {i}", c.point) for i, c in enumerate(d.contacts)]
    points = "".join(f'<site name="{name}" pos="{_text(p)}"/>' for name, p in sites)
    return f"""<mujoco>
      <compiler angle="radian" inertiafromgeom="false"/>
      <option gravity="{_text(d.gravity)}"><flag constraint="disable"/></option>
      <worldbody>
        <body name="platform">{_joints("slide", np.eye(3))}{_joints("hinge", np.eye(3))}
          {_inertial(d.mass, [0, 0, 0], d.inertia)}{points}</body>
        {"".join(_chain(i, c) for i, c in enumerate(d.chains))}
      </worldbody></mujoco>"""


class MujocoEngine:
    """The tree of one mechanism; one call, one sample."""

    def __init__(self, description: Raw | Description) -> None:
        self.d = d = read(description)
        self.model = mujoco.MjModel.from_xml_string(mjcf(d))
        self.data = mujoco.MjData(self.model)
        self.drives, at = [], 6
        for chain in d.chains:
            self.drives.append(at + 2 if chain.kind == "SPS" else at)
            at += 3 if chain.kind == "SPS" else 6
        tips = [(f"tip {i}", f"M {i}") for i in range(len(d.chains))]
        cuts = [(f"S {i}", f"rod {i}") for i, c in enumerate(d.chains) if c.kind != "SPS"]
        self.closed = [(self._site(a), self._site(b)) for a, b in tips + cuts]

    def _site(self, name: str) -> int:
        return mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SITE, name)

    def _jacobian(self, site: int) -> Array:
        J = np.zeros((3, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, J, None, site)
        return J

    def _jacobian_rate(self, site: int) -> Array:
        J = np.zeros((3, self.model.nv))
        body, point = self.model.site_bodyid[site], self.data.site_xpos[site]
        mujoco.mj_jacDot(self.model, self.data, J, None, point, body)
        return J

    def coordinates(self, pose: Array) -> Array:
        motion = platform_motion(pose)
        parts: list[Array | list[float]] = [pose]
        for chain in self.d.chains:
            P = motion.point(chain.M)[0]
            travel, S = joint(chain, P)
            angles = rod_angles(chain, P - S)
            if chain.kind == "SPS":
                parts.append([*angles, travel])
            else:
                parts.append([travel, *(chain.N0.T @ (S - chain.S)), *angles])
        return np.concatenate(parts)

    def inverse_dynamics(
        self,
        pose: Array,
        pose_rate: Array,
        pose_acceleration: Array,
        wrench: Array,
        load_point: str | Array | None = "right_molar",
    ) -> dict[str, Array]:
        """As PinocchioEngine.inverse_dynamics, without the angles of the rods."""
        model, data = self.model, self.data
        data.qpos[:] = self.coordinates(np.asarray(pose, float))
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        gaps = [data.site_xpos[a] - data.site_xpos[b] for a, b in self.closed]
        if not np.abs(gaps).max() < 1e-12 * max(1, self.d.size):
            raise ValueError("the pose is out of reach")
        closed = np.vstack([self._jacobian(a) - self._jacobian(b) for a, b in self.closed])
        K = -np.linalg.solve(closed[:, 6:], closed[:, :6])
        data.qvel[:] = v = np.concatenate([pose_rate, K @ pose_rate])
        mujoco.mj_comVel(model, data)
        rates = [self._jacobian_rate(a) - self._jacobian_rate(b) for a, b in self.closed]
        chains = K @ pose_acceleration - np.linalg.solve(closed[:, 6:], np.vstack(rates) @ v)
        data.qacc[:] = a = np.concatenate([pose_acceleration, chains])
        mujoco.mj_inverse(model, data)
        forces = data.qfrc_inverse
        linear, turning = np.zeros((2, 3, model.nv))
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "platform")
        point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ self.d.load_point(load_point)
        mujoco.mj_jac(model, data, linear, turning, point, body)
        load = linear.T @ wrench[:3] + turning.T @ wrench[3:]
        Q = forces[:6] + K.T @ forces[6:] - load[:6]
        J = K[[drive - 6 for drive in self.drives]]
        sites = [self._site(f"contact {i}") for i in range(len(self.d.contacts))]
        normals = contact_normals(self.d, platform_motion(np.asarray(pose, float)))
        N = np.array([n @ self._jacobian(s)[:, :6] for n, s in zip(normals, sites, strict=True)])
        N = N.reshape(-1, 6)
        tau, contact = distribute(Q, J, N, self.d.size)
        motion = {"joint": data.qpos, "joint_rate": v, "joint_acceleration": a}
        named = {name: x[self.drives].copy() for name, x in motion.items()}
        return {"tau": tau, "contact": contact, "Q": Q, "J_theta": J, "C_normal": N} | named


def inverse_dynamics(
    description: Raw | Description,
    pose: Array,
    pose_rate: Array,
    pose_acceleration: Array,
    wrench: Array,
    load_point: str | Array | None = "right_molar",
) -> dict[str, Array]:
    """One sample; see MujocoEngine.inverse_dynamics."""
    engine = MujocoEngine(description)
    return engine.inverse_dynamics(pose, pose_rate, pose_acceleration, wrench, load_point)
