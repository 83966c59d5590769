"""Inverse dynamics within effort limits: efforts and contact forces of a motion under a load."""

from __future__ import annotations

from itertools import product

import casadi as ca

from ..dynamics import FORMULATIONS
from ..graph.program import Programs
from ..kinematics.chain import ChainDynamics
from ..status import Status
from .allocation import TERMS, Allocated, EffortBox, allocate, least_pattern
from .bound import CERTIFIED, bound, data_error
from .builder import Builder
from .equations import Wrench, equations
from .inverse import DOUBTFUL, feasibility
from .platform import PlatformState, closed, contacts
from .structure import Structure


def limited(structure: Structure, term: str = "square", weighs: bool = False) -> Programs:
    """Efforts and contact forces, from q, q', q'', the load and the limits.

    Samples that fail its checks take the robust path.

    Args: term: of the objective, see `TERMS`;  weighs: whether contact forces have a weight.
    """
    b = Builder(structure)
    platform, load = closed(b), Wrench.of(b)
    answer, chains = within(b, platform, load, EffortBox.ports(b, weighs), term)
    b.output("bound", ca.fmax(CERTIFIED, bound(data_error(b, platform, chains))), "1")
    discriminants = [chain.discriminant for chain in chains]
    b.output("effort", answer.effort, "N m or N")
    b.output("contact_force", answer.force, "N", len(structure.contacts))
    b.check(feasibility(b, platform, discriminants), DOUBTFUL, Status.unreachable)
    b.check(1 - 2 * answer.none, 0.5, Status.infeasible)
    b.check(answer.sure, 0.5)
    return Programs(b.finish(), single=True)


def within(
    b: Builder, platform: PlatformState, load: Wrench, limits: EffortBox, term: str = "square"
) -> tuple[Allocated, list[ChainDynamics]]:
    """Efforts within limits, minimised over all friction signs, and the chains' motion."""
    s = b.structure
    lump = FORMULATIONS[s.formulation].lumps
    eq = equations(b, platform, load, route="core", lump=lump)
    touch, rows = contacts(b, platform), [chain.row for chain in eq.chains]
    both = eq.state.B.T @ touch.N, eq.state.B.T @ touch.T
    signs = [(1, -1) if i in s.friction else (0,) for i in range(len(s.contacts))]
    cost = TERMS[term]

    def solve(D: ca.SX, own: EffortBox) -> Allocated:
        return allocate(b, eq.Q, rows, D, own, cost, cost.turns)

    found = least_pattern(both, list(product(*signs)), limits, solve)
    return found, [chain.dynamics for chain in eq.chains]
