"""A mechanism's raw TOML dictionary in SI, and the closed-form position of each chain.

Rules from formats.md. {S} is fixed, {M} on the platform and equal to {S} at home.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .rotations import X, Y, bryant, turn, unit
from .surfaces import Surface, read_surface

Array = np.ndarray
Raw = dict[str, Any]
COORDINATES = ("X", "Y", "Z", "alpha", "beta", "gamma")


@dataclass(frozen=True)
class Contact:
    name: str
    point: Array  # ball centre, in {M} [m]
    surface: Surface


@dataclass(frozen=True)
class Rod:
    """A body that turns with N_i0 Ry(beta_i) Rz(gamma_i); its X axis runs from S to M."""

    mass: float
    com: float  # [m] along X, from `origin`
    transverse: float  # [kg m^2]
    axial: float
    origin: str = "S"  # or "M"

    @property
    def inertia(self) -> Array:
        """Central inertia in the rod's axes."""
        return np.diag([self.axial, self.transverse, self.transverse])


@dataclass(frozen=True)
class Chain:
    name: str
    kind: str  # RSS, PSS, SPS or cable
    S: Array  # at home, in {S}; B for SPS and cable
    M: Array  # in {M}
    N0: Array  # (3, 3), columns are the axes of N_i0
    length: float  # of the rod; at home for SPS and cable
    rods: tuple[Rod, ...]
    G: Array = field(default_factory=lambda: np.zeros(3))  # crank pivot (RSS)
    axis: Array = field(
        default_factory=lambda: np.zeros(3)
    )  # shaft (RSS, perpendicular to the crank) or rail (PSS), unit
    drive: float = 0.0  # crank inertia [kg m^2] or slider mass [kg]
    drive_mass: float = 0.0  # of a crank [kg], and
    drive_com: Array = field(default_factory=lambda: np.zeros(3))  # its centre from G at home


@dataclass(frozen=True)
class Description:
    name: str
    gravity: Array
    mass: float
    com: Array  # in {M}
    inertia: Array  # about it, in {M}
    points: dict[str, Array]
    contacts: tuple[Contact, ...]
    chains: tuple[Chain, ...]
    dependent: tuple[str, ...] | None

    @property
    def size(self) -> float:
        """Characteristic length [m]: mean distance of platform joints and contacts from O_M."""
        points = [c.M for c in self.chains] + [c.point for c in self.contacts]
        return float(np.mean(np.linalg.norm(points, axis=1)))

    def load_point(self, where: str | Array | None) -> Array:
        if where is None:
            return np.zeros(3)
        return self.points[where] if isinstance(where, str) else np.asarray(where, float)


def load(path: Path | str) -> Raw:
    return tomllib.loads(Path(path).read_text())


def rod_frame(direction: Array) -> Array:
    """N_i0: X along the rod at home, Y = X x X_S (X x Y_S within 5 degrees of X_S), Z completes."""
    x = unit(direction)
    near = np.linalg.norm(np.cross(x, X)) < np.sin(np.radians(5))
    y = unit(np.cross(x, Y if near else X))
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _rod(table: Raw, scale: float, origin: str = "S") -> Rod:
    return Rod(table["mass"], table["com"] * scale, table["transverse"], table["axial"], origin)


def _chain(table: Raw, unit_length: float) -> Chain:
    kind, M = table["kind"], np.array(table["platform"], float) * unit_length
    base = np.array(table["base"], float) * unit_length
    if kind == "muscle":  # to the engines, which know no limits, a cable
        kind = "cable"
    if kind == "RSS":
        S = np.array(table["crank_tip"], float) * unit_length
        crank = unit(S - base)
        axis = np.array(table["axis"], float)
        axis = unit(axis - crank * (crank @ axis))
        length = float(np.linalg.norm(M - S))
        own: Raw = {"rods": (_rod(table["coupler"], length),), "G": base, "axis": axis}
        own["drive"] = table["crank"]["inertia"]
        own["drive_mass"] = table["crank"].get("mass", 0.0)
        own["drive_com"] = table["crank"].get("com", 0.0) * unit_length * crank
    else:
        S = base
        length = float(np.linalg.norm(M - S))
        if kind == "PSS":
            own = {"rods": (_rod(table["rod"], length),), "drive": table["slider"]["mass"]}
            own["axis"] = unit(np.array(table["axis"], float))
        elif kind == "cable":
            own = {"rods": ()}
        else:
            cylinder = _rod(table["cylinder"], unit_length)
            own = {"rods": (cylinder, _rod(table["piston"], unit_length, "M"))}
    return Chain(table["name"], kind, S, M, rod_frame(M - S), length, **own)


