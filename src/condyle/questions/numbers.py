"""A mechanism's numbers and their layout: shared parameters, lanes of chains."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from ..dynamics import FORMULATIONS
from ..errors import UnsupportedError
from ..graph.program import Numbers
from ..kinematics.chain import FAMILIES
from ..kinematics.chain.family import Constants
from ..kinematics.constraints import (
    ContactSymbols,
    angle_equation,
    closed_form_available,
    mean_and_difference,
)
from ..mechanism.chain import Chain
from ..mechanism.home import characteristic_length, dependent_coordinates
from ..mechanism.mechanism import Mechanism
from ..mechanism.surface import of_form
from .structure import Structure

LOSSES = tuple(
    f"actuator.{key}" for key in ("rotor_inertia", "gear", "viscous", "coulomb", "smoothing_speed")
)
NO_LOSSES = (0.0, 0.0, 0.0, 1.0)
Parameter = Callable[[str], ca.SX]  # a mechanism's number by name
Slot = tuple[int, int]  # start, count
Vector = tuple[float, ...]
ChainNumbers = dict[str, np.ndarray]  # constants of a chain by name
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
        losses = {"actuator": len(NO_LOSSES)} if structure.losses else {}
        lanes = [
            _slots({"mask": 1, "joint": 3, "constants": FAMILIES[kind].size()} | losses)
            for kind in structure.families
        ]
        return Layout(structure, _slots(sizes), lanes)

    @staticmethod
    def of_file(structure: Structure) -> Layout:
        """Numbers as a mechanism file has them, which `file_numbers` makes the others of."""
        sizes = {"gravity": 3, "mass": 1, "inertia": 6, "landmark": 3}
        for i, (_, count) in enumerate(structure.contacts):
            sizes |= {f"contact_point_{i}": 3, f"contact_surface_{i}": count}
        sizes |= {f"friction_{i}": 3 for i in structure.friction}
        losses = dict.fromkeys(LOSSES, 1) if structure.losses else {}
        lanes = [_slots(FAMILIES[kind].numbers | losses) for kind in structure.families]
        return Layout(structure, _slots(sizes), lanes)

    @property
    def sizes(self) -> tuple[int, list[int]]:
        """How many shared numbers there are, and numbers of a lane, group by group."""

        def total(slots: dict[str, Slot]) -> int:
            return sum(count for _, count in slots.values())

        return total(self.parameters), [total(slots) for slots in self.lanes]

    def file_values(self, mechanism: Mechanism, landmark: str | None = None) -> dict[str, Any]:
        """Shared numbers of `of_file`, by name; of friction the smoothing speed, not its square."""
        values = self._values(mechanism, landmark, constants_of(mechanism))
        for i in self.structure.friction:
            f = mechanism.contacts[i].friction
            values[f"friction_{i}"] = (f.coefficient, f.smoothing_speed, values[f"friction_{i}"][2])
        return {name: np.ravel(values[name]) for name in self.parameters}

    def _values(
        self, mechanism: Mechanism, landmark: str | None, constants: Sequence[ChainNumbers]
    ) -> dict[str, Any]:
        """Shared numbers of a mechanism, by name."""
        points = [contact.point for contact in mechanism.contacts]
        masses = end_masses(mechanism, constants)
        values: dict[str, Any] = {
            "gravity": mechanism.gravity,
            **_body(mechanism, {}),
            **{f"lumped_{name}": v for name, v in _body(mechanism, masses).items()},
            "branch": 1.0,
            "length": characteristic_length(mechanism),
            "landmark": mechanism.platform.points[landmark] if landmark else (0.0, 0.0, 0.0),
            "middle": np.mean(points, axis=0) if points else (0.0, 0.0, 0.0),
        }
        for i, contact in enumerate(mechanism.contacts):
            values[f"contact_point_{i}"] = contact.point
            values[f"contact_surface_{i}"] = contact.offset_surface.constants()
            if i in self.structure.friction:
                f, radius = contact.friction, contact.push * (contact.ball_radius or 0.0)
                values[f"friction_{i}"] = (f.coefficient, f.smoothing_speed**2, radius)
        if self.structure.parallel:
            first, second = (np.array(c.point) for c in mechanism.contacts)
            a, b = (c.offset_surface.constants() for c in mechanism.contacts)
            values |= {"slope": a[:2], "mean": (first + second) / 2, "difference": first - second}
            values |= {"mean_offset": (a[2] + b[2]) / 2, "gap": a[2] - b[2]}
        if has_closed_form(mechanism):
            values["branch"] = closed_branch(mechanism)
        return values

    def numbers(self, mechanism: Mechanism, landmark: str | None = None) -> Numbers:
        """The numbers of a mechanism, as backends take them.

        Args: landmark: the platform point whose path is given, if one is.
        """
        constants = constants_of(mechanism)
        values = self._values(mechanism, landmark, constants)
        parameters = np.concatenate([np.ravel(values[name]) for name in self.parameters])
        lanes, padding = [], []
        for kind in self.structure.families:
            family = FAMILIES[kind]
            own = zip(mechanism.chains, constants, strict=True)
            chains = [(chain, given) for chain, given in own if chain.kind == kind]
            rows = [[1.0, *c.platform, *family.vector(g), *self._losses(c)] for c, g in chains]
            first, idle = chains[0]
            idle = idle | {name: np.zeros_like(idle[name]) for name in self.pads(kind)}
            lanes.append(np.array(rows, dtype=float).T.copy())
            none = [*NO_LOSSES] if self.structure.losses else []
            padding.append(np.array([0.0, *first.platform, *family.vector(idle), *none]))
        order = tuple(
            i
            for kind in self.structure.families
            for i, chain in enumerate(mechanism.chains)
            if chain.kind == kind
        )
        return Numbers(parameters.astype(float), tuple(lanes), tuple(padding), order)

    def _losses(self, chain: Chain) -> list[float]:
        """Rotor's inertia at the joint, viscous and Coulomb friction, squared smoothing speed."""
        if not self.structure.losses:
            return []
        a = chain.actuator
        return [a.reflected_inertia, a.viscous, a.coulomb, a.smoothing_speed**2]

    def pads(self, kind: str) -> tuple[str, ...]:
        """Constants of a family that are 0 in a padding lane, so that it contributes nothing."""
        own = FORMULATIONS[self.structure.formulation].pads
        return FAMILIES[kind].padding if own else ()


