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
from ..mechanism import Mechanism
from ..mechanism.chain import limits
from .mjcf_xml import child, element, quaternion, rgba

LIGHT = 1e-6  # mass of a massless body over the platform's
THIN, SLENDER = 1e-2, 0.018  # radii of gyration and drawn radii over a length
BARREL = 0.6  # length of a leg's cylinder over the leg's at home
UNLIMITED = 1e9  # N: of a cable that has no greatest tension


class ChainWriter:
    """Writes the chains of a mechanism into a document.

    size: a length of the mechanism [m] that drawn radii go by.
    """

    def __init__(self, root: Element, mechanism: Mechanism, colours: dict[str, str], size: float):
        self.root, self.mechanism, self.colours, self.radius = root, mechanism, colours, 0.03 * size
        self.world = child(root, "worldbody")
        self.notes: list[str] = []

    def write(self, chain: Any) -> None:
        WRITERS[chain.kind](self, chain)
        self._actuator(chain)

    def rss(self, chain: Any) -> None:
        c = FAMILIES["RSS"].constants(chain)
        length = float(c["L"])
        arm = c["l"] * c["C"][:, 0]
        crank = element(self.world, "body", name=f"{chain.name}_crank", pos=c["G"])
        self._drive(crank, chain, "hinge", c["C"][:, 2])
        # Its shaft stands on the base: neither its mass nor its inertia across ever matter.
        _inertial(crank, c["crank"] / c["l"] ** 2, np.zeros(3), [c["crank"]] * 3)
        self.rod(crank, chain, 1.6, np.zeros(3), arm)
        coupler = self._turning(crank, f"{chain.name}_coupler", arm, c["N"])
        self._rod_body(coupler, chain.coupler, length)
        self.rod(coupler, chain, 1.0, np.zeros(3), [length, 0, 0])
        self._shut(chain, f"{chain.name}_coupler", length)
        self._balls(chain, (coupler, np.zeros(3)), (coupler, [length, 0, 0]))
        shaft = 0.25 * c["l"] * c["C"][:, 2]
        self._grey(c["G"] - shaft, c["G"] + shaft, 2.0)

    def pss(self, chain: Any) -> None:
        c = FAMILIES["PSS"].constants(chain)
        axis = np.array(chain.axis) / np.linalg.norm(chain.axis)
        length = float(np.linalg.norm(np.subtract(chain.platform, chain.base)))
        slider = element(self.world, "body", name=f"{chain.name}_slider", pos=chain.base)
        self._drive(slider, chain, "slide", axis)
        # It only slides, so that any inertia will do.
        moments = [(chain.slider.mass or 1.0) * (THIN * length) ** 2] * 3
        self._body(slider, chain.slider.mass, np.zeros(3), moments, length)
        rod = self._turning(slider, f"{chain.name}_rod", np.zeros(3), c["N"])
        self._rod_body(rod, chain.rod, length)
        self.rod(rod, chain, 1.0, np.zeros(3), [length, 0, 0])
        self._shut(chain, f"{chain.name}_rod", length)
        self._balls(chain, (rod, np.zeros(3)), (rod, [length, 0, 0]))
        rail = 0.2 * length * axis
        self._grey(np.subtract(chain.base, rail), np.add(chain.base, rail), 0.8)

    def sps(self, chain: Any) -> None:
        c = FAMILIES["SPS"].constants(chain)
        home = float(c["home"])
        cylinder = self._turning(self.world, f"{chain.name}_cylinder", c["B"], c["N"])
        self._leg_body(cylinder, chain.cylinder, 1.0, home)
        self.rod(cylinder, chain, 2.0, np.zeros(3), [BARREL * home, 0, 0])
        end = np.array([home, 0, 0])
        piston = element(cylinder, "body", name=f"{chain.name}_piston", pos=end)
        self._drive(piston, chain, "slide", np.array([1.0, 0, 0]))
        self._leg_body(piston, chain.piston, -1.0, home)
        self.rod(piston, chain, 1.0, -(1 - BARREL) * end, np.zeros(3))
        self._shut(chain, f"{chain.name}_piston", 0.0)
        self._balls(chain, (cylinder, np.zeros(3)), (piston, np.zeros(3)))

    def cable(self, chain: Any) -> None:
        element(self.world, "site", name=f"{chain.name}_base", pos=chain.base)
        actuator = chain.actuator
        tendon = element(
            child(self.root, "tendon"),
            "spatial",
            name=chain.name,
            width=0.4 * self.radius,
            rgba=rgba(self.colours[chain.name]),
            damping=actuator.viscous or None,
            frictionloss=actuator.coulomb or None,
            armature=actuator.reflected_inertia or None,
        )
        element(tendon, "site", site=f"{chain.name}_base")
        element(tendon, "site", site=f"{chain.name}_platform")

    def rod(self, body: Element, chain: Any, thickness: float, start: Any, end: Any) -> None:
        """Draw a body of a chain."""
        colour = rgba(self.colours[chain.name])
        line, size = np.ravel([start, end]), [thickness * self.radius]
        element(body, "geom", class_="drawn", type="capsule", fromto=line, size=size, rgba=colour)

    def _grey(self, start: Any, end: Any, thickness: float) -> None:
        line, size = np.ravel([start, end]), [thickness * self.radius]
        element(self.world, "geom", class_="fixed", type="cylinder", fromto=line, size=size)

    def _balls(self, chain: Any, *places: tuple[Element, Any]) -> None:
        for body, at in places:
            element(body, "geom", class_="drawn", pos=at, size=[1.5 * self.radius])

    def _drive(self, body: Element, chain: Any, kind: str, axis: np.ndarray) -> None:
        actuator = chain.actuator
        element(
            body,
            "joint",
            name=chain.name,
            type=kind,
            axis=axis,
            armature=actuator.reflected_inertia or None,
            damping=actuator.viscous or None,
            frictionloss=actuator.coulomb or None,
        )

    def _turning(self, parent: Element, name: str, at: np.ndarray, N: np.ndarray) -> Element:
        """A body on two hinges along Y and Z of N_i0; its X axis runs along it."""
        body = element(parent, "body", name=name, pos=at, quat=quaternion(N))
        for which, axis in (("beta", [0, 1, 0]), ("gamma", [0, 0, 1])):
            element(body, "joint", name=f"{name}_{which}", type="hinge", axis=axis)
        return body

    def _rod_body(self, body: Element, rod: Any, length: float) -> None:
        inertia = [rod.axial, rod.transverse, rod.transverse]
        self._body(body, rod.mass, [rod.com * length, 0, 0], inertia, length)

    def _leg_body(self, body: Element, part: Any, sign: float, length: float) -> None:
        inertia = [part.axial, part.transverse, part.transverse]
        self._body(body, part.mass, [sign * part.com, 0, 0], inertia, length)

    def _body(self, body: Element, mass: float, com: Any, inertia: Any, length: float) -> None:
        """MuJoCo has no massless bodies: those get a millionth of the platform, and no weight."""
        if not mass:
            mass = LIGHT * self.mechanism.platform.mass
            body.set("gravcomp", "1")
            self._note("bodies without mass weigh nothing and have a millionth of the platform's")
        least = mass * (THIN * length) ** 2
        moments = np.array(inertia, float)
        if (moments <= 0).any():
            moments = np.maximum(moments, min(least, moments[moments > 0].min(initial=least)))
            self._note("moments of inertia that are zero are those of a thin rod")
        _inertial(body, mass, com, moments)

    def _shut(self, chain: Any, last: str, length: float) -> None:
        """The last body's end is the platform's joint M."""
        element(
            child(self.root, "equality"),
            "connect",
            name=f"{chain.name}_loop",
            body1=last,
            body2="platform",
            anchor=[length, 0, 0],
        )

    def _actuator(self, chain: Any) -> None:
        low, high, speed = limits(chain)
        cable = chain.kind == "cable"
        if cable:  # a tendon's force would lengthen it
            low, high = max(low, 0.0), min(high, UNLIMITED)
        limited = math.isfinite(low) or math.isfinite(high)
        element(
            child(self.root, "actuator"),
            "motor",
            name=chain.name,
            **{"tendon" if cable else "joint": chain.name},
            gear=[-1.0] if cable else None,
            ctrlrange=np.clip([low, high], -UNLIMITED, UNLIMITED) if limited else None,
        )
        kind = "tendon" if cable else "joint"
        for quantity in ("pos", "vel"):
            name = f"{chain.name}_{quantity}"
            element(
                child(self.root, "sensor"), f"{kind}{quantity}", name=name, **{kind: chain.name}
            )
        if math.isfinite(speed):
            name = f"speed_limit_{chain.name}"
            element(child(self.root, "custom"), "numeric", name=name, data=[speed])
        if chain.actuator.coulomb:
            self._note(
                "Coulomb friction of actuators is MuJoCo's frictionloss, which holds at rest; "
                "condyle's fades below the smoothing speed"
            )

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)


WRITERS: dict[str, Callable[[ChainWriter, Any], None]] = {
    "RSS": ChainWriter.rss,
    "PSS": ChainWriter.pss,
    "SPS": ChainWriter.sps,
    "cable": ChainWriter.cable,
}


def _inertial(body: Element, mass: float, com: Any, moments: Any) -> None:
    element(body, "inertial", mass=float(mass), pos=com, diaginertia=moments)
