"""The fastest traversal: against reachable sets by small programs, against a law in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

import condyle
from condyle.optimisation.fastest import Planner, Traversal
from condyle.optimisation.path_limits import TraversalLimits

ROBOT = condyle.load_mechanism("masticatory")
WEAK = ROBOT.set({f"chain.{c.name}.actuator.torque_limit": 0.06 for c in ROBOT.chains})


def fastest(*given: Any, **options: Any) -> Traversal:
    return Planner(*given, **options).traversal()


def leaning(count: int = 201, closed: bool = False) -> condyle.Motion:
    """The jaw opens and shifts aside: at rest at its ends, or a loop."""
    t = np.linspace(0.0, 1.0, count)
    if closed:
        s = 2 * np.pi * t
        beta, Y = 0.06 - 0.05 * np.cos(s), 1e-3 * np.sin(s)
    else:
        s = t**3 * (10 - 15 * t + 6 * t**2)
        beta, Y = 0.12 * s, 1.5e-3 * np.sin(np.pi * s)
    return condyle.Motion.from_arrays(
        t, {"X": 0.01 * beta, "Y": Y, "alpha": 0.1 * beta**2, "beta": beta}
    )


def reachable(model: condyle.Model, motion: condyle.Motion, nodes: int) -> float:
    """The least time by reachable sets (Pham and Pham 2018), each step a program of its own.

    Places are evenly spaced in the motion's smooth step; forces by inverse dynamics alone, with
    the null space of the actuators from its Jacobians.
    """
    s = np.linspace(0, 1, 20001)
    arc = s**3 * (10 - 15 * s + 6 * s**2)
    here = np.interp(np.linspace(0, 1, nodes + 1), arc, s)
    (q, v, a), _ = model.poses.of_motion(
        condyle.Motion.from_arrays(motion.t, motion.value, motion.names, times=here)
    )
    rate = 30 * here**2 * (1 - here) ** 2
    bend = 60 * here * (1 - here) * (1 - 2 * here)
    ends = rate < 1e-9
    rate[ends] = 1.0
    q_u, q_uu = v / rate[:, None], (a - v * (bend / rate)[:, None]) / rate[:, None] ** 2
    for k, near in ((0, 1), (-1, -2)):  # limits at the ends, where the motion rests
        q_u[k], q_uu[k] = q_u[near], q_uu[near]
    free = model.inverse_dynamics(q, 0 * q, 0 * q).effort
    by_a = model.inverse_dynamics(q, 0 * q, q_u).effort - free
    by_h = model.inverse_dynamics(q, q_u, q_uu).effort - free
    jacobians = model.jacobians(q)
    A = jacobians.J_theta @ jacobians.M_J
    most = np.array([c.actuator.effort_range[1] for c in model.mechanism.chains])
    fast = np.array([c.actuator.speed_limit for c in model.mechanism.chains])
    limit = ((fast / np.abs((A @ q_u[..., None])[..., 0])) ** 2).min(axis=1)
    step = 1.0 / nodes

    def best(i: int, cost: list[float], within: Any, low: float, high: float) -> Any:
        """Least cost of (h, a) at node i with h + 2 step a within, and h from low to high."""
        inner = np.linalg.svd(A[i].T)[2][A.shape[2] :]  # efforts that move nothing
        rows, right = [], []
        columns = np.column_stack([by_h[i], by_a[i], inner.T])
        for sign in (1, -1):
            rows += [sign * columns]
            right += [most - sign * free[i]]
        there = np.zeros((2, columns.shape[1]))
        there[:, :2] = [[1, 2 * step], [-1, -2 * step]]
        return linprog(
            [*cost, *[0.0] * len(inner)],
            np.vstack([*rows, there]),
            np.concatenate([*right, [within[1], -within[0]]]),
            bounds=[(low, high), (None, None), *[(None, None)] * len(inner)],
        )

    sets = [(0.0, 0.0)]
    for i in range(nodes - 1, -1, -1):
        ends_of = [best(i, [sign, 0.0], sets[0], 0.0, limit[i]) for sign in (1.0, -1.0)]
        assert all(found.status == 0 for found in ends_of)
        sets.insert(0, (float(ends_of[0].x[0]), float(ends_of[1].x[0])))
    h = [0.0]
    for i in range(nodes):
        found = best(i, [0.0, -1.0], sets[i + 1], h[-1], h[-1])
        h.append(min(max(h[-1] + 2 * step * found.x[1], 0.0), limit[i + 1]))
    root = np.sqrt(h)
    return float(np.sum(2 * step / (root[1:] + root[:-1])))


@pytest.mark.slow
@pytest.mark.parametrize(
    "machine", [WEAK, pytest.param(ROBOT, marks=pytest.mark.ci)], ids=["effort", "speed"]
)
def test_no_other_traversal_is_faster(machine: condyle.Mechanism) -> None:
    model, motion = condyle.derive(machine, backend="numpy"), leaning()
    found = fastest(model, motion, TraversalLimits({}, {}, {}), intervals=400).duration
    # The oracle's 200 steps are worth 0.7 % of the time, by its answer with 400.
    assert found == pytest.approx(reachable(model, motion, 200), rel=1e-2)
    finer = fastest(model, motion, TraversalLimits({}, {}, {}), intervals=1600).duration
    assert found == pytest.approx(finer, rel=5e-3)


def test_one_bound_of_acceleration_is_bang_bang() -> None:
    """From rest to rest over b within acceleration A: 2 sqrt(b / A)."""
    motion = leaning()
    strong = ROBOT.set({f"chain.{c.name}.actuator.speed_limit": 1e4 for c in ROBOT.chains})
    strong = strong.set({f"chain.{c.name}.actuator.torque_limit": 1e4 for c in strong.chains})
    model = condyle.derive(strong, backend="numpy")
    found = fastest(model, motion, TraversalLimits({}, {"beta": 3.0}, {}), intervals=200)
    assert found.duration == pytest.approx(2 * np.sqrt(0.12 / 3.0), rel=3e-3)
    assert {name for _, _, names in found.segments() for name in names} == {"acceleration of beta"}


def test_a_cycle_does_not_stop() -> None:
    model, motion = condyle.derive(WEAK, backend="numpy"), leaning(closed=True)
    going = fastest(model, motion, TraversalLimits({}, {}, {}), closed=True, intervals=200)
    stopping = fastest(model, motion, TraversalLimits({}, {}, {}), intervals=200)
    assert going.rate.min() > 0 and going.rate[0] == pytest.approx(going.rate[-1])
    assert going.duration < stopping.duration
    with pytest.raises(condyle.InputError, match="closed path"):
        fastest(model, leaning(), TraversalLimits({}, {}, {}), closed=True)


@pytest.mark.slow
def test_what_is_written_keeps_the_limits() -> None:
    along = {"closed": True, "intervals": 200, "share": 0.8}
    found = condyle.plan_path(
        WEAK, {"kind": "fastest", "along": along}, motion=leaning(closed=True)
    )
    assert max(share for share, _ in found.used.values()) == pytest.approx(0.8, rel=5e-3)
    named = {name for _, _, names in found.binds for name in names}
    assert any(name.startswith("effort of ") for name in named)
    assert found.binds[0][0] == 0 and "what binds" in str(found)
    assert found.data["binds"][0]["limits"] == [*found.binds[0][2]]


def test_a_contact_force_slows_the_path_down() -> None:
    model, motion = condyle.derive(WEAK, backend="numpy"), leaning()
    free = fastest(model, motion, TraversalLimits({}, {}, {}), intervals=100)
    bearing = dict.fromkeys(ROBOT.contact_names, 0.1)
    kept = fastest(model, motion, TraversalLimits({}, {}, bearing), intervals=100)
    assert kept.duration > 1.04 * free.duration
    assert any("load of left_condyle" in names for names in kept.binds)


def test_where_the_motion_rests_so_does_the_traversal() -> None:
    """There and back, with a pause at the far end, takes twice the way there."""
    model, there = condyle.derive(WEAK, backend="numpy"), leaning()
    values = np.concatenate([there.value, there.value[-1:].repeat(80, axis=0), there.value[::-1]])
    t = 5e-3 * np.arange(len(values))
    both = condyle.Motion.from_arrays(t, values, there.names)
    twice = fastest(model, both, TraversalLimits({}, {}, {}), intervals=400)
    once = fastest(model, there, TraversalLimits({}, {}, {}), intervals=200)
    assert (twice.rate == 0).sum() == 4  # both ends, and both sides of the pause
    assert twice.duration == pytest.approx(2 * once.duration, rel=1e-2)


def test_what_does_not_fit_is_said() -> None:
    along: list[tuple[dict[str, Any], str]] = [
        ({"pose": [{"X": 0.0}]}, "pose, jerk and period"),
        ({"kind": "periodic", "along": {}}, 'along: is a key of kind = "fastest"'),
        ({"speed": {"Q": 1.0}}, "Q not among"),
        ({"along": {"contact_force": {"chin": 1.0}}}, "chin not among"),
        ({"along": {"motion": "none.csv"}}, "no such file"),
        ({"along": {"share": 0.0}}, "share"),
    ]
    for study, said in along:
        with pytest.raises(condyle.InputError, match=said):
            condyle.plan_path("masticatory", {"kind": "fastest", **study}, backend="numpy")


@pytest.mark.slow
def test_a_load_that_nothing_holds_is_said_with_its_place() -> None:
    weak = ROBOT.set({f"chain.{c.name}.actuator.torque_limit": 0.3 for c in ROBOT.chains})
    study = {"kind": "fastest", "along": {"load": "reference"}}
    with pytest.raises(condyle.InputError, match=r"hold it at 1\.\d+ s of its own time"):
        condyle.plan_path(weak, study, backend="numpy")
    rough = ROBOT.set("contact.left_condyle.friction.coefficient", 0.3)
    with pytest.raises(condyle.UnsupportedError, match="friction"):
        condyle.plan_path(rough, study, backend="numpy")
    legs = condyle.load_mechanism("gough-stewart")
    with pytest.raises(condyle.InputError, match="nothing limits it"):
        condyle.plan_path(legs, study | {"along": {}}, motion=condyle.trial_motion(legs))
