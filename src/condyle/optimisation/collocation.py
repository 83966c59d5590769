"""A cycle that costs least, by direct collocation of periodic splines.

    q(s) = sum_j c_j B_j(s),    B_j quintic, one a node, knots at the nodes,    s = t / period

The independent coordinates have no equations of closure, so c is all that is unknown, with the
period where it is free and activations where there are muscles (`activation`). At the nodes the
mechanism has outputs y(z), z = (q, q', q'', activations): efforts, contact forces, the singularity
ratio, places of the contacts. With slopes that are exact and curvature by their differences, IPOPT
solves

    minimise  mean of sum w y^2 + c^T P c / 2 - p^T c (+ w s + w period),
    low <= y <= high (or |y| <= s), points and bounds of q, dynamics of activation.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np

from ..errors import InputError
from ..model.model import Model
from ..motion.spline import basis
from ..status import Status
from .activation import Activation
from .point_paths import Track

Array = np.ndarray
DEGREE = 5  # acceleration is twice differentiable
STEPS = (1e-6, 1e-3, 1e-1)  # of q, v, a [SI], for curvature by differences of exact slopes
FINER = (1e-6, 1e-5, 1e-1)  # where there are muscles, whose force bends with their speed
UNMET = 1e-9  # violation that counts as none, relative to the limit; of points, in m or rad
ACCURACY = 1e-9  # of optimality, by IPOPT's scaled measure
DYNAMIC = ("effort", "contact_force")
ACTIVATED = ("activation", "balance")  # and contact_force, where there are muscles
LEAST = 1e-8  # cost that is scaled to one: less is rounding
NEARLY = 1e-6  # the barrier's first parameter where a start is nearly the end


@dataclass(frozen=True)
class NodeOutputs:
    """Outputs of a node, (r,) of them, over their scale.

    of: as `Model.derivatives` names them;  names: in words;  low, high: limits over the scale;
    weight: of the mean square in the cost;  peak: of the largest magnitude at any node.
    """

    of: str
    names: tuple[str, ...]
    scale: Array
    low: Array
    high: Array
    weight: float = 0.0
    peak: float = 0.0


@dataclass(frozen=True)
class QuadraticCost:
    """c^T P c / 2 - p^T c + constant, of splines with weights of their own."""

    P: Array
    p: Array
    constant: float


@dataclass(frozen=True, eq=False)
class Cycle:
    """A periodic motion that costs least, at its nodes.

    t: (N,) [s], from 0, the period's end left out;  q, v, a: (N, m);
    outputs: measure -> (N, r), over its scale, of muscles excitation too;
    cost, first_cost: of it, and of the start;
    violation: largest of all constraints;  binds: (name, when [s]) where limits hold it;
    coefficients: (N, m), of its splines;  evaluations: of the outputs at all nodes;
    status: IPOPT's word;  period: [s];  multipliers: IPOPT's, of unknowns and of rows.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    outputs: dict[str, Array]
    cost: float
    first_cost: float
    violation: float
    binds: tuple[tuple[str, float], ...]
    coefficients: Array
    iterations: int
    evaluations: int
    seconds: float
    status: str
    period: float
    multipliers: tuple[Array, Array] = field(repr=False)


@dataclass(frozen=True)
class Iterate:
    """Where outputs are asked for: coefficients (N m,), activations (N, n), period over the
    greatest."""

    c: Array
    w: Array
    share: float = 1.0

    def same(self, other: Iterate | None) -> bool:
        return other is not None and self.share == other.share and bool(
            np.array_equal(self.c, other.c) and np.array_equal(self.w, other.w)
        )  # fmt: skip


