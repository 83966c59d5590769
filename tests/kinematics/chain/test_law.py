"""The laws of a family: what its closed forms must satisfy, whatever the chain."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from support.families import case, close

from condyle.kinematics.chain import FAMILIES, Family

CASES = {"RSS": "rss", "PSS": "pss", "SPS": "sps_k0", "cable": "cable_k0", "muscle": "muscle_k0"}
ARCS = (ca.OP_ATAN, ca.OP_ATAN2, ca.OP_ACOS, ca.OP_ASIN)
# Operations a chain costs a sample in `dynamics`, numbers of the chain not counted.
OPERATIONS = {"RSS": 215, "PSS": 170, "SPS": 190, "cable": 20, "muscle": 20}
ROOTS_AND_DIVISORS = dict(zip(OPERATIONS, (4, 3, 3, 2, 2), strict=True))  # a divisor once


class Chain:
    """A family with the numbers of a random chain, and platform joints near its home."""

    def __init__(self, kind: str) -> None:
        self.family: Family = FAMILIES[kind]
        table = case(CASES[kind]).mechanism.chains[1]
        self.c = self.family.named(self.family.vector(self.family.constants(table)))
        near = np.random.default_rng(5).normal(0, 2e-3, (5, 3))
        self.joints = np.asarray(table.platform) + near


@pytest.fixture(params=FAMILIES)
def chain(request: pytest.FixtureRequest) -> Chain:
    return Chain(request.param)


def test_inertia_is_symmetric_and_positive(chain: Chain) -> None:
    M, V, A = (ca.SX.sym(name, 3) for name in "MVA")
    g = ca.SX([0.3, -0.2, -9.81])
    law = chain.family.dynamics(chain.c, M, V, A, g).complete(A, g)
    total = sum(law.forces.values(), ca.SX(3, 1))
    inertia = ca.Function("inertia", [M], [ca.jacobian(total, A)])
    for joint in chain.joints:
        I = np.asarray(inertia(joint))
        close(I, I.T, 1e-13)
        assert np.linalg.eigvalsh(I).min() >= -1e-13 * np.abs(I).max()


def test_dimensionless_transmission(chain: Chain) -> None:
    """|J_A| / scale is a sine, and J_A / |rod| the inverse of the row's length along the rod."""
    M = ca.SX.sym("M", 3)
    loop = chain.family.loop(chain.c, M)
    outputs = [loop.J_A, loop.J_A_scale, loop.J, loop.rod, loop.rod_length]
    function = ca.Function("posture", [M], outputs)
    for joint in chain.joints:
        J_A, scale, J, rod, length = (np.asarray(o).ravel() for o in function(joint))
        assert np.abs(J_A) <= scale * (1 + 1e-12)
        close(np.linalg.norm(rod), length, 1e-13)
        close(J, -2 * rod / J_A, 1e-12)  # J_A joint' + 2 rod . M' = 0


def test_laws_stay_cheap(chain: Chain) -> None:
    c, g = ca.SX.sym("c", chain.family.size()), ca.SX.sym("g", 3)
    M, V, A = (ca.SX.sym(name, 3) for name in "MVA")
    law = chain.family.dynamics(chain.family.named(c), M, V, A, g).complete(A, g)
    outputs = [sum(law.forces.values(), ca.SX(3, 1)), law.J]
    f = ca.Function("law", [c, g, M, V, A], ca.cse(outputs))
    made: dict[int, int] = {}  # where a value is kept -> the operation that made it
    varies: dict[int, bool] = {}
    operations: list[int] = []
    slow: set[tuple[bool, int]] = set()
    for k in range(f.n_instructions()):
        op, inputs, results = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
        if op == ca.OP_OUTPUT:
            continue
        sources = [] if op in (ca.OP_INPUT, ca.OP_CONST) else [made[i] for i in inputs]
        varies[k] = any(varies[i] for i in sources) or (op == ca.OP_INPUT and inputs[0] > 1)
        made[results[0]] = k
        if varies[k] and op != ca.OP_INPUT:
            operations.append(op)
            if op in (ca.OP_DIV, ca.OP_INV, ca.OP_SQRT):
                slow.add((op == ca.OP_SQRT, sources[-1]))
    assert not set(operations) & set(ARCS)
    assert len(operations) <= OPERATIONS[chain.family.kind]
    assert len(slow) <= ROOTS_AND_DIVISORS[chain.family.kind], slow
