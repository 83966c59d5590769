"""Dependent coordinates where they have no closed form: Newton's method as one expression.

A fixed number of steps, for kernels, which cannot loop until convergence. The last residual says
whether they converged; otherwise the sample needs `Closure`, which follows it from home.

Most mechanisms on curved surfaces z = f(x, y) depend in Z and one angle; see `one_angle`. The
others follow the sample from home in steps, as `Closure` does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca

from .constraints import (
    ContactFrame,
    ContactSymbols,
    Placement,
    all_of,
    contact_frame,
    determinant,
    indices,
    solve_small,
)
from .one_angle import one_angle
from .parasitic import rate_bias
from .rotation import Bryant, turn_by, turned

TINY = 1e-10  # steps that need not shrink
CLOSED = 1e-13  # maximum last step
NEAREST = 0.25  # minimum lever over the characteristic length: a contact may be at O_M itself
NOTHING = 1e-30  # avoids 0 / 0 for steps of zero


@dataclass(frozen=True)
class _Plan:
    """How the path from home is followed, and the conditions for trusting it.

    shrink: maximum ratio of consecutive steps in a piece; `Closure`: a quarter.
    fold:   minimum 1 - 2 h, and minimum determinant of C_dep over home's.
    far:    maximum length of the path.
    """

    steps: int
    shrink: float
    fold: float
    far: float


# By the number of dependent coordinates: the more there are, the nearer the folds. Six: a landmark
# follows its path.
PLANS = (
    _Plan(4, 0.25, 0.05, 1.5),
    _Plan(4, 0.1, 0.1, 1.5),
    _Plan(6, 0.1, 0.2, 0.7),
    _Plan(4, 0.1, 0.2, 0.7),
    _Plan(2, 0.1, 0.2, 0.7),
    _Plan(2, 0.2, 0.1, 1.0),
)


def newton(
    contacts: Sequence[ContactSymbols], dependent: Sequence[str], q: ca.SX, length: ca.SX
) -> Placement:
    """A pose with phi = 0, from q in the order of X_EE.

    Its `discriminant` is 1 where the steps converged, else 0.

    Args: length: the characteristic one [m].
    """
    dep = indices(dependent)
    if not dep:
        return Placement(q[:3], Bryant.of(q[3:]), None)
    if all(_is_graph(c) for c in contacts) and 2 in dep:
        if len(dep) == 1:
            return _height(contacts[0], q)
        if len(dep) == 2 and max(dep) >= 3:
            return one_angle(contacts, max(dep), q)
    return followed(contacts, dep, q, length)


def _is_graph(contact: ContactSymbols) -> bool:
    """Whether phi = z - f(x, y), so that Z is found by adding."""
    p = ca.SX.sym("p", 3)
    return contact.anchored and ca.jacobian(contact.phi(p), p[2]).is_one()


def _height(contact: ContactSymbols, q: ca.SX) -> Placement:
    """One contact: Z follows from the other five coordinates directly."""
    bryant = Bryant.of(q[2:])
    below = ca.vertcat(q[:2], 0)
    Z = -contact.phi(contact.at(below, bryant.rotation()))
    return Placement(ca.vertcat(q[:2], Z), bryant, None)


def followed(
    contacts: Sequence[ContactSymbols], dep: list[int], q: ca.SX, length: ca.SX
) -> Placement:
    """All dependent coordinates at once, along the straight path from home; guides move with it.

    Each piece is a step that follows the curvature of the contacts, and a Newton step that shows
    its error. Branches meet at folds, where the determinant of C_dep changes sign; steps that
    shrink quickly and determinants away from zero exclude a fold between them.
    """
    lever = sum((c.square_lever for c in contacts), ca.SX(0)) / len(contacts)
    unit = _Unit(ca.fmax(lever, (NEAREST * length) ** 2))
    pose = _Pose(ca.SX.zeros(3), [ca.SX([1, 0])] * 3)
    there = _Contacts.at([c.started_at(c.point) for c in contacts], dep, pose)
    home = there.determinant
    sure = []
    plan = PLANS[len(dep) - 1]
    for part, goal in _homotopy(dep, q, plan.steps):
        pose = pose.with_goal(goal, dep)
        here = there.guided(part).at_pose(pose)
        step, fold = here.curved_step(unit)
        pose = pose.moved(dep, step)
        there = here.at_pose(pose)
        rest = there.step()
        pose = pose.moved(dep, rest)
        shrunk = unit.square(rest, dep) < plan.shrink**2 * unit.square(step, dep) + TINY**2
        sure += [fold > plan.fold, shrunk]
        sure += [c.determinant * home > plan.fold * home * home for c in (here, there)]
    there = there.at_pose(pose)
    pose = pose.moved(dep, there.curved_step(unit)[0])
    last = there.at_pose(pose)
    pose = pose.moved(dep, last.step())
    phi = _phi([c.along_path(1.0) for c in contacts], pose)
    left = unit.square(solve_small(last.C, phi), dep)
    sure.append(left < CLOSED**2)
    sure.append(pose.square(unit) < plan.far**2)
    return Placement(pose.position, pose.bryant, all_of(sure), True, left)


@dataclass(frozen=True)
class _Unit:
    """Norm of steps in lengths and angles: lengths are divided by the levers' mean.

    lever: mean square of the contact points' distances from O_M, or a minimum [m^2].
    """

    lever: ca.SX

    def dot(self, a: ca.SX, b: ca.SX, dep: Sequence[int]) -> ca.SX:
        weight = ca.vertcat(*(1 / self.lever if i < 3 else ca.SX(1) for i in dep))
        return ca.dot(weight * a, b)

    def square(self, step: ca.SX, dep: Sequence[int]) -> ca.SX:
        return self.dot(step, step, dep)


@dataclass(frozen=True)
class _Pose:
    """O_M, (3,), and the cosine and sine of each angle."""

    position: ca.SX
    turns: list[ca.SX]

    @property
    def bryant(self) -> Bryant:
        return Bryant(*(ca.vertcat(*(turn[i] for turn in self.turns)) for i in (0, 1)))

    def square(self, unit: _Unit) -> ca.SX:
        """Squared norm of the move from home: lengths over the levers', angles by their chords."""
        chords = sum((2 * (1 - turn[0]) for turn in self.turns), ca.SX(0))
        return ca.dot(self.position, self.position) / unit.lever + chords

    def with_goal(self, goal: _Pose, dep: Sequence[int]) -> _Pose:
        """The pose with the independent coordinates of another."""
        position = ca.vertcat(*((self if i in dep else goal).position[i] for i in range(3)))
        return _Pose(position, [(self if i + 3 in dep else goal).turns[i] for i in range(3)])

    def moved(self, dep: Sequence[int], step: ca.SX) -> _Pose:
        """After a step of the dependent coordinates; angles to second order."""
        position, turns = ca.SX(self.position), list(self.turns)
        for i, change in zip(dep, ca.vertsplit(step), strict=True):
            if i < 3:
                position[i] += change
            else:
                turns[i - 3] = turned(turns[i - 3], turn_by(change))
        return _Pose(position, turns)


