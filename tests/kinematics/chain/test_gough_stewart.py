"""The bundled Gough-Stewart platform against a Newton-Euler computation of its own.

Thirteen bodies cut free, 78 balances in 78 unknowns: at each leg the forces at B and M, the five
reactions of the sliding joint, the guide's moment, and the actuator's force. Motion comes from
positions alone (`jets`); nothing of condyle is used but its results.
"""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest
from oracles.bodies import Body, leg, platform
from oracles.jets import Array, Jet
from support.families import close
from support.loads import parts

import condyle
from condyle.dynamics import FORMULATIONS
from condyle.mechanism import bundled_text
from condyle.model.model import Model

RAW = tomllib.loads(bundled_text("gough-stewart"))
GRAVITY = np.array(RAW["gravity"], float)
PAYLOAD = np.array(RAW["platform"]["points"]["payload"])


def states(count: int = 6) -> tuple[Array, Array, Array, Array]:
    rng = np.random.default_rng(2)
    size = np.repeat([0.4, 0.3], 3)
    q, q1, q2 = rng.uniform(-1, 1, (3, count, 6)) * size * np.array([[[1.0]], [[3.0]], [[9.0]]])
    q[0] = 0
    return q, q1, q2, rng.normal(0, 2000, (count, 6))


def plain_newton_euler(pose: Jet, wrench: Array) -> dict[str, Any]:
    """Efforts, and forces at B and M and on the piston, of one sample."""
    top = platform(RAW, pose, 1.0)
    A, b = np.zeros((78, 78)), np.zeros(78)

    def balance(row: int, body: Body) -> None:
        force, moment = body.needs(GRAVITY)
        b[row : row + 3], b[row + 3 : row + 6] = force, moment

    def push(row: int, body: Body, columns: slice, forces: Array, point: Array) -> None:
        A[row : row + 3, columns] += forces
        A[row + 3 : row + 6, columns] += np.cross(point - body.centre.x, forces, axisb=0, axisc=0)

    balance(0, top)
    arm = top.R.x @ PAYLOAD
    b[:3] -= wrench[:3]
    b[3:6] -= np.cross(arm, wrench[:3]) + wrench[3:]
    for i, chain in enumerate(RAW["chain"]):
        M = top.centre + top.R @ np.array(chain["platform"])
        r, (cylinder, piston) = leg(chain, M, 1.0)
        low, high, first = 6 + 12 * i, 12 + 12 * i, 13 * i
        at_B, at_M, slide, turn, guide, tau = (
            slice(first + k, first + end)
            for k, end in ((0, 3), (3, 6), (6, 8), (8, 11), (11, 12), (12, 13))
        )
        balance(low, cylinder)
        balance(high, piston)
        across, along = r.R.x[:, 1:], r.R.x[:, :1]
        push(low, cylinder, at_B, np.eye(3), r.start.x)
        A[low + 3 : low + 6, guide] = r.guide[:, None]
        for columns, directions in ((slide, across), (tau, along)):
            push(high, piston, columns, directions, M.x)
            push(low, cylinder, columns, -directions, M.x)
        A[high + 3 : high + 6, turn] = np.eye(3)
        A[low + 3 : low + 6, turn] = -np.eye(3)
        push(high, piston, at_M, -np.eye(3), M.x)
        push(0, top, at_M, np.eye(3), M.x)
    x = np.linalg.solve(A, b).reshape(6, 13)
    return {"tau": x[:, 12], "at_B": x[:, :3], "at_M": x[:, 3:6], "turn": x[:, 8:11]}


def test_published_numbers() -> None:
    """Radii 3 and 1 m, height 2 m, 2.5 and 10 degrees; steel tubes and bars of 3/4 the length."""
    mechanism, density = condyle.load_mechanism("gough-stewart"), 76000 / 9.81

    def ring(radius: float, height: float, degrees: list[float]) -> Array:
        a = np.radians(degrees)
        return np.stack([radius * np.cos(a), radius * np.sin(a), 0 * a + height], axis=1)

    base = ring(3.0, -2.0, [-2.5, 2.5, 117.5, 122.5, 237.5, 242.5])
    top = ring(1.0, 0.0, [-50, 50, 70, 170, 190, 290])
    close([c.base for c in mechanism.chains], base, 1e-9)
    close([c.platform for c in mechanism.chains], top, 1e-9)
    size = 0.75 * np.linalg.norm(top - base, axis=1)[0]
    outer, inner = 0.05, 0.03
    for body, (a, b) in {"cylinder": (outer, inner), "piston": (inner, 0.0)}.items():
        mass = density * np.pi * (a**2 - b**2) * size
        wanted = [mass, size / 2, mass * (3 * (a**2 + b**2) + size**2) / 12]
        wanted.append(mass * (a**2 + b**2) / 2)
        for chain in mechanism.chains:
            table = getattr(chain, body)
            got = [table.mass, table.com, table.transverse, table.axial]
            np.testing.assert_allclose(got, wanted, rtol=1e-4)
    plate = density * np.pi * 0.05
    inertia = mechanism.platform.inertia
    np.testing.assert_allclose(mechanism.platform.mass, plate, rtol=1e-6)
    np.testing.assert_allclose(inertia.zz, plate / 2, rtol=1e-6)
    np.testing.assert_allclose(inertia.xx, plate * (3 + 0.05**2) / 12, rtol=1e-6)


@pytest.fixture(scope="module")
def wanted() -> list[dict[str, Any]]:
    q, q1, q2, wrench = states()
    return [plain_newton_euler(Jet(*s), w) for *s, w in zip(q, q1, q2, wrench, strict=True)]


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_efforts(wanted: list[dict[str, Any]], formulation: str) -> None:
    model = Model(condyle.load_mechanism("gough-stewart"), formulation=formulation, backend="numpy")
    q, q1, q2, wrench = states()
    load = np.hstack([wrench, np.tile(PAYLOAD, (len(q), 1))])
    close(
        model.inverse_dynamics(q, q1, q2, *parts(load)).effort,
        [w["tau"] for w in wanted],
        1e-11,
    )


def test_reactions(wanted: list[dict[str, Any]]) -> None:
    from condyle.model.joint_reactions import reactions

    model = Model(condyle.load_mechanism("gough-stewart"), backend="numpy")
    q, q1, q2, wrench = states()
    load = np.hstack([wrench, np.tile(PAYLOAD, (len(q), 1))])
    found = reactions(model, model.inverse_dynamics(q, q1, q2, *parts(load), outputs="all"))
    for i, w in enumerate(wanted):
        for k, name in enumerate(model.mechanism.chain_names):
            close(found[f"base_joint_{name}"].array[i], w["at_B"][k], 1e-10)
            close(found[f"platform_joint_{name}"].array[i], w["at_M"][k], 1e-10)
            close(found[f"sleeve_moment_{name}"].array[i], w["turn"][k], 1e-9)


def test_weight_alone_at_home() -> None:
    """At rest the vertical forces at the base carry the whole weight."""
    from condyle.model.joint_reactions import reactions

    mechanism = condyle.load_mechanism("gough-stewart")
    model = Model(mechanism, backend="numpy")
    zero = np.zeros((1, 6))
    found = reactions(model, model.inverse_dynamics(zero, zero, zero, outputs="all"))
    total = sum(found[f"base_joint_{name}"].array[0] for name in mechanism.chain_names)
    mass = mechanism.platform.mass
    mass += sum(c.cylinder.mass + c.piston.mass for c in mechanism.chains)
    close(total, [0, 0, 9.81 * mass], 1e-12)
