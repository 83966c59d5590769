"""The motion for mechanisms that nobody measured."""

from __future__ import annotations

import numpy as np
import pytest

import condyle
from condyle.mechanism.home import independent_coordinates


@pytest.mark.parametrize("name", condyle.bundled_mechanisms())
def test_every_bundled_mechanism_follows_it(name: str) -> None:
    mechanism = condyle.load(name)
    motion = condyle.trial_motion(mechanism)
    assert motion.names == tuple(independent_coordinates(mechanism))
    solution = condyle.derive(mechanism, backend="interpreted").solve(motion)
    assert np.isfinite(solution["torque"]).all()


def test_it_begins_at_rest_and_moves_everything() -> None:
    motion = condyle.trial_motion(condyle.load("gough-stewart"), rate=200)
    assert len(motion) == 1001
    for of in (motion.value, motion.rate, motion.acceleration):
        np.testing.assert_allclose(of[0], 0, atol=1e-6)
    assert (np.ptp(motion.value, axis=0) > 0.01).all()
    # No two coordinates move alike.
    assert np.linalg.matrix_rank(motion.value, tol=1e-3) == 6
