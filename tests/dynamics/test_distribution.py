"""With friction, losses and limits the torques are the least of all active sets, on Pinocchio's
dynamics; without, the engines' least 2-norm (`test_engines.py`)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles.null_space import least_of_patterns
from oracles.rotations import platform_motion
from oracles.rubbing import losses, touching
from support.families import close
from support.rubbing import Rubbing, drawn
from support.speeds import ci

from condyle.mechanism.chain import limits
from condyle.model.distributing import Distribution
from condyle.model.model import Model
from condyle.status import Status

TOLERANCE, PRELOAD = 1e-8, 0.4
FREE: dict[str, dict[str, Any]] = {
    "k2 n7 curved": {"chains": 7, "surface": "quadratic", "families": ("RSS", "PSS"), "seed": 33},
    "k1 ball": {"ball_radius": 3.0, "surface": "sphere", "contacts": 1, "seed": 34},
    "k3 legs": {"families": ("SPS",), "contacts": 3, "mu": 0.5, "seed": 36},
}
LIMITED: dict[str, dict[str, Any]] = {
    "k2": {"limit": 4.0, "seed": 42},
    "k2 smooth": {"mu": 0, "limit": 5.0, "seed": 47},
    "k3 n5": {"contacts": 3, "limit": 5.0, "chains": 5, "seed": 45},
    "k2 legs": {"families": ("SPS",), "limit": 4.0, "seed": 46},
}
IN_CI = {"k1 ball", "k2 smooth"}


def by_pinocchio(case: Rubbing, i: int, low: np.ndarray, high: np.ndarray) -> Any:
    """The least of all patterns of one sample; forces and moments of friction as points move."""
    pytest.importorskip("pinocchio", reason="pinocchio is not installed (`test` extra)")
    from oracles.pinocchio_engine import PinocchioEngine

    s, engine = case.states, PinocchioEngine(case.raw)
    pose, rate, second = (s[name][i] for name in ("pose", "pose_rate", "pose_acceleration"))
    found = engine.inverse_dynamics(pose, rate, second, s["wrench"][i], s["load_point"])
    at, _, drag = touching(engine.d, case.raw, pose, rate)
    T = np.hstack([drag, np.cross(at, drag) @ platform_motion(pose).axes])
    loss = losses(case.raw, found["joint_rate"], found["joint_acceleration"])
    J = found["J_theta"]
    return least_of_patterns(J, found["C_normal"], T, found["Q"] + J.T @ loss, low, high)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=ci if n in IN_CI else ()) for n in FREE | LIMITED]
)
def test_the_least_of_all_active_sets(name: str) -> None:
    """With limits contacts push, too: some samples are infeasible, and said to be."""
    limited = name in LIMITED
    case = drawn(**{"count": 2 + limited, "one_sided": limited, **(FREE | LIMITED)[name]})
    machine, options = case.mechanism, {}
    low = np.full(len(machine.chains) + len(machine.contacts), -np.inf)
    high = -low
    if limited:
        options["distribution"] = Distribution("bounded", preload=PRELOAD)
        both = [limits(chain) for chain in machine.chains]
        push = np.array([contact.push for contact in machine.contacts])
        low = np.r_[[x.low for x in both], np.where(push > 0, PRELOAD, -np.inf)]
        high = np.r_[[x.high for x in both], np.where(push < 0, -PRELOAD, np.inf)]
    model, n = Model(machine, backend="numpy", **options), len(machine.chains)
    got = model.inverse_dynamics(*case.arguments)
    for i, status in enumerate(got.status):
        wanted = by_pinocchio(case, i, low, high)
        assert status == (Status.infeasible if wanted is None else Status.ok)
        if wanted is not None:
            effort, force = wanted[1][:n], wanted[1][n:]
            close(got.effort[i], effort, TOLERANCE)
            close(got.contact_force[i], force, TOLERANCE, floor=np.abs(effort).max())
    seen = set(got.status.tolist())
    assert Status.ok in seen and (limited or seen == {Status.ok})
