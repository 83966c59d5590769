"""The bound of every answer: it is always there, and follows the condition of what was solved."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import condyle
from condyle.model.model import Model

REGULAR = 1e-11  # at home and near it


def states(model: Model, size: int = 8) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(3)
    scale = [model.characteristic_length if n in "XYZ" else 1.0 for n in model.independent]
    q, v, a = rng.normal(0, 1, (3, size, len(scale))) * scale
    return 0.01 * q, v, 10 * a


@pytest.mark.parametrize("name", ["masticatory", "gough-stewart", "masticatory-curved"])
def test_inverse_dynamics_has_one_for_each_sample(name: str) -> None:
    model = condyle.derive(name, backend="numpy")
    found = model.inverse_dynamics(*states(model))
    assert found.bound.shape == found.status.shape == (8,)
    assert (found.bound > 0).all() and (found.bound < REGULAR).all()
    far = tuple(100 * x for x in states(model))
    lost = model.inverse_dynamics(*far)
    assert (np.isnan(lost.bound) == (lost.status != 0)).all()


@pytest.mark.parametrize("name", ["masticatory", "masticatory-curved"])
def test_the_robust_path_has_the_same(name: str) -> None:
    """Within what differs: the condition itself there, pivots in the kernels."""
    model = condyle.derive(name, backend="numpy")
    q, v, a = states(model)
    ports: dict[str, Any] = dict.fromkeys(("force", "moment", "point"), np.zeros((8, 3)))
    robust, _ = model.system.robust.evaluate({"q": q, "q1": v, "q2": a, **ports})
    ratio = model.inverse_dynamics(q, v, a).bound / robust["bound"]
    assert (ratio > 0.1).all() and (ratio < 10).all()


def test_it_grows_towards_a_singularity() -> None:
    """A joint's square root vanishes at the end of its reach: errors grow as its reciprocal."""
    model = condyle.derive("masticatory", backend="numpy")
    ray = np.zeros(4)
    ray[0] = 1.0
    near, far = 0.0, 1.0
    for _ in range(60):
        middle = (near + far) / 2
        ok = model.inverse_dynamics(middle * ray, 0 * ray, 0 * ray).status == 0
        near, far = (middle, far) if ok else (near, middle)
    steps = near * (1 - np.array([1e-2, 1e-4, 1e-6]))
    bounds = model.inverse_dynamics(steps[:, None] * ray, 0 * ray, 0 * ray).bound
    assert (bounds[1:] > 10 * bounds[:-1]).all()


def test_efforts_within_limits_are_as_good_as_their_certificate() -> None:
    model = condyle.derive("human-jaw", backend="numpy", distribution="weighted")
    found = model.inverse_dynamics(*(0 * x for x in states(model)))
    assert (found.bound[found.status == 0] == 1e-9).all()


@pytest.mark.slow
@pytest.mark.parametrize("distribution", ["minimum_norm", "bounded"])
def test_single_states_have_that_of_many(distribution: str) -> None:
    model = condyle.derive("masticatory", backend="compiled", distribution=distribution)
    q, v, a = states(model)
    many = model.inverse_dynamics(q, v, a).bound
    alone = [model.inverse_dynamics(*state).bound for state in zip(q, v, a, strict=True)]
    assert np.shape(alone[0]) == ()
    if distribution == "minimum_norm":
        np.testing.assert_allclose(alone, many, rtol=1e-3)
    assert (np.array(alone) >= 0.9 * many).all()


def test_a_solution_has_it() -> None:
    run = condyle.run(backend="numpy")
    assert run["bound"].dims == ("time",) and float(run["bound"].max()) < REGULAR


def test_forward_dynamics_has_one_for_each_sample() -> None:
    model = condyle.derive("masticatory-curved", backend="numpy")
    q, v, a = states(model)
    found = model.forward_dynamics(q, v, model.inverse_dynamics(q, v, a).effort)
    assert (found.bound > 0).all() and (found.bound < 1e-8).all()
    assert (np.abs(found.acceleration - a).max(axis=1) < found.bound * np.abs(a).max(axis=1)).all()


@pytest.mark.parametrize("name", ["gough-stewart", "masticatory-curved"])
def test_kinematics_have_one_for_each_sample(name: str) -> None:
    """There and back: the difference is within the sum of both."""
    model = condyle.derive(name, backend="numpy")
    q, v, a = states(model)
    there = model.inverse_kinematics(q, v, a)
    back = model.forward_kinematics(there.joint, start=there.pose)
    unit = [model.characteristic_length] * 3 + [1.0] * 3
    off = (np.abs(back.pose - there.pose) / unit).max(axis=1)
    for bound in (there.bound, back.bound):
        assert (bound > 0).all() and (bound < REGULAR).all()
    assert (off < there.bound + back.bound).all()
    lost = model.inverse_kinematics(1e3 * q)
    assert (np.isnan(lost.bound) == (lost.status != 0)).all()