@dataclass
class Collocation:
    """Outputs of a mechanism, with their slopes and curvature by each node's own unknowns.

    Those are, u of them: coefficients whose splines are not zero there, (P, m), activations (n,)
    and the period over the greatest, `period`, if it is free.
    """

    model: Model
    period: float
    N: int
    measures: tuple[NodeOutputs, ...]
    activation: Activation | None = None
    least_period: float | None = None
    wrench: Array | None = None  # (N, 6), of a load
    at: Array | None = None
    tracks: Mapping[str, Track] = field(default_factory=dict)  # of measures, by `of`
    evaluations: int = 0
    _outputs_at: tuple[Iterate, Array] | None = field(default=None, repr=False)
    _slopes_at: tuple[Iterate, Array] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        self.m: int = len(self.model.independent)
        self.n: int = 0 if self.activation is None else self.activation.n
        self.free: bool = self.least_period is not None
        self.scale: Array = np.concatenate([measure.scale for measure in self.measures])
        self.r: int = len(self.scale)
        self.weight: Array = np.concatenate(
            [np.full(len(x.scale), x.weight) for x in self.measures]
        )
        self.names: list[str] = [name for measure in self.measures for name in measure.names]
        self.t: Array = np.arange(self.N) * (self.period / self.N)
        self.B = np.stack([self.rows(self.t, nu) for nu in range(3)])  # (3, N, N)
        # nodes are even: each has the splines of the first one, further on
        first = np.flatnonzero(np.abs(self.B[:, 0]).max(axis=0))
        self.near: Array = (first + np.arange(self.N)[:, None]) % self.N  # (N, P)
        self.W = self.B[:, 0, first]  # (3, P)
        moving = len(first) * self.m
        self.d: int = 3 * self.m + self.n
        self.u: int = moving + self.n + self.free
        self.mask: Array = np.zeros((self.r, self.u), bool)  # which outputs have which unknowns
        row = 0
        for measure in self.measures:
            rows = slice(row, row := row + len(measure.scale))
            self.mask[rows, :moving] = measure.of != "activation"
            if measure.of == "activation":
                self.mask[rows, moving : moving + self.n] = np.eye(self.n, dtype=bool)
            elif self.activation is not None and measure.of in ("balance", "contact_force"):
                self.mask[rows, moving : moving + self.n] = True
            if self.free and measure.of in (*DYNAMIC, "balance"):
                self.mask[rows, -1] = True
        squared = self.mask[self.weight > 0]
        # Activations are linear, but for squares.
        self.curved: Array = np.ones((self.u, self.u), bool)
        own = slice(moving, moving + self.n)
        self.curved[own, own] = squared[:, own].T.astype(int) @ squared[:, own].astype(int) > 0

    def rows(self, t: Array, nu: int = 0) -> Array:
        """Matrix of the derivative of order `nu` at times (K,) in coefficients, (K, N)."""
        h = self.period / self.N
        knots = h * np.arange(-DEGREE, self.N + DEGREE + 1)
        first, values = basis(knots, np.mod(t, self.period), DEGREE, nu)
        matrix: Array = np.zeros((len(t), self.N))
        for j in range(DEGREE + 1):
            np.add.at(matrix, (np.arange(len(t)), (first + j) % self.N), values[:, j])
        matrix[np.abs(matrix) < 1e-13 * np.abs(matrix).max()] = 0.0
        return matrix

    def states(self, x: Iterate) -> Array:
        """q, v, a at the nodes, (3, N, m)."""
        slower = x.share ** -np.arange(3.0)[:, None, None]
        found: Array = slower * (self.B @ x.c.reshape(self.N, self.m))
        return found

    def outputs(self, x: Iterate) -> Array:
        """y over its scale, (N, r), NaN where there is none."""
        if self._outputs_at is None or not x.same(self._outputs_at[0]):
            self.evaluations += 1
            q, v, a = self.states(x)
            self._outputs_at = x, self._outputs(q, v, a, x.w) / self.scale
        return self._outputs_at[1]

    def _outputs(self, q: Array, v: Array, a: Array, w: Array) -> Array:
        of, values = {measure.of for measure in self.measures}, dict[str, Array]()
        bad, dynamic = np.zeros(len(q), bool), of & {*DYNAMIC}
        if self.activation is not None:
            values, sure = self.activation.outputs(q, v, a, w, self.wrench, self.at)
            bad, dynamic = ~sure, set()
        if dynamic:
            solved: Any = self.model.inverse_dynamics(q, v, a, self.wrench, self.at)
            values |= {name: getattr(solved, name) for name in dynamic}
            bad |= np.asarray(solved.status) != Status.ok
        if still := of - {*values} - dynamic:
            solution: Any = self.model.inverse_kinematics(q)
            for name in still:
                if name in self.tracks:
                    values[name] = self.tracks[name].outputs(solution.pose)
                else:
                    ratio = name == "singularity_ratio"
                    values[name] = solution.singularity.ratio if ratio else getattr(solution, name)
            bad |= np.asarray(solution.status) != Status.ok
        parts = [values[measure.of].reshape(len(q), -1) for measure in self.measures]
        return np.where(bad[:, None], np.nan, np.hstack(parts))

    def slopes(self, x: Iterate) -> Array:
        """Slopes of y over its scale by z, (N, r, d)."""
        if self._slopes_at is None or not x.same(self._slopes_at[0]):
            self._slopes_at = x, self._slopes(self.states(x), x.w)
        return self._slopes_at[1]

    def _slopes(self, z: Array, w: Array) -> Array:
        """The same of states (3, ..., N, m), (..., N, r, d)."""
        of = [measure.of for measure in self.measures]
        lead, by = z.shape[1:-1], ("q", "v", "a")
        slopes: dict[tuple[str, str], Array] = {}
        load: Any = {} if self.wrench is None else {"wrench": self.wrench, "at": self.at}
        if self.activation is not None:
            slopes = self.activation.slopes(z, w, self.wrench, self.at)
        elif dynamic := tuple(name for name in of if name in DYNAMIC):
            moved = self.model.derivatives(
                dynamic, by, q=z[0], v=z[1], a=z[2], zeros=True, **load
            )  # fmt: skip
            slopes = dict(moved)
        known = {name for name, _ in slopes}
        still = [name for name in of if name not in known and name not in self.tracks]
        if still or self.tracks:
            of_places = (*still, *["pose"] * bool(self.tracks))
            slopes |= dict(self.model.derivatives(of_places, ("q",), q=z[0], zeros=True))
        if self.tracks:
            pose = self.model.inverse_kinematics(z[0]).pose
            by_q = slopes["pose", "q"]
            slopes |= {(n, "q"): measure.slopes(pose, by_q) for n, measure in self.tracks.items()}
        parts = []
        for measure in self.measures:
            part = np.zeros((*lead, len(measure.scale), self.d))
            for k, wrt in enumerate((*by, "w")):
                if (measure.of, wrt) in slopes:
                    own = slice(k * self.m, (k + 1) * self.m if wrt != "w" else self.d)
                    part[..., own] = slopes[measure.of, wrt].reshape(*part[..., own].shape)
            parts.append(part)
        return np.concatenate(parts, axis=-2) / self.scale[:, None]

    def _by_own(self, x: Iterate) -> Array:
        """Slopes of z by each node's own unknowns, (N, d, u)."""
        slower, m = x.share ** -np.arange(3.0)[:, None], self.m
        moved = np.einsum("kp,ab->kapb", slower * self.W, np.eye(m)).reshape(3 * m, -1)
        blocks = np.zeros((self.N, self.d, self.u))
        blocks[:, : 3 * m, : moved.shape[1]] = moved
        blocks[:, 3 * m :, moved.shape[1] : moved.shape[1] + self.n] = np.eye(self.n)
        if self.free:
            rates = -np.arange(3)[:, None, None] / x.share * self.states(x)
            blocks[:, : 3 * m, -1] = rates.transpose(1, 0, 2).reshape(self.N, -1)
        return blocks

    def jacobian(self, x: Iterate) -> Array:
        """Slopes of y over its scale by each node's own unknowns, (N, r, u)."""
        return self.slopes(x) @ self._by_own(x)

    def cost(self, x: Iterate) -> float:
        """The cost of the outputs' squares alone."""
        return float(np.sum(self.weight * self.outputs(x) ** 2) / self.N)

    def gradient(self, x: Iterate) -> Array:
        """The gradient of the cost, (N, u): sums over nodes are the slopes."""
        weighted = 2 / self.N * self.weight * self.outputs(x)
        found: Array = (weighted[:, None] @ self.jacobian(x))[:, 0]
        return found

    def hessian(self, x: Iterate, of_cost: float, of_outputs: Array) -> Array:
        """Hessian of of_cost times the cost + of_outputs (N, r) . y over its scale, (N, u, u)."""
        D, Z, m = self.slopes(x), self._by_own(x), self.m
        weights = 2 * of_cost / self.N * self.weight * self.outputs(x) + of_outputs
        z, size = self.states(x), 3 * m
        moved = np.repeat(z[:, None, None], 2, axis=1).repeat(size, axis=2)  # (3, 2, 3m, N, m)
        steps = np.repeat(STEPS if self.activation is None else FINER, m)
        for i in range(size):
            k, column = divmod(i, m)
            moved[k, 0, i, :, column] += steps[i]
            moved[k, 1, i, :, column] -= steps[i]
        slopes = weights[:, None] @ self._slopes(moved, x.w)  # (2, 3m, N, 1, d)
        rows = ((slopes[0] - slopes[1])[:, :, 0] / (2 * steps[:, None, None])).transpose(1, 0, 2)
        H = 2 * of_cost / self.N * np.swapaxes(D, 1, 2) @ (self.weight[:, None] * D)
        H[:, :size, :size] += (rows[..., :size] + np.swapaxes(rows[..., :size], 1, 2)) / 2
        H[:, :size, size:] += rows[..., size:]
        H[:, size:, :size] += np.swapaxes(rows[..., size:], 1, 2)
        blocks: Array = np.swapaxes(Z, 1, 2) @ H @ Z
        if self.free:  # z is no linear function of the period
            g = (weights[:, None] @ D)[:, 0, :size].reshape(self.N, 3, m)
            orders = np.arange(3.0)
            slower = -orders * x.share ** (-orders - 1)
            moved_both = np.einsum("k,kp,nka->npa", slower, self.W, g)
            both = moved_both.reshape(self.N, -1)
            blocks[:, : both.shape[1], -1] += both
            blocks[:, -1, : both.shape[1]] += both
            twice = orders * (orders + 1) / x.share**2
            blocks[:, -1, -1] += np.einsum("k,kna,nka->n", twice, z, g)
        return blocks


