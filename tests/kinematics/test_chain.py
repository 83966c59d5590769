"""Chains in closed form: joint coordinates, the loop, and their rates ([Cheng2023] eqs 12-28)."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from oracles.description import joint, read, rod_angles, rod_rotation
from oracles.random_mechanism import random_mechanism, random_state, toml_text
from oracles.rotations import platform_motion

import condyle
from condyle.kinematics.chain import FAMILIES
from condyle.kinematics.chain.family import rod_spin
from condyle.mechanism import Mechanism, parse

CASES = {kind: {"families": (kind,)} for kind in FAMILIES}
CASES |= {"RSS along X": {"rod_along_x": True}, "RSS far off X": {"spread": 3.0}}


@cache
def drawn(case: str) -> tuple[dict[str, Any], Mechanism]:
    raw = random_mechanism(np.random.default_rng(6), contacts=1, **CASES[case])
    return raw, parse(toml_text(raw))


@cache
def numeric(kind: str) -> dict[str, ca.Function]:
    """The family's loop, tip and first law as numbers: of its constants and M, M', M''."""
    family = FAMILIES[kind]
    c, q = ca.SX.sym("c", family.size()), ca.SX.sym("q", 3)
    M, V, A, g = (ca.SX.sym(name, 3) for name in "MVAg")
    named = family.named(c)
    loop, tip = family.loop(named, M), family.end_point(named, q)
    law = family.dynamics(named, M, V, A, g)
    return {
        "loop": ca.Function("loop", [c, M], [loop.q_r, loop.J, loop.rod, loop.J_A]),
        "law": ca.Function("law", [c, M, V, A, g], [law.rate, law.acceleration, law.J]),
        "tip": ca.Function("tip", [c, q], [tip, ca.jacobian(tip, q)]),
    }


@pytest.mark.parametrize("case", CASES)
def test_joint_coordinates_meet_the_oracle(case: str) -> None:
    """theta_i on the branch of home, beta_i, gamma_i of N_i0."""
    raw, mechanism = drawn(case)
    d = read(raw)
    poses = np.vstack([random_state(np.random.default_rng(1), raw, 6)["pose"], np.zeros(6)])
    found = condyle.derive(mechanism).poses.configuration(poses)
    for i, pose in enumerate(poses):
        motion = platform_motion(pose)
        for k, chain in enumerate(d.chains):
            P = motion.point(chain.M)[0]
            x, S = joint(chain, P)
            wanted = (x, *rod_angles(chain, P - S))
            got = [a[i, k] for a in (found.joint, found.beta, found.gamma)]
            np.testing.assert_allclose(got, wanted, atol=1e-14)
            assert found.cos_gamma[i, k] == pytest.approx(np.cos(wanted[2]), abs=1e-14)
            assert found.discriminant[i, k] > 0
    np.testing.assert_allclose(found.joint[-1], 0, atol=1e-14)


@pytest.mark.parametrize("case", CASES)
def test_loop_closes_and_its_rates_are_derivatives(case: str) -> None:
    """tip(q_r) = M; M_1 q_r' = M'; J_A q' = rod . M'; the law's rate and acceleration."""
    _, mechanism = drawn(case)
    rng = np.random.default_rng(3)
    h = 1e-3
    for chain in mechanism.chains:
        f, family = numeric(chain.kind), FAMILIES[chain.kind]
        constants = family.vector(family.constants(chain))
        M0 = np.array(chain.platform) + rng.normal(0, 0.0005, 3)
        V, A = rng.normal(0, 0.02, 3), rng.normal(0, 0.1, 3)
        around = [M0 + V * t + A * t * t / 2 for t in h * np.arange(-2, 3)]
        left2, left, (q_r, J, rod, J_A), right, right2 = (
            [v.full().ravel() for v in f["loop"](constants, M)] for M in around
        )
        tip, M_1 = (v.full() for v in f["tip"](constants, q_r))
        rates = (8 * (right[0] - left[0]) - (right2[0] - left2[0])) / (12 * h)
        second = 16 * (right[0] + left[0]) - right2[0] - left2[0] - 30 * q_r
        second /= 12 * h * h
        rate, acceleration, J_of_law = (
            v.full().ravel() for v in f["law"](constants, M0, V, A, np.zeros(3))
        )
        size = np.abs(rates).max()
        np.testing.assert_allclose(tip.ravel(), M0, atol=1e-15)
        np.testing.assert_allclose(M_1 @ rates, V, atol=1e-9)
        np.testing.assert_allclose(rates[0], J @ V, atol=1e-8 * size)
        np.testing.assert_allclose(J_A[0] * rates[0] + 2 * rod @ V, 0, atol=1e-10)
        np.testing.assert_allclose(rate, J @ V, atol=1e-13 * size)
        np.testing.assert_allclose(J_of_law, J, atol=1e-13 * np.abs(J).max())
        np.testing.assert_allclose(acceleration, second[0], atol=1e-5 * np.abs(second).max())
        np.testing.assert_allclose(np.linalg.inv(M_1)[0], J, atol=1e-12 * np.abs(J).max())


def test_rods_turn_with_their_two_angles() -> None:
    """omega = W (., beta', gamma') of N_i0 Ry(beta) Rz(gamma), the axial rate included."""
    chain = read(drawn("RSS")[0]).chains[0]
    q, rates, h = np.array([0.3, 0.4, -0.7]), np.array([1.0, 0.8, -0.5]), 1e-5
    before, here, after = (rod_rotation(chain, *(q + s * h * rates)[1:]) for s in (-1, 0, 1))
    spin = (after - before) / (2 * h) @ here.T
    W = np.asarray(ca.DM(ca.evalf(rod_spin(ca.SX(ca.DM(chain.N0)), ca.SX(ca.DM(q))))))
    omega = W @ rates
    np.testing.assert_allclose(omega, [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-9)
    assert omega @ here[:, 0] == pytest.approx(rates[1] * np.sin(q[2]), abs=1e-12)
