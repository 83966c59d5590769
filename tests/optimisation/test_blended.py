"""What `path` writes of the fastest traversal: its time and its share of limits, by own programs.

The oracle knows a path q(p) in closed form and forces by inverse dynamics alone: the least time is
a sequence of linear programs in p'^2 on a grid of its own, the share that a state needs another.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import linprog

import condyle
from condyle.mechanism.actuator import Limits
from condyle.optimisation.optimal_motion import MotionLimits, OptimiseStudy, _efforts

NODES = 800
ROBOT = condyle.load_mechanism("masticatory")
WEAK = ROBOT.set({f"chain.{c.name}.actuator.torque_limit": 0.06 for c in ROBOT.chains})
JAW = 5e-4, 1e-3, 0.01, 0.06
BOX = 0.3, 0.3, 0.2, 0.05, 0.05, 0.05


def place(p: Any, amplitude: Any, seed: int, closed: bool) -> list[np.ndarray]:
    """q, dq/dp, d2q/dp2 at p from 0 to 1."""
    c = np.random.default_rng(seed).uniform(-1, 1, (3, len(amplitude))) * amplitude
    w, x = np.pi * (1 + closed), np.asarray(p)[:, None]
    one, two, line = (c[1], 0.4 * c[2], c[0]) if closed else (0.5 * c[1], 0.2 * c[2], c[0])
    turn = [
        one * w**k * np.sin(w * x + k * np.pi / 2)
        + two * (2 * w) ** k * np.sin(2 * w * x + k * np.pi / 2)
        for k in range(3)
    ]
    if closed:
        return [f + line * w**k * np.cos(w * x + k * np.pi / 2) for k, f in enumerate(turn)]
    return [turn[0] + line * x, turn[1] + line, turn[2]]


def own(model: condyle.Model, q: np.ndarray) -> tuple[np.ndarray, ...]:
    """Joint rates by q', (N, n, m); efforts that move nothing, (N, n, r); limits (n,) each."""
    jacobians = model.jacobians(q)
    A = jacobians.J_theta @ jacobians.M_J
    inner = np.linalg.svd(A)[0][:, :, A.shape[2] :]
    actuators = [c.actuator for c in model.mechanism.chains]
    low, high = np.array([a.effort_range for a in actuators]).T
    return A, inner, low, high, np.array([a.speed_limit or np.inf for a in actuators])


def least_time(model: condyle.Model, path: Any, share: float, closed: bool) -> float:
    p, step = np.linspace(0, 1, NODES + 1), 1 / NODES
    q, q1, q2 = path(p)
    A, inner, low, high, speed = own(model, q)
    low = np.where(low > 0, low, share * low)
    most = ((share * speed / np.abs((A @ q1[..., None])[..., 0])) ** 2).min(axis=1)
    if not closed:
        most[[0, -1]] = 0.0
    free = model.inverse_dynamics(q, 0 * q, 0 * q).effort
    by_a = model.inverse_dynamics(q, 0 * q, q1).effort - free
    by_b = model.inverse_dynamics(q, q1, q2).effort - free
    at = np.concatenate([np.arange(NODES), np.arange(1, NODES + 1)])  # both ends of intervals
    start, n = np.tile(np.arange(NODES), 2), len(low)
    rows = np.arange(len(at) * n)
    slope = (by_a[at] / (2 * step)).ravel()
    of_b = sparse.csr_array(
        (
            np.concatenate([by_b[at].ravel(), slope, -slope]),
            (np.tile(rows, 3), np.concatenate([np.repeat(i, n) for i in (at, start + 1, start)])),
        ),
        shape=(len(rows), NODES + 1),
    )
    W = sparse.hstack([of_b, sparse.block_diag(list(inner[at]))])
    upper = sparse.vstack([W, -W])
    greatest = np.concatenate([(share * high - free[at]).ravel(), (free[at] - low).ravel()])
    same = np.zeros((1, W.shape[1]))
    same[0, [0, NODES]] = closed, -closed
    bounds: list[Any] = [(0, None if np.isinf(x) else x) for x in most]
    bounds += [(None, None)] * (W.shape[1] - NODES - 1)
    found: Any
    b, T, last = np.ones(NODES + 1), np.inf, np.nan
    while not abs(T - last) < 1e-6 * T:
        root = np.sqrt(np.maximum(b, 1e-6 * b.max()))
        pair, cost = step / (root[1:] + root[:-1]) ** 2, np.zeros(W.shape[1])
        cost[1 : NODES + 1] -= pair / root[1:]
        cost[:NODES] -= pair / root[:-1]
        found = linprog(cost / np.abs(cost).max(), upper, greatest, same, [0.0], bounds)
        b = np.maximum(found.x[: NODES + 1], 0.0)
        last, T = T, float(np.sum(2 * step / (np.sqrt(b[1:]) + np.sqrt(b[:-1]))))
    return T