@dataclass(frozen=True, eq=False)
class Wanted:
    """What a cycle passes and keeps, beside the outputs' limits.

    times: (K,) [s], of the greatest period;  points: (K, m), NaN where free;
    box: (m, 2), bounds of q;  time: weight of the period over the greatest.
    """

    times: Array
    points: Array
    box: Array
    time: float = 0.0


@dataclass(frozen=True, eq=False)
class InitialGuess:
    """Where a search begins: coefficients (N, m), and what an earlier result knew."""

    coefficients: Array
    activation: Array | None = None
    excitation: Array | None = None
    period: float | None = None
    multipliers: tuple[Array, Array] | None = None


def cheapest_cycle(
    problem: Collocation,
    wanted: Wanted,
    quadratic: QuadraticCost | None = None,
    *,
    start: InitialGuess | None = None,
    steps: int = 200,
) -> Cycle:
    """The periodic motion through points that costs least, within limits at the nodes.

    Args:   quadratic: a further cost, of the coefficients alone.
            start: None: the curve of least acceleration through the points.
            steps: most iterations of IPOPT.
    Raises: InputError: for a start where the mechanism has no outputs, and where no motion meets
            the constraints, with the one that is missed most.
    """
    began = time.perf_counter()
    held = np.isfinite(wanted.points)
    at = np.kron(problem.rows(wanted.times), np.eye(problem.m))[held.ravel()]
    target = wanted.points[held]
    first = InitialGuess(_start(problem, at, target)) if start is None else start
    x = _begun(problem, first)
    if not np.isfinite(problem.outputs(x)).all():
        i = int(np.argmax(~np.isfinite(problem.outputs(x)).all(axis=1)))
        raise InputError(
            f"the start has no efforts at t = {problem.t[i]:.6g} s: the mechanism does not reach "
            "it, or is singular there. Move the poses nearer to home, or give another start"
        )
    solver = _Solver(problem, at, target, wanted, quadratic)
    x0 = solver.all_unknowns(x, first.excitation)
    first_cost = solver.cost(x0)
    best, known, iterations, status = solver.solved(x0, steps, first if start else None)
    x = solver.point(best)
    if solver.peak:
        best[-1] = solver.highest(x)
    misses, when = solver.misses(best)
    violation = max(float(misses.max(initial=0.0)), 0.0)
    if not violation <= UNMET or status not in ("Solve_Succeeded", "Solved_To_Acceptable_Level"):
        worst = int(np.argmax(misses))
        reason = f"missed most is {solver.names[worst]}"
        reason += f" at t = {when[worst]:.4g} s, by {misses[worst]:.2g}"
        if violation <= UNMET:
            reason = "constraints are met, but the cost has not settled; raise steps"
        raise InputError(f"no cheapest cycle after {iterations} iterations ({status}): {reason}")
    tight = np.flatnonzero(misses > -1e-6)
    binds = tuple((solver.names[i], float(when[i])) for i in tight if solver.limits[i])
    q, v, a = problem.states(x)
    y, ends = problem.outputs(x), np.cumsum([len(one.scale) for one in problem.measures])
    of = [one.of for one in problem.measures]
    outputs = dict(zip(of, np.split(y, ends[:-1], axis=1), strict=True))
    if problem.activation is not None:
        outputs["excitation"] = problem.activation.spread(solver.excitation(best))
    return Cycle(
        *(problem.t * x.share, q, v, a, outputs, solver.cost(best), first_cost, violation),
        *(binds, x.c.reshape(problem.N, problem.m), iterations, problem.evaluations),
        *(time.perf_counter() - began, status, problem.period * x.share, known),
    )


