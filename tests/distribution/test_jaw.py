"""The human jaw's static bites, against numbers found independently with the same data."""

import numpy as np
import pytest

from condyle.distribution import CERTIFIED, OBJECTIVES, Status, distribute

from .cases import INCISOR, MOLAR_RIGHT, human_jaw


def test_hundred_newtons_on_the_right_first_molar():
    problem = human_jaw(np.array([100.0]), MOLAR_RIGHT)
    result = distribute(problem, "cubic")
    left, right = result.contact_force[0]
    assert left == pytest.approx(25.2, abs=0.05)
    assert right == pytest.approx(18.5, abs=0.05)
    assert (result.effort[0] / problem.high).max() == pytest.approx(0.178, abs=5e-4)


def test_six_hundred_newtons_bring_the_first_muscle_to_its_limit():
    problem = human_jaw(np.array([550.0, 600.0]), MOLAR_RIGHT)
    activation = (distribute(problem, "cubic").effort / problem.high).max(axis=1)
    assert activation[0] < 0.999
    assert activation[1] == pytest.approx(1.0)


def test_hundred_newtons_on_the_incisors():
    result = distribute(human_jaw(np.array([100.0]), INCISOR), "cubic")
    np.testing.assert_allclose(result.contact_force[0], 92.9, atol=0.06)


@pytest.mark.parametrize("name", sorted(OBJECTIVES))
def test_every_objective_is_certified_up_to_what_the_jaw_can_bite(name):
    result = distribute(human_jaw(np.linspace(1.0, 1500.0, 120), MOLAR_RIGHT), name)
    ok = result.status == Status.ok
    assert set(result.status) <= {Status.ok, Status.infeasible}
    assert ok.all() or name != "minimum_norm"
    assert ok[:40].all()
    for part in (result.residual, result.primal, result.dual):
        assert part[ok].max() <= CERTIFIED
    # Once it cannot bite harder it cannot bite harder still.
    assert (np.diff(ok.astype(int)) <= 0).all()
