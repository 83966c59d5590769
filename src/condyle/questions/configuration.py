"""The configuration at a pose: joints, contacts, and how near the mechanism is to a singularity.

L_i = |S_i - M_i|^2 - |S_i M_i|^2 gives J_A theta' + J_W q' = 0 ([Cheng2023] eqs 25, 26). Divided by
twice crank times coupler, J_A becomes the sine of the transmission angle. J_W is taken on twists
[V; L omega] that the contacts admit, in orthonormal coordinates of theirs, L the characteristic
length; divided by twice the coupler it is dimensionless too. So its singular values depend on no
choice of coordinates, and a gimbal lock of the angles does not appear in them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

import casadi as ca

from ..dynamics.singular_values import singular_values
from ..graph.program import Program
from ..kinematics.chain import FAMILIES, ChainLoop
from .bound import data_error, off_contacts
from .builder import Builder, Lanes
from .output_sets import OutputSets
from .platform import ANGLE_UNITS, PlatformState, closed, contacts, given
from .structure import Structure

CONVERGED = 0.0  # minimum quality of singular values
# Optional results of a survey, besides the discriminants; "ratio" has singular values.
SURVEYED = ("pose", "joint", "transmission", "rates", "points", "rows", "ratio")
RESULTS = {name: (name,) for name in SURVEYED} | {"ratio": ("J_W_sigma", "J_A_extremes")}
SETS = OutputSets(RESULTS, SURVEYED[:-2], SURVEYED[:-1], SURVEYED)
OF_LOOPS: dict[str, tuple[Callable[[ChainLoop], ca.SX], str]] = {
    "joint": (lambda loop: loop.q_r[0], "rad or m"),
    "beta": (lambda loop: loop.q_r[1], "rad"),
    "gamma": (lambda loop: loop.q_r[2], "rad"),
    "cos_gamma": (lambda loop: loop.cos_gamma, "1"),
    "discriminant": (lambda loop: loop.discriminant, "1"),
    "J_A": (lambda loop: loop.J_A, "m^2 per rad or m"),
    "transmission": (lambda loop: loop.transmission, "1"),
}


def configuration(structure: Structure) -> Program:
    """The configuration at whole poses that meet the contacts."""
    b = Builder(structure)
    platform = given(b, still=True)
    rows = add_configuration(b, platform)
    b.output("J_W", rows, "1", structure.m)
    data = data_error(b, platform, loops_of(b, platform), off_contacts(b, platform))
    b.output("data_error", data, "1", 2)
    return b.finish()


def add_configuration(b: Builder, platform: PlatformState) -> Lanes:
    """The configuration among a question's outputs; returns the dimensionless rows of J_W."""
    loops = loops_of(b, platform)
    rows = rows_of_J_W(b, platform, loops)
    _add_loops(b, loops, OF_LOOPS)
    _add_singularity(b, loops, rows)
    contacts(b, platform).add_places(b)
    return rows


def survey(structure: Structure, wanted: Collection[str] = (), at_pose: bool = False) -> Program:
    """Some of `SURVEYED` at many poses, for maps, and every chain's discriminant.

    `met` is >= 0.5, or >= 0 where it is not iterated, where the contacts can be closed. Results of
    a chain that cannot reach a pose are NaN there.

    Args: at_pose: from whole poses that meet the contacts; else from q_EE, which closes them.
    """
    b = Builder(structure)
    platform = given(b, still=True) if at_pose else closed(b, rates=0)
    met = platform.placement.discriminant
    b.output("met", ca.SX(1) if met is None else met, "1")
    loops = loops_of(b, platform)
    rows = rows_of_J_W(b, platform, loops)
    _add_loops(b, loops, ("discriminant", *(name for name in OF_LOOPS if name in wanted)))
    if "pose" in wanted:
        b.output("pose", platform.pose, ANGLE_UNITS)
    if "rates" in wanted:
        b.output("rates", on_rates(b, platform, [c.J for c in loops]), "", structure.m)
    if "rows" in wanted:
        b.output("rows", rows, "1", structure.m)
    if "ratio" in wanted:
        _add_singularity(b, loops, rows)
    if "points" in wanted:
        b.output("points", contacts(b, platform).point.T, "m", len(structure.contacts), 3)
    return b.finish()


