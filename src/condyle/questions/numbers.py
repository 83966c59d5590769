"""A mechanism's numbers and their layout: shared parameters, lanes of chains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ..dynamics import FORMULATIONS
from ..errors import UnsupportedError
from ..graph.program import ManyNumbers, Numbers
from ..kinematics.chain import FAMILIES
from ..kinematics.constraints import (
    ContactSymbols,
    closed_form_available,
    mean_and_difference,
)
from ..mechanism.home import dependent_coordinates
from ..mechanism.mechanism import Mechanism
from ..mechanism.surface import of_form
from ..mechanism.surface.wall import Wall
from .structure import Structure

LOSSES = tuple(
    f"actuator.{key}" for key in ("rotor_inertia", "gear", "viscous", "coulomb", "smoothing_speed")
)
ZERO = "actuator.zero"  # what an encoder reads at home
NO_LOSSES = (0.0, 0.0, 0.0, 1.0)
Parameter = Callable[[str], ca.SX]  # a mechanism's number by name
Slot = tuple[int, int]  # start, count
# Numbers of a ligament in the file, and how many; of a table twice its rows.
LIGAMENT = {"base": 3, "platform": 3, "slack_length": 1, "stiffness": 1, "damping": 1}
INERTIA = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # order of an inertia's entries


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
        losses = {"actuator": len(NO_LOSSES)} if structure.losses else {}
        lanes = [
            _slots({"mask": 1, "joint": 3, "constants": FAMILIES[kind].size(), "zero": 1} | losses)
            for kind in structure.families
        ]
        return Layout(structure, _slots(sizes), lanes)

    @staticmethod
    def of_file(structure: Structure, walls: Sequence[Wall]) -> Layout:
        """Numbers as a mechanism file has them, which `file_numbers` makes the others of.

        A contact's `home` is no number of the file, but where Newton starts and what is kept: the
        unit normal and `Wall.miss` of the nominal mechanism.
        """
        sizes = {"gravity": 3, "mass": 1, "com": 3, "inertia": 6, "landmark": 3}
        for i, wall in enumerate(walls):
            sizes |= {f"contact_point_{i}": 3, f"contact_surface_{i}": wall.size}
            sizes |= {f"contact_ball_{i}": 1} if wall.push else {}
            sizes |= {f"contact_home_{i}": 4} if wall.general or wall.kept else {}
        sizes |= {f"friction_{i}": 2 for i in structure.friction}
        for i, rows in enumerate(structure.ligaments):
            own = LIGAMENT | ({"stiffness": 2 * rows} if rows else {})
            sizes |= {f"ligament_{name}_{i}": size for name, size in own.items()}
        for i in range(len(structure.walls)):
            sizes |= {f"wall_point_{i}": 3, f"wall_surface_{i}": 3}
        losses = dict.fromkeys(LOSSES, 1) if structure.losses else {}
        lanes = [
            _slots({**FAMILIES[kind].numbers, ZERO: 1} | losses) for kind in structure.families
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
    """The structure with this mechanism's zeros left out."""
    zeros = [(-1, int(i)) for i in np.flatnonzero(numbers.parameters == 0)]
    for group, (values, pad) in enumerate(zip(numbers.lanes, numbers.padding, strict=True)):
        none = (values == 0).all(axis=1) & (pad == 0)
        zeros += [(group, int(i)) for i in np.flatnonzero(none)]
    return replace(structure, zeros=frozenset(zeros))


def agree(structure: Structure, numbers: Numbers | ManyNumbers) -> bool:
    """Whether what a structure takes as zero is zero in a mechanism, or in all of them."""
    return all(
        not (numbers.parameters[..., i] if g < 0 else numbers.lanes[g][..., i, :]).any()
        for g, i in structure.zeros
    )


def characteristic(structure: Structure, numbers: Numbers) -> float:
    """The characteristic length [m], from a mechanism's numbers."""
    return float(numbers.parameters[Layout.of(structure).parameters["length"][0]])


def contact_symbols(
    structure: Structure, parameter: Callable[[str], ca.SX]
) -> list[ContactSymbols]:
    """The contacts, their numbers by name; parallel planes by their mean and difference."""
    if structure.parallel:
        names = ("slope", "mean", "mean_offset", "difference", "gap")
        return mean_and_difference(of_form("plane"), *(parameter(name) for name in names))
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
