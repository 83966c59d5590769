"""What a policy asks for on whole mechanisms: limits, push, preload, objectives, mixed families."""

from __future__ import annotations

import pickle
from functools import cache
from typing import Any

import numpy as np
import pytest
from distribution.oracle import Full, best_active_set, by_slsqp, least_maximum, least_stretch
from oracles.rubbing import Balance
from support.loads import parts
from support.rubbing import Rubbing, balanced, drawn
from support.speeds import first

import condyle
from condyle.mechanism.chain import limits
from condyle.model.distributing import Distribution
from condyle.model.model import Model
from condyle.status import Status

pytestmark = pytest.mark.slow

MIXED = ("RSS", "PSS", "SPS", "cable")
CASES: dict[str, dict[str, Any]] = {
    "bounded k0": {"contacts": 0, "chains": 7, "limit": 3.0, "seed": 1},
    "bounded k1": {"contacts": 1, "chains": 7, "limit": 3.0, "seed": 2},
    "bounded k2 one-sided": {"limit": 4.0, "one_sided": True, "preload": 0.5, "seed": 3},
    "bounded k2 ball": {"limit": 3.0, "ball_radius": 3.0, "surface": "sphere", "seed": 4},
    "bounded k3 one-sided": {"contacts": 3, "limit": 5.0, "one_sided": True, "seed": 5},
    "bounded cables": {"families": ("cable",), "chains": 7, "limit": 5.0, "seed": 6},
    "bounded cables and legs": {"families": ("SPS", "cable"), "limit": 8.0, "seed": 13},
    "bounded without friction": {"mu": 0, "limit": 2.0, "one_sided": True, "seed": 7},
    "weighted mixed k2": {"families": MIXED, "chains": 7, "limit": 8.0, "seed": 8},
    "weighted mixed k3": {"families": MIXED, "contacts": 3, "limit": 8.0, "seed": 9},
    "weighted load": {"limit": 4.0, "contact_weight": 30.0, "seed": 10},
    "minimax k2": {"limit": 4.0, "seed": 11},
    "minimax mixed k1": {
        "families": MIXED[:3], "contacts": 1, "chains": 7, "limit": 8.0, "seed": 12
    },
    "minimax cables beside motors": {
        "families": ("RSS", "cable"), "chains": 8, "limit": 8.0, "seed": 21
    },
    "cubic cables": {"families": ("cable",), "chains": 8, "limit": 5.0, "seed": 6},
}  # fmt: skip
TIGHTER = 1e-8


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


def programs(model: Model, b: Balance, mixes: bool) -> list[Full]:
    """The program of every pattern, with bounds of efforts, of signs, and of one-sided contacts."""
    robot, chosen = model.mechanism, model.distribution
    low, high = (np.array([getattr(limits(c), x) for c in robot.chains]) for x in ("low", "high"))
    scale = np.maximum(np.abs(low), np.abs(high)) if mixes else np.ones(len(low))
    weight = chosen.contact_weight / model.reference_force**2
    push = np.array([c.push if c.one_sided else 0 for c in robot.contacts])
    made = []
    for sigma in b.patterns():
        signs = np.array(sigma, float)
        least = np.where(signs > 0, 0.0, -np.inf)
        most = np.where(signs < 0, 0.0, np.inf)
        least = np.where(push > 0, np.maximum(least, chosen.preload), least)
        most = np.where(push < 0, np.minimum(most, -chosen.preload), most)
        cost = np.r_[1 / scale**2, np.full(len(push), weight)]
        bounds = np.r_[low, least], np.r_[high, most]
        made.append(Full(np.hstack([b.C, b.along(sigma)]), b.b, *bounds, cost, len(low)))
    return made


