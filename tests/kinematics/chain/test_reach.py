"""Where a chain cannot go, which way it goes on, and its units."""

from __future__ import annotations

import numpy as np
import pytest
from support.families import case
from support.loads import parts

import condyle
from condyle.errors import UnreachableError
from condyle.mechanism import Mechanism
from condyle.model.model import Model
from condyle.model.model_result import require_ok
from condyle.status import Status


def hexaglide() -> Mechanism:
    return condyle.load_mechanism("hexaglide")


def test_a_rail_too_far_from_its_joint() -> None:
    model = Model(hexaglide(), backend="numpy")
    q = np.zeros((2, 5))
    q[1, 1] = 0.3  # sideways, by more than the rods reach
    evaluation = model.inverse_dynamics(q, 0 * q, 0 * q, outputs="all")
    assert evaluation.status.tolist() == [0, Status.unreachable]
    with pytest.raises(UnreachableError) as caught:
        require_ok(model.mechanism, evaluation)
    # Up the slope of 0.1 as well: M is then at y = 355, z = 90, its rail at y = 0, z = 230 mm.
    distance, rod = np.hypot(355, 140), np.linalg.norm([310, 55, 170])
    assert (
        f'chain "middle_front" cannot reach M: its rail passes M at {distance:.1f} mm, '
        f"the rod is {rod:.1f} mm long at row 2"
    ) in str(caught.value)


def test_travel_follows_the_platform_along_the_rails() -> None:
    """Moving along parallel rails moves every slider as far, and its force does the work."""
    mechanism = hexaglide().replace(contacts=())
    model = Model(mechanism, backend="numpy")
    q = np.zeros((3, 6))
    q[:, 0] = [-0.03, 0.0, 0.04]
    evaluation = model.inverse_dynamics(q, 0 * q, 0 * q, outputs="all")
    np.testing.assert_allclose(
        evaluation.configuration.joint, q[:, :1].repeat(6, axis=1), atol=1e-15
    )
    # At rest the forces along the rails cancel: gravity has no part along them.
    total = evaluation.effort.sum(axis=1)
    assert np.abs(total).max() < 1e-12 * np.abs(evaluation.effort).max()


def test_the_slider_keeps_the_branch_of_home() -> None:
    c = case("pss_k0")
    evaluation = c.evaluate()
    for i, chain in enumerate(c.mechanism.chains):
        axis = np.array(chain.axis) / np.linalg.norm(chain.axis)
        home = np.subtract(chain.platform, chain.base) @ axis
        sines = evaluation.configuration.singularity.transmission[:, i]
        assert (np.sign(-sines) == np.sign(home)).all()


def test_leg_coordinate_is_the_change_of_length() -> None:
    c = case("sps_k0")
    model = Model(c.mechanism, backend="numpy")
    q = np.zeros((2, 6))
    q[1, :3] = [0.004, -0.003, 0.006]
    joint = model.inverse_dynamics(q, 0 * q, 0 * q, outputs="all").configuration.joint
    for i, chain in enumerate(c.mechanism.chains):
        leg = np.subtract(chain.platform, chain.base)
        change = np.linalg.norm(leg + q[1, :3]) - np.linalg.norm(leg)
        assert joint[1, i] == pytest.approx(change, abs=1e-15)
    assert np.abs(joint[0]).max() < 1e-15


def test_extension_pushes() -> None:
    """A load that presses a Gough-Stewart platform down needs positive, pushing efforts."""
    mechanism = condyle.load_mechanism("gough-stewart")
    model = Model(mechanism, backend="numpy")
    zero = np.zeros((1, 6))
    load = np.zeros((1, 9))
    load[0, 2] = -1e4
    effort = model.inverse_dynamics(zero, zero, zero, *parts(load)).effort
    assert (effort > 1e4 / 6).all()


@pytest.mark.parametrize(
    ("name", "joint", "effort"),
    [("gough-stewart", "m", "N"), ("hexaglide", "m", "N"), ("masticatory", "rad", "N m")],
)
def test_units_in_the_check(name: str, joint: str, effort: str) -> None:
    from condyle.report.mechanism_summary import check

    text = str(check(condyle.load_mechanism(name)))
    assert f"joint [{joint}], effort [{effort}]" in text
    assert ("6 chains, 1 contact, 5 degrees" in text) == (name == "hexaglide")
