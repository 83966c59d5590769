"""Poses on the contacts for any number of them: residuals, branches, rates and accelerations."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from oracles.closure import complete_state, contact_rows
from oracles.description import read
from oracles.random_mechanism import random_mechanism, random_state, toml_text
from oracles.rotations import platform_motion

from condyle import InputError
from condyle.backends.choose import Backend
from condyle.kinematics.constraints import (
    contact_frame,
    contacts_of,
    indices,
    parasitic_jacobian,
    residuals,
)
from condyle.kinematics.continuation import least_squares
from condyle.kinematics.rotation import Bryant, rotation
from condyle.mechanism import COORDINATES, Mechanism, parse
from condyle.mechanism.home import (
    condition_of,
    constraint_jacobian,
    dependent_coordinates,
    independent_coordinates,
    usable_sets,
)
from condyle.model.closing import Closure

pytestmark = pytest.mark.slow


def coordinate_closure(mechanism: Mechanism, names: Sequence[str]) -> Closure:
    return Closure(mechanism, names, backend=Backend("numpy"))


def landmark_closure(mechanism: Mechanism, landmark: str) -> Closure:
    return Closure(mechanism, landmark=landmark, backend=Backend("numpy"))


@cache
def drawn(contacts: int) -> tuple[dict[str, Any], Mechanism]:
    raw = random_mechanism(np.random.default_rng(20 + contacts), contacts=contacts)
    return raw, parse(toml_text(raw))


def off(mechanism: Mechanism, pose: np.ndarray) -> float:
    """Largest distance of a contact point from its plane [m]."""
    x = ca.SX.sym("x", 6)
    phi = ca.Function("phi", [x], [residuals(contacts_of(mechanism), x)])
    return float(np.abs(phi(pose.T).full()).max())


@pytest.mark.parametrize("contacts", range(1, 6))
def test_poses_lie_on_the_contacts_and_agree_with_the_oracle(contacts: int) -> None:
    raw, mechanism = drawn(contacts)
    states = random_state(np.random.default_rng(contacts), raw, 5)
    given, compared = ("pose", "pose_rate", "pose_acceleration"), 0
    for dependent in usable_sets(mechanism):
        condition = condition_of(constraint_jacobian(mechanism), dependent)
        if condition > 40:  # there the set ceases to determine the pose near home
            continue
        names = [name for name in COORDINATES if name not in dependent]
        columns = indices(names)
        found = coordinate_closure(mechanism, names).solve(*(states[k][:, columns] for k in given))
        assert found.reached.all()
        assert off(mechanism, found.pose) < 1e-12
        for key, got in zip(given, (found.pose, found.rate, found.acceleration), strict=True):
            scale = np.abs(states[key]).max()
            np.testing.assert_allclose(got, states[key], atol=1e-13 * condition * scale)
            compared += 1
    assert compared >= 6


@pytest.mark.parametrize("contacts", range(1, 6))
def test_rates_and_accelerations_are_derivatives(contacts: int) -> None:
    """Along q(t) = q + q' t + q'' t^2 / 2, against central differences of the pose."""
    raw, mechanism = drawn(contacts)
    states = random_state(np.random.default_rng(7), raw, 4, scale=0.5)
    q, q1, q2 = (states[key] for key in ("q", "qd", "qdd"))
    closure = coordinate_closure(mechanism, independent_coordinates(mechanism))
    h = 2e-4
    left2, left, middle, right, right2 = (
        closure.solve(q + q1 * t + q2 * t * t / 2, q1, q2).pose for t in h * np.arange(-2, 3)
    )
    found = closure.solve(q, q1, q2)
    first = (8 * (right - left) - (right2 - left2)) / (12 * h)
    second = (16 * (right + left) - (right2 + left2) - 30 * middle) / (12 * h * h)
    np.testing.assert_allclose(found.rate, first, atol=1e-8 * np.abs(first).max())
    np.testing.assert_allclose(found.acceleration, second, atol=1e-6 * np.abs(second).max())


@pytest.mark.parametrize("contacts", range(6))
def test_parasitic_jacobian(contacts: int) -> None:
    """M_J: identity rows, C M_J = 0, and it turns q' into X_EE'."""
    raw, mechanism = drawn(contacts)
    d, dependent = read(raw), dependent_coordinates(mechanism)
    x = ca.SX.sym("x", 6)
    frame = contact_frame(contacts_of(mechanism), x[:3], rotation(x[3:]))
    C = frame.N.T @ ca.diagcat(ca.SX.eye(3), Bryant.of(x[3:]).angular_velocity())
    M_J_of = ca.Function("M_J", [x], [ca.densify(parasitic_jacobian(C, dependent))])
    states = random_state(np.random.default_rng(2), raw, 4)
    for pose, rate, q1 in zip(states["pose"], states["pose_rate"], states["qd"], strict=True):
        M_J = M_J_of(pose).full()
        np.testing.assert_allclose(M_J @ q1, rate, atol=1e-13 * np.abs(rate).max())
        rows = contact_rows(d, platform_motion(pose))
        np.testing.assert_allclose(rows @ M_J, 0, atol=1e-13 * np.abs(rows).max(initial=1))
        free = indices([name for name in COORDINATES if name not in dependent])
        np.testing.assert_array_equal(M_J[free], np.eye(6 - contacts))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 23])