@pytest.mark.parametrize(
    "name", first([n for n in CASES if n.split()[0] in ("bounded", "weighted")], 3)
)
def test_least_of_all_patterns_and_active_sets(name: str) -> None:
    case, model, got = found(name)
    for i, b in enumerate(case.balances()):
        tried = programs(model, b, name.startswith("weighted"))
        if got.status[i] == Status.infeasible:
            # Limits on both sides stretch alike; nothing serves a contact that would be pulled.
            needed = min(map(least_stretch, tried))
            assert needed > 1
            assert got.shortfall[i] == pytest.approx(needed, rel=1e-6)
            continue
        best = min(filter(None, map(best_active_set, tried)), key=lambda found: found[0])
        n = b.C.shape[1]
        assert got.status[i] == Status.ok and got.shortfall[i] == 1
        size = np.abs(best[1][:n]).max()
        np.testing.assert_allclose(got.effort[i], best[1][:n], atol=TIGHTER * size)
        size = max(size, np.abs(best[1][n:]).max(initial=0.0))
        np.testing.assert_allclose(got.contact_force[i], best[1][n:], atol=TIGHTER * size * 100)


@pytest.mark.parametrize("name", first(CASES, 5))
def test_equations_and_limits_hold(name: str) -> None:
    case, model, got = found(name)
    for i, b in enumerate(case.balances()):
        if got.status[i] != Status.ok:
            continue
        effort, force = got.effort[i], got.contact_force[i]
        sigma = np.where(force >= 0, 1, -1)
        left = b.C @ effort + b.along(sigma) @ force - b.b
        assert np.abs(left).max() < 1e-8 * max(np.abs(b.b).max(), np.abs(effort).max())
        for tau, chain in zip(effort, model.mechanism.chains, strict=True):
            bound = limits(chain)
            slack = 1e-9 * np.abs(effort).max()
            assert bound.low - slack <= tau <= bound.high + slack
        for pushed, contact in zip(force, model.mechanism.contacts, strict=True):
            if contact.one_sided:
                assert (
                    contact.push * pushed >= model.distribution.preload - 1e-9 * np.abs(force).max()
                )
    assert (got.status == Status.ok).any()
    np.testing.assert_allclose(got.share.sum(axis=1), got.effort, atol=1e-9)
    assert model.parts[-1] == "internal" and len(model.parts) == got.share.shape[1]


@pytest.mark.parametrize("name", [n for n in CASES if n.startswith("minimax")])
def test_minimax_by_linear_programs(name: str) -> None:
    case, model, got = found(name)
    for i, b in enumerate(case.balances()):
        tried = programs(model, b, True)
        greatest = 1 / np.sqrt(tried[0].cost[: tried[0].n])
        wanted = min(least_maximum(f, greatest) for f in tried)
        if got.status[i] == Status.infeasible:
            assert not np.isfinite(wanted)
            continue
        assert np.abs(got.effort[i] / greatest).max() == pytest.approx(wanted, rel=1e-7)


@pytest.mark.slow
def test_cubic_by_slsqp() -> None:
    case, model, got = found("cubic cables")
    compared = 0
    for i, b in enumerate(case.balances()):
        if got.status[i] != Status.ok:
            continue
        greatest = np.array([limits(c).greatest for c in model.mechanism.chains])
        mine = ((got.effort[i] / greatest) ** 3).sum()
        for full in programs(model, b, True):
            start = best_active_set(full)
            if start is None:
                continue
            z = by_slsqp(
                full,
                lambda x, g=greatest: float(((x / g) ** 3).sum()),
                lambda x, g=greatest: 3 * x**2 / g**3,
                start[1],
            )
            left = np.abs(full.C @ z - full.q).max()
            if left < 1e-7 * np.abs(full.q).max():
                theirs = ((z[: full.n] / greatest) ** 3).sum()
                assert mine < theirs * (1 + 1e-6)
                compared += 1
    assert compared


