"""Derivatives within limits are those of the active set; where it changes they are a kink."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import condyle
from condyle.errors import InputError, UnsupportedError
from condyle.model.distributing import Distribution
from condyle.model.model import Model
from condyle.status import Status

Array = np.ndarray
SIZES = {"q": 1e-3, "v": 1e-2, "a": 0.1, "wrench": 1.0, "at": 1e-3}


def given_to(model: Model, seed: int) -> dict[str, Array]:
    rng, m = np.random.default_rng(seed), len(model.independent)
    given = {name: rng.normal(0, size, (2, m)) for name, size in list(SIZES.items())[:3]}
    return given | {
        "wrench": rng.uniform(-1, 1, (2, 6)) * [50, 50, 50, 1, 1, 1],
        "at": rng.normal(0, 0.01, (2, 3)),
    }


@pytest.mark.parametrize(
    ("machine", "distribution"),
    [
        ("human-jaw", "bounded"),
        *(
            pytest.param(machine, name, marks=pytest.mark.ci)
            for machine, name in (
                ("human-jaw", "weighted"),
                ("human-jaw", "cubic"),
                ("human-jaw-curved", "minimax"),
                ("masticatory", "minimax"),
                ("masticatory-curved", "weighted"),
            )
        ),
    ],
)
def test_against_differences(machine: str, distribution: str) -> None:
    """Of sixth order, over steps that change no active set; some bounds are active."""
    model = Model(machine, backend="numpy", distribution=distribution)
    given = given_to(model, 1)
    d = model.derivatives(("effort", "contact_force"), tuple(given), **given)
    assert not d.status.any()
    effort = model.inverse_dynamics(**given).effort
    if machine.startswith("human"):
        assert (np.abs(effort) < 1e-9).any()  # cables that are slack
    for by in ("q", "wrench", "at"):  # others move efforts by less than their certificate
        rng = np.random.default_rng(2)
        direction = rng.choice([-1.0, 1.0], given[by].shape[1]) * SIZES[by] * 1e-4

        def at(s: float, by: str = by, way: Array = direction) -> Any:
            return model.inverse_dynamics(**{**given, by: given[by] + s * way})

        ends = [(at(s), at(-s)) for s in (1, 2, 3)]
        for of in ("effort", "contact_force"):
            diffs = [getattr(x, of) - getattr(y, of) for x, y in ends]
            wanted = (45 * diffs[0] - 9 * diffs[1] + diffs[2]) / 60
            found = d[of, by] @ direction
            scale = np.abs(d[of, by] * direction).max()
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-5 * scale)


def test_forward_and_reverse_are_the_matrix() -> None:
    model = Model("human-jaw", backend="numpy", distribution="bounded")
    given, rng = given_to(model, 1), np.random.default_rng(3)
    d = model.derivatives(("effort", "contact_force"), ("q", "wrench"), **given)
    weights = {of: rng.normal(0, 1, d[of, "q"].shape[:2]) for of in ("effort", "contact_force")}
    back = model.vjp(tuple(weights), weights, ("q", "wrench"), **given)
    for by in ("q", "wrench"):
        total = sum((w[:, None] @ d[of, by])[:, 0] for of, w in weights.items())
        np.testing.assert_allclose(back[by], total, atol=1e-9 * np.abs(total).max())


CASES = [
    ("masticatory", Distribution("bounded")),
    ("human-jaw", Distribution("cubic")),
    ("human-jaw", Distribution("minimax")),
    ("human-jaw", Distribution("weighted", contact_weight=0.5)),
    ("masticatory", Distribution("weighted", contact_weight=2.0)),
]


@pytest.mark.parametrize(("name", "distribution"), CASES)
def test_by_limits_and_contact_weight(name: str, distribution: Distribution) -> None:
    """Against differences between mechanisms with other numbers in the file."""
    machine = condyle.load_mechanism(name)
    key = "force_limit[1]" if name == "human-jaw" else "torque_limit"
    if name == "human-jaw":
        most = max(machine.get(f"chain.{c}.actuator.{key}") for c in machine.chain_names)
        machine = machine.set(f"chain.{machine.chain_names[0]}.actuator.{key}", 1.1 * most)
    if name == "masticatory":  # the strongest stands alone, so that N_ref has a derivative
        limits = {
            f"chain.{c}.actuator.torque_limit": 2.0 + 0.1 * i
            for i, c in enumerate(machine.chain_names)
        }
        machine = machine.set(limits)
    model = Model(machine, backend="numpy", distribution=distribution)
    given, rng = given_to(model, 1), np.random.default_rng(2)
    if distribution.name == "bounded":  # one limit binds, in both samples
        least = np.abs(Model(machine, backend="numpy").inverse_dynamics(**given).effort)
        i = int(least.min(axis=0).argmax())
        limit = f"chain.{machine.chain_names[i]}.actuator.torque_limit"
        machine = machine.set(limit, 0.98 * float(least[:, i].min()))
        model = Model(machine, backend="numpy", distribution=distribution)
    star, of = f"chain.*.actuator.{key}", ("effort", "contact_force")
    paths = (star, "platform.mass", "chain.*.platform")
    d = model.derivatives(of, paths, **given, keep="all")
    good = d.status == 0
    assert good.any()
    n = len(machine.chains)
    assert d["effort", star].shape == (len(d.status), n, n)
    assert np.abs(d["effort", star][good]).max() > 0

    def changed(steps: dict[str, np.ndarray], size: float) -> Any:
        moves = {
            path.replace("*", c): tuple(value) if np.ndim(value) else float(value)
            for path, step in steps.items()
            for c, value in zip(
                machine.chain_names,
                [
                    np.asarray(machine.get(path.replace("*", c))) + size * s
                    for c, s in zip(machine.chain_names, step, strict=True)
                ],
                strict=True,
            )
        }
        other = Model(machine._set(moves, "all"), backend="numpy", distribution=distribution)
        return other.inverse_dynamics(**given)

    most = machine.get(star.replace("*", machine.chain_names[0]))
    sizes = {star: 1e-4 * most * rng.normal(size=n)}
    sizes["chain.*.platform"] = 1e-6 * rng.normal(size=(n, 3))
    for path, step in sizes.items():
        ends = [(changed({path: step}, s), changed({path: step}, -s)) for s in (1, 2)]
        for result in of:
            diffs = [getattr(x, result) - getattr(y, result) for x, y in ends]
            wanted = (8 * diffs[0] - diffs[1])[good] / 12
            slope = d[result, path][good].reshape(good.sum(), -1, step.size)
            have = slope @ step.ravel()
            scale = np.abs(slope * step.ravel()).max()
            np.testing.assert_allclose(have, wanted, rtol=0, atol=3e-5 * scale)
    tangents = {star: sizes[star], "platform.mass": np.array(0.1)}
    along = model.jvp(of, tangents, **given, keep="all")
    weights = {r: rng.normal(size=d[r, star].shape[:2]) for r in of}
    back = model.vjp(of, weights, paths, **given, keep="all")
    for result in of:
        total = d[result, star] @ sizes[star] + 0.1 * d[result, "platform.mass"]
        np.testing.assert_allclose(along[result], total, atol=1e-9 * np.nanmax(np.abs(total)))
    for path in paths:
        flat = [
            np.einsum("sr,srp->sp", weights[r], d[r, path].reshape(*weights[r].shape, -1))
            for r in of
        ]
        total = (flat[0] + flat[1]).reshape(back[path].shape)
        np.testing.assert_allclose(back[path], total, atol=1e-9 * np.nanmax(np.abs(total)))


def test_a_largest_limit_that_several_have() -> None:
    model = Model("human-jaw", backend="numpy", distribution=Distribution("weighted", 0.0, 0.5))
    with pytest.raises(UnsupportedError, match="largest limit"):
        model.derivatives("effort", "chain.*.actuator.force_limit", **given_to(model, 1))


def test_limits_without_a_say() -> None:
    state = {n: np.zeros(4) for n in "qva"}
    limit = "chain.masseter_left.actuator.torque_limit"
    model = Model("masticatory", backend="numpy")
    with pytest.raises(InputError, match="cannot depend"):
        model.derivatives("effort", limit, **state)
    assert not model.derivatives("effort", limit, **state, zeros=True)["effort", limit].any()
    bounded = Model("masticatory", backend="numpy", distribution="bounded")
    missing = bounded.mechanism.set({limit: None})
    with pytest.raises(InputError, match="has no limit"):
        Model(missing, backend="numpy", distribution="bounded").derivatives(
            "effort", limit, **state
        )


def test_an_effort_at_its_limit_is_a_kink() -> None:
    """With a limit that the effort of least norm just meets: both sides are the active set's."""
    free = Model("masticatory", backend="numpy")
    state = {n: np.full(4, x) for n, x in (("q", 1e-3), ("v", 0.1), ("a", 1.0))}
    state["wrench"] = np.array([0, 0, -40.0, 0, 0, 0])
    effort = free.inverse_dynamics(**state).effort
    name, most = free.mechanism.chain_names[0], float(abs(effort[0]))
    key = f"chain.{name}.actuator.torque_limit"
    found = []
    for factor in (0.99, 1.0, 1.01):
        mechanism = free.mechanism.set({key: factor * most})
        model = Model(mechanism, backend="numpy", distribution="bounded")
        found.append(model.derivatives("effort", "q", **state))
    assert [int(d.status) for d in found] == [Status.ok, Status.kink, Status.ok]
    assert not found[0]["effort", "q"][0].any() and found[2]["effort", "q"][0].all()
    at_kink = found[1]["effort", "q"]
    size = 0.05 * np.abs(at_kink).max()
    sides = [found[i]["effort", "q"] for i in (0, 2)]
    assert any(np.allclose(at_kink, side, atol=size) for side in sides)
    assert not np.allclose(*sides, atol=size)


