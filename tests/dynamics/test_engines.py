"""Pinocchio, MuJoCo and plain Newton-Euler on randomly perturbed mechanisms, to 1e-9."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from itertools import product
from typing import Any

import numpy as np
import pytest
from oracles import newton_euler
from oracles.random_mechanism import off_centre, random_mechanism
from support.families import MECHANISMS, MIXED, Case, close, of_raw
from support.loads import parts
from support.speeds import few

pytestmark = pytest.mark.slow

TOLERANCE = 1e-9
Engine = Callable[..., dict[str, Any]]
# tests/kinematics/chain holds cables, which have no bodies.
CASES: list[dict[str, Any]] = [
    *({"contacts": k, "chains": n} for k, n in ((0, 8), (2, 4), (2, 12), (5, 1))),
    {"families": ("PSS",), "contacts": 0, "rod_along_x": True},
    *(MECHANISMS[name] for name in ("rss_k3_n7", "pss_k1", "sps_k2_n7", "sps_k3", "mixed_k0_n8")),
    *({"surface": "quadratic", "contacts": k, "chains": n} for k, n in ((1, 6), (3, 8))),
    {"surface": "quadratic", "families": MIXED, "contacts": 2},
    {"surface": ("sphere", "cylinder", "ellipsoid"), "contacts": 3},
    {"surface": ("profile", "ellipsoid"), "families": MIXED, "chains": 8},
    {"surface": ("ellipsoid", "plane"), "ball_radius": 4.0},
]
FEW = CASES[1], *(MECHANISMS[name] for name in ("pss_k1", "sps_k2_n7")), *CASES[14:]


def plain(raw: dict[str, Any]) -> Engine:
    return lambda *state: newton_euler.inverse_dynamics(raw, *state)


def engines(raw: dict[str, Any]) -> list[Engine]:
    """Inverse dynamics of a raw mechanism by every engine that is installed."""
    found = [plain(raw)]
    if find_spec("pinocchio"):
        from oracles.pinocchio_engine import PinocchioEngine

        found.append(PinocchioEngine(raw).inverse_dynamics)
    if find_spec("mujoco"):
        from oracles.mujoco_engine import MujocoEngine

        found.append(MujocoEngine(raw).inverse_dynamics)
    return found


def check(c: Case, *engines: Engine, efforts: float = TOLERANCE) -> None:
    ours = c.evaluate()
    assert (ours.status == 0).all()
    for i, by in product(range(len(c.load)), engines):
        theirs = by(*c.sample(i))
        close(ours.effort[i], theirs["tau"], efforts)
        force = np.abs(c.load[i, :3]).max()  # contact forces are small differences of large ones
        close(ours.contact_force[i], theirs["contact"], TOLERANCE, floor=force)
        # Joint coordinates, rod angles and poses are zero at home.
        at = {"joint": "joint", "beta": "beta_i", "gamma": "gamma_i"}
        for name in (name for name, key in at.items() if key in theirs):
            close(getattr(ours.configuration, name)[i], theirs[at[name]], TOLERANCE, floor=1e-3)
        close(ours.joint_rate[i], theirs["joint_rate"], TOLERANCE)
        close(ours.joint_acceleration[i], theirs["joint_acceleration"], TOLERANCE)
        for key in ("pose", "pose_rate", "pose_acceleration"):
            close(getattr(ours, key)[i], c.states[key][i], 1e-11, floor=1e-3)


@pytest.mark.parametrize("options", few(CASES, *FEW), ids=str)
def test_outside_engines_agree(options: dict[str, Any]) -> None:
    rng = np.random.default_rng(100 + len(str(options)))
    c = of_raw(random_mechanism(rng, **{"tilted_gravity": True, **options}))
    check(c, *engines(c.raw))


@pytest.mark.parametrize("module", ["pinocchio", "mujoco"])
def test_there_are_outside_engines(module: str) -> None:
    if find_spec(module) is None:
        pytest.skip(f"{module} is not installed (it is in the `test` extra)")


def test_shafts_that_are_upright_or_nearly() -> None:
    """The cranks of two chains lie level, but for a tilt [rad] of their shafts."""
    for tilt in (0.0, 8e-10):
        raw = random_mechanism(np.random.default_rng(5))
        for chain, sign in zip(raw["chain"][:2], (1, -1), strict=True):
            tip = np.array(chain["crank_tip"])
            out = (np.array(chain["platform"]) - tip) * [1, 1, 0]
            out /= np.linalg.norm(out)
            across = np.cross([0, 0, 1], out)
            crank = -25 * (0.9 * out + 0.4 * across)
            lean = np.cross([0, 0, 1], crank / np.linalg.norm(crank))
            chain["base"] = (tip - crank).tolist()
            chain["axis"] = (sign * (np.array([0, 0, 1]) + tilt * lean)).tolist()
        check(of_raw(raw), plain(raw), efforts=1e-12)


MOVING: list[dict[str, Any]] = [MECHANISMS["mixed_k0_n8"], CASES[11]]
MOVING += [{"families": MIXED, "contacts": 1}]  # mass centres of platform and cranks off their axes


@pytest.mark.parametrize("options", MOVING, ids=str)
def test_a_moving_base(options: dict[str, Any]) -> None:
    """Pinocchio's recursion with a free base that is led."""
    pytest.importorskip("pinocchio", reason="pinocchio is not installed (`test` extra)")
    from oracles.pinocchio_engine import OnMovingBase

    rng = np.random.default_rng(200 + len(str(options)))
    raw = random_mechanism(rng, **options)
    c = of_raw(off_centre(rng, raw) if options is MOVING[-1] else raw)
    gravity, base = rng.normal(0, 9, (len(c.load), 3)), rng.normal(0, 6, (len(c.load), 9))
    q = (c.states[key] for key in ("q", "qd", "qdd"))
    ours = c.model().inverse_dynamics(*q, *parts(c.load), gravity=gravity, base=base)
    assert (ours.status == 0).all()
    for i in range(len(c.load)):
        theirs = OnMovingBase(c.raw, base[i], gravity[i]).inverse_dynamics(*c.sample(i))
        close(ours.effort[i], theirs["tau"], TOLERANCE)
        force = np.abs(c.load[i, :3]).max()
        close(ours.contact_force[i], theirs["contact"], TOLERANCE, floor=force)
