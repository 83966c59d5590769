"""Derivatives of efforts, accelerations, poses and their like by states, loads and numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from ..backends.kernel import AGAIN, OK
from ..errors import InputError, UnsupportedError, as_flag, brief, did_you_mean
from ..graph.program import Interface
from ..graph.transform import LANE_NUMBERS, NUMBERS
from ..kinematics.chain.muscle import muscles
from ..kinematics.constraints import indices
from ..motion.arrays import as_doubles
from ..quantities import QUANTITIES
from ..questions.derivative import GRADIENT, OF_NUMBERS, WEIGHT
from ..questions.numbers import Layout
from ..status import Status
from .arguments import GIVEN, Arguments, Lead
from .elasticity import Elasticity
from .forward_dynamics import ForwardDynamics
from .forward_kinematics import ForwardKinematics
from .implicit import (
    VIBRATING,
    SolvedSamples,
    accelerated,
    balanced,
    directional_rows,
    flat,
    read_back,
    samples_first,
    solved_places,
    vibrating,
)
from .inverse_dynamics import InverseDynamics
from .model_result import ModelResult
from .number_columns import NumberColumns, limit_ends
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
    "gravity": ("gravity",),
    "base": ("base",),
}
DYNAMIC = ("q", "q1", "q2", "force", "moment", "point")  # ports of inverse dynamics
OF_LANES = ("along", "joint", "transmission", "J_W", "effort", "reading")  # rows and ports


@dataclass(frozen=True)
class ResultKind:
    """Results that one solution has: their names, and the states and loads that they follow from.

    needs: arguments without which there is no solution.
    """

    of: tuple[str, ...]
    by: tuple[str, ...]
    needs: tuple[str, ...]


BESIDE = ("wrench", "at", *GIVEN)
INVERSE = ResultKind(("effort", "contact_force"), ("q", "v", "a", *BESIDE), ("q", "v", "a"))
FORWARD = ResultKind(
    ("acceleration", "contact_force"), ("q", "v", "effort", *BESIDE), ("q", "v", "effort")
)
PLACES = ResultKind(("pose", "joint", "contact_point", "singularity_ratio"), ("q",), ("q",))
READINGS = ResultKind(("q",), ("joint",), ("joint",))
MODES = ResultKind(("frequency",), ("q", "effort", "wrench", "at"), ("q",))
KINDS = (INVERSE, FORWARD, PLACES, READINGS, MODES)
ALL = tuple(dict.fromkeys(n for kind in KINDS for n in kind.of))


class Derivatives(Mapping[Any, Array]):
    """Derivatives by name, d["effort", "q"], and the status of every sample.

    status:    (...), of `Status`; NaN where it is neither `ok` nor `kink`: there they are those of
               the active set that was chosen.
    units:     of each entry, in words.
    home_kept: contacts whose surface follows numbers of the file that would take it off home; not
               among them is one whose own offset or centre is asked for.
    """

    def __init__(
        self,
        values: Mapping[Any, Array],
        status: Array,
        units: Mapping[Any, str],
        home_kept: tuple[str, ...] = (),
    ) -> None:
        self._values = dict(values)
        self.status: Array = status
        self.units: dict[Any, str] = dict(units)
        self.home_kept: tuple[str, ...] = home_kept

    def __getitem__(self, key: Any) -> Array:
        if key not in self._values:
            raise InputError(
                f"derivatives: unknown entry {brief(key)}; available: "
                + ", ".join(map(str, self._values))
            )
        return self._values[key]

    def __iter__(self) -> Iterator[Any]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        lines = [f"  {k!s:42} {a.shape!s:16} {self.units[k]}" for k, a in self._values.items()]
        kept = [f"  home kept: {', '.join(self.home_kept)}"] if self.home_kept else []
        return "\n".join(["Derivatives", *lines, *kept])


@dataclass(frozen=True)
class _Part:
    """Good samples of one kind, by number, and what is held at their solutions."""

    names: tuple[str, ...]
    kind: ResultKind
    held: SolvedSamples
    good: Array


class Differentiator:
    """Takes derivatives of one model's results; see `Model.derivatives`."""

    def __init__(
        self,
        system: System,
        arguments: Arguments,
        poses: Poses,
        inverse: Callable[[], InverseDynamics],
        forward: Callable[[], ForwardDynamics],
        readings: Callable[[], ForwardKinematics],
        elasticity: Callable[[], Elasticity],
    ) -> None:
        """Args: inverse, forward, readings, elasticity: what finds solutions, made when it is first
        wanted."""
        self._system, self._own, self._poses = system, arguments, poses
        self._inverse, self._forward, self._readings = inverse, forward, readings
        self._elasticity = elasticity

    def _request(
        self, of: Any, wrt: Any, given: Mapping[str, Any], zeros: bool, keep: str
    ) -> _Request:
        limited = self._inverse().distributor.distribution.objective.limits
        return _Request.of(self._system_of(given), of, wrt, given, zeros, keep, limited)

    # -- what a model offers -----------------------------------------------------------------

    def matrices(
        self, of: Any, wrt: Any, given: Mapping[str, Any], zeros: bool = False, keep: str = "home"
    ) -> Derivatives:
        """As `Model.derivatives`."""
        request = self._request(of, wrt, given, zeros, keep)
        lead, count, ports = self._samples(given)
        parts, status = self._parts(request, ports, count)
        values = {
            (name, by): np.full((count, self._size(name), size), np.nan)
            for _, names in request.kinds
            for name in names
            for by, size in request.sizes.items()
        }
        for part in parts:
            for name in part.names:
                for by in request.wrt:
                    values[name, by][part.good] = 0.0
            for by, columns in self._by_states(part, request.states):
                for name in part.names:
                    values[name, by][part.good] = part.held.applied(name, columns)
            for name, block in self._by_numbers(part, request.J).items():
                for by, at in request.columns.items():
                    values[name, by][part.good] += block[:, :, at]
                    if name in part.held.length:
                        moved = part.held.length[name][..., None] * request.length[at]
                        values[name, by][part.good] += moved
            for name, (by, ends) in product(part.names, request.ends.items()):
                values[name, by][part.good] += _by_ends(part.held, name, ends)
        units = {(n, by): f"({_unit(n)}) / ({request.units[by]})" for n, by in values}
        shaped = {
            (n, by): a.reshape((*lead, *self._shape(n), *request.shapes[by]))
            for (n, by), a in values.items()
        }
        return Derivatives(shaped, status.reshape(lead), units, request.home_kept)

    def jvp(
        self, of: Any, tangents: Mapping[str, Any], given: Mapping[str, Any], zeros: bool, keep: str
    ) -> Derivatives:
        """As `Model.jvp`."""
        if not isinstance(tangents, Mapping):
            raise InputError(f"tangents: expected arrays by name, got {brief(tangents)}")
        request = self._request(of, tuple(tangents), given, zeros, keep)
        lead, count, ports = self._samples(given)
        tangent = {name: request.rows(name, a, lead, count) for name, a in tangents.items()}
        parts, status = self._parts(request, ports, count)
        values = {
            name: np.full((count, self._size(name)), np.nan)
            for _, names in request.kinds
            for name in names
        }
        for part in parts:
            directions: Arrays = {}
            for by, state in request.states.items():
                if state in part.kind.by:
                    directions |= _split(state, tangent[by][part.good])
            if request.numbers:
                steps = np.concatenate([tangent[by] for by in request.columns], axis=1)[part.good]
                directions |= _as_ports(part.held.system, steps @ request.J.T)
            rows = directional_rows(part.held, directions)[..., None] if directions else None
            for name in part.names:
                values[name][part.good] = (
                    0.0 if rows is None else part.held.applied(name, rows)[..., 0]
                )
                for by, ends in request.ends.items():
                    slope, step = _by_ends(part.held, name, ends), tangent[by][part.good]
                    values[name][part.good] += (slope @ step[..., None])[..., 0]
                if name in part.held.length and request.numbers:
                    moved = steps @ request.length
                    values[name][part.good] += part.held.length[name] * moved[:, None]
        shaped = {n: a.reshape((*lead, *self._shape(n))) for n, a in values.items()}
        units = {n: _unit(n) for n in shaped}
        return Derivatives(shaped, status.reshape(lead), units, request.home_kept)

    def vjp(
        self, of: Any, weights: Any, wrt: Any, given: Mapping[str, Any], zeros: bool, keep: str
    ) -> Derivatives:
        """As `Model.vjp`."""
        names = names_of(of, "of")
        weights = weights if isinstance(weights, Mapping) else dict.fromkeys(names, weights)
        request = self._request(of, wrt, given, zeros, keep)
        lead, count, ports = self._samples(given)
        every = [name for _, some in request.kinds for name in some]
        if missing := [name for name in every if name not in weights]:
            raise InputError(f"cotangents: expected those of {', '.join(missing)} too")
        given_weights = {
            name: _fitting(f"cotangents: {name}", weights[name], (*lead, *self._shape(name)))
            for name in every
        }
        parts, status = self._parts(request, ports, count)
        values = {by: np.full((count, size), np.nan) for by, size in request.sizes.items()}
        for a in values.values():
            a[(status == Status.ok) | (status == Status.kink)] = 0.0
        for part in parts:
            rows = [given_weights[n].reshape(count, -1)[part.good] for n in part.names]
            total = sum(part.held.pulled(n, w) for n, w in zip(part.names, rows, strict=True))
            states = {b: state for b, state in request.states.items() if state in part.kind.by}
            by = [p for state in states.values() for p in PORTS[state]] + list(
                OF_NUMBERS if request.numbers else ()
            )
            gradient = self._gradient(part.held, np.asarray(total), tuple(by)) if by else {}
            for b, state in states.items():
                values[b][part.good] += np.concatenate([gradient[p] for p in PORTS[state]], axis=1)
            for b, at in request.columns.items():
                values[b][part.good] += (gradient[NUMBERS] @ request.J)[:, at]
            for name, w in zip(part.names, rows, strict=True):
                for b, ends in request.ends.items():
                    values[b][part.good] += (w[:, None] @ _by_ends(part.held, name, ends))[:, 0]
                if name in part.held.length:
                    moved = (w * part.held.length[name]).sum(axis=1, keepdims=True)
                    for b, at in request.columns.items():
                        values[b][part.good] += moved * request.length[at]
        shaped = {by: a.reshape((*lead, *request.shapes[by])) for by, a in values.items()}
        units = {by: request.units[by] for by in shaped}
        return Derivatives(shaped, status.reshape(lead), units, request.home_kept)

    def linearised(
        self, q: Any, v: Any, effort: Any, wrench: Any, at: Any, more: Mapping[str, Any]
    ) -> ModelResult:
        """As `Model.linearise`; more: of `GIVEN`."""
        own = self._own
        # What is missing, too.
        own.samples((own.q, own.v, own.effort), (q, v, effort), wrench, at, more)
        given = {"q": q, "v": v, "effort": effort, "wrench": wrench, "at": at, **more}
        d = self.matrices("acceleration", ("q", "v", "effort"), given)
        by = {name: d["acceleration", name] for name in ("q", "v", "effort")}
        shape, known = by["q"].shape, np.isfinite(by["q"]).all(axis=(-1, -2))
        still = np.where(known[..., None, None], 0.0, np.nan)
        above = [np.broadcast_to(still, shape), still + np.eye(shape[-1])]
        A = np.block([above, [by["q"], by["v"]]])
        B = np.concatenate([0.0 * by["effort"], by["effort"]], axis=-2)
        return ModelResult(A=A, B=B, status=d.status)

    # -- the solutions -----------------------------------------------------------------------

    def _system_of(self, given: Mapping[str, Any]) -> System:
        return self._system.with_inputs([name for name in GIVEN if given.get(name) is not None])

    def _samples(self, given: Mapping[str, Any]) -> tuple[Lead, int, Arrays]:
        """The leading shape, the number of samples, and every port's array with all of them."""
        own = self._own
        known = {"q": own.q, "v": own.v, "a": own.a, "effort": own.effort, "joint": own.joint}
        known |= GIVEN
        there = [known[name] for name in known if given.get(name) is not None]
        values = [given[a.name] for a in there]
        lead, ports = own.samples(there, values, given.get("wrench"), given.get("at"))
        count = math.prod(lead)
        return lead, count, {n: np.broadcast_to(a, (count, a.shape[1])) for n, a in ports.items()}

    def _parts(self, request: _Request, ports: Arrays, count: int) -> tuple[list[_Part], Array]:
        """Good samples, kind by kind, and all statuses: of several kinds, what failed first."""
        parts, status = [], np.zeros(count, dtype=np.uint8)
        for kind, names in request.kinds:
            if kind is INVERSE or (kind is MODES and "effort" not in ports):
                self._require_known(request)
            own, rows = np.zeros(count, dtype=np.uint8), np.arange(count)
            if kind is INVERSE and names == ("effort",) and self._plain(request.system):
                kernel = request.system.kernel("inverse")
                state = {n: ports[n] for n in (*DYNAMIC, *request.system.structure.given)}
                own = kernel.run(state).status
                good, rows = np.flatnonzero(own == OK), np.flatnonzero(own == AGAIN)
                state, still = {n: a[good] for n, a in state.items()}, np.zeros(len(good), bool)
                held = SolvedSamples(request.system, "inverse", state, ("effort",), {}, still)
                parts.append(_Part(names, kind, held, good))
            if rows.size:
                some = {name: a[rows] for name, a in ports.items()}
                other, own[rows] = self._held(request.system, kind, names, some)
                if other is not None:
                    good = rows[np.isin(own[rows], (Status.ok, Status.kink))]
                    parts.append(_Part(names, kind, other, good))
            status = _worse(status, own)
        return [part for part in parts if part.good.size], status

    def _require_known(self, request: _Request) -> None:
        """Raises UnsupportedError for numbers that the objective itself is made of."""
        chosen = self._inverse().distributor.distribution
        machine = self._system.mechanism
        if chosen.objective.limits and machine.enabled_walls:
            raise UnsupportedError(
                f"distribution {chosen.name}: whether walls bear a force follows from the state, "
                "and derivatives within limits do not know it: set their enabled to false, or take "
                "minimum_norm"
            )
        if chosen.objective.limits and muscles(machine.chains):
            raise UnsupportedError(
                f"distribution {chosen.name} minimises within limits of muscles that depend on the "
                "state, and has no derivatives yet: take differences, or minimum_norm"
            )

        if chosen.contact_weight and request.ends and self._inverse().distributor.shared_reference:
            raise UnsupportedError(
                "wrt: several chains have the largest limit, which the contact weight is of; there "
                "is no derivative by one of them: let one limit be larger, or take contact_weight 0"
            )

    def _plain(self, system: System) -> bool:
        """Whether efforts can be differentiated as the kernel computes them."""
        return not self._inverse().distributor.chooses and not system.structure.friction

    def _held(
        self, system: System, kind: ResultKind, of: tuple[str, ...], ports: Arrays
    ) -> tuple[SolvedSamples | None, Array]:
        """What is held at solutions that are good, and the statuses of all."""
        own, more = self._system, {n: ports[n] for n in system.structure.given}
        load = ("force", "moment", "point", *more)
        wrench, at = np.hstack([ports["force"], ports["moment"]]), ports["point"]
        if kind is MODES:
            return self._vibrating(system, ports, wrench, at)
        if kind is READINGS:
            solved = self._readings().solve(ports["joint"])
            bad = np.where(solved.status == 0, Status.ok, Status.unreachable)
            solved = ModelResult(**vars(solved) | {"status": bad})
        elif kind is PLACES:
            solved = self._poses.inverse_kinematics(ports["q"], None, None)
        elif kind is INVERSE:
            state = [ports[n] for n in ("q", "q1", "q2")]
            solved = self._inverse().solve(state, wrench, at, ("pose",), None, more)
        else:
            state = [ports[n] for n in ("q", "q1", "effort")]
            solved = self._forward().solve(state, wrench, at, ("pose",), None, more)
        status = solved.status.astype(np.uint8)
        good = np.flatnonzero(status == Status.ok)
        if not good.size:
            return None, status
        pose = solved.pose[good]
        places = {"pose": pose, "q": pose[:, indices(own.independent)]}
        if kind is READINGS:
            held = read_back(system, places | {"reading": ports["joint"][good]})
        elif kind is PLACES:
            still = np.zeros((len(good), self._own.effort.size))
            held = solved_places(system, places | {"reading": still}, of)
        else:
            places |= {n: ports[n][good] for n in ("q", "q1", *load)}
            places["contact_force"] = solved.contact_force[good]
            error = np.fmax(solved.bound[good], 0.0)
            if kind is INVERSE:
                places |= {"q2": ports["q2"][good], "effort": solved.effort[good]}
                held = balanced(system, places, self._inverse().distributor, error)
            else:
                places |= {"q2": solved.acceleration[good], "effort": ports["effort"][good]}
                rubs = np.array([c.friction.coefficient > 0 for c in own.mechanism.contacts], bool)
                held = accelerated(system, places, rubs, error)
        status[good[held.kink]] = Status.kink
        return held, status

    def _vibrating(
        self, system: System, ports: Arrays, wrench: Array, at: Array
    ) -> tuple[SolvedSamples | None, Array]:
        q, effort, force = ports["q"], ports.get("effort"), None
        if effort is None:
            solution = self._inverse().solve((q, 0 * q, 0 * q), wrench, at, (), None)
            effort, force = np.nan_to_num(solution.effort), solution.contact_force
        _, here = self._elasticity().equilibrium(q, effort, wrench, at)
        status = here.status.astype(np.uint8)
        if force is not None:
            status = _worse(solution.status.astype(np.uint8), status)
        square, shape = here.modes
        status[(status == Status.ok) & ~(square > 0).all(axis=1)] = Status.unstable
        good = np.flatnonzero(status == Status.ok)
        if not good.size:
            return None, status
        own = {name: a[good] for name, a in here.ports.items()}
        efforts = None
        if force is not None:
            still = {"q1": 0 * own["q"], "q2": 0 * own["q"], "contact_force": force[good]}
            error = np.fmax(solution.bound[good], 0.0)
            efforts = balanced(system, own | still, self._inverse().distributor, error)
        modes = (square[good], shape[good], here.M[good])
        held = vibrating(system, own, modes, efforts)
        status[good[held.kink]] = Status.kink
        return held, status

    # -- derivatives of the rows -------------------------------------------------------------

    def _by_states(self, part: _Part, states: Mapping[str, str]) -> Iterator[tuple[str, Array]]:
        """Slopes of the rows by each of these that matter, (N, rows, size)."""
        held, states = part.held, {by: s for by, s in states.items() if s in part.kind.by}
        if by := tuple(dict.fromkeys(p for state in states.values() for p in PORTS[state])):
            kernel = held.system.derivative("slopes", held.question, by, held.rows)
            values = kernel.run(held.ports).values
            for name, state in states.items():
                ports = (
                    [
                        _columns(values[f"{row}/{port}"], row in OF_LANES, port in OF_LANES)
                        for row in held.rows
                    ]
                    for port in PORTS[state]
                )
                yield name, np.concatenate([np.concatenate(p, axis=1) for p in ports], axis=2)

    def _gradient(self, held: SolvedSamples, weights: Array, by: tuple[str, ...]) -> Arrays:
        """Slopes of weights (N, rows) . rows by each port, (N, size); all numbers under NUMBERS."""
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
        found = {p: flat(values[GRADIENT + p]) for p in by if p not in OF_NUMBERS}
        if NUMBERS in by:
            found[NUMBERS] = self._numbers_of(held.system, kernel.interface, values)
        return found

    def _numbers_of(self, system: System, interface: Interface, values: Arrays) -> Array:
        """Derivatives by the kernel's numbers, (N, K), from those that matter."""
        count = next(iter(values.values())).shape[-1]
        shared, groups = np.zeros((system.numbers.parameters.size, count)), _groups(system)
        lanes = [np.zeros((size, len(at), count)) for at, size in groups]
        for r in interface.results:
            which, _, i = r.name.removeprefix(GRADIENT).partition("/")
            if which == NUMBERS:
                shared[int(i)] = values[r.name][0]
            elif which == LANE_NUMBERS:
                there = np.sort(np.concatenate([groups[g][0] for g in r.groups]))
                for g in r.groups:
                    lanes[g][int(i)] = values[r.name][0][np.searchsorted(there, groups[g][0])]
        return np.concatenate([shared, *(a.reshape(-1, count) for a in lanes)]).T

    def _by_numbers(self, part: _Part, J: Array) -> Arrays:
        """Slopes of results by numbers of the file, (N, size, F), in as few sweeps as will do.

        Args: J: of the kernel's numbers by those, (K, F).
        """
        held, count, F = part.held, len(part.good), J.shape[1]
        if not F:
            return {}
        sizes = {name: self._size(name) for name in part.names}
        slopes = {name: np.empty((count, size, F)) for name, size in sizes.items()}
        if sum(sizes.values()) >= F:
            for i in range(F):
                rows = directional_rows(held, _as_ports(held.system, J[None, :, i]))[..., None]
                for name in part.names:
                    slopes[name][:, :, i] = held.applied(name, rows)[..., 0]
            return slopes
        for name, size in sizes.items():
            for i, unit in enumerate(np.eye(size)):
                weights = held.pulled(name, np.broadcast_to(unit, (count, size)))
                slopes[name][:, i] = self._gradient(held, weights, OF_NUMBERS)[NUMBERS] @ J
        return slopes

    # -- shapes ------------------------------------------------------------------------------

    def _shape(self, name: str) -> tuple[int, ...]:
        return QUANTITIES[name].shape(self._system.mechanism)

    def _size(self, name: str) -> int:
        return math.prod(self._shape(name))


