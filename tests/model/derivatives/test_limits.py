"""Derivatives within limits are those of the active set; where it changes they are a kink."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machines import model as shared
from support.speeds import first

import condyle
from condyle.errors import InputError, UnsupportedError
from condyle.model.distributing import Distribution
from condyle.model.model import Model
from condyle.results import row_stream
from condyle.status import Status

Array = np.ndarray
OF = ("effort", "contact_force")
SIZES = {"q": 1e-3, "v": 1e-2, "a": 0.1, "wrench": 1.0, "at": 1e-3}


def given_to(model: Model, seed: int) -> dict[str, Array]:
    rng, m = np.random.default_rng(seed), len(model.independent)
    given = {name: rng.normal(0, SIZES[name], (2, m)) for name in "qva"}
    wrench = rng.uniform(-1, 1, (2, 6)) * [50, 50, 50, 1, 1, 1]
    return given | {"wrench": wrench, "at": rng.normal(0, 0.01, (2, 3))}


def with_limits(name: str, distribution: Distribution) -> condyle.Mechanism:
    """The strongest stands alone, so that N_ref has a derivative; of `bounded` one limit binds."""
    machine = condyle.load_mechanism(name)
    names = machine.chain_names
    if name.startswith("human"):
        limit = "chain.{}.actuator.force_limit[1]"
        most = max(machine.get(limit.format(c)) for c in names)
        return machine.set(limit.format(names[0]), 1.1 * most)
    limit = "chain.{}.actuator.torque_limit"
    machine = machine.set({limit.format(c): 2.0 + 0.1 * i for i, c in enumerate(names)})
    if distribution.name != "bounded":
        return machine
    model = Model(machine, backend="numpy")
    least = np.abs(model.inverse_dynamics(**given_to(model, 1)).effort)
    i = int(least.min(axis=0).argmax())
    return machine.set(limit.format(names[i]), 0.98 * float(least[:, i].min()))


LIMITED = [
    ("masticatory", Distribution("bounded")),
    ("human-jaw", Distribution("weighted", contact_weight=0.5)),
    ("human-jaw", Distribution("cubic")),
    ("human-jaw-curved", Distribution("minimax")),
]


@pytest.mark.parametrize(("name", "distribution"), first(LIMITED, 2))
def test_by_states_loads_limits_and_contact_weight(name: str, distribution: Distribution) -> None:
    """Against differences between states, and between mechanisms with other numbers, of fourth
    order over steps that change no active set; forward and reverse."""
    machine = with_limits(name, distribution)
    model = Model(machine, backend="numpy", distribution=distribution)
    given, rng, n = given_to(model, 1), np.random.default_rng(2), len(machine.chains)
    if name.startswith("human"):
        assert (np.abs(model.inverse_dynamics(**given).effort) < 1e-9).any()  # slack cables
    star = "chain.*.actuator." + ("force_limit[1]" if name.startswith("human") else "torque_limit")
    paths = (star, "platform.mass", "chain.*.platform")
    d = model.derivatives(OF, (*given, *paths), **given, keep="all")
    good = d.status == 0
    assert d["effort", star].shape == (2, n, n) and np.abs(d["effort", star][good]).max() > 0
    kept = {k: a[good] for k, a in given.items()}
    most = machine.get(star.replace("*", machine.chain_names[0]))
    steps = {star: 1e-4 * most * rng.normal(size=n), paths[2]: 1e-6 * rng.normal(size=(n, 3))}
    for by in ("q", "wrench", "at"):  # others move efforts by less than their certificate
        steps[by] = rng.choice([-1.0, 1.0], given[by].shape[1]) * SIZES[by] * 1e-4

    def at(by: str, s: float) -> Any:
        if by in given:
            return model.inverse_dynamics(**{**kept, by: kept[by] + s * steps[by]})
        moves = {}
        for c, step in zip(machine.chain_names, steps[by], strict=True):
            value = np.asarray(machine.get(by.replace("*", c))) + s * step
            moves[by.replace("*", c)] = tuple(value) if value.ndim else float(value)
        other = Model(machine._set(moves, "all"), backend="numpy", distribution=distribution)
        return other.inverse_dynamics(**kept)

    for by, step in steps.items():
        ends = [(at(by, s), at(by, -s)) for s in (1, 2)]
        for of in OF:
            diffs = [getattr(x, of) - getattr(y, of) for x, y in ends]
            wanted = (8 * diffs[0] - diffs[1]) / 12
            terms = d[of, by][good].reshape(*wanted.shape, -1) * step.ravel()
            scale = 3e-5 * np.abs(terms).max()
            np.testing.assert_allclose(terms.sum(axis=-1), wanted, rtol=0, atol=scale)
    tangents = {star: steps[star], "platform.mass": np.array(0.1)}
    along = model.jvp(OF, tangents, **given, keep="all")
    weights = {r: rng.normal(size=d[r, star].shape[:2]) for r in OF}
    back = model.vjp(OF, weights, paths, **given, keep="all")
    for r in OF:
        total = d[r, star] @ steps[star] + 0.1 * d[r, "platform.mass"]
        np.testing.assert_allclose(along[r], total, atol=1e-9 * np.nanmax(np.abs(total)))
    for path in paths:
        flat = {r: d[r, path].reshape(*weights[r].shape, -1) for r in OF}
        total = sum(np.einsum("sr,srp->sp", weights[r], flat[r]) for r in OF)
        total = np.reshape(total, back[path].shape)
        np.testing.assert_allclose(back[path], total, atol=1e-9 * np.nanmax(np.abs(total)))


def test_limits_without_a_say_and_a_largest_limit_that_several_have() -> None:
    state = {n: np.zeros(4) for n in "qva"}
    limit = "chain.masseter_left.actuator.torque_limit"
    model = shared("masticatory")
    with pytest.raises(InputError, match="cannot depend"):
        model.derivatives("effort", limit, **state)
    assert not model.derivatives("effort", limit, **state, zeros=True)["effort", limit].any()
    bounded = Model(model.mechanism.set({limit: None}), backend="numpy", distribution="bounded")
    with pytest.raises(InputError, match="has no limit"):
        bounded.derivatives("effort", limit, **state)
    model = Model("human-jaw", backend="numpy", distribution=Distribution("weighted", 0.0, 0.5))
    with pytest.raises(UnsupportedError, match="largest limit"):
        model.derivatives("effort", "chain.*.actuator.force_limit", **given_to(model, 1))


def test_an_effort_at_its_limit_is_a_kink() -> None:
    """With a limit that the effort of least norm just meets: both sides are the active set's."""
    free = shared("masticatory")
    state = {n: np.full(4, x) for n, x in (("q", 1e-3), ("v", 0.1), ("a", 1.0))}
    state["wrench"] = np.array([0, 0, -40.0, 0, 0, 0])
    most = float(abs(free.inverse_dynamics(**state).effort[0]))
    key = f"chain.{free.mechanism.chain_names[0]}.actuator.torque_limit"
    found = []
    for factor in (0.99, 1.0, 1.01):
        mechanism = free.mechanism.set({key: factor * most})
        model = Model(mechanism, backend="numpy", distribution="bounded")
        found.append(model.derivatives("effort", "q", **state))
    assert [int(d.status) for d in found] == [Status.ok, Status.kink, Status.ok]
    low, at_kink, high = (d["effort", "q"] for d in found)
    assert not low[0].any() and high[0].all()
    size = 0.05 * np.abs(at_kink).max()
    assert any(np.allclose(at_kink, side, atol=size) for side in (low, high))
    assert not np.allclose(low, high, atol=size)


