"""Forward dynamics: accelerations and contact forces from efforts and a load.

From the independent coordinates q, their rates q', efforts and the load. With the equations affine
in the accelerations (`inertia`), c'' = start + Pi w and forces G mu of the contacts,

    H c'' + F = G mu,    Pi^T G = 0:    (Pi^T H Pi) w = - Pi^T (F + H start),

and q'' = S^-1 w. The matrix is symmetric and positive definite.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import casadi as ca

from ..dynamics import FORMULATIONS
from ..dynamics.least_norm import definite_solve
from ..graph.program import Program, Programs
from ..kinematics.constraints import all_of, indices, solve_small
from ..kinematics.rotation import GIMBAL_LOCK, NEAR_LOCK
from ..status import Status
from .bound import (
    cancellation,
    data_error,
    distance,
    forward_bound,
    spread,
    uncancelled,
)
from .builder import Builder, Lanes
from .configuration import loops_of
from .equations import Wrench
from .friction import Consistent, consistent
from .inertia import Affine, affine
from .inverse import DOUBTFUL, HUGE
from .output_sets import OutputSets
from .platform import (
    ANGLE_UNITS,
    Contacts,
    PlatformState,
    closed,
    contacts,
    feasibility,
    given,
    normal_forces,
)
from .structure import Structure

# Optional results besides the accelerations, and their names.
RESULTS = {
    "contact": ("contact_force",),
    "motion": ("pose", "pose_rate", "pose_acceleration"),
    "joint": ("joint", "joint_rate", "joint_acceleration"),
    "sliding": ("slip", "drag"),
    "twist": ("twist_rate",),
    "bound": ("bound",),
}
OUTPUTS = tuple(RESULTS)
SETS = OutputSets(  # of many samples
    RESULTS, ("contact", "bound"), ("contact", "motion", "joint", "bound"), OUTPUTS
)
# Minimum |pivot| over the diagonal's entry in the elimination.
CONDITIONED = 1e-5


def forward(structure: Structure, wanted: Collection[str] = ()) -> Programs:
    """Accelerations alone, or with some of `OUTPUTS`.

    Samples that fail its checks take the robust path.
    """
    b = Builder(structure)
    platform = closed(b, rates=1)
    effort = b.lane_sample("effort", unit="N m or N")
    moved = accelerated(b, platform, Wrench.of(b), effort, "contact" in wanted)
    eq, touch, q2 = moved.equations, moved.touch, moved.q2
    b.output("acceleration", q2, "per s^2", structure.m)
    if "contact" in wanted:
        b.output("contact_force", moved.force, "N", len(structure.contacts))
    if "motion" in wanted:
        motion = platform.motion
        b.output("pose", platform.pose, ANGLE_UNITS)
        b.output("pose_rate", motion.rate, "per s")
        b.output("pose_acceleration", motion.acceleration + motion.M_J @ q2, "per s^2")
    if "joint" in wanted:
        b.output("joint", [loop.q_r[0] for loop in loops_of(b, platform)], "rad or m")
        b.output("joint_rate", eq.rates, "rad/s or m/s")
        turned = eq.start + eq.basis.rates(moved.w)
        pairs = zip(eq.biases, eq.rows, strict=True)
        accelerations = [bias + ca.dot(row, turned) for bias, row in pairs]
        b.output("joint_acceleration", accelerations, "per s^2")
    if "sliding" in wanted:
        (touch or contacts(b, platform)).add_sliding(b)
    if "twist" in wanted:
        b.output("twist_rate", twist_rate(platform, eq, moved.w), "per s^2")
    if "bound" in wanted:
        data = ca.sum1(data_error(b, platform, eq.chains))
        right = uncancelled(eq.basis, [*eq.parts, eq.H @ eq.start, _carried(b, eq, effort)])
        square = ca.dot(moved.lengths, moved.w * moved.w)
        lost = ca.sqrt(cancellation(right, moved.lengths, square))
        opened = spread(eq.S, len(structure.dependent))
        b.output("bound", forward_bound(data, lost / opened, moved.regular), "1")
    return Programs(b.finish(), single=True)


def twist_rate(platform: PlatformState, eq: Affine, w: ca.SX) -> ca.SX:
    """[V'; omega'], (6,): determined in a gimbal lock of the angles too."""
    return platform.motion.twist_rate + eq.B @ eq.basis.rates(w)


@dataclass(frozen=True)
class Accelerated:
    """q'' (m,) and the contact forces (k,), with their equations.

    regular: V^2 of the inertia matrix, times V of the friction's equations;  lengths: the inertia
             matrix's diagonal.
    """

    q2: ca.SX
    force: ca.SX
    w: ca.SX
    equations: Affine
    touch: Contacts | None
    regular: ca.SX
    lengths: ca.SX


def accelerated(
    b: Builder,
    platform: PlatformState,
    load: Wrench,
    effort: Lanes,
    forces: bool = True,
    smooth: bool = False,
) -> Accelerated:
    """Accelerations as a part of a question, with their checks.

    Args: forces: whether contact forces are required;  smooth: whether friction is left out.
    """
    eq = affine(b, platform, load, effort)
    touch = contacts(b, platform) if b.structure.friction and not smooth else None
    carried = _carried(b, eq, effort) if touch is not None else ca.SX()
    w, force, sure, regular, lengths, friction = _solved(b, platform, eq, touch, forces, carried)
    q2 = solve_small(eq.S, w)
    b.check(feasibility(b, platform, eq.discriminants), DOUBTFUL, Status.unreachable)
    known = ca.fabs(ca.sum1(q2)) < HUGE
    if friction is not None:
        b.check(1 - 2 * sure * friction.none, 0.5, Status.jammed)
        b.check(1 - 2 * sure * friction.several, 0.5, Status.ambiguous)
        known = known * friction.single + friction.none + friction.several
    b.check(2 * sure * known - 1, 0.5)
    # The twist's rate is determined, and rates of the angles in it are not; equations in these have
    # lost digits before.
    twists = FORMULATIONS[b.structure.formulation].uses_twist
    least, status = (GIMBAL_LOCK, Status.gimbal_lock) if twists else (NEAR_LOCK, None)
    b.check(ca.fabs(platform.placement.bryant.cos[1]) - least, 0.0, status)
    return Accelerated(q2, force, w, eq, touch, regular, lengths)


@dataclass(frozen=True)
class Response:
    """What unit wrenches change, one a column: q'' (m, c), [V'; omega'] (6, c), and the forces of
    the contacts (k, c)."""

    q2: ca.SX
    twist: ca.SX
    force: ca.SX


def responses(b: Builder, platform: PlatformState, eq: Affine, wrenches: ca.SX) -> Response:
    """The response of accelerations to wrenches, (6, c), dual to the twist."""
    H, right = _columns(eq), eq.B.T @ wrenches
    M = eq.basis.generalized_force(H)
    pulled = eq.basis.generalized_force(right)
    x = definite_solve(M, pulled, ca.diag(M), CONDITIONED)[0]
    x = _refined(b, eq, H, right, M, x)
    dep = indices(b.structure.dependent)
    forces = ca.SX(0, right.shape[1])
    if dep:
        left = ca.horzsplit(solve_small(eq.G[dep, :], H[dep, :] @ x - right[dep, :]))
        forces = ca.horzcat(*(normal_forces(b, platform.motion, mu) for mu in left))
    return Response(solve_small(eq.S, x), eq.B @ eq.basis.rates(x), forces)


def forward_system(structure: Structure) -> Program:
    """The equations themselves, at whole poses that meet the contacts, for the robust path.

    Port pose_acceleration is X_EE'' for q'' = 0.
    """
    b = Builder(structure)
    platform = given(b)
    effort = b.lane_sample("effort", unit="N m or N")
    load, m = Wrench.of(b), structure.m
    eq = affine(b, platform, load, effort)
    b.output("H", _columns(eq), "kg, kg m, kg m^2", 6, m)
    b.output("F", eq.F + eq.H @ eq.start, "N, N m", 6)
    b.output("S", eq.S, "", m, m)
    b.output("M_J", platform.motion.M_J, "", 6, m)
    b.output("twist_rate", platform.motion.twist_rate, "per s^2")
    b.output("along", eq.B @ eq.basis.rates(ca.SX.eye(m)), "", 6, m)
    b.output("data_error", data_error(b, platform, eq.chains), "1", 2)
    b.output("cos_beta", platform.placement.bryant.cos[1], "1")
    touch = contacts(b, platform)
    touch.add_wrenches(b, eq.B)
    touch.add_sliding(b)
    b.output("joint_rate", eq.rates, "rad/s or m/s")
    pairs = list(zip(eq.biases, eq.rows, strict=True))
    force, turned = load.force, ca.fabs(ca.cross(platform.R @ load.point, load.force))
    borne = ca.vertcat(ca.fabs(force), turned + ca.fabs(load.moment))
    size = _carried(b, eq, effort) + ca.fabs(eq.B.T) @ borne
    b.output("size", size, "N, N m", 6)
    b.output("bias", [bias + ca.dot(row, eq.start) for bias, row in pairs], "per s^2")
    along = eq.basis.rates(ca.SX.eye(m))
    b.output("J", [along.T @ row for row in eq.rows], "", m)
    return b.finish()


def _carried(b: Builder, eq: Affine, effort: Lanes) -> ca.SX:
    """|J|^T |tau|, (s,): terms of F that may cancel."""
    return b.total([ca.fabs(row * tau) for row, tau in zip(eq.rows, effort, strict=True)])


def _columns(eq: Affine) -> ca.SX:
    """H Pi, (s, m)."""
    ind, dep = list(eq.basis.identity), list(eq.basis.others)
    return eq.H[:, ind] + eq.H[:, dep] @ eq.basis.rest if dep else eq.H[:, ind]


def _refined(b: Builder, eq: Affine, H: ca.SX, right: ca.SX, M: ca.SX, x: ca.SX) -> ca.SX:
    """One step that refines x, M x = Pi^T right, by what is left of H x - G mu = right.

    Where Pi is large, Pi^T right is a small difference of large numbers; what is left of all six
    equations is not.
    """
    if not (dep := indices(b.structure.dependent)):
        return x
    mu = solve_small(eq.G[dep, :], H[dep, :] @ x - right[dep, :])
    left = eq.basis.generalized_force(right - H @ x + eq.G @ mu)
    return x + definite_solve(M, left, ca.diag(M), CONDITIONED)[0]


def _solved(
    b: Builder,
    platform: PlatformState,
    eq: Affine,
    touch: Contacts | None,
    wanted: bool,
    carried: ca.SX,
) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX, Consistent | None]:
    """w, contact forces along the unit normals (on request), and whether they are reliable; V^2 and
    the diagonal of the inertia matrix; with friction, which of its patterns are consistent.

    Args: carried: of `_carried`, with friction.
    """
    H, F = _columns(eq), eq.F + eq.H @ eq.start
    frictional = list(b.structure.friction)
    right = -F
    if touch is not None:
        T = eq.B.T @ touch.T[:, frictional]
        right = ca.horzcat(right, T)
    M, pulled = eq.basis.generalized_force(H), eq.basis.generalized_force(right)
    lengths = ca.diag(M)
    x, excess, pivots = definite_solve(M, pulled, lengths, CONDITIONED)
    x = _refined(b, eq, H, right, M, x)
    sure = all_of(one > 0 for one in excess)
    w, force, regular, solution = x[:, 0], ca.SX(0, 1), pivots.square, None
    if wanted or touch is not None:
        dep = indices(b.structure.dependent)
        left = F[dep] + H[dep, :] @ w
        force = normal_forces(b, platform.motion, solve_small(eq.G[dep, :], left))
        if touch is not None:
            moved = H[dep, :] @ w
            terms = carried[dep] + ca.fabs(F[dep]) + ca.fabs(moved)
            inverse = 1 / b.parameter("length")
            size = ca.sum1(terms * ca.vertcat(*(inverse if i >= 3 else ca.SX(1) for i in dep)))
            left = T[dep, :] - H[dep, :] @ x[:, 1:]
            each = ca.horzsplit(solve_small(eq.G[dep, :], left))
            K = ca.horzcat(*(normal_forces(b, platform.motion, mu) for mu in each))
            solution = consistent(K[frictional, :], force[frictional], size)
            w, force = w - x[:, 1:] @ solution.y, force + K @ solution.y
            regular = regular * distance(K[frictional, :], force[frictional])
    return w, force, sure, regular, lengths, solution
