"""The fastest traversal of a path: time as a function of place, within all limits.

Along a path q(u), with h = u'^2 and a = u'', the state is q' = q_u sqrt(h), q'' = q_u a + q_uu h,
so forces are linear in a and, but for viscous losses, in h; and a = h_u / 2. Between nodes h is
linear in u; at both ends of each interval efforts and limited contact forces are variables:

    J^T effort + N lambda = Q(h, a),    efforts, loads, speeds, accelerations within limits.

The time, sum of 2 Du / (sqrt(h_i) + sqrt(h_i+1)), is convex in h: linear programs (HiGHS) whose
cost is its slope at the last solution, and whose Q is linear about it, lead to the least one (the
convex form: Verscheure, Demeulenaere, Swevers, De Schutter and Diehl, IEEE Trans. Automatic Control
54 (2009)). The limits' multipliers say what binds where.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ..errors import CondyleError, InputError, UnsupportedError
from ..mechanism.chain import limits, require_fixed_limits
from ..model.model import Model
from ..motion import Load, Motion
from .path_limits import Held, TraversalLimits, forces

DENSE = 20  # samples an interval, from which the path's length is taken
STILL = 1e-3  # of the largest speed, below which a motion rests
FASTEST = 1e12  # u'^2 where nothing limits it
SETTLED = 1e-6  # of the time, between two linear programs
PROGRAMS = 25
HOLDS = 1e-7  # of the limits, by which a state at rest may exceed them
BINDS = 1e-7  # of the largest multiplier


@dataclass(frozen=True)
class Traversal:
    """A traversal of a path: at u[i] at t[i], in the path's own measure, with rate[i] = du/dt.

    place: the motion's columns at u, (N, columns);  binds: limits that bind, of each interval.
    """

    t: np.ndarray
    u: np.ndarray
    rate: np.ndarray
    place: Callable[[np.ndarray], np.ndarray]
    binds: tuple[tuple[str, ...], ...]

    @property
    def duration(self) -> float:
        return float(self.t[-1])

    def at(self, t: np.ndarray) -> np.ndarray:
        """u at times from 0 to the duration: accelerations are even between nodes."""
        i = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        since, whole = t - self.t[i], np.maximum(self.t[i + 1] - self.t[i], 1e-300)
        rise = (self.rate[i + 1] - self.rate[i]) / whole
        return self.u[i] + since * (self.rate[i] + 0.5 * since * rise)

    def segments(self) -> tuple[tuple[float, float, tuple[str, ...]], ...]:
        """Intervals in which the same limits bind [s]."""
        joined: list[tuple[float, float, tuple[str, ...]]] = []
        for start, end, names in zip(self.t[:-1], self.t[1:], self.binds, strict=True):
            if joined and joined[-1][2] == names:
                joined[-1] = (joined[-1][0], float(end), names)
            else:
                joined.append((float(start), float(end), names))
        return tuple(joined)


class Planner:
    """Fastest traversals of a motion's path, from rest to rest or as an endless cycle.

    Where the motion rests on its way, a traversal comes to rest as well.

    Args:   motion: the path; its own times only say where on it one is.
            load: in the motion's own time;  at: its point in {M}, (3,).
            closed: end and beginning are one place, passed without stopping.
    Raises: InputError: for a path that is not closed, or that nothing limits, or that no
            efforts within limits hold even at rest; UnsupportedError: for muscles and contacts
            with friction.
    """

    def __init__(
        self,
        model: Model,
        motion: Motion,
        bounds: TraversalLimits,
        load: Load | None = None,
        at: Any = None,
        *,
        closed: bool = False,
        intervals: int = 400,
    ) -> None:
        machine = model.mechanism
        require_fixed_limits(machine.chains, "the fastest path", machine.enabled_walls)
        if rough := [c.name for c in machine.contacts if c.friction.coefficient]:
            raise UnsupportedError(
                f"the fastest path: contact {rough[0]} has friction; set its coefficient to 0"
            )
        if closed:
            _check_closed(motion)
        self.bounds: TraversalLimits = bounds
        self.closed: bool = closed
        self.path: _Path = _Path.of(model, motion, intervals, load, at)
        self.program: _Program = _Program(self.path, bounds, closed)
        self.nodes: int = len(self.path.u)
        self._h = np.ones(self.nodes)

    def traversal(self, room: np.ndarray | None = None) -> Traversal:
        """The fastest, with a part `room` (nodes,) of what rest leaves of every limit; all of it
        by default."""
        path, h, duration = self.path, self._h, np.inf
        for _ in range(PROGRAMS):
            h, binds = self.program.solve(h, np.ones(self.nodes) if room is None else room)
            if np.median(h) > 0.5 * FASTEST:
                raise InputError(
                    "the fastest path: nothing limits it; expected limits of efforts or speeds"
                )
            root = np.sqrt(h)
            with np.errstate(invalid="ignore"):
                each = np.where(path.step > 0, 2 * path.step / (root[1:] + root[:-1]), 0.0)
            t = np.concatenate([[0.0], np.cumsum(each)])
            last, duration = duration, t[-1]
            if abs(duration - last) <= SETTLED * duration:
                break
        self._h = h
        return Traversal(t, path.u, root, path.place, binds)


@dataclass(frozen=True)
class _Path:
    """A path at nodes along its length u; columns are weighed by their greatest speeds.

    s: the motion's own time there;  place: the motion's columns at any u;  step: between nodes;
    rests: nodes where the motion does;  given_u, given_uu: of its columns;  at: the load's point.
    """

    model: Model
    s: np.ndarray
    u: np.ndarray
    rests: np.ndarray
    place: Callable[[np.ndarray], np.ndarray]
    names: tuple[str, ...]
    given_u: np.ndarray
    given_uu: np.ndarray
    q: np.ndarray
    q_u: np.ndarray
    q_uu: np.ndarray
    wrench: np.ndarray
    at: Any

    @property
    def step(self) -> np.ndarray:
        return np.diff(self.u)

    @classmethod
    def of(cls, model: Model, motion: Motion, count: int, load: Load | None, at: Any) -> _Path:
        dense = at_times(motion, np.linspace(motion.t[0], motion.t[-1], DENSE * count + 1))
        size = np.abs(dense.rate).max(axis=0)
        if not size.any():
            raise InputError("the fastest path: the motion stands still")
        weight = np.divide(1.0, size, where=size > 0, out=np.zeros_like(size))
        speed = np.sqrt(((dense.rate * weight) ** 2).mean(axis=1))
        moves = speed > STILL * speed.max()
        steps = 0.5 * (speed[1:] + speed[:-1]) * np.diff(dense.t) * (moves[1:] & moves[:-1])
        length = np.concatenate([[0.0], np.cumsum(steps)])
        s, u, rests = _nodes(dense.t, speed, length, moves, count)
        here = at_times(motion, s)
        (q, v, a), _ = model.poses.of_motion(here)
        g = np.sqrt(((here.rate * weight) ** 2).mean(axis=1, keepdims=True))
        g1 = (here.rate * here.acceleration * weight**2).mean(axis=1, keepdims=True) / g
        own, own2 = here.rate / g, (here.acceleration - here.rate * g1 / g) / g**2
        wrench = np.zeros((len(s), 6)) if load is None else load.at(s)
        some = np.flatnonzero(moves)
        some = some[np.diff(length[some], prepend=-1.0) > 0]
        place = CubicHermiteSpline(
            length[some], dense.value[some], dense.rate[some] / speed[some, None]
        )
        return cls(
            model, s, u, rests, place, here.names, own, own2,
            q, v / g, (a - v * g1 / g) / g**2, wrench, at,
        )  # fmt: skip

    def forces(self, h: np.ndarray, a: float) -> dict[str, np.ndarray]:
        """Forces as of `path_limits.forces`, at the nodes."""
        v = self.q_u * np.sqrt(h)[:, None]
        state = self.q, v, self.q_u * a + self.q_uu * h[:, None]
        return forces(self.model, state, self.wrench, self.at)


def _nodes(
    t: np.ndarray, speed: np.ndarray, length: np.ndarray, moves: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times of nodes, evenly along every part between two rests; their lengths; which are rests.

    A node at a rest looks at the path where it just moves, and so has its direction; parts have
    a node of their own at each end, at no distance from their neighbour's.
    """
    edges = np.flatnonzero(np.diff(moves.astype(int), prepend=0, append=0))
    parts = []
    for first, end in edges.reshape(-1, 2):
        last = end - 1
        part = length[last] - length[first]
        pieces = max(round(count * part / length[-1]), 4)
        u = np.linspace(length[first], length[last], pieces + 1)
        own = slice(first, end)
        s = np.interp(u, length[own], t[own])
        exact = CubicHermiteSpline(t[own], length[own], speed[own])(s)
        exact[[0, -1]] = u[[0, -1]]
        parts.append((s, exact, np.isin(np.arange(pieces + 1), (0, pieces))))
    s, u, rests = (np.concatenate(one) for one in zip(*parts, strict=True))
    rests[0], rests[-1] = (not moves[i] for i in (0, -1))
    return s, u, rests


