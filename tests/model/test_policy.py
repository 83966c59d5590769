"""What a policy asks for on whole mechanisms: limits, push, preload, objectives, mixed families."""

from __future__ import annotations

import pickle
from functools import cache
from typing import Any

import numpy as np
import pytest
from distribution.oracle import Program
from oracles.rubbing import Balance
from support.families import close
from support.loads import parts
from support.rubbing import Rubbing, balanced, drawn
from support.speeds import few

import condyle
from condyle.mechanism.chain import limits
from condyle.model.distributing import Distribution
from condyle.model.model import Model
from condyle.status import Status

pytestmark = pytest.mark.slow

MIXED = ("RSS", "PSS", "SPS", "cable")
CASES: dict[str, dict[str, Any]] = {
    "bounded k0": {"contacts": 0, "chains": 7, "limit": 3.0, "seed": 1},
    "bounded k2 one-sided": {"limit": 4.0, "one_sided": True, "preload": 0.5, "seed": 3},
    "bounded k2 ball": {"limit": 3.0, "ball_radius": 3.0, "surface": "sphere", "seed": 4},
    "bounded k3 one-sided": {"contacts": 3, "limit": 5.0, "one_sided": True, "seed": 5},
    "bounded cables": {"families": ("cable",), "chains": 7, "limit": 5.0, "seed": 6},
    "bounded cables and legs": {"families": ("SPS", "cable"), "limit": 8.0, "seed": 13},
    "bounded without friction": {"mu": 0, "limit": 2.0, "one_sided": True, "seed": 7},
    "weighted mixed k2": {"families": MIXED, "chains": 7, "limit": 8.0, "seed": 8},
    "weighted load": {"limit": 4.0, "contact_weight": 30.0, "seed": 10},
    "minimax k2": {"limit": 4.0, "seed": 11},
    "minimax cables and motors": {
        "families": ("RSS", "cable"), "chains": 8, "limit": 8.0, "seed": 21
    },
    "cubic cables": {
        "families": ("cable",), "contacts": 1, "chains": 8, "limit": 5.0, "seed": 6, "count": 2
    },
}  # fmt: skip


@cache
def found(name: str) -> tuple[Rubbing, Model, Any]:
    options = dict(CASES[name])
    numbers = {key: options.pop(key) for key in ("preload", "contact_weight") if key in options}
    case = drawn(**{"count": 3, **options})
    if options.get("families") == ("cable",):
        case = balanced(case, 1, 20.0)
    distribution = Distribution(name.split()[0], **numbers)
    model = Model(case.mechanism, backend="numpy", distribution=distribution)
    return case, model, model.inverse_dynamics(*case.arguments, outputs="all")


def programs(model: Model, b: Balance, mixes: bool) -> list[Program]:
    """The program of every pattern, with bounds of efforts, of signs, and of one-sided contacts."""
    robot, chosen = model.mechanism, model.distribution
    low, high = (np.array([getattr(limits(c), x) for c in robot.chains]) for x in ("low", "high"))
    scale = np.maximum(np.abs(low), np.abs(high)) if mixes else np.ones(len(low))
    push = np.array([c.push if c.one_sided else 0 for c in robot.contacts])
    weight = np.full(len(push), chosen.contact_weight / model.reference_force**2)
    made = []
    for sigma in b.patterns():
        signs = np.array(sigma, float)
        least, most = np.where(signs > 0, 0.0, -np.inf), np.where(signs < 0, 0.0, np.inf)
        least = np.where(push > 0, np.maximum(least, chosen.preload), least)
        most = np.where(push < 0, np.minimum(most, -chosen.preload), most)
        bounds = np.r_[low, least], np.r_[high, most]
        cost = np.r_[1 / scale**2, weight]
        made.append(Program(np.hstack([b.C, b.along(sigma)]), b.b, *bounds, cost, len(low)))
    return made


def least_cubes(tried: list[Program], greatest: np.ndarray) -> float:
    """The least sum of cubes that SLSQP finds under a pattern, from the least squares."""
    sums = []
    for program in tried:
        z = (start := program.least()) and program.by_slsqp(
            lambda x: float(((x / greatest) ** 3).sum()),
            lambda x: 3 * x**2 / greatest**3,
            start[1],
        )
        if z is not None:
            sums.append(((z[: program.n] / greatest) ** 3).sum())
    return min(sums)


