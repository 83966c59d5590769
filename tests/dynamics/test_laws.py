"""Symmetry, shares, contact forces and bodies without mass."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles import newton_euler
from oracles.random_mechanism import random_mechanism, random_state, toml_text
from support.loads import load_point_of, parts, with_point

import condyle
from condyle.dynamics import FORMULATIONS
from condyle.mechanism import Mechanism, parse
from condyle.model.model import Model

MIRROR = {"X": 1, "Y": -1, "Z": 1, "alpha": -1, "beta": 1, "gamma": -1}


def solve(model: Model, states: dict[str, Any], point: str = "right_molar") -> Any:
    load = with_point(states["wrench"], np.array(model.mechanism.platform.points[point]))
    evaluation = model.inverse_dynamics(
        states["q"], states["qd"], states["qdd"], *parts(load), outputs="all"
    )
    assert (evaluation.status == 0).all()
    return evaluation


@pytest.mark.parametrize("contacts, chains", [(2, 6), (1, 8), (0, 6)])
def test_mirrored_motion_gives_mirrored_torques(contacts: int, chains: int) -> None:
    """Left and right change places: motion, load, its point, torques and contact forces."""
    rng = np.random.default_rng(contacts)
    raw = random_mechanism(rng, chains=chains, contacts=2, symmetric=True)
    raw["contact"] = raw["contact"][:0] if contacts == 0 else raw["contact"]
    if contacts == 1:  # one contact in the middle
        middle = {"name": "middle", "point": [50, 0, 4]}
        raw["contact"] = [middle | {"surface": {"kind": "plane", "slope": [0.3, 0], "offset": -11}}]
    mechanism = parse(toml_text(raw))
    model = condyle.derive(mechanism, backend="numpy")
    states = random_state(rng, raw, 5)
    sign = np.array([MIRROR[name] for name in model.independent])
    mirrored = {key: states[key] * sign for key in ("q", "qd", "qdd")}
    mirrored["wrench"] = states["wrench"] * [1, -1, 1, -1, 1, -1]
    points = dict(mechanism.platform.points)
    points["left_molar"] = tuple(np.array(points["right_molar"]) * [1, -1, 1])
    platform = mechanism.platform.model_copy(update={"points": points})
    model = condyle.derive(mechanism.replace(platform=platform), backend="numpy")
    one, other = solve(model, states), solve(model, mirrored, "left_molar")
    swap = np.arange(chains).reshape(-1, 2)[:, ::-1].ravel()
    np.testing.assert_allclose(
        other.effort[:, swap], one.effort, atol=1e-12 * np.abs(one.effort).max()
    )
    np.testing.assert_allclose(
        other.contact_force[:, ::-1], one.contact_force, atol=1e-11 * np.abs(states["wrench"]).max()
    )
    assert np.abs(one.effort - other.effort).max() > 0.05 * np.abs(one.effort).max()


def test_the_reference_is_its_own_mirror_image(reference: Mechanism) -> None:
    model = condyle.derive(reference)
    rng = np.random.default_rng(1)
    q, q1, q2 = rng.normal(0, 1, (3, 5, 4)) * [0.001, 0.001, 0.05, 0.05]
    sign = [1, -1, -1, 1]
    wrench = rng.normal(0, 10, (5, 6))
    one = model.inverse_dynamics(
        q, q1, q2, wrench, load_point_of(model, "right_molar"), outputs="all"
    )
    load = with_point(wrench * [1, -1, 1, -1, 1, -1], load_point_of(model, "left_molar"))
    other = model.inverse_dynamics(q * sign, q1 * sign, q2 * sign, *parts(load), outputs="all")
    swap = [1, 0, 3, 2, 5, 4]
    np.testing.assert_allclose(other.effort[:, swap], one.effort, atol=1e-12)
    np.testing.assert_allclose(other.contact_force[:, ::-1], one.contact_force, atol=1e-10)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_shares_sum_to_the_torque_and_belong_to_their_bodies(formulation: str) -> None:
    raw = random_mechanism(np.random.default_rng(3))
    mechanism = parse(toml_text(raw))
    model = condyle.derive(mechanism, formulation=formulation, backend="numpy")
    assert model.parts == ("platform", "couplers", "cranks", "load")
    states = random_state(np.random.default_rng(3), raw, 4)
    full = solve(model, states)
    np.testing.assert_allclose(full.share.sum(axis=1), full.effort, atol=1e-12)
    without_load = solve(model, states | {"wrench": 0 * states["wrench"]})
    np.testing.assert_array_equal(without_load.share[:, 3], 0)
    np.testing.assert_allclose(without_load.share[:, :3], full.share[:, :3], atol=1e-13)
    none = {"mass": 0.0, "com": 0.5, "transverse": 0.0, "axial": 0.0}
    light = parse(toml_text(raw | {"chain": [c | {"coupler": none} for c in raw["chain"]]}))
    rods_gone = solve(condyle.derive(light, formulation=formulation, backend="numpy"), states)
    np.testing.assert_allclose(rods_gone.share[:, 1], 0, atol=1e-16)
    for part in (0, 2, 3):
        np.testing.assert_allclose(rods_gone.share[:, part], full.share[:, part], atol=1e-12)
    heavier = [c | {"crank": {"inertia": 3 * c["crank"]["inertia"]}} for c in raw["chain"]]
    slow = parse(toml_text(raw | {"chain": heavier}))
    turned = solve(condyle.derive(slow, formulation=formulation, backend="numpy"), states)
    np.testing.assert_allclose(turned.share[:, 2], 3 * full.share[:, 2], atol=1e-12)
    assert all(np.abs(part).max() > 1e-4 for part in np.moveaxis(full.share, 1, 0))


@pytest.mark.parametrize("contacts", range(1, 6))
def test_contact_forces_balance_the_platform(contacts: int) -> None:
    """With our torques, every body's free body diagram closes, and asks for our contact forces."""
    raw = random_mechanism(np.random.default_rng(contacts), contacts=contacts)
    model = condyle.derive(parse(toml_text(raw)), backend="numpy")
    states = random_state(np.random.default_rng(1), raw, 3)
    found = solve(model, states)
    for i in range(3):
        motion = (states[key][i] for key in ("pose", "pose_rate", "pose_acceleration", "wrench"))
        result = newton_euler.inverse_dynamics(raw, *motion, tau=found.effort[i])
        assert result["residual"] < 1e-12
        size = np.abs(states["wrench"][i]).max()
        np.testing.assert_allclose(found.contact_force[i], result["contact"], atol=1e-11 * size)


def test_a_contact_force_is_a_push_along_the_unit_normal(reference: Mechanism) -> None:
    """Straight up on the jaw presses it to the skull: lambda n with n upwards is negative."""
    model = condyle.derive(reference)
    q = np.zeros((2, 4))
    load = np.zeros((2, 9))
    load[1, 2] = 1000.0
    rest, pressed = model.inverse_dynamics(q, q, q, *parts(load)).contact_force
    assert (pressed < rest).all() and (pressed < 0).all()