@pytest.mark.parametrize("seed", first([1, 3, 4], 1))
def test_on_either_side_of_where_a_muscle_slackens(seed: int) -> None:
    """Of `cubic`, whose curvature is none there: against differences that stay on one side."""
    machine, rng = condyle.load_mechanism("human-jaw"), np.random.default_rng(seed)
    moves: dict[str, Any] = {}
    for name in (f"chain.{chain}" for chain in machine.chain_names):
        limit = f"{name}.actuator.force_limit[1]"
        moves[limit] = machine.get(limit) * rng.uniform(0.5, 2)
        moves[f"{name}.platform"] = machine.get(f"{name}.platform") + rng.normal(0, 2e-3, 3)
    model = Model(machine._set(moves, "all"), backend="numpy", distribution="cubic")
    start = [0, 0, -60, 0, 0, 0] + rng.uniform(-1, 1, 6) * [20, 20, 20, 0.5, 0.5, 0.5]
    way = rng.uniform(-1, 1, 6) * [30, 30, 30, 0.6, 0.6, 0.6]

    def effort(s: Array) -> Array:
        still = np.zeros((len(s), len(model.independent)))
        return model.inverse_dynamics(still, still, still, start + s[:, None] * way).effort

    ends = (-1.0, 1.0)
    for _ in range(5):  # to a part of 30 in each: one muscle alone changes
        s = np.linspace(*ends, 31)
        pulls = effort(s) > 1e-6
        k = np.flatnonzero((pulls[1:] != pulls[:-1]).sum(axis=1) == 1)[0]
        ends = (s[k], s[k + 1])
    (muscle,), kink = np.flatnonzero(pulls[k] != pulls[k + 1]), np.mean(ends)
    slopes = []
    for side in (-1e-3, 1e-3):
        state = dict.fromkeys("qva", np.zeros(len(model.independent)))
        d = model.derivatives("effort", "wrench", **state, wrench=start + (kink + side) * way)
        e = effort(kink + side * np.array([0.6, 0.8, 1.2, 1.4]))
        wanted = (8 * (e[2] - e[1]) - (e[3] - e[0])) / (12 * 0.2 * side)
        found = d["effort", "wrench"] @ way
        np.testing.assert_allclose(found, wanted, rtol=0, atol=2e-4 * np.abs(wanted).max())
        slopes.append(found[muscle])
    assert d.status == 0 and min(np.abs(slopes)) == 0 < max(np.abs(slopes))


