"""The cycle of least cost, against SciPy's SLSQP on a transcription of its own."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import BSpline
from scipy.optimize import minimize
from support.machines import model as model_of
from support.points import moved

import condyle
from condyle.kinematics.chain.muscle import MuscleState
from condyle.optimisation import collocation
from condyle.optimisation.optimal_motion import OptimalMotion

NAMES = ("X", "Y", "alpha", "beta")
FAR = (0.001, 0.0003, 0.005, 0.06)
BOUNDS = {"X": (-0.001, 0.0015), "Y": (-0.0005, 0.0005), "alpha": (-0.006, 0.006)}
BOUNDS |= {"beta": (-0.005, 0.065)}
LIMIT = 3.0  # N m, of the bundled robot
INTERVALS = 8
STUDY: dict[str, Any] = {
    "period": 1.0,
    "intervals": INTERVALS,
    "pose": [
        {"t": 0.0, **dict.fromkeys(NAMES, 0.0)},
        {"t": 0.5, **dict(zip(NAMES, FAR, strict=True))},
    ],
    "bounds": BOUNDS,
}


def least(**changes: Any) -> OptimalMotion:
    start = changes.pop("start", None)
    study = {**STUDY, **changes}
    return condyle.optimise(study, "masticatory", start=start, backend="numpy")


@pytest.fixture(scope="module")
def model() -> condyle.Model:
    return model_of("masticatory")


@pytest.fixture(scope="module")
def free() -> OptimalMotion:
    """The answer to the study as it stands, which other answers are compared with."""
    return least()


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


class Made(Exception):
    """The program, in the place of its solution."""


def program(monkeypatch: pytest.MonkeyPatch, machine: str, study: dict[str, Any]) -> Any:
    """The program that IPOPT would solve, and its start."""

    def stop(solver: Any, x0: np.ndarray, *_: Any) -> None:
        raise Made(solver, x0)

    monkeypatch.setattr(collocation._Solver, "solved", stop)
    with pytest.raises(Made) as made:
        condyle.optimise(study, machine, backend="numpy")
    return made.value.args


@pytest.mark.parametrize(
    ("machine", "period"), [("masticatory", (0.1, 0.2)), ("human-jaw-muscles", 0.2)]
)
def test_slopes_and_curvature_are_those_of_differences(
    monkeypatch: pytest.MonkeyPatch, machine: str, period: Any
) -> None:
    cost = {"effort": 1.0, "peak_effort": 0.5, "contact_force": 0.01, "jerk": 1e-5, "time": 2.0}
    pose = [{"phase": 0.0, **dict.fromkeys(NAMES, 0.0)}, {"phase": 0.5, "beta": 0.02}]
    study = {"period": period, "intervals": 7, "pose": pose, "cost": cost, "reference_force": 1e2}
    solver, x = program(monkeypatch, machine, {**study, "bounds": {"beta": (-0.1, 0.1)}})
    c, acts, period_at = solver.ends[0], slice(*solver.ends[[0, 2]]), solver.ends[2]
    rng = np.random.default_rng(0)
    x[:c] += 1e-5 * rng.normal(size=c)
    x[acts] = rng.uniform(0.1, 0.9, acts.stop - acts.start)
    d, h, rows = rng.normal(size=len(x)), 1e-6, len(solver.low)
    d[:c] *= 1e-2
    if solver.problem.free:
        x[period_at] = 0.8

    def matrix(pattern: Any, entries: np.ndarray) -> np.ndarray:
        found = np.zeros(pattern.shape)
        found[tuple(pattern.get_triplet())] = entries
        return found

    def lagrangian(x: np.ndarray) -> np.ndarray:
        J = matrix(solver.jacobian_pattern, solver.jacobian(x))
        return 0.7 * solver.gradient(x) + J.T @ weights

    def differences(f: Any) -> Any:
        return (f(x + h * d) - f(x - h * d)) / (2 * h)

    weights = rng.normal(size=rows)
    assert solver.gradient(x) @ d == pytest.approx(differences(solver.cost), rel=1e-6)
    J = matrix(solver.jacobian_pattern, solver.jacobian(x))
    moved = differences(solver.values)
    np.testing.assert_allclose(J @ d, moved, atol=1e-7 * np.abs(moved).max())
    upper = matrix(solver.hessian_pattern, solver.hessian(x, 0.7, weights))
    bent = differences(lagrangian)
    both = upper + np.triu(upper, 1).T
    np.testing.assert_allclose(both @ d, bent, atol=3e-6 * np.abs(bent).max())


@pytest.mark.slow
def test_an_independent_solver_ends_at_the_same_cost(
    model: condyle.Model, free: OptimalMotion
) -> None:
    assert free.cycle.violation <= 1e-9 and free.cycle.cost < free.cycle.first_cost

    def cost(B: np.ndarray, c: np.ndarray) -> float:
        q, v, a, _ = B @ c.reshape(-1, 4)
        return float(np.sum((model.inverse_dynamics(q, v, a).effort / LIMIT) ** 2) / len(q))

    assert free.cycle.cost == pytest.approx(by_slsqp(model, free, cost), rel=1e-4)


@pytest.mark.slow
def test_jerk_costs_what_the_splines_third_derivative_says(
    model: condyle.Model, free: OptimalMotion
) -> None:
    found = least(cost={"effort": 1.0, "jerk": 1e-6}, start=free)
    q, v, a, j = periodic(INTERVALS) @ found.cycle.coefficients
    width = np.array([np.ptp(BOUNDS[name]) for name in NAMES])
    effort = model.inverse_dynamics(q, v, a).effort
    parts = np.sum((effort / LIMIT) ** 2), 1e-6 * np.sum((j / width) ** 2)
    assert found.cycle.cost == pytest.approx(sum(parts) / INTERVALS, rel=1e-9)


@pytest.mark.slow
def test_a_limit_holds_and_one_too_low_is_named(free: OptimalMotion) -> None:
    limit = 0.97 * np.abs(free.cycle.outputs["effort"]).max()
    held = least(limits={"share": limit}, start=free)
    assert np.abs(held.cycle.outputs["effort"]).max() <= limit * (1 + 1e-9)
    assert any("limit of effort" in name for name in held.binding)
    said = r"missed most is the limit of effort of \w+ at t = "
    with pytest.raises(condyle.InputError, match=said):
        least(limits={"share": 3e-4}, intervals=6)


@pytest.mark.slow
def test_the_peak_falls_where_it_alone_costs(free: OptimalMotion) -> None:
    peak = least(cost={"peak_effort": 1.0}, start=free)
    highest = [np.abs(one.cycle.outputs["effort"]).max() for one in (free, peak)]
    assert highest[1] < 0.97 * highest[0]
    assert peak.cycle.cost == pytest.approx(highest[1], rel=1e-9)


@pytest.mark.slow
def test_a_path_is_followed_where_distance_alone_costs() -> None:
    t = np.linspace(0.0, 1.0, 101)
    values = np.outer(0.5 * (1 - np.cos(2 * np.pi * t)), FAR)
    path = condyle.Motion.from_arrays(t, values, NAMES)
    study = {**STUDY, "pose": [{"t": 0.0, **dict.fromkeys(NAMES, 0.0)}]}
    study |= {"cost": {"path": 1.0}, "intervals": 16, "limits": {"singularity_ratio": 0.0}}
    found = condyle.optimise(study, "masticatory", follow=path, backend="numpy")
    there = np.array([np.interp(found.cycle.t, t, x) for x in values.T]).T
    assert (np.abs(found.cycle.q - there) <= 5e-4 * np.abs(FAR)).all()


@pytest.mark.slow
def test_margins_are_kept() -> None:
    """Least ratio and contacts' bounds above and within what the cheapest motion has without."""
    limits: dict[str, Any] = {"singularity_ratio": 1e-9, "contact_bounds": False}
    bare = least(bounds={}, limits=limits, intervals=6)
    ratio = 1.01 * bare.cycle.outputs["singularity_ratio"].min()
    limits["singularity_ratio"] = ratio
    kept = least(bounds={}, limits=limits, intervals=6, start=bare)
    assert kept.cycle.outputs["singularity_ratio"].min() >= ratio * (1 - 1e-9)
    assert kept.cycle.cost >= bare.cycle.cost * (1 - 1e-9)