@dataclass(frozen=True)
class _Request:
    """What is asked for: results by kind, and what they are differentiated by.

    system: whose kernels have the derivatives.
    states: those of `wrt` that are states or loads, and which.
    shapes: of each of `wrt`;  columns: of each number of the file among those of J, (K, F);
    ends: what limits of efforts make of all least and greatest ones, (2 n, entries).
    """

    system: System
    kinds: list[tuple[ResultKind, tuple[str, ...]]]
    wrt: tuple[str, ...]
    states: dict[str, str]
    shapes: Mapping[str, tuple[int, ...]]
    units: dict[str, str]
    columns: dict[str, slice]
    J: Array
    ends: dict[str, Array]
    home_kept: tuple[str, ...] = ()

    @staticmethod
    def of(
        own: System,
        of: Any,
        wrt: Any,
        given: Mapping[str, Any],
        zeros: bool,
        keep: str,
        limited: bool,
    ) -> _Request:
        zeros = as_flag(zeros, "zeros")
        kinds = _kinds(names_of(of, "of"), given)
        if any(kind is MODES for kind, _ in kinds):
            own.require_giving()
            if own.structure.given:
                raise InputError(
                    f"{' and '.join(own.structure.given)}: frequencies are those in the file's "
                    "gravity, on a base at rest; leave it out"
                )
        sizes = {
            name: QUANTITIES[name].shape(own.mechanism)
            for name in PORTS
            if name not in GIVEN or name in own.structure.given
        }
        variables = names_of(wrt, "wrt")
        states = {by: by for by in variables if by in sizes}
        if isinstance(at := given.get("at"), str):  # that point is a number of the file
            states |= {by: "at" for by in variables if by == f"platform.points.{at}"}
        for (kind, names), (by, state) in product(kinds, states.items()):
            if state not in kind.by and not zeros:
                raise InputError(
                    f"wrt: {', '.join(names)} cannot depend on {by}, only on "
                    f"{', '.join(kind.by)} and numbers of the file. --zeros (zeros=True) gives "
                    "zeros"
                )
        shapes: dict[str, tuple[int, ...]] = {by: sizes[state] for by, state in states.items()}
        units = {by: _unit(state) for by, state in states.items()}
        paths = [by for by in variables if by not in states]
        if "base" in paths:
            raise InputError("wrt: base: give the base's motion too: base=..., (..., 9)")
        for by in paths:
            if "." not in by and by != "gravity":
                near = did_you_mean(by, {*sizes, "gravity", "base"})
                raise InputError(
                    f"wrt: unknown variable {brief(by)}.{near} Or the path of a number of the "
                    "file, such as platform.mass"
                )
        ends: dict[str, Array] = {}
        for by in [*paths] if limited and all(kind is INVERSE for kind, _ in kinds) else ():
            if (found := limit_ends(own.mechanism, by)) is not None:
                ends[by], shapes[by], units[by] = *found, _unit("effort")
                paths.remove(by)
        if not paths:
            return _Request(
                own, kinds, variables, states, shapes, units, {}, np.zeros((0, 0)), ends
            )
        terms = [term for kind, names in kinds for term in _terms(kind, names)]
        n_ = NumberColumns.of(own, paths, keep, zeros, terms)
        return _Request(
            n_.system,
            kinds,
            variables,
            states,
            shapes | n_.shapes,
            units | n_.units,
            n_.columns,
            n_.J,
            ends,
            n_.home_kept,
        )

    @property
    def length(self) -> Array:
        """Derivatives of the characteristic length by the numbers of the file, (F,)."""
        return self.J[Layout.of(self.system.structure).parameters["length"][0]]

    @property
    def numbers(self) -> bool:
        return bool(self.columns)

    @property
    def sizes(self) -> dict[str, int]:
        return {by: math.prod(self.shapes[by]) for by in self.wrt}

    def rows(self, by: str, given: Any, lead: Lead, count: int) -> Array:
        """A tangent, (N, size).

        Raises: InputError: for other shapes.
        """
        return _fitting(f"tangents: {by}", given, (*lead, *self.shapes[by])).reshape(count, -1)


