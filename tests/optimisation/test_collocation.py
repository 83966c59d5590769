"""The cycle of least cost, against SciPy's SLSQP on a transcription of its own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.optimize import minimize

import condyle
from condyle.optimisation.collocation import Collocation, Measured
from condyle.optimisation.optimal_motion import OptimalMotion

NAMES = ("X", "Y", "alpha", "beta")
FAR = (0.001, 0.0003, 0.005, 0.06)
BOUNDS = {"X": (-0.001, 0.0015), "Y": (-0.0005, 0.0005), "alpha": (-0.006, 0.006)}
BOUNDS |= {"beta": (-0.005, 0.065)}
LIMIT = 3.0  # N m, of the bundled robot
STUDY: dict[str, Any] = {
    "period": 1.0,
    "intervals": 12,
    "pose": [
        {"t": 0.0, **dict.fromkeys(NAMES, 0.0)},
        {"t": 0.5, **dict(zip(NAMES, FAR, strict=True))},
    ],
    "bounds": BOUNDS,
}


@pytest.fixture(scope="module")
def model() -> condyle.Model:
    return condyle.derive("masticatory", backend="numpy")


def least(**changes: Any) -> OptimalMotion:
    start = changes.pop("start", None)
    study = {**STUDY, **changes}
    return condyle.optimise(study, "masticatory", start=start, backend="numpy")


def periodic(N: int) -> np.ndarray:
    """Values and derivatives of SciPy's periodic splines at the nodes, (4, N, N)."""
    knots = np.arange(-5, N + 6) / N
    t = np.arange(N) / N
    found = np.zeros((4, N, N))
    for j in range(N + 5):
        one = BSpline(knots, np.eye(N + 5)[j], 5)
        for nu in range(4):
            found[nu, :, j % N] += one(t, nu)
    return found


