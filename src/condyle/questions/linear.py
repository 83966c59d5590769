"""What is differentiated about a known solution: equations that hold there, with its unknowns held.

Derivatives of the unknowns follow from the implicit function theorem, whatever found them. The pose
is a start that meets the contacts: one Newton step, which changes nothing, closes them again from
q, so that derivatives in q and in numbers of contacts move the dependent coordinates too.
"""

from __future__ import annotations

import casadi as ca

from ..graph.program import Program
from ..kinematics.chain import FAMILIES
from ..kinematics.constraints import Placement, contact_frame, indices, residuals, solve_small
from ..kinematics.parasitic import platform_rates
from ..kinematics.rotation import Bryant
from .builder import Builder, Lanes
from .configuration import loops_of, on_rates, rows_of_J_W
from .equations import Wrench, equations
from .numbers import contact_symbols
from .platform import ANGLE_UNITS, PlatformState, contacts, independent_indices
from .pose import without_turns
from .structure import Structure


def yielding(structure: Structure) -> Program:
    """As `linear`, at poses off the surfaces: phi = level, port (k,) [m], where contacts yield."""
    return linear(structure, yields=True)


def linear(structure: Structure, yields: bool = False) -> Program:
    """The balance in twists, and what multipliers y of it make of efforts and contact forces:

        residual = Q - J^T tau - D lambda,    along = J y,    across = D^T y,

    D = N - sign(lambda) T, with J, N and T themselves. Ports: q and a pose of it, q1, q2, the load,
    effort tau, contact_force lambda along unit normals, and multiplier y.
    """
    b = Builder(structure)
    platform, load = platform_near(b, rates=True, yields=yields), Wrench.of(b)
    add_linear(b, platform, load, b.lane_sample("effort", unit="N m or N"))
    return b.finish()


def add_linear(b: Builder, platform: PlatformState, load: Wrench, effort: Lanes) -> None:
    """Results of `linear` among those of another question."""
    k = len(b.structure.contacts)
    force, y = b.sample("contact_force", k, "N"), b.sample("multiplier", 6)
    eq = equations(b, platform, load, "virtual_power", "core", lump=True)
    touch = contacts(b, platform)
    D = touch.N - touch.T @ ca.diag(ca.sign(force)) if k else touch.N
    rows = [chain.row for chain in eq.chains]
    carried = b.total([row * tau for row, tau in zip(rows, effort, strict=True)])
    b.output("residual", eq.Q - carried - D @ force, "N, N m", 6)
    b.output("along", [ca.dot(row, y) for row in rows], "")
    b.output("across", D.T @ y, "", k)
    b.output("J", rows, "", 6)
    b.output("N", touch.N.T, "", k, 6)
    b.output("T", touch.T.T, "", k, 6)


def places(structure: Structure) -> Program:
    """Pose, joints and contacts of q, and what the singularity ratio is made of.

    pull is the gradient, (m,), of half the sum of squares that forward kinematics minimises: of
    joints less readings, port `reading`, those that turn multiplied by the characteristic length.
    """
    b = Builder(structure)
    platform, m = platform_near(b, rates=False), structure.m
    reading = b.lane_sample("reading", unit="rad or m")
    loops, length = loops_of(b, platform), b.parameter("length")
    b.output("pose", platform.pose, ANGLE_UNITS)
    b.output("joint", [loop.q_r[0] for loop in loops], "rad or m")
    b.output("contact_point", contacts(b, platform).point.T, "m", len(structure.contacts), 3)
    b.output("transmission", [loop.transmission for loop in loops], "1")
    b.output("J_W", rows_of_J_W(b, platform, loops), "1", m)
    rates, terms = on_rates(b, platform, [loop.J for loop in loops]), []
    for kind, loop, given, rate in zip(structure.families, loops, reading, rates, strict=True):
        turns = FAMILIES[kind].joint_unit == "rad"
        left = loop.q_r[0] - given
        own = length * length * without_turns(left) if turns else left
        terms.append(own * rate)
    b.output("pull", b.total(terms), "m^2", m)
    return b.finish()


def platform_near(b: Builder, rates: bool, yields: bool = False) -> PlatformState:
    """The state from q and a pose of it, ports q, q1, q2 and pose; with `yields` level too."""
    s, m = b.structure, b.structure.m
    dep, ind = indices(s.dependent), independent_indices(s.dependent)
    start, q = b.sample("pose", 6, ANGLE_UNITS), b.sample("q", m)
    q1, q2 = (b.sample(n, m) if rates else ca.SX.zeros(m) for n in ("q1", "q2"))
    symbols = contact_symbols(s, b.parameter)
    pose = ca.SX(start)
    pose[ind] = q
    if dep:
        bryant = Bryant.of(pose[3:])
        C = contact_frame(symbols, pose[:3], bryant.rotation()).N.T @ bryant.twist_jacobian()
        phi = residuals(symbols, pose)
        if yields:
            level = b.sample("level", len(dep), "m")
            if s.parallel:  # of two planes these are the mean and the difference
                level = ca.vertcat((level[0] + level[1]) / 2, level[0] - level[1])
            phi = phi - level
        pose[dep] -= solve_small(C[:, dep], phi)
    placement = Placement(pose[:3], Bryant.of(pose[3:]), None)
    motion = platform_rates(symbols, s.dependent, placement, q1, q2)
    return PlatformState(q, q1, q2, pose, placement, motion)
