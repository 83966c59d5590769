"""The balance of forces of a motion under activations: what is left of it, for optimal motion.

    balance = Pi^T Q - (J Pi)^T tau,    tau = passive + activation active

It is linear in the activations and in q''; the tensions follow from q and q' (`excitation`).
"""

from __future__ import annotations

import casadi as ca

from ..dynamics import FORMULATIONS
from ..graph.program import Program
from ..status import Status
from .builder import Builder
from .equations import Wrench, equations
from .excitation import NUMBERS, contraction
from .inverse import DOUBTFUL, MUSCLE
from .platform import closed, feasibility
from .structure import Structure


def activated(structure: Structure) -> Program:
    """Efforts from q, q', q'', a load, and activations: those of chains without a muscle are their
    efforts over the first of their numbers.

    Ports: activation;  muscle (9,): of `muscle_numbers`.
    Results: balance (m,), dual to q';  contact_force (k,).
    """
    b = Builder(structure)
    platform, load = closed(b), Wrench.of(b)
    numbers, activation = b.lane_sample("muscle", len(NUMBERS) + 1), b.lane_sample("activation")
    lump = FORMULATIONS[structure.formulation].lumps
    eq = equations(b, platform, load, route="core", lump=lump)
    effort, still = [], ca.SX(0)
    for i, kind in enumerate(structure.families):
        own = activation[i]
        if kind == MUSCLE:
            effort.append(contraction(b, i, eq.state, numbers[i], own, still, still).tension)
        else:
            effort.append(own * numbers[i][0])
    carried = b.total([row * tau for row, tau in zip(eq.A, effort, strict=True)])
    b.output("balance", eq.basis.generalized_force(eq.Q) - carried, "N, N m", structure.m)
    k = len(structure.contacts)
    b.output("contact_force", eq.contact_forces(platform, effort), "N", k)
    discriminants = [chain.dynamics.discriminant for chain in eq.chains]
    b.check(feasibility(b, platform, discriminants), DOUBTFUL, Status.unreachable)
    return b.finish()