def single_contacts(description: Raw) -> Iterator[Raw]:
    """Tables of contacts; a ball joint as three coordinates that are held, x, y and z."""
    for table in description.get("contact", []):
        if table.get("kind") != "ball":
            yield table
            continue
        for axis in range(3):
            held = {"kind": "held", "axis": axis, "at": table["point"][axis]}
            yield {
                "name": f"{table['name']}_{'xyz'[axis]}",
                "point": table["point"],
                "surface": held,
            }


def read(description: Raw | Description) -> Description:
    """SI numbers of a raw description; one that was read already is returned as it is."""
    if isinstance(description, Description):
        return description
    unit_length = {"m": 1.0, "mm": 1e-3}[description.get("length_unit", "m")]
    platform = description["platform"]
    i = {key: platform["inertia"].get(key, 0.0) for key in ("xx", "yy", "zz", "xy", "xz", "yz")}
    xy, xz, yz = i["xy"], i["xz"], i["yz"]
    inertia = [[i["xx"], xy, xz], [xy, i["yy"], yz], [xz, yz, i["zz"]]]
    points = platform.get("points", {})
    dependent = description.get("dependent")
    return Description(
        name=description["name"],
        gravity=np.array(description.get("gravity", [0, 0, -9.81]), float),
        mass=platform["mass"],
        com=np.array(platform.get("com", (0, 0, 0)), float) * unit_length,
        inertia=np.array(inertia, float),
        points={name: np.array(p, float) * unit_length for name, p in points.items()},
        contacts=tuple(
            Contact(
                name=c["name"],
                point=np.array(c["point"], float) * unit_length,
                surface=read_surface(c, unit_length),
            )
            for c in single_contacts(description)
        ),
        chains=tuple(_chain(c, unit_length) for c in description["chain"]),
        dependent=None if dependent is None else tuple(dependent),
    )


def _root(linear: float, square: float, home: float) -> float:
    """Root of the discriminant linear^2 - square with the sign of `home`; nan if out of reach."""
    discriminant = linear**2 - square
    return float(np.copysign(np.sqrt(discriminant), home)) if discriminant >= 0 else float("nan")


def joint(chain: Chain, P: Array) -> tuple[float, Array]:
    """Joint coordinate and S when the platform joint is at P, on the branch of home.

    RSS: theta in (-pi, pi] [rad], from d.d + l^2 - L^2 = 2 l (d.u cos + d.w sin), d = P - G;
    PSS: travel [m], from (d - x a)^2 = L^2, d = P - S at home; SPS: length minus home length [m];
    cable: home length minus length [m].
    nan if out of reach.
    """
    if chain.kind == "SPS":
        return float(np.linalg.norm(P - chain.S)) - chain.length, chain.S
    if chain.kind == "cable":
        return chain.length - float(np.linalg.norm(P - chain.S)), chain.S
    if chain.kind == "PSS":
        d, d0 = P - chain.S, chain.M - chain.S
        along = d @ chain.axis
        travel = along + _root(along, d @ d - chain.length**2, -(d0 @ chain.axis))
        return float(travel), chain.S + travel * chain.axis
    crank = chain.S - chain.G
    length, u = float(np.linalg.norm(crank)), unit(crank)
    w = np.cross(chain.axis, u)
    d = P - chain.G
    a, b = d @ u, d @ w
    c = (d @ d + length**2 - chain.length**2) / (2 * length)
    # theta = 0 at home, so the sine of theta - atan2(b, a) has there the sign of -b
    side = _root(np.hypot(a, b), c * c, -(chain.M - chain.G) @ w)
    theta = np.arctan2(b, a) + np.arctan2(side, c)
    theta = float(np.pi - (np.pi - theta) % (2 * np.pi))
    return theta, chain.G + length * (u * np.cos(theta) + w * np.sin(theta))


def rod_angles(chain: Chain, rod: Array) -> tuple[float, float]:
    """beta_i, gamma_i of the rod vector M - S: N_i0 Ry(beta_i) Rz(gamma_i) maps X onto it."""
    x, y, z = chain.N0.T @ unit(rod)
    return float(np.arctan2(-z, x)), float(np.arctan2(y, np.hypot(x, z)))


def rod_rotation(chain: Chain, beta: float, gamma: float) -> Array:
    return chain.N0 @ bryant([0.0, beta, gamma])


def swing_axes(chain: Chain, beta: float) -> tuple[Array, Array]:
    """Axes of beta_i' and gamma_i', in {S}."""
    return chain.N0[:, 1], chain.N0 @ turn(Y, beta)[:, 2]