def _homotopy(dep: Sequence[int], q: ca.SX, steps: int) -> list[tuple[float, _Pose]]:
    """Poses with the independent coordinates at equal parts of the path from home to q."""
    given = iter(ca.vertsplit(q))
    values = [ca.SX(0) if i in dep else next(given) for i in range(6)]
    first = [ca.vertcat(ca.cos(v / steps), ca.sin(v / steps)) for v in values[3:]]
    goals, turns = [], first
    for part in range(1, steps + 1):
        share = part / steps
        goals.append((share, _Pose(ca.vertcat(*values[:3]) * share, turns)))
        turns = [turned(turn, by) for turn, by in zip(turns, first, strict=True)]
    return goals


def _phi(contacts: Sequence[ContactSymbols], pose: _Pose) -> ca.SX:
    R = pose.bryant.rotation()
    return ca.vertcat(*(c.phi(c.at(pose.position, R)) for c in contacts))


@dataclass(frozen=True)
class _Contacts:
    """phi, (k,), at a pose, and C, (k, k), its derivative in the dependent coordinates."""

    contacts: Sequence[ContactSymbols]
    dep: list[int]
    pose: _Pose
    frame: ContactFrame
    phi: ca.SX
    C: ca.SX

    @staticmethod
    def at(contacts: Sequence[ContactSymbols], dep: list[int], pose: _Pose) -> _Contacts:
        bryant = pose.bryant
        frame = contact_frame(contacts, pose.position, bryant.rotation())
        C = frame.N.T @ bryant.twist_jacobian()
        return _Contacts(contacts, dep, pose, frame, _phi(contacts, pose), C[:, dep])

    def at_pose(self, pose: _Pose) -> _Contacts:
        """The contacts at another pose nearby."""
        R = self.pose.bryant.rotation()
        here = [c.started_at(c.at(self.pose.position, R)) for c in self.contacts]
        return _Contacts.at(here, self.dep, pose)

    def guided(self, part: float) -> _Contacts:
        """The contacts with their guides at a fraction of the path."""
        return replace(self, contacts=[c.along_path(part) for c in self.contacts])

    @property
    def determinant(self) -> ca.SX:
        return determinant(self.C)

    def step(self) -> ca.SX:
        """Newton's."""
        return -solve_small(self.C, self.phi)

    def curved_step(self, unit: _Unit) -> tuple[ca.SX, ca.SX]:
        """The step to the quadratic's root along Newton's step s, which also leads to near folds.

            b = C^-1 phi''(s, s),   h = -(s . b) / (s . s),
            t s - t^2 (b + h s) / 2   with   t = 2 / (1 + sqrt(1 - 2 h)).

        Returns: the step, and 1 - 2 h: negative where the quadratic has no root.
        """
        s = self.step()
        rate = ca.SX.zeros(6)
        rate[self.dep] = s
        pose = self.pose
        bias = rate_bias(self.contacts, self.frame, pose.position, pose.bryant, rate)
        b = solve_small(self.C, bias)
        h = -unit.dot(s, b, self.dep) / (unit.square(s, self.dep) + NOTHING)
        fold = 1 - 2 * h
        t = 2 / (1 + ca.sqrt(ca.fmax(fold, 0)))
        return t * s - (t * t / 2) * (b + h * s), fold
