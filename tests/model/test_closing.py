"""Poses on the contacts: residuals, branches, rates and accelerations; paths of landmarks."""

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
from support import following
from support.families import close
from support.machines import model as shared
from support.speeds import first

import condyle
from condyle import InputError
from condyle.backends.choose import Backend
from condyle.backends.kernel import AGAIN
from condyle.kinematics.constraints import (
    contact_frame,
    contacts_of,
    indices,
    parasitic_jacobian,
    residuals,
)
from condyle.kinematics.pose_finder import least_squares
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
from condyle.motion.followed_closure import FollowedClosure

pytestmark = pytest.mark.slow

COUNT = 120
MOTION = ("pose", "pose_rate", "pose_acceleration")


def of_coordinates(mechanism: Mechanism, names: Sequence[str]) -> Closure:
    return Closure.of(mechanism, names, backend=Backend("numpy"))


def of_landmark(mechanism: Mechanism, landmark: str) -> Closure:
    return Closure.of(mechanism, landmark=landmark, backend=Backend("numpy"))


@cache
def drawn(contacts: int) -> tuple[dict[str, Any], Mechanism]:
    raw = random_mechanism(np.random.default_rng(20 + contacts), contacts=contacts)
    return raw, parse(toml_text(raw))


def off(mechanism: Mechanism, pose: np.ndarray) -> float:
    """Largest distance of a contact point from its plane [m]."""
    x = ca.SX.sym("x", 6)
    phi = ca.Function("phi", [x], [residuals(contacts_of(mechanism), x)])
    return float(np.abs(phi(pose.T).full()).max())


@pytest.mark.parametrize("contacts", range(6))
def test_poses_rates_and_accelerations_are_those_of_the_oracle(contacts: int) -> None:
    """By every fourth set of coordinates, but those that hardly determine the pose near home.

    M_J has identity rows, C M_J = 0, and it turns q' into X_EE'.
    """
    raw, mechanism = drawn(contacts)
    states, compared = random_state(np.random.default_rng(contacts), raw, 5), 0
    for dependent in [*usable_sets(mechanism)][::4] if contacts else []:
        condition = condition_of(constraint_jacobian(mechanism), dependent)
        if condition > 40:
            continue
        names = [name for name in COORDINATES if name not in dependent]
        columns = indices(names)
        found = of_coordinates(mechanism, names).solve(*(states[k][:, columns] for k in MOTION))
        assert found.reached.all() and off(mechanism, found.pose) < 1e-12
        for key, got in zip(MOTION, (found.pose, found.rate, found.acceleration), strict=True):
            close(got, states[key], 1e-13 * condition)
        compared += 1
    assert compared or not contacts
    dependent = dependent_coordinates(mechanism)
    x = ca.SX.sym("x", 6)
    frame = contact_frame(contacts_of(mechanism), x[:3], rotation(x[3:]))
    C = frame.N.T @ ca.diagcat(ca.SX.eye(3), Bryant.of(x[3:]).angular_velocity())
    M_J_of = ca.Function("M_J", [x], [ca.densify(parasitic_jacobian(C, dependent))])
    free = indices([name for name in COORDINATES if name not in dependent])
    for pose, rate in zip(states["pose"], states["pose_rate"], strict=True):
        M_J = M_J_of(pose).full()
        close(M_J @ rate[free], rate, 1e-13)
        rows = contact_rows(read(raw), platform_motion(pose))
        np.testing.assert_allclose(rows @ M_J, 0, atol=1e-13 * np.abs(rows).max(initial=1))
        np.testing.assert_array_equal(M_J[free], np.eye(6 - contacts))


def test_far_from_home_the_branch_is_that_of_home() -> None:
    """A pose found at once is the one found by following small steps."""
    raw = random_mechanism(np.random.default_rng(1), contacts=3)
    mechanism = parse(toml_text(raw))
    names = independent_coordinates(mechanism)
    far = np.array([0.005 if name in "XYZ" else 0.15 for name in names])
    q = np.random.default_rng(0).uniform(-1, 1, (24, 3)) * far
    found = of_coordinates(mechanism, names).solve(q, q, q)
    assert 8 < found.reached.sum() < 24 and np.ptp(found.pose[found.reached, 3:]) > 0.2
    for i in np.flatnonzero(found.reached)[::2]:
        wanted = complete_state(raw, names, q[i], 0 * q[i], 0 * q[i], steps=30)[0]
        np.testing.assert_allclose(found.pose[i], wanted, atol=1e-11)


