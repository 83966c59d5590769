"""Gravity given sample by sample, and a base that moves: formulations, laws, derivatives.

That every body obeys Newton and Euler in a frame that stands still is tested with the reactions.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from oracles.random_mechanism import off_centre, random_mechanism
from support.families import MIXED, Case, case, close, of_raw, same
from support.loads import parts
from support.speeds import few

from condyle import InputError
from condyle.dynamics import FORMULATIONS, ROUTES
from condyle.model.model import Model, parts_with_inputs
from condyle.model.model_result import ModelResult

NAMES = few(("mixed_k0_n8", "off_centre"), "off_centre")


@cache
def built(name: str) -> Case:
    if name != "off_centre":
        return case(name)
    rng = np.random.default_rng(5)
    return of_raw(off_centre(rng, random_mechanism(rng, families=MIXED, contacts=1)))


@cache
def rubbing() -> Case:
    """Friction, limits and losses."""
    raw = random_mechanism(np.random.default_rng(2), chains=8)
    for contact in raw["contact"]:
        contact["friction"] = {"coefficient": 0.2}
    for chain in raw["chain"]:
        chain["actuator"] = {"torque_limit": 0.5, "viscous": 1e-3, "rotor_inertia": 1e-5}
    return of_raw(raw)


def heavier(c: Case) -> Case:
    mass = 1.5 * c.mechanism.platform.mass
    return replace(c, mechanism=c.mechanism.set({"platform.mass": mass}))


def states(c: Case) -> tuple[Any, ...]:
    return (*(c.states[key] for key in ("q", "qd", "qdd")), *parts(c.load))


def moved(c: Case) -> dict[str, Any]:
    rng, count = np.random.default_rng(3), len(c.load)
    return {"gravity": rng.normal(0, 9, (count, 3)), "base": rng.normal(0, 6, (count, 9))}


def everything(c: Case) -> dict[str, Any]:
    """By the names of `derivatives`."""
    return dict(zip(("q", "v", "a", "wrench", "at"), states(c), strict=True)) | moved(c)


def solved(c: Case, *choices: str, **given: Any) -> ModelResult:
    beside = ("share", "gravity_share", "joint_rate", "joint_acceleration")
    found = c.model(*choices).inverse_dynamics(*states(c), **given, outputs=beside)
    assert (found.status == 0).all()
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_formulations_and_routes_agree(name: str) -> None:
    """Forward dynamics inverts them, by the kernel and by the robust path."""
    c = built(name)
    q, v, a, wrench, at = states(c)
    wanted = solved(c, **moved(c))
    every = product(FORMULATIONS, ROUTES[:1] if name == "off_centre" else ROUTES)
    for choice in (*every, ("lagrange", "direct")):
        got = solved(c, *choice, **moved(c))
        same(got, wanted, 1e-10)
        close(got.gravity_share, wanted.gravity_share, 1e-10)
    for formulation in ("virtual_power", "momentum"):
        model = c.model(formulation)
        back = model.forward_dynamics(q, v, wanted.effort, wrench, at, **moved(c))
        close(back.acceleration, a, 1e-8)
        close(back.contact_force, wanted.contact_force, 1e-8)
        robust = model.system.with_inputs(("gravity", "base")).robust
        inputs = {"q": q, "q1": v, "force": wrench[:, :3], "moment": wrench[:, 3:], "point": at}
        found = robust.evaluate({**inputs, "q2": a, **moved(c)})[0]
        close(found["share"], np.moveaxis(wanted.share, 0, -1), 1e-10)
        found = robust.forward({**inputs, "effort": wanted.effort, **moved(c)})[0]
        close(found["acceleration"].T, a, 1e-8)


def test_a_column_of_the_files_gravity_changes_nothing() -> None:
    c, still = case("rss"), np.zeros(9)
    for given in ({"gravity": c.mechanism.gravity}, {"base": still}):
        close(solved(c, **given).effort, solved(c).effort, 1e-15)
    one = [a[0] if np.ndim(a) > 1 else a for a in states(c)]
    got = c.model().inverse_dynamics(*one, gravity=c.mechanism.gravity, base=still)
    close(got.effort, solved(c).effort[0], 1e-15)


def test_in_free_fall_nothing_has_to_be_held() -> None:
    c, g = case("rss"), np.array([1.0, -2.0, 9.0])
    q, zero, model = c.states["q"], 0 * c.states["q"], c.model()
    falling = model.inverse_dynamics(q, zero, zero, gravity=g, base=[*g, *np.zeros(6)])
    held = model.inverse_dynamics(q, zero, zero, gravity=g)
    assert np.abs(falling.effort).max() < 1e-13 * np.abs(held.effort).max()
    assert (falling.bound > 1e-14).all() or (falling.effort == 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_derivatives(name: str) -> None:
    c, state = built(name), everything(built(name))
    model, q = c.model(), c.states["q"]
    wrt = {"q": 3e-5, "v": 1e-2, "gravity": 1.0, "base": 1.0}  # steps
    d = model.derivatives(("effort", "contact_force"), (*wrt, "platform.mass"), **state)

    def along(by: str, i: int, step: float) -> np.ndarray:
        x = np.array(state[by])
        x[:, i] += step
        found = model.inverse_dynamics(**{**state, by: x})
        return np.hstack([found.effort, found.contact_force])

    for by, h in wrt.items():
        both = np.concatenate([d["effort", by], d["contact_force", by]], axis=1)
        for i in range(both.shape[-1]):
            slope = 8 * (along(by, i, h) - along(by, i, -h))
            slope -= along(by, i, 2 * h) - along(by, i, -2 * h)
            close(both[..., i], slope / (12 * h), 1e-9, floor=np.abs(both).max())
    difference = solved(heavier(c), **moved(c)).effort - solved(c, **moved(c)).effort
    close(d["effort", "platform.mass"] * 0.5 * c.mechanism.platform.mass, difference, 1e-9)
    jvp = model.jvp("effort", {"base": np.ones(9), "q": 0 * q + 1}, **state)["effort"]
    close(jvp, d["effort", "base"].sum(axis=-1) + d["effort", "q"].sum(axis=-1), 1e-11)
    by = model.vjp("effort", np.ones(d["effort", "q"].shape[:2]), "base", **state)
    close(by["base"], d["effort", "base"].sum(axis=-2), 1e-11)


def test_accelerations_by_gravity_and_base() -> None:
    """They are affine in gravity and the base's acceleration; only the difference counts."""
    c = case("rss")
    effort, state = solved(c, **moved(c)).effort, everything(c)
    del state["a"]
    d = c.model().derivatives("acceleration", ("gravity", "base"), effort=effort, **state)
    close(d["acceleration", "gravity"], -d["acceleration", "base"][..., :3], 1e-11)
    linear = c.model().linearise(effort=effort, **state)
    assert (linear.status == 0).all() and np.isfinite(linear.A).all()


