"""An export in C, and its interface.

Other targets (MEX files, FMUs) build on this: they call `Function`s by their arguments and do not
depend on the source.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

from ..graph.program import OutputShape, Port
from ..kinematics.chain import FAMILIES
from ..mechanism.home import independent_coordinates
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..motion.column_units import BASE
from ..questions.derivative import PREFIX
from .catalogue import Wish

Precision = Literal["double", "float"]


@dataclass(frozen=True)
class CArray:
    """An array of a C function, one dimension, in the order of `labels`.

    name:   in C.
    text:   what it is, in a few words.
    labels: name of each entry, as the mechanism file has it.
    units:  of each entry.
    given:  whether it is an input.
    port:   name of the input or result of the question, if it is one.
    """

    name: str
    text: str
    labels: tuple[str, ...]
    units: tuple[str, ...]
    given: bool
    port: str = ""

    @property
    def size(self) -> int:
        return len(self.labels)

    @property
    def unit(self) -> str:
        """One unit where all are alike, else one for each entry."""
        return self.units[0] if len(set(self.units)) == 1 else ", ".join(self.units)

    def declared(self, real: str) -> str:
        """As a parameter in C."""
        return f"{'const ' if self.given else ''}{real} {self.name}[{self.size}]"


@dataclass(frozen=True)
class Function:
    """One exported question.

    name:       in C.
    question:   in the catalogue (`inverse`, `motion` ..).
    text:       what it computes.
    iterations: maximum number of steps; 0 without iteration.
    operations: floating-point operations, sine and cosine as one.
    statuses:   that it may return besides ok: name -> reason.
    """

    name: str
    question: str
    text: str
    arguments: tuple[CArray, ...]
    iterations: int
    operations: int
    statuses: Mapping[str, str]

    @property
    def inputs(self) -> tuple[CArray, ...]:
        return tuple(a for a in self.arguments if a.given)

    @property
    def outputs(self) -> tuple[CArray, ...]:
        return tuple(a for a in self.arguments if not a.given)


@dataclass(frozen=True)
class Exported:
    """A mechanism in C.

    mechanism, wish: what was exported, and what `closure` starts from.
    prefix:    what every name begins with.
    source:    text of `prefix`.c, C99.
    header:    text of `prefix`.h, C99 and C++.
    names:     names of chains, contacts and points -> their identifiers in C.
    struct:    whether constants stand in a structure that is given to every function, in place of
               inside.
    lanes:     width of the vector types, 0 where there are none.
    symbols:   functions of the C library that the source may call.
    recipe:    how the model is made that these functions are of: keywords of `condyle.derive`.
    """

    mechanism: Mechanism
    wish: Wish
    prefix: str
    source: str
    header: str
    functions: tuple[Function, ...]
    precision: Precision
    names: Mapping[str, str]
    struct: bool
    lanes: int
    symbols: tuple[str, ...]
    recipe: Mapping[str, Any]

    def __getitem__(self, question: str) -> Function:
        return next(f for f in self.functions if f.question == question)

    @property
    def context(self) -> str:
        """The first parameter of every function, where constants are a structure."""
        return f"const {self.prefix}_constants *constants" if self.struct else ""

    def prototype(self, function: Function) -> str:
        """Declaration of a function, without the semicolon."""
        parts = [a.declared(self.precision) for a in function.arguments]
        return f"int {function.name}({', '.join([self.context] * self.struct + parts)})"


# What entries are of: independent coordinates, X_EE, those that `closure` starts from, joints,
# actuators, contacts, axes; the sample.
FREE, WHOLE, GIVEN = "free", "whole", "given"
JOINT, EFFORT, CONTACT, AXES, ONE = "joint", "effort", "contact", "axes", "one"
MOVING = "moving"  # the base's motion
# Name -> what it is, what its entries are of, and their unit: what follows that of a coordinate or
# joint, or all of it.
KNOWN = {
    "q": ("independent coordinates", FREE, ""),
    "q1": ("rates of q", FREE, "/s"),
    "q2": ("accelerations of q", FREE, "/s^2"),
    "acceleration": ("accelerations of q", FREE, "/s^2"),
    "q_d": ("desired independent coordinates", FREE, ""),
    "q1_d": ("desired rates", FREE, "/s"),
    "q2_d": ("desired accelerations", FREE, "/s^2"),
    "kp": ("stiffness: acceleration by deviation", FREE, "=1/s^2"),
    "kd": ("damping: acceleration by deviation of rate", FREE, "=1/s"),
    "s": ("prescribed coordinates", GIVEN, ""),
    "s1": ("rates of s", GIVEN, "/s"),
    "s2": ("accelerations of s", GIVEN, "/s^2"),
    "force": ("force on the platform, axes of {S}", AXES, "N"),
    "moment": ("moment on the platform, axes of {S}", AXES, "N m"),
    "point": ("point of action of the force, in the platform's frame {M}", AXES, "m"),
    "gravity": ("gravity, axes of {S}", AXES, "m/s^2"),
    "base": (
        "acceleration, angular velocity and angular acceleration of the base, axes of {S}",
        MOVING, "",
    ),
    "direction": ("unit vector, in {S}", AXES, "1"),
    "pose": ("the platform's pose X_EE", WHOLE, ""),
    "pose_rate": ("its rates", WHOLE, "/s"),
    "pose_acceleration": ("its accelerations", WHOLE, "/s^2"),
    "start": ("initial guess: the previous pose; first home, zeros", WHOLE, ""),
    "pose_before": ("pose of the previous call; first the present pose", WHOLE, ""),
    "pose_rate_before": ("pose_rate of the previous call; first 0", WHOLE, "/s"),
    "joint": ("joint coordinates, zero at home", JOINT, ""),
    "joint_rate": ("rates of joints", JOINT, "/s"),
    "joint_d": ("desired joint coordinates", JOINT, ""),
    "joint_rate_d": ("desired rates of joints", JOINT, "/s"),
    "joint_read": ("joint coordinates, zero at home, as read by the encoders", JOINT, ""),
    "joint_rate_read": ("rates of joints, filtered", JOINT, "/s"),
    "joint_before": ("joint_read of the previous call; first as joint", JOINT, ""),
    "joint_rate_before": ("joint_rate_read of the previous call; first 0", JOINT, "/s"),
    "resolution": ("resolution of the encoders; 0: exact", JOINT, ""),
    "encoder_std": ("standard deviation of the readings' errors", JOINT, ""),
    "acceleration_std": ("noise of the accelerations, a root of time", FREE, "/s^1.5"),
    "acted": ("efforts that acted since the last call", EFFORT, ""),
    "residual": ("joint minus the joint coordinates of the pose", JOINT, ""),
    "effort": ("efforts of the actuators at their joints", EFFORT, ""),
    "contact_force": (
        "contact forces on the platform, along the unit normals of the surfaces", CONTACT, "N",
    ),
    "bound": ("bound of the relative error of the other results, by rounding", ONE, "=1"),
}  # fmt: skip
LETTERS = {"force": "F", "moment": "M"}  # of axes


class FunctionArguments:
    """Arguments about one mechanism.

    given:    names of what `closure` starts from;  landmark: whose path that is, if it is one.
    """

    def __init__(
        self, mechanism: Mechanism, given: Sequence[str] = (), landmark: str | None = None
    ) -> None:
        families = [FAMILIES[chain.kind] for chain in mechanism.chains]
        chains = [chain.name for chain in mechanism.chains]
        self.independent = independent_coordinates(mechanism)
        self._landmark = landmark
        self._labels: dict[str, Sequence[str]] = {
            FREE: self.independent,
            WHOLE: COORDINATES,
            GIVEN: given if landmark is None else "xyz",
            JOINT: chains,
            EFFORT: chains,
            CONTACT: mechanism.contact_names,
            ONE: ("relative",),
            MOVING: [name.removeprefix("base_") for name in BASE],
        }
        self._units: dict[str, Sequence[str]] = {
            JOINT: [family.joint_unit for family in families],
            EFFORT: [family.effort_unit for family in families],
            MOVING: [unit for unit in ("m/s^2", "rad/s", "rad/s^2") for _ in "xyz"],
        }

    def argument(
        self, name: str, port: Port | OutputShape, given: bool, described: tuple[str, str] | None
    ) -> CArray:
        """What a port or result is in C.

        Args: name: in C;  described: description, and unit where that is not `KNOWN` either.
        """
        if "_by_" in name:
            return self._slopes(name, port.name)
        size = port.size if isinstance(port, Port) else math.prod(port.shape)
        known = name.removeprefix(PREFIX)
        text, of, per = KNOWN.get(known, (name.replace("_", " "), "", "=1"))
        if known != name:
            text = f"{'direction in' if given else 'derivative of'} {text}"
        if described is not None:
            text = described[0]
            per = f"={described[1]}" if described[1] else per
        if not of:
            of = JOINT if port.lanes else FREE if size == len(self.independent) else AXES
        labels = self._labels.get(of, [f"{LETTERS.get(name, '')}{axis}" for axis in "xyz"])
        if not (port.lanes or known in KNOWN or size == len(labels)):
            labels = [str(i + 1) for i in range(size)] if size > 1 else [name]
        if name == "s" and self._landmark is not None:
            text = f'displacement of "{self._landmark}" from home, in {{S}}'
        units = self._units_of(of, per, labels)
        return CArray(name, text, tuple(labels), tuple(units), given, port.name)

    def _units_of(self, of: str, per: str, labels: Sequence[str]) -> list[str]:
        if of in (AXES, CONTACT) or per.startswith("="):
            return [per.removeprefix("=")] * len(labels)
        own = self._units.get(of) or ["m" if n in "XYZxyz" else "rad" for n in labels]
        return [f"{unit}{per}" for unit in own]

    def _slopes(self, name: str, port: str) -> CArray:
        """Derivatives `<of>_by_<in>`: of joints one column, of others one row after another."""
        ends = []
        for part in name.split("_by_"):
            text, of, per = KNOWN[part]
            ends.append((text, self._labels[of], self._units_of(of, per, self._labels[of])))
        (text, rows, units), (by, columns, per_units) = ends
        pairs = list(product(zip(rows, units, strict=True), zip(columns, per_units, strict=True)))
        if KNOWN[name.partition("_by_")[0]][1] in (JOINT, EFFORT):
            pairs.sort(key=lambda pair: columns.index(pair[1][0]))
        labels = tuple(f"{row} by {column}" for (row, _), (column, _) in pairs)
        both = tuple(f"({unit})/({per})" for (_, unit), (_, per) in pairs)
        return CArray(name, f"derivatives of the {text} by the {by}", labels, both, False, port)
