"""Gravity given sample by sample, and a base that moves: formulations, laws, derivatives.

That every body obeys Newton and Euler in a frame that stands still is tested with the reactions.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from oracles.bodies import bodies
from oracles.jets import Jet
from oracles.random_mechanism import off_centre, random_mechanism
from support.families import Case, case, close, of_raw
from support.loads import parts
from support.speeds import few

from condyle import InputError
from condyle.dynamics import FORMULATIONS
from condyle.mechanism import Mechanism
from condyle.model.model import Model, parts_under
from condyle.model.model_result import ModelResult

NAMES = ("rss", "pss_k1", "sps_k2_n7", "mixed_k0_n8", "mixed_k1", "off_centre")


def built(name: str) -> Case:
    if name != "off_centre":
        return case(name)
    rng = np.random.default_rng(5)
    raw = random_mechanism(rng, families=("RSS", "PSS", "SPS"), contacts=1)
    return of_raw(off_centre(rng, raw))


def heavier_of(c: Case) -> Mechanism:
    return c.mechanism.set({"platform.mass": 1.5 * c.mechanism.platform.mass})


def states(c: Case) -> tuple[Any, ...]:
    return (*(c.states[key] for key in ("q", "qd", "qdd")), *parts(c.load))


def moved(c: Case) -> dict[str, Any]:
    rng, count = np.random.default_rng(3), len(c.load)
    return {"gravity": rng.normal(0, 9, (count, 3)), "base": rng.normal(0, 6, (count, 9))}


def model_of(c: Case, *choices: str) -> Model:
    pulls = any(chain.kind == "cable" for chain in c.mechanism.chains)
    return c.model(*choices, distribution="minimum_norm" if pulls else None)  # cables may push


def solved(c: Case, *choices: str, **given: Any) -> ModelResult:
    found = model_of(c, *choices).inverse_dynamics(*states(c), **given, outputs="all")
    assert (found.status == 0).all()
    return found


@pytest.mark.parametrize("name", few(NAMES, "rss", "off_centre"))
def test_formulations_and_routes_agree(name: str) -> None:
    c = built(name)
    wanted = solved(c, **moved(c))
    others = [(f, "core") for f in FORMULATIONS]
    others += [("lagrange", "direct")] if len(c.mechanism.contacts) < 3 else []
    for choice in others:
        got = solved(c, *choice, **moved(c))
        for key in ("effort", "share", "gravity_share", "contact_force"):
            close(getattr(got, key), getattr(wanted, key), 1e-10)


@pytest.mark.parametrize("name", few(NAMES, "rss", "off_centre"))
@pytest.mark.parametrize("formulation", ["virtual_power", "momentum"])
def test_forward_dynamics_inverts_inverse_dynamics(name: str, formulation: str) -> None:
    c = built(name)
    q, v, a, wrench, at = states(c)
    found, model = solved(c, **moved(c)), model_of(c, formulation)
    back = model.forward_dynamics(q, v, found.effort, wrench, at, **moved(c))
    close(back.acceleration, a, 1e-8)
    close(back.contact_force, found.contact_force, 1e-8)
    system = model.system.under(("gravity", "base"))
    w = np.broadcast_to(wrench, (len(q), 6))
    inputs = {"q": q, "q1": v, "q2": a, "force": w[:, :3], "moment": w[:, 3:], "point": at}
    robust = system.robust.evaluate({**inputs, **moved(c)})[0]
    close(robust["share"], np.moveaxis(found.share, 0, -1), 1e-10)
    del inputs["q2"]
    robust = system.robust.forward({**inputs, "effort": found.effort, **moved(c)})[0]
    close(robust["acceleration"].T, a, 1e-8)


def test_a_column_of_the_files_gravity_changes_nothing() -> None:
    c = case("mixed")
    still = np.zeros(9)
    for given in ({"gravity": c.mechanism.gravity}, {"base": still}):
        close(solved(c, **given).effort, solved(c).effort, 1e-15)
    one = [a[0] if np.ndim(a) > 1 else a for a in states(c)]
    got = c.model().inverse_dynamics(*one, gravity=c.mechanism.gravity, base=still)
    close(got.effort, solved(c).effort[0], 1e-15)


@pytest.mark.parametrize("name", ["rss", "mixed_k0_n8"])
def test_in_free_fall_nothing_has_to_be_held(name: str) -> None:
    c = case(name)
    q, zero, g = c.states["q"], 0 * c.states["q"], np.array([1.0, -2.0, 9.0])
    model = model_of(c)
    falling = model.inverse_dynamics(q, zero, zero, gravity=g, base=[*g, *np.zeros(6)])
    held = model.inverse_dynamics(q, zero, zero, gravity=g)
    assert np.abs(falling.effort).max() < 1e-13 * np.abs(held.effort).max()
    assert (falling.bound > 1e-14).all() or (falling.effort == 0).all()


@pytest.mark.parametrize("name", ["rss", "sps_k3"])
def test_at_rest_on_a_base_that_turns_evenly_there_is_a_potential(name: str) -> None:
    """Virtual work of the efforts is the slope of - sum (m |w x r|^2 + w.I w) / 2."""
    c = case(name)
    w, model = np.array([3.0, -7.0, 5.0]), c.model()
    q, zero = c.states["q"][1:3], 0 * c.states["q"][1:3]

    def potential(q: np.ndarray) -> np.ndarray:
        poses, found = model.inverse_kinematics(q).pose, []
        for pose in poses:
            free = bodies(c.raw, Jet(pose, 0 * pose, 0 * pose)).values()
            square = [
                b.mass * np.sum(np.cross(w, b.centre.x) ** 2) + w @ b.R.x @ b.inertia @ b.R.x.T @ w
                for b in free
            ]
            found.append(-sum(square) / 2)
        return np.array(found)

    base = [0, 0, 0, *w, 0, 0, 0]
    effort = model.inverse_dynamics(q, zero, zero, gravity=np.zeros(3), base=base).effort
    J = model.jacobians(q)
    work = np.einsum("...i,...ij,...jm->...m", effort, J.J, J.twist_basis)
    h = 1e-4 * np.where([n in "XYZ" for n in model.independent], 0.05, 1.0)
    for i, step in enumerate(np.diag(h)):
        slope = 8 * (potential(q + step) - potential(q - step))
        slope -= potential(q + 2 * step) - potential(q - 2 * step)
        close(work[:, i], slope / (12 * h[i]), 1e-6, floor=1e-3 * np.abs(work).max())


@pytest.mark.parametrize("name", few(NAMES, "off_centre"))
def test_derivatives(name: str) -> None:
    c = built(name)
    model, given = model_of(c), moved(c)
    q, v, a, wrench, at = states(c)
    state = {"q": q, "v": v, "a": a, "wrench": wrench, "at": at, **given}
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
    heavier = model_of(replace(c, mechanism=heavier_of(c)))
    difference = heavier.inverse_dynamics(*states(c), **given).effort - solved(c, **given).effort
    close(d["effort", "platform.mass"] * 0.5 * c.mechanism.platform.mass, difference, 1e-9)
    jvp = model.jvp("effort", {"base": np.ones(9), "q": 0 * q + 1}, **state)["effort"]
    close(jvp, d["effort", "base"].sum(axis=-1) + d["effort", "q"].sum(axis=-1), 1e-11)
    weights = np.ones((len(q), len(c.mechanism.chains)))
    by = model.vjp("effort", weights, "base", **state)
    close(by["base"], d["effort", "base"].sum(axis=-2), 1e-11)


def test_accelerations_by_gravity_and_base() -> None:
    c = case("rss")
    q, v, _, wrench, at = states(c)
    model, given, effort = c.model(), moved(c), solved(c, **moved(c)).effort
    state = {"q": q, "v": v, "effort": effort, "wrench": wrench, "at": at, **given}
    d = model.derivatives("acceleration", ("gravity", "base"), **state)
    # In gravity and the base's acceleration they are affine, and only the difference counts.
    close(d["acceleration", "gravity"], -d["acceleration", "base"][..., :3], 1e-11)
    linear = model.linearise(q, v, effort, wrench, at, **given)
    assert (linear.status == 0).all() and np.isfinite(linear.A).all()


def test_what_does_not_fit() -> None:
    model, q = case("rss").model(), np.zeros(4)
    with pytest.raises(InputError, match=r"base: .*shape \(\.\.\., 9\)"):
        model.inverse_dynamics(q, q, q, base=np.zeros(3))
    with pytest.raises(InputError, match="wrt: base: give"):
        model.derivatives("effort", "base", q=q, v=q, a=q)


def test_variants_are_given_it_too() -> None:
    c = case("mixed")
    model, given = model_of(c), moved(c)
    masses = c.mechanism.platform.mass * np.array([1.0, 1.5])
    found = model.variants({"platform.mass": masses}).inverse_dynamics(*states(c), **given)
    close(found.effort[0], solved(c, **given).effort, 1e-12)
    heavier = model_of(replace(c, mechanism=heavier_of(c)))
    close(found.effort[1], heavier.inverse_dynamics(*states(c), **given).effort, 1e-12)


def test_friction_and_limits() -> None:
    raw = random_mechanism(np.random.default_rng(2), chains=8)
    for contact in raw["contact"]:
        contact["friction"] = {"coefficient": 0.2}
    for chain in raw["chain"]:
        chain["actuator"] = {"torque_limit": 0.4, "viscous": 1e-3, "rotor_inertia": 1e-5}
    c = of_raw(raw)
    given = moved(c)
    for distribution in (None, "bounded"):
        model = Model(c.mechanism, distribution=distribution, backend="numpy")
        found = model.inverse_dynamics(*states(c), **given, outputs="all")
        assert (found.status == 0).any()
        good = found.status == 0
        q, v, a, wrench, at = (
            np.broadcast_to(x, (len(good), *x.shape[1:]))[good] for x in states(c)
        )
        few_ = {name: x[good] for name, x in given.items()}
        back = model.forward_dynamics(q, v, found.effort[good], wrench, at, **few_)
        close(back.acceleration, a, 1e-6)
        assert parts_under(model, given)[:4] == ("platform", "couplers", "cranks", "actuators")
        close(found.share[good].sum(axis=1), found.effort[good], 1e-9)


def test_gravity_that_varies_and_is_given() -> None:
    c = case("rss")
    batch = c.model().variants({"gravity[2]": [-9.8, -9.7]})
    with pytest.raises(InputError, match=r"gravity\[2\]: varies, and gravity is given"):
        batch.inverse_dynamics(*states(c), **moved(c))


@pytest.mark.parametrize("distribution", ["minimum_norm", "bounded"])
def test_derivatives_with_friction_and_limits(distribution: str) -> None:
    raw = random_mechanism(np.random.default_rng(2), chains=8)
    for contact in raw["contact"]:
        contact["friction"] = {"coefficient": 0.2}
    for chain in raw["chain"]:
        chain["actuator"] = {"torque_limit": 0.5, "viscous": 1e-3, "rotor_inertia": 1e-5}
    c = of_raw(raw)
    model = Model(c.mechanism, distribution=distribution, backend="numpy")
    q, v, a, wrench, at = states(c)
    state = {"q": q, "v": v, "a": a, "wrench": wrench, "at": at, **moved(c)}
    d = model.derivatives("effort", ("gravity", "base"), **state)
    good = d.status == 0
    assert good.sum() > 1
    for by, h in (("gravity", 1e-4), ("base", 1e-4)):
        for i in range(d["effort", by].shape[-1]):
            ends = []
            for step in (h, -h):
                x = np.array(state[by])
                x[:, i] += step
                ends.append(model.inverse_dynamics(**{**state, by: x}).effort)
            slope = (ends[0] - ends[1]) / (2 * h)
            close(d["effort", by][good, :, i], slope[good], 1e-6, floor=1e-2)
