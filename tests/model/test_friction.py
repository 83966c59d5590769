"""Friction at contacts and actuators' losses against free body diagrams, active sets and Newton."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from distribution.oracle import Full, best_active_set
from oracles.newton_euler import inverse_dynamics
from oracles.random_mechanism import toml_text
from oracles.rotations import platform_motion
from oracles.rubbing import Balance
from scipy.optimize import minimize
from support.loads import load_point_of, parts
from support.rubbing import Rubbing, drawn
from support.speeds import few, first, slow

import condyle
from condyle.dynamics import FORMULATIONS
from condyle.mechanism import parse
from condyle.mechanism.contact import Friction
from condyle.model.model import Model
from condyle.model.model_result import ModelResult
from condyle.status import Status

pytestmark = pytest.mark.slow

CASES: dict[str, dict[str, Any]] = {
    "k1": {"contacts": 1, "seed": 1},
    "k1 n8": {"contacts": 1, "chains": 7, "seed": 2},
    "k2 plane": {"seed": 3},
    "k2 quadratic": {"surface": "quadratic", "seed": 4},
    "k2 sphere, cylinder": {"surface": ("sphere", "cylinder"), "seed": 5},
    "k2 ellipsoid, profile": {"surface": ("ellipsoid", "profile"), "seed": 6},
    "k2 ball plane": {"ball_radius": 3.0, "seed": 7},
    "k2 ball sphere, quadratic": {
        "surface": ("sphere", "quadratic"), "ball_radius": 3.0, "seed": 8
    },
    "k2 ball cylinder, ellipsoid": {
        "surface": ("cylinder", "ellipsoid"), "ball_radius": 3.0, "seed": 9
    },
    "k3 mixed": {"contacts": 3, "surface": "mixed", "seed": 16},
    "k3 ball": {"contacts": 3, "ball_radius": 3.0, "surface": "sphere", "seed": 17},
    "k4": {"contacts": 4, "seed": 18},
    "PSS": {"families": ("PSS",), "seed": 19},
    "SPS": {"families": ("SPS",), "contacts": 3, "seed": 20},
    "as many efforts as equations": {"contacts": 2, "chains": 4, "seed": 21},
    "much friction": {"mu": 0.9, "surface": "quadratic", "seed": 22},
}  # fmt: skip


@cache
def found(name: str) -> tuple[Rubbing, ModelResult]:
    case = drawn(**{"count": 3, **CASES[name]})
    return case, by_numpy(name).inverse_dynamics(*case.arguments, outputs="all")


@cache
def by_numpy(name: str) -> Model:
    return Model(drawn(**{"count": 3, **CASES[name]}).mechanism, backend="numpy")


def least(b: Balance) -> tuple[float, np.ndarray, np.ndarray] | None:
    """Of all patterns and active sets the least half sum of squares, with efforts and forces."""
    n, k, best = b.C.shape[1], b.N.shape[1], None
    for sigma in b.patterns():
        signs = np.array(sigma, float)
        full = Full(
            np.hstack([b.C, b.along(sigma)]),
            b.b,
            np.r_[np.full(n, -np.inf), np.where(signs > 0, 0.0, -np.inf)],
            np.r_[np.full(n, np.inf), np.where(signs < 0, 0.0, np.inf)],
            np.r_[np.ones(n), np.zeros(k)],
            n,
        )
        answer = best_active_set(full)
        if answer and (best is None or answer[0] < best[0]):
            best = answer[0], answer[1][:n], answer[1][n:]
    return best


@pytest.mark.parametrize("name", first(CASES, 5))
def test_least_of_all_patterns_and_active_sets(name: str) -> None:
    case, got = found(name)
    for i, b in enumerate(case.balances()):
        wanted = least(b)
        if wanted is None:
            assert got.status[i] == Status.jammed
            continue
        assert got.status[i] == Status.ok
        _, effort, force = wanted
        np.testing.assert_allclose(got.effort[i], effort, atol=1e-8 * np.abs(effort).max())
        np.testing.assert_allclose(got.contact_force[i], force, atol=1e-8 * np.abs(force).max())
        np.testing.assert_allclose(got.slip[i], b.slip, atol=1e-12)
        rubbed = -np.abs(force)[:, None] * b.drag
        np.testing.assert_allclose(got.friction_force[i], rubbed, atol=1e-8 * np.abs(force).max())
    assert (got.status == Status.ok).any()


@pytest.mark.parametrize("name", few(CASES, "k1", "k2 plane", "k2 ellipsoid, profile"))
def test_conditions_of_optimality(name: str) -> None:
    """C effort + D lambda = b; effort = C^T y; D^T y = 0, but for forces that are held at 0."""
    case, got = found(name)
    for i, b in enumerate(case.balances()):
        if got.status[i] != Status.ok:
            continue
        effort, force = got.effort[i], got.contact_force[i]
        size = np.abs(b.b).max()
        touching = np.abs(force) < 1e-9 * size
        sigma = np.where(touching, 1, np.sign(force)).astype(int)
        assert np.abs(b.C @ effort + b.along(sigma) @ force - b.b).max() < 1e-10 * size
        columns = [b.C, b.along(sigma)[:, ~touching]]
        right = np.r_[effort, np.zeros((~touching).sum())]
        y = np.linalg.lstsq(np.hstack(columns).T, right, rcond=None)[0]
        assert np.abs(np.hstack(columns).T @ y - right).max() < 1e-8 * np.abs(effort).max()
        if np.linalg.matrix_rank(b.C) == 6:  # y is the only one: no pattern would take less
            for k in np.flatnonzero(touching):
                slack = 1e-8 * np.abs(y).max()
                assert (b.N[:, k] - b.T[:, k]) @ y <= slack
                assert (b.N[:, k] + b.T[:, k]) @ y >= -slack


@pytest.mark.parametrize("name", first(CASES, 6))
def test_free_bodies_balance_with_friction_as_a_load(name: str) -> None:
    """Efforts put on all bodies cut free: friction by a fixed point, and nothing is left over.

    All of a contact's friction is moved to the load's point, as a force and a moment.
    """
    case, got = found(name)
    s = case.states
    point = np.array(case.mechanism.platform.points[s["load_point"]])
    for i, b in enumerate(case.balances()):
        if got.status[i] != Status.ok:
            continue
        at = platform_motion(s["pose"][i]).R @ point
        state = (s[x][i] for x in ("pose", "pose_rate", "pose_acceleration"))
        pose, rate, second = state
        force = np.zeros(len(b.drag))
        for _ in range(60):
            rubbed = -np.abs(force)[:, None] * b.drag
            moment = np.cross(b.touch - at, rubbed).sum(axis=0)
            wrench = s["wrench"][i] + np.r_[rubbed.sum(axis=0), moment]
            tau = got.effort[i] - b.loss
            cut = inverse_dynamics(case.raw, pose, rate, second, wrench, s["load_point"], tau)
            change = np.abs(cut["contact"] - force).max()
            force = cut["contact"]
            if change < 1e-13 * np.abs(force).max():
                break
        if name == "much friction" and change > 1e-9:  # the fixed point does not attract
            force = got.contact_force[i]
        size = np.abs(b.b).max()
        np.testing.assert_allclose(got.contact_force[i], force, atol=1e-8 * size)
        if change < 1e-9:
            assert cut["residual"] < 1e-9


def test_quadratic_programs_by_slsqp() -> None:
    case, got = found("k2 quadratic")
    for effort, b in zip(got.effort, case.balances(), strict=True):
        values = [value for sigma in b.patterns() if (value := by_slsqp(b, sigma)) is not None]
        assert effort @ effort == pytest.approx(min(values), rel=1e-6)


def by_slsqp(b: Balance, sigma: tuple[int, ...]) -> float | None:
    """Least sum of squares under a pattern; None where none was found."""
    A, n = np.hstack([b.C, b.along(sigma)]), b.C.shape[1]
    start = np.linalg.lstsq(A, b.b, rcond=None)[0]
    start[n:] = np.where(np.sign(start[n:]) == sigma, start[n:], 0)
    done = minimize(
        lambda z: z[:n] @ z[:n],
        start,
        jac=lambda z: np.r_[2 * z[:n], 0 * z[n:]],
        bounds=[(None, None)] * n + [(0, None) if x > 0 else (None, 0) for x in sigma],
        constraints={"type": "eq", "fun": lambda z: A @ z - b.b, "jac": lambda z: A},
        method="SLSQP",
        options={"maxiter": 500, "ftol": 1e-14},
    )
    return float(done.fun) if np.abs(A @ done.x - b.b).max() < 1e-8 else None


@pytest.mark.slow
@pytest.mark.parametrize("name", ["k2 ball cylinder, ellipsoid", "k2 ellipsoid, profile"])
def test_sliding_velocity_by_differences_of_the_motion(name: str) -> None:
    """A point fixed to the platform where the ball touches moves at the velocity of sliding."""
    case, got = found(name)
    model = by_numpy(name)
    q, q1, q2, load = case.packed
    h = 1e-4
    poses = [
        model.inverse_dynamics(
            q + t * q1 + t * t / 2 * q2, q1 + t * q2, q2, *parts(load), outputs="all"
        ).pose
        for t in (-2 * h, -h, h, 2 * h)
    ]
    for i, (pose, b) in enumerate(zip(got.pose, case.balances(), strict=True)):
        body = platform_motion(pose).R.T @ b.touch.T
        at = []
        for moved in poses:
            motion = platform_motion(moved[i])
            at.append((motion.origin[:, None] + motion.R @ body).T)
        speed = (8 * (at[2] - at[1]) - (at[3] - at[0])) / (12 * h)
        np.testing.assert_allclose(got.slip[i], speed, atol=1e-7 * np.abs(speed).max())
        for k, contact in enumerate(case.mechanism.contacts):
            normal = got.configuration.contact_normal[i, k]
            centre = got.configuration.contact_point[i, k]
            reach = np.linalg.norm(b.touch[k] + got.pose[i, :3] - centre)
            assert reach == pytest.approx(contact.ball_radius or 0.0, abs=1e-12)
            assert abs(normal @ got.slip[i, k]) < 1e-10  # it slides and does not leave


HELD: dict[str, dict[str, Any]] = {
    "k1": {"contacts": 1, "mu": 0.7, "seed": 26},
    "one effort to spare": {"chains": 5, "seed": 23},
    "two": {"mu": 0.9, "surface": "quadratic", "seed": 22},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", HELD)
def test_a_kernel_is_sure_of_forces_that_are_held_at_zero(name: str) -> None:
    """All candidates in one graph against Newton's method on the dual, pattern by pattern."""
    case = drawn(count=20, **HELD[name])
    model = Model(case.mechanism, backend="numpy")
    q, q1, q2, load = case.packed
    wrench = {"force": load[:, :3], "moment": load[:, 3:6], "point": load[:, 6:]}
    given = {"q": q, "q1": q1, "q2": q2, **wrench}
    answer = model.kernel("inverse", ("contact",)).run(given)
    wanted, status = model.system.robust.evaluate(given)
    assert not answer.status.any() and not status.any()
    for part in ("effort", "contact_force"):
        a, b = answer.values[part], wanted[part]
        np.testing.assert_allclose(a, b, atol=1e-9 * np.abs(b).max())
    held = (answer.values["contact_force"] == 0).sum(axis=0)
    assert (held == 1).any()
    assert (held == 2).any() == (name == "two")


