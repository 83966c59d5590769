"""Every family and mixture meets engines that know nothing of condyle."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles import newton_euler
from oracles.mujoco_engine import MujocoEngine
from oracles.pinocchio_engine import PinocchioEngine
from support.families import MECHANISMS, case, close
from support.speeds import few

TOLERANCE = 1e-9


@pytest.mark.parametrize("name", few(MECHANISMS, "rss", "pss_k1", "sps_k3", "mixed_k0_n8"))
@pytest.mark.parametrize("engine", ["pinocchio", "mujoco", "newton_euler"])
def test_efforts_contacts_and_joints(name: str, engine: str) -> None:
    c = case(name)
    ours = c.evaluate()
    compute: Any = {
        "pinocchio": lambda: PinocchioEngine(c.raw).inverse_dynamics,
        "mujoco": lambda: MujocoEngine(c.raw).inverse_dynamics,
        "newton_euler": lambda: lambda *args: newton_euler.inverse_dynamics(c.raw, *args),
    }[engine]()
    assert (ours.status == 0).all()
    for i in range(len(c.load)):
        theirs = compute(*c.sample(i))
        close(ours.effort[i], theirs["tau"], TOLERANCE)
        force = np.abs(c.load[i, :3]).max()
        close(ours.contact_force[i], theirs["contact"], TOLERANCE, floor=force)
        # Joint coordinates are zero at home.
        close(ours.configuration.joint[i], theirs["joint"], TOLERANCE, floor=1e-3)
        close(ours.joint_rate[i], theirs["joint_rate"], TOLERANCE)
        close(ours.joint_acceleration[i], theirs["joint_acceleration"], TOLERANCE)


@pytest.mark.parametrize("name", ["pss", "sps_k1", "mixed"])
def test_rod_angles(name: str) -> None:
    c = case(name)
    ours, engine = c.evaluate(), PinocchioEngine(c.raw)
    for i in range(len(c.load)):
        theirs = engine.inverse_dynamics(*c.sample(i))
        close(ours.configuration.beta[i], theirs["beta_i"], TOLERANCE, floor=1e-3)
        close(ours.configuration.gamma[i], theirs["gamma_i"], TOLERANCE, floor=1e-3)
