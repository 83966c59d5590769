"""Friction at contacts and actuators' losses against free body diagrams, active sets and energy."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from distribution.oracle import Program
from oracles.newton_euler import inverse_dynamics
from oracles.random_mechanism import toml_text
from oracles.rotations import platform_motion
from oracles.rubbing import Balance
from support.families import close
from support.loads import load_point_of, parts
from support.rubbing import Rubbing, drawn
from support.speeds import few, first

import condyle
from condyle.dynamics import FORMULATIONS
from condyle.mechanism import parse
from condyle.mechanism.contact import Friction
from condyle.model.model import Model
from condyle.model.model_result import ModelResult
from condyle.status import Status

pytestmark = pytest.mark.slow

CASES: dict[str, dict[str, Any]] = {
    "k1 n7": {"contacts": 1, "chains": 7, "seed": 2},
    "k2 plane": {"seed": 3},
    "PSS ball": {
        "families": ("PSS",), "contacts": 1, "surface": "quadratic", "ball_radius": 3.0, "seed": 9
    },
    "much friction": {"mu": 0.9, "surface": "quadratic", "seed": 22},
    "as many efforts as equations": {"contacts": 2, "chains": 4, "seed": 21},
    "SPS": {"families": ("SPS",), "contacts": 3, "seed": 20},
    "k2 ellipsoid, profile": {"surface": ("ellipsoid", "profile"), "seed": 6},
    "k2 ball": {"surface": ("sphere", "cylinder"), "ball_radius": 3.0, "seed": 8},
    "k3 mixed": {"contacts": 3, "surface": "mixed", "seed": 16},
    "k4": {"contacts": 4, "seed": 18},
}  # fmt: skip


def model_of(raw: dict[str, Any]) -> Model:
    return Model(parse(toml_text(raw)), backend="numpy")


@cache
def found(name: str) -> tuple[Rubbing, Model, ModelResult]:
    case = drawn(**{"count": 3, **CASES[name]})
    model = Model(case.mechanism, backend="numpy")
    return case, model, model.inverse_dynamics(*case.arguments, outputs="all")


def ports(case: Rubbing) -> dict[str, np.ndarray]:
    q, q1, q2, load = case.packed
    names = ("q", "q1", "q2", "force", "moment", "point")
    return dict(zip(names, (q, q1, q2, *np.hsplit(load, 3)), strict=True))


def least(b: Balance) -> tuple[float, np.ndarray, np.ndarray] | None:
    """Of all patterns and active sets the least half sum of squares, with efforts and forces."""
    n, k, best = b.C.shape[1], b.N.shape[1], None
    for sigma in b.patterns():
        signs = np.array(sigma, float)
        low = np.r_[np.full(n, -np.inf), np.where(signs > 0, 0.0, -np.inf)]
        high = np.r_[np.full(n, np.inf), np.where(signs < 0, 0.0, np.inf)]
        cost = np.r_[np.ones(n), np.zeros(k)]
        answer = Program(np.hstack([b.C, b.along(sigma)]), b.b, low, high, cost, n).least()
        if answer and (best is None or answer[0] < best[0]):
            best = answer[0], answer[1][:n], answer[1][n:]
    return best


@pytest.mark.parametrize("name", first(CASES, 6))
def test_least_of_all_patterns_and_active_sets(name: str) -> None:
    """And friction takes work; shares add up, and what balances itself does nothing."""
    case, model, got = found(name)
    J = model.jacobians(case.arguments[0])
    share = dict(zip(model.parts, np.moveaxis(got.share, 1, 0), strict=True))
    assert model.parts[-4:] == ("actuators", "load", "friction", "internal")
    for i, b in enumerate(case.balances()):
        wanted = least(b)
        if wanted is None:
            assert got.status[i] == Status.jammed
            continue
        assert got.status[i] == Status.ok
        _, effort, force = wanted
        close(got.effort[i], effort, 1e-8)
        close(got.contact_force[i], force, 1e-8)
        np.testing.assert_allclose(got.slip[i], b.slip, atol=1e-12)
        close(got.friction_force[i], -np.abs(force)[:, None] * b.drag, 1e-8, np.abs(force).max())
        assert (got.friction_force[i] * got.slip[i]).sum(axis=1).max() <= 0
        np.testing.assert_allclose(got.share[i].sum(axis=0), got.effort[i], atol=1e-12)
        A = J.J_theta[i] @ J.M_J[i]
        close(A.T @ share["actuators"][i], A.T @ b.loss, 1e-10, np.abs(b.loss).max())
        scale = np.abs(A).max() * np.abs(effort).max()
        assert np.abs(A.T @ share["internal"][i]).max() < 1e-10 * scale
    assert (got.status == Status.ok).any()


@pytest.mark.parametrize("name", first([name for name in CASES if name != "much friction"], 5))
def test_free_bodies_balance_with_friction_as_a_load(name: str) -> None:
    """Efforts put on all bodies cut free: friction by a fixed point, and nothing is left over.

    All of a contact's friction is moved to the load's point, as a force and a moment.
    """
    case, _, got = found(name)
    s = case.states
    point = np.array(case.mechanism.platform.points[s["load_point"]])
    for i, b in enumerate(case.balances()):
        if got.status[i] != Status.ok:
            continue
        state = [s[x][i] for x in ("pose", "pose_rate", "pose_acceleration")]
        at, force = platform_motion(state[0]).R @ point, np.zeros(len(b.drag))
        for _ in range(60):
            rubbed = -np.abs(force)[:, None] * b.drag
            moment = np.cross(b.touch - at, rubbed).sum(axis=0)
            wrench = s["wrench"][i] + np.r_[rubbed.sum(axis=0), moment]
            cut = inverse_dynamics(
                case.raw, *state, wrench, s["load_point"], got.effort[i] - b.loss
            )
            change, force = np.abs(cut["contact"] - force).max(), cut["contact"]
            if change < 1e-13 * np.abs(force).max():
                break
        assert change < 1e-9 and cut["residual"] < 1e-9
        close(got.contact_force[i], force, 1e-8, np.abs(b.b).max())


@pytest.mark.parametrize("name", few(["PSS ball", "k2 ball", "k3 mixed"], "PSS ball"))
def test_sliding_velocity_by_differences_of_the_motion(name: str) -> None:
    """A point fixed to the platform where the ball touches moves at the velocity of sliding."""
    case, model, got = found(name)
    q, q1, q2, _ = case.packed
    h = 1e-4
    poses = [
        model.inverse_kinematics(q + t * q1 + t * t / 2 * q2).pose for t in (-2 * h, -h, h, 2 * h)
    ]
    for i, (pose, b) in enumerate(zip(got.pose, case.balances(), strict=True)):
        body = platform_motion(pose).R.T @ b.touch.T
        motions = [platform_motion(moved[i]) for moved in poses]
        at = [(m.origin[:, None] + m.R @ body).T for m in motions]
        close(got.slip[i], (8 * (at[2] - at[1]) - (at[3] - at[0])) / (12 * h), 1e-7)
        for k, contact in enumerate(case.mechanism.contacts):
            reach = b.touch[k] + got.pose[i, :3] - got.configuration.contact_point[i, k]
            assert np.linalg.norm(reach) == pytest.approx(contact.ball_radius or 0.0, abs=1e-12)
            # It slides and does not leave.
            assert abs(got.configuration.contact_normal[i, k] @ got.slip[i, k]) < 1e-10


HELD: dict[str, dict[str, Any]] = {
    "k1": {"contacts": 1, "mu": 0.7, "seed": 26},
    "two": {"mu": 0.9, "surface": "quadratic", "seed": 22, "count": 10},
    "one effort to spare": {"chains": 5, "seed": 23},
    "many": {"mu": 0.9, "seed": 3, "count": 100},
}


@pytest.mark.parametrize("name", few(HELD, "k1"))
def test_the_robust_path_agrees(name: str) -> None:
    """All candidates in one graph against Newton's method on the dual, pattern by pattern.

    A kernel is sure of forces that are held at zero. Among `many` samples are some whose least
    has a contact force of zero next to a worse pattern.
    """
    case = drawn(**{"count": 20, **HELD[name]})
    model = Model(case.mechanism, backend="numpy")
    answer = model.kernel("inverse", ("contact",)).run(ports(case))
    wanted, status = model.system.robust.evaluate(ports(case))
    got = model.inverse_dynamics(*case.arguments, outputs=("share",) if name == "k1" else ())
    assert (got.status == status).all() and not status.any()
    close(got.effort.T, wanted["effort"], 1e-9)
    if name == "k1":
        close(np.moveaxis(got.share, 0, -1), wanted["share"], 1e-9)
        assert wanted["gravity"].shape[0] == len(model.parts)
    if name != "many":
        assert not answer.status.any()
        for part in ("effort", "contact_force"):
            close(answer.values[part], wanted[part], 1e-9)
        held = (answer.values["contact_force"] == 0).sum(axis=0)
        assert (held == 1).any() and (held == 2).any() == (name == "two")


CHOICES = [(f, ("core", "direct")[i % 2]) for i, f in enumerate(FORMULATIONS)]


@pytest.mark.parametrize(("formulation", "route"), few(CHOICES, CHOICES[1]))
def test_every_formulation_and_route(formulation: str, route: str) -> None:
    case, _, wanted = found("k2 plane")
    model = Model(case.mechanism, formulation=formulation, route=route, backend="numpy")
    got = model.inverse_dynamics(*case.arguments, outputs="all")
    for name in ("effort", "contact_force", "friction_force", "slip"):
        close(getattr(got, name), getattr(wanted, name), 1e-10)


@pytest.mark.parametrize("backend", ["numpy", "compiled"])
def test_whatever_is_asked_on_threads_and_one_by_one(
    backend: str, compiler_command: object
) -> None:
    case, _, wanted = found("k1 n7")
    model = Model(case.mechanism, backend=backend)
    asked = ("share", "gravity_share", "pose", "joint_rate", "condition")
    for outputs in ((), ("gravity_share",), asked) if backend == "numpy" else ((),):
        got = model.inverse_dynamics(*case.arguments, outputs=outputs, threads=2)
        assert (got.status == wanted.status).all()
        close(got.effort, wanted.effort, 1e-11)
        for part in {"share", "gravity_share"} & set(outputs):
            assert getattr(got, part).shape == wanted.share.shape
    one = [model.unchecked().inverse_dynamics(*row) for row in zip(*case.arguments, strict=True)]
    close(one, wanted.effort, 1e-11)


def test_at_rest_friction_vanishes() -> None:
    case, model, _ = found("much friction")
    case = case.still()
    raw = case.raw | {"contact": [dict(c) for c in case.raw["contact"]]}
    raw["chain"] = [{k: v for k, v in c.items() if k != "actuator"} for c in raw["chain"]]
    for contact in raw["contact"]:
        del contact["friction"]
    got, bare = (m.inverse_dynamics(*case.arguments, outputs="all") for m in (model, model_of(raw)))
    assert np.abs(got.friction_force).max() == 0 == np.abs(got.slip).max()
    close(got.effort, bare.effort, 1e-12)
    close(got.contact_force, bare.contact_force, 1e-11)


def test_without_friction_and_losses_nothing_changes() -> None:
    bare = drawn(5, mu=0, lossy=False)
    raw = bare.raw | {
        "contact": [c | {"friction": {"coefficient": 0.0}} for c in bare.raw["contact"]],
        "chain": [c | {"actuator": {"coulomb": 0.0, "gear": 9.0}} for c in bare.raw["chain"]],
    }
    models = model_of(bare.raw), model_of(raw)
    a, b = (m.inverse_dynamics(*bare.arguments, outputs="all") for m in models)
    assert (a.effort == b.effort).all() and (a.contact_force == b.contact_force).all()
    assert a.share.shape == b.share.shape and not b.slip.any()


def test_the_order_of_chains_and_contacts_does_not_matter() -> None:
    case, _, wanted = found("much friction")
    rng, contacts = np.random.default_rng(1), [1, 0]
    chains, rows = rng.permutation(len(case.raw["chain"])), rng.permutation(len(wanted.effort))
    raw = case.raw | {
        "chain": [case.raw["chain"][i] for i in chains],
        "contact": [case.raw["contact"][i] for i in contacts],
    }
    got = model_of(raw).inverse_dynamics(*(a[rows] for a in case.arguments))
    close(got.effort, wanted.effort[rows][:, chains], 1e-10)
    close(got.contact_force, wanted.contact_force[rows][:, contacts], 1e-10)


@pytest.mark.parametrize("name", first(["PSS ball", "k3 mixed", "k1 n7", "SPS"]))
def test_power_balance_along_a_trajectory(name: str) -> None:
    """Efforts and load, less friction and losses, change the energy; rotors have theirs."""
    case, model, _ = found(name)
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
    slope = slope / (12 * h) + (q(t, 1) * model.gravity(q(t, 0))).sum(axis=1)
    power = (got.effort * got.joint_rate).sum(axis=1)
    for i, (pose, rate) in enumerate(zip(got.pose, got.pose_rate, strict=True)):
        motion = platform_motion(pose, rate)
        power[i] += load[i, :3] @ motion.point(load[i, 6:])[1] + load[i, 3:6] @ motion.omega
    rubbed, lost = (got.friction_force * got.slip).sum(axis=(1, 2)), np.zeros(len(t))
    for j, chain in enumerate(case.raw["chain"]):
        a, x = chain["actuator"], got.joint_rate[:, j]
        lost += a["viscous"] * x**2 + a["coulomb"] * x**2 / np.hypot(x, a["smoothing_speed"])
    size = np.abs(got.effort * got.joint_rate).sum(axis=1).max()
    assert np.abs(power + rubbed - lost - slope).max() < 1e-7 * size
    assert min(np.abs(rubbed).max(), lost.max(), np.abs(slope).max()) > 1e-3 * size


@pytest.mark.ci
def test_efforts_are_continuous_but_where_the_least_pattern_changes() -> None:
    """Along the reference motion; every change of a pattern is closed in on by bisection.

    Either a force passes through 0 there, and efforts do not leap, or two patterns are of one norm.
    """
    robot, friction = (
        condyle.load_mechanism("masticatory"),
        Friction(coefficient=0.9, smoothing_speed=2e-3),
    )
    contacts = [c.model_copy(update={"friction": friction}) for c in robot.contacts]
    model = Model(robot.replace(contacts=tuple(contacts)), backend="numpy")
    times = np.linspace(0, 5, 1251)
    motion = condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], times=times)
    states, _ = model.poses.of_motion(motion)
    point = np.tile(load_point_of(model, "right_molar"), (len(times), 1))
    path = np.hstack([*states, condyle.reference_load().at(times), point])

    def at(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        got = model.inverse_dynamics(*np.split(rows, [4, 8, 12, 18], axis=1))
        assert (got.status == Status.ok).all()
        force = got.contact_force
        return got.effort, np.where(np.abs(force) < 1e-10, 0, np.sign(force))

    effort, sigma = at(path)
    size = np.abs(effort).max()
    step = np.abs(np.diff(effort, axis=0)).max(axis=1)
    changes = (sigma[1:] != sigma[:-1]).any(axis=1)
    half = np.abs(effort[2:] - effort[:-2]).max(axis=1)[::2]
    assert step[~changes].max() < 0.6 * half.max()  # half the step, half the change
    assert changes.sum() > 5
    low, high, start = path[:-1][changes], path[1:][changes], sigma[:-1][changes]
    for _ in range(36):
        middle = (low + high) / 2
        same = (at(middle)[1] == start).all(axis=1)[:, None]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    (before, _), (after, _) = at(low), at(high)
    leap = np.abs(after - before).max(axis=1) > 1e-6 * size
    norms = [np.linalg.norm(x[leap], axis=1) for x in (before, after)]
    np.testing.assert_allclose(*norms, rtol=1e-6)


def test_jammed() -> None:
    """Strong friction under which, at some samples, no pattern of signs is consistent.

    They disturb no others, and neither do samples that are out of reach.
    """
    case = drawn(4, count=40, mu=3.0, contacts=2, chains=4, lossy=False)
    model = Model(case.mechanism, backend="numpy")
    got = model.inverse_dynamics(*case.arguments, outputs="all")
    jams = np.array([least(b) is None for b in case.balances()])
    assert 0 < jams.sum() < len(jams)
    assert (got.status == np.where(jams, Status.jammed, Status.ok)).all()
    assert np.isnan(got.effort[jams]).all() and np.isnan(got.shortfall[jams]).all()
    assert (got.shortfall[~jams] == 1).all()
    alone = model.inverse_dynamics(*(a[~jams] for a in case.arguments), outputs="all")
    np.testing.assert_allclose(alone.effort, got.effort[~jams], rtol=1e-9)
    q, *rest = case.arguments
    lost = model.inverse_dynamics(q + 10.0, *rest, outputs="all")
    assert (lost.status == Status.unreachable).all()
    assert np.isnan(lost.shortfall).all() and lost.share.shape == got.share.shape
