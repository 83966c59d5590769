"""The free bodies of a mechanism, with their motion from positions alone, in plain numpy.

For each body of [Cheng2023] and the other families: mass, mass centre and axes as jets, central
inertia in its own axes. What a body needs is m (a - g) and the rate of its angular momentum.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .jets import Array, Jet, cos, jet, length, power, rotation_x, rotation_y, rotation_z, sin, spin

EYE = np.eye(3)


@dataclass(frozen=True)
class Body:
    """name: "<chain>.<body>" or "platform". inertia: central, in the axes R, (3, 3)."""

    name: str
    mass: float
    centre: Jet
    R: Jet
    inertia: Array

    def needs(self, gravity: Array) -> tuple[Array, Array]:
        """Force, and moment about the mass centre, that the other bodies must provide."""
        omega, omega_rate = spin(self.R)
        I = self.R.x @ self.inertia @ self.R.x.T
        moment = I @ omega_rate + np.cross(omega, I @ omega)
        return self.mass * (self.centre.a - gravity), moment


@dataclass(frozen=True)
class Rod:
    """Where a rod goes: unit vector along it, its axes, and the axis of its guide."""

    start: Jet
    along: Jet
    R: Jet
    guide: Array


def rod(start: Jet, end: Jet, home: Array) -> Rod:
    """A rod from `start` to `end` that turns with N_i0 Ry(beta) Rz(gamma); `home` is its vector."""
    x = home / np.linalg.norm(home)
    near = abs(x[0]) > np.cos(np.radians(5))
    y = np.cross(x, EYE[1] if near else EYE[0])
    y /= np.linalg.norm(y)
    N = np.stack([x, y, np.cross(x, y)], axis=1)
    e = end - start
    u = power(length(e), -1) * e
    n = jet(N.T) @ u  # (cos b cos g, sin g, -sin b cos g)
    cos_g = power(n[0] * n[0] + n[2] * n[2], 0.5)
    inverse = power(cos_g, -1)
    cos_b, sin_b = n[0] * inverse, -(n[2] * inverse)
    R = jet(N) @ rotation_y(cos_b, sin_b) @ rotation_z(cos_g, n[1])
    guide = N @ np.array([cos_b.x, 0, -sin_b.x])
    return Rod(start, u, R, guide)


def platform(raw: dict[str, Any], pose: Jet, unit: float) -> Body:
    angles = [pose[3], pose[4], pose[5]]
    R = rotation_x(cos(angles[0]), sin(angles[0]))
    R = R @ rotation_y(cos(angles[1]), sin(angles[1])) @ rotation_z(cos(angles[2]), sin(angles[2]))
    i = {"xy": 0.0, "xz": 0.0, "yz": 0.0} | raw["platform"]["inertia"]
    rows = [["xx", "xy", "xz"], ["xy", "yy", "yz"], ["xz", "yz", "zz"]]
    inertia = np.array([[i[name] for name in row] for row in rows])
    origin = Jet(pose.x[:3], pose.v[:3], pose.a[:3])
    arm = np.multiply(raw["platform"].get("com", (0.0, 0.0, 0.0)), unit)
    return Body("platform", raw["platform"]["mass"], origin + R @ arm, R, inertia)


def table(data: dict[str, Any]) -> Array:
    """Central inertia of a rod-like body, X along it."""
    return np.diag([data["axial"], data["transverse"], data["transverse"]])


def leg(chain: dict[str, Any], M: Jet, unit: float) -> tuple[Rod, list[Body]]:
    """Cylinder and piston of an SPS chain."""
    B, home = np.multiply(chain["base"], unit), np.multiply(chain["platform"], unit)
    r = rod(jet(B), M, home - B)
    cylinder, piston = chain["cylinder"], chain["piston"]
    centres = r.start + cylinder["com"] * unit * r.along, M - piston["com"] * unit * r.along
    return r, [
        Body(f"{chain['name']}.{name}", data["mass"], centre, r.R, table(data))
        for name, data, centre in zip(
            ("cylinder", "piston"), (cylinder, piston), centres, strict=True
        )
    ]


def drive(chain: dict[str, Any], M: Jet, unit: float) -> tuple[Rod, list[Body]]:
    """Crank and coupler of an RSS chain, or slider and rod of a PSS chain.

    The driven point S follows from |M - S| = L: the unknown is one scalar, found by Newton on
    its jet, whose derivatives are exact after two steps.
    """
    crank = chain["kind"] == "RSS"
    base, M_0 = np.multiply(chain["base"], unit), np.multiply(chain["platform"], unit)
    S_0 = np.multiply(chain["crank_tip"], unit) if crank else base
    axis = np.array(chain["axis"], float)
    arm = S_0 - base
    if crank:
        axis = axis - arm * (axis @ arm) / (arm @ arm)
    axis /= np.linalg.norm(axis)
    across = np.cross(axis, arm)
    size = np.linalg.norm(M_0 - S_0)

    def place(x: Jet) -> tuple[Jet, Jet]:
        """S and dS/dx at the joint coordinate x."""
        if not crank:
            return jet(base) + x * axis, jet(axis)
        return jet(base) + cos(x) * arm + sin(x) * across, cos(x) * across - sin(x) * arm

    x = jet(0.0)
    for _ in range(30):
        S, tangent = place(x)
        e = M - S
        gap = e @ e - float(size**2)
        x = x + gap * power((e @ tangent) * 2.0, -1)
    S, _ = place(x)
    r = rod(S, M, M_0 - S_0)
    kind = "coupler" if crank else "rod"
    data = chain[kind]
    centre = S + data["com"] * size * r.along
    second = Body(f"{chain['name']}.{kind}", data["mass"], centre, r.R, table(data))
    if crank:
        turn = jet(np.eye(3)) + sin(x) * cross_matrix(axis)
        turn = turn + (jet(1.0) - cos(x)) * (cross_matrix(axis) @ cross_matrix(axis))
        own = {"mass": 0.0, "com": 0.0} | chain["crank"]
        com = own["com"] * unit
        about = (own["inertia"] - own["mass"] * com**2) * np.outer(axis, axis)
        place = jet(base) + turn @ (com / np.linalg.norm(arm) * arm)
        first = Body(f"{chain['name']}.crank", own["mass"], place, turn, about)
    else:
        first = Body(f"{chain['name']}.slider", chain["slider"]["mass"], S, jet(EYE), 0 * EYE)
    return r, [first, second]


def cross_matrix(v: Array) -> Array:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def bodies(raw: dict[str, Any], pose: Jet) -> dict[str, Body]:
    """Every body of a mechanism at a moving pose."""
    unit = {"m": 1.0, "mm": 1e-3}[raw.get("length_unit", "m")]
    ground, origin = platform(raw, pose, unit), Jet(pose.x[:3], pose.v[:3], pose.a[:3])
    found = {"platform": ground}
    for chain in raw["chain"]:
        M = origin + ground.R @ np.multiply(chain["platform"], unit)
        make = leg if chain["kind"] == "SPS" else drive
        found |= {body.name: body for body in make(chain, M, unit)[1]}
    return found
