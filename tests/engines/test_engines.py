"""Pinocchio, MuJoCo and plain Newton-Euler on randomly perturbed mechanisms, to 1e-9."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, random_state, toml_text

import condyle
from condyle.kinematics.chain import FAMILIES
from condyle.mechanism import parse
from condyle.model import with_point

MODULES = {"pinocchio": "pinocchio", "mujoco": "mujoco", "newton_euler": "numpy"}
PLANES: list[dict[str, Any]] = [
    {"contacts": contacts, "chains": chains} for contacts in range(4) for chains in (6, 8)
]
PLANES += [{"contacts": 2, "chains": 4}, {"contacts": 5, "chains": 6}]
CLASS: list[dict[str, Any]] = [
    {"families": (kind,), "contacts": contacts} for kind in FAMILIES for contacts in (0, 2)
]
CLASS += [{"families": tuple(FAMILIES), "chains": 8, "contacts": 1}, {"rod_along_x": True}]


def engine(name: str, raw: dict[str, Any]) -> Callable[..., dict[str, Any]]:
    """Inverse dynamics of a raw mechanism by one engine; skips where it is not installed."""
    if find_spec(MODULES[name]) is None:
        pytest.skip(f"{MODULES[name]} is not installed (it is in the `test` extra)")
    if name == "pinocchio":
        from oracles.pinocchio_engine import PinocchioEngine

        return PinocchioEngine(raw).inverse_dynamics
    if name == "mujoco":
        from oracles.mujoco_engine import MujocoEngine

        return MujocoEngine(raw).inverse_dynamics
    from oracles.newton_euler import inverse_dynamics

    return lambda *state: inverse_dynamics(raw, *state)


@pytest.mark.parametrize("name", MODULES)
@pytest.mark.parametrize("options", PLANES + CLASS, ids=str)
def test_an_outside_engine_agrees(options: dict[str, Any], name: str) -> None:
    rng = np.random.default_rng(100 + len(str(options)))
    raw = random_mechanism(rng, tilted_gravity=True, **options)
    by_engine = engine(name, raw)
    mechanism = parse(toml_text(raw))
    model = condyle.derive(mechanism, backend="interpreted")
    states = random_state(rng, raw, 3)
    assert model.independent == tuple(states["names"])
    load = with_point(states["wrench"], model.load_point("right_molar"))
    got = model.evaluate(states["q"], states["qd"], states["qdd"], load)
    assert (got.status == 0).all()
    ours = {
        "tau": got.torques.torque,
        "contact": got.torques.contact_force,
        "joint": got.posture.joint,
        "joint_rate": got.torques.rate,
        "joint_acceleration": got.torques.acceleration,
    }
    given = ("pose", "pose_rate", "pose_acceleration", "wrench")
    for i in range(3):
        wanted = by_engine(*(states[key][i] for key in given), "right_molar")
        for key, value in ours.items():
            size = np.abs(wanted[key]).max(initial=0.0)
            if key == "contact":  # small differences of large forces
                size = max(size, np.abs(states["wrench"][i]).max())
            np.testing.assert_allclose(value[i], wanted[key], rtol=0, atol=1e-9 * size)
        for key, value in zip(given[:3], vars(got.poses).values(), strict=False):
            np.testing.assert_allclose(
                value[i], states[key][i], atol=1e-11 * np.abs(value[i]).max()
            )
