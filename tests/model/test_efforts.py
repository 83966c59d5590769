"""Efforts and contact forces of whole mechanisms, with friction, losses, limits and policies: the
least of all patterns of signs and active sets, on the equations of free bodies."""

from __future__ import annotations

import pickle
from functools import cache
from typing import Any

import numpy as np
import pytest
from distribution.oracle import Program, unexplained
from oracles.random_mechanism import toml_text
from oracles.rotations import platform_motion
from oracles.rubbing import Balance
from support.families import close
from support.loads import parts
from support.rubbing import Rubbing, balanced, drawn
from support.speeds import few, first

import condyle
from condyle.dynamics import FORMULATIONS
from condyle.mechanism import parse
from condyle.mechanism.chain import limits
from condyle.model.distributing import Distribution
from condyle.model.model import Model
from condyle.status import Status

pytestmark = pytest.mark.slow

Array = np.ndarray
MIXED = ("RSS", "PSS", "SPS", "cable")
CUBIC = {"families": ("cable",), "contacts": 1, "chains": 8, "limit": 5.0, "seed": 6, "count": 2}
# The objective, and options of `drawn`.
CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "k1 n7": ("minimum_norm", {"contacts": 1, "chains": 7, "seed": 2}),
    "k2 plane": ("minimum_norm", {"seed": 3}),
    "much friction": ("minimum_norm", {"mu": 0.9, "surface": "quadratic", "seed": 22}),
    "determined": ("minimum_norm", {"contacts": 2, "chains": 4, "seed": 21}),
    "SPS k3": ("minimum_norm", {"families": ("SPS",), "contacts": 3, "seed": 20, "count": 2}),
    "PSS ball": (
        "minimum_norm",
        {"families": ("PSS",), "contacts": 1, "surface": "sphere", "ball_radius": 3.0, "seed": 9},
    ),
    "k0": ("bounded", {"contacts": 0, "chains": 7, "limit": 3.0, "seed": 1}),
    "one-sided": ("bounded", {"limit": 4.0, "one_sided": True, "preload": 0.5, "seed": 3}),
    "cables": ("bounded", {"families": ("cable",), "chains": 7, "limit": 5.0, "seed": 6}),
    "smooth": ("bounded", {"mu": 0, "limit": 2.0, "one_sided": True, "seed": 7}),
    "mixed": ("weighted", {"families": MIXED, "chains": 7, "limit": 8.0, "seed": 8}),
    "contact weight": ("weighted", {"limit": 4.0, "contact_weight": 30.0, "seed": 10}),
    "minimax": ("minimax", {"limit": 4.0, "seed": 11}),
    "cubic": ("cubic", CUBIC),
    "ellipsoid, profile": ("minimum_norm", {"surface": ("ellipsoid", "profile"), "seed": 6}),
    "k3 mixed": ("minimum_norm", {"contacts": 3, "surface": "mixed", "seed": 16}),
}


def of(mechanism: Any, backend: str = "numpy", **options: Any) -> Model:
    return Model(mechanism, backend=backend, **options)


@cache
def found(name: str) -> tuple[Rubbing, Model, Any]:
    objective, options = CASES[name]
    numbers = {key: options[key] for key in ("preload", "contact_weight") if key in options}
    case = drawn(**{"count": 3, **{k: v for k, v in options.items() if k not in numbers}})
    if options.get("families") == ("cable",):
        case = balanced(case, 1, 20.0)
    model = of(case.mechanism, distribution=Distribution(objective, **numbers))
    return case, model, model.inverse_dynamics(*case.arguments, outputs="all")


def bounds(model: Model) -> tuple[Array, Array]:
    """Of efforts; there are none for the least norm."""
    chains = model.mechanism.chains
    if model.distribution.name == "minimum_norm":
        return np.full(len(chains), -np.inf), np.full(len(chains), np.inf)
    low, high = (np.array([getattr(limits(c), x) for c in chains]) for x in ("low", "high"))
    return low, high