def through(problem: Collocation, q: Array) -> Array:
    """Coefficients of the splines through q (N, m) at the nodes."""
    found: Array = np.linalg.solve(problem.B[0], q)
    return found


def _start(problem: Collocation, at: Array, target: Array) -> Array:
    """Coefficients of the curve of least acceleration through the points."""
    bent = np.kron(problem.B[2].T @ problem.B[2], np.eye(problem.m))
    bent /= np.abs(bent).max()
    size, K = len(bent), len(at)
    KKT = np.block([[bent, at.T], [at, np.zeros((K, K))]])
    found = np.linalg.lstsq(KKT, np.concatenate([np.zeros(size), target]), rcond=None)[0]
    first: Array = found[:size].reshape(problem.N, problem.m)
    return first


def _begun(problem: Collocation, start: InitialGuess) -> Iterate:
    """The start as the problem has it; activations that balance it nearly, if it has none."""
    least = 0.0 if problem.least_period is None else problem.least_period / problem.period
    share = 1.0
    if problem.free and start.period is not None:
        share = min(max(start.period / problem.period, least), 1.0)
    none = np.zeros((problem.N, problem.n))
    x = Iterate(np.asarray(start.coefficients, float).ravel(), none, share)
    if problem.activation is None:
        return x
    w = start.activation
    if w is None:
        q, v, a = problem.states(x)
        w = problem.activation.balancing(q, v, a, problem.wrench, problem.at)
    return replace(x, w=w)


