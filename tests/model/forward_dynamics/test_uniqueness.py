"""Efforts put forward under friction come back as their motion, or are said to have several."""

from __future__ import annotations

import numpy as np
import pytest

import condyle
from condyle.mechanism.contact import Friction
from condyle.model.model import Model
from condyle.status import Status

pytestmark = pytest.mark.slow

Array = np.ndarray


def rough(*mu: float) -> Model:
    machine = condyle.load_mechanism("masticatory")
    contacts = tuple(
        c.model_copy(update={"friction": Friction(coefficient=m, smoothing_speed=1e-3)})
        for c, m in zip(machine.contacts, mu, strict=True)
    )
    return Model(machine.replace(contacts=contacts), backend="numpy")


def motions(model: Model, count: int, seed: int) -> tuple[Array, Array, Array, Array]:
    """q, v, a and wrenches: up to 3 mm, with loads of some newtons."""
    rng, m = np.random.default_rng(seed), len(model.independent)
    angles = [name not in "XYZ" for name in model.independent]
    size = np.where(angles, 1.0, model.characteristic_length)
    q, v = rng.uniform(-0.05, 0.05, (count, m)) * size, rng.normal(size=(count, m)) * size
    a = 10 * rng.normal(size=(count, m)) * size
    return q, v, a, rng.normal(size=(count, 6)) * np.repeat([15, 0.5], 3)


def returned(model: Model, *given: Array | None) -> tuple[Array, Array, Array]:
    """Statuses of efforts put forward, their relative errors, and whether inverse dynamics said
    that they are ambiguous; of samples that have efforts."""
    there = model.inverse_dynamics(*given, outputs=("ambiguous",))
    ok = there.status == Status.ok
    q, v, a, *load = (x[ok] for x in given)
    back = model.forward_dynamics(q, v, there.effort[ok], *load, outputs=("all_accelerations",))
    scale = np.abs(a).max(axis=1)
    wrong = np.abs(back.all_accelerations - a[:, None]).max(axis=2) / scale[:, None]
    several = back.status == Status.ambiguous
    # The motion that the efforts were made for is always among the solutions.
    assert (np.nanmin(wrong[back.status == Status.ok], axis=1, initial=1) < 1e-8).all()
    assert (np.nanmin(wrong[several], axis=1, initial=1) < 1e-5).all()
    assert (np.isfinite(wrong[several]).sum(axis=1) >= 2).all()
    error = np.abs(back.acceleration - a).max(axis=1) / scale
    return back.status, error, there.ambiguous[ok]


def test_no_ok_with_another_motion() -> None:
    """With mu = 3 and 4 one motion of fifty came back as another; weak friction is never in doubt,
    nor is rest without a load and weight, where contact forces are zero to rounding."""
    model = rough(3.0, 4.0)
    status, error, ambiguous = returned(model, *motions(model, 150, 0))
    assert {*np.unique(status)} == {Status.ok, Status.ambiguous}
    assert ((status == Status.ambiguous) == ambiguous).all()
    assert not (error[status == Status.ok] > 1e-8).any()
    model = rough(0.3, 0.3)
    given = motions(model, 40, 1)
    status, error, ambiguous = returned(model, *given)
    assert not status.any() and not ambiguous.any() and error.max() < 1e-10
    light = Model(model.mechanism.replace(gravity=(0.0, 0.0, 0.0)), backend="numpy")
    q, v, _, _ = given
    assert not light.forward_dynamics(q, 1e-9 * v, np.zeros((40, 6))).status.any()