def programs(model: Model, b: Balance) -> list[Program]:
    """The program of every pattern, with bounds of efforts, of signs, and of one-sided contacts."""
    robot, chosen = model.mechanism, model.distribution
    low, high = bounds(model)
    scale = np.ones(len(low))
    if chosen.name not in ("minimum_norm", "bounded"):
        scale = np.maximum(np.abs(low), np.abs(high))
    push = np.array([c.push if c.one_sided else 0 for c in robot.contacts])
    weight = np.zeros(len(push))
    if chosen.contact_weight:
        weight += chosen.contact_weight / model.reference_force**2
    made = []
    for sigma in b.patterns():
        signs = np.array(sigma, float)
        least, most = np.where(signs > 0, 0.0, -np.inf), np.where(signs < 0, 0.0, np.inf)
        least = np.where(push > 0, np.maximum(least, chosen.preload), least)
        most = np.where(push < 0, np.minimum(most, -chosen.preload), most)
        ends, cost = (np.r_[low, least], np.r_[high, most]), np.r_[1 / scale**2, weight]
        made.append(Program(np.hstack([b.C, b.along(sigma)]), b.b, *ends, cost, len(low)))
    return made


def least(tried: list[Program]) -> Array | None:
    """Of all patterns and active sets; efforts and contact forces."""
    answers = [a for p in tried if (a := p.least()) is not None]
    return min(answers, key=lambda answer: answer[0])[1] if answers else None


@pytest.mark.parametrize("name", first(CASES, 14))
def test_equations_limits_and_optimum(name: str) -> None:
    """Least squares by trying active sets, minimax by linear programs, cubes by what
    is left of their slope.

    And friction takes work, shares add up, and what balances itself does nothing.
    """
    case, model, got = found(name)
    objective, n = model.distribution.name, len(model.mechanism.chains)
    low, high = bounds(model)
    J = model.jacobians(case.arguments[0])
    share = dict(zip(model.parts, np.moveaxis(got.share, 1, 0), strict=True))
    assert model.parts[-1] == "internal" and len(model.parts) == got.share.shape[1]
    for i, b in enumerate(case.balances()):
        tried, status = programs(model, b), got.status[i]
        if status == Status.infeasible:
            # Limits on both sides stretch alike; nothing serves a contact that would be pulled.
            needed = min(p.least_stretch() for p in tried)
            assert needed > 1 and got.shortfall[i] == pytest.approx(needed, rel=1e-6)
            continue
        if status == Status.jammed:
            assert least(tried) is None
            continue
        assert status == Status.ok and got.shortfall[i] == 1
        effort, force = got.effort[i], got.contact_force[i]
        left = b.C @ effort + b.along(np.where(force >= 0, 1, -1)) @ force - b.b
        size, load = np.abs(effort).max(), np.abs(b.b).max()
        assert np.abs(left).max() < 1e-8 * max(load, size)
        assert (effort > low - 1e-9 * size).all() and (effort < high + 1e-9 * size).all()
        slack = 1e-9 * np.abs(force).max(initial=0)
        for pushed, contact in zip(force, model.mechanism.contacts, strict=True):
            if contact.one_sided:
                assert contact.push * pushed >= model.distribution.preload - slack
        if objective == "minimax":
            wanted = min(p.least_maximum(np.maximum(-low, high)) for p in tried)
            assert np.abs(effort / np.maximum(-low, high)).max() == pytest.approx(wanted, rel=1e-7)
        elif objective == "cubic":
            own = next(
                p for p in tried if (force >= p.low[n:]).all() and (force <= p.high[n:]).all()
            )
            gradient, x = np.r_[effort**2 / high**3, 0 * force], np.r_[effort, force]
            assert unexplained(own.C, x, gradient, own.low, own.high) < 1e-7
        else:
            best = least(tried)
            assert best is not None
            close(effort, best[:n], 1e-8)
            close(force, best[n:], 1e-6, size)
        np.testing.assert_allclose(got.share[i].sum(axis=0), effort, atol=1e-9)
        A = J.J_theta[i] @ J.M_J[i]
        close(A.T @ share["actuators"][i], A.T @ b.loss, 1e-10, np.abs(b.loss).max())
        assert np.abs(A.T @ share["internal"][i]).max() < 1e-10 * np.abs(A).max() * max(size, load)
        if "friction" in model.parts:
            np.testing.assert_allclose(got.slip[i], b.slip, atol=1e-12)
            close(got.friction_force[i], -np.abs(force)[:, None] * b.drag, 1e-8, load)
            assert (got.friction_force[i] * got.slip[i]).sum(axis=1).max() <= 0
            arms = got.configuration.contact_point[i] - got.pose[i, :3]
            radius = [c.ball_radius or 0.0 for c in model.mechanism.contacts]
            np.testing.assert_allclose(np.linalg.norm(b.touch - arms, axis=1), radius, atol=1e-12)
    assert (got.status == Status.ok).any()


