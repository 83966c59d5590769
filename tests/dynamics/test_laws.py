"""Symmetry, shares, signs of contact forces, and rest without gravity."""

from __future__ import annotations

from typing import Any

import numpy as np
from oracles.random_mechanism import random_mechanism, random_state, toml_text
from support.families import close
from support.loads import parts, with_point
from support.machines import model

from condyle.mechanism import parse
from condyle.model.model import Model

MIRROR = {"X": 1, "Y": -1, "Z": 1, "alpha": -1, "beta": 1, "gamma": -1}


def solve(model: Model, states: dict[str, Any], point: str = "right_molar") -> Any:
    load = with_point(states["wrench"], np.array(model.mechanism.platform.points[point]))
    q = (states[key] for key in ("q", "qd", "qdd"))
    evaluation = model.inverse_dynamics(*q, *parts(load), outputs="share")
    assert (evaluation.status == 0).all()
    return evaluation


def test_mirrored_motion_gives_mirrored_torques() -> None:
    """Left and right change places: motion, load, its point, torques and contact forces."""
    rng = np.random.default_rng(2)
    raw = random_mechanism(rng, symmetric=True)
    points = raw["platform"]["points"]
    points["left_molar"] = (np.array(points["right_molar"]) * [1, -1, 1]).tolist()
    model, states = Model(parse(toml_text(raw)), backend="numpy"), random_state(rng, raw, 5)
    sign = np.array([MIRROR[name] for name in model.independent])
    mirrored = {key: states[key] * sign for key in ("q", "qd", "qdd")}
    mirrored["wrench"] = states["wrench"] * [1, -1, 1, -1, 1, -1]
    one, other = solve(model, states), solve(model, mirrored, "left_molar")
    swap = np.arange(6).reshape(-1, 2)[:, ::-1].ravel()
    close(other.effort[:, swap], one.effort, 1e-12)
    close(other.contact_force[:, ::-1], one.contact_force, 1e-11, floor=states["wrench"].max())
    assert np.abs(one.effort - other.effort).max() > 0.05 * np.abs(one.effort).max()


def test_shares_sum_to_the_torque_and_belong_to_their_bodies() -> None:
    """Those of other formulations are compared with these."""
    raw = random_mechanism(np.random.default_rng(3))
    states = random_state(np.random.default_rng(3), raw, 4)

    def shares(**changes: Any) -> Any:
        chains = [chain | changes for chain in raw["chain"]]
        by = Model(parse(toml_text(raw | {"chain": chains})), backend="numpy")
        assert by.parts == ("platform", "couplers", "cranks", "load")
        found = solve(by, states)
        np.testing.assert_allclose(found.share.sum(axis=1), found.effort, atol=1e-12)
        free = solve(by, states | {"wrench": 0 * states["wrench"]}).share
        np.testing.assert_array_equal(free[:, 3], 0)
        np.testing.assert_allclose(free[:, :3], found.share[:, :3], atol=1e-13)
        return found.share

    full = shares()
    light = shares(coupler={"mass": 0.0, "com": 0.5, "transverse": 0.0, "axial": 0.0})
    np.testing.assert_allclose(light, full * np.array([1, 0, 1, 1])[:, None], atol=1e-12)
    slow = [{"crank": {"inertia": 3 * c["crank"]["inertia"]}} for c in raw["chain"]]
    raw["chain"] = [chain | change for chain, change in zip(raw["chain"], slow, strict=True)]
    np.testing.assert_allclose(shares(), full * np.array([1, 1, 3, 1])[:, None], atol=1e-12)
    assert all(np.abs(part).max() > 1e-4 for part in np.moveaxis(full, 1, 0))


def test_a_contact_force_is_a_push_along_the_unit_normal() -> None:
    """Straight up on the jaw presses it to the skull: lambda n with n upwards is negative."""
    q, load = np.zeros((2, 4)), np.zeros((2, 9))
    load[1, 2] = 1000.0
    rest, pressed = model("masticatory").inverse_dynamics(q, q, q, *parts(load)).contact_force
    assert (pressed < rest).all() and (pressed < 0).all()


def test_without_gravity_nothing_at_rest_is_held() -> None:
    """That power is the rate of the energy, `test_engines.py` asks with sixty digits."""
    mechanism, q = model("masticatory").mechanism, np.full(4, 1e-3)
    floating = Model(mechanism.replace(gravity=(0, 0, 0)), backend="numpy")
    at_rest = floating.inverse_dynamics(q, 0 * q, 0 * q)
    assert not at_rest.effort.any() and not at_rest.contact_force.any()
