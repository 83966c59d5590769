"""Pinocchio, MuJoCo and plain Newton-Euler on randomly perturbed mechanisms, to 1e-9."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism
from support.families import MECHANISMS, MIXED, Case, case, close, of_raw
from support.loads import parts
from support.speeds import few

pytestmark = pytest.mark.slow

TOLERANCE = 1e-9
MODULES = {"pinocchio": "pinocchio", "mujoco": "mujoco", "newton_euler": "numpy"}
PLANES: list[dict[str, Any]] = [
    {"contacts": contacts, "chains": chains} for contacts in range(4) for chains in (6, 8)
]
PLANES += [
    {"contacts": contacts, "chains": chains}
    for contacts, chains in ((2, 4), (5, 6), (5, 1), (3, 3), (2, 12))
]
# Of every family and mixture; tests/kinematics/chain holds cables, which have no bodies.
CLASS = [*MECHANISMS.values(), {"rod_along_x": True}]
SURFACES: list[dict[str, Any]] = [
    {"surface": "quadratic", "contacts": contacts, "chains": chains}
    for contacts, chains in ((1, 6), (2, 6), (2, 8), (3, 6), (3, 8))
]
SURFACES += [
    {"surface": "quadratic", "families": families, "contacts": contacts}
    for families, contacts in ((("PSS",), 1), (("SPS",), 3), (MIXED, 2))
]
SURFACES += [
    {"surface": ("sphere", "cylinder", "ellipsoid"), "contacts": 3},
    {"surface": ("profile", "ellipsoid"), "families": MIXED, "chains": 8},
    {"surface": ("ellipsoid", "plane"), "ball_radius": 4.0},
]
FEW = PLANES[4], *(MECHANISMS[n] for n in ("pss_k1", "sps_k3", "mixed_k0_n8")), *SURFACES[3::7]


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


def check(c: Case, name: str, efforts: float = TOLERANCE) -> None:
    by_engine = engine(name, c.raw)
    ours = c.evaluate()
    assert (ours.status == 0).all()
    for i in range(len(c.load)):
        theirs = by_engine(*c.sample(i))
        close(ours.effort[i], theirs["tau"], efforts)
        force = np.abs(c.load[i, :3]).max()  # contact forces are small differences of large ones
        close(ours.contact_force[i], theirs["contact"], TOLERANCE, floor=force)
        # Joint coordinates and poses are zero at home.
        close(ours.configuration.joint[i], theirs["joint"], TOLERANCE, floor=1e-3)
        close(ours.joint_rate[i], theirs["joint_rate"], TOLERANCE)
        close(ours.joint_acceleration[i], theirs["joint_acceleration"], TOLERANCE)
        for key in ("pose", "pose_rate", "pose_acceleration"):
            close(getattr(ours, key)[i], c.states[key][i], 1e-11, floor=1e-3)


@pytest.mark.parametrize("name", MODULES)
@pytest.mark.parametrize("options", few([*PLANES, *CLASS, *SURFACES], *FEW), ids=str)
def test_an_outside_engine_agrees(options: dict[str, Any], name: str) -> None:
    rng = np.random.default_rng(100 + len(str(options)))
    check(of_raw(random_mechanism(rng, **{"tilted_gravity": True, **options})), name)


@pytest.mark.parametrize("tilt", [0.0, 1e-13, 8e-10, 1e-6])
def test_shafts_that_are_upright_or_nearly(tilt: float) -> None:
    raw = random_mechanism(np.random.default_rng(5))
    level_cranks(raw, tilt)
    check(of_raw(raw), "newton_euler", 1e-12)


@pytest.mark.parametrize("name", ["pss", "sps_k1", "mixed"])
def test_rod_angles(name: str) -> None:
    c = case(name)
    ours, by_engine = c.evaluate(), engine("pinocchio", c.raw)
    for i in range(len(c.load)):
        theirs = by_engine(*c.sample(i))
        close(ours.configuration.beta[i], theirs["beta_i"], TOLERANCE, floor=1e-3)
        close(ours.configuration.gamma[i], theirs["gamma_i"], TOLERANCE, floor=1e-3)


@pytest.mark.parametrize(
    "options", few([*CLASS, *SURFACES], CLASS[0], MECHANISMS["mixed_k0_n8"], SURFACES[3]), ids=str
)
def test_a_moving_base(options: dict[str, Any]) -> None:
    """Pinocchio's recursion with a free base that is led."""
    engine("pinocchio", random_mechanism(np.random.default_rng(0)))  # skips without it
    from oracles.pinocchio_engine import OnMovingBase

    rng = np.random.default_rng(200 + len(str(options)))
    c = of_raw(random_mechanism(rng, **options))
    gravity, base = rng.normal(0, 9, (len(c.load), 3)), rng.normal(0, 6, (len(c.load), 9))
    q = (c.states[key] for key in ("q", "qd", "qdd"))
    ours = c.model().inverse_dynamics(*q, *parts(c.load), gravity=gravity, base=base)
    assert (ours.status == 0).all()
    for i in range(len(c.load)):
        by_engine = OnMovingBase(c.raw, base[i], gravity[i])
        theirs = by_engine.inverse_dynamics(*c.sample(i))
        close(ours.effort[i], theirs["tau"], TOLERANCE)
        force = np.abs(c.load[i, :3]).max()
        close(ours.contact_force[i], theirs["contact"], TOLERANCE, floor=force)