def test_power_balance_along_a_trajectory() -> None:
    """Efforts and load, less friction and losses, change the energy; rotors have theirs."""
    case, model, _ = found("k2 plane")
    unit = np.array([3e-4 if x in "XYZ" else 0.01 for x in model.independent])
    phase = np.random.default_rng(2).uniform(0, 6, 4)
    t, h = np.linspace(0, 0.1, 5)[:, None], 2e-4

    def q(t: Array, order: int) -> Array:
        return unit * 60.0**order * np.sin(60 * t + phase + order * np.pi / 2)

    def kinetic(t: Array) -> Array:
        M = model.mass_matrix(q(t, 0))  # with the rotors
        return np.einsum("ri,rij,rj->r", q(t, 1), M, q(t, 1)) / 2

    load = case.packed[3][:1] + 0 * t
    states = q(t, 0), q(t, 1), q(t, 2)
    got = model.inverse_dynamics(*states, *parts(load), outputs="all")
    assert not got.status.any()
    slope = 8 * (kinetic(t + h) - kinetic(t - h)) - (kinetic(t + 2 * h) - kinetic(t - 2 * h))
    slope = slope / (12 * h) + (q(t, 1) * model.gravity(q(t, 0))).sum(axis=1)
    power = (got.effort * got.joint_rate).sum(axis=1)
    for i, (pose, rate) in enumerate(zip(got.pose, got.pose_rate, strict=True)):
        motion = platform_motion(pose, rate)
        power[i] += load[i, :3] @ motion.point(load[i, 6:])[1] + load[i, 3:6] @ motion.omega
    rubbed = (got.friction_force * got.slip).sum(axis=(1, 2))
    lost = np.zeros(len(t))
    for x, chain in zip(got.joint_rate.T, case.raw["chain"], strict=True):
        a = chain["actuator"]
        lost += a["viscous"] * x**2 + a["coulomb"] * x**2 / np.hypot(x, a["smoothing_speed"])
    size = np.abs(got.effort * got.joint_rate).sum(axis=1).max()
    # Differences of fourth order over h = 0.2 ms at 60 rad/s are off by (60 h)^4 / 30.
    assert np.abs(power + rubbed - lost - slope).max() < 1e-7 * size
    assert min(np.abs(rubbed).max(), lost.max(), np.abs(slope).max()) > 1e-3 * size


HELD: dict[str, dict[str, Any]] = {
    "k1": {"contacts": 1, "mu": 0.7, "seed": 26},
    "two": {"mu": 0.9, "surface": "quadratic", "seed": 22, "count": 10},
    "many": {"mu": 0.9, "seed": 3, "count": 100},
}