def _unit(name: str) -> str:
    return QUANTITIES[name].any_unit()


def _by_ends(held: SolvedSamples, name: str, ends: Array) -> Array:
    """Slopes of a result by limits of efforts, (N, size, entries)."""
    own = held.ends[name]
    return own.reshape(*own.shape[:2], -1) @ ends


def _as_ports(system: System, numbers: Array) -> Arrays:
    """Directions of the kernel's numbers, (N, K), as ports take them."""
    start, groups = system.numbers.parameters.size, _groups(system)
    ports = {NUMBERS: numbers[:, :start]}
    lanes = np.zeros((len(numbers), max(s for _, s in groups), system.structure.n))
    for at, size in groups:
        end = start + size * len(at)
        lanes[:, :size, at] = numbers[:, start:end].reshape(len(numbers), size, len(at))
        start = end
    return ports | {LANE_NUMBERS: lanes}


def _groups(system: System) -> list[tuple[Array, int]]:
    """Each group's chains in the order of the file, and how many numbers each has."""
    order, start, groups = np.array(system.numbers.order), 0, []
    for (values,) in system.numbers.lanes:
        groups.append((order[start : start + values.shape[1]], values.shape[0]))
        start += values.shape[1]
    return groups


def _terms(kind: ResultKind, names: tuple[str, ...]) -> list[tuple[str, str, tuple[str, ...]]]:
    """Results, and the question and its results that they follow from."""
    if kind in (INVERSE, FORWARD):
        rows = ("residual", "along", "across") if kind is INVERSE else ("residual",)
        return [(name, "linear", rows) for name in names]
    if kind is MODES:
        return [(name, *VIBRATING) for name in names]
    own = {"q": ("pull",), "singularity_ratio": ("transmission", "J_W")}
    return [(name, "places", own.get(name, (name,))) for name in names]


