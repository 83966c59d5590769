"""Impulses and active contacts: no false state, and what friction and dependent contacts do."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.contacts import judged
from condyle.simulation.impact import complementary

CASES = 1000


@pytest.mark.slow
def test_no_contact_state_is_false() -> None:
    """`python -m benchmarks.contacts 1e5` judges more."""
    found = judged(CASES)
    assert found["landings"] == found["rests"] == 0
    assert found["refused"] <= CASES / 100  # strong friction far off the mass centre: a run ends


def test_a_block_on_four_corners_rests_on_some_of_them() -> None:
    corners = np.array([[x, y, 0.0] for x in (-1, 1) for y in (-1, 1)])
    up = np.array([0.0, 0.0, 1.0])
    normal = np.array([[*up, *np.cross(corner, up)] for corner in corners]).T
    R, b = normal.T @ normal, np.full(4, -9.81)
    (found,) = complementary(R, b)
    assert np.abs(found.a).max() < 1e-12 and abs(found.p.sum() - 9.81) < 1e-12


def test_friction_may_leave_no_motion_or_several() -> None:
    """Painleve's rod: where pushing makes a contact approach the more."""
    pushing = np.array([[-1.0]])
    assert not complementary(pushing, np.array([-1.0]))
    several = complementary(pushing, np.array([1.0]))
    assert [one.active.tolist() for one in several] == [[False], [True]]
