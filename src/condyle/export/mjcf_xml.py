"""A document of MJCF: numbers as text, bodies that MuJoCo accepts, and names that differ.

It is written as XML, not by MuJoCo's `MjSpec`, whose own writer keeps six digits of a number.
"""

from __future__ import annotations

from collections import Counter
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Comment, Element, SubElement

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import UnsupportedError
from ..mechanism import Mechanism
from ..mechanism.home import characteristic_length
from .syntax import packaged, xml_comment

# Elements whose names MuJoCo keeps apart by more than their tag.
SPACES = {"spatial": "tendon", "motor": "actuator", "freejoint": "joint"}
SPACES |= {f"{of}{what}": "sensor" for of in ("joint", "tendon") for what in ("pos", "vel")}

IDENTITY = np.eye(3)


class Document:
    """An MJCF document; `notes` say what is approximate or left out."""

    def __init__(self, mechanism: Mechanism) -> None:
        from ..report.scene.parts import Appearance

        self.mechanism: Mechanism = mechanism
        self.notes: list[str] = []
        self.text: str = ""
        self.size: float = characteristic_length(mechanism)
        self.look: Appearance = Appearance(mechanism)
        self.root: ElementTree.Element = ElementTree.fromstring(packaged("mjcf_settings.xml"))
        self.world: ElementTree.Element = self.section("worldbody")
        fixed = [point for chain in mechanism.chains for point in chain.fixed_points]
        cloud = np.vstack([self.look.hull, *fixed])  # what a camera should see
        low, high = cloud.min(axis=0), cloud.max(axis=0)
        extent = 0.75 * float(np.linalg.norm(high - low))
        self.root.set("model", mechanism.name)
        give(self.section("option"), gravity=mechanism.gravity)
        middle = (low + high) / 2
        give(self.section("statistic"), center=middle, extent=extent, meansize=0.1 * self.size)
        give(self.section("default/site"), size=0.02 * self.size)
        give(self.section("worldbody/light"), pos=[0, 0, 4 * self.size])

    def section(self, path: str) -> Element:
        found = self.root.find(path)
        assert found is not None
        return found

    def add(self, section: str, tag: str, **attributes: Any) -> Element:
        """An element at the end of a section."""
        return element(self.section(section), tag, **attributes)

    def note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)

    def finish(self) -> None:
        """Write `text`.

        Raises: UnsupportedError: where two elements of a kind have one name, which MuJoCo refuses.
        """
        named = [node for node in self.root.iter() if node.get("name")]
        counted = Counter((SPACES.get(n.tag, n.tag), n.get("name")) for n in named)
        for (space, name), count in counted.items():
            if count > 1:
                raise UnsupportedError(
                    f'two {space} elements would have the name "{name}"; rename a chain, '
                    "contact or landmark of the mechanism"
                )
        for node in list(self.root):
            if not len(node) and not node.attrib:
                self.root.remove(node)
        lines = [
            f"{self.mechanism.name}, written by condyle. SI; home is qpos0, and controls are "
            "efforts.",
            "Joints, tendons and actuators have the names of the chains; keyframe home is at rest.",
            *(f"Note: {note}." for note in self.notes),
        ]
        self.root.insert(0, Comment("\n".join(["", *map(xml_comment, lines), ""])))
        ElementTree.indent(self.root)
        self.text = ElementTree.tostring(self.root, encoding="unicode") + "\n"


def element(parent: Element, tag: str, **attributes: Any) -> Element:
    """A child with attributes: numbers with all their digits; None is left out; class_ is class."""
    return give(SubElement(parent, tag), **attributes)


def give(node: Element, **attributes: Any) -> Element:
    """An element with more attributes."""
    for key, value in attributes.items():
        if value is not None:
            node.set(key.rstrip("_"), _text(value))
    return node


def inertial(
    body: Element, mass: float, com: Any, moments: Any, axes: np.ndarray = IDENTITY
) -> None:
    """Args: axes: principal axes, in columns."""
    own = {"diaginertia": moments, "quat": quaternion(axes)}
    element(body, "inertial", mass=float(mass), pos=com, **own)


def quaternion(R: np.ndarray) -> np.ndarray | None:
    """(w, x, y, z) of a rotation matrix; None for the identity, which MJCF takes for granted."""
    return None if np.array_equal(R, np.eye(3)) else np.roll(Rotation.from_matrix(R).as_quat(), 1)


def rgba(colour: str) -> list[float]:
    """The numbers of "#rrggbb", opaque."""
    return [round(int(colour[i : i + 2], 16) / 255, 4) for i in (1, 3, 5)] + [1.0]


def _text(value: Any) -> str:
    if isinstance(value, str | int):
        return str(value)
    return " ".join(repr(float(v) + 0.0) for v in np.ravel(value))