def test_a_kink_in_any_chunk_of_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its status stands in the table, or the error says how it would."""
    monkeypatch.setattr(row_stream, "CHUNK_ROWS", 1)
    free = shared("masticatory")
    states = np.repeat([[1e-3], [0.1], [1.0]], 4, axis=1).reshape(1, 12)
    q, v, a = np.split(states, 3, axis=1)
    most = float(abs(free.inverse_dynamics(q, v, a).effort[0, 0]))
    key = f"chain.{free.mechanism.chain_names[0]}.actuator.torque_limit"
    model = Model(free.mechanism.set({key: most}), backend="numpy", distribution="bounded")
    head = ",".join(prefix + name for prefix in ("", "d", "dd") for name in model.independent)
    out = tmp_path / "out.csv"
    files = {"states": tmp_path / "states.csv", "out": out}
    for order in ((1.0, 0.5), (0.5, 1.0)):
        table = np.vstack([np.hstack([q, v * k, a * k]) for k in order])
        np.savetxt(files["states"], table, fmt="%.17g", delimiter=",", header=head, comments="")
        if order[0] < 1:
            with pytest.raises(InputError, match=r"row 2 is at a kink.*--flag"):
                condyle.derivative_states(model, **files)
        report = condyle.derivative_states(model, **files, flag=order[0] < 1)
        assert report.data["kinks"] == 1
        last = [line.split(",")[-1] for line in out.read_text().splitlines()]
        assert last == ["status", *("kink" if k == 1 else "ok" for k in order)]


def test_a_contact_force_near_zero_under_friction_is_a_kink() -> None:
    mechanism = condyle.load_mechanism("masticatory")
    mechanism = mechanism.set({"contact.left_condyle.friction.coefficient": 0.2})
    model = Model(mechanism, backend="numpy")
    state = {"q": np.zeros(4), "v": np.full(4, 0.1), "effort": np.zeros(6)}

    def sign(z: float) -> Any:
        wrench = np.array([0, 0, z, 0, 0, 0])
        return np.sign(model.forward_dynamics(**state, wrench=wrench).contact_force[0])

    low, high = -200.0, 200.0
    start = sign(low)
    assert sign(high) != start
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if sign(middle) == start else (low, middle)
    for more, status in ((0.0, Status.kink), (1.0, Status.ok)):
        wrench = np.array([more, more, low + more, more, more, more])
        d = model.derivatives("acceleration", "q", **state, wrench=wrench)
        assert int(d.status) == status and np.isfinite(d["acceleration", "q"]).all()


def test_a_second_derivative_is_the_reverse_of_the_forward_one() -> None:
    """Hessian of weights . effort in q, times a direction, against differences of gradients."""
    model = shared("masticatory")
    rng, given = np.random.default_rng(4), given_to(model, 2)
    weights, way = rng.normal(0, 1, (2, 6)), rng.normal(0, 1, 4)
    inner = "directional", "inverse", (), ("q",), ("effort",)
    kernel = model.kernel("derivative", "gradient", "derivative", inner, ("q",), ("d_effort",))
    ports = {"q": given["q"], "q1": given["v"], "q2": given["a"], "point": given["at"]}
    ports |= {"force": given["wrench"][:, :3], "moment": given["wrench"][:, 3:]}
    ports |= {"d_q": np.tile(way, (2, 1)), "w_d_effort": weights}
    found = kernel.run(ports).values["g_q"].T

    def gradient(s: float) -> Array:
        moved = {**given, "q": given["q"] + s * way}
        return model.vjp("effort", weights, "q", **moved)["q"]

    h = 1e-5
    wanted = (8 * (gradient(h) - gradient(-h)) - gradient(2 * h) + gradient(-2 * h)) / (12 * h)
    np.testing.assert_allclose(found, wanted, atol=1e-8 * np.abs(wanted).max())