LEFT_TO_CI = (
    "bounded k2 ball",
    "bounded cables and legs",
    "bounded k3 one-sided",
    "minimax cables and motors",
)


@pytest.mark.parametrize("name", few(CASES, *(n for n in CASES if n not in LEFT_TO_CI)))
def test_equations_limits_and_optimum(name: str) -> None:
    """Least squares by trying active sets, minimax by linear programs, cubes by SLSQP."""
    case, model, got = found(name)
    objective, chains = model.distribution.name, model.mechanism.chains
    low, high = (np.array([getattr(limits(c), x) for c in chains]) for x in ("low", "high"))
    greatest = np.array([limits(c).greatest for c in chains])
    for i, b in enumerate(case.balances()):
        tried = programs(model, b, objective != "bounded")
        if got.status[i] == Status.infeasible:
            if objective == "minimax":
                assert not np.isfinite(min(p.least_maximum(greatest) for p in tried))
                continue
            # Limits on both sides stretch alike; nothing serves a contact that would be pulled.
            needed = min(p.least_stretch() for p in tried)
            assert needed > 1 and got.shortfall[i] == pytest.approx(needed, rel=1e-6)
            continue
        assert got.status[i] == Status.ok and got.shortfall[i] == 1
        effort, force = got.effort[i], got.contact_force[i]
        left = b.C @ effort + b.along(np.where(force >= 0, 1, -1)) @ force - b.b
        size = np.abs(effort).max()
        assert np.abs(left).max() < 1e-8 * max(np.abs(b.b).max(), size)
        assert (effort > low - 1e-9 * size).all() and (effort < high + 1e-9 * size).all()
        for pushed, contact in zip(force, model.mechanism.contacts, strict=True):
            slack = 1e-9 * np.abs(force).max()
            if contact.one_sided:
                assert contact.push * pushed >= model.distribution.preload - slack
        if objective == "minimax":
            wanted = min(p.least_maximum(greatest) for p in tried)
            assert np.abs(effort / greatest).max() == pytest.approx(wanted, rel=1e-7)
        elif objective == "cubic":
            assert ((effort / greatest) ** 3).sum() < least_cubes(tried, greatest) * (1 + 1e-6)
        else:
            best = min(filter(None, (p.least() for p in tried)), key=lambda found: found[0])[1]
            close(effort, best[: len(chains)], 1e-8)
            close(force, best[len(chains) :], 1e-6, size)
    assert (got.status == Status.ok).any()
    np.testing.assert_allclose(got.share.sum(axis=1), got.effort, atol=1e-9)
    assert model.parts[-1] == "internal" and len(model.parts) == got.share.shape[1]


def test_limits_that_no_effort_meets() -> None:
    """Shortfall: with limits so many times as wide it is just feasible, with less it is not."""
    case = drawn(3, limit=0.2, contacts=1)
    model = Model(case.mechanism, backend="numpy", distribution="bounded")
    got = model.inverse_dynamics(*case.arguments, outputs="all")
    worst = np.where(np.isfinite(got.shortfall), got.shortfall, -1)
    at = int(worst.argmax())
    assert got.status[at] == Status.infeasible
    for factor, status in ((1.001, Status.ok), (0.999, Status.infeasible)):
        wide = {
            f"chain.{c.name}.actuator.torque_limit": tuple(
                worst[at] * factor * x for x in (limits(c).low, limits(c).high)
            )
            for c in case.mechanism.chains
        }
        model = Model(case.mechanism.set(wide), backend="numpy", distribution="bounded")
        assert model.inverse_dynamics(*case.arguments).status[at] == status


def test_wide_limits_leave_the_least_norm() -> None:
    case = drawn(8, count=3, limit=1e6, contacts=1)
    bounded, least = (
        Model(case.mechanism, backend="numpy", distribution=name).inverse_dynamics(
            *case.arguments, outputs="all"
        )
        for name in ("bounded", "minimum_norm")
    )
    for name in ("effort", "slip", "friction_force"):
        close(getattr(bounded, name), getattr(least, name), 1e-9)


