"""The pose of encoder readings, by a fixed number of Gauss-Newton steps.

    X <- X + M_J dq + dX_phi,    A dq ~ theta - theta(X) - J_theta dX_phi,    A = J_theta M_J,

where dX_phi moves the dependent coordinates back onto the surfaces: contacts, flat or curved, and
joints close in the same steps. n joints over-determine the 6 - k freedoms, so ~ is least squares,
with joints that turn multiplied by the characteristic length, and their differences taken without
whole turns. Angles of the pose count as lengths in the same way: A and steps have no dimension.

The start decides the assembly mode. Steps that shrink to a quarter each time lead to the pose
nearest to it; otherwise the certificate is 0, and the sample goes to
`condyle.model.forward_kinematics`, which follows it in pieces.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from ..dynamics.least_norm import definite_solve, gram
from ..graph.program import Program, Programs
from ..kinematics.chain import FAMILIES
from ..kinematics.constraints import (
    ContactSymbols,
    all_of,
    contact_frame,
    indices,
    parasitic_jacobian,
    solve_small,
)
from ..kinematics.rotation import Bryant
from .builder import Builder, Lanes
from .configuration import loops_at
from .numbers import single_contacts
from .platform import ANGLE_UNITS, independent_indices
from .structure import Structure

ITERATIONS = 5  # between samples of a motion three suffice
LONGEST = 1.0  # maximum first step, in characteristic lengths and radians
SHRINK = 0.25  # maximum ratio of consecutive steps
TINY = 1e-11  # steps that need not shrink
CLOSED = 1e-10  # maximum last step
CONDITIONED = 1e-12  # minimum |pivot| over the diagonal's entry of A^T A


@dataclass(frozen=True)
class PoseStep:
    """A Gauss-Newton step at a pose, with its intermediate results.

    pose, move: X_EE and the step, (6,).   square: of the move, without dimension.
    M_J: (6, m).   A: (m,) a group, lane values, without dimension; `weight` of each group's.
    residual: joint coordinates as read, less those of the pose, lane values [rad or m].
    regular: 1, or 0 where A has not full rank, or a chain cannot reach the pose.
    """

    b: Builder
    pose: ca.SX
    move: ca.SX
    square: ca.SX
    M_J: ca.SX
    A: Lanes
    weight: Lanes
    unit: ca.SX
    residual: Lanes
    regular: ca.SX

    @property
    def free(self) -> list[int]:
        return independent_indices(self.b.structure.dependent)

    def rates(self, joint_rate: Lanes) -> ca.SX:
        """q' (m,) with theta' ~ (d theta / dq) q', of least squares, from lane values."""
        scaled = [w * rate for w, rate in zip(self.weight, joint_rate, strict=True)]
        return least_squares(self.b, self.A, scaled)[0] * self.unit[self.free]


@dataclass(frozen=True)
class Estimate:
    """A pose from encoders.

    last: the step at the pose itself: its pose, rows, residual.
    sure: 1 where the steps converged to the pose nearest to the start, else 0.
    """

    last: PoseStep
    sure: ca.SX

    @property
    def pose(self) -> ca.SX:
        """X_EE, (6,)."""
        return self.last.pose

    @property
    def q(self) -> ca.SX:
        """The independent coordinates, (m,)."""
        return self.pose[self.last.free]


def joints_read(b: Builder, reading: Lanes) -> Lanes:
    """Joint coordinates, zero at home, that encoders' readings stand for: reading - zero."""
    return [one - b.lane(group, "zero") for group, one in enumerate(reading)]


def pose_from_encoders(
    b: Builder,
    joint: Lanes,
    start: ca.SX,
    iterations: int = ITERATIONS,
    weight: Lanes | None = None,
) -> Estimate:
    """The pose on the contacts whose joint coordinates are nearest to those read.

    Args: joint: lane values [rad or m], zero at home; turning joints may count whole turns.
          start: X_EE, (6,), near by: on the contacts, or a little off them.
          weight: of each chain's difference, besides the characteristic length; default 1.
    """
    contacts = single_contacts(b.structure, b.parameter)
    step, sure = step_at(b, joint, start, contacts, weight), ca.SX(1)
    sure = step.regular * (step.square <= LONGEST**2)
    for _ in range(iterations):
        before, contacts = step, _near(contacts, step.pose)
        step = step_at(b, joint, before.pose + before.move, contacts, weight)
        shrunk = step.square <= SHRINK**2 * before.square + TINY**2
        sure = sure * shrunk * step.regular
    return Estimate(step, sure * (step.square <= CLOSED**2))


def step_at(
    b: Builder,
    joint: Lanes,
    pose: ca.SX,
    contacts: Sequence[ContactSymbols],
    weight: Lanes | None = None,
) -> PoseStep:
    """The Gauss-Newton step from any pose, also from one that does not meet the contacts."""
    at, length = joints_at(b, pose, contacts), b.parameter("length")
    unit = ca.vertcat(length, length, length, 1, 1, 1)
    free = independent_indices(b.structure.dependent)
    residual, rows, right, weights = [], [], [], []
    for group, kind in enumerate(b.structure.families):
        turns = FAMILIES[kind].joint_unit == "rad"
        left = joint[group] - at.joint[group]
        residual.append(without_turns(left) if turns else left)
        own = b.lane(group, "mask") * (ca.SX(1) if turns else 1 / length)
        weights.append(own if weight is None else own * weight[group])
        rows.append(weights[-1] * (unit[free] * (at.M_J.T @ at.J[group])))
        right.append(weights[-1] * (residual[-1] - ca.dot(at.J[group], at.back)))
    dq, regular = least_squares(b, rows, right)
    move = at.back + at.M_J @ (unit[free] * dq)
    regular = regular * (b.least(at.discriminant) >= 0)
    square = ca.sumsqr(move / unit)
    return PoseStep(b, pose, move, square, at.M_J, rows, weights, unit, residual, regular)


