"""A cycle that costs least, by direct collocation of periodic splines.

    q(t) = sum_j c_j B_j(t),    B_j quintic, one a node, knots at the nodes

The independent coordinates have no equations of closure, so c is all that is unknown. At the nodes
the mechanism has outputs y(q, q', q''): efforts, contact forces, the singularity ratio, places of
the contacts. With slopes that are exact and curvature by their differences, IPOPT solves

    minimise  mean of sum w y^2 + c^T P c / 2 - p^T c (+ w s),    low <= y <= high (or |y| <= s),

points and bounds of q.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from ..errors import InputError
from ..model.model import Model
from ..motion.spline import basis
from ..status import Status

Array = np.ndarray
DEGREE = 5  # acceleration is twice differentiable
STEPS = (1e-6, 1e-3, 1e-1)  # of q, v, a [SI], for curvature by differences of exact slopes
UNMET = 1e-9  # violation that counts as none, relative to the limit; of points, in m or rad
ACCURACY = 1e-9  # of optimality, by IPOPT's scaled measure
DYNAMIC = ("effort", "contact_force")
LEAST = 1e-8  # cost that is scaled to one: less is rounding
NEARLY = 1e-6  # the barrier's first parameter where a start is nearly the end


@dataclass(frozen=True)
class Measured:
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
class Quadratic:
    """c^T P c / 2 - p^T c + constant, of splines with weights of their own."""

    P: Array
    p: Array
    constant: float


@dataclass(frozen=True, eq=False)
class Cycle:
    """A periodic motion that costs least, at its nodes.

    t: (N,) [s], from 0, the period's end left out;  q, v, a: (N, m);
    outputs: measure -> (N, r), over its scale;  cost, first_cost: of it, and of the start;
    violation: largest of all constraints;  binds: (name, when [s]) where limits hold it;
    coefficients: (N, m), of its splines;  evaluations: of the outputs at all nodes;
    status: IPOPT's word.
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


