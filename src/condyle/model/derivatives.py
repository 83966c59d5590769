"""Derivatives of efforts, accelerations, poses and their like by states, loads and numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError, as_flag, did_you_mean, shown
from ..graph.transform import LANE_NUMBERS, NUMBERS
from ..kinematics.constraints import indices
from ..questions.derivative import GRADIENT, OF_NUMBERS, PREFIX, WEIGHT
from ..status import Status
from .arguments import Argument, Arguments, Lead
from .forward_dynamics import ForwardDynamics
from .forward_kinematics import ForwardKinematics
from .implicit import Held, accelerated, balanced, placed, read_back, samples_first
from .inverse_dynamics import InverseDynamics
from .model_result import ModelResult
from .poses import Poses
from .system import System

Array = np.ndarray
Arrays = dict[str, Array]
# What results may be differentiated by, as ports of their question.
PORTS = {
    "q": ("q",),
    "v": ("q1",),
    "a": ("q2",),
    "wrench": ("force", "moment"),
    "at": ("point",),
    "effort": ("effort",),
    "joint": ("reading",),
}
OF_LANES = ("along", "joint", "transmission", "J_W", "effort", "reading")  # rows and ports
UNITS = {"q": "m, rad", "v": "m/s, rad/s", "a": "m/s^2, rad/s^2", "wrench": "N, N m", "at": "m"}
UNITS |= {"effort": "N m or N", "joint": "rad or m", "acceleration": "m/s^2, rad/s^2"}
UNITS |= {"contact_force": "N", "pose": "m, rad", "contact_point": "m", "singularity_ratio": "1"}


@dataclass(frozen=True)
class Kind:
    """Results that one solution has: their names, and the states and loads that they follow from.

    needs: arguments without which there is no solution.
    """

    of: tuple[str, ...]
    by: tuple[str, ...]
    needs: tuple[str, ...]


INVERSE = Kind(("effort", "contact_force"), ("q", "v", "a", "wrench", "at"), ("q", "v", "a"))
FORWARD = Kind(
    ("acceleration", "contact_force"), ("q", "v", "effort", "wrench", "at"), ("q", "v", "effort")
)
PLACES = Kind(("pose", "joint", "contact_point", "singularity_ratio"), ("q",), ("q",))
READINGS = Kind(("q",), ("joint",), ("joint",))
ALL = tuple(dict.fromkeys(n for kind in (INVERSE, FORWARD, PLACES, READINGS) for n in kind.of))


class Derivatives(Mapping[Any, Array]):
    """Derivatives by name, d["effort", "q"], and the status of every sample.

    status: (...), of `Status`; NaN where it is neither `ok` nor `kink`: one side's at a switch.
    units:  of each entry, in words.
    """

    def __init__(
        self, values: Mapping[Any, Array], status: Array, units: Mapping[Any, str]
    ) -> None:
        self._values, self.status, self.units = dict(values), status, dict(units)

    def __getitem__(self, key: Any) -> Array:
        if key not in self._values:
            raise InputError(
                f"derivatives: there is no {shown(key)}; here are "
                + ", ".join(map(str, self._values))
            )
        return self._values[key]

    def __iter__(self) -> Iterator[Any]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        lines = [f"  {k!s:42} {a.shape!s:16} {self.units[k]}" for k, a in self._values.items()]
        return "\n".join(["Derivatives", *lines])


@dataclass(frozen=True)
class _Solved:
    """Solutions of N samples: what is held at the good ones, by number, and all statuses."""

    held: Held | None
    good: Array
    status: Array


class Derived:
    """Takes derivatives of one model's results; see `Model.derivatives`."""

    def __init__(
        self,
        system: System,
        arguments: Arguments,
        poses: Poses,
        inverse: Callable[[], InverseDynamics],
        forward: Callable[[], ForwardDynamics],
        readings: Callable[[], ForwardKinematics],
    ) -> None:
        """Args: inverse, forward, readings: what finds solutions, made when it is first wanted."""
        self._system, self._own, self._poses = system, arguments, poses
        self._inverse, self._forward, self._readings = inverse, forward, readings

    # -- what a model offers -----------------------------------------------------------------

    def matrices(self, of: Any, wrt: Any, given: Mapping[str, Any], zeros: bool) -> Derivatives:
        """As `Model.derivatives`."""
        asked = _Asked.of(self._system, of, wrt, given, zeros)
        lead, count, ports = self._samples(given)
        values: dict[Any, Array] = {}
        status = np.zeros(count, dtype=np.uint8)
        for kind, names in asked.kinds:
            s = self._solved(kind, names, ports, count, bool(asked.numbers))
            status = _worse(status, s.status)
            for by in asked.wrt:
                size = asked.sizes[by]
                for name in names:
                    values[name, by] = np.full((count, self._size(name), size), np.nan)
                    values[name, by][s.good] = 0.0
            if s.held is None:
                continue
            for name, columns in self._by_states(s.held, [b for b in asked.wrt if b in kind.by]):
                for one in names:
                    values[one, name][s.good] = s.held.maps[one] @ columns
            if asked.numbers:
                for one, block in self._by_numbers(s.held, names, asked.J).items():
                    for by, at in asked.columns.items():
                        values[one, by][s.good] += block[:, :, at]
        units = {(n, by): f"({UNITS[n]}) / ({asked.unit(by)})" for n, by in values}
        shaped = {(n, by): self._shaped(a, lead, n) for (n, by), a in values.items()}
        return Derivatives(shaped, status.reshape(lead), units)

    def jvp(
        self, of: Any, tangents: Mapping[str, Any], given: Mapping[str, Any], zeros: bool
    ) -> Derivatives:
        """As `Model.jvp`."""
        if not isinstance(tangents, Mapping):
            raise InputError(f"tangents: expected arrays by name, got {shown(tangents)}")
        asked = _Asked.of(self._system, of, tuple(tangents), given, zeros)
        lead, count, ports = self._samples(given)
        along = {name: asked.rows(name, a, lead, count) for name, a in tangents.items()}
        values: dict[Any, Array] = {}
        status = np.zeros(count, dtype=np.uint8)
        for kind, names in asked.kinds:
            s = self._solved(kind, names, ports, count, bool(asked.numbers))
            status = _worse(status, s.status)
            for name in names:
                values[name] = np.full((count, self._size(name)), np.nan)
            if s.held is None:
                continue
            directions: Arrays = {}
            for by in [b for b in along if b in kind.by]:
                directions |= _split(by, along[by][s.good])
            if asked.numbers:
                steps = np.concatenate([along[by] for by in asked.columns], axis=1)[s.good]
                directions |= self._as_ports(steps @ asked.J.T)
            rows = self._along(s.held, directions)
            for name in names:
                values[name][s.good] = (s.held.maps[name] @ rows[..., None])[..., 0]
        shaped = {n: self._shaped(a[..., None], lead, n)[..., 0] for n, a in values.items()}
        return Derivatives(shaped, status.reshape(lead), {n: UNITS[n] for n in shaped})

    def vjp(
        self, of: Any, weights: Any, wrt: Any, given: Mapping[str, Any], zeros: bool
    ) -> Derivatives:
        """As `Model.vjp`."""
        names = _names(of, "of")
        weights = weights if isinstance(weights, Mapping) else dict.fromkeys(names, weights)
        asked = _Asked.of(self._system, of, wrt, given, zeros)
        lead, count, ports = self._samples(given)
        values = {by: np.zeros((count, asked.sizes[by])) for by in asked.wrt}
        status = np.zeros(count, dtype=np.uint8)
        for kind, mine in asked.kinds:
            s = self._solved(kind, mine, ports, count, bool(asked.numbers))
            status = _worse(status, s.status)
            bad = np.setdiff1d(np.arange(count), s.good)
            for a in values.values():
                a[bad] = np.nan
            if s.held is None:
                continue
            total = np.zeros(s.held.maps[mine[0]].shape[::2])
            for name in mine:
                if name not in weights:
                    raise InputError(
                        f"cotangents: expected one of {name}; got {', '.join(map(str, weights))}"
                    )
                shape = *lead, *self._shape(name)
                w = _fitting(f"cotangents: {name}", weights[name], shape)
                w = w.reshape(count, -1)[s.good]
                total += (w[:, None] @ s.held.maps[name])[:, 0]
            states = [b for b in asked.wrt if b in kind.by]
            by = [p for b in states for p in PORTS[b]] + list(OF_NUMBERS if asked.numbers else ())
            found = self._gradient(s.held, total, tuple(by))
            for b in states:
                values[b][s.good] += np.concatenate([found[p] for p in PORTS[b]], axis=1)
            if asked.numbers:
                block = found[NUMBERS] @ asked.J
                for b, at in asked.columns.items():
                    values[b][s.good] += block[:, at]
        shaped = {by: a.reshape(*lead, *asked.shapes[by]) for by, a in values.items()}
        return Derivatives(shaped, status.reshape(lead), {by: asked.unit(by) for by in shaped})

    def linearised(self, q: Any, v: Any, effort: Any, wrench: Any, at: Any) -> ModelResult:
        """As `Model.linearise`."""
        given = {"q": q, "v": v, "effort": effort, "wrench": wrench, "at": at}
        d = self.matrices("acceleration", ("q", "v", "effort"), given, False)
        by = {name: d["acceleration", name] for name in ("q", "v", "effort")}
        shape, known = by["q"].shape, np.isfinite(by["q"]).all(axis=(-1, -2))
        still = np.where(known[..., None, None], 0.0, np.nan)
        above = [np.broadcast_to(still, shape), still + np.eye(shape[-1])]
        A = np.block([above, [by["q"], by["v"]]])
        B = np.concatenate([0.0 * by["effort"], by["effort"]], axis=-2)
        return ModelResult(A=A, B=B, status=d.status)

    # -- the solutions -----------------------------------------------------------------------

    def _samples(self, given: Mapping[str, Any]) -> tuple[Lead, int, Arrays]:
        """The leading shape, the number of samples, and every port's array with all of them."""
        own = self._own
        known = {"q": own.q, "v": own.v, "a": own.a, "effort": own.effort}
        known["joint"] = Argument("joint", own.effort.size, "in the order of the file [rad or m]")
        there = [known[name] for name in known if given.get(name) is not None]
        values = [given[a.name] for a in there]
        lead, ports = own.samples(there, values, given.get("wrench"), given.get("at"))
        count = math.prod(lead)
        return lead, count, {n: np.broadcast_to(a, (count, a.shape[1])) for n, a in ports.items()}

    def _solved(
        self, kind: Kind, of: tuple[str, ...], ports: Arrays, count: int, numbers: bool
    ) -> _Solved:
        own = self._system
        system = own.wide if numbers else own
        load = {name: ports[name] for name in ("force", "moment", "point")}
        wrench, at = np.hstack([load["force"], load["moment"]]), load["point"]
        if kind is READINGS:
            found = self._readings().solve(ports["joint"])
            status = np.where(found.status == 0, Status.ok, Status.unreachable).astype(np.uint8)
        elif kind is PLACES:
            found = self._poses.inverse_kinematics(ports["q"], None, None)
            status = found.status.astype(np.uint8)
        elif kind is INVERSE:
            state = [ports[n] for n in ("q", "q1", "q2")]
            found = self._inverse().many(state, wrench, at, ("pose",), None)
            status = found.status
        else:
            state = [ports[n] for n in ("q", "q1", "effort")]
            found = self._forward().many(state, wrench, at, ("pose",), None)
            status = found.status
        good = np.flatnonzero(status == Status.ok)
        if not good.size:
            return _Solved(None, good, status)
        pose = found.pose[good]
        places = {"pose": pose, "q": pose[:, indices(own.independent)]}
        if kind in (READINGS, PLACES):
            reading = (
                ports["joint"] if kind is READINGS else np.zeros((count, self._own.effort.size))
            )
            places["reading"] = reading[good]
            held = read_back(system, places) if kind is READINGS else placed(system, places, of)
        else:
            places |= {n: ports[n][good] for n in ("q", "q1", *load)}
            places["contact_force"] = found.contact_force[good]
            error = np.fmax(found.bound[good], 0.0)
            if kind is INVERSE:
                places |= {"q2": ports["q2"][good], "effort": found.effort[good]}
                held = balanced(system, places, self._inverse().distributor, error)
            else:
                places |= {"q2": found.acceleration[good], "effort": ports["effort"][good]}
                rubs = np.array([c.friction.coefficient > 0 for c in own.mechanism.contacts], bool)
                held = accelerated(system, places, rubs, error)
        status = status.copy()
        status[good[held.kink]] = Status.kink
        return _Solved(held, good, status)

    # -- derivatives of the rows -------------------------------------------------------------

    def _by_states(self, held: Held, wrt: Iterable[str]) -> Iterator[tuple[str, Array]]:
        """Of the rows by each of these, (N, rows, size)."""
        wrt = tuple(wrt)
        if by := tuple(p for name in wrt for p in PORTS[name]):
            kernel = held.system.derivative("slopes", held.question, by, held.rows)
            values = kernel.run(held.ports).values
            for name in wrt:
                ports = (
                    [
                        _columns(values[f"{row}/{p}"], row in OF_LANES, p in OF_LANES)
                        for row in held.rows
                    ]
                    for p in PORTS[name]
                )
                yield name, np.concatenate([np.concatenate(p, axis=1) for p in ports], axis=2)

    def _along(self, held: Held, directions: Arrays) -> Array:
        """Of the rows along directions of ports and numbers, (N, rows)."""
        kernel = held.system.derivative("directional", held.question, tuple(directions), held.rows)
        ports = held.ports | {PREFIX + name: a for name, a in directions.items()}
        values = kernel.run(ports).values
        flat = [_flat(values[PREFIX + row]) for row in held.rows]
        return np.concatenate(flat, axis=1)

    def _gradient(self, held: Held, weights: Array, by: tuple[str, ...]) -> Arrays:
        """Of weights (N, rows) . rows by each port, (N, size); all numbers under NUMBERS."""
        kernel = held.system.derivative("gradient", held.question, by, held.rows)
        ports, start = dict(held.ports), 0
        for port in kernel.interface.ports:
            if port.name.startswith(WEIGHT):
                width = port.size * (kernel.interface.lanes if port.lanes else 1)
                block = weights[:, start : start + width]
                if port.lanes and port.size > 1:
                    block = block.reshape(-1, port.size, kernel.interface.lanes)
                ports[port.name] = block
                start += width
        values = kernel.run(ports).values
        found = {p: _flat(values[GRADIENT + p]) for p in by if p not in OF_NUMBERS}
        if NUMBERS in by:
            parts = [_flat(values[GRADIENT + NUMBERS])]
            lanes = values[GRADIENT + LANE_NUMBERS]
            for at, size in self._groups(held.system):
                parts.append(_flat(lanes[:size][:, at]))
            found[NUMBERS] = np.concatenate(parts, axis=1)
        return found

    def _by_numbers(self, held: Held, of: Sequence[str], J: Array) -> Arrays:
        """Of results by numbers of the file, (N, size, F), in as few sweeps as will do.

        Args: J: of the kernel's numbers by those, (K, F).
        """
        count, F = len(held.ports["q"]), J.shape[1]
        sizes = {name: held.maps[name].shape[1] for name in of}
        found = {name: np.empty((count, size, F)) for name, size in sizes.items()}
        if sum(sizes.values()) >= F:
            for i in range(F):
                rows = self._along(held, self._as_ports(J[None, :, i]))
                for name in of:
                    found[name][:, :, i] = (held.maps[name] @ rows[..., None])[..., 0]
            return found
        for name in of:
            for i in range(sizes[name]):
                by = self._gradient(held, held.maps[name][:, i], OF_NUMBERS)[NUMBERS]
                found[name][:, i] = by @ J
        return found

    def _as_ports(self, numbers: Array) -> Arrays:
        """Directions of the kernel's numbers, (N, K), as ports take them."""
        system = self._system.wide
        shared = len(system.numbers.parameters)
        groups = self._groups(system)
        lanes = np.zeros((len(numbers), max(s for _, s in groups), system.structure.n))
        start = shared
        for at, size in groups:
            end = start + size * len(at)
            lanes[:, :size, at] = numbers[:, start:end].reshape(len(numbers), size, len(at))
            start = end
        return {NUMBERS: numbers[:, :shared], LANE_NUMBERS: lanes}

    def _groups(self, system: System) -> list[tuple[Array, int]]:
        """Of each group: its chains in the order of the file, and how many numbers each has."""
        order, start, found = np.array(system.numbers.order), 0, []
        for values in system.numbers.lanes:
            found.append((order[start : start + values.shape[1]], values.shape[0]))
            start += values.shape[1]
        return found

    # -- shapes ------------------------------------------------------------------------------

    def _shape(self, name: str) -> tuple[int, ...]:
        m, k = self._own.q.size, len(self._system.mechanism.contacts)
        n = self._own.effort.size
        known: dict[str, tuple[int, ...]] = {
            "q": (m,), "acceleration": (m,), "effort": (n,), "joint": (n,), "contact_force": (k,),
            "pose": (6,), "contact_point": (k, 3), "singularity_ratio": (),
        }  # fmt: skip
        return known[name]

    def _size(self, name: str) -> int:
        return math.prod(self._shape(name))

    def _shaped(self, a: Array, lead: Lead, name: str) -> Array:
        return a.reshape(*lead, *self._shape(name), a.shape[-1])


