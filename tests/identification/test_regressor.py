"""The regressor: its numbers give the balance that other formulations give."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, toml_text
from support.machines import model as model_of
from support.speeds import first

import condyle
from condyle.mechanism import Mechanism, parse

SAMPLES = 5


def machine(name: str) -> Mechanism:
    if not name.isdigit():
        return condyle.load_mechanism(name)
    rng = np.random.default_rng(int(name))
    raw = random_mechanism(rng, contacts=int(name) % 6)
    return parse(toml_text(raw), f"random {name}")


# Planes, curves, no contacts and one contact on a random surface stand for the others.
NAMES = first(
    ["masticatory", "masticatory-curved", "gough-stewart", "1", "hexaglide", "sphere-in-cylinder",
     "human-jaw-muscles", "2", "5"], 4,
)  # fmt: skip


def states(model: condyle.Model, seed: int) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    shape = SAMPLES, len(model.independent)
    return [scale * rng.normal(size=shape) for scale in (1e-3, 0.1, 1.0)]


@pytest.mark.parametrize("name", NAMES)
def test_numbers_give_the_balance(name: str) -> None:
    mechanism = machine(name)
    model = condyle.derive(mechanism, backend="numpy", distribution="minimum_norm")
    other = condyle.derive(
        mechanism, formulation="newton_euler", backend="numpy", distribution="minimum_norm"
    )
    q, v, a = states(model, 1)
    wrench = np.random.default_rng(2).normal(size=(SAMPLES, 6))
    found = model.regressor(q, v, a, wrench)
    asked = other.inverse_dynamics(q, v, a, wrench)
    good = asked.status == 0
    assert good.any() and not found.status[good].any()
    force = np.abs(asked.contact_force)
    left = found.Y @ found.numbers + found.load + (found.friction @ force[..., None])[..., 0]
    right = (found.J.swapaxes(1, 2) @ asked.effort[..., None])[..., 0]
    np.testing.assert_allclose(
        left[good], right[good], rtol=0, atol=1e-12 * np.nanmax(np.abs(right))
    )
    carried = (found.contact_J @ asked.effort[..., None])[..., 0]
    drag = (found.contact_friction @ force[..., None])[..., 0]
    contact = found.contact_Y @ found.numbers + found.contact_load + drag - carried
    size = max(1.0, np.abs(asked.contact_force[good]).max(initial=0))
    np.testing.assert_allclose(contact[good], asked.contact_force[good], rtol=0, atol=1e-11 * size)


def test_a_moving_base_is_in_it() -> None:
    rng = np.random.default_rng(5)
    for name in ("masticatory", "gough-stewart", "hexaglide"):
        model = condyle.derive(name, backend="numpy")
        other = condyle.derive(name, formulation="newton_euler", backend="numpy")
        given = {"gravity": rng.normal(size=(SAMPLES, 3)), "base": rng.normal(size=(SAMPLES, 9))}
        found = model.regressor(*states(model, 3), **given)
        effort = other.inverse_dynamics(*states(model, 3), **given).effort
        right = (found.J.swapaxes(1, 2) @ effort[..., None])[..., 0]
        left = found.Y @ found.numbers
        np.testing.assert_allclose(left, right, rtol=0, atol=1e-12 * np.nanmax(np.abs(right)))


@pytest.mark.parametrize("path", ["platform.mass", "chain.*.coupler.com", "chain.*.crank.inertia"])
def test_columns_are_the_numbers_effects(path: str) -> None:
    """Another number in the file gives other numbers and the same columns."""
    model = model_of("masticatory")
    value = 1.2 * np.asarray(model.mechanism.get(path.replace("*", "masseter_left")))
    names = [path.replace("*", name) for name in model.mechanism.chain_names]
    changed = model.mechanism.set(dict.fromkeys(names, float(value)))
    other = condyle.derive(changed, backend="numpy")
    before, after = (m.regressor(*states(model, 4)) for m in (model, other))
    np.testing.assert_allclose(after.Y, before.Y, rtol=0, atol=1e-13 * np.abs(before.Y).max())
    assert not np.array_equal(before.numbers, after.numbers)


def test_states_that_cannot_be_have_no_row() -> None:
    model = model_of("masticatory")
    far = np.array([[0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0]])
    found = model.regressor(far, 0 * far, 0 * far)
    assert found.status.tolist()[0] == 0 and found.status.tolist()[1] != 0
    assert np.isfinite(found.Y[0]).all() and np.isnan(found.Y[1]).all()
    assert len(found.names) == len(found.units) == found.Y.shape[-1]
    deep = model.regressor(np.zeros((2, 3, 4)), np.zeros(4), np.zeros(4))
    assert deep.Y.shape == (2, 3, 4, len(found.names)) and deep.status.shape == (2, 3)
    assert model.regressor(*np.zeros((3, 4))).J.shape == (6, 4)


def test_what_a_motion_can_tell() -> None:
    model = model_of("masticatory")
    found = model.base_parameters(condyle.reference_motion())
    assert 0 < found.rank < len(found.names)
    assert found.rank == len(found.known)
    assert len(found.unknown) == len(found.names) - found.rank
    text = str(found)
    assert "platform.mass" in text and f"{found.rank} of {len(found.names)}" in text


def test_combinations_hold() -> None:
    """Numbers that change along what the motion cannot tell leave the efforts as they are."""
    model = model_of("masticatory")
    motion = condyle.reference_motion()
    q, v, a = model.poses.of_motion(motion)[0]
    asked = model.regressor(q, v, a)
    found = model.base_parameters(motion)
    place = {name: i for i, name in enumerate(asked.names)}
    size = np.abs(asked.Y).max(axis=(0, 1))
    for name in found.unknown:
        move = np.zeros(len(asked.names))
        move[place[name]] = 1.0
        for one in found.known:
            terms = dict(one.terms)
            if name in terms:
                move[place[one.terms[0][0]]] -= terms[name]
        left = np.abs(asked.Y @ move).max()
        assert left <= 1e-5 * (size * np.abs(move)).max(), name
