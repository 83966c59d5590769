"""Where a kernel finds its numbers: sample inputs, parameters of the mechanism, lanes of chains."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ..dynamics.equations import has_closed_form
from ..kinematics.chain import FAMILIES
from ..kinematics.contact import ContactSymbols, angle_equation, mean_and_difference
from ..mechanism.mechanism import Mechanism
from ..mechanism.surface import of_form
from .spec import KernelSpec

Slot = tuple[int, int]  # start, count
Vector = tuple[float, ...]
INERTIA = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # order of an inertia's entries


@dataclass(frozen=True)
class Layout:
    """Names to positions.

    inputs:     names of the sample inputs, in order.
    parameters: shared numbers of the mechanism.
    lanes:      numbers of a chain, by group.
    """

    inputs: list[str]
    parameters: dict[str, Slot]
    lanes: list[dict[str, Slot]]
    spec: KernelSpec

    @staticmethod
    def of(spec: KernelSpec) -> Layout:
        names = ["q", "q1", "q2"]
        inputs = [f"{name}_{i}" for name in names for i in range(spec.m)]
        inputs += [f"force_{i}" for i in range(3)]
        inputs += [f"moment_{i}" for i in range(3)] if spec.moment else []
        body = {"mass": 1, "first_moment": 3, "inertia": 6}
        sizes = {"gravity": 3, **body, **{f"folded_{name}": n for name, n in body.items()}}
        sizes |= {"load_point": 3, "branch": 1}
        if spec.parallel:
            sizes |= {"slope": 2, "mean": 3, "mean_offset": 1, "difference": 3, "gap": 1}
        else:
            for i, (_, count) in enumerate(spec.contacts):
                sizes |= {f"contact_point_{i}": 3, f"contact_surface_{i}": count}
        lanes = [
            _slots({"active": 1, "joint": 3, "constants": FAMILIES[kind].size()})
            for kind, _ in spec.chains
        ]
        return Layout(inputs, _slots(sizes), lanes, spec)

    def contact_symbols(self, parameters: Callable[[str], ca.SX]) -> list[ContactSymbols]:
        """The contacts, their numbers by name."""
        if self.spec.parallel:
            names = ("slope", "mean", "mean_offset", "difference", "gap")
            return mean_and_difference(of_form("plane"), *(parameters(name) for name in names))
        return [
            ContactSymbols(
                of_form(form), parameters(f"contact_point_{i}"), parameters(f"contact_surface_{i}")
            )
            for i, (form, _) in enumerate(self.spec.contacts)
        ]

    def parameter_values(self, mechanism: Mechanism, load_point: np.ndarray) -> np.ndarray:
        """Shared numbers of a mechanism and the point its load acts at, (size,)."""
        values: dict[str, Any] = {
            "gravity": mechanism.gravity,
            **_body(mechanism, {}),
            **{f"folded_{name}": v for name, v in _body(mechanism, end_masses(mechanism)).items()},
            "load_point": load_point,
            "branch": 1.0,
        }
        for i, contact in enumerate(mechanism.contacts):
            values[f"contact_point_{i}"] = contact.point
            values[f"contact_surface_{i}"] = contact.locus.constants()
        if self.spec.parallel:
            first, second = (np.array(c.point) for c in mechanism.contacts)
            a, b = (c.locus.constants() for c in mechanism.contacts)
            values |= {"slope": a[:2], "mean": (first + second) / 2, "difference": first - second}
            values |= {"mean_offset": (a[2] + b[2]) / 2, "gap": a[2] - b[2]}
        if has_closed_form(mechanism):
            contacts = self.contact_symbols(lambda name: ca.SX(ca.DM(np.ravel(values[name]))))
            equation = angle_equation(contacts, self.spec.dependent, ca.SX.zeros(6))
            values["branch"] = -float(np.sign(float(ca.evalf(equation.B))))
        return np.concatenate([np.ravel(values[name]) for name in self.parameters]).astype(float)

    def lane_values(self, mechanism: Mechanism, width: int = 1) -> list[np.ndarray]:
        """Numbers of the chains, (size, count) a group.

        Args: width: lanes a vector; groups are filled up to it with chains that do nothing.
        """
        groups = []
        for kind, _ in self.spec.chains:
            family = FAMILIES[kind]
            chains = [c for c in mechanism.chains if c.kind == kind]
            rows = [[1.0, *c.platform, *family.vector(family.constants(c))] for c in chains]
            idle = family.constants(chains[0])
            if self.spec.formulation == "virtual_power":
                idle |= {name: np.zeros_like(idle[name]) for name in family.idle}
            rows += [[0.0, *chains[0].platform, *family.vector(idle)]] * (-len(chains) % width)
            groups.append(np.array(rows).T.copy())
        return groups

    def chain_order(self, mechanism: Mechanism) -> list[int]:
        """Where each lane, group by group, stands among the mechanism's chains."""
        return [
            i
            for kind, _ in self.spec.chains
            for i, chain in enumerate(mechanism.chains)
            if chain.kind == kind
        ]


def end_masses(mechanism: Mechanism) -> dict[Vector, float]:
    """Masses [kg] of the chains that move with the platform's joints, by the joints' points."""
    masses: dict[Vector, float] = {}
    for chain in mechanism.chains:
        family = FAMILIES[chain.kind]
        constants = family.named(ca.SX(ca.DM(family.vector(family.constants(chain)))))
        found = [float(ca.evalf(mass)) for mass in family.end_masses(constants).values()]
        masses[tuple(chain.platform)] = masses.get(tuple(chain.platform), 0.0) + sum(found)
    return masses


def _body(mechanism: Mechanism, points: dict[Vector, float]) -> dict[str, Any]:
    """Mass, first moment and inertia about O_M, in {M}, of the platform and point masses on it.

    Sums are exact before they are rounded: what a symmetric mechanism makes zero is zero.
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


def specialise(spec: KernelSpec, parameters: np.ndarray, lanes: list[np.ndarray]) -> KernelSpec:
    """The spec that leaves out what is zero in this mechanism."""
    zeros = [(-1, int(i)) for i in np.flatnonzero(parameters == 0)]
    for group, values in enumerate(lanes):
        zeros += [(group, int(i)) for i in np.flatnonzero((values == 0).all(axis=1))]
    return replace(spec, zeros=tuple(zeros))


def _slots(sizes: dict[str, int]) -> dict[str, Slot]:
    slots, start = {}, 0
    for name, count in sizes.items():
        slots[name] = (start, count)
        start += count
    return slots
