"""From a mechanism file's numbers to the kernel's: a question, and a mechanism's answer to it.

Chains' constants are those of their families, a contact's those of its surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import casadi as ca
import numpy as np

from ..backends.numpy_kernel import fixed_results
from ..graph.program import Numbers, Program
from ..kinematics.chain import FAMILIES
from ..kinematics.chain.family import LEFT_OUT
from ..kinematics.constraints import angle_equation, closed_form_available
from ..mechanism.mechanism import Mechanism
from ..mechanism.surface.wall import Wall, WallConstants, home_of
from .builder import Builder
from .number_checks import judge
from .numbers import (
    FIBRES,
    GIVING,
    INERTIA,
    LOSSES,
    ZERO,
    Layout,
    lane_numbers,
    shared_numbers,
    single_contacts,
)
from .passive import knots_and_bends
from .structure import Structure, walls_of

SHORT_RANGE = 23.4  # stiffness of fibres by tension over optimal length: Cui et al. (2008)


def file_numbers(structure: Structure, walls: tuple[Wall, ...], judged: bool = False) -> Program:
    """The kernel's numbers by their names in `Layout.of`, from those of `Layout.of_file`.

    Nothing varies from sample to sample: there are no ports.

    Args: walls: see `walls_of`;  judged: whether it is checked that these are a mechanism's
          numbers: statuses `refused` and `singular`.
    """
    bare = replace(structure, formulation="virtual_power", route="core", zeros=frozenset())
    return _written(bare, walls, judged)


@lru_cache(maxsize=64)
def _written(structure: Structure, walls: tuple[Wall, ...], judged: bool) -> Program:
    layout, b = Layout.of(structure), Builder(structure, Layout.of_file(structure, walls))
    groups = range(len(structure.chains))
    constants = [_constants(b, group) for group in groups]
    values, placed = _shared(b, walls, constants)
    if judged:
        judge(b, walls, placed, values)
    for name, (_, count) in layout.parameters.items():
        if count:
            b.output(name, ca.densify(values[name]), "", count)
    for name in ("mask", "joint", "constants", "zero", "actuator", "give"):
        if all(name in lane for lane in layout.lanes):
            for group in groups:
                alone: list[ca.SX | None] = [None] * len(groups)
                alone[group] = constants[group] if name == "constants" else _lane(b, group, name)
                b.output(f"{name}_{group}", alone, "", layout.lanes[group][name][1])
    return b.finish()


def _constants(b: Builder, group: int) -> ca.SX:
    family = FAMILIES[b.structure.families[group]]
    return family.derived_vector(ca.vertcat(*(b.lane(group, path) for path in family.numbers)))


def _lane(b: Builder, group: int, name: str) -> ca.SX:
    if name == "mask":
        return ca.SX(1)
    if name == "joint":
        return b.lane(group, "platform")
    if name == "zero":
        return b.lane(group, ZERO)
    if name == "give":
        return _give(b, group)
    rotor, gear, viscous, coulomb, speed = (b.lane(group, path) for path in LOSSES)
    return ca.vertcat(rotor * gear**2, viscous, coulomb, speed**2)


def _give(b: Builder, group: int) -> ca.SX:
    """`GIVE` of the chains of a group; of a rigid one no stiffness, which stands for rigid."""
    own = b.layout.lanes[group]
    family = FAMILIES[b.structure.families[group]]
    drive, damping = (b.lane(group, path) for path in GIVING)
    axial = b.lane(group, family.axial) if family.axial in own else ca.SX(LEFT_OUT)
    yields, stretches = drive > 0, axial > 0
    soft = stretches / (axial + (1 - stretches))
    if FIBRES in own:
        short_range = (1 - yields) * SHORT_RANGE / b.lane(group, FIBRES)
        return ca.vertcat(yields * drive, 1, short_range, soft, damping)
    held = (1 - yields) * stretches  # by the drive, and only the rod gives
    return ca.vertcat(yields * drive + held, 1 - held, 0, soft, damping)


def _shared(
    b: Builder, walls: Sequence[Wall], constants: Sequence[ca.SX]
) -> tuple[dict[str, ca.SX], list[WallConstants]]:
    """Shared numbers by name, and what the contacts lead to."""
    structure = b.structure
    k, groups = len(structure.contacts), range(len(structure.chains))
    own = {name: b.parameter(name) for name in b.layout.parameters}
    points = [own[f"contact_point_{i}"] for i in range(k)]
    joints = [b.lane(group, "platform") for group in groups]
    masses = [_end_mass(b, group, constants[group]) for group in groups]
    first = b.total([m * p for m, p in zip(masses, joints, strict=True)])
    second = b.total(
        [
            ca.vertcat(*(m * p[i] * p[j] for i, j in INERTIA))
            for m, p in zip(masses, joints, strict=True)
        ]
    )
    own_first, own_inertia = (
        own["mass"] * own["com"],
        own["inertia"]
        + _about(own["mass"] * ca.vertcat(*(own["com"][i] * own["com"][j] for i, j in INERTIA))),
    )
    mean = b.total([ca.norm_2(p) for p in joints]) + sum(map(ca.norm_2, points), ca.SX(0))
    mean = mean / (structure.n + k)
    values = {
        "gravity": own["gravity"],
        "mass": own["mass"],
        "first_moment": own_first,
        "inertia": own_inertia,
        "lumped_mass": own["mass"] + b.total(masses),
        "lumped_first_moment": own_first + first,
        "lumped_inertia": own_inertia + _about(second),
        "branch": ca.SX(1),
        "length": mean + ca.logic_not(mean),
        "landmark": own["landmark"],
        "middle": sum(points, ca.SX.zeros(3)) / max(1, k),
    }
    wall_constants = []
    for i, wall in enumerate(walls):
        values[f"contact_point_{i}"] = points[i]
        ball = own.get(f"contact_ball_{i}", ca.SX(0))
        home = own.get(f"contact_home_{i}", ca.SX(0, 1))
        surface_numbers = wall.constants(own[f"contact_surface_{i}"], points[i], ball, home)
        values[f"contact_surface_{i}"] = surface_numbers.constants
        wall_constants.append(surface_numbers)
        if i in structure.friction:
            f = own[f"friction_{i}"]
            values[f"friction_{i}"] = ca.vertcat(f[0], f[1] ** 2, wall.push * ball)
    for i, rows in enumerate(structure.ligaments):
        length, stiffness = own[f"ligament_slack_length_{i}"], own[f"ligament_stiffness_{i}"]
        knots, bends = knots_and_bends(length, stiffness, rows)
        values |= {f"ligament_knots_{i}": knots, f"ligament_bends_{i}": bends}
    values |= {name: x for name, x in own.items() if name.startswith(("ligament_", "wall_"))}
    if structure.parallel:
        s, t = values["contact_surface_0"], values["contact_surface_1"]
        values |= {"slope": s[:2], "mean": (points[0] + points[1]) / 2}
        values |= {"difference": points[0] - points[1]}
        values |= {"mean_offset": (s[2] + t[2]) / 2, "gap": s[2] - t[2]}
    if closed_form_available([form for form, _ in structure.contacts], structure.dependent):
        contacts = single_contacts(structure, values.__getitem__)
        home = ca.SX.zeros(6)
        B = angle_equation(contacts, structure.dependent, home).B if contacts else ca.SX(0)
        values["branch"] = -ca.sign(B)
    return values, wall_constants


def _about(second: ca.SX) -> ca.SX:
    """The inertia, (6,), of masses with these second moments, (6,) [kg m^2]."""
    trace = second[0] + second[1] + second[2]
    return ca.vertcat(*(trace * (i == j) - second[n] for n, (i, j) in enumerate(INERTIA)))


def _end_mass(b: Builder, group: int, constants: ca.SX) -> ca.SX:
    family = FAMILIES[b.structure.families[group]]
    own = family.end_masses(family.named(constants))
    return sum(own.values(), ca.SX(0))


def numbers_of_file(
    mechanism: Mechanism, structure: Structure, walls: Sequence[Wall], landmark: str | None = None
) -> Numbers:
    """A mechanism's numbers as of `Layout.of_file`.

    Args: landmark: the platform point whose path is given, if one is.
    """
    shared = [
        one.values(mechanism, landmark)
        if one.path
        else np.array(home_of(mechanism.contacts[one.at], walls[one.at].home_kept))
        for one in shared_numbers(structure, tuple(walls))
    ]
    lanes, order = [], []
    for group, kind in enumerate(structure.families):
        own = [(i, chain) for i, chain in enumerate(mechanism.chains) if chain.kind == kind]
        paths = lane_numbers(structure, group)
        rows = np.array([FAMILIES[kind].file_numbers(chain, paths) for _, chain in own])
        lanes.append(rows.T[None])
        order += [i for i, _ in own]
    first = tuple(lane[..., 0] for lane in lanes)
    return Numbers(np.concatenate(shared)[None], tuple(lanes), first, tuple(order))


def numbers_of(structure: Structure, mechanism: Mechanism, landmark: str | None = None) -> Numbers:
    """The numbers of a mechanism, as backends take them: `Layout.of(structure)`.

    Args: landmark: as of `numbers_of_file`.
    """
    walls, layout = walls_of(mechanism, structure), Layout.of(structure)
    own = numbers_of_file(mechanism, structure, walls, landmark)
    values = fixed_results(file_numbers(structure, walls), own)
    parameters = np.concatenate([values.get(n, np.empty(0)).ravel() for n in layout.parameters])
    lanes, padding = [], []
    for group, names in enumerate(layout.lanes):
        lanes.append(np.concatenate([values[f"{name}_{group}"] for name in names])[None])
        padding.append(layout.idle(group, lanes[-1][..., 0]))
    return Numbers(parameters[None], tuple(lanes), tuple(padding), own.order)