class _Solver:
    """The program as IPOPT has it: unknowns are c, activations and excitations, the period over
    the greatest where it is free, and s where a peak costs.

    Rows: outputs with limits, |y| <= s, bounds of q, points, dynamics of activation.
    """

    def __init__(
        self,
        problem: Collocation,
        at: Array,
        target: Array,
        wanted: Wanted,
        quadratic: QuadraticCost | None,
    ) -> None:
        self.problem, self.quadratic, p = problem, quadratic, problem
        self.acts, N, r, m, n = p.activation, p.N, p.r, p.m, p.n
        M = 0 if self.acts is None else len(self.acts.mine)
        peak = np.concatenate([np.full(len(x.scale), x.peak) for x in p.measures])
        self.peak = float(peak.max(initial=0.0))
        # unknowns
        self.ends = np.cumsum([N * m, N * n, N * M, p.free, bool(self.peak)])
        self.size = int(self.ends[-1])
        self.lower, self.upper = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        parts = [(p.near[..., None] * m + np.arange(m)).reshape(N, -1)]
        parts.append(self.ends[0] + np.arange(N * n).reshape(N, n))
        if p.least_period is not None:
            parts.append(np.full((N, 1), self.ends[2]))
            self.lower[self.ends[2]], self.upper[self.ends[2]] = p.least_period / p.period, 1.0
        self.columns = np.hstack(parts)  # of each node's own unknowns, (N, u)
        if self.acts is not None:
            between = slice(self.ends[0], self.ends[1])
            self.lower[between] = np.tile(self.acts.low, N)
            self.upper[between] = np.tile(self.acts.high, N)
            self.lower[self.ends[1] : self.ends[2]], self.upper[self.ends[1] : self.ends[2]] = 0, 1
        self.linear_cost = np.zeros(self.size)
        if p.free:
            self.linear_cost[self.ends[2]] = wanted.time
        if self.peak:
            self.linear_cost[-1] = self.peak
        self.constant = 0.0 if p.free else wanted.time
        # rows
        low = np.concatenate([one.low for one in p.measures])
        high = np.concatenate([one.high for one in p.measures])
        self.limited = np.flatnonzero(np.tile(np.isfinite(low) | np.isfinite(high), N))
        self.peaked = np.flatnonzero(np.tile(peak > 0, N)) if self.peak else np.zeros(0, int)
        bound = np.isfinite(wanted.box).any(axis=1)
        places = np.kron(p.B[0], np.eye(m))[np.tile(bound, N)]
        self.linear = np.vstack([places, at])
        names, node = [*p.model.independent], np.repeat(p.t, r)
        self.names = [f"the limit of {p.names[i % r]}" for i in self.limited]
        self.names += [f"the peak of {p.names[i % r]}" for i in [*self.peaked, *self.peaked]]
        self.names += [f"the bound of {names[i % m]}" for i in np.flatnonzero(np.tile(bound, N))]
        self.names += ["a pose"] * len(at) + ["activation's dynamics"] * (N * M)
        self.limits = np.arange(len(self.names)) < len(self.names) - len(at) - N * M
        count, own_box = len(self.peaked), np.tile(wanted.box[bound], (N, 1))
        none, open_, even = np.zeros(count), np.full(count, np.inf), np.zeros(N * M)
        first, last = np.tile(low, N)[self.limited], np.tile(high, N)[self.limited]
        self.limits[: len(self.limited)] = first < last
        self.low = np.concatenate([first, -open_, none, own_box[:, 0], target, even])
        self.high = np.concatenate([last, none, open_, own_box[:, 1], target, even])
        self.when = np.concatenate([
            node[self.limited], node[self.peaked], node[self.peaked],
            np.repeat(p.t, m)[np.tile(bound, N)], np.zeros(len(at)), np.repeat(p.t, M),
        ])  # fmt: skip
        if self.acts is not None:
            self.names += [f"the limit of {self.acts.names[i % n]}" for i in range(N * n)]
            self.when = np.concatenate([self.when, np.repeat(p.t, n)])
            self.limits = np.concatenate([self.limits, np.ones(N * n, bool)])
        self._pattern_rows()
        self._pattern_curved()

    # -- patterns: where the values of a node, of fixed matrices, of dynamics stand ------------

    def _pattern_rows(self) -> None:
        p, count = self.problem, len(self.peaked)
        sets = (self.limited, self.peaked, self.peaked)
        tall = [np.tile(p.mask, (p.N, 1))[part] for part in sets]
        wide = [np.repeat(self.columns, p.r, axis=0)[part] for part in sets]
        start = np.cumsum([0, *map(len, sets), len(self.linear)])
        rows = [k + np.nonzero(mask)[0] for k, mask in zip(start, tall, strict=False)]
        columns = [c[mask] for c, mask in zip(wide, tall, strict=True)]
        self._of_rows = [(part, np.nonzero(mask)) for part, mask in zip(sets, tall, strict=True)]
        if self.peak:
            rows.append(np.arange(start[1], start[3]))
            columns.append(np.full(2 * count, self.size - 1))
        fixed = np.nonzero(self.linear)
        rows.append(start[3] + fixed[0])
        columns.append(fixed[1])
        self._fixed = np.concatenate(
            [np.repeat([-1.0, 1.0], count if self.peak else 0), self.linear[fixed]]
        )
        if self.acts is not None:
            own_rows, own = self._dynamics_unknowns()
            rows.append(np.repeat(start[4] + own_rows.ravel(), own.shape[-1]))
            columns.append(own.ravel())
        self.jacobian_pattern, self._jacobian_at = _pattern_of(
            (len(self.low), self.size), np.concatenate(rows), np.concatenate(columns)
        )

    def _pattern_curved(self) -> None:
        p = self.problem
        i, j = np.nonzero(p.curved)
        rows, columns = self.columns[:, i], self.columns[:, j]
        self._upper = rows <= columns
        self._curved = i, j
        every = [(rows[self._upper], columns[self._upper])]
        if self.quadratic is not None:
            bent_rows, bent_columns = np.nonzero(np.triu(self.quadratic.P))
            self._bent = bent_rows, bent_columns
            every.append(self._bent)
        if self.acts is not None:
            _, own = self._dynamics_unknowns()
            a, b = self._pairs = np.triu_indices(own.shape[-1])
            one, two = own[..., a].ravel(), own[..., b].ravel()
            every.append((np.minimum(one, two), np.maximum(one, two)))
        self.hessian_pattern, self._hessian_at = _pattern_of(
            (self.size, self.size), *map(np.concatenate, zip(*every, strict=True))
        )

    def _dynamics_unknowns(self) -> tuple[Array, Array]:
        """Rows (N, M), and their unknowns: activation at both ends, excitation, the period."""
        p = self.problem
        assert self.acts is not None
        M = len(self.acts.mine)
        here = self.ends[0] + np.arange(p.N)[:, None] * p.n + np.array(self.acts.mine)
        own = [here, np.roll(here, -1, axis=0), self.ends[1] + np.arange(p.N * M).reshape(p.N, M)]
        own += [np.full((p.N, M), self.ends[2])] * p.free
        return np.arange(p.N * M).reshape(p.N, M), np.stack(own, axis=-1)

    # -- unknowns ------------------------------------------------------------------------------

    def point(self, x: Array) -> Iterate:
        p, ends = self.problem, self.ends
        share = float(x[ends[2]]) if p.free else 1.0
        return Iterate(x[: ends[0]], x[ends[0] : ends[1]].reshape(p.N, p.n), share)

    def excitation(self, x: Array) -> Array:
        found: Array = x[self.ends[1] : self.ends[2]].reshape(self.problem.N, -1)
        return found

    def all_unknowns(self, x: Iterate, excitation: Array | None = None) -> Array:
        """All unknowns: with the excitations that keep activations, and the s that they have."""
        parts = [x.c, x.w.ravel()]
        if self.acts is not None:
            keeping = x.w if excitation is None else excitation
            parts.append(np.clip(keeping[:, self.acts.mine], 0.0, 1.0).ravel())
        if self.problem.free:
            parts.append(np.array([x.share]))
        if self.peak:
            parts.append(np.array([self.highest(x)]))
        return np.concatenate(parts)

    def highest(self, x: Iterate) -> float:
        """The s that outputs have."""
        return float(np.abs(self.problem.outputs(x).ravel()[self.peaked]).max())

    # -- values --------------------------------------------------------------------------------

    def cost(self, x: Array) -> float:
        point = self.point(x)
        total = self.problem.cost(point) + float(self.linear_cost @ x) + self.constant
        if self.quadratic is not None:
            k, c = self.quadratic, point.c
            total += float(0.5 * c @ k.P @ c - k.p @ c + k.constant)
        return total

    def gradient(self, x: Array) -> Array:
        point = self.point(x)
        own = self.problem.gradient(point)
        found = np.bincount(self.columns.ravel(), own.ravel(), self.size) + self.linear_cost
        if self.quadratic is not None:
            found[: len(point.c)] += self.quadratic.P @ point.c - self.quadratic.p
        return found

    def values(self, x: Array) -> Array:
        point = self.point(x)
        y = self.problem.outputs(point).ravel()
        peaks, s = y[self.peaked], x[-1] if self.peak else 0.0
        parts = [y[self.limited], peaks - s, peaks + s, self.linear @ point.c]
        if self.acts is not None:
            h = point.share * self.problem.period / self.problem.N
            parts.append(self.acts.steps(point.w, self.excitation(x), h).ravel())
        return np.concatenate(parts)

    def jacobian(self, x: Array) -> Array:
        """Entries of the pattern."""
        p, point = self.problem, self.point(x)
        J = p.jacobian(point).reshape(-1, p.u)
        parts = [J[rows[at], column] for rows, (at, column) in self._of_rows]
        parts.append(self._fixed)
        if self.acts is not None:
            h = p.period / p.N
            parts.append(self.acts.by_own(point.w, self.excitation(x), h, point.share, p.free))
        entries = np.concatenate([one.ravel() for one in parts])
        return np.bincount(self._jacobian_at, entries, self.jacobian_pattern.nnz())

    def hessian(self, x: Array, of_cost: float, of_rows: Array) -> Array:
        """Entries of the pattern, of the upper triangle."""
        p, point, count = self.problem, self.point(x), len(self.peaked)
        weights, ends = np.zeros(p.N * p.r), np.cumsum([len(self.limited), count, count])
        weights[self.limited] += of_rows[: ends[0]]
        weights[self.peaked] += of_rows[ends[0] : ends[1]] + of_rows[ends[1] : ends[2]]
        own = p.hessian(point, of_cost, weights.reshape(p.N, p.r))
        parts = [own[:, self._curved[0], self._curved[1]][self._upper]]
        if self.quadratic is not None:
            parts.append(of_cost * self.quadratic.P[self._bent])
        if self.acts is not None:
            h, M = p.period / p.N, len(self.acts.mine)
            of_steps = of_rows[len(of_rows) - p.N * M :].reshape(p.N, M)
            bent = self.acts.curved(point.w, self.excitation(x), h, point.share, p.free, of_steps)
            a, b = self._pairs
            own_pairs = bent[..., a, b]
            parts.append(own_pairs.ravel())
        return np.bincount(self._hessian_at, np.concatenate(parts), self.hessian_pattern.nnz())

    def misses(self, x: Array) -> tuple[Array, Array]:
        """How far each row is beyond its limits, negative within, and when."""
        values = self.values(x)
        excess = np.maximum(self.low - values, values - self.high)
        if self.acts is not None:
            own = slice(self.ends[0], self.ends[1])
            beyond = np.maximum(self.lower[own] - x[own], x[own] - self.upper[own])
            excess = np.concatenate([excess, beyond])
        return excess, self.when

    def solved(
        self, x0: Array, steps: int, start: InitialGuess | None
    ) -> tuple[Array, tuple[Array, Array], int, str]:
        """IPOPT's unknowns, multipliers, iterations and word."""
        x, none = ca.Sparsity.dense(self.size), ca.Sparsity(0, 0)
        g, scalar = ca.Sparsity.dense(len(self.low)), ca.Sparsity.dense(1)
        pattern, upper = self.jacobian_pattern, self.hessian_pattern
        made = {
            "grad_f": _External(
                "grad_f", (x, none), (scalar, x), lambda x, _: (self.cost(x), self.gradient(x))
            ),
            "jac_g": _External(
                "jac_g", (x, none), (g, pattern), lambda x, _: (self.values(x), self.jacobian(x))
            ),
            "hess_lag": _External(
                *("hess_lag", (x, none, scalar, g), (upper,)),
                lambda x, _, of_cost, lam: (self.hessian(x, float(of_cost[0]), lam),),
            ),
        }
        f = _External(
            "nlp", (x, none), (scalar, g), lambda x, _: (self.cost(x), self.values(x))
        )  # fmt: skip
        quiet: dict[str, Any] = {"print_level": 0, "sb": "yes", "max_iter": steps, "tol": ACCURACY}
        quiet |= {"constr_viol_tol": UNMET / 10, "bound_relax_factor": 0.0}
        quiet["obj_scaling_factor"] = 1 / max(abs(self.cost(x0)), LEAST)
        given: dict[str, Any] = {}
        if self.acts is not None:
            quiet["mu_strategy"] = "adaptive"
        if start is not None:
            quiet |= {"mu_init": NEARLY, "bound_push": NEARLY, "slack_bound_push": NEARLY}
            known = start.multipliers
            if known is not None and [len(a) for a in known] == [self.size, len(self.low)]:
                quiet["warm_start_init_point"] = "yes"
                names = ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac")
                quiet |= {f"warm_start_{name}": NEARLY for name in (*names, "mult_bound_push")}
                given = {"lam_x0": known[0], "lam_g0": known[1]}
        X = ca.MX.sym("x", self.size)
        F = f(X, ca.MX(0, 0))
        how: Any = {**made, "no_nlp_grad": True, "calc_lam_p": False, "ipopt": quiet}
        how |= {"print_time": False, "show_eval_warnings": False}
        solver = ca.nlpsol("cycle", "ipopt", {"x": X, "f": F[0], "g": F[1]}, how)
        bounds = {"lbx": self.lower, "ubx": self.upper, "lbg": self.low, "ubg": self.high}
        answer = solver(x0=x0, **bounds, **given)
        said = solver.stats()
        found, lam_x, lam_g = (answer[name].full().ravel() for name in ("x", "lam_x", "lam_g"))
        return found, (lam_x, lam_g), int(said["iter_count"]), said["return_status"]