@dataclass
class Collocation:
    """Outputs of a mechanism and their slopes by the coefficients of periodic splines."""

    model: Model
    period: float
    N: int
    measures: tuple[Measured, ...]
    evaluations: int = 0
    _at: tuple[Array, Array] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        self.m = len(self.model.independent)
        self.scale = np.concatenate([one.scale for one in self.measures])
        self.r = len(self.scale)
        self.weight = np.concatenate([np.full(len(x.scale), x.weight) for x in self.measures])
        self.names = [name for one in self.measures for name in one.names]
        self.t = np.arange(self.N) * (self.period / self.N)
        self.B = np.stack([self.rows(self.t, nu) for nu in range(3)])  # (3, N, N)
        node = np.abs(self.B).max(axis=0) > 0  # each output has the coefficients of its node
        self.mask = np.kron(node, np.ones((self.r, self.m), bool))
        self.curved = np.kron(node.T.astype(int) @ node.astype(int) > 0, np.ones((self.m,) * 2))

    def rows(self, t: Array, nu: int = 0) -> Array:
        """Matrix of the derivative of order `nu` at times (K,) in coefficients, (K, N)."""
        h = self.period / self.N
        knots = h * np.arange(-DEGREE, self.N + DEGREE + 1)
        first, values = basis(knots, np.mod(t, self.period), DEGREE, nu)
        found: Array = np.zeros((len(t), self.N))
        for j in range(DEGREE + 1):
            np.add.at(found, (np.arange(len(t)), (first + j) % self.N), values[:, j])
        found[np.abs(found) < 1e-13 * np.abs(found).max()] = 0.0
        return found

    def states(self, c: Array) -> Array:
        """q, v, a at the nodes, (3, N, m)."""
        found: Array = self.B @ c.reshape(self.N, self.m)
        return found

    def outputs(self, c: Array) -> Array:
        """y over its scale, (N, r), NaN where there is none."""
        if self._at is None or not np.array_equal(self._at[0], c):
            self.evaluations += 1
            self._at = c.copy(), self._outputs(*self.states(c)) / self.scale
        return self._at[1]

    def _outputs(self, q: Array, v: Array, a: Array) -> Array:
        of, found = [one.of for one in self.measures], []
        solved: Any = self.model.inverse_dynamics(q, v, a) if {*of} & {*DYNAMIC} else None
        placed: Any = self.model.inverse_kinematics(q) if {*of} - {*DYNAMIC} else None
        for name in of:
            if name == "singularity_ratio":
                found.append(placed.singularity.ratio[:, None])
            else:
                one = getattr(solved if name in DYNAMIC else placed, name)
                found.append(one.reshape(len(q), -1))
        bad = np.zeros(len(q), bool)
        for one in (solved, placed):
            if one is not None:
                bad |= np.asarray(one.status) != Status.ok
        return np.where(bad[:, None], np.nan, np.hstack(found))

    def _slopes(self, z: Array) -> Array:
        """Of y over its scale by (q, v, a): (..., r, 3, m)."""
        of = [one.of for one in self.measures]
        dynamic = tuple(name for name in of if name in DYNAMIC)
        still = tuple(name for name in of if name not in DYNAMIC)
        lead, by = z.shape[1:-1], ("q", "v", "a")
        moved: Any = {}
        placed: Any = {}
        if dynamic:
            moved = self.model.derivatives(dynamic, by, q=z[0], v=z[1], a=z[2], zeros=True)
        if still:
            placed = self.model.derivatives(still, ("q",), q=z[0], zeros=True)
        parts = []
        for one in self.measures:
            part = np.zeros((*lead, len(one.scale), 3, self.m))
            for k, wrt in enumerate(by if one.of in DYNAMIC else by[:1]):
                found = (moved if one.of in DYNAMIC else placed)[one.of, wrt]
                part[..., k, :] = np.asarray(found).reshape(*lead, len(one.scale), self.m)
            parts.append(part)
        return np.concatenate(parts, axis=-3) / self.scale[:, None, None]

    def jacobian(self, c: Array) -> Array:
        """Of y over its scale, (N r, N m)."""
        dense = np.einsum("inkm,kij->injm", self._slopes(self.states(c)), self.B, optimize=True)
        found: Array = dense.reshape(self.N * self.r, self.N * self.m)
        return found

    def cost(self, c: Array) -> float:
        """Of the outputs' squares alone."""
        return float(np.sum(self.weight * self.outputs(c) ** 2) / self.N)

    def gradient(self, c: Array) -> Array:
        found: Array = 2 / self.N * (self.weight * self.outputs(c)).ravel() @ self.jacobian(c)
        return found

    def hessian(self, c: Array, of_cost: float, of_outputs: Array) -> Array:
        """Of of_cost times the cost + of_outputs (N, r) . y over its scale, (N m, N m)."""
        J = self.jacobian(c)
        weights = 2 * of_cost / self.N * self.weight * self.outputs(c) + of_outputs
        z, size = self.states(c), 3 * self.m
        moved = np.repeat(z[:, None, None], 2, axis=1).repeat(size, axis=2)  # (3, 2, 3m, N, m)
        steps = np.repeat(STEPS, self.m)
        for d in range(size):
            k, column = divmod(d, self.m)
            moved[k, 0, d, :, column] += steps[d]
            moved[k, 1, d, :, column] -= steps[d]
        slopes = np.einsum("sdinkm,in->sdikm", self._slopes(moved), weights)
        H = (slopes[0] - slopes[1]) / (2 * steps[:, None, None, None])
        H = H.reshape(3, self.m, self.N, 3, self.m)
        # nodes are even: each has the weights of the first one, further on
        columns = np.flatnonzero(np.abs(self.B[:, 0]).max(axis=0))
        w = self.B[:, 0, columns]
        local = np.einsum("kaiLb,kp,Lr->iparb", H, w, w, optimize=True)
        found, every = np.zeros((self.N, self.m, self.N, self.m)), np.arange(self.m)
        for i, one in enumerate(local):
            at = (columns + i) % self.N
            found[np.ix_(at, every, at, every)] += one
        square: Array = found.reshape((self.N * self.m,) * 2)
        scaled = (self.weight * np.ones((self.N, self.r))).ravel()
        return (square + square.T) / 2 + 2 * of_cost / self.N * J.T @ (scaled[:, None] * J)