def _kinds(
    of: tuple[str, ...], given: Mapping[str, Any]
) -> list[tuple[ResultKind, tuple[str, ...]]]:
    """Results by the solution that has them.

    Raises: InputError: for unknown results, and where an argument is missing.
    """
    forward = "acceleration" in of or ("effort" not in of and given.get("effort") is not None)
    groups: dict[ResultKind, list[str]] = {}
    for name in of:
        if name not in ALL:
            raise InputError(f"of: unknown result {brief(name)}.{did_you_mean(name, ALL)}")
        for kind in (FORWARD, INVERSE) if forward else (INVERSE, FORWARD):
            if name in kind.of:
                break
        else:
            kind = next(kind for kind in (PLACES, READINGS, MODES) if name in kind.of)
        groups.setdefault(kind, []).append(name)
    for kind, names in groups.items():
        missing = [n for n in kind.needs if given.get(n) is None]
        if missing:
            raise InputError(
                f"derivatives of {', '.join(names)} take {', '.join(kind.needs)}; missing: "
                f"{', '.join(missing)}"
            )
    return [(kind, tuple(names)) for kind, names in groups.items()]


def names_of(given: Any, what: str) -> tuple[str, ...]:
    names = (given,) if isinstance(given, str) else given
    if (
        not isinstance(names, list | tuple)
        or not names
        or not all(isinstance(n, str) for n in names)
    ):
        raise InputError(f"{what}: expected names, got {brief(given)}")
    return tuple(dict.fromkeys(names))


def _fitting(what: str, given: Any, shape: tuple[int, ...]) -> Array:
    """As doubles of a shape, or what broadcasts to it.

    Raises: InputError: for anything else.
    """
    values = as_doubles(given, what)
    try:
        return np.broadcast_to(values, shape)
    except ValueError:
        raise InputError(f"{what}: expected numbers of shape {shape}, got {values.shape}") from None


def _split(by: str, a: Array) -> Arrays:
    """Slopes by port."""
    return {"force": a[:, :3], "moment": a[:, 3:]} if by == "wrench" else {PORTS[by][0]: a}


def _worse(one: Array, other: Array) -> Array:
    """Statuses of both: what failed comes before a kink."""
    kink = one == Status.kink
    return np.where((one == Status.ok) | (kink & (other != Status.ok)), other, one)


def _columns(a: Array, of_lanes: bool, by_lanes: bool) -> Array:
    """Results by a port, as `slopes` has them, as (N, rows, size)."""
    if by_lanes:
        a = a[..., 0, :, :]  # chains are the port's
    elif of_lanes:
        a = np.moveaxis(a, -3, -2)
    return samples_first(a.reshape(-1, *a.shape[-2:]))