@dataclass(frozen=True)
class _Asked:
    """What is asked for: results by kind, and what they are differentiated by.

    shapes: of each of `wrt`;  columns: of each number of the file among those of J, (K, F).
    """

    kinds: list[tuple[Kind, tuple[str, ...]]]
    wrt: tuple[str, ...]
    shapes: dict[str, tuple[int, ...]]
    units: dict[str, str]
    columns: dict[str, slice]
    J: Array

    @staticmethod
    def of(system: System, of: Any, wrt: Any, given: Mapping[str, Any], zeros: bool) -> _Asked:
        zeros = as_flag(zeros, "zeros")
        kinds = _kinds(_names(of, "of"), given)
        states = {
            "q": (m := len(system.independent),), "v": (m,), "a": (m,), "wrench": (6,), "at": (3,),
            "effort": (n := len(system.mechanism.chains),), "joint": (n,),
        }  # fmt: skip
        asked, shapes, units = _names(wrt, "wrt"), dict[str, tuple[int, ...]](), dict[str, str]()
        for by in asked:
            if by not in states:
                raise InputError(f"wrt: there is no {shown(by)}.{did_you_mean(by, states)}")
            shapes[by], units[by] = states[by], UNITS[by]
            for kind, names in kinds:
                if by not in kind.by and not zeros:
                    raise InputError(
                        f"wrt: {', '.join(names)} cannot depend on {by}, only on "
                        f"{', '.join(kind.by)} and numbers of the file; zeros=True gives zeros"
                    )
        return _Asked(kinds, asked, shapes, units, {}, np.zeros((0, 0)))

    @property
    def numbers(self) -> bool:
        return bool(self.columns)

    @property
    def sizes(self) -> dict[str, int]:
        return {by: math.prod(shape) for by, shape in self.shapes.items()}

    def unit(self, by: str) -> str:
        return self.units[by]

    def rows(self, by: str, given: Any, lead: Lead, count: int) -> Array:
        """A tangent, (N, size).

        Raises: InputError: for other shapes.
        """
        return _fitting(f"tangents: {by}", given, (*lead, *self.shapes[by])).reshape(count, -1)


