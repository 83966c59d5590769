"""Dependent coordinates by a fixed number of steps: what is accepted is what `Closure` finds."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, toml_text
from support.following import coordinate_closure
from support.speeds import few

import condyle
from condyle.kinematics.batch import evaluate
from condyle.kinematics.constraints import contacts_of
from condyle.kinematics.iteration import newton
from condyle.mechanism import Mechanism, parse
from condyle.mechanism.home import (
    characteristic_length,
    dependent_coordinates,
    independent_coordinates,
)

SIZES = {"modest": (0.3, 0.02), "large": (0.6, 0.04), "far": (2.0, 0.1)}  # rad, m, from home
CASES: dict[str, dict[str, Any]] = {
    "quadratic_k1": {"contacts": 1, "surface": "quadratic"},
    "ellipsoid_ball_k1": {"contacts": 1, "surface": "ellipsoid", "ball_radius": 4.0},
    "sphere_k2": {"contacts": 2, "surface": "sphere"},
    "profile_k3": {"contacts": 3, "surface": "profile"},
    "different": {"contacts": 2, "surface": ("quadratic", "profile")},
    "cylinder_k1": {"contacts": 1, "surface": "cylinder"},
    "quadratic_ball_k2": {"contacts": 2, "surface": "quadratic", "ball_radius": 4.0},
    "ellipsoid_k3": {"contacts": 3, "surface": "ellipsoid"},
    "with_a_plane": {"contacts": 2, "surface": ("plane", "sphere")},
    "masticatory-curved": {},
}
FEW = [*CASES][:4]
COUNT = 100


@cache
def mechanism(name: str) -> Mechanism:
    if not CASES[name]:
        return condyle.load_mechanism(name)
    return parse(toml_text(random_mechanism(np.random.default_rng(3), **CASES[name])))


@cache
def function(name: str) -> ca.Function:
    """q -> X_EE and reach."""
    m = mechanism(name)
    q = ca.SX.sym("q", 6 - len(m.contacts))
    length = ca.SX(characteristic_length(m))
    placement = newton(contacts_of(m), dependent_coordinates(m), q, length)
    reach = ca.SX(1) if placement.discriminant is None else placement.discriminant
    return ca.Function("newton", [q], [placement.pose(), reach])


@pytest.mark.parametrize("name", few(CASES, *FEW))
def test_what_is_accepted_is_on_the_branch_of_home(name: str) -> None:
    """Home as it is, and nearly all poses near home in all six coordinates."""
    m = mechanism(name)
    names, contacts = independent_coordinates(m), len(m.contacts)
    lengths = np.array([each in "XYZ" for each in names])
    closure = coordinate_closure(m, names)
    for size, (angle, length) in SIZES.items():
        if size == "modest" and contacts > 2:
            angle, length = 0.1, 0.007
        box = np.where(lengths, length, angle)
        count = COUNT * (5 if size == "modest" and contacts > 2 else 1)
        q = np.random.default_rng(0).uniform(-1, 1, (count, len(names))) * box
        with np.errstate(all="ignore"):
            closed = closure.solve(q, 0 * q, 0 * q)
            pose, reach = evaluate(function(name), q)
            near = (np.abs(closed.pose) <= np.repeat([length, angle], 3)).all(axis=1)
        accepted = reach[:, 0] == 1
        assert closed.reached[accepted].all()
        assert (np.abs(pose - closed.pose)[accepted] < 1e-12).all()
        if size == "modest" and CASES[name]:
            assert near.sum() > 5 and accepted[near].mean() > 0.98
    pose, reach = evaluate(function(name), np.zeros((1, len(names))))
    assert reach[0, 0] == 1 and np.abs(pose).max() < 1e-13


def test_what_is_no_pose_is_not_accepted() -> None:
    for name in ("sphere_k2", "ellipsoid_ball_k1", "profile_k3"):
        lengths = [each in "XYZ" for each in independent_coordinates(mechanism(name))]
        for value in (np.nan, np.inf, 1e300, 1e20):
            q = np.eye(len(lengths))
            q[q == 1] = value
            with np.errstate(all="ignore"):
                accepted = evaluate(function(name), q)[1][:, 0] == 1
            # A turn by a large number of radians is a pose like any other.
            assert not accepted[lengths if np.isfinite(value) else slice(None)].any()
