"""Accelerations and contact forces meet engines that know nothing of condyle."""

from __future__ import annotations

import pytest
from oracles.forward_tree import forward_dynamics
from oracles.mujoco_engine import MujocoEngine
from oracles.pinocchio_engine import PinocchioEngine
from support.speeds import first, slow

from .cases import BUNDLED, CASES, by_numpy, case, close, efforts, load_of, state

TOLERANCE = 1e-9


@pytest.mark.parametrize("name", first(CASES, 3, rest=slow))
def test_tree_with_its_loops_closed(name: str) -> None:
    c, model = case(name), by_numpy(name)
    engines = [PinocchioEngine(c.raw)]
    engines += [MujocoEngine(c.raw)] if name in BUNDLED or "n8" in name else []
    effort, load, s = efforts(c), load_of(c), c.states
    ours = model.forward_dynamics(*state(c, model), effort, *load, outputs="all")
    assert not ours.status.any()
    for i in range(len(effort)):
        given = s["pose"][i], s["pose_rate"][i], effort[i], s["wrench"][i], s["load_point"]
        for engine in engines:
            (theirs,) = forward_dynamics(engine, c.raw, *given)
            close(ours.pose_acceleration[i], theirs.acceleration, TOLERANCE)
            close(ours.contact_force[i], theirs.force, TOLERANCE)