def test_variants_are_given_it_too_and_what_does_not_fit_is_refused() -> None:
    c, q = case("rss"), np.zeros(4)
    model, masses = c.model(), c.mechanism.platform.mass * np.array([1.0, 1.5])
    found = model.variants({"platform.mass": masses}).inverse_dynamics(*states(c), **moved(c))
    for effort, one in zip(found.effort, (c, heavier(c)), strict=True):
        close(effort, solved(one, **moved(c)).effort, 1e-12)
    with pytest.raises(InputError, match=r"base: .*shape \(\.\.\., 9\)"):
        model.inverse_dynamics(q, q, q, base=np.zeros(3))
    with pytest.raises(InputError, match="wrt: base: give"):
        model.derivatives("effort", "base", q=q, v=q, a=q)
    batch = model.variants({"gravity[2]": [-9.8, -9.7]})
    with pytest.raises(InputError, match=r"gravity\[2\]: varies, and gravity is given"):
        batch.inverse_dynamics(*states(c), **moved(c))


@pytest.mark.slow
@pytest.mark.parametrize("distribution", ["minimum_norm", "bounded"])
def test_friction_and_limits(distribution: str) -> None:
    c = rubbing()
    model, state = Model(c.mechanism, distribution=distribution, backend="numpy"), everything(c)
    found = model.inverse_dynamics(**state, outputs="share")
    good = found.status == 0
    assert good.sum() > 1
    rows = {key: x[good] for key, x in state.items() if key != "a"}
    back = model.forward_dynamics(effort=found.effort[good], **rows)
    close(back.acceleration, state["a"][good], 1e-6)
    assert parts_with_inputs(model, moved(c))[:4] == ("platform", "couplers", "cranks", "actuators")
    close(found.share[good].sum(axis=1), found.effort[good], 1e-9)
    d = model.derivatives("effort", ("gravity", "base"), **state)
    for by in ("gravity", "base"):
        for i, unit in enumerate(1e-4 * np.eye(d["effort", by].shape[-1])):
            ends = [
                model.inverse_dynamics(**{**state, by: state[by] + step}).effort
                for step in (unit, -unit)
            ]
            slope = (ends[0] - ends[1]) / 2e-4
            close(d["effort", by][good, :, i], slope[good], 1e-6, floor=1e-2)