def test_a_leap_to_another_branch_is_made_in_smaller_pieces() -> None:
    """From home, Newton's steps shrink all the way to a pose on the wrong branch."""
    rng = np.random.default_rng(103)
    mechanism = parse(toml_text(random_mechanism(rng, contacts=3, chains=9, surface="cylinder")))
    way = np.linspace(0, 1, 200)[:, None] * [-0.01644455, 0.01753188, 0.13332819]
    found = of_coordinates(mechanism, independent_coordinates(mechanism)).solve(
        way, 0 * way, 0 * way
    )
    assert found.reached.all() and off(mechanism, found.pose) < 1e-15
    assert np.abs(np.diff(found.pose, axis=0)).max() < 0.05


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
    size = [0.0005 if name in "XYZ" else 0.01 for name in names]
    q = np.random.default_rng(0).uniform(-1, 1, (100, 3)) * size
    found = of_coordinates(mechanism, names).solve(q, q, q)
    assert found.reached.all() and off(mechanism, found.pose) < 1e-15


def test_a_pose_out_of_reach_is_not_a_number_and_alone() -> None:
    closure = of_coordinates(drawn(2)[1], ["Y", "Z", "alpha", "beta"])
    good = np.array([[0.001, 0.002, 0.01, -0.02]])
    some = np.vstack([good, [[0.0, 5.0, 0.0, 0.0]], good])
    alone, together = closure.solve(good, good, good), closure.solve(some, some, some)
    assert together.reached.tolist() == [True, False, True]
    for name in ("pose", "rate", "acceleration"):
        got = getattr(together, name)
        assert np.isnan(got[1]).all()
        np.testing.assert_array_equal(got[[0, 2]], getattr(alone, name)[[0, 0]])
    nearly = np.diag([1.0, 1, 1, 1, 1, 1e-17]) + 1e-3
    b = np.arange(12.0).reshape(2, 6)
    both = least_squares(np.stack([nearly, np.zeros((6, 6))]), b[..., None])
    np.testing.assert_array_equal(both[0], least_squares(nearly[None], b[:1, :, None])[0])
    assert np.isfinite(both[0]).all() and np.isnan(both[1]).all()


def test_six_coordinates_are_a_pose_where_no_contact_is() -> None:
    closure = of_coordinates(condyle.load_mechanism("gough-stewart"), COORDINATES)
    s, s1, s2 = 0.1 * np.arange(36.0).reshape(3, 2, 6) / 36
    found = closure.solve(s, s1, s2)
    assert found.reached.all()
    np.testing.assert_array_equal([found.pose, found.rate, found.acceleration], [s, s1, s2])


def test_what_does_not_determine_the_pose(reference: Mechanism) -> None:
    for names, message in (
        ([], "got none; the mechanism has 4 degrees of freedom"),
        (["X", "Y", "alpha"], "got the 3 coordinates.*4 degrees of freedom.*X,Y,alpha,beta"),
        (["X", "Z", "alpha", "beta"], "not independent.*do not determine Y, gamma"),
    ):
        with pytest.raises(InputError, match=message):
            of_coordinates(reference, names)
    with pytest.raises(InputError, match=r'no landmark "incisors".*Did you mean "incisor"'):
        of_landmark(reference, "incisors")
    with pytest.raises(InputError, match=r"two contacts; this mechanism has 0"):
        of_landmark(reference.replace(contacts=()), "incisor")


# -- landmarks -----------------------------------------------------------------------------


def paths(size: float) -> tuple[np.ndarray, ...]:
    """Displacements of a landmark [m] with rates, the fourth condition at rest."""
    rng = np.random.default_rng(2)
    s = np.hstack([rng.uniform(-size, size, (COUNT, 3)), np.zeros((COUNT, 1))])
    return s, rng.normal(0, 0.1, (COUNT, 4)), rng.normal(0, 1, (COUNT, 4))


def kernel_alone(closure: Closure, s: np.ndarray, s1: np.ndarray, s2: np.ndarray) -> tuple:
    answer = closure.kernel.run({"s": s, "s1": s1, "s2": s2})
    return [answer.values[name].T for name in MOTION], answer.status