def test_far_from_home_the_branch_is_that_of_home(seed: int) -> None:
    """A pose found at once is the one found by following small steps."""
    raw = random_mechanism(np.random.default_rng(seed), contacts=3)
    mechanism = parse(toml_text(raw))
    names = independent_coordinates(mechanism)
    far = np.array([0.005 if name in "XYZ" else 0.15 for name in names])
    q = np.random.default_rng(0).uniform(-1, 1, (24, 3)) * far
    found = coordinate_closure(mechanism, names).solve(q, q, q)
    assert 8 < found.reached.sum() < 24 and np.ptp(found.pose[found.reached, 3:]) > 0.2
    for sample, pose in zip(q[found.reached], found.pose[found.reached], strict=True):
        wanted = complete_state(raw, names, sample, 0 * sample, 0 * sample, steps=30)[0]
        np.testing.assert_allclose(pose, wanted, atol=1e-11)


def test_contacts_that_hold_badly_still_hold() -> None:
    """Two balls 0.2 mm apart on nearly the same plane: steps stall far above rounding."""
    raw = random_mechanism(np.random.default_rng(6), contacts=3)
    near, other = raw["contact"][0], raw["contact"][2]
    other["point"] = [p + step for p, step in zip(near["point"], (0.15, 0.1, 0.05), strict=True)]
    slope = [s + step for s, step in zip(near["surface"]["slope"], (0.0005, -0.001), strict=True)]
    offset = other["point"][2] - np.dot(slope, other["point"][:2])
    other["surface"] = {"kind": "plane", "slope": slope, "offset": float(offset)}
    mechanism = parse(toml_text(raw))
    condition = condition_of(constraint_jacobian(mechanism), dependent_coordinates(mechanism))
    assert 9e3 < condition < 1e4
    names = independent_coordinates(mechanism)
    q = np.random.default_rng(0).uniform(-1, 1, (100, 3)) * [
        0.0005 if name in "XYZ" else 0.01 for name in names
    ]
    found = coordinate_closure(mechanism, names).solve(q, q, q)
    assert found.reached.all() and off(mechanism, found.pose) < 1e-15


def test_a_pose_out_of_reach_is_not_a_number_and_alone() -> None:
    _, mechanism = drawn(2)
    closure = coordinate_closure(mechanism, ["Y", "Z", "alpha", "beta"])
    good = np.array([[0.001, 0.002, 0.01, -0.02]])
    with_bad = np.vstack([good, [[0.0, 5.0, 0.0, 0.0]], good])
    alone, together = closure.solve(good, good, good), closure.solve(with_bad, with_bad, with_bad)
    assert together.reached.tolist() == [True, False, True]
    for name in ("pose", "rate", "acceleration"):
        assert np.isnan(getattr(together, name)[1]).all()
        np.testing.assert_array_equal(getattr(together, name)[[0, 2]], getattr(alone, name)[[0, 0]])


def test_a_singular_matrix_does_not_touch_its_neighbours() -> None:
    nearly = np.diag([1.0, 1, 1, 1, 1, 1e-17]) + 1e-3
    b = np.arange(12.0).reshape(2, 6)
    together = least_squares(np.stack([nearly, np.zeros((6, 6))]), b[..., None])
    np.testing.assert_array_equal(together[0], least_squares(nearly[None], b[:1, :, None])[0])
    assert np.isfinite(together[0]).all() and np.isnan(together[1]).all()


def test_a_landmark_is_led_and_the_midpoint_keeps_its_y(reference: Mechanism) -> None:
    rng = np.random.default_rng(5)
    s = rng.uniform(-1, 1, (40, 4)) * [0.002, 0.002, 0.01, 0]
    found = landmark_closure(reference, "incisor").solve(s, s, s)
    middle = np.mean([c.point for c in reference.contacts], axis=0)
    incisor = np.array(reference.platform.points["incisor"])
    assert found.reached.all() and off(reference, found.pose) < 1e-12
    for sample, pose, rate in zip(s, found.pose, found.rate, strict=True):
        motion = platform_motion(pose, rate)
        np.testing.assert_allclose(motion.point(incisor)[0] - incisor, sample[:3], atol=1e-15)
        np.testing.assert_allclose(motion.point(incisor)[1], sample[:3], atol=1e-15)
        assert abs(motion.point(middle)[0][1] - middle[1]) < 1e-15


@pytest.mark.parametrize(
    "names, message",
    [
        (["X", "Y", "alpha"], "got the 3 coordinates.*4 degrees of freedom.*X,Y,alpha,beta"),
        (["X", "Z", "alpha", "beta"], "not independent.*do not determine Y, gamma"),
    ],
)
def test_sets_that_do_not_determine_the_pose(
    reference: Mechanism, names: list[str], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        coordinate_closure(reference, names)


def test_a_landmark_needs_two_contacts(reference: Mechanism) -> None:
    with pytest.raises(InputError, match=r'no landmark "incisors".*Did you mean "incisor"'):
        landmark_closure(reference, "incisors")
    with pytest.raises(InputError, match=r"two contacts; this mechanism has 0"):
        landmark_closure(reference.replace(contacts=()), "incisor")


def test_a_leap_to_another_branch_is_made_in_smaller_pieces() -> None:
    """From home, Newton's steps shrink all the way to a pose on the wrong branch."""
    rng = np.random.default_rng(103)
    raw = random_mechanism(rng, contacts=3, chains=9, surface="cylinder")
    mechanism = parse(toml_text(raw))
    names = independent_coordinates(mechanism)
    q = np.array([[-0.01644455, 0.01753188, 0.13332819]])
    way = np.linspace(0, 1, 200)[:, None] * q
    closure = coordinate_closure(mechanism, names)
    found = closure.solve(way, 0 * way, 0 * way)
    assert found.reached.all()
    assert np.abs(np.diff(found.pose, axis=0)).max() < 0.05
    assert off(mechanism, found.pose) < 1e-15