def by_slsqp(model: condyle.Model, found: OptimalMotion, cost: Any) -> float:
    """The least cost(B, c) of SciPy's solver, from halfway between the answer and a plain curve."""
    N = len(found.cycle.t)
    B = periodic(N)
    box = np.array([BOUNDS[name] for name in NAMES])
    points = np.array([np.zeros(4), FAR])
    passing, nodes = np.kron(B[0][[0, N // 2]], np.eye(4)), np.kron(B[0], np.eye(4))
    low, high = np.tile(box[:, 0], N), np.tile(box[:, 1], N)
    start = np.linalg.lstsq(passing, points.ravel(), rcond=None)[0]
    start = start + 0.5 * (found.cycle.coefficients.ravel() - start)
    size = 1.0 / found.cycle.cost
    other = minimize(
        lambda c: size * cost(B, c),
        start,
        method="SLSQP",
        constraints=[
            {"type": "eq", "fun": lambda c: 1e2 * (passing @ c - points.ravel())},
            {"type": "ineq", "fun": lambda c: 1e2 * (nodes @ c - low)},
            {"type": "ineq", "fun": lambda c: 1e2 * (high - nodes @ c)},
        ],
        options={"maxiter": 400, "ftol": 1e-10},
    )
    assert np.abs(passing @ other.x - points.ravel()).max() < 1e-9
    return float(other.fun / size)


def test_slopes_are_those_of_the_cost(model: condyle.Model) -> None:
    names = tuple(f"effort {i}" for i in range(6))
    free = np.full(6, np.inf)
    effort = Measured("effort", names, np.full(6, LIMIT), -free, free, weight=1.0)
    two = np.full(2, np.inf)
    load = Measured("contact_force", ("left", "right"), np.ones(2), -two, two, weight=0.01)
    problem = Collocation(model, 1.0, 12, (effort, load))
    rng = np.random.default_rng(0)
    c, d, h = 1e-3 * rng.normal(size=48), rng.normal(size=48), 1e-6
    by_steps = (problem.cost(c + h * d) - problem.cost(c - h * d)) / (2 * h)
    assert problem.gradient(c) @ d == pytest.approx(by_steps, rel=1e-6)
    curved = (problem.gradient(c + h * d) - problem.gradient(c - h * d)) / (2 * h)
    exact = problem.hessian(c, 1.0, np.zeros((12, 8))) @ d
    np.testing.assert_allclose(exact, curved, atol=1e-6 * np.abs(curved).max())


@pytest.mark.slow
def test_an_independent_solver_ends_at_the_same_cost(model: condyle.Model) -> None:
    found = least()
    assert found.cycle.violation <= 1e-9 and found.cycle.cost < found.cycle.first_cost

    def cost(B: np.ndarray, c: np.ndarray) -> float:
        q, v, a, _ = B @ c.reshape(-1, 4)
        return float(np.sum((model.inverse_dynamics(q, v, a).effort / LIMIT) ** 2) / len(q))

    assert found.cycle.cost == pytest.approx(by_slsqp(model, found, cost), rel=1e-4)


def test_jerk_costs_what_the_splines_third_derivative_says(model: condyle.Model) -> None:
    found = least(cost={"effort": 1.0, "jerk": 1e-6})
    q, v, a, j = periodic(12) @ found.cycle.coefficients
    width = np.array([np.ptp(BOUNDS[name]) for name in NAMES])
    effort = model.inverse_dynamics(q, v, a).effort
    parts = np.sum((effort / LIMIT) ** 2), 1e-6 * np.sum((j / width) ** 2)
    assert found.cycle.cost == pytest.approx(sum(parts) / 12, rel=1e-9)


@pytest.mark.slow
def test_a_limit_holds_and_one_too_low_is_named() -> None:
    free = least(intervals=20)
    effort = np.abs(free.cycle.outputs["effort"]).max()
    held = least(intervals=20, limits={"share": 0.97 * effort}, start=free)
    assert np.abs(held.cycle.outputs["effort"]).max() <= 0.97 * effort * (1 + 1e-9)
    assert any("limit of effort" in name for name in held.binding)
    with pytest.raises(
        condyle.InputError, match=r"missed most is the limit of effort of \w+ at t = "
    ):
        least(intervals=20, limits={"share": 3e-4})


@pytest.mark.slow
def test_the_peak_falls_where_it_alone_costs() -> None:
    squares, peak = least(), least(cost={"peak_effort": 1.0})
    highest = [np.abs(one.cycle.outputs["effort"]).max() for one in (squares, peak)]
    assert highest[1] < 0.97 * highest[0]
    assert peak.cycle.cost == pytest.approx(highest[1], rel=1e-9)


def test_a_path_is_followed_where_distance_alone_costs() -> None:
    t = np.linspace(0.0, 1.0, 101)
    turn = 0.5 * (1 - np.cos(2 * np.pi * t))
    values = np.outer(turn, FAR)
    path = condyle.Motion.from_arrays(t, values, NAMES)
    study = {**STUDY, "pose": [{"t": 0.0, **dict.fromkeys(NAMES, 0.0)}]}
    study |= {"cost": {"path": 1.0}, "intervals": 16, "limits": {"singularity_ratio": 0.0}}
    found = condyle.optimise(study, "masticatory", follow=path, backend="numpy")
    there = np.array([np.interp(found.cycle.t, t, x) for x in values.T]).T
    assert (np.abs(found.cycle.q - there) <= 5e-4 * np.abs(FAR)).all()


def test_margins_are_kept() -> None:
    """Least ratio and contacts' bounds above and within what the cheapest motion has without."""
    bare = least(bounds={}, limits={"singularity_ratio": 1e-9, "contact_bounds": False})
    ratio = bare.cycle.outputs["singularity_ratio"].min()
    kept = least(bounds={}, limits={"singularity_ratio": 1.01 * ratio, "contact_bounds": False})
    assert kept.cycle.outputs["singularity_ratio"].min() >= 1.01 * ratio * (1 - 1e-9)
    assert kept.cycle.cost >= bare.cycle.cost * (1 - 1e-9)


def test_a_motion_is_written_and_begun_from(tmp_path: Any) -> None:
    first = least()
    first.save(tmp_path / "cycle.csv")
    again = least(start=tmp_path / "cycle.csv")
    assert again.cycle.cost == pytest.approx(first.cycle.cost, rel=1e-6)
    assert again.cycle.iterations < first.cycle.iterations
    assert again.cycle.first_cost == pytest.approx(first.cycle.cost, rel=1e-4)
    np.testing.assert_allclose(first.motion.value[0], first.motion.value[-1], atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"pose": [{"X": 0.0}]}, "pose 1: expected t"),
        ({"pose": [{"t": 0.0, "X": 0.0}]}, "Y, alpha, beta has no value"),
        ({"bounds": {"Q": (0.0, 1.0)}}, "Q not among"),
        ({"bounds": {"X": (1.0, 0.0)}}, "least first"),
        ({"cost": {"path": 1.0}}, "follow: expected with cost.path"),
        ({"limits": {"contact_force": {"chin": 1.0}}}, "chin not among"),
        ({"pose": [{"t": 0.0, "X": 1.0, "Y": 0.0, "alpha": 0.0, "beta": 0.0}]}, "no efforts at t"),
    ],
)
def test_what_does_not_fit_is_said(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(condyle.InputError, match=said):
        least(**changes)


def test_muscles_and_friction_are_refused() -> None:
    with pytest.raises(condyle.UnsupportedError, match="limits of muscles"):
        condyle.optimise(STUDY, "human-jaw-muscles")
    rough = condyle.load_mechanism("masticatory").set(
        "contact.left_condyle.friction.coefficient", 0.3
    )
    with pytest.raises(condyle.UnsupportedError, match="friction"):
        condyle.optimise(STUDY, rough)