class _External(ca.Callback):  # type: ignore[misc]
    """A function of ours, as CasADi calls it: values are entries of their patterns."""

    def __init__(
        self, name: str, ins: Sequence[Any], outs: Sequence[Any], run: Callable[..., Any]
    ) -> None:
        super().__init__()
        self._ins, self._outs, self._run = ins, outs, run
        self.construct(name, {})

    def get_n_in(self) -> int:
        return len(self._ins)

    def get_n_out(self) -> int:
        return len(self._outs)

    def get_sparsity_in(self, i: int) -> Any:
        return self._ins[i]

    def get_sparsity_out(self, i: int) -> Any:
        return self._outs[i]

    def has_eval_buffer(self) -> bool:
        return True

    def eval_buffer(self, arg: Sequence[Any], res: Sequence[Any]) -> int:
        given = [np.zeros(0) if a is None else np.frombuffer(a).copy() for a in arg]
        for own, value in zip(res, self._run(*given), strict=True):
            if own is not None:
                np.frombuffer(own)[:] = value
        return 0


def _pattern_of(shape: tuple[int, int], rows: Array, columns: Array) -> tuple[Any, Array]:
    """A pattern in CasADi's order, columns first, and where each entry stands in it."""
    key = columns * shape[0] + rows
    places, at = np.unique(key, return_inverse=True)
    own = (places % shape[0]).tolist(), (places // shape[0]).tolist()
    pattern = ca.Sparsity.triplet(*shape, *own)
    return pattern, at
