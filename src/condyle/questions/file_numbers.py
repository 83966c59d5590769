"""From a mechanism file's numbers to the kernel's, in the graph: `Layout.numbers` as a question.

Chains' constants are those of their families. A contact's surface is given by its constants: those
of the surface on which the ball's centre stays.
"""

from __future__ import annotations

from functools import cache

import casadi as ca

from ..graph.program import Program
from ..kinematics.chain import FAMILIES
from ..kinematics.constraints import angle_equation, closed_form_available
from .builder import Builder
from .numbers import INERTIA, Layout, single_contacts
from .structure import Structure


@cache
def file_numbers(structure: Structure) -> Program:
    """The kernel's numbers by their names in `Layout.of`, from those of `Layout.of_file`.

    Nothing varies from sample to sample: there are no ports.
    """
    layout, b = Layout.of(structure), Builder(structure, Layout.of_file(structure))
    groups = range(len(structure.chains))
    values = _shared(b)
    for name, (_, count) in layout.parameters.items():
        if count:
            b.output(name, ca.densify(values[name]), "", count)
    for name in ("mask", "joint", "constants", "actuator"):
        if all(name in lane for lane in layout.lanes):
            for group in groups:
                alone: list[ca.SX | None] = [None] * len(groups)
                alone[group] = _lane(b, group, name)
                b.output(f"{name}_{group}", alone, "", layout.lanes[group][name][1])
    return b.finish()


def _lane(b: Builder, group: int, name: str) -> ca.SX:
    family, structure = FAMILIES[b.structure.families[group]], b.structure
    if name == "mask":
        return ca.SX(1)
    if name == "joint":
        return b.lane(group, "platform")
    if name == "constants":
        given = ca.vertcat(*(b.lane(group, path) for path in family.numbers))
        return family.derived_vector(given)
    assert structure.losses
    rotor, gear, viscous, coulomb, speed = (
        b.lane(group, f"actuator.{key}")
        for key in ("rotor_inertia", "gear", "viscous", "coulomb", "smoothing_speed")
    )
    return ca.vertcat(rotor * gear**2, viscous, coulomb, speed**2)


def _shared(b: Builder) -> dict[str, ca.SX]:
    structure = b.structure
    k, groups = len(structure.contacts), range(len(structure.chains))
    own = {name: b.parameter(name) for name in b.layout.parameters}
    points = [own[f"contact_point_{i}"] for i in range(k)]
    joints = [b.lane(group, "platform") for group in groups]
    masses = [_end_mass(b, group) for group in groups]
    first = b.total([m * p for m, p in zip(masses, joints, strict=True)])
    second = b.total(
        [
            ca.vertcat(*(m * p[i] * p[j] for i, j in INERTIA))
            for m, p in zip(masses, joints, strict=True)
        ]
    )
    trace = second[0] + second[1] + second[2]
    about = ca.vertcat(*(trace * (i == j) - second[n] for n, (i, j) in enumerate(INERTIA)))
    mean = b.total([ca.norm_2(p) for p in joints]) + sum(map(ca.norm_2, points), ca.SX(0))
    mean = mean / (structure.n + k)
    values = {
        "gravity": own["gravity"],
        "mass": own["mass"],
        "first_moment": ca.SX.zeros(3),
        "inertia": own["inertia"],
        "lumped_mass": own["mass"] + b.total(masses),
        "lumped_first_moment": first,
        "lumped_inertia": own["inertia"] + about,
        "branch": ca.SX(1),
        "length": mean + ca.logic_not(mean),
        "landmark": own["landmark"],
        "middle": sum(points, ca.SX.zeros(3)) / max(1, k),
    }
    for i in range(k):
        values[f"contact_point_{i}"] = points[i]
        values[f"contact_surface_{i}"] = own[f"contact_surface_{i}"]
        if i in structure.friction:
            f = own[f"friction_{i}"]
            values[f"friction_{i}"] = ca.vertcat(f[0], f[1] ** 2, f[2])
    if structure.parallel:
        s, t = own["contact_surface_0"], own["contact_surface_1"]
        values |= {"slope": s[:2], "mean": (points[0] + points[1]) / 2}
        values |= {"difference": points[0] - points[1]}
        values |= {"mean_offset": (s[2] + t[2]) / 2, "gap": s[2] - t[2]}
    if closed_form_available([form for form, _ in structure.contacts], structure.dependent):
        contacts = single_contacts(structure, own.__getitem__)
        home = ca.SX.zeros(6)
        B = angle_equation(contacts, structure.dependent, home).B if contacts else ca.SX(0)
        values["branch"] = -ca.sign(B)
    return values


def _end_mass(b: Builder, group: int) -> ca.SX:
    family = FAMILIES[b.structure.families[group]]
    own = family.end_masses(family.named(_lane(b, group, "constants")))
    return sum(own.values(), ca.SX(0))
