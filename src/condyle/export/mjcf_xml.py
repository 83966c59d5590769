"""Elements of MJCF: numbers as text, frames, bodies that MuJoCo accepts, names that differ."""

from __future__ import annotations

from collections import Counter
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import UnsupportedError

# Elements whose names MuJoCo keeps apart.
SPACES = ("body", "joint", "geom", "site", "mesh", "actuator", "tendon", "sensor", "numeric")
TENDONS, ACTUATORS = ("spatial",), ("motor",)


def element(parent: Element, tag: str, **attributes: Any) -> Element:
    """A child with attributes: numbers with all their digits; None is left out; class_ is class."""
    kept = {k.rstrip("_"): _text(v) for k, v in attributes.items() if v is not None}
    return SubElement(parent, tag, kept)


def child(root: Element, tag: str) -> Element:
    """The section of that name, made where there is none."""
    found = root.find(tag)
    return element(root, tag) if found is None else found


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        return str(value)
    return " ".join(repr(float(v) + 0.0) for v in np.ravel(value))


def quaternion(R: np.ndarray) -> np.ndarray | None:
    """(w, x, y, z) of a rotation matrix; None for the identity, which MJCF takes for granted."""
    if np.array_equal(R, np.eye(3)):
        return None
    x, y, z, w = Rotation.from_matrix(R).as_quat()
    return np.array([w, x, y, z])


def onto(direction: np.ndarray) -> np.ndarray:
    """A rotation whose Z axis is a unit vector, (3, 3)."""
    helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
    x = np.cross(helper, direction)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(direction, x), direction])


def rgba(colour: str, alpha: float = 1.0) -> list[float]:
    """Of "#rrggbb"."""
    return [round(int(colour[i : i + 2], 16) / 255, 4) for i in (1, 3, 5)] + [alpha]


def name_problems(root: Element) -> None:
    """Raises UnsupportedError where two elements of a kind have one name, which MuJoCo refuses."""
    for space in SPACES:
        tags = {"tendon": TENDONS, "actuator": ACTUATORS}.get(space, (space,))
        nodes = list(root.find("sensor") or []) if space == "sensor" else root.iter()
        counted = Counter(n.get("name") for n in nodes if space == "sensor" or n.tag in tags)
        if twice := [name for name, count in counted.items() if name and count > 1]:
            raise UnsupportedError(
                f'two {space} elements would be called "{twice[0]}"; rename a chain, contact or '
                "landmark of the mechanism"
            )


def written(root: Element) -> str:
    """The document as text."""
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"