@pytest.mark.parametrize(
    ("surface", "size"),
    first([("bundled", 0.006), ("sphere", 0.002), ("plane", 0.03), ("ellipsoid", 0.006)], 2),
)
def test_what_a_landmarks_kernel_vouches_for(surface: str, size: float) -> None:
    """It is what following from home finds; the rest is flagged. Rates are slopes of the path."""
    m = condyle.load_mechanism("masticatory-curved")
    if surface != "bundled":
        m = parse(toml_text(random_mechanism(np.random.default_rng(12), surface=surface)))
    landmark = "incisor" if surface == "bundled" else next(iter(m.platform.points))
    given, closure = paths(size), of_landmark(m, landmark)
    with np.errstate(all="ignore"):
        found, status = kernel_alone(closure, *given)
        wanted = following.landmark_closure(m, landmark).solve(*given)
        whole = closure.solve(*given)
    sure, reached = status == 0, wanted.reached
    assert set(status) <= {0, AGAIN} and reached[sure].all()
    if size < 0.01:
        assert sure.mean() > 0.2
    for got, right in zip(found, (wanted.pose, wanted.rate, wanted.acceleration), strict=True):
        scale = np.abs(right[sure]).max(initial=1.0)
        assert np.abs(got - right)[sure].max(initial=0) < 1e-9 * scale
    np.testing.assert_array_equal(whole.reached, reached)
    assert np.isnan(whole.pose[~reached]).all()
    np.testing.assert_allclose(whole.pose[reached], wanted.pose[reached], atol=1e-11)
    s, s1, s2 = (a[:50] * [1, 1, 1, 0] for a in given)
    h, found = 1e-4, closure.solve(s, s1, s2)
    path = [closure.solve(s + s1 * t + s2 * t * t / 2, s1, s2).pose for t in (-h, 0.0, h)]
    good = np.isfinite(path).all(axis=(0, 2)) & found.reached
    close(found.rate[good], (path[2] - path[0])[good] / (2 * h), 1e-4)
    close(found.acceleration[good], (path[2] - 2 * path[1] + path[0])[good] / h**2, 1e-3)


def test_the_reference_path_is_certified_by_the_kernel(
    monkeypatch: pytest.MonkeyPatch, compiler_command: object
) -> None:
    """Not one sample has to be followed from home; the compiled kernel says the same."""
    given = [a[:100] for a in paths(0.006)]
    m = condyle.load_mechanism("masticatory")
    closures = [
        Closure.of(m, landmark="incisor", backend=Backend(b)) for b in ("numpy", "compiled")
    ]
    (wanted, status), (found, compiled) = (kernel_alone(c, *given) for c in closures)
    np.testing.assert_array_equal(status, compiled)
    for a, b in zip(wanted, found, strict=True):
        close(b[status == 0], a[status == 0], 1e-12)
    monkeypatch.setattr(
        FollowedClosure, "solve", lambda *given: pytest.fail("a sample was followed")
    )
    motion = condyle.reference_motion()
    assert motion.kind == "landmark" and motion.landmark == "incisor"
    (q, _, _), _ = shared("masticatory").poses.of_motion(motion)
    assert np.isfinite(q).all() and np.ptp(q, axis=0).max() > 0.05


def test_a_landmark_is_led_and_the_midpoint_keeps_its_y(reference: Mechanism) -> None:
    s = np.random.default_rng(5).uniform(-1, 1, (40, 4)) * [0.002, 0.002, 0.01, 0]
    found = of_landmark(reference, "incisor").solve(s, s, s)
    middle = np.mean([c.point for c in reference.contacts], axis=0)
    incisor = np.array(reference.platform.points["incisor"])
    assert found.reached.all() and off(reference, found.pose) < 1e-12
    for sample, pose, rate in zip(s, found.pose, found.rate, strict=True):
        motion = platform_motion(pose, rate)
        np.testing.assert_allclose(motion.point(incisor)[0] - incisor, sample[:3], atol=1e-15)
        np.testing.assert_allclose(motion.point(incisor)[1], sample[:3], atol=1e-15)
        assert abs(motion.point(middle)[0][1] - middle[1]) < 1e-15