@pytest.mark.parametrize("name", few(HELD, "k1"))
def test_the_robust_path_agrees(name: str) -> None:
    """All candidates in one graph against Newton's method on the dual, pattern by pattern.

    A kernel is sure of forces that are held at zero. Among `many` samples are some whose least
    has a contact force of zero next to a worse pattern.
    """
    case = drawn(**{"count": 20, **HELD[name]})
    model = of(case.mechanism)
    q, q1, q2, load = case.packed
    ports = {"q": q, "q1": q1, "q2": q2}
    ports |= dict(zip(("force", "moment", "point"), np.hsplit(load, 3), strict=True))
    answer = model.kernel("inverse", ("contact",)).run(ports)
    wanted, status = model.system.robust.evaluate(ports)
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
    model = of(case.mechanism, formulation=formulation, route=route)
    got = model.inverse_dynamics(*case.arguments, outputs="all")
    for name in ("effort", "contact_force", "friction_force", "slip"):
        close(getattr(got, name), getattr(wanted, name), 1e-10)


def test_one_by_one_pickled_on_threads_and_compiled(compiler_command: object) -> None:
    case, model, wanted = found("one-sided")
    back = pickle.loads(pickle.dumps(model))
    assert back.distribution == model.distribution
    for name, own in (("one-sided", model), ("one-sided", back), ("k1 n7", None)):
        case, _, wanted = found(name)
        own = own or of(case.mechanism, "compiled")
        for outputs in ((), ("gravity_share",))[: 2 - (name == "k1 n7")]:
            got = own.inverse_dynamics(*case.arguments, outputs=outputs, threads=2)
            assert (got.status == wanted.status).all()
            np.testing.assert_allclose(got.effort, wanted.effort, rtol=1e-8, atol=1e-9)
            for part in outputs:
                assert getattr(got, part).shape == wanted.share.shape
        rows = zip(*case.arguments, strict=True)
        one = [own.unchecked().inverse_dynamics(*row) for row in rows]
        np.testing.assert_allclose(one, wanted.effort, rtol=1e-8, atol=1e-9)


COMPILED = [("bounded", 0.0, False), ("bounded", 1.5, True), ("weighted", 1.5, True)]


@pytest.mark.parametrize(("objective", "mu", "shares"), first(COMPILED))
def test_compiled_limits_and_shortfalls(
    objective: str, mu: float, shares: bool, compiler_command: object
) -> None:
    """Where limits are met and where not; in `ci` with friction and with shares, which take
    other equations."""
    case = drawn(5, count=3, mu=mu, contacts=1, limit=8.0, one_sided=shares)
    q, q1, q2, load = (np.repeat(a, 4, axis=0) for a in case.packed)
    load[:, :6] *= np.tile([0.5, 1, 4, 16], 3)[:, None]
    given, chosen = (q, q1, q2, *parts(load)), Distribution(objective, preload=2.0)
    numpy, compiled = (of(case.mechanism, x, distribution=chosen) for x in ("numpy", "compiled"))
    outputs = ("share", "shortfall") if shares else ("shortfall",)
    wanted, got = (m.inverse_dynamics(*given, outputs=outputs) for m in (numpy, compiled))
    assert set(wanted.status) == {Status.ok, Status.infeasible}
    assert (got.status == wanted.status).all()
    good = wanted.status == Status.ok
    for name in {"effort", "contact_force", *outputs} - {"shortfall"}:
        close(getattr(got, name)[good], getattr(wanted, name)[good], 1e-9)
    np.testing.assert_allclose(got.shortfall, wanted.shortfall, rtol=1e-9)
    quick = compiled.inverse_dynamics(*given).effort
    close(quick[good], got.effort[good], 1e-9)
    assert np.isnan(quick[~good]).all()
    one = [compiled.unchecked().inverse_dynamics(*row) for row in zip(*given, strict=True)]
    close(np.array(one)[good], wanted.effort[good], 1e-8)