def specialised(structure: Structure, numbers: Numbers) -> Structure:
    """The structure with this mechanism's zeros left out."""
    zeros = [(-1, int(i)) for i in np.flatnonzero(numbers.parameters == 0)]
    for group, (values, pad) in enumerate(zip(numbers.lanes, numbers.padding, strict=True)):
        none = (values == 0).all(axis=1) & (pad == 0)
        zeros += [(group, int(i)) for i in np.flatnonzero(none)]
    return replace(structure, zeros=frozenset(zeros))


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


def closed_branch(mechanism: Mechanism) -> float:
    """-sign(B) of the angle equation at home, which keeps the dependent angle on its branch."""
    if not mechanism.contacts:
        return 0.0
    forms = tuple((c.offset_surface.form, 3) for c in mechanism.contacts)
    given = [n for c in mechanism.contacts for n in (*c.point, *c.offset_surface.constants())]
    B = _angle_sine(forms, dependent_coordinates(mechanism))
    return -float(np.sign(float(B(*given))))


@lru_cache(maxsize=32)
def _angle_sine(forms: tuple[tuple[str, int], ...], dependent: tuple[str, ...]) -> ca.Function:
    """B of the angle equation at home, from each contact's point and the constants of its plane."""
    symbols = [(ca.SX.sym("p", 3), ca.SX.sym("c", count)) for _, count in forms]
    contacts = [
        ContactSymbols(of_form(form), p, c)
        for (form, _), (p, c) in zip(forms, symbols, strict=True)
    ]
    given = [entry for pair in symbols for part in pair for entry in ca.vertsplit(part)]
    return ca.Function("B", given, [angle_equation(contacts, dependent, ca.SX.zeros(6)).B])


def constants_of(mechanism: Mechanism) -> list[ChainNumbers]:
    """Constants of every chain, by the names of its family."""
    found = ((FAMILIES[chain.kind], chain) for chain in mechanism.chains)
    return [
        {name: np.asarray(v, dtype=float) for name, v in family.constants(chain).items()}
        for family, chain in found
    ]


def end_masses(mechanism: Mechanism, constants: Sequence[ChainNumbers]) -> dict[Vector, float]:
    """End masses of the chains [kg], by the points of the platform joints.

    Args: constants: as of `constants_of`.
    """
    masses: dict[Vector, float] = {}
    for chain, own in zip(mechanism.chains, constants, strict=True):
        found = FAMILIES[chain.kind].end_masses(Constants({n: v[()] for n, v in own.items()}))
        joint = tuple(chain.platform)
        masses[joint] = masses.get(joint, 0.0) + sum(map(float, found.values()))
    return masses


def _body(mechanism: Mechanism, points: dict[Vector, float]) -> dict[str, Any]:
    """Mass, first moment and inertia about O_M, in {M}, of the platform and point masses on it.

    Sums are rounded once, so that symmetric mechanisms have exact zeros.
    """
    platform, xx = mechanism.platform, range(3)
    own = platform.inertia.tensor()
    second = [[math.fsum(m * p[i] * p[j] for p, m in points.items()) for j in xx] for i in xx]
    trace = math.fsum(second[i][i] for i in xx)
    inertia = [own[i, j] + (trace if i == j else 0.0) - second[i][j] for i, j in INERTIA]
    return {
        "mass": platform.mass + math.fsum(points.values()),
        "first_moment": [math.fsum(m * p[i] for p, m in points.items()) for i in xx],
        "inertia": inertia,
    }


def _slots(sizes: dict[str, int]) -> dict[str, Slot]:
    slots, start = {}, 0
    for name, count in sizes.items():
        slots[name] = (start, count)
        start += count
    return slots