def test_a_motion_is_written_and_begun_from(free: OptimalMotion, tmp_path: Any) -> None:
    free.save(tmp_path / "cycle.csv")
    again = least(start=tmp_path / "cycle.csv")
    assert again.cycle.cost == pytest.approx(free.cycle.cost, rel=1e-6)
    assert again.cycle.iterations < free.cycle.iterations
    assert again.cycle.first_cost == pytest.approx(free.cycle.cost, rel=1e-4)
    np.testing.assert_allclose(free.motion.value[0], free.motion.value[-1], atol=1e-12)


def test_what_does_not_fit_is_said() -> None:
    tusk: dict[str, Any] = {"point": "incisor", "place": (0.0, 0.0, 0.0), "within": 1e-4}
    home = {"t": 0.0, **dict.fromkeys(NAMES, 0.0)}
    far = home | {"X": 1.0}
    changes: list[tuple[dict[str, Any], str]] = [
        ({"pose": [{"X": 0.0}]}, "pose 1: expected t"),
        ({"period": (0.5, 1.0)}, "where the period is free, expected phase"),
        ({"pose": [{"t": 0.0, "X": 0.0}]}, "Y, alpha, beta has no value"),
        ({"bounds": {"Q": (0.0, 1.0)}}, "Q not among"),
        ({"bounds": {"X": (1.0, 0.0)}}, "least first"),
        ({"cost": {"path": 1.0}}, "follow: expected with cost.path"),
        ({"limits": {"contact_force": {"chin": 1.0}}}, "chin not among"),
        ({"pose": [far], "bounds": {}}, "no efforts at t"),
        ({"pose": [far]}, "pose 1: expected X within bounds.X, -0.001 to 0.0015, got 1"),
        ({"pose": [home, home]}, "pose 2: is at the time of pose 1"),
        ({"pose": [{"t": 0.0, "betta": 0.0}]}, 'Did you mean "beta"'),
        ({"cost": {"time": 1.0}}, "cost: expected a weight above 0"),
        ({"rate": 1e13}, "samples, expected at most"),
        ({"limits": {"activation": (0.1, 1.0)}}, "limits.activation: is of muscles"),
        ({"load_point": "incisor"}, "load_point: requires load"),
        ({"period": -1.0}, r"- period: expected a value above 0"),
        ({"track": [tusk | {"point": "tusk", "t": 0.5}]}, "tusk not among"),
        ({"track": [{"point": "incisor", "within": 1e-4}]}, "track 1: expected path, or place"),
        ({"track": [tusk | {"t": 0.3}]}, "a multiple of 0.125 s"),
        ({"track": [tusk]}, "track 1: expected t"),
    ]
    for change, said in changes:
        with pytest.raises(condyle.InputError, match=said):
            least(**change)