def needed(model: condyle.Model, motion: condyle.Motion) -> float:
    """The largest share of a limit, at samples and twice between them; least efforts are kept."""
    t = np.linspace(0.0, motion.t[-1], 3 * len(motion.t) - 2)
    fine = condyle.Motion.from_arrays(motion.t, motion.value, motion.names, times=t)
    A, inner, low, high, speed = own(model, fine.value)
    effort = model.inverse_dynamics(fine.value, fine.rate, fine.acceleration).effort
    most = float((np.abs((A @ fine.rate[..., None])[..., 0]) / speed).max())
    stays, none = np.where(low > 0, low, 0.0), (None, None)
    for some in np.array_split(np.arange(len(t)), len(t) // 200 + 1):
        moves, each = sparse.block_diag(list(inner[some])), sparse.eye_array(len(some))
        by_share = [sparse.kron(each, -x[:, None]) for x in (high, stays - low)]
        upper = sparse.hstack([sparse.vstack([moves, -moves]), sparse.vstack(by_share)])
        right = np.concatenate([-effort[some].ravel(), (effort[some] - stays).ravel()])
        count = moves.shape[1]
        cost = np.repeat([0.0, 1.0], [count, len(some)])
        found: Any = linprog(cost, upper, right, bounds=[none] * count + [(0, None)] * len(some))
        assert found.status == 0, "least efforts are not kept"
        most = max(most, found.x[count:].max())
    return most


CASES = [
    (WEAK, JAW, 0, False, 0.9, {"intervals": 200}),
    (ROBOT, JAW, 2, True, 0.9, {}),
    ("cable-robot", BOX, 0, True, 0.9, {}),
    ("cable-robot", BOX, 1, False, 0.5, {}),
    ("hexaglide", (0.05,) * 5, 1, False, 0.7, {}),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    "case", [CASES[0], *(pytest.param(c, marks=pytest.mark.ci) for c in CASES[1:])]
)
def test_the_written_motion_keeps_the_share_and_is_fast(case: Any) -> None:
    machine, amplitude, seed, closed, share, options = case
    model = condyle.derive(machine, backend="numpy", distribution="minimum_norm")
    t = np.linspace(0, 1, 401)
    p = t if closed else t**3 * (10 - 15 * t + 6 * t**2)
    path = condyle.Motion.from_arrays(t, place(p, amplitude, seed, closed)[0], model.independent)
    study = {"kind": "fastest", "along": {"closed": closed, "share": share, **options}}
    found = condyle.plan_path(machine, study, motion=path, backend="numpy")
    best = least_time(model, lambda p: place(p, amplitude, seed, closed), share, closed)
    assert found.motion.t[-1] < 1.02 * best
    assert needed(model, found.motion) < share * 0.905 / 0.9
    assert max(x for n, (x, _) in found.used.items()) <= share * (1 + 1e-6)


def test_a_share_lowers_no_least_effort() -> None:
    assert Limits(30.0, 300.0, 2.0).part(0.9) == (30.0, 270.0, 1.8)
    assert Limits(-300.0, -30.0, 2.0).part(0.9) == (-270.0, -30.0, 1.8)
    assert Limits(-3.0, 3.0, np.inf).part(0.9) == pytest.approx((-2.7, 2.7, np.inf))
    with pytest.raises(condyle.InputError, match="leaves no effort within limits of 30 to 32"):
        Limits(30.0, 32.0, np.inf).part(0.9)
    used = Limits(30.0, 300.0, np.inf).used(np.array([150.0, 20.0, -1.0]))
    assert list(used) == [0.5, 1.5, np.inf]
    study = OptimiseStudy(period=1.0, limits=MotionLimits(share=0.9), pose=({"X": 0.0, "t": 0.0},))
    efforts = _efforts(condyle.load_mechanism("cable-robot"), study)
    assert efforts.low * efforts.scale == pytest.approx(30.0)
    assert efforts.high * efforts.scale == pytest.approx(0.9 * 720.0)