def _kinds(of: tuple[str, ...], given: Mapping[str, Any]) -> list[tuple[Kind, tuple[str, ...]]]:
    """Results by the solution that has them.

    Raises: InputError: for unknown results, and where an argument is missing.
    """
    forward = "acceleration" in of or ("effort" not in of and given.get("effort") is not None)
    found: dict[Kind, list[str]] = {}
    for name in of:
        if name not in ALL:
            raise InputError(f"of: there is no {shown(name)}.{did_you_mean(name, ALL)}")
        for kind in (FORWARD, INVERSE) if forward else (INVERSE, FORWARD):
            if name in kind.of:
                break
        else:
            kind = PLACES if name in PLACES.of else READINGS
        found.setdefault(kind, []).append(name)
    for kind, names in found.items():
        missing = [n for n in kind.needs if given.get(n) is None]
        if missing:
            raise InputError(
                f"derivatives of {', '.join(names)} take {', '.join(kind.needs)}; missing: "
                f"{', '.join(missing)}"
            )
    return [(kind, tuple(names)) for kind, names in found.items()]


def _names(given: Any, what: str) -> tuple[str, ...]:
    names = (given,) if isinstance(given, str) else given
    if (
        not isinstance(names, list | tuple)
        or not names
        or not all(isinstance(n, str) for n in names)
    ):
        raise InputError(f"{what}: expected names, got {shown(given)}")
    return tuple(dict.fromkeys(names))