def at_times(motion: Motion, times: np.ndarray) -> Motion:
    """A motion at times of its own, by the spline through its samples."""
    return Motion.from_arrays(
        motion.t, motion.value, motion.names, landmark=motion.landmark, times=times, source="path"
    )


def _check_closed(motion: Motion) -> None:
    for what in (motion.value, motion.rate):
        size, gap = np.ptp(what, axis=0).max(), np.abs(what[-1] - what[0]).max()
        if gap > 1e-3 * size:
            raise InputError(
                "the fastest path: expected a closed path, whose end is its beginning and goes on "
                f"the same way; got ends {gap:.3g} apart"
            )


class _Program:
    """The linear program about a traversal.

    Its variables are h at the nodes; then, at both ends of every interval, the efforts and the
    contact forces that are limited. Other contact forces drop out of the balance.
    """

    def __init__(self, path: _Path, bounds: TraversalLimits, closed: bool) -> None:
        from scipy import sparse

        self.path, self.bounds, self.closed = path, bounds, closed
        self.machine = path.model.mechanism
        N = len(path.q) - 1
        nodes = sparse.eye_array(N + 1, format="csr")
        apart = np.flatnonzero(path.step > 0)  # between two rests there is no distance
        self.place = np.concatenate([apart, apart + 1])
        self.here = nodes[self.place]
        rise = sparse.diags_array(0.5 / path.step[apart]) @ (nodes[apart + 1] - nodes[apart])
        self.rise = sparse.vstack([rise, rise], format="csr")
        self.held = Held.of(path.model, bounds)
        self.rest = self.held.needed(path.forces(np.zeros(N + 1), 0.0))[0]
        if (self.rest > bounds.share + HOLDS).any():
            raise self._held_nowhere()

    def _speeds(self, share: np.ndarray) -> tuple[np.ndarray, list[str]]:
        """The greatest h at each node that speeds permit, and whose speed that is."""
        path = self.path
        joint_rate = path.forces(np.ones(len(path.q)), 0.0)["joint_rate"]
        rates = [
            (c.name, limits(c).speed, joint_rate[:, i]) for i, c in enumerate(self.machine.chains)
        ]
        rates += [
            (name, own, path.given_u[:, path.names.index(name)])
            for name, own in self.bounds.speed.items()
        ]
        with np.errstate(divide="ignore"):
            most = np.array([(share * own / np.abs(rate)) ** 2 for _, own, rate in rates])
        who = [f"speed of {rates[i][0]}" for i in np.argmin(most, axis=0)]
        return np.where(path.rests, 0.0, np.minimum(most.min(axis=0), FASTEST)), who

    def _balance(self, last: np.ndarray) -> tuple[np.ndarray, ...]:
        """Rows of the balance at the nodes: of variables, (N + 1, r, c), h and a, and the rest."""
        path = self.path
        h = np.maximum(last, 1e-6 * last.max())
        at = path.forces(h, 0.0)
        by_a = path.forces(h, 1.0)["Q"] - at["Q"]
        by_h = (path.forces(1.001 * h, 0.0)["Q"] - at["Q"]) / (0.001 * h)[:, None]
        rest = at["Q"] - by_h * h[:, None]
        return self.held.balance(at, [by_h, by_a, rest])

    def solve(
        self, last: np.ndarray, room: np.ndarray
    ) -> tuple[np.ndarray, tuple[tuple[str, ...], ...]]:
        """h at the nodes that is best about `last`, and what binds in each interval.

        Args: room: part of what rest leaves of each limit, at the nodes.
        """
        from scipy import sparse
        from scipy.optimize import linprog

        N, place = len(self.path.q) - 1, self.place
        both = len(place)
        held, by_h, by_a, rest = (x[place] for x in self._balance(last))
        share = self.bounds.share
        low, high = self.held.at(self.rest + (share - self.rest) * room)
        most, fast = self._speeds(share * room)
        if not self.closed:
            most[[0, -1]] = 0.0

        def linear(of_h: np.ndarray, of_a: np.ndarray) -> Any:
            """Rows (2 I r, N + 1) of what is linear in h and a, factors (2 I, r) each."""
            rows, each = of_h.size, np.repeat(np.arange(both), of_h.shape[1])
            spread = [
                sparse.csr_array((x.ravel(), (np.arange(rows), each)), shape=(rows, both))
                for x in (of_h, of_a)
            ]
            return spread[0] @ self.here + spread[1] @ self.rise

        width = both * len(self.held.labels)
        equal = [sparse.hstack([-linear(by_h, by_a), sparse.block_diag(list(held))])]
        right = [rest.ravel()]
        if self.closed:
            ends = sparse.csr_array(([1.0, -1.0], ([0, 0], [0, N])), shape=(1, N + 1 + width))
            equal, right = [*equal, ends], [*right, np.zeros(1)]
        names = [*self.bounds.acceleration]
        upper = greatest = None
        if names:
            at = [self.path.names.index(name) for name in names]
            size = np.outer((share * room)[place], [*self.bounds.acceleration.values()])
            rows = linear(
                self.path.given_uu[place][:, at] / size, self.path.given_u[place][:, at] / size
            )
            rows = sparse.hstack([rows, sparse.csr_array((rows.shape[0], width))])
            upper, greatest = sparse.vstack([rows, -rows]), np.ones(2 * rows.shape[0])
        optimum = linprog(  # type: ignore[call-overload]
            np.concatenate([_slope(self.path.step, last), np.zeros(width)]),
            upper, greatest, sparse.vstack(equal, format="csr"), np.concatenate(right),
            np.column_stack([
                np.concatenate([np.zeros(N + 1), low[place].ravel()]),
                np.concatenate([most, high[place].ravel()]),
            ]),
            method="highs",
        )  # fmt: skip
        if optimum.status == 2:
            raise self._held_nowhere()
        if optimum.x is None:
            raise CondyleError(f"the linear program of the fastest path: {optimum.message}")
        multiplier = np.maximum(np.abs(optimum.lower.marginals), np.abs(optimum.upper.marginals))
        own = multiplier[N + 1 :].reshape(both, -1) * np.abs(optimum.x[N + 1 :].reshape(both, -1))
        if names:
            pulled = np.abs(optimum.ineqlin.marginals).reshape(2, both, len(names)).sum(axis=0)
            own = np.hstack([own, pulled])
        own = own[: both // 2] + own[both // 2 :]
        speed = multiplier[: N + 1] * optimum.x[: N + 1]
        whole = np.zeros((N, own.shape[1] + 1))
        whole[place[: both // 2], :-1], whole[:, -1] = own, speed[1:]
        labels = [*self.held.labels, *(f"acceleration of {name}" for name in names)]
        tight = whole > BINDS * whole.max(initial=1e-300)
        binds = tuple(
            tuple((labels[j] if j < len(labels) else fast[i + 1]) for j in np.flatnonzero(row))
            for i, row in enumerate(tight)
        )
        return np.maximum(optimum.x[: N + 1], 0.0), binds

    def _held_nowhere(self) -> CondyleError:
        """Says where along the path nothing holds it, even at rest."""
        bad = np.flatnonzero(self.rest > self.bounds.share + HOLDS)
        where = f"at {self.path.s[bad[0]]:.4g} s of its own time" if len(bad) else "on its way"
        return InputError(
            f"the fastest path: no efforts and loads within {self.bounds.share:.0%} of their "
            f"limits hold it {where}, even at rest; raise limits or share, or leave out loads"
        )


def _slope(step: np.ndarray, h: np.ndarray) -> np.ndarray:
    """The slope of the time by h at the nodes, scaled."""
    root = np.sqrt(np.maximum(h, 1e-6 * h.max()))
    pair = step / (root[1:] + root[:-1]) ** 2
    slope = np.zeros(len(h))
    slope[1:] -= pair / root[1:]
    slope[:-1] -= pair / root[:-1]
    return slope / np.abs(slope).max()