def _add_loops(b: Builder, loops: list[ChainLoop], names: Collection[str]) -> None:
    for name in names:
        value, unit = OF_LOOPS[name]
        b.output(name, [value(loop) for loop in loops], unit)


def rows_of_J_W(b: Builder, platform: PlatformState, loops: list[ChainLoop]) -> Lanes:
    """The dimensionless rows of J_W on the admissible twists, (m,) each.

    Householder's reflections take the contacts' k wrenches to the first k axes; the other axes are
    the coordinates of admissible twists. The last one's sign makes them an oriented basis that
    moves continuously, so that curves det J_W = 0 can be traced.
    """
    scale = wrench_scale(b)
    columns = ca.horzsplit(ca.diag(scale) @ platform.motion.frame.N) if b.structure.contacts else []
    reflections: list[tuple[ca.SX, ca.SX]] = []
    sign = ca.SX(1)
    for i, column in enumerate(columns):
        x = _reflected_by(reflections, column)[i:]
        size = ca.norm_2(x)
        sign = ca.copysign(sign, sign * x[0])
        size = ca.copysign(size, x[0])  # |x_0| would have no slope where it is 0
        w = ca.vertcat(x[0] + size, x[1:])
        reflections.append((w, 1 / (size * w[0])))
    rows = []
    for row in twist_rows(b, platform, [loop.rod / loop.rod_length for loop in loops]):
        own = _reflected_by(reflections, scale * row)[len(columns) :]
        own[-1] *= sign
        rows.append(own)
    return rows


def _reflected_by(reflections: list[tuple[ca.SX, ca.SX]], x: ca.SX) -> ca.SX:
    for i, (w, factor) in enumerate(reflections):
        x = ca.vertcat(x[:i], x[i:] - (factor * ca.dot(w, x[i:])) * w)
    return x


def wrench_scale(b: Builder) -> ca.SX:
    """Factors of a wrench, (6,), that make it dual to the twist [V; L omega]."""
    inverse = 1 / b.parameter("length")
    return ca.vertcat(1, 1, 1, inverse, inverse, inverse)


def twist_rows(b: Builder, platform: PlatformState, rows: Lanes) -> Lanes:
    """Rows (3,) on the velocities of the platform joints as rows (6,) on the twist [V; omega]."""
    twists = []
    for group, row in enumerate(rows):
        r = platform.R @ b.lane(group, "joint")
        twists.append(b.lane(group, "mask") * ca.vertcat(row, ca.cross(r, row)))
    return twists


def _add_singularity(b: Builder, loops: list[ChainLoop], rows: Lanes) -> None:
    """Singular values of J_W, from its dimensionless rows, and extremes of J_A."""
    sigma, quality = singular_values(b.total, rows)
    b.output("J_W_sigma", sigma, "1", b.structure.m)
    size = [ca.fabs(loop.transmission) for loop in loops]
    b.output("J_A_extremes", ca.vertcat(b.least(size), -b.least([-s for s in size])), "1")
    b.check(quality, CONVERGED)


def loops_of(b: Builder, platform: PlatformState) -> list[ChainLoop]:
    """The closed loops of the chains, one a group."""
    return loops_at(b, platform.position, platform.R)


def loops_at(b: Builder, O_M: ca.SX, R: ca.SX) -> list[ChainLoop]:
    """Loops at any position, (3,), and rotation, (3, 3), of the platform."""
    loops = []
    for group, kind in enumerate(b.structure.families):
        family = FAMILIES[kind]
        position = O_M + R @ b.lane(group, "joint")
        loops.append(family.loop(family.named(b.lane(group, "constants")), position))
    return loops


def on_rates(b: Builder, platform: PlatformState, rows: Lanes) -> Lanes:
    """Rows (3,) on the velocities of the platform joints as rows (m,) on q_EE'."""
    B = platform.motion.E @ platform.motion.M_J
    return [B.T @ row for row in twist_rows(b, platform, rows)]
