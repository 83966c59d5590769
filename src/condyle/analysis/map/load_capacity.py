"""What efforts within limits can do at rest: hold a pose, and how large a load they bear besides.

Efforts and unilateral contact forces within limits make a set of generalized forces that is a
zonotope, a sum of segments and rays. A force g is in it where, for the normal y of each facet,

    sum_i min(y.c_i low_i, y.c_i high_i)  <=  y.g  <=  sum_i max(y.c_i low_i, y.c_i high_i),

c_i the columns. Normals are orthogonal to d - 1 columns, so they are the rows of the inverses of d
columns each. Every y makes an inequality that holds, so rounding in normals never makes the set
smaller than it is. Where there are too many facets, HiGHS solves one linear program a pose.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np

from ...errors import CondyleError
from ...kinematics.chain import FAMILIES
from ...kinematics.chain.muscle import muscles
from ...kinematics.constraints import indices
from ...mechanism.chain import limits
from ...mechanism.mechanism import Mechanism
from ...model.distributing import of_activations
from ...model.model import Model
from ...status import Status

MANY = 300  # subsets of columns, above which a linear program is quicker
DEPENDENT = 1e-10  # volume of d unit columns below which they have no inverse
ZERO = 1e-12  # part of a column along a normal, over the largest, that is rounding
ROUNDING = 1e-9  # of forces, and of multipliers, relative to the largest
SOLVED, INFEASIBLE, UNBOUNDED = 0, 2, 3  # statuses of SciPy's linprog


@dataclass(frozen=True)
class LoadCapacity:
    """Limits of one mechanism's efforts and of its unilateral contacts; of muscles, activations."""

    model: Model
    low: np.ndarray
    high: np.ndarray
    free: list[int]
    unilateral: list[int]

    @staticmethod
    def of(model: Model) -> LoadCapacity:
        mechanism = model.mechanism
        own = [limits(chain) for chain in mechanism.chains]
        unilateral = [i for i, c in enumerate(mechanism.contacts) if c.one_sided]
        push = [mechanism.contacts[i].push for i in unilateral]
        mine = muscles(mechanism.chains)
        high = [1.0 if i in mine else x.high for i, x in enumerate(own)]
        high += [np.inf if p > 0 else 0.0 for p in push]
        low = [x.low for x in own] + [0.0 if p > 0 else -np.inf for p in push]
        free = [i for i in range(len(mechanism.contacts)) if i not in unilateral]
        return LoadCapacity(model, np.array(low), np.array(high), free, unilateral)

    def largest(self, pose: np.ndarray, load: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """The largest s, (N,) [N], so that `load` and s times `direction` can be held.

        Negative infinity where no s >= 0 can, infinity where no limit is met.

        Args: pose: (N, 6), on the contacts, no number where there is none.
              load: (9,), wrench and point.  direction: a force in {S} at its point, (3,).
        """
        columns, needed, more = self._columns(pose, load, direction)
        lower, upper = interval(columns, needed, more, self.low, self.high)
        found = np.where((lower <= upper) & (upper >= 0), upper, -np.inf)
        return np.where(np.isfinite(pose).all(axis=1), found, np.nan)

    def holds(self, pose: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Whether a load can be held within the limits, (N,)."""
        units = {FAMILIES[chain.kind].effort_unit for chain in self.model.mechanism.chains}
        if (
            self.too_many_facets and len(units) == 1
        ):  # choosing efforts is quicker than linear programs
            q = pose[:, indices(self.model.independent)]
            bounded = self.model.with_distribution("bounded")
            chosen = bounded.inverse_dynamics(q, 0 * q, 0 * q, load[:6], load[6:])
            return ~np.isin(chosen.status, (Status.infeasible, Status.jammed))
        columns, needed, _ = self._columns(pose, load, np.zeros(3))
        lower, upper = interval(columns, needed, 0 * needed, self.low, self.high)
        return (lower <= 0) & (upper >= 0)

    @property
    def too_many_facets(self) -> bool:
        """Whether there are too many facets to go through."""
        return comb(len(self.low), 6 - len(self.free)) > MANY

    def _columns(
        self, pose: np.ndarray, load: np.ndarray, direction: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """c_i, (N, d, n + s), and what has to be balanced, (N, d): at s = 0, and more for each."""
        still = np.zeros_like(pose)
        wrench = {"force": load[:3], "moment": load[3:6], "point": load[6:]}
        pushed = wrench | {"force": load[:3] + direction}
        kernel, sides = self.model.kernel("system"), []
        for given in (wrench, pushed):
            ports = {name: np.tile(value, (len(pose), 1)) for name, value in given.items()}
            ports |= {"pose": pose, "pose_rate": still, "pose_acceleration": still}
            sides.append(kernel.run(ports).values)
        s = {name: np.moveaxis(value, -1, 0) for name, value in sides[0].items()}
        Q, more = s["Q"], np.moveaxis(sides[1]["Q"], -1, 0) - s["Q"]
        pushing = s["normal"][:, self.unilateral].transpose(0, 2, 1)
        J, chains = s["J"], self.model.mechanism.chains
        if muscles(chains):
            passive, active = of_activations(chains, s)
            Q, J = Q - np.einsum("rin,rn->ri", J, passive), J * active[:, None]
        columns = np.concatenate([J, pushing], axis=2)
        columns, Q, more = (np.nan_to_num(a) for a in (columns, Q, more))
        if not self.free:
            return columns, Q, more
        normals = np.nan_to_num(s["normal"][:, self.free].transpose(0, 2, 1))
        away = np.linalg.svd(normals)[0][:, :, len(self.free) :].transpose(0, 2, 1)
        return away @ columns, (away @ Q[..., None])[..., 0], (away @ more[..., None])[..., 0]


def interval(
    columns: np.ndarray, needed: np.ndarray, more: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest s, (N,) each, so that needed + s more is in the zonotope; lower > upper
    where there is none. Where there are many columns, of the s that are not negative.

    Args: columns: (N, d, c);  needed, more: (N, d);  low, high: (c,), infinite or not.
    """
    d, count = columns.shape[1:]
    lower, upper = np.full(len(columns), -np.inf), np.full(len(columns), np.inf)
    if comb(count, d) > MANY:
        for i in range(len(columns)):
            lower[i], upper[i] = _program(columns[i], needed[i], more[i], low, high)
        return lower, upper
    with np.errstate(invalid="ignore", divide="ignore"):
        size = np.linalg.norm(columns, axis=1, keepdims=True)
        unit = columns / np.where(size > 0, size, 1.0)
    some = np.zeros(len(columns), dtype=bool)
    for chosen in combinations(range(count), d):
        own = unit[:, :, chosen]
        good = np.abs(np.linalg.det(own)) > DEPENDENT
        if not good.any():
            continue
        some |= good
        inverse = np.linalg.inv(columns[good][:, :, chosen])
        combined = inverse @ columns[good]
        combined[:, :, chosen] = np.eye(d)
        combined[np.abs(combined) < ZERO * np.abs(combined).max(axis=2, keepdims=True)] = 0.0
        with np.errstate(invalid="ignore"):
            ends = [np.where(combined == 0, 0.0, combined * end) for end in (low, high)]
        least, most = np.minimum(*ends).sum(axis=2), np.maximum(*ends).sum(axis=2)
        have, step = ((inverse @ b[good][..., None])[..., 0] for b in (needed, more))
        own_lower, own_upper = _within(least, most, have, step)
        lower[good] = np.maximum(lower[good], own_lower.max(axis=1))
        upper[good] = np.minimum(upper[good], own_upper.min(axis=1))
    lower[~some], upper[~some] = np.inf, -np.inf  # singular: nothing is held
    return lower, upper


def _within(
    least: np.ndarray, most: np.ndarray, have: np.ndarray, step: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ends of s so that least <= have + s step <= most, entry by entry."""
    size = np.abs(np.concatenate([have, step], axis=1)).max(axis=1, keepdims=True)
    flat = np.abs(step) <= ZERO * size
    with np.errstate(invalid="ignore", divide="ignore"):
        first, second = (least - have) / step, (most - have) / step
        fits = (have >= least - ROUNDING * size) & (have <= most + ROUNDING * size)
    lower, upper = np.minimum(first, second), np.maximum(first, second)
    lower = np.where(flat, np.where(fits, -np.inf, np.inf), lower)
    return lower, np.where(flat, np.where(fits, np.inf, -np.inf), upper)


def _program(
    columns: np.ndarray, needed: np.ndarray, more: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[float, float]:
    """The same by a linear program, s >= 0."""
    found = largest_load(columns, needed, more, low, high)
    return (np.inf, -np.inf) if found is None else (0.0, found.s)


@dataclass(frozen=True)
class LargestLoad:
    """s, one x that holds it, (c,), and which bounds of x hold s back at their upper end, (c,)."""

    s: float
    x: np.ndarray
    held: np.ndarray


def largest_load(
    columns: np.ndarray, needed: np.ndarray, more: np.ndarray, low: np.ndarray, high: np.ndarray
) -> LargestLoad | None:
    """The largest s >= 0 of  columns x = needed + s more,  low <= x <= high,  by HiGHS.

    Infinite (x without numbers) where no limit is met; None where no s is feasible.

    Args:   columns: (d, c);  needed, more: (d,);  low, high: (c,), infinite or not.
    Raises: CondyleError: where the solver gives up.
    """
    from scipy.optimize import linprog

    A = np.column_stack([columns, -more])
    size = np.abs(A).max(axis=1, keepdims=True)
    size[size == 0] = 1.0
    bounds = [*zip(low, high, strict=True), (0.0, None)]
    cost = np.append(np.zeros(len(low)), -1.0 if more.any() else 0.0)
    solution = linprog(cost, A_eq=A / size, b_eq=needed / size[:, 0], bounds=bounds)
    count = len(low)
    if solution.status == INFEASIBLE:
        return None
    if solution.status not in (SOLVED, UNBOUNDED):
        raise CondyleError(f"the linear program of the largest load: {solution.message}")
    if solution.status == UNBOUNDED or not more.any():
        return LargestLoad(np.inf, np.full(count, np.nan), np.zeros(count, dtype=bool))
    x, gain = np.asarray(solution.x), np.abs(solution.upper.marginals[:count])
    tight = gain > ROUNDING * max(gain.max(initial=0.0), 1e-300)
    return LargestLoad(float(x[-1]), x[:count], tight)


def limited(mechanism: Mechanism) -> bool:
    """Whether any effort has a limit."""
    return any(c.kind == "muscle" or limits(c).limited for c in mechanism.chains)
