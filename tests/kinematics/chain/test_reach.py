"""Where a chain cannot go, which way it goes on, its units, and links without mass."""

from __future__ import annotations

import copy
from types import SimpleNamespace

import numpy as np
import pytest
from support.families import case
from support.machines import model

import condyle
from condyle.errors import UnreachableError
from condyle.kinematics.causes import require_ok
from condyle.kinematics.chain import FAMILIES
from condyle.mechanism import Mechanism
from condyle.mechanism.files import from_data
from condyle.model.model import Model
from condyle.report.mechanism_summary import check
from condyle.status import Status


def test_out_of_reach_is_said_with_numbers(reference: Mechanism) -> None:
    pose = np.array([[0.2, 0, 0, 0, 0, 0]])
    text = FAMILIES["RSS"].explain(reference.chains[2], pose[0])
    assert 'chain "masseter_left" cannot reach M' in text and "mm" in text
    found = model("masticatory").poses.configuration(pose)
    assert found.discriminant[0, 2] < 0 and np.isnan(found.joint[0, 2])
    q = np.zeros((2, 5))
    q[1, 1] = 0.3  # sideways, by more than the rods reach
    hexaglide = model("hexaglide")
    evaluation = hexaglide.inverse_dynamics(q, 0 * q, 0 * q, outputs="all")
    assert evaluation.status.tolist() == [0, Status.unreachable]
    with pytest.raises(UnreachableError) as caught:
        require_ok(hexaglide.mechanism, evaluation)
    # Up the slope of 0.1 as well: M is then at y = 355, z = 90, its rail at y = 0, z = 230 mm.
    distance, rod = np.hypot(355, 140), np.linalg.norm([310, 55, 170])
    assert (
        f'chain "middle_front" cannot reach M: its rail passes M at {distance:.1f} mm, '
        f"the rod is {rod:.1f} mm long at row 2"
    ) in str(caught.value)


def test_travel_follows_the_platform_along_the_rails() -> None:
    """Moving along parallel rails moves every slider as far, and its force does the work."""
    free = Model(condyle.load_mechanism("hexaglide").replace(contacts=()), backend="numpy")
    q = np.zeros((3, 6))
    q[:, 0] = [-0.03, 0.0, 0.04]
    found = free.inverse_dynamics(q, 0 * q, 0 * q, outputs="configuration")
    joint = found.configuration.joint
    np.testing.assert_allclose(joint, q[:, :1].repeat(6, axis=1), atol=1e-15)
    # At rest the forces along the rails cancel: gravity has no part along them.
    assert np.abs(found.effort.sum(axis=1)).max() < 1e-12 * np.abs(found.effort).max()


def test_the_slider_keeps_the_branch_of_home() -> None:
    c = case("pss_k0")
    pose = np.array(c.states["pose"])
    sines = c.model().poses.configuration(pose).singularity.transmission
    for i, chain in enumerate(c.mechanism.chains):
        axis = np.array(chain.axis) / np.linalg.norm(chain.axis)
        home = np.subtract(chain.platform, chain.base) @ axis
        assert (np.sign(-sines[:, i]) == np.sign(home)).all()


def test_leg_coordinate_is_the_change_of_length_and_extension_pushes() -> None:
    c = case("sps_k0")
    pose = np.zeros((2, 6))
    pose[1, :3] = [0.004, -0.003, 0.006]
    joint = c.model().poses.configuration(pose).joint
    for i, chain in enumerate(c.mechanism.chains):
        leg = np.subtract(chain.platform, chain.base)
        change = np.linalg.norm(leg + pose[1, :3]) - np.linalg.norm(leg)
        assert joint[1, i] == pytest.approx(change, abs=1e-15)
    assert np.abs(joint[0]).max() < 1e-15
    zero, down = np.zeros((1, 6)), np.array([[0, 0, -1e4, 0, 0, 0]])
    effort = model("gough-stewart").inverse_dynamics(zero, zero, zero, down).effort
    assert (effort > 1e4 / 6).all()


def test_massless_links_are_allowed() -> None:
    nothing = {"mass": 0, "transverse": 0, "axial": 0}
    tables = copy.deepcopy(case("mixed").raw)
    for chain in tables["chain"]:
        for body in {"PSS": ("rod",), "SPS": ("cylinder", "piston")}.get(chain["kind"], ()):
            chain[body] |= nothing
    q, model = np.zeros((1, 4)), condyle.derive(from_data(tables), backend="numpy")
    assert np.isfinite(model.inverse_dynamics(q, q, q).effort).all()


def test_units_in_the_check(monkeypatch: pytest.MonkeyPatch) -> None:
    """But for the room around home, a search of its own."""
    room = SimpleNamespace(radius=0.0, at_most=0.0, stops="", points=0, spacing=0.0)
    monkeypatch.setattr("condyle.report.mechanism_summary.ball_around_home", lambda _: room)
    text = str(check(condyle.load_mechanism("hexaglide")))
    assert "joint [m], effort [N]" in text and "6 chains, 1 contact, 5 degrees" in text