def test_torques_one_by_one_pickled_and_on_threads() -> None:
    case, model, wanted = found("bounded k2 one-sided")
    back = pickle.loads(pickle.dumps(model))
    assert back.distribution == model.distribution
    for own, threads in ((model, 1), (back, 2)):
        got = own.inverse_dynamics(*case.arguments, outputs="all", threads=threads)
        assert (got.status == wanted.status).all()
        np.testing.assert_allclose(got.effort, wanted.effort, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(got.share, wanted.share, rtol=1e-9, atol=1e-9)
    rows = [model.unchecked().inverse_dynamics(*row) for row in zip(*case.arguments, strict=True)]
    np.testing.assert_allclose(rows, wanted.effort, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("objective", ["bounded", pytest.param("weighted", marks=pytest.mark.ci)])
@pytest.mark.parametrize("one_sided", [True, False])
def test_compiled_limits_and_shortfalls(
    objective: str, one_sided: bool, compiler_command: object
) -> None:
    """With and without shares, which take other equations; where limits are met and where not."""
    case = drawn(5, count=3, mu=1.5, contacts=1, limit=8.0, one_sided=one_sided)
    q, q1, q2, load = (np.repeat(a, 4, axis=0) for a in case.packed)
    load[:, :6] *= np.tile([0.5, 1, 4, 16], len(load) // 4)[:, None]
    given, chosen = (q, q1, q2, *parts(load)), Distribution(objective, preload=2.0)
    numpy, compiled = (
        Model(case.mechanism, backend=backend, distribution=chosen)
        for backend in ("numpy", "compiled")
    )
    outputs = ("share", "shortfall") if one_sided else ("shortfall",)
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
    free, held = (
        Model(case.mechanism, backend="numpy", distribution=Distribution("bounded", preload=p))
        for p in (0.0, 2.0)
    )
    found, kept = (m.inverse_dynamics(*case.arguments) for m in (free, held))
    assert not found.status.any() and not kept.status.any()
    least = np.abs(found.contact_force).min(axis=1)
    assert (least < 1e-9).any() and (least > 2).any()
    assert np.abs(kept.contact_force).min() > 2 - 1e-9
    bound = least < 2
    np.testing.assert_allclose(kept.effort[~bound], found.effort[~bound], atol=1e-9)
    squares = [(m.effort**2).sum(axis=1)[bound] for m in (found, kept)]
    assert (squares[1] > squares[0]).all()
    # Efforts still give the motion, or are known not to.
    q, v, a, *load = case.arguments
    back = held.forward_dynamics(q, v, kept.effort, *load)
    same = back.status == Status.ok
    assert same.any() and set(back.status) <= {Status.ok, Status.ambiguous}
    np.testing.assert_allclose(back.acceleration[same], a[same], rtol=1e-7, atol=1e-7)


def test_a_preload_without_one_sided_contacts_is_told(capsys: pytest.CaptureFixture[str]) -> None:
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


def test_what_is_refused() -> None:
    case = drawn(9, families=MIXED, contacts=3, limit=8.0)
    for name, said in (("minimum_norm", "N m"), ("bounded", "N m"), ("bound", "bounded")):
        with pytest.raises(condyle.InputError, match=said):
            condyle.derive(case.mechanism, backend="numpy", distribution=name)


def test_one_sample_within_limits_is_one_evaluation_of_a_kernel() -> None:
    base = condyle.load_mechanism("masticatory")
    base = base.set({f"chain.{name}.actuator.torque_limit": 0.35 for name in base.chain_names})
    model, rng = Model(base, backend="numpy", distribution="bounded"), np.random.default_rng(2)
    q, q1, q2 = 0.004 * rng.normal(size=(3, 40, 4)) * np.array([1, 10, 100])[:, None, None]
    wrench, at = np.zeros((40, 6)), np.tile([0.03, 0, 0], (40, 1))
    wrench[:, 2] = rng.uniform(-80, 0, 40)
    many = model.inverse_dynamics(q, q1, q2, wrench, at)
    one = model.unchecked().inverse_dynamics
    found = [one(*row) for row in zip(q, q1, q2, wrench, at, strict=True)]
    assert {Status.ok, Status.infeasible} <= set(many.status.tolist())
    assert (np.abs(many.effort) == 0.35).any()
    np.testing.assert_allclose(found, many.effort, rtol=0, atol=1e-12)