def test_a_preload_holds_rubbing_contacts_off_zero() -> None:
    """Either sign, and no less; where it does not bind, the answer of none."""
    case = drawn(5, count=12, mu=1.5, contacts=2, limit=50.0)
    chosen = [Distribution("bounded", preload=p) for p in (0.0, 2.0)]
    models = [of(case.mechanism, distribution=d) for d in chosen]
    free, kept = (model.inverse_dynamics(*case.arguments) for model in models)
    assert not free.status.any() and not kept.status.any()
    least = np.abs(free.contact_force).min(axis=1)
    assert (least < 1e-9).any() and (least > 2).any()
    assert np.abs(kept.contact_force).min() > 2 - 1e-9
    bound = least < 2
    np.testing.assert_allclose(kept.effort[~bound], free.effort[~bound], atol=1e-9)
    squares = [(m.effort**2).sum(axis=1)[bound] for m in (free, kept)]
    assert (squares[1] > squares[0]).all()


def test_at_rest_and_without_coefficients_there_is_no_friction() -> None:
    """And the order of chains and contacts does not matter."""
    case, model, moving = found("much friction")
    other = case.raw | {name: case.raw[name][::-1] for name in ("contact", "chain")}
    got = of(parse(toml_text(other))).inverse_dynamics(*case.arguments)
    close(got.effort, moving.effort[:, ::-1], 1e-10)
    close(got.contact_force, moving.contact_force[:, ::-1], 1e-10)
    case, raw = case.still(), dict(case.raw)
    for table, key in (("contact", "friction"), ("chain", "actuator")):
        raw[table] = [{k: v for k, v in one.items() if k != key} for one in raw[table]]
    zero = raw | {
        "contact": [c | {"friction": {"coefficient": 0.0}} for c in raw["contact"]],
        "chain": [c | {"actuator": {"coulomb": 0.0, "gear": 9.0}} for c in raw["chain"]],
    }
    models = of(parse(toml_text(raw))), model, of(parse(toml_text(zero)))
    bare, got, none = (m.inverse_dynamics(*case.arguments, outputs="all") for m in models)
    assert np.abs(got.friction_force).max() == 0 == np.abs(got.slip).max()
    close(got.effort, bare.effort, 1e-12)
    close(got.contact_force, bare.contact_force, 1e-11)
    assert (none.effort == bare.effort).all() and (none.contact_force == bare.contact_force).all()
    assert none.share.shape == bare.share.shape and not none.slip.any()


def test_jammed() -> None:
    """Strong friction under which, at some samples, no pattern of signs is consistent.

    They disturb no others, and neither do samples that are out of reach.
    """
    case = drawn(4, count=24, mu=3.0, contacts=2, chains=4, lossy=False)
    model = of(case.mechanism)
    got = model.inverse_dynamics(*case.arguments, outputs="all")
    jams = np.array([least(programs(model, b)) is None for b in case.balances()])
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


def test_what_is_told_and_refused(capsys: pytest.CaptureFixture[str]) -> None:
    chosen = {"backend": "numpy", "distribution": Distribution("bounded", preload=3.0)}
    machine = condyle.load_mechanism("masticatory").replace(name="two-sided")
    for _ in range(2):
        condyle.derive(machine, **chosen)
    said = capsys.readouterr().err
    assert said.count("condyle: preload 3 N presses on nothing") == 1
    assert '"two-sided"' in said and "one_sided = true" in said
    first, *others = machine.contacts
    one = first.model_copy(update={"one_sided": True, "side": "below"})
    condyle.derive(machine.replace(contacts=(one, *others)), **chosen)
    assert capsys.readouterr().err == ""
    mixed = drawn(9, families=MIXED, contacts=3, limit=8.0).mechanism
    for name, said in (("minimum_norm", "N m"), ("bounded", "N m"), ("bound", "bounded")):
        with pytest.raises(condyle.InputError, match=said):
            condyle.derive(mixed, backend="numpy", distribution=name)