@dataclass(frozen=True, eq=False)
class Wanted:
    """What a cycle passes and keeps, beside the outputs' limits.

    times: (K,) [s];  points: (K, m), NaN where free;  box: (m, 2), bounds of q.
    """

    times: Array
    points: Array
    box: Array


def cheapest_cycle(
    problem: Collocation,
    wanted: Wanted,
    quadratic: Quadratic | None = None,
    *,
    start: Array | None = None,
    steps: int = 200,
) -> Cycle:
    """The periodic motion through points that costs least, within limits at the nodes.

    Args:   quadratic: a further cost, of the coefficients alone.
            start: coefficients (N, m); None: the curve of least acceleration through the points.
            steps: most iterations of IPOPT.
    Raises: InputError: for a start where the mechanism has no outputs, and where no motion meets
            the constraints, with the one that is missed most.
    """
    began = time.perf_counter()
    held = np.isfinite(wanted.points)
    at = np.kron(problem.rows(wanted.times), np.eye(problem.m))[held.ravel()]
    target = wanted.points[held]
    c = _start(problem, at, target) if start is None else np.asarray(start, float).ravel()
    if not np.isfinite(problem.cost(c)):
        i = int(np.argmax(~np.isfinite(problem.outputs(c)).all(axis=1)))
        raise InputError(
            f"the start has no efforts at t = {problem.t[i]:.6g} s: the mechanism does not reach "
            "it, or is singular there. Move the poses nearer to home, or give another start"
        )
    solver = _Solver(problem, at, target, wanted.box, quadratic)
    first = solver.cost(c)
    found, iterations, status = solver.solved(c, steps, warm=start is not None)
    misses, when = solver.misses(found)
    violation = max(float(misses.max(initial=0.0)), 0.0)
    if not violation <= UNMET or status not in ("Solve_Succeeded", "Solved_To_Acceptable_Level"):
        worst = int(np.argmax(misses))
        said = f"missed most is {solver.names[worst]}"
        said += f" at t = {when[worst]:.4g} s, by {misses[worst]:.2g}"
        if violation <= UNMET:
            said = "constraints are met, but the cost has not settled; raise steps"
        raise InputError(f"no cheapest cycle after {iterations} iterations ({status}): {said}")
    tight = np.flatnonzero(misses > -1e-6)
    binds = tuple((solver.names[i], float(when[i])) for i in tight if solver.limits[i])
    q, v, a = problem.states(found)
    y, ends = problem.outputs(found), np.cumsum([len(one.scale) for one in problem.measures])
    of = [one.of for one in problem.measures]
    outputs = dict(zip(of, np.split(y, ends[:-1], axis=1), strict=True))
    return Cycle(
        *(problem.t, q, v, a, outputs, solver.cost(found), first, violation, binds),
        *(found.reshape(problem.N, problem.m), iterations, problem.evaluations),
        *(time.perf_counter() - began, status),
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
    first: Array = found[:size]
    return first


class _Solver:
    """The program as IPOPT has it: unknowns are c, and s where a peak costs.

    Rows: outputs with limits, |y| <= s, bounds of q, points.
    """

    def __init__(
        self,
        problem: Collocation,
        at: Array,
        target: Array,
        box: Array,
        quadratic: Quadratic | None,
    ) -> None:
        self.problem, self.quadratic = problem, quadratic
        N, r, m = problem.N, problem.r, problem.m
        self.size = N * m
        low = np.concatenate([one.low for one in problem.measures])
        high = np.concatenate([one.high for one in problem.measures])
        peak = np.concatenate([np.full(len(x.scale), x.peak) for x in problem.measures])
        self.peak = float(peak.max(initial=0.0))
        kept = np.tile(np.isfinite(low) | np.isfinite(high), N)
        self.kept = np.flatnonzero(kept)
        self.peaked = np.flatnonzero(np.tile(peak > 0, N)) if self.peak else np.zeros(0, int)
        bound = np.isfinite(box).any(axis=1)
        places = np.kron(problem.B[0], np.eye(m))[np.tile(bound, N)]
        self.linear = np.vstack([places, at])
        names = [*problem.model.independent]
        node = np.repeat(problem.t, r)
        self.names = [f"the limit of {problem.names[i % r]}" for i in self.kept]
        self.names += [f"the peak of {problem.names[i % r]}" for i in [*self.peaked, *self.peaked]]
        self.names += [f"the bound of {names[i % m]}" for i in np.flatnonzero(np.tile(bound, N))]
        self.names += ["a pose"] * len(at)
        self.when = np.concatenate([
            node[self.kept], node[self.peaked], node[self.peaked],
            np.repeat(problem.t, m)[np.tile(bound, N)], np.zeros(len(at)),
        ])  # fmt: skip
        none, open_ = np.zeros(len(self.peaked)), np.full(len(self.peaked), np.inf)
        own = np.tile(box[bound], (N, 1))
        self.low = np.concatenate([np.tile(low, N)[self.kept], -open_, none, own[:, 0], target])
        self.high = np.concatenate([np.tile(high, N)[self.kept], none, open_, own[:, 1], target])
        self.limits = np.arange(len(self.names)) < len(self.names) - len(at)

    def _split(self, x: Array) -> tuple[Array, float]:
        return x[: self.size], float(x[-1]) if self.peak else 0.0

    def whole(self, c: Array) -> Array:
        """c, and the s that it has."""
        if not self.peak:
            return c
        return np.append(c, np.abs(self.problem.outputs(c).ravel()[self.peaked]).max())

    def cost(self, x: Array) -> float:
        """Args: x: c, with its s or without."""
        c, s = self._split(x if len(x) > self.size else self.whole(x))
        found = self.problem.cost(c) + self.peak * s
        if self.quadratic is not None:
            k = self.quadratic
            found += float(0.5 * c @ k.P @ c - k.p @ c + k.constant)
        return found

    def gradient(self, x: Array) -> Array:
        c, _ = self._split(x)
        found = self.problem.gradient(c)
        if self.quadratic is not None:
            found = found + self.quadratic.P @ c - self.quadratic.p
        return np.append(found, self.peak) if self.peak else found

    def values(self, x: Array) -> Array:
        c, s = self._split(x)
        y = self.problem.outputs(c).ravel()
        peaks = y[self.peaked]
        return np.concatenate([y[self.kept], peaks - s, peaks + s, self.linear @ c])

    def jacobian(self, x: Array) -> Array:
        c, _ = self._split(x)
        J = self.problem.jacobian(c)
        rows = np.vstack([J[self.kept], J[self.peaked], J[self.peaked], self.linear])
        return np.hstack([rows, self._of_s()]) if self.peak else rows

    def _of_s(self) -> Array:
        """Column of the rows by s."""
        count = len(self.peaked)
        parts = (0.0, len(self.kept)), (-1.0, count), (1.0, count), (0.0, len(self.linear))
        return np.concatenate([np.full(size, value) for value, size in parts])[:, None]

    def hessian(self, x: Array, of_cost: float, of_rows: Array) -> Array:
        c, _ = self._split(x)
        p, count = self.problem, len(self.peaked)
        weights = np.zeros(p.N * p.r)
        weights[self.kept] += of_rows[: len(self.kept)]
        one, two = of_rows[len(self.kept) :][:count], of_rows[len(self.kept) + count :][:count]
        weights[self.peaked] += one + two
        found = p.hessian(c, of_cost, weights.reshape(p.N, p.r))
        if self.quadratic is not None:
            found = found + of_cost * self.quadratic.P
        return np.pad(found, (0, 1)) if self.peak else found

    def misses(self, x: Array) -> tuple[Array, Array]:
        """How far each row is beyond its limits, negative within, and when."""
        values = self.values(x if len(x) > self.size else self.whole(x))
        return np.maximum(self.low - values, values - self.high), self.when

    def solved(self, c: Array, steps: int, warm: bool) -> tuple[Array, int, str]:
        """IPOPT's coefficients, iterations and word."""
        x0 = self.whole(c)
        size = len(x0)
        x, none = ca.Sparsity.dense(size), ca.Sparsity(0, 0)
        g, one = ca.Sparsity.dense(len(self.low)), ca.Sparsity.dense(1)
        mask = np.vstack([self.problem.mask[k] for k in (self.kept, self.peaked, self.peaked)])
        pattern, curved = np.vstack([mask, self.linear != 0]), np.triu(self.problem.curved) > 0
        if self.quadratic is not None:
            curved |= np.triu(self.quadratic.P) != 0
        if self.peak:
            pattern, curved = np.hstack([pattern, self._of_s() != 0]), np.pad(curved, (0, 1))
        jacobian, upper = _pattern(pattern), _pattern(curved)

        def nlp(x: Array, _: Array) -> list[Any]:
            return [self.cost(x), self.values(x)]

        def slope(x: Array, _: Array) -> list[Any]:
            return [self.cost(x), self.gradient(x)]

        def slopes(x: Array, _: Array) -> list[Any]:
            return [self.values(x), self.jacobian(x)]

        def curvature(x: Array, _: Array, of_cost: Array, lam: Array) -> list[Any]:
            return [self.hessian(x, float(of_cost[0]), lam)]

        made = {
            "grad_f": _External("grad_f", (x, none), (one, x), slope),
            "jac_g": _External("jac_g", (x, none), (g, jacobian), slopes),
            "hess_lag": _External("hess_lag", (x, none, one, g), (upper,), curvature),
        }
        f = _External("nlp", (x, none), (one, g), nlp)
        quiet: dict[str, Any] = {"print_level": 0, "sb": "yes", "max_iter": steps, "tol": ACCURACY}
        quiet |= {"constr_viol_tol": UNMET / 10, "bound_relax_factor": 0.0}
        quiet["obj_scaling_factor"] = 1 / max(abs(self.cost(x0)), LEAST)
        if warm:
            quiet |= {"mu_init": NEARLY, "bound_push": NEARLY, "slack_bound_push": NEARLY}
        X = ca.MX.sym("x", size)
        F = f(X, ca.MX(0, 0))
        how: Any = {**made, "no_nlp_grad": True, "calc_lam_p": False, "ipopt": quiet}
        how |= {"print_time": False, "show_eval_warnings": False}
        solver = ca.nlpsol("cycle", "ipopt", {"x": X, "f": F[0], "g": F[1]}, how)
        answer = solver(x0=x0, lbg=self.low, ubg=self.high)
        said = solver.stats()
        found = np.asarray(answer["x"].full()).ravel()[: self.size]
        return found, int(said["iter_count"]), said["return_status"]


class _External(ca.Callback):  # type: ignore[misc]
    """A function of ours, as CasADi calls it."""

    def __init__(self, name: str, ins: Sequence[Any], outs: Sequence[Any], run: Any) -> None:
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

    def eval(self, arg: Sequence[Any]) -> list[Any]:
        given = [np.asarray(one.full()).ravel() for one in arg]
        return [
            ca.DM(sparsity, one[tuple(np.array(sparsity.get_triplet()))].tolist())
            if np.ndim(one) == 2
            else ca.DM(one)
            for sparsity, one in zip(self._outs, self._run(*given), strict=True)
        ]


def _pattern(mask: Array) -> Any:
    rows, columns = np.nonzero(mask)
    size, width = mask.shape
    return ca.Sparsity.triplet(size, width, rows.tolist(), columns.tolist())