@pytest.mark.slow
def test_a_free_period_is_the_best_of_fixed_ones(free: OptimalMotion) -> None:
    poses = [
        {"phase": t, **dict(zip(NAMES, x, strict=True))} for t, x in ((0, 4 * (0,)), (0.5, FAR))
    ]
    weight = free.cycle.cost
    best = least(period=(0.2, 1.0), pose=poses, cost={"effort": 1.0, "time": weight})
    found = best.cycle
    assert 0.25 < found.period < 0.95
    assert found.t[1] == pytest.approx(found.period / INTERVALS)
    there, *beside = (
        least(period=x * found.period, pose=poses, start=best).cycle.cost
        + weight * x * found.period
        for x in (1.0, 0.97, 1.03)
    )
    assert found.cost == pytest.approx(there, rel=1e-6)
    assert min(beside) > there


def jaw(**changes: Any) -> OptimalMotion:
    pose = [
        {"t": 0.0, **dict.fromkeys(NAMES, 0.0)},
        {"t": 0.15, "X": -0.003, "Y": 0.001, "alpha": 0.0, "beta": 0.08},
    ]
    study = {"period": 0.3, "intervals": 12, "pose": pose, "limits": {"singularity_ratio": 0.0}}
    return condyle.optimise({**study, **changes}, "human-jaw-muscles", backend="numpy")


@pytest.mark.slow
def test_activations_are_those_of_an_independent_transcription() -> None:
    """Of the same motion: balance by forward dynamics, activation's rate by CasADi's symbols."""
    found = jaw().cycle
    model = model_of("human-jaw-muscles")
    chains, N, n, h = model.mechanism.chains, 12, 24, 0.3 / 12
    q, v, a = found.q, found.v, found.a
    at = model.inverse_kinematics(q, v, a)
    muscle = MuscleState.of(chains, at.joint, at.joint_rate)
    still = model.forward_dynamics(q, v, muscle.passive)
    unit = np.eye(n)[:, None] * muscle.active
    alone = model.forward_dynamics(q, v, muscle.passive + unit)
    opti = ca.Opti()
    act, e = opti.variable(N, n), opti.variable(N, n)
    rise, fall = chains[0].muscle.activation_time, chains[0].muscle.deactivation_time
    for i in range(N):
        by_a = (alone.acceleration[:, i] - still.acceleration[i]).T
        by_force = (alone.contact_force[:, i] - still.contact_force[i]).T
        opti.subject_to(still.acceleration[i] + by_a @ act[i, :].T == a[i])
        force = still.contact_force[i] + by_force @ act[i, :].T
        opti.subject_to(np.array([c.push for c in model.mechanism.contacts]) * force >= 0)
        after = act[(i + 1) % N, :]
        mean, s = (act[i, :] + after) / 2, ca.tanh(10 * (e[i, :] - (act[i, :] + after) / 2)) / 2
        slow = 0.5 + 1.5 * mean
        rate = ((0.5 + s) / (rise * slow) + (0.5 - s) * slow / fall) * (e[i, :] - mean)
        opti.subject_to(after - act[i, :] == h * rate)
    opti.subject_to(opti.bounded(0.01, ca.vec(act), 1))
    opti.subject_to(opti.bounded(0, ca.vec(e), 1))
    opti.minimize(ca.sumsqr(act) / N)
    opti.set_initial(act, 0.05)
    opti.set_initial(e, 0.05)
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "tol": 1e-9})
    own = opti.solve()
    # the motion is free in `found` but for two poses: with its own it costs no less
    assert found.cost == pytest.approx(own.value(opti.f), rel=1e-5)
    np.testing.assert_allclose(found.outputs["activation"], own.value(act), atol=1e-4)