@dataclass(frozen=True)
class JointsAt:
    """Joints and contacts at a pose.

    joint, discriminant: lane values.   J: (6,) a group, theta' = J . X_EE'.
    M_J: (6, m).   back: (6,), moves the dependent coordinates back onto the surfaces;
    release: (6, k), by which back = release phi.
    phi: (k,) [m], distances of the contacts from their surfaces.
    twist: (6,) a group, theta' = twist . [V; omega].   N: (6, k), wrenches of the contacts.
    """

    joint: Lanes
    discriminant: Lanes
    J: Lanes
    M_J: ca.SX
    back: ca.SX
    release: ca.SX
    phi: ca.SX
    twist: Lanes
    N: ca.SX


def joints_at(b: Builder, pose: ca.SX, contacts: Sequence[ContactSymbols]) -> JointsAt:
    """Joints at any pose, also at one that does not meet the contacts."""
    s, position, bryant = b.structure, pose[:3], Bryant.of(pose[3:])
    R, E = bryant.rotation(), ca.diagcat(ca.SX.eye(3), bryant.angular_velocity())
    dep = indices(s.dependent)
    phi = ca.vertcat(ca.SX(0, 1), *(c.phi(c.at(position, R)) for c in contacts))
    N = contact_frame(contacts, position, R).N
    C = N.T @ E
    M_J, back, release = parasitic_jacobian(C, s.dependent), ca.SX.zeros(6), ca.SX(6, len(dep))
    if dep:
        back[dep] = -solve_small(C[:, dep], phi)
        release[dep, :] = -solve_small(C[:, dep], ca.SX.eye(len(dep)))
    levers = [R @ b.lane(group, "joint") for group in range(len(s.families))]
    loops = loops_at(b, position, R)
    pairs = zip(loops, levers, strict=True)
    twist = [ca.vertcat(loop.J, ca.cross(lever, loop.J)) for loop, lever in pairs]
    J, reach = [E.T @ row for row in twist], [loop.discriminant for loop in loops]
    joint = [loop.q_r[0] for loop in loops]
    return JointsAt(joint, reach, J, M_J, back, release, phi, twist, N)


def least_squares(b: Builder, A: Lanes, right: Lanes) -> tuple[ca.SX, ca.SX]:
    """x with A x ~ right over all chains, (m,), by normal equations; whether A has full rank.

    They square A's condition number. In iterations this costs no accuracy, only speed of
    convergence, and that not before the condition number is a million.
    """
    G = gram(b.total, A, A)
    carried = b.total([a * y for a, y in zip(A, right, strict=True)])
    x, excess, _ = definite_solve(G, carried, ca.diag(G), CONDITIONED)
    return x, all_of(one > 0 for one in excess)


def pose(structure: Structure, iterations: int = ITERATIONS) -> Programs:
    """The pose of encoders' readings, port joint, from a pose near by, port start.

    Results: pose (6,); residual, readings less joint coordinates of the pose and zeros.
    """
    b = Builder(structure)
    joint = joints_read(b, b.lane_sample("joint", unit="rad or m"))
    found = pose_from_encoders(b, joint, b.sample("start", 6, ANGLE_UNITS), iterations)
    b.output("pose", found.pose, ANGLE_UNITS)
    b.output("residual", found.last.residual, "rad or m")
    b.check(2 * found.sure - 1, 0.5)
    return Programs(b.finish(), single=True)


def encoders(structure: Structure) -> Program:
    """The results of `JointsAt` at any pose, port pose, to follow readings in pieces."""
    b = Builder(structure)
    contacts = single_contacts(structure, b.parameter)
    at = joints_at(b, b.sample("pose", 6, ANGLE_UNITS), contacts)
    b.output("joint", at.joint, "rad or m")
    b.output("J_theta", at.J, "")
    b.output("M_J", at.M_J, "", 6, structure.m)
    b.output("correction", at.back, "m, rad", 6)
    b.output("release", at.release, "", 6, len(contacts))
    b.output("phi", at.phi, "m", len(contacts))
    b.output("twist", at.twist, "")
    b.output("N", at.N.T, "", len(contacts), 6)
    return b.finish()


def _near(contacts: Sequence[ContactSymbols], pose: ca.SX) -> list[ContactSymbols]:
    """Contacts for poses near `pose`: see `Smooth.started_at`."""
    R = Bryant.of(pose[3:]).rotation()
    return [c.started_at(c.at(pose[:3], R)) for c in contacts]


def without_turns(difference: ca.SX) -> ca.SX:
    """An angle's difference without whole turns."""
    turn = 2 * math.pi
    return difference - turn * ca.floor(difference / turn + 0.5)
