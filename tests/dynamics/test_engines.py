"""Pinocchio, MuJoCo and plain Newton-Euler on randomly perturbed mechanisms, to 1e-9."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, random_state, toml_text
from support.speeds import few

import condyle
from condyle.kinematics.chain import FAMILIES
from condyle.mechanism import parse
from condyle.model.model import with_point

# Cables have no bodies; tests/kinematics/chain holds them against the oracle of free bodies.
RIGID = tuple(kind for kind, family in FAMILIES.items() if family.bodies)

MODULES = {"pinocchio": "pinocchio", "mujoco": "mujoco", "newton_euler": "numpy"}
PLANES: list[dict[str, Any]] = [
    {"contacts": contacts, "chains": chains} for contacts in range(4) for chains in (6, 8)
]
PLANES += [
    {"contacts": contacts, "chains": chains}
    for contacts, chains in ((2, 4), (5, 6), (5, 1), (3, 3), (2, 12))
]
CLASS: list[dict[str, Any]] = [
    {"families": (kind,), "contacts": contacts} for kind in RIGID for contacts in (0, 2)
]
CLASS += [{"families": RIGID, "chains": 8, "contacts": 1}, {"rod_along_x": True}]
SURFACES: list[dict[str, Any]] = [
    {"surface": "quadratic", "contacts": contacts, "chains": chains}
    for contacts, chains in ((1, 6), (2, 6), (2, 8), (3, 6), (3, 8))
]
SURFACES += [
    {"surface": "quadratic", "families": families, "contacts": contacts}
    for families, contacts in ((("PSS",), 1), (("SPS",), 3), (RIGID, 2))
]
SURFACES += [
    {"surface": ("sphere", "cylinder", "ellipsoid"), "contacts": 3},
    {"surface": ("profile", "ellipsoid"), "families": RIGID, "chains": 8},
    {"surface": ("ellipsoid", "plane"), "ball_radius": 4.0},
]
FEW = PLANES[4], CLASS[1], CLASS[-2], SURFACES[3], SURFACES[-2]


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


def level_cranks(raw: dict[str, Any], tilt: float) -> None:
    """Lay the cranks of two chains level, but for a tilt [rad] of their shafts."""
    for chain, sign in zip(raw["chain"][:2], (1, -1), strict=True):
        tip = np.array(chain["crank_tip"])
        out = (np.array(chain["platform"]) - tip) * [1, 1, 0]
        out /= np.linalg.norm(out)
        across = np.cross([0, 0, 1], out)
        crank = -25 * (0.9 * out + 0.4 * across)
        lean = np.cross([0, 0, 1], crank / np.linalg.norm(crank))
        chain["base"] = (tip - crank).tolist()
        chain["axis"] = (sign * (np.array([0, 0, 1]) + tilt * lean)).tolist()


@pytest.mark.parametrize("tilt", [0.0, 1e-13, 8e-10, 1e-6])
def test_shafts_that_are_upright_or_nearly(tilt: float) -> None:
    raw = random_mechanism(np.random.default_rng(5))
    level_cranks(raw, tilt)
    by_engine = engine("newton_euler", raw)
    states = random_state(np.random.default_rng(1), raw, 2, scale=0.3)
    model = condyle.derive(parse(toml_text(raw)), backend="numpy")
    load = with_point(states["wrench"], model.load_point("right_molar"))
    effort = model.evaluate(states["q"], states["qd"], states["qdd"], load).effort
    given = ("pose", "pose_rate", "pose_acceleration", "wrench")
    for i in range(2):
        wanted = by_engine(*(states[key][i] for key in given), "right_molar")["tau"]
        np.testing.assert_allclose(effort[i], wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize("name", MODULES)
@pytest.mark.parametrize("options", few(PLANES + CLASS + SURFACES, *FEW), ids=str)
def test_an_outside_engine_agrees(options: dict[str, Any], name: str) -> None:
    rng = np.random.default_rng(100 + len(str(options)))
    raw = random_mechanism(rng, tilted_gravity=True, **options)
    by_engine = engine(name, raw)
    mechanism = parse(toml_text(raw))
    model = condyle.derive(mechanism, backend="numpy")
    states = random_state(rng, raw, 3)
    assert model.independent == tuple(states["names"])
    load = with_point(states["wrench"], model.load_point("right_molar"))
    got = model.evaluate(states["q"], states["qd"], states["qdd"], load)
    assert (got.status == 0).all()
    ours = {
        "tau": got.effort,
        "contact": got.contact_force,
        "joint": got.configuration.joint,
        "joint_rate": got.joint_rate,
        "joint_acceleration": got.joint_acceleration,
    }
    given = ("pose", "pose_rate", "pose_acceleration", "wrench")
    for i in range(3):
        wanted = by_engine(*(states[key][i] for key in given), "right_molar")
        for key, value in ours.items():
            size = np.abs(wanted[key]).max(initial=0.0)
            if key == "contact":  # small differences of large forces
                size = max(size, np.abs(states["wrench"][i]).max())
            np.testing.assert_allclose(value[i], wanted[key], rtol=0, atol=1e-9 * size)
        for key, value in zip(
            given[:3], (got.pose, got.pose_rate, got.pose_acceleration), strict=False
        ):
            np.testing.assert_allclose(
                value[i], states[key][i], atol=1e-11 * np.abs(value[i]).max()
            )
