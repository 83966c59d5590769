"""Inverse dynamics: minimum-norm efforts of a motion under a load, and derived quantities.

From the independent coordinates q, q', q'' and the load; the contacts are closed on the way.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial, reduce

import casadi as ca

from ..dynamics import FORMULATIONS
from ..dynamics.least_norm import gram_schmidt, normal_equations
from ..graph.program import Program, Programs
from ..kinematics.rotation import NEAR_LOCK
from ..status import Status
from .bound import bound, cancellation, data_error, uncancelled
from .builder import Builder, Lanes
from .configuration import add_configuration
from .equations import Equations, Wrench, equations, total
from .friction import LeastNorm, least_norm_pattern
from .output_sets import OutputSets
from .passive import sides
from .platform import (
    ANGLE_UNITS,
    Contacts,
    PlatformState,
    check_contacts,
    closed,
    contacts,
    feasibility,
    given,
    independent_indices,
)
from .structure import Structure

# Optional results besides the efforts, and their names; "configuration" has all others.
RESULTS = {
    "contact": ("contact_force",),
    "share": ("share",),
    "gravity": ("gravity",),
    "motion": ("pose", "pose_rate", "pose_acceleration"),
    "joint": ("joint_rate", "joint_acceleration"),
    "configuration": (),
    "bound": ("bound",),
}
OUTPUTS = tuple(RESULTS)
# Of many samples: what costs hardly anything, parts of the efforts too, all.
SETS = OutputSets(
    RESULTS,
    ("contact", "motion", "joint", "bound"),
    ("contact", "share", "gravity", "motion", "joint", "bound"),
    OUTPUTS,
)
DOUBTFUL = 1e-14  # minimum discriminant,
WEAK = 1e-20  # and squared ratio of a pivot to its column, of samples that are not repeated
HUGE = 1e300
MUSCLE = "muscle"  # the family whose limits depend on the state


def inverse(structure: Structure, wanted: Collection[str] = ()) -> Programs:
    """Efforts alone, or with some of `OUTPUTS`."""
    lean = not {"share", "gravity", "configuration"} & set(wanted)
    return in_variants(structure, lambda *how: program(structure, wanted, *how), lean)


def program(
    structure: Structure,
    wanted: Collection[str] = (),
    robust: bool = False,
    low_latency: bool = False,
) -> Program:
    """One variant.

    Args: robust: by `gram_schmidt` in place of the faster `normal_equations`.
          low_latency: as in `equations`.
    """
    b = Builder(structure)
    platform = closed(b)
    eq, best = _minimum_norm(b, platform, Wrench.of(b), robust, low_latency, wanted)
    b.output("effort", best.effort, "N m or N")
    if "share" in wanted:
        b.output("share", best.share, "N m or N")
    if "gravity" in wanted:
        b.output("gravity", best.gravity, "N m or N")
    if "contact" in wanted:
        b.output("contact_force", best.force, "N", len(structure.contacts))
    if "motion" in wanted:
        _add_motion(b, platform)
    if "joint" in wanted:
        b.output("joint_rate", [c.dynamics.rate for c in eq.chains], "rad/s or m/s")
        b.output("joint_acceleration", [c.dynamics.acceleration for c in eq.chains], "per s^2")
    if "configuration" in wanted:
        add_configuration(b, platform)
        if structure.friction:
            contacts(b, platform).add_sliding(b)
    if "bound" in wanted:
        square, terms, held = ca.vertsplit(best.accuracy)
        data = data_error(b, platform, [c.dynamics for c in eq.chains], held=held)
        lengths = b.total([a * a for a in eq.A])
        size = b.total([t * t for t in best.effort])
        lost = cancellation(uncancelled(eq.basis, eq.parts.values()), lengths, size)
        known = bound(data, ca.sqrt(lost), ca.sqrt(square), ca.sqrt(terms))
        held_by = bound(data, ca.sqrt(best.borne), terms=ca.sqrt(terms))
        b.output("bound", ca.fmax(known, held_by), "1")
    return b.finish()


def efforts(
    b: Builder,
    platform: PlatformState,
    load: Wrench,
    robust: bool = False,
    low_latency: bool = False,
) -> Lanes:
    """Minimum-norm efforts as a part of another question, with their checks; as `program`."""
    return _minimum_norm(b, platform, load, robust, low_latency, ())[1].effort


def in_variants(
    structure: Structure, program: Callable[[bool, bool], Program], lean: bool = True
) -> Programs:
    """Variants of a program with minimum-norm efforts.

    By normal equations, with a robust variant for samples where those lose digits, and one of
    minimum latency.

    Args: program: (robust, low_latency) -> the program;  lean: whether normal equations suffice.
    """
    if not lean:
        return Programs(program(True, False))
    square = structure.n == structure.m
    robust = None if square else partial(program, True, False)
    latency = None
    if FORMULATIONS[structure.formulation].lumps:
        latency = partial(program, structure.n <= structure.m, True)
    return Programs(program(square, False), robust, latency, single=True)


@dataclass(frozen=True)
class _Best:
    """Minimum-norm efforts, the share of each part, and the contact forces.

    accuracy: V^2, s^2 and c^2 of `bound`, (3,), with friction of the chosen pattern.
    borne:    of `force_cancellation`, where contact forces are wanted.
    """

    effort: Lanes
    share: Lanes
    gravity: Lanes
    force: ca.SX
    quality: ca.SX
    accuracy: ca.SX
    borne: ca.SX | float = 1.0


def _minimum_norm(
    b: Builder,
    platform: PlatformState,
    load: Wrench,
    robust: bool,
    low_latency: bool,
    wanted: Collection[str],
) -> tuple[Equations, _Best]:
    """The equations and their minimum-norm efforts, with the checks that certify them."""
    s, apart = b.structure, bool({"share", "gravity"} & set(wanted))
    lump = FORMULATIONS[s.formulation].lumps and not apart
    # Friction acts across the contacts, where route `direct` has no equations.
    route = "core" if s.friction else s.route
    eq = equations(b, platform, load, route=route, lump=lump, low_latency=low_latency)
    solve = gram_schmidt if robust else normal_equations
    best = _solved(b, platform, load, eq, solve, apart, wanted)
    discriminants = [c.dynamics.discriminant for c in eq.chains]
    b.check(feasibility(b, platform, discriminants), DOUBTFUL, Status.unreachable)
    finite = ca.fabs(b.total(best.effort)) < HUGE
    b.check(best.quality * finite * _observable(b, eq), WEAK)
    if not FORMULATIONS[s.formulation].uses_twist:
        b.check(ca.fabs(platform.placement.bryant.cos[1]) - NEAR_LOCK, 0.0)
    return eq, best


def _solved(
    b: Builder,
    platform: PlatformState,
    load: Wrench,
    eq: Equations,
    solve: LeastNorm,
    apart: bool,
    wanted: Collection[str],
) -> _Best:
    parts = list(eq.parts.values())
    chosen = None
    if b.structure.friction:
        touch = contacts(b, platform)
        chosen = least_norm_pattern(b, eq, touch, solve)
        # Friction as a load.
        parts.append(eq.state.B.T @ (touch.T @ ca.fabs(chosen.force)))
    if chosen is not None and not apart:
        sure = chosen.sure * chosen.pivots
        borne = eq.force_cancellation(chosen.effort) if "contact" in wanted else 1.0
        return _Best(chosen.effort, [], [], chosen.force, sure, chosen.accuracy, borne)
    pulled = [eq.basis.generalized_force(part) for part in parts]
    right = ca.horzcat(*pulled) if apart else total(pulled)
    if "gravity" in wanted:
        # Forces of bodies at rest: gravity alone, and the load.
        bodies = ca.horzcat(*pulled[: len(eq.parts)])
        right = ca.horzcat(right, b.at_zero(bodies, platform.q1, platform.q2))
    found, pivots, eliminated = solve(b.total, eq.A, right)
    share = [f[:, : len(parts)] if apart else f for f in found]
    gravity = [f[:, len(parts) :] for f in found]
    if chosen is not None:
        share = [ca.horzcat(f, t - ca.sum2(f)) for f, t in zip(share, chosen.effort, strict=True)]
        gravity = [ca.horzcat(f, 0, 0) for f in gravity]  # no friction at rest
        quality = chosen.sure * ca.fmin(pivots, chosen.pivots)
        borne = eq.force_cancellation(chosen.effort) if "contact" in wanted else 1.0
        return _Best(chosen.effort, share, gravity, chosen.force, quality, chosen.accuracy, borne)
    effort = [total(ca.horzsplit(f)) for f in share]
    force, borne = ca.SX(0, 1), ca.SX(1)
    if "contact" in wanted and b.structure.contacts:
        core = eq
        if eq.G is None:  # route `direct` has no equations across the contacts
            lump = FORMULATIONS[b.structure.formulation].lumps
            core = equations(b, platform, load, route="core", lump=lump)
        force = core.contact_forces(platform, effort)
        borne = core.force_cancellation(effort)
    accuracy = ca.vertcat(eliminated.square, eliminated.terms, 1)
    return _Best(effort, share, gravity, force, pivots, accuracy, borne)


def motion(structure: Structure) -> Program:
    """The whole pose and its rates from the independent coordinates."""
    b = Builder(structure)
    platform = closed(b)
    _add_motion(b, platform)
    check_contacts(b, platform.placement)
    return b.finish()


def balance(structure: Structure) -> Program:
    """The generalized force to be balanced, at whole poses that meet the contacts."""
    b = Builder(structure)
    platform, load = given(b), Wrench.of(b)
    lump = FORMULATIONS[structure.formulation].lumps
    eq = equations(b, platform, load, route="core", lump=lump)
    _add_balance(b, platform, eq)
    if MUSCLE in structure.families:
        b.output("joint_rate", [c.dynamics.rate for c in eq.chains], "rad/s or m/s")
    b.output("data_error", data_error(b, platform, [c.dynamics for c in eq.chains]), "1", 2)
    return b.finish()


def system(structure: Structure) -> Program:
    """The equations themselves, at whole poses that meet the contacts, for the robust path."""
    b = Builder(structure)
    platform, load = given(b), Wrench.of(b)
    eq = equations(b, platform, load, route="core")
    rates = platform.motion.rate, platform.motion.acceleration
    still = [b.at_zero(part, *rates) for part in eq.parts.values()]
    b.output("A", eq.A, "", structure.m)
    for name, parts in (("b", list(eq.parts.values())), ("b_gravity", still)):
        rows = ca.horzcat(*(eq.basis.generalized_force(p) for p in parts)).T
        b.output(name, rows, "", len(parts), structure.m)
    pulled = eq.basis.generalized_force(ca.SX.eye(eq.Q.numel()))
    b.output("Pi", pulled, "", structure.m, 6)  # Pi^T
    _add_balance(b, platform, eq).add_sliding(b)
    b.output("joint_rate", [c.dynamics.rate for c in eq.chains], "rad/s or m/s")
    b.output("joint_acceleration", [c.dynamics.acceleration for c in eq.chains], "per s^2")
    b.output("data_error", data_error(b, platform, [c.dynamics for c in eq.chains]), "1", 2)
    b.output("uncancelled", uncancelled(eq.basis, eq.parts.values()), "", structure.m)
    return b.finish()


def _add_motion(b: Builder, platform: PlatformState) -> None:
    b.output("pose", platform.pose, ANGLE_UNITS)
    b.output("pose_rate", platform.motion.rate, "per s")
    b.output("pose_acceleration", platform.motion.acceleration, "per s^2")


def _add_balance(b: Builder, platform: PlatformState, eq: Equations) -> Contacts:
    """Q = J^T tau + sum_k lambda_k (N_k - sigma_k T_k), sample by sample."""
    b.output("Q", eq.Q, "N, N m", 6)
    b.output("J", [c.row for c in eq.chains], "")
    if MUSCLE in b.structure.families:
        # A line's discriminant is the square of its length over that at home.
        b.output("stretch", [ca.sqrt(c.dynamics.discriminant) for c in eq.chains], "1")
    if walls := sides(b, eq.state):
        gaps, pushes = zip(*walls, strict=True)
        b.output("wall_gap", ca.vertcat(*gaps), "m", len(gaps))
        b.output("wall", ca.horzcat(*pushes).T, "", len(gaps), 6)
    touch = contacts(b, platform)
    touch.add_wrenches(b, eq.state.B)
    return touch


def _observable(b: Builder, eq: Equations) -> ca.SX:
    """Whether every independent rate moves some joint, beyond rounding: 1, else 0.

    Pivots are compared with their own columns, which does not detect a column of mere rounding.
    """
    length = b.parameter("length")
    angles = [i >= 3 for i in independent_indices(b.structure.dependent)]
    scale = ca.vertcat(*(1 / length if angle else ca.SX(1) for angle in angles))
    sizes = scale * scale * b.total([a * a for a in eq.A])
    return reduce(ca.fmin, ca.vertsplit(sizes)) >= WEAK * ca.sum1(sizes)