def _fitting(what: str, given: Any, shape: tuple[int, ...]) -> Array:
    """As doubles of a shape, or what broadcasts to it.

    Raises: InputError: for anything else.
    """
    found = Argument(what, shape[-1] if shape else 1, f"of shape {shape}").numbers(given)
    try:
        return np.broadcast_to(found, shape)
    except ValueError:
        raise InputError(f"{what}: expected numbers of shape {shape}, got {found.shape}") from None


def _split(by: str, a: Array) -> Arrays:
    """By port."""
    return {"force": a[:, :3], "moment": a[:, 3:]} if by == "wrench" else {PORTS[by][0]: a}


def _worse(one: Array, other: Array) -> Array:
    """Statuses of both: what failed comes before a kink."""
    kink = one == Status.kink
    return np.where((one == Status.ok) | (kink & (other != Status.ok)), other, one)


def _flat(a: Array) -> Array:
    """Results (.., N) as (N, all)."""
    return np.ascontiguousarray(samples_first(a).reshape(a.shape[-1], -1))


def _columns(a: Array, of_lanes: bool, by_lanes: bool) -> Array:
    """Results by a port, as `slopes` has them, as (N, rows, size)."""
    if by_lanes:
        a = a[..., 0, :, :]  # chains are the port's
    elif of_lanes:
        a = np.moveaxis(a, -3, -2)
    return samples_first(a.reshape(-1, *a.shape[-2:]))
