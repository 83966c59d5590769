"""The mechanism as the peers see it: read from a TOML dict, in SI, without condyle.

The rules are those of the file contract; what the peers cannot do (other chains, curved surfaces,
other numbers of contacts or chains) is refused with a message.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CHAINS = 6
CONTACTS = 2
UNIT = {"m": 1.0, "mm": 1e-3}


@dataclass(frozen=True)
class Chain:
    """One RSS chain at home, in {S}; `joint` is M in {M}.

    `u`, `w`: crank directions at theta = 0 and 90 degrees; `N`: N_i0, axes as columns, (3, 3);
    `branch`: sign of e . dS/dtheta, kept from home; inertias in kg m^2, lengths in m.
    """

    base: Array
    u: Array
    w: Array
    joint: Array
    N: Array
    crank: float
    coupler: float
    branch: float
    crank_inertia: float
    mass: float
    com: float
    transverse: float
    axial: float


@dataclass(frozen=True)
class Contact:
    """A platform point on a plane n . x = offset, n = (-dz/dx, -dz/dy, 1) not of unit length."""

    point: Array
    normal: Array
    offset: float


@dataclass(frozen=True)
class Mechanism:
    """Six RSS chains and two contacts with planes; `load_point` takes the bite force, in {M}."""

    gravity: Array
    load_point: Array
    mass: float
    inertia: Array
    contacts: tuple[Contact, ...]
    chains: tuple[Chain, ...]

    @property
    def gamma_branch(self) -> float:
        """Sign at home of the derivative of the contacts' difference by gamma: the root to take."""
        left, right = self.contacts
        slope = _gamma_slope(left) - _gamma_slope(right)
        return float(np.sign(slope))

    def packed(self) -> Array:
        """All numbers in one row, in the order in which the compiled peers read them."""
        parts: list[Any] = [self.gravity, self.load_point, self.mass, self.inertia]
        for contact in self.contacts:
            parts += [contact.point, contact.normal, contact.offset]
        parts += [self.gamma_branch]
        for vector in ("base", "u", "w", "joint"):
            parts += [np.array([getattr(c, vector) for c in self.chains]).T]
        parts += [np.array([c.N[:, axis] for c in self.chains]).T for axis in range(3)]
        for scalar in ("crank", "coupler", "branch", "crank_inertia"):
            parts += [[getattr(c, scalar) for c in self.chains]]
        for scalar in ("mass", "com", "transverse", "axial"):
            parts += [[getattr(c, scalar) for c in self.chains]]
        return np.concatenate([np.ravel(np.asarray(part, dtype=float)) for part in parts])


def read(data: dict[str, Any], load_point: str = "right_molar") -> Mechanism:
    """Mechanism from the dict that `tomllib` makes of a mechanism file.

    Raises: ValueError: if it is not of the kind that the peers are written for.
    """
    scale = UNIT[data.get("length_unit", "m")]
    chains, contacts = data.get("chain", []), data.get("contact", [])
    if len(chains) != CHAINS or any(c["kind"] != "RSS" for c in chains):
        raise ValueError(f"the peers are written for {CHAINS} RSS chains, got {len(chains)}")
    if len(contacts) != CONTACTS or any(c["surface"]["kind"] != "plane" for c in contacts):
        raise ValueError(f"the peers are written for {CONTACTS} planes, got {len(contacts)}")
    platform = data["platform"]
    entry = {"xy": 0.0, "xz": 0.0, "yz": 0.0} | platform["inertia"]
    inertia = np.array([[entry["".join(sorted(i + j))] for j in "xyz"] for i in "xyz"])
    return Mechanism(
        gravity=np.array(data.get("gravity", [0, 0, -9.81]), dtype=float),
        load_point=scale * np.array(platform["points"][load_point], dtype=float),
        mass=float(platform["mass"]),
        inertia=inertia,
        contacts=tuple(_contact(c, scale) for c in contacts),
        chains=tuple(_chain(c, scale) for c in chains),
    )


def _contact(data: dict[str, Any], scale: float) -> Contact:
    slope_x, slope_y = data["surface"]["slope"]
    return Contact(
        point=scale * np.array(data["point"], dtype=float),
        normal=np.array([-slope_x, -slope_y, 1.0]),
        offset=scale * data["surface"]["offset"],
    )


def _gamma_slope(contact: Contact) -> float:
    x, y, _ = contact.point
    return float(contact.normal[1] * x - contact.normal[0] * y)


def _chain(data: dict[str, Any], scale: float) -> Chain:
    base, tip, joint = (scale * np.array(data[k], float) for k in ("base", "crank_tip", "platform"))
    arm, rod = tip - base, joint - tip
    crank, coupler = float(np.linalg.norm(arm)), float(np.linalg.norm(rod))
    u = arm / crank
    axis = np.array(data["axis"], dtype=float)
    axis -= (axis @ u) * u
    w = np.cross(axis / np.linalg.norm(axis), u)
    x = rod / coupler
    along = np.eye(3)[1 if abs(x[0]) > np.cos(np.radians(5)) else 0]
    y = np.cross(x, along)
    y /= np.linalg.norm(y)
    rods = data["coupler"]
    return Chain(
        base=base,
        u=u,
        w=w,
        joint=joint,
        N=np.column_stack([x, y, np.cross(x, y)]),
        crank=crank,
        coupler=coupler,
        branch=float(np.sign(w @ (joint - base))),
        crank_inertia=float(data["crank"]["inertia"]),
        mass=float(rods["mass"]),
        com=float(rods["com"]),
        transverse=float(rods["transverse"]),
        axial=float(rods["axial"]),
    )