@pytest.mark.ci
def test_excitations_bring_the_activations_forward_in_time() -> None:
    found = jaw(intervals=48).cycle
    act, e = found.outputs["activation"], found.outputs["excitation"]
    assert (e >= 0).all() and (e <= 1).all() and np.ptp(act) > 0.02
    one = condyle.load_mechanism("human-jaw-muscles").chains[0].muscle
    rise, fall = one.activation_time, one.deactivation_time
    now, h = act[0], 0.3 / 48

    def rate(_: float, a: np.ndarray, e: np.ndarray) -> np.ndarray:
        s, slow = np.tanh(10 * (e - a)) / 2, 0.5 + 1.5 * a
        return ((0.5 + s) / (rise * slow) + (0.5 - s) * slow / fall) * (e - a)

    for i in range(48):
        step = solve_ivp(rate, (0.0, h), now, args=(e[i],), rtol=1e-8, atol=1e-10)
        now = step.y[:, -1]
        assert np.abs(now - act[(i + 1) % 48]).max() < 0.02 * act.max()


def test_friction_and_coarse_muscles_are_refused() -> None:
    with pytest.raises(condyle.InputError, match="intervals: expected 34 or more, got 8"):
        condyle.optimise(STUDY, "human-jaw-muscles")
    rough = condyle.load_mechanism("masticatory").set(
        "contact.left_condyle.friction.coefficient", 0.3
    )
    with pytest.raises(condyle.UnsupportedError, match="friction"):
        condyle.optimise(STUDY, rough)


def place_of(model: condyle.Model, q: np.ndarray, point: Any) -> np.ndarray:
    """(N, 3)"""
    return np.array([moved(pose, point) + point for pose in model.inverse_kinematics(q).pose])


@pytest.mark.slow
def test_a_point_keeps_to_its_path_and_place(
    model: condyle.Model, free: OptimalMotion, tmp_path: Any
) -> None:
    name, point = next((n, np.array(p)) for n, p in model.mechanism.platform.points.items())
    own, at = place_of(model, free.cycle.q, point), INTERVALS // 4
    near = free.cycle.q[at : at + 1]
    aim = place_of(model, near - np.array([2e-4, 1e-4, 0.0, 4e-3]), point)[0]
    track: dict[str, Any] = {"point": name, "within": 1e-5}
    one = least(track=[{**track, "place": tuple(aim.tolist()), "t": 0.25}], start=free)
    assert np.abs(own[at] - aim).max() > 1e-4
    away = np.abs(place_of(model, one.cycle.q[at : at + 1], point) - aim)
    assert away.max() == pytest.approx(1e-5, rel=1e-3)
    assert one.cycle.cost > free.cycle.cost
    times = np.append(free.cycle.t, 1.0)
    nearer = 1 - 0.05 * np.sin(2 * np.pi * times)[:, None] ** 2
    aside = place_of(model, nearer * np.vstack([free.cycle.q, free.cycle.q[:1]]), point)
    assert np.abs(own - aside[:-1]).max() > 1e-4
    rows, path = np.column_stack([times, aside]), tmp_path / "path.csv"
    np.savetxt(path, rows, delimiter=",", header="t,x,y,z", comments="")
    found = least(track=[track | {"within": 5e-5, "path": str(path)}], start=free)
    away = np.abs(place_of(model, found.cycle.q, point) - aside[:-1])
    assert away.max() == pytest.approx(5e-5, rel=1e-3)


@pytest.mark.slow
def test_a_load_is_that_of_the_nodes(model: condyle.Model, free: OptimalMotion) -> None:
    t = np.linspace(0.0, 2.0, INTERVALS + 1)  # stretched to the period
    force = np.outer(np.sin(np.pi * t / 2) ** 2, (0.0, 0.0, 5.0))
    load = condyle.Load.from_arrays(t, force, point="left_molar")
    found = condyle.optimise(STUDY, "masticatory", load=load, start=free, backend="numpy")
    wrench = np.hstack([force[:-1], np.zeros((INTERVALS, 3))])

    def cost(of: OptimalMotion) -> float:
        states = of.cycle.q, of.cycle.v, of.cycle.a
        effort = model.inverse_dynamics(*states, wrench, "left_molar").effort
        return float(np.sum((effort / LIMIT) ** 2) / INTERVALS)

    assert found.cycle.cost == pytest.approx(cost(found), rel=1e-9)
    assert found.cycle.cost < cost(free)