def test_limits_that_no_effort_meets() -> None:
    """Shortfall: with limits so many times as wide it is just feasible, with less it is not."""
    case = drawn(3, limit=0.2)
    model = condyle.derive(case.mechanism, backend="numpy", distribution="bounded")
    got = model.inverse_dynamics(*case.arguments, outputs="all")
    assert (got.status == Status.infeasible).any()
    worst = float(np.nanmax(got.shortfall[np.isfinite(got.shortfall)]))
    for more, enough in ((1.001, True), (0.999, False)):
        raw = case.raw | {"chain": [dict(c) for c in case.raw["chain"]]}
        for chain in raw["chain"]:
            a = dict(chain["actuator"])
            a["torque_limit"] = [x * worst * more for x in a["torque_limit"]]
            chain["actuator"] = a
        wide = Rubbing(raw, case.states)
        model = Model(wide.mechanism, backend="numpy", distribution="bounded")
        again = model.inverse_dynamics(*case.arguments, outputs="all")
        at = int(np.nanargmax(np.where(np.isfinite(got.shortfall), got.shortfall, -1)))
        assert bool(again.status[at] == Status.ok) is enough


@pytest.mark.slow
@pytest.mark.parametrize("contacts", [2, 3])
def test_wide_limits_leave_the_least_norm(contacts: int) -> None:
    case = drawn(8, count=3, limit=1e6, contacts=contacts)
    bounded, least = (
        Model(case.mechanism, backend="numpy", distribution=name).inverse_dynamics(
            *case.arguments, outputs="all"
        )
        for name in ("bounded", "minimum_norm")
    )
    size = np.abs(least.effort).max()
    np.testing.assert_allclose(bounded.effort, least.effort, atol=1e-9 * size)
    np.testing.assert_allclose(bounded.slip, least.slip)
    np.testing.assert_allclose(bounded.friction_force, least.friction_force, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bounded k2 one-sided", "bounded k3 one-sided", "minimax k2"])
def test_torques_one_and_evaluate_agree(name: str) -> None:
    case, model, wanted = found(name)
    for threads in (1, 2):
        got = model.inverse_dynamics(*case.arguments, outputs=("share",), threads=threads)
        assert (got.status == wanted.status).all()
        np.testing.assert_allclose(got.effort, wanted.effort, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(got.share, wanted.share, rtol=1e-9, atol=1e-9)
    rows = [model.unchecked().inverse_dynamics(*row) for row in zip(*case.arguments, strict=True)]
    np.testing.assert_allclose(rows, wanted.effort, rtol=1e-8, atol=1e-9)


@pytest.mark.usefixtures("compiler_command")
def test_one_sample_of_a_compiled_model_keeps_its_distribution() -> None:
    case, _, wanted = found("bounded k2 one-sided")
    model = Model(
        case.mechanism, backend="compiled", distribution=Distribution("bounded", preload=0.5)
    )
    rows = [model.unchecked().inverse_dynamics(*row) for row in zip(*case.arguments, strict=True)]
    np.testing.assert_allclose(rows, wanted.effort, rtol=1e-8, atol=1e-9)


@pytest.mark.usefixtures("compiler_command")
@pytest.mark.parametrize("objective", ["bounded", "weighted"])
def test_compiled_limits_and_shortfalls_are_those_of_numpy(objective: str) -> None:
    """With and without shares, which take other equations; where limits are met and where not."""
    case, model, _ = found("bounded k2 one-sided")
    q, q1, q2, load = (np.repeat(a, 4, axis=0) for a in case.packed)
    load[:, :6] *= np.tile([0.5, 1, 4, 16], len(load) // 4)[:, None]
    wanted = model.with_distribution(Distribution(objective, 0.5)).inverse_dynamics(
        q, q1, q2, *parts(load), outputs="all"
    )
    assert set(wanted.status) == {Status.ok, Status.infeasible}
    compiled = Model(
        case.mechanism, backend="compiled", distribution=Distribution(objective, preload=0.5)
    )
    got = compiled.inverse_dynamics(q, q1, q2, *parts(load), outputs="all")
    assert (got.status == wanted.status).all()
    good = wanted.status == Status.ok
    for name in ("effort", "contact_force", "friction_force"):
        a, b = getattr(got, name)[good], getattr(wanted, name)[good]
        np.testing.assert_allclose(a, b, atol=1e-9 * np.abs(b).max())
    size = np.abs(wanted.effort[good]).max()
    np.testing.assert_allclose(got.share[good], wanted.share[good], atol=1e-9 * size)
    np.testing.assert_allclose(got.shortfall, wanted.shortfall, rtol=1e-9)
    quick = compiled.inverse_dynamics(q, q1, q2, *parts(load))
    np.testing.assert_allclose(quick.effort[good], got.effort[good], atol=1e-9 * size)
    assert np.isnan(quick.effort[~good]).all()


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


@pytest.mark.usefixtures("compiler_command")
def test_a_preload_of_rubbing_contacts_in_kernels() -> None:
    case = drawn(5, count=4, mu=1.5, contacts=1, limit=50.0)
    chosen = Distribution("bounded", preload=2.0)
    wanted = Model(case.mechanism, backend="numpy", distribution=chosen)
    one = Model(case.mechanism, backend="compiled", distribution=chosen).unchecked()
    rows = [one.inverse_dynamics(*row) for row in zip(*case.arguments, strict=True)]
    np.testing.assert_allclose(
        rows, wanted.inverse_dynamics(*case.arguments).effort, rtol=1e-8, atol=1e-8
    )


def test_a_preload_without_one_sided_contacts_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    machine = condyle.load_mechanism("masticatory").replace(name="two-sided")
    for _ in range(2):
        condyle.derive(machine, backend="numpy", distribution=Distribution("bounded", preload=3.0))
    said = capsys.readouterr().err
    assert said.count("condyle: preload 3 N presses on nothing") == 1
    assert '"two-sided"' in said and "one_sided = true" in said
    chosen = condyle.load_mechanism("masticatory")
    one = chosen.contacts[0].model_copy(update={"one_sided": True, "side": "below"})
    pushed = chosen.replace(contacts=(one, *chosen.contacts[1:]))
    condyle.derive(pushed, backend="numpy", distribution=Distribution("bounded", preload=3.0))
    assert capsys.readouterr().err == ""


def test_a_pickled_model_keeps_its_distribution() -> None:
    case, model, wanted = found("bounded k2 one-sided")
    back = pickle.loads(pickle.dumps(model))
    assert back.distribution == model.distribution and back.distribution.preload == 0.5
    np.testing.assert_allclose(
        back.inverse_dynamics(*case.arguments).effort, wanted.effort, rtol=1e-9
    )


def test_units_are_not_mixed_by_norms() -> None:
    case = drawn(9, families=MIXED, contacts=3, limit=8.0)
    for name in ("minimum_norm", "bounded"):
        with pytest.raises(condyle.InputError, match="N m"):
            condyle.derive(case.mechanism, backend="numpy", distribution=name)
    with pytest.raises(condyle.InputError, match="bounded"):
        condyle.derive(case.mechanism, backend="numpy", distribution="bound")


@pytest.mark.parametrize("bad", [-1.0, np.nan, np.inf])
def test_weights_are_numbers(bad: float) -> None:
    for what in ("preload", "contact_weight"):
        with pytest.raises(condyle.InputError, match="at least 0"):
            condyle.derive("masticatory", distribution=Distribution("bounded", **{what: bad}))


def test_one_sample_within_limits_is_one_evaluation_of_a_kernel() -> None:
    robot = condyle.load_mechanism("masticatory")
    chains = []
    for chain in robot.chains:
        actuator = chain.actuator.model_copy(update={"torque_limit": 0.35})
        chains.append(chain.model_copy(update={"actuator": actuator}))
    model = Model(robot.replace(chains=tuple(chains)), distribution="bounded")
    rng = np.random.default_rng(2)
    q, q1, q2 = 0.004 * rng.normal(size=(3, 40, 4)) * np.array([1, 10, 100])[:, None, None]
    load = np.zeros((40, 9))
    load[:, 2], load[:, 6] = rng.uniform(-80, 0, 40), 0.03
    many = model.inverse_dynamics(q, q1, q2, *parts(load))
    found = np.array(
        [
            model.unchecked().inverse_dynamics(*row)
            for row in zip(q, q1, q2, *parts(load), strict=True)
        ]
    )
    assert {Status.ok, Status.infeasible} <= set(many.status.tolist())
    assert (np.abs(many.effort) == 0.35).any()
    np.testing.assert_allclose(found, many.effort, rtol=0, atol=1e-12)
