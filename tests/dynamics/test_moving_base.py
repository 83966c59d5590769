"""Gravity given sample by sample, and a base that moves: formulations, laws, derivatives.

That every body obeys Newton and Euler in a frame that stands still is tested with the reactions.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
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
from condyle.model.model import Model, parts_under
from condyle.model.model_result import ModelResult

NAMES = ("rss", "pss_k1", "mixed_k0_n8", "off_centre")


@cache
def built(name: str) -> Case:
    if name != "off_centre":
        return case(name)
    rng = np.random.default_rng(5)
    raw = random_mechanism(rng, families=("RSS", "PSS", "SPS"), contacts=1)
    return of_raw(off_centre(rng, raw))


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


def solved(c: Case, *choices: str, **given: Any) -> ModelResult:
    beside = ("share", "gravity_share")
    found = c.model(*choices).inverse_dynamics(*states(c), **given, outputs=beside)
    assert (found.status == 0).all()
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", few(NAMES, "off_centre"))
def test_formulations_and_routes_agree(name: str) -> None:
    """And forward dynamics inverts them, by the kernel and by the robust path."""
    c = built(name)
    q, v, a, wrench, at = states(c)
    wanted = solved(c, **moved(c))
    for choice in (
        *((formulation, "core") for formulation in FORMULATIONS),
        ("lagrange", "direct"),
    ):
        got = solved(c, *choice, **moved(c))
        for key in ("effort", "share", "gravity_share", "contact_force"):
            close(getattr(got, key), getattr(wanted, key), 1e-10)
    for formulation in ("virtual_power", "momentum"):
        model = c.model(formulation)
        back = model.forward_dynamics(q, v, wanted.effort, wrench, at, **moved(c))
        close(back.acceleration, a, 1e-8)
        close(back.contact_force, wanted.contact_force, 1e-8)
        system = model.system.under(("gravity", "base"))
        inputs = {"q": q, "q1": v, "force": wrench[:, :3], "moment": wrench[:, 3:], "point": at}
        robust = system.robust.evaluate({**inputs, "q2": a, **moved(c)})[0]
        close(robust["share"], np.moveaxis(wanted.share, 0, -1), 1e-10)
        robust = system.robust.forward({**inputs, "effort": wanted.effort, **moved(c)})[0]
        close(robust["acceleration"].T, a, 1e-8)


def test_a_column_of_the_files_gravity_changes_nothing() -> None:
    c = case("rss")
    still = np.zeros(9)
    for given in ({"gravity": c.mechanism.gravity}, {"base": still}):
        close(solved(c, **given).effort, solved(c).effort, 1e-15)
    one = [a[0] if np.ndim(a) > 1 else a for a in states(c)]
    got = c.model().inverse_dynamics(*one, gravity=c.mechanism.gravity, base=still)
    close(got.effort, solved(c).effort[0], 1e-15)


@pytest.mark.parametrize("name", ["rss", pytest.param("mixed_k0_n8", marks=pytest.mark.slow)])
def test_in_free_fall_nothing_has_to_be_held(name: str) -> None:
    c = case(name)
    q, zero, g = c.states["q"], 0 * c.states["q"], np.array([1.0, -2.0, 9.0])
    model = c.model()
    falling = model.inverse_dynamics(q, zero, zero, gravity=g, base=[*g, *np.zeros(6)])
    held = model.inverse_dynamics(q, zero, zero, gravity=g)
    assert np.abs(falling.effort).max() < 1e-13 * np.abs(held.effort).max()
    assert (falling.bound > 1e-14).all() or (falling.effort == 0).all()


@pytest.mark.parametrize("name", ["rss", pytest.param("sps_k3", marks=pytest.mark.slow)])
def test_at_rest_on_a_base_that_turns_evenly_there_is_a_potential(name: str) -> None:
    """Virtual work of the efforts is the slope of - sum (m |w x r|^2 + w.I w) / 2."""
    c = case(name)
    w, model = np.array([3.0, -7.0, 5.0]), c.model()
    q, zero = c.states["q"][1:3], 0 * c.states["q"][1:3]

    def potential(q: np.ndarray) -> np.ndarray:
        found = []
        for pose in model.inverse_kinematics(q).pose:
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


@pytest.mark.slow
@pytest.mark.parametrize("name", few(NAMES, "off_centre"))
def test_derivatives(name: str) -> None:
    c = built(name)
    model, given = c.model(), moved(c)
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
    difference = solved(heavier(c), **given).effort - solved(c, **given).effort
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
    c, q = case("rss"), np.zeros(4)
    model = c.model()
    with pytest.raises(InputError, match=r"base: .*shape \(\.\.\., 9\)"):
        model.inverse_dynamics(q, q, q, base=np.zeros(3))
    with pytest.raises(InputError, match="wrt: base: give"):
        model.derivatives("effort", "base", q=q, v=q, a=q)
    batch = model.variants({"gravity[2]": [-9.8, -9.7]})
    with pytest.raises(InputError, match=r"gravity\[2\]: varies, and gravity is given"):
        batch.inverse_dynamics(*states(c), **moved(c))


def test_variants_are_given_it_too() -> None:
    c = case("rss")
    given = moved(c)
    masses = c.mechanism.platform.mass * np.array([1.0, 1.5])
    found = c.model().variants({"platform.mass": masses}).inverse_dynamics(*states(c), **given)
    close(found.effort[0], solved(c, **given).effort, 1e-12)
    close(found.effort[1], solved(heavier(c), **given).effort, 1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("distribution", ["minimum_norm", "bounded"])
def test_friction_and_limits(distribution: str) -> None:
    c = rubbing()
    given, (q, v, a, wrench, at) = moved(c), states(c)
    model = Model(c.mechanism, distribution=distribution, backend="numpy")
    found = model.inverse_dynamics(*states(c), **given, outputs="share")
    good = found.status == 0
    assert good.sum() > 1
    rows = {"wrench": wrench[good], "at": at[good]} | {k: x[good] for k, x in given.items()}
    back = model.forward_dynamics(q[good], v[good], found.effort[good], **rows)
    close(back.acceleration, a[good], 1e-6)
    assert parts_under(model, given)[:4] == ("platform", "couplers", "cranks", "actuators")
    close(found.share[good].sum(axis=1), found.effort[good], 1e-9)
    state = {"q": q, "v": v, "a": a, "wrench": wrench, "at": at, **given}
    d = model.derivatives("effort", ("gravity", "base"), **state)
    for by in ("gravity", "base"):
        for i in range(d["effort", by].shape[-1]):
            unit = 1e-4 * np.eye(d["effort", by].shape[-1])[i]
            ends = [
                model.inverse_dynamics(**{**state, by: state[by] + step}).effort
                for step in (unit, -unit)
            ]
            slope = (ends[0] - ends[1]) / 2e-4
            close(d["effort", by][good, :, i], slope[good], 1e-6, floor=1e-2)
