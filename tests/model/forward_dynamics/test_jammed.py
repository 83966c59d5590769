"""Friction so strong that no motion, or more than one, is consistent with it."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.forward_tree import forward_dynamics
from oracles.pinocchio_engine import PinocchioEngine
from support.rubbing import drawn

from condyle.errors import InputError
from condyle.model.model import Model
from condyle.status import Status

from .cases import by_numpy, case, close, efforts, load_of, state


@pytest.mark.slow
@pytest.mark.parametrize(("contacts", "mu", "seed"), [(1, 6.0, 3), (2, 6.0, 1), (3, 2.0, 2)])
def test_patterns_are_those_of_the_tree(contacts: int, mu: float, seed: int) -> None:
    c = drawn(seed, count=25, mu=mu, lossy=False, contacts=contacts)
    model, effort = Model(c.mechanism, backend="numpy"), efforts(c)
    found = model.forward_dynamics(
        *state(c, model),
        effort,
        *load_of(c),
        outputs="all",
    )
    engine, s, counts = PinocchioEngine(c.raw), c.states, []
    for i in range(len(effort)):
        given = s["pose"][i], s["pose_rate"][i], effort[i], s["wrench"][i], s["load_point"]
        patterns = forward_dynamics(engine, c.raw, *given)
        counts.append(len(patterns))
        assert found.status[i] == (Status.jammed, Status.ok, *[Status.ambiguous] * 7)[len(patterns)]
        if len(patterns) == 1:
            close(found.pose_acceleration[i], patterns[0].acceleration, 1e-8)
            close(found.contact_force[i], patterns[0].force, 1e-8)
        else:
            assert np.isnan(found.acceleration[i]).all()
            assert np.isnan(found.contact_force[i]).all()
    assert 1 in counts
    assert {0, 2} & {*counts}


def test_without_motion_and_weight_no_force_has_a_sign() -> None:
    """All patterns say the same, so none is in doubt: not jammed."""
    c = case("RSS k1 n8")
    mechanism = c.mechanism.replace(gravity=(0.0, 0.0, 0.0))
    model = Model(mechanism, backend="numpy")
    n = len(mechanism.chains)
    found = model.forward_dynamics(np.zeros((1, 5)), np.zeros((1, 5)), np.zeros((1, n)))
    assert not found.status.any()
    assert np.abs(found.acceleration).max() == 0
    assert np.abs(found.contact_force).max() == 0


def test_statuses() -> None:
    c, model = case("masticatory"), by_numpy("masticatory")
    q, q1 = (np.repeat(a[:1], 3, axis=0) for a in state(c, model))
    effort, wrench, at = (np.repeat(a[:1], 3, axis=0) for a in (efforts(c), *load_of(c)))
    q[1, 0] = 0.5  # metres
    effort[2, 1] = np.nan
    found = model.forward_dynamics(q, q1, effort, wrench, at)
    assert [Status(s) for s in found.status] == [Status.ok, Status.unreachable, Status.overflow]
    assert np.isnan(found.acceleration[1:]).all()
    assert np.isnan(
        model.unchecked().forward_dynamics(q[1], q1[1], effort[1], wrench[1], at[1])
    ).all()
    about = model.linearise(q, q1, effort, wrench, at)
    A, B = about.A, about.B
    assert np.isfinite(A[0]).all() and np.isfinite(B[0]).all()
    assert np.isnan(A[1:]).all() and np.isnan(B[1:]).all()


def test_what_does_not_fit() -> None:
    c, model = case("masticatory"), by_numpy("masticatory")
    given = (*state(c, model), efforts(c), *load_of(c))
    with pytest.raises(InputError, match=r"no output 'joints'.* joint"):
        model.forward_dynamics(*given, outputs=("joints",))
    with pytest.raises(
        InputError, match=r"effort: expected numbers in an array of shape \(..., 6\): temporalis"
    ):
        model.forward_dynamics(given[0], given[1], given[2][:, :4], *given[3:])
