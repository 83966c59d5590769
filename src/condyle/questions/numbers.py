"""A mechanism's numbers and their layout: shared parameters, lanes of chains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from operator import attrgetter
from typing import Any

import casadi as ca
import numpy as np

from ..dynamics import FORMULATIONS
from ..errors import UnsupportedError
from ..graph.program import Numbers
from ..kinematics.chain import FAMILIES
from ..kinematics.constraints import (
    ContactSymbols,
    closed_form_available,
    mean_and_difference,
)
from ..mechanism.actuator import Actuator
from ..mechanism.chain import CHAINS
from ..mechanism.contact import Contact
from ..mechanism.fossa_wall import FossaWall
from ..mechanism.home import dependent_coordinates
from ..mechanism.ligament import Ligament
from ..mechanism.mechanism import Mechanism
from ..mechanism.quantities import LARGEST_LIMIT, NumberField, Unit, number_fields
from ..mechanism.surface import of_form
from ..mechanism.surface.wall import Wall
from .structure import Structure

ZERO = "actuator.zero"  # what an encoder reads at home
LOSSES = tuple(f"actuator.{key}" for key in Actuator.implied if key not in ("damping", "zero"))
NO_LOSSES = (0.0, 0.0, 0.0, 1.0)
GIVING = ("actuator.stiffness", "actuator.damping")
# Of a chain: drive of stiffness (stiffness + short_range tension) / yields, rod of 1 / soft.
GIVE = ("stiffness", "yields", "short_range", "soft", "damping")
FIBRES = "muscle.optimal_length"  # which a muscle's short-range stiffness goes by
Parameter = Callable[[str], ca.SX]  # a mechanism's number by name
Slot = tuple[int, int]  # start, count
INERTIA = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # order of an inertia's entries


@dataclass(frozen=True)
class FileNumber:
    """A number or vector of a mechanism file, from which numbers of a kernel are made.

    part, at: its table, and which of them: "contact", 0; "" for the mechanism itself.
    path:     within that, `surface.slope`; empty for what the file does not say.
    name:     in `Layout.of_file`, where it may stand with others.
    field:    what it is.
    """

    part: str
    at: int
    path: str
    name: str
    field: NumberField

    def values(self, mechanism: Mechanism, landmark: str | None) -> np.ndarray:
        """Its entries, one after another."""
        if self.path == LANDMARK:
            return np.array(mechanism.platform.points[landmark] if landmark else (0.0, 0.0, 0.0))
        part = tables(mechanism, self.part)[self.at] if self.part else mechanism
        return np.ravel(attrgetter(self.path)(part)).astype(float)


LANDMARK = "platform.points"
HOME = NumberField(Unit(), 4, "where the search for the touching point begins: normal at home; 0")
ROWS = NumberField(Unit(most=LARGEST_LIMIT), 0, "strain and force [N] of every row")


def tables(mechanism: Mechanism, part: str) -> tuple[Any, ...]:
    """Contacts, chains, ligaments or walls that are enabled."""
    return mechanism.enabled_walls if part == "wall" else mechanism.entries()[part]


@lru_cache(maxsize=64)
def shared_numbers(structure: Structure, walls: tuple[Wall, ...]) -> tuple[FileNumber, ...]:
    """Numbers of the file that all chains share, in the order of `Layout.of_file`.

    A contact's home is no number of the file, but where Newton starts and what is kept: the unit
    normal and `Wall.miss` of the nominal mechanism.
    """
    contact, point = number_fields(Contact), number_fields(Contact)["point"]
    numbers = [
        FileNumber("", 0, path, path.split(".")[:2][-1], own)
        for path, own in number_fields(Mechanism).items()
    ]
    landmark = replace(point, meaning="in {M}: the point whose path is given")
    numbers.append(FileNumber("", 0, LANDMARK, "landmark", landmark))
    for i, wall in enumerate(walls):
        own = [("point", "point", point)]
        own += [
            ("surface", f"surface.{name}", replace(wall.surface.numbers[name], size=count))
            for name, count in wall.sizes
        ]
        own += [("ball", "ball_radius", contact["ball_radius"])] if wall.push else []
        own += [("home", "", HOME)] if wall.general or wall.home_kept else []
        numbers += [FileNumber("contact", i, path, f"contact_{n}_{i}", f) for n, path, f in own]
    for i in structure.friction:
        numbers += [
            FileNumber("contact", i, path, f"friction_{i}", own)
            for path, own in contact.items()
            if path in ("friction.coefficient", "friction.smoothing_speed")
        ]
    for i, rows in enumerate(structure.ligaments):
        table = {"stiffness": replace(ROWS, size=2 * rows)} if rows else {}
        for path, field in (number_fields(Ligament) | table).items():
            numbers.append(FileNumber("ligament", i, path, f"ligament_{path}_{i}", field))
    for i in range(len(structure.walls)):
        numbers += [
            FileNumber("wall", i, path, f"wall_{path.partition('.')[0]}_{i}", own)
            for path, own in number_fields(FossaWall).items()
            if path.startswith(("point", "surface"))
        ]
    return tuple(numbers)


def lane_numbers(structure: Structure, group: int) -> dict[str, NumberField]:
    """Numbers of the file of a group's chains, by their paths in its table."""
    kind = structure.families[group]
    family, table = FAMILIES[kind], number_fields(CHAINS[kind])
    paths = (*family.numbers, ZERO, *(LOSSES if structure.losses else ()))
    if structure.gives:
        paths += tuple(path for path in (*GIVING, family.axial, FIBRES) if path in table)
    return {
        path: replace(table[path], unit=table[path].unit.at(family.joint_unit)) for path in paths
    }


