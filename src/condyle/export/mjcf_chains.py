"""Chains as trees of bodies: `connect` closes each loop at its platform joint.

A rod turns on two hinges along Y and Z of N_i0, as in `kinematics.chain`; behind a crank these turn
with the crank, which changes nothing but how the rod spins about its own line. A cable is a tendon.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from ..kinematics.chain import FAMILIES
from ..mechanism.chain import limits
from .mjcf_xml import Document, element, inertial, quaternion, rgba

LIGHT = 1e-6  # mass of a massless body over the platform's
THIN, SLENDER = 1e-2, 0.03  # radius of gyration over a length; drawn radius over the mechanism's
BARREL = 0.6  # length of a leg's cylinder over the leg's at home
UNLIMITED = 1e9  # N: of a cable that has no greatest tension
X, ZERO = np.array([1.0, 0, 0]), np.zeros(3)


def write_chain(d: Document, chain: Any) -> None:
    """Bodies, joints, actuator and sensors of a chain."""
    WRITERS[chain.kind](d, chain)
    low, high, speed = limits(chain)
    cable = chain.kind == "cable"
    if cable:  # a tendon's force would lengthen it
        low, high = max(low, 0.0), min(high, UNLIMITED)
    kind, name = "tendon" if cable else "joint", chain.name
    limited = math.isfinite(low) or math.isfinite(high)
    ends = np.clip([low, high], -UNLIMITED, UNLIMITED) if limited else None
    gear = [-1.0] if cable else None
    d.add("actuator", "motor", name=name, **{kind: name}, gear=gear, ctrlrange=ends)
    for quantity in ("pos", "vel"):
        d.add("sensor", f"{kind}{quantity}", name=f"{name}_{quantity}", **{kind: name})
    if math.isfinite(speed):
        d.add("custom", "numeric", name=f"speed_limit_{name}", data=[speed])
    if chain.actuator.coulomb:
        d.note(
            "Coulomb friction of actuators is MuJoCo's frictionloss, which holds at rest; "
            "condyle's fades below the smoothing speed"
        )


def _rss(d: Document, chain: Any) -> None:
    c = FAMILIES["RSS"].constants(chain)
    crank = element(d.world, "body", name=f"{chain.name}_crank", pos=c["G"])
    _driven(crank, chain, "hinge", c["C"][:, 2])
    # Its shaft stands on the base: neither its mass nor its inertia across ever matter.
    inertial(crank, c["crank"] / c["l"] ** 2, ZERO, [c["crank"]] * 3)
    _line(d, crank, chain, 1.6, ZERO, c["l"] * c["C"][:, 0])
    _rod(d, crank, chain, "coupler", c["l"] * c["C"][:, 0], c["N"], float(c["L"]))
    _fixed(d, c["G"], 0.25 * c["l"] * c["C"][:, 2], 2.0)


def _pss(d: Document, chain: Any) -> None:
    c = FAMILIES["PSS"].constants(chain)
    axis = np.array(chain.axis) / np.linalg.norm(chain.axis)
    length = float(np.linalg.norm(np.subtract(chain.platform, chain.base)))
    slider = element(d.world, "body", name=f"{chain.name}_slider", pos=chain.base)
    _driven(slider, chain, "slide", axis)
    # It only slides, so that any inertia will do.
    moments = [(chain.slider.mass or 1.0) * (THIN * length) ** 2] * 3
    _massive(d, slider, chain.slider.mass, ZERO, moments, length)
    _rod(d, slider, chain, "rod", ZERO, c["N"], length)
    _fixed(d, np.array(chain.base), 0.2 * length * axis, 0.8)


def _sps(d: Document, chain: Any) -> None:
    c = FAMILIES["SPS"].constants(chain)
    home = float(c["home"])
    cylinder = _turning(d.world, f"{chain.name}_cylinder", c["B"], c["N"])
    piston_at = home * X
    _slim(d, cylinder, chain.cylinder, chain.cylinder.com, home)
    _line(d, cylinder, chain, 2.0, ZERO, BARREL * home * X)
    piston = element(cylinder, "body", name=f"{chain.name}_piston", pos=piston_at)
    _driven(piston, chain, "slide", X)
    _slim(d, piston, chain.piston, -chain.piston.com, home)
    _line(d, piston, chain, 1.0, -(1 - BARREL) * piston_at, ZERO)
    _shut(d, chain, f"{chain.name}_piston", (cylinder, ZERO), (piston, ZERO))


def _cable(d: Document, chain: Any) -> None:
    element(d.world, "site", name=f"{chain.name}_base", pos=chain.base)
    look = {"width": 0.4 * SLENDER * d.size, "rgba": rgba(d.look.colours[chain.name])}
    tendon = d.add("tendon", "spatial", name=chain.name, **look, **_losses(chain))
    for end in ("base", "platform"):
        element(tendon, "site", site=f"{chain.name}_{end}")


WRITERS: dict[str, Callable[[Document, Any], None]] = {
    "RSS": _rss,
    "PSS": _pss,
    "SPS": _sps,
    "cable": _cable,
}


def _losses(chain: Any) -> dict[str, float | None]:
    a = chain.actuator
    losses = {"armature": a.reflected_inertia, "damping": a.viscous, "frictionloss": a.coulomb}
    return {key: value or None for key, value in losses.items()}


def _driven(body: Element, chain: Any, kind: str, axis: np.ndarray) -> None:
    element(body, "joint", name=chain.name, type=kind, axis=axis, **_losses(chain))


def _rod(
    d: Document, parent: Element, chain: Any, what: str, at: Any, N: np.ndarray, length: float
) -> None:
    """The part of a chain between its drive and the platform."""
    part = getattr(chain, what)
    body = _turning(parent, f"{chain.name}_{what}", at, N)
    _slim(d, body, part, part.com * length, length)
    _line(d, body, chain, 1.0, ZERO, length * X)
    _shut(d, chain, f"{chain.name}_{what}", (body, ZERO), (body, length * X))


def _turning(parent: Element, name: str, at: np.ndarray, N: np.ndarray) -> Element:
    """A body on two hinges along Y and Z of N_i0; its X axis runs along it."""
    body = element(parent, "body", name=name, pos=at, quat=quaternion(N))
    for which, axis in (("beta", [0, 1, 0]), ("gamma", [0, 0, 1])):
        element(body, "joint", name=f"{name}_{which}", type="hinge", axis=axis)
    return body


def _slim(d: Document, body: Element, part: Any, com: float, length: float) -> None:
    """Mass and moments of a part that is symmetric about X."""
    _massive(d, body, part.mass, com * X, [part.axial, part.transverse, part.transverse], length)


def _massive(
    d: Document, body: Element, mass: float, com: Any, inertia: Any, length: float
) -> None:
    """MuJoCo has no massless bodies: those get a millionth of the platform, and no weight."""
    if not mass:
        mass = LIGHT * d.mechanism.platform.mass
        body.set("gravcomp", "1")
        d.note("bodies without mass weigh nothing and have a millionth of the platform's")
    least = mass * (THIN * length) ** 2
    moments = np.array(inertia, float)
    if (moments <= 0).any():
        moments = np.maximum(moments, min(least, moments[moments > 0].min(initial=least)))
        d.note("moments of inertia that are zero are those of a thin rod")
    inertial(body, mass, com, moments)


def _shut(d: Document, chain: Any, last: str, *joints: tuple[Element, np.ndarray]) -> None:
    """The last body's end is the platform's joint M; balls are drawn at both joints."""
    ends = {"body1": last, "body2": "platform", "anchor": joints[-1][1]}
    d.add("equality", "connect", name=f"{chain.name}_loop", **ends)
    for body, at in joints:
        element(body, "geom", class_="drawn", pos=at, size=[1.5 * SLENDER * d.size])


def _line(d: Document, body: Element, chain: Any, thickness: float, start: Any, end: Any) -> None:
    """A body of a chain, drawn."""
    colour, size = rgba(d.look.colours[chain.name]), [thickness * SLENDER * d.size]
    line = {"fromto": [start, end], "size": size, "rgba": colour}
    element(body, "geom", class_="drawn", type="capsule", **line)


def _fixed(d: Document, middle: np.ndarray, half: np.ndarray, thickness: float) -> None:
    """A shaft or rail of the base, drawn."""
    line = {"fromto": [middle - half, middle + half], "size": [thickness * SLENDER * d.size]}
    element(d.world, "geom", class_="fixed", type="cylinder", **line)
