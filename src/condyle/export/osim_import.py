"""The muscles of an OpenSim model as a jaw of condyle: points, strengths and lengths.

The platform is the mandible: the body called jaw or mandible, else that which most muscles end on.
All other bodies are taken as fixed where the model's default coordinates have them. Frames: OpenSim
has X forward, Y up and Z to the right; {S} has X forward, Y to the left, Z up, and its origin at
the mandible's mass centre.

A muscle is a line from the fixed bodies to the mandible. What it runs along the mandible beyond its
first point there is a constant length, and comes off its tendon.
"""

from __future__ import annotations

import math
import os
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NoReturn
from xml.etree.ElementTree import Element

import numpy as np

from ..errors import InputError, UnsupportedError, brief, join, printable
from ..files.xml_tree import read_xml
from ..mechanism.files import from_data
from .mjcf_import import ImportResult

AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # of OpenSim to {S}
OLDEST = 40_000  # of the format: frames instead of parent_body
DEEPEST = 1000  # bodies from the jaw to ground
JAW = re.compile("jaw|mandib", re.IGNORECASE)
CHARACTERS = re.compile(r"[^A-Za-z0-9_.\-]+")
TURNS = {
    "BallJoint": "XYZ",
    "FreeJoint": "XYZ",
    "GimbalJoint": "XYZ",
    "PinJoint": "Z",
    "PlanarJoint": "Z",
    "SliderJoint": "",
    "UniversalJoint": "XY",
    "WeldJoint": "",
}
SLIDES = {"FreeJoint": "XYZ", "PlanarJoint": "XY", "SliderJoint": "X"}
AXIS = dict(zip("XYZ", np.eye(3), strict=True))


@dataclass(frozen=True)
class Place:
    """Where a frame is in another one: its axes, (3, 3), and origin, (3,) [m]."""

    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    p: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def __matmul__(self, inner: Place) -> Place:
        return Place(self.R @ inner.R, self.p + self.R @ inner.p)

    def inverse(self) -> Place:
        return Place(self.R.T, -self.R.T @ self.p)


def from_osim(path: str | os.PathLike[str], name: str) -> ImportResult:
    """A mechanism called `name` from the muscles of an OpenSim model (.osim).

    Raises: InputError, UnsupportedError: with what was found instead;  MechanismError: if it
            breaks the rules of the file format.
    """
    with np.errstate(all="ignore"):  # numbers beyond all are refused with those of the file
        return _Model(path).mechanism(name)


def muscle_chain(
    path: str,
    name: str,
    fixed: list[list[float]],
    moving: list[list[float]],
    force: float,
    lengths: dict[str, float],
) -> dict[str, Any]:
    """The table of a muscle, or of a cable where no lengths are known.

    Args:   path: of the file that it is from;  fixed, moving: points along it on fixed bodies and
            on the platform, in {S} at home [m];  force: its greatest [N];  lengths: optimal_length,
            tendon_length, which what runs along the platform is taken off, pennation, max_speed.
    Raises: UnsupportedError: for a cable over points, and a tendon that is too short.
    """
    base, *via = fixed
    table: dict[str, Any] = {"name": CHARACTERS.sub("_", name), "base": base, "platform": moving[0]}
    table |= {"via": via} if via else {}
    if not lengths:
        if via:
            raise UnsupportedError(
                printable(f"{path}: {name} has points on its way and no fibres; expected a muscle")
            )
        return table | {"kind": "cable", "actuator": {"force_limit": [0.0, force]}}
    beyond = sum(math.dist(a, b) for a, b in pairwise(moving))
    tendon = lengths["tendon_length"] - beyond
    if tendon < 0:
        raise UnsupportedError(
            printable(
                f"{path}: {name} runs {beyond:g} m along the platform, more than its tendon is long"
            )
        )
    fibres = {"max_force": force, **lengths, "tendon_length": tendon}
    return table | {"kind": "muscle", "muscle": fibres}