@dataclass(frozen=True)
class Layout:
    """Names to positions.

    parameters: shared numbers of the mechanism.
    lanes:      numbers of a chain, by group.
    """

    structure: Structure
    parameters: dict[str, Slot]
    lanes: list[dict[str, Slot]]

    @staticmethod
    def of(structure: Structure) -> Layout:
        body = {"mass": 1, "first_moment": 3, "inertia": 6}
        sizes = {"gravity": 3, **body, **{f"lumped_{name}": n for name, n in body.items()}}
        sizes |= {"branch": 1, "length": 1, "landmark": 3, "middle": 3}
        for i, (_, count) in enumerate(structure.contacts):
            sizes |= {f"contact_point_{i}": 3, f"contact_surface_{i}": count}
        sizes |= {f"friction_{i}": 3 for i in structure.friction}
        if structure.parallel:
            sizes |= {"slope": 2, "mean": 3, "mean_offset": 1, "difference": 3, "gap": 1}
        for i, rows in enumerate(structure.ligaments):
            knots = max(1, rows - 1)
            own = {"base": 3, "platform": 3, "damping": 1, "knots": knots, "bends": knots}
            sizes |= {f"ligament_{name}_{i}": size for name, size in own.items()}
        for i in range(len(structure.walls)):
            sizes |= {f"wall_point_{i}": 3, f"wall_surface_{i}": 3}
        more = {"actuator": len(NO_LOSSES)} if structure.losses else {}
        more |= {"give": len(GIVE)} if structure.gives else {}
        lanes = [
            _slots({"mask": 1, "joint": 3, "constants": FAMILIES[kind].size(), "zero": 1} | more)
            for kind in structure.families
        ]
        return Layout(structure, _slots(sizes), lanes)

    @staticmethod
    def of_file(structure: Structure, walls: Sequence[Wall]) -> Layout:
        """Numbers as a mechanism file has them, which `file_numbers` makes the others of."""
        sizes: dict[str, int] = {}
        for one in shared_numbers(structure, tuple(walls)):
            sizes[one.name] = sizes.get(one.name, 0) + one.field.size
        lanes = [
            _slots({path: own.size for path, own in lane_numbers(structure, group).items()})
            for group in range(len(structure.chains))
        ]
        return Layout(structure, _slots(sizes), lanes)

    @property
    def sizes(self) -> tuple[int, list[int]]:
        """How many shared numbers there are, and numbers of a lane, group by group."""

        def total(slots: dict[str, Slot]) -> int:
            return sum(count for _, count in slots.values())

        return total(self.parameters), [total(slots) for slots in self.lanes]

    def idle(self, group: int, first: np.ndarray) -> np.ndarray:
        """Numbers of a lane without a chain, which contributes nothing, (..., size).

        Args: first: those of the group's first chain, (..., size).
        """
        family = FAMILIES[self.structure.families[group]]
        own = FORMULATIONS[self.structure.formulation].pads
        idle, slots = first.copy(), self.lanes[group]
        idle[..., slots["mask"][0]] = 0.0
        start, at = slots["constants"][0], 0
        for name, count in family.shapes.items():
            if own and name in family.padding:
                idle[..., start + at : start + at + count] = 0.0
            at += count
        if self.structure.losses:
            start, count = slots["actuator"]
            idle[..., start : start + count] = NO_LOSSES
        return idle