@pytest.mark.parametrize("formulation", first(FORMULATIONS, 2, rest=slow))
@pytest.mark.parametrize("route", few(["core", "direct"], "core"))
def test_every_formulation_and_route(formulation: str, route: str) -> None:
    case, wanted = found("k2 plane")
    model = Model(case.mechanism, formulation=formulation, route=route, backend="numpy")
    got = model.inverse_dynamics(*case.arguments, outputs="all")
    for name in ("effort", "contact_force", "friction_force", "slip"):
        a, b = getattr(got, name), getattr(wanted, name)
        np.testing.assert_allclose(a, b, atol=1e-10 * np.abs(b).max())


@pytest.mark.slow
@pytest.mark.usefixtures("compiler_command")
def test_compiled() -> None:
    case, wanted = found("k2 plane")
    model = Model(case.mechanism, backend="compiled")
    got = model.inverse_dynamics(*case.arguments)
    size = np.abs(wanted.effort).max()
    np.testing.assert_allclose(got.effort, wanted.effort, atol=1e-11 * size)
    for sample, effort in zip(zip(*case.arguments, strict=True), wanted.effort, strict=True):
        np.testing.assert_allclose(
            model.unchecked().inverse_dynamics(*sample), effort, atol=1e-11 * size
        )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["k2 plane", "k3 mixed"])