class _Model:
    """An OpenSim model at its default coordinates."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = os.fspath(path)
        root = read_xml(path)
        found = root.find("Model") if root.tag == "OpenSimDocument" else None
        if found is None:
            raise InputError(f"{path}: expected an OpenSimDocument with a Model, got <{root.tag}>")
        version = root.get("Version", "")
        if not version.isdigit() or int(version) < OLDEST:
            raise UnsupportedError(
                f"{path}: is of version {brief(version)} of the format, expected {OLDEST} or "
                "later; open it with OpenSim 4 and save it"
            )
        self.model, self.notes = found, list[str]()
        self.bodies = {_name(body): body for body in found.iterfind("BodySet/objects/Body")}
        joints = found.findall("JointSet/objects/*")
        self.offsets: dict[str, list[Element]] = {}
        for frame in found.iter("PhysicalOffsetFrame"):
            self.offsets.setdefault(_name(frame), []).append(frame)
        self.joints = {self._body_of(joint, "socket_child_frame"): joint for joint in joints}
        self.places = {"ground": Place()}

    def mechanism(self, name: str) -> ImportResult:
        lines = {
            _name(one): one for one in self.model.iter() if one.find("GeometryPath") is not None
        }
        muscles = {
            key: one for key, one in lines.items() if one.find("max_isometric_force") is not None
        }
        if others := sorted(lines.keys() - muscles.keys()):
            self.notes.append(f"lines that are no muscles are left out: {join(others)}")
        if not muscles:
            raise UnsupportedError(
                f"{self.path}: has no muscles (elements with max_isometric_force)"
            )
        routes = {key: self._route(one) for key, one in muscles.items()}
        jaw = self._jaw(routes)
        table = self.bodies[jaw]
        at = self.place_of(jaw)
        centre = at.R @ self._vector(table, "mass_center") + at.p

        def placed(point: np.ndarray) -> list[float]:
            return [float(x) for x in AXES @ (point - centre)]

        chains = [
            made
            for key, one in muscles.items()
            if (made := self._chain(key, one, routes[key], jaw, placed)) is not None
        ]
        if not chains:
            raise UnsupportedError(f"{self.path}: no muscle runs from another body to {jaw}")
        turn = AXES @ at.R
        inertia = turn @ self._tensor(table) @ turn.T
        entries = {
            "xx": (0, 0),
            "yy": (1, 1),
            "zz": (2, 2),
            "xy": (0, 1),
            "xz": (0, 2),
            "yz": (1, 2),
        }
        data: dict[str, Any] = {
            "name": name,
            "vocabulary": "jaw",
            "gravity": [
                float(x) for x in AXES @ self._vector(self.model, "gravity", (0, -9.80665, 0))
            ],
            "platform": {
                "mass": self._number(table, "mass"),
                "inertia": {key: float(inertia[i]) for key, i in entries.items()},
                "points": self._landmarks(jaw, placed),
            },
            "chain": chains,
        }
        self.notes += [
            f"the platform is the body {jaw}; all other bodies are fixed where the model's default "
            "coordinates have them",
            "joints of the model are left out: add [[contact]] tables for the condyles",
        ]
        return ImportResult(
            from_data(data, self.path), tuple(printable(note, lines=False) for note in self.notes)
        )

    def _jaw(self, routes: dict[str, list[tuple[str, np.ndarray]]]) -> str:
        ends = Counter(end for route in routes.values() for end in {route[0][0], route[-1][0]})
        ends.pop("ground", None)
        named = [body for body in ends if JAW.search(body)]
        if len(named) == 1 or not ends:
            return named[0] if named else self._refuse("no muscle ends on a body")
        (best, count), *rest = ends.most_common(2)
        if rest and rest[0][1] == count:
            self._refuse(
                f"{best} and {rest[0][0]} are ends of {count} muscles each, so which is the jaw "
                "is open; call one of them jaw or mandible"
            )
        return best

    def _route(self, muscle: Element) -> list[tuple[str, np.ndarray]]:
        """Body and place in ground, (3,) [m], of each point of a muscle; [] where one moves."""
        path = muscle.find("GeometryPath")
        points = path.findall("PathPointSet/objects/*") if path is not None else []
        if path is not None and path.find("PathWrapSet/objects/*") is not None:
            self.notes.append(f"{_name(muscle)}: wrapping is left out")
        if odd := sorted({one.tag for one in points} - {"PathPoint"}):
            self._refuse(
                f"muscle {_name(muscle)} has a {join(odd)}, which moves in its body; expected "
                "points of kind PathPoint"
            )
        if len(points) < 2:
            self._refuse(f"muscle {_name(muscle)} has {len(points)} points, expected 2 or more")
        route = []
        for point in points:
            body, inside = self._frame(self._text(point, "socket_parent_frame"), None)
            frame = self.place_of(body) @ inside
            route.append((body, frame.R @ self._vector(point, "location") + frame.p))
        return route

    def _chain(
        self, key: str, muscle: Element, route: list[tuple[str, np.ndarray]], jaw: str, placed: Any
    ) -> dict[str, Any] | None:
        if route[0][0] == jaw:
            route = route[::-1]
        moves = [body == jaw for body, _ in route]
        first = moves.index(True) if any(moves) else 0
        if not first or not all(moves[first:]):
            self.notes.append(f"{key} does not run once from a fixed body to {jaw}: left out")
            return None
        if (muscle.findtext("appliesForce") or "true").strip() == "false":
            self.notes.append(f"{key} is switched off (appliesForce): left out")
            return None
        points = [placed(point) for _, point in route]
        lengths: dict[str, float] = {}
        if muscle.find("optimal_fiber_length") is not None:
            lengths = {
                "optimal_length": self._number(muscle, "optimal_fiber_length"),
                "tendon_length": self._number(muscle, "tendon_slack_length"),
                "pennation": self._number(muscle, "pennation_angle_at_optimal", 0.0),
                "max_speed": self._number(muscle, "max_contraction_velocity", 10.0),
            }
        force = self._number(muscle, "max_isometric_force")
        return muscle_chain(self.path, key, points[:first], points[first:], force, lengths)

    def _landmarks(self, jaw: str, placed: Any) -> dict[str, list[float]]:
        found = {}
        for marker in self.model.iterfind("MarkerSet/objects/Marker"):
            body, inside = self._frame(self._text(marker, "socket_parent_frame"), None)
            if body == jaw:
                frame = self.place_of(body) @ inside
                at = frame.R @ self._vector(marker, "location") + frame.p
                found[CHARACTERS.sub("_", _name(marker))] = placed(at)
        return found

    def place_of(self, body: str) -> Place:
        """A body in ground."""
        chain, here = list[tuple[str, Place]](), body
        while here not in self.places:
            if here not in self.joints or len(chain) > len(self.joints) or len(chain) > DEEPEST:
                self._refuse(f"body {here} hangs on no joint that leads to ground")
            joint = self.joints[here]
            parent, inner = self._frame(self._text(joint, "socket_parent_frame"), joint)
            _, own = self._frame(self._text(joint, "socket_child_frame"), joint)
            chain.append((here, inner @ self._moved(joint) @ own.inverse()))
            here = parent
        for name, inside in reversed(chain):
            self.places[name] = self.places[here] @ inside
            here = name
        return self.places[body]

    def _body_of(self, joint: Element, socket: str) -> str:
        return self._frame(self._text(joint, socket), joint)[0]

    def _frame(self, path: str, joint: Element | None) -> tuple[str, Place]:
        """The body on which a frame is, and the frame's place in it."""
        inside = Place()
        for _ in range(20):
            word = path.rpartition("/")[2]
            own = [] if joint is None else joint.findall("frames/PhysicalOffsetFrame")
            offset = next((one for one in own if _name(one) == word), None)
            if offset is None:
                if word == "ground" or word in self.bodies:
                    return word, inside
                near = self.offsets.get(word, [])
                if len(near) != 1:
                    what = "is unknown" if not near else f"is the name of {len(near)} frames"
                    self._refuse(f"the frame {brief(path)} {what}")
                offset = near[0]
            turned = _turns("XYZ", self._vector(offset, "orientation", (0, 0, 0)))
            inside = Place(turned, self._vector(offset, "translation", (0, 0, 0))) @ inside
            path, joint = self._text(offset, "socket_parent"), None
        self._refuse(f"the frame {brief(path)} stands in itself")

    def _moved(self, joint: Element) -> Place:
        """The joint's child in its parent, at default coordinates."""
        values = {
            _name(one): self._number(one, "default_value", 0.0)
            for one in joint.iterfind("coordinates/Coordinate")
        }
        if joint.tag == "CustomJoint":
            R, p = np.eye(3), np.zeros(3)
            for one in joint.iterfind("SpatialTransform/TransformAxis"):
                axis, value = self._vector(one, "axis"), self._value(one, values)
                if _name(one).startswith("rotation"):
                    R = R @ _turn(axis, value)
                else:
                    p = p + value * axis
            return Place(R, p)
        if joint.tag not in TURNS:
            self._refuse(
                f"joint {_name(joint)} is a {joint.tag}; expected a CustomJoint, "
                f"{join(sorted(TURNS))}"
            )
        given = [*values.values()]
        turns, slides = TURNS[joint.tag], SLIDES.get(joint.tag, "")
        given += [0.0] * (len(turns) + len(slides) - len(given))
        p = sum(
            (x * AXIS[k] for x, k in zip(given[len(turns) :], slides, strict=False)), np.zeros(3)
        )
        return Place(_turns(turns, given[: len(turns)]), p)

    def _value(self, axis: Element, values: dict[str, float]) -> float:
        """The value of an axis' function at default coordinates."""
        scale = 1.0
        law = next((one for one in axis if one.tag in LAWS), None)
        while law is not None and law.tag == "MultiplierFunction":
            scale *= self._number(law, "scale", 1.0)
            law = next((one for one in law.iter() if one is not law and one.tag in LAWS), None)
        if law is not None and law.tag == "Constant":
            return scale * self._number(law, "value", 0.0)
        if law is not None and law.tag == "LinearFunction":
            slope, start = self._numbers(law, "coefficients", 2)
            x = values.get((axis.findtext("coordinates") or "").strip(), 0.0)
            return scale * (slope * x + start)
        self._refuse(
            f"{_name(axis)} of a CustomJoint is no Constant or LinearFunction; give that joint its "
            "default place with a WeldJoint"
        )

    def _tensor(self, body: Element) -> np.ndarray:
        xx, yy, zz, xy, xz, yz = self._numbers(body, "inertia", 6)
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def _text(self, of: Element, tag: str) -> str:
        text = (of.findtext(tag) or "").strip()
        return text or self._refuse(f"{of.tag} {_name(of)} has no {tag}")

    def _vector(self, of: Element, tag: str, default: Sequence[float] | None = None) -> np.ndarray:
        if default is not None and of.find(tag) is None:
            return np.array(default, float)
        return np.array(self._numbers(of, tag, 3))

    def _number(self, of: Element, tag: str, default: float | None = None) -> float:
        if default is not None and of.find(tag) is None:
            return default
        return self._numbers(of, tag, 1)[0]

    def _numbers(self, of: Element, tag: str, count: int) -> list[float]:
        words = self._text(of, tag).split()
        try:
            found = [float(word) for word in words]
        except ValueError:
            found = []
        if len(found) != count or not all(map(math.isfinite, found)):
            self._refuse(
                f"{of.tag} {_name(of)}: {tag}: expected {count} finite number{'s' * (count > 1)}, "
                f"got {brief(' '.join(words))}"
            )
        return found

    def _refuse(self, problem: str) -> NoReturn:
        raise UnsupportedError(printable(f"{self.path}: {problem}", lines=False))


LAWS = ("Constant", "LinearFunction", "MultiplierFunction", "SimmSpline", "PolynomialFunction",
        "PiecewiseLinearFunction", "GCVSpline", "Sine")  # fmt: skip


def _name(element: Element) -> str:
    return element.get("name", "")


def _turn(axis: np.ndarray, angle: float) -> np.ndarray:
    size = float(np.linalg.norm(axis))
    x, y, z = axis / size if size else axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K


def _turns(axes: str, angles: Sequence[float] | np.ndarray) -> np.ndarray:
    """Rotations about the axes of the turned frame, one after another."""
    R = np.eye(3)
    for axis, angle in zip(axes, angles, strict=True):
        R = R @ _turn(AXIS[axis], float(angle))
    return R