def specialised(structure: Structure, numbers: Numbers) -> Structure:
    """The structure without what is zero in all these mechanisms."""
    zeros = [(-1, int(i)) for i in np.flatnonzero((numbers.parameters == 0).all(axis=0))]
    for group, (values, pad) in enumerate(zip(numbers.lanes, numbers.padding, strict=True)):
        none = (values == 0).all(axis=(0, 2)) & (pad == 0).all(axis=0)
        zeros += [(group, int(i)) for i in np.flatnonzero(none)]
    return replace(structure, zeros=frozenset(zeros))


def agree(structure: Structure, numbers: Numbers) -> bool:
    """Whether what a structure takes as zero is zero in all these mechanisms."""
    return all(
        not (numbers.parameters[:, i] if g < 0 else numbers.lanes[g][:, i]).any()
        for g, i in structure.zeros
    )


def characteristic(structure: Structure, numbers: Numbers) -> np.ndarray:
    """The characteristic length of every mechanism, (V,) [m]."""
    return numbers.parameters[:, Layout.of(structure).parameters["length"][0]]


def contact_symbols(
    structure: Structure, parameter: Callable[[str], ca.SX]
) -> list[ContactSymbols]:
    """The contacts, their numbers by name; parallel planes by their mean and difference."""
    if structure.parallel:
        names = ("slope", "mean", "mean_offset", "difference", "gap")
        return mean_and_difference(
            of_form(structure.contacts[0][0]), *(parameter(name) for name in names)
        )
    return single_contacts(structure, parameter)


def single_contacts(
    structure: Structure, parameter: Callable[[str], ca.SX]
) -> list[ContactSymbols]:
    """The contacts, one by one."""
    return [
        ContactSymbols(
            of_form(form), parameter(f"contact_point_{i}"), parameter(f"contact_surface_{i}")
        )
        for i, (form, _) in enumerate(structure.contacts)
    ]


def has_closed_form(mechanism: Mechanism) -> bool:
    """Whether the parasitic motion of the mechanism needs no iteration."""
    forms = [contact.offset_surface.form for contact in mechanism.contacts]
    return closed_form_available(forms, dependent_coordinates(mechanism))


def require_closed_form(mechanism: Mechanism) -> None:
    """Raises UnsupportedError where route `direct` has no closed-form parasitic motion."""
    if not has_closed_form(mechanism):
        kinds = [contact.surface.kind for contact in mechanism.contacts]
        dependent = dependent_coordinates(mechanism)
        raise UnsupportedError(
            "route direct needs parasitic motion in closed form: at most two contacts, on planes, "
            f"with at most one dependent angle. This mechanism has {len(kinds)} "
            f"({', '.join(kinds)}) with dependent {', '.join(dependent)}. Use route core, which "
            "gives the same efforts"
        )


def _slots(sizes: dict[str, int]) -> dict[str, Slot]:
    slots, start = {}, 0
    for name, count in sizes.items():
        slots[name] = (start, count)
        start += count
    return slots