def test_torques_agree_with_evaluate_whatever_is_asked_and_on_threads(name: str) -> None:
    case, wanted = found(name)
    model = by_numpy(name)
    asked = ("share", "gravity_share", "pose", "joint_rate", "condition")
    for outputs in ((), ("gravity_share",), asked) if name == "k2 plane" else ((), asked):
        got = model.inverse_dynamics(*case.arguments, outputs=outputs, threads=2)
        assert (got.status == wanted.status).all()
        np.testing.assert_allclose(got.effort, wanted.effort, rtol=1e-9, atol=1e-12)
        for part in {"share", "gravity_share"} & set(outputs):
            assert getattr(got, part).shape == wanted.share.shape
    one = np.array(
        [model.unchecked().inverse_dynamics(*row) for row in zip(*case.arguments, strict=True)]
    )
    np.testing.assert_allclose(one, wanted.effort, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", ["k3 mixed", "k1"])
def test_shares_are_of_least_norm_and_add_up(name: str) -> None:
    case, got = found(name)
    model = by_numpy(name)
    assert model.parts[-4:] == ("actuators", "load", "friction", "internal")
    np.testing.assert_allclose(got.share.sum(axis=1), got.effort, atol=1e-12)
    share = dict(zip(model.parts, np.moveaxis(got.share, 1, 0), strict=True))
    J = model.jacobians(case.arguments[0])
    A = J.J_theta @ J.M_J
    for i, b in enumerate(case.balances()):
        # What balances itself does nothing, and the losses are what the actuators' share holds.
        held = A[i].T @ share["actuators"][i]
        np.testing.assert_allclose(held, A[i].T @ b.loss, atol=1e-10 * np.abs(b.loss).max())
        scale = np.abs(A[i]).max() * np.abs(got.effort[i]).max()
        assert np.abs(A[i].T @ share["internal"][i]).max() < 1e-10 * scale


@pytest.mark.parametrize("name", ["k2 quadratic", "k3 mixed"])
def test_at_rest_friction_vanishes(name: str) -> None:
    case = found(name)[0].still()
    raw = case.raw | {"contact": [dict(c) for c in case.raw["contact"]]}
    raw["chain"] = [{k: v for k, v in c.items() if k != "actuator"} for c in raw["chain"]]
    for contact in raw["contact"]:
        del contact["friction"]
    got = by_numpy(name).inverse_dynamics(*case.arguments, outputs="all")
    bare = Model(parse(toml_text(raw)), backend="numpy").inverse_dynamics(
        *case.arguments, outputs="all"
    )
    assert np.abs(got.friction_force).max() == 0 == np.abs(got.slip).max()
    size = np.abs(bare.effort).max()
    np.testing.assert_allclose(got.effort, bare.effort, atol=1e-12 * size)
    size = np.abs(bare.contact_force).max()
    np.testing.assert_allclose(got.contact_force, bare.contact_force, atol=1e-11 * size)


@pytest.mark.parametrize("contacts", [2, 3])
def test_without_friction_and_losses_nothing_changes(contacts: int) -> None:
    bare = drawn(5, mu=0, lossy=False, contacts=contacts)
    raw = bare.raw | {"contact": [dict(c) for c in bare.raw["contact"]]}
    for contact in raw["contact"]:
        contact["friction"] = {"coefficient": 0.0}
    raw["chain"] = [c | {"actuator": {"coulomb": 0.0, "gear": 9.0}} for c in raw["chain"]]
    a, b = (
        Model(parse(toml_text(x)), backend="numpy").inverse_dynamics(*bare.arguments, outputs="all")
        for x in (bare.raw, raw)
    )
    assert (a.effort == b.effort).all() and (a.contact_force == b.contact_force).all()
    assert a.share.shape == b.share.shape and not b.slip.any()


def test_the_order_of_chains_and_contacts_does_not_matter() -> None:
    case, wanted = found("k2 ball plane")
    rng = np.random.default_rng(1)
    chains, contacts = rng.permutation(len(case.raw["chain"])), [1, 0]
    raw = dict(case.raw)
    raw["chain"] = [raw["chain"][i] for i in chains]
    raw["contact"] = [raw["contact"][i] for i in contacts]
    rows = rng.permutation(len(wanted.effort))
    given = [a[rows] for a in case.arguments]
    got = Model(parse(toml_text(raw)), backend="numpy").inverse_dynamics(*given, outputs="all")
    effort = wanted.effort[rows][:, chains]
    np.testing.assert_allclose(got.effort, effort, atol=1e-10 * np.abs(effort).max())
    force = wanted.contact_force[rows][:, contacts]
    np.testing.assert_allclose(got.contact_force, force, atol=1e-10 * np.abs(force).max())


@pytest.mark.slow
def test_friction_takes_work() -> None:
    for name in ("k2 quadratic", "k3 ball", "much friction"):
        _, got = found(name)
        good = got.status == Status.ok
        power = (got.friction_force * got.slip).sum(axis=2)[good]
        assert (power <= 0).all() and power.min() < 0


@pytest.mark.parametrize("name", first(["k2 ball cylinder, ellipsoid", "k3 mixed", "k1 n8", "SPS"]))
def test_power_balance_along_a_trajectory(name: str) -> None:
    """Efforts and load, less friction and losses, change the energy; rotors have theirs."""
    case, _ = found(name)
    model = by_numpy(name)
    rng, m = np.random.default_rng(2), model.mechanism.degrees_of_freedom
    small = 0.2 if m == 3 else 1.0
    unit = small * np.array([3e-4 if x in "XYZ" else 0.01 for x in model.independent])
    phase, t, h = rng.uniform(0, 6, m), np.linspace(0, 0.1, 9)[:, None], 2e-4

    def q(t: np.ndarray, order: int) -> np.ndarray:
        return unit * 60.0**order * np.sin(60 * t + phase + order * np.pi / 2)

    def kinetic(t: np.ndarray) -> np.ndarray:
        M = model.mass_matrix(q(t, 0))  # with the rotors
        return np.einsum("ri,rij,rj->r", q(t, 1), M, q(t, 1)) / 2

    load = case.packed[3][:1] + np.zeros((len(t), 1))
    got = model.inverse_dynamics(q(t, 0), q(t, 1), q(t, 2), *parts(load), outputs="all")
    assert (got.status == Status.ok).all()
    slope = 8 * (kinetic(t + h) - kinetic(t - h)) - (kinetic(t + 2 * h) - kinetic(t - 2 * h))
    slope /= 12 * h
    slope += (q(t, 1) * model.gravity(q(t, 0))).sum(axis=1)
    power = (got.effort * got.joint_rate).sum(axis=1)
    for i, (pose, rate) in enumerate(zip(got.pose, got.pose_rate, strict=True)):
        motion = platform_motion(pose, rate)
        power[i] += load[i, :3] @ motion.point(load[i, 6:])[1] + load[i, 3:6] @ motion.omega
    rubbed = (got.friction_force * got.slip).sum(axis=(1, 2))
    lost = np.zeros(len(t))
    for j, chain in enumerate(case.raw["chain"]):
        a, x = chain["actuator"], got.joint_rate[:, j]
        lost += a["viscous"] * x**2 + a["coulomb"] * x**2 / np.hypot(x, a["smoothing_speed"])
    size = np.abs(got.effort * got.joint_rate).sum(axis=1).max()
    assert np.abs(power + rubbed - lost - slope).max() < 1e-7 * size
    assert min(np.abs(rubbed).max(), lost.max(), np.abs(slope).max()) > 1e-3 * size


def reference_with_friction(mu: float) -> condyle.Mechanism:
    robot = condyle.load_mechanism("masticatory")
    friction = Friction(coefficient=mu, smoothing_speed=0.002)
    contacts = [c.model_copy(update={"friction": friction}) for c in robot.contacts]
    return robot.replace(contacts=tuple(contacts))


@pytest.mark.slow
def test_efforts_are_continuous_but_where_the_least_pattern_changes() -> None:
    """Along the reference motion; every change of a pattern is closed in on by bisection.

    Either a force passes through 0 there, and efforts do not leap, or two patterns are of one norm.
    """
    model = Model(reference_with_friction(0.9), backend="numpy")
    times = np.linspace(0, 5, 5001)
    motion = condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], times=times)
    states, _ = model.poses.of_motion(motion)
    load = np.zeros((len(times), 9))
    load[:, :6] = condyle.reference_load().at(times)
    load[:, 6:] = load_point_of(model, "right_molar")
    path = np.hstack([*states, load])

    def at(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        got = model.inverse_dynamics(*np.split(rows, [4, 8, 12, 18], axis=1))
        assert (got.status == Status.ok).all()
        return got.effort, sides(got.contact_force)

    def sides(force: np.ndarray) -> np.ndarray:
        return np.where(np.abs(force) < 1e-10, 0, np.sign(force))

    effort, sigma = at(path)
    size = np.abs(effort).max()
    step = np.abs(np.diff(effort, axis=0)).max(axis=1) / size
    changes = (sigma[1:] != sigma[:-1]).any(axis=1)
    half = np.abs(effort[2:] - effort[:-2]).max(axis=1)[::2] / size
    assert step[~changes].max() < 0.6 * half.max()  # half the step, half the change
    assert changes.sum() > 5
    low, high = path[:-1][changes], path[1:][changes]
    start = sigma[:-1][changes]
    for _ in range(36):
        middle = (low + high) / 2
        same = (at(middle)[1] == start).all(axis=1)[:, None]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    (before, _), (after, _) = at(low), at(high)
    leap = np.abs(after - before).max(axis=1) > 1e-6 * size
    norms = [np.linalg.norm(x[leap], axis=1) for x in (before, after)]
    np.testing.assert_allclose(*norms, rtol=1e-6)
    assert leap.sum() <= changes.sum()
    print(f"{changes.sum()} changes, {leap.sum()} leaps")


def test_jammed() -> None:
    """Strong friction under which, at some samples, no pattern of signs is consistent."""
    case = drawn(4, count=40, mu=3.0, contacts=2, chains=4, lossy=False)
    got = Model(case.mechanism, backend="numpy").inverse_dynamics(*case.arguments, outputs="all")
    jams = np.array([least(b) is None for b in case.balances()])
    assert 0 < jams.sum() < len(jams)
    assert (got.status[jams] == Status.jammed).all()
    assert (got.status[~jams] == Status.ok).all()
    assert np.isnan(got.effort[jams]).all() and np.isnan(got.shortfall[jams]).all()
    assert (got.shortfall[~jams] == 1).all()


def test_a_jam_does_not_disturb_others() -> None:
    case = drawn(4, count=40, mu=3.0, contacts=2, chains=4, lossy=False)
    model = Model(case.mechanism, backend="numpy")
    got = model.inverse_dynamics(*case.arguments, outputs="all")
    good = got.status == Status.ok
    alone = model.inverse_dynamics(*(a[good] for a in case.arguments), outputs="all")
    np.testing.assert_allclose(alone.effort, got.effort[good], rtol=1e-9)


def test_nothing_that_can_be_computed() -> None:
    """All samples out of reach: results have their shapes, and no numbers."""
    case, wanted = found("k2 quadratic")
    q, q1, q2, load = case.packed
    model = by_numpy("k2 quadratic")
    got = model.inverse_dynamics(q + 10.0, q1, q2, *parts(load), outputs="all")
    assert (got.status == Status.unreachable).all()
    assert np.isnan(got.shortfall).all() and got.share.shape == wanted.share.shape


@pytest.mark.parametrize("name", ["k2 plane", "k3 mixed"])
def test_the_robust_path_agrees(name: str) -> None:
    """Every sample looked at by singular values and active sets, as near a singularity."""
    case, wanted = found(name)
    model = by_numpy(name)
    q, q1, q2, load = case.packed
    names = ("q", "q1", "q2", "force", "moment", "point")
    given = dict(zip(names, (q, q1, q2, *np.hsplit(load, 3)), strict=True))
    values, status = model.system.robust.evaluate(given)
    assert (status == wanted.status).all()
    np.testing.assert_allclose(values["effort"].T, wanted.effort, rtol=1e-8, atol=1e-11)
    assert values["share"].shape[0] == values["gravity"].shape[0] == len(model.parts)
    share = np.moveaxis(values["share"], -1, 0)
    np.testing.assert_allclose(share, wanted.share, rtol=1e-7, atol=1e-9)


@pytest.mark.slow
def test_a_kernel_vouches_only_for_the_least_of_all() -> None:
    """Among many samples are some whose least has a contact force of 0, next to a worse pattern."""
    case = drawn(3, count=150, mu=0.9)
    model = Model(case.mechanism, backend="numpy")
    q, q1, q2, load = case.packed
    names = ("q", "q1", "q2", "force", "moment", "point")
    given = dict(zip(names, (q, q1, q2, *np.hsplit(load, 3)), strict=True))
    values, status = model.system.robust.evaluate(given)
    got = model.inverse_dynamics(*case.arguments)
    assert (got.status == status).all()
    np.testing.assert_allclose(got.effort, values["effort"].T, rtol=1e-7, atol=1e-9)