def test_a_contact_force_near_zero_under_friction_is_a_kink() -> None:
    free = Model("masticatory", backend="numpy")
    mechanism = free.mechanism.set({"contact.left_condyle.friction.coefficient": 0.2})
    model = Model(mechanism, backend="numpy")
    q, v, effort = np.zeros(4), np.full(4, 0.1), np.zeros(6)

    def force(z: float) -> Any:
        return model.forward_dynamics(q, v, effort, np.array([0, 0, z, 0, 0, 0]))

    low, high = -200.0, 200.0
    sign = np.sign(force(low).contact_force[0])
    assert np.sign(force(high).contact_force[0]) != sign
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (
            (middle, high) if np.sign(force(middle).contact_force[0]) == sign else (low, middle)
        )
    wrench = np.array([0, 0, low, 0, 0, 0])
    d = model.derivatives("acceleration", "q", q=q, v=v, effort=effort, wrench=wrench)
    assert int(d.status) == Status.kink and np.isfinite(d["acceleration", "q"]).all()
    away = model.derivatives("acceleration", "q", q=q, v=v, effort=effort, wrench=wrench + 1.0)
    assert int(away.status) == Status.ok


def test_a_second_derivative_is_the_reverse_of_the_forward_one() -> None:
    """Hessian of weights . effort in q, times a direction, against differences of gradients."""
    model = Model("masticatory", backend="numpy")
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
