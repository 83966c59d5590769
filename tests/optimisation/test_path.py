"""`plan_path`: profiles against a search of their own, cycles against SciPy's periodic spline."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import make_interp_spline

import condyle
from condyle.mechanism.chain import limits
from condyle.optimisation.periodic_path import periodic
from condyle.optimisation.point_to_point import point_to_point

NAMES = "X", "Y", "alpha", "beta"
POSES = [dict.fromkeys(NAMES, 0.0) | {"beta": beta} for beta in (0.0, 0.1, 0.03)]
BOUNDS = {"speed": {"beta": 1.0}, "acceleration": {"beta": 20.0}, "jerk": {"beta": 1000.0}}


def least_time(v: float, a: float, j: float) -> float:
    """The least time from 0 to 1: the highest peak speed whose two ramps fit, by bisection."""

    def ramp(peak: float) -> float:
        return 2 * np.sqrt(peak / j) if peak < a * a / j else peak / a + a / j

    low, high = 0.0, v
    if v * ramp(v) > 1:
        for _ in range(200):
            middle = (low + high) / 2
            low, high = (middle, high) if middle * ramp(middle) < 1 else (low, middle)
    return ramp(high) + 1 / high


def test_a_line_is_the_fastest_within_its_bounds() -> None:
    for bounds in (
        (0.5, 2.0, 30.0), (5.0, 2.0, 30.0), (0.2, 50.0, 30.0), (50.0, 50.0, 30.0), (3.0, 9.0, 27.0),
    ):  # fmt: skip
        _, s, at = point_to_point(np.array([[0.0], [1.0]]), np.array(bounds)[:, None], 1e5)
        found = s[:, 0]
        assert found[0] == 0 and found[-1] == pytest.approx(1, abs=1e-12)
        assert at[-1] == pytest.approx(least_time(*bounds), abs=1.1e-5)
        for bound in bounds[:2]:  # the third difference is rounding
            found = np.diff(found) * 1e5  # means of the derivative: none exceeds the bound
            assert np.abs(found).max() < bound * (1 + 1e-4)


def test_each_pose_is_reached_at_rest_by_the_column_that_is_slowest() -> None:
    poses = np.array([[0.0, 0.0], [1.0, 0.1], [1.0, 3.0]])
    bounds = np.array([[1.0, 1.0], [4.0, 4.0], [40.0, 40.0]])
    t, q, at = point_to_point(poses, bounds, 1000.0)
    assert np.diff(at) == pytest.approx([least_time(1, 4, 40), least_time(*bounds[:, 0] / 2.9)],
                                        rel=1e-3)  # fmt: skip
    rate = np.gradient(q, t, axis=0)
    for pose, when in zip(poses, at, strict=True):
        assert [np.interp(when, t, c) for c in q.T] == pytest.approx(pose, abs=1e-5)
        assert [np.interp(when, t, c) for c in rate.T] == pytest.approx([0, 0], abs=1e-3)
    length = cumulative_trapezoid(np.linalg.norm(rate, axis=1), t)[-1]
    assert length == pytest.approx(np.hypot(1, 0.1) + 2.9, rel=1e-4)  # straight, never back


def test_a_cycle_is_the_periodic_spline() -> None:
    poses = np.random.default_rng(1).normal(size=(7, 2))
    t, q, at = periodic(poses, 0.8, 1000.0)
    knots = np.linspace(0, 0.8, 8)
    reference = make_interp_spline(knots, poses[[*range(7), 0]], k=5, bc_type="periodic")
    assert q == pytest.approx(reference(t), abs=1e-11)
    assert at == pytest.approx(knots[:-1])


def test_shares_of_limits_name_when() -> None:
    found = condyle.plan_path("masticatory", {"pose": POSES, **BOUNDS}, backend="numpy")
    assert found.used["acceleration of beta"][0] == pytest.approx(1, abs=0.02)
    assert str(found).endswith("beyond their limits: none")
    assert len(found.at) == 3 and found.at[-1] == pytest.approx(found.motion.t[-1])
    model = condyle.derive("masticatory", backend="numpy", distribution="minimum_norm")
    chain = model.mechanism.chains[0]
    at = int(np.argmin(np.abs(found.motion.t - found.used[f"effort of {chain.name}"][1])))
    motion = found.motion
    state = motion.value[at], motion.rate[at], motion.acceleration[at]
    effort = model.inverse_dynamics(*state).effort[0]
    limit = limits(chain).high if effort > 0 else -limits(chain).low
    assert abs(effort) / limit == pytest.approx(found.used[f"effort of {chain.name}"][0], rel=1e-6)


def test_studies_that_do_not_fit() -> None:
    changes: list[tuple[dict[str, Any], str]] = [
        ({"pose": POSES[:1]}, "at least 2"),
        ({"pose": [*POSES, {"X": 0.0}]}, "pose 4: expected X"),
        ({"pose": [POSES[0], POSES[0]]}, "pose 2: is the one before"),
        ({"jerk": {}}, "jerk: expected a bound of each column that moves, beta"),
        ({"speed": {"gamma": 1.0}}, "speed: gamma not among"),
        ({"period": 1.0}, "periodic"),
        ({"kind": "periodic"}, "period: expected the time of the cycle"),
        ({"kind": "periodic", "period": 0.001}, "rate: expected two samples a pose"),
        ({"pose": [POSES[0], POSES[0] | {"beta": float("inf")}]}, "pose"),
        ({"speed": dict.fromkeys(POSES[0], 1e-9)}, "10000000 .limit SAMPLES.; lower rate"),
        ({"kind": "periodic", "period": 1e9}, "1e.12 samples, expected at most 10000000"),
    ]
    for change, said in changes:
        with pytest.raises(condyle.CondyleError, match=said):
            condyle.plan_path("masticatory", {"pose": POSES, **BOUNDS, **change}, backend="numpy")
