"""The cut-open tree in MuJoCo: mj_inverse, mj_crb, and mj_jacDot for the loops."""

from __future__ import annotations

import mujoco
import numpy as np

from .cut_tree import CutTree
from .description import Chain, Description, Raw, Rod

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


class MujocoEngine(CutTree):
    along_rod = True

    def __init__(self, description: Raw | Description) -> None:
        super().__init__(description)
        d = self.d
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

    def place(self, q: Array) -> Array:
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        sites = self.data.site_xpos
        return np.array([sites[a] - sites[b] for a, b in self.closed])

    def loops(self) -> Array:
        return np.vstack([self._jacobian(a) - self._jacobian(b) for a, b in self.closed])

    def points(self) -> Array:
        sites = [self._site(f"contact {i}") for i in range(len(self.d.contacts))]
        return np.array([self._jacobian(s)[:, :6] for s in sites]).reshape(-1, 3, 6)

    def drift(self, q: Array, v: Array) -> Array:
        self.data.qvel[:] = v
        mujoco.mj_comVel(self.model, self.data)
        rates = [self._jacobian_rate(a) - self._jacobian_rate(b) for a, b in self.closed]
        return np.vstack(rates) @ v

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        self.data.qvel[:], self.data.qacc[:] = v, a
        mujoco.mj_inverse(self.model, self.data)
        return self.data.qfrc_inverse.copy()

    def matrices(self, q: Array, v: Array) -> tuple[Array, Array]:
        model, data = self.model, self.data
        mujoco.mj_crb(model, data)
        M, h = np.zeros((model.nv, model.nv)), np.zeros(model.nv)
        for column, unit in zip(M, np.eye(model.nv), strict=True):
            mujoco.mj_mulM(model, data, column, unit)
        mujoco.mj_rne(model, data, 0, h)
        return M, h
