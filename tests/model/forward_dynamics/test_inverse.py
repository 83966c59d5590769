"""Forward and inverse dynamics undo each other; every body is in balance."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, random_state
from oracles.rubbing import balance
from support import families
from support.rubbing import Rubbing
from support.speeds import first

import condyle
from condyle.dynamics import FORMULATIONS
from condyle.model.model import Model

from .cases import CASES, DRAWN, by_numpy, case, close, efforts, load_of, state

pytestmark = pytest.mark.slow

# Surfaces, by options of `random_mechanism`.
SURFACES: dict[str, dict[str, Any]] = {
    "every kind": {"surface": "mixed", "contacts": 5, "chains": 8},
    "balls": {"surface": ("ellipsoid", "quadratic"), "ball_radius": 4.0},
    "round balls": {"surface": ("sphere", "cylinder"), "ball_radius": 8.0},
    "profile": {"surface": "profile", "contacts": 1},
}


# Least norms of three contacts and more with friction take their time.
@pytest.mark.parametrize(
    "name", first([name for name in CASES if name not in ("PSS k4", "RSS k5")], 5)
)
def test_inverse_undoes_forward(name: str) -> None:
    """Of the efforts that make a motion, the motion; with friction, and the same forces."""
    c, model = case(name), by_numpy(name)
    s, load = c.states, load_of(c)
    q, q1 = state(c, model)
    order = [s["names"].index(coordinate) for coordinate in model.independent]
    q2 = s["qdd"][:, order]
    efforts = model.inverse_dynamics(q, q1, q2, *load, outputs="all")
    found = model.forward_dynamics(q, q1, efforts.effort, *load, outputs="all")
    good = efforts.status == 0
    assert good.any()
    assert not found.status[good].any()
    close(found.acceleration[good], q2[good], 1e-10)
    close(found.contact_force[good], efforts.contact_force[good], 1e-10)
    for result in ("pose", "pose_rate", "pose_acceleration", "joint_rate", "joint_acceleration"):
        close(getattr(found, result)[good], getattr(efforts, result)[good], 1e-10)


@pytest.mark.parametrize("name", ["human-jaw", "human-jaw-curved"])
def test_inverse_undoes_forward_of_muscles(name: str) -> None:
    """Tensions below zero too: what limits them does not matter to the equations."""
    model = Model(condyle.load_mechanism(name), distribution="minimum_norm", backend="numpy")
    rng = np.random.default_rng(5)
    sizes = np.array([0.002 if c in "XYZ" else 0.03 for c in model.independent])
    q, q1, q2 = (k * rng.normal(0, 1, (3, len(sizes))) * sizes for k in (1, 10, 300))
    load = np.hstack([rng.normal(0, 30, (3, 3)), np.zeros((3, 3))]), np.full(3, 0.02)
    efforts = model.inverse_dynamics(q, q1, q2, *load)
    assert not efforts.status.any()
    found = model.forward_dynamics(q, q1, efforts.effort, *load)
    assert not found.status.any()
    close(found.acceleration, q2, 1e-10)
    close(found.contact_force, efforts.contact_force, 1e-10)


def unrubbed(name: str) -> Rubbing:
    if name in SURFACES:
        rng = np.random.default_rng(sum(map(ord, name)))
        raw = random_mechanism(rng, condition=100.0, **SURFACES[name])
        return Rubbing(raw, random_state(rng, raw, 2))
    c = families.case(name)
    return Rubbing(c.raw, c.states)


@pytest.mark.parametrize(
    "name", [*families.MECHANISMS, "cable_k0", *SURFACES, "mixed k3 quadratic", "every family"]
)
def test_free_bodies_are_in_balance(name: str) -> None:
    """Six equations of free bodies a sample, by the accelerations that come out."""
    c = case(name) if name in DRAWN else unrubbed(name)
    model = by_numpy(name) if name in DRAWN else Model(c.mechanism, backend="numpy")
    s, effort = c.states, efforts(c)
    found = model.forward_dynamics(*state(c, model), effort, *load_of(c), outputs="all")
    assert not found.status.any()
    for i in range(0, len(effort), 2):
        given = s["pose"][i], s["pose_rate"][i], found.pose_acceleration[i], s["wrench"][i]
        b = balance(c.raw, *given, s["load_point"])
        force = found.contact_force[i]
        terms = [b.C @ effort[i], b.N @ force, -b.T @ np.abs(force), -b.b]
        close(sum(terms), np.zeros(6), 1e-10, np.abs(terms).max())
        rubs = b.rubbing()
        close(found.slip[i, rubs], b.slip[rubs], 1e-11)
        close(found.friction_force[i], -np.abs(force)[:, None] * b.drag, 1e-10)


@pytest.mark.parametrize("name", ["RSS k2 plain", "SPS k1"])
def test_formulations_agree(name: str) -> None:
    c, wanted = case(name), by_numpy(name)
    given = (*state(c, wanted), efforts(c), *load_of(c))
    best = wanted.forward_dynamics(*given, outputs="all")
    assert not best.status.any()
    for formulation in FORMULATIONS:
        model = Model(c.mechanism, formulation=formulation, backend="numpy")
        found = model.forward_dynamics(*given, outputs="all")
        assert not found.status.any()
        close(found.acceleration, best.acceleration, 1e-10)
        close(found.contact_force, best.contact_force, 1e-10)
        close(found.joint_acceleration, best.joint_acceleration, 1e-10)


@pytest.mark.parametrize("name", ["RSS k2 n8 quadratic", "PSS k4", "gough-stewart"])
def test_robust_path_says_the_same(name: str) -> None:
    """Samples that a kernel would doubt: by singular values and all patterns."""
    c, model = case(name), by_numpy(name)
    outputs = ("motion", "joint", "sliding")
    given = (*state(c, model), efforts(c))
    quick = model.kernel("forward", ("contact", *outputs))
    own = model._arguments
    _, inputs = own.samples((own.q, own.v, own.effort), given, *load_of(c))
    answer = quick.run(inputs)
    found, status = model.system.robust.forward(inputs)
    assert not answer.status.any()
    assert not status.any()
    for result, value in answer.values.items():
        close(found[result], value, 1e-9)


@pytest.mark.parametrize("name", ["RSS k2 n8 quadratic", "masticatory"])
def test_backends_agree(name: str, compiler_command: object) -> None:
    """Compiled batches and single samples give numpy's numbers."""
    c, model = case(name), by_numpy(name)
    compiled = Model(c.mechanism, backend="compiled")
    given = (*state(c, model), efforts(c), *load_of(c))
    wanted, found = (m.forward_dynamics(*given) for m in (model, compiled))
    close(found.acceleration, wanted.acceleration, 1e-12)
    close(found.contact_force, wanted.contact_force, 1e-12)
    ones = [compiled.unchecked().forward_dynamics(*sample) for sample in zip(*given, strict=True)]
    close(ones, wanted.acceleration, 1e-12)
    close(model.unchecked().forward_dynamics(*(a[0] for a in given)), wanted.acceleration[0], 0)
