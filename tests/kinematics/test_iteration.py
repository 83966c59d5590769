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

MODEST, LARGE = (0.3, 0.02), (0.6, 0.04)  # rad and m, by which coordinates differ from home
FAR = (2.0, 0.1)
KINDS = ("quadratic", "sphere", "cylinder", "ellipsoid", "profile")
CASES = [(kind, contacts, 0.0) for contacts in (1, 2, 3) for kind in KINDS]
CASES += [("quadratic", 1, 4.0), ("quadratic", 2, 4.0), ("ellipsoid", 1, 4.0)]
FEW = ("quadratic", 1, 0.0), ("ellipsoid", 1, 4.0), ("sphere", 2, 0.0), ("profile", 3, 0.0)
COUNT = 1000


@cache
def mechanism(kind: str, contacts: int, ball: float, seed: int = 3) -> Mechanism:
    if kind == "masticatory-curved":
        return condyle.load_mechanism(kind)
    rng = np.random.default_rng(seed)
    raw = random_mechanism(rng, contacts=contacts, surface=kind, ball_radius=ball)
    return parse(toml_text(raw))


def function(m: Mechanism) -> ca.Function:
    """q -> X_EE and reach."""
    q = ca.SX.sym("q", 6 - len(m.contacts))
    length = ca.SX(characteristic_length(m))
    placement = newton(contacts_of(m), dependent_coordinates(m), q, length)
    reach = ca.SX(1) if placement.discriminant is None else placement.discriminant
    return ca.Function("newton", [q], [placement.pose(), reach])


def drawn(m: Mechanism, size: tuple[float, float], count: int) -> np.ndarray:
    names = independent_coordinates(m)
    scale = [size[1] if name in "XYZ" else size[0] for name in names]
    return np.random.default_rng(0).uniform(-1, 1, (count, len(names))) * scale


def compared(m: Mechanism, q: np.ndarray) -> tuple[np.ndarray, Any, np.ndarray]:
    """Whether samples are accepted, what `Closure` says of them, and how far the two are apart."""
    with np.errstate(all="ignore"):
        closed = coordinate_closure(m, independent_coordinates(m)).solve(q, 0 * q, 0 * q)
        pose, reach = evaluate(function(m), q)
    return reach[:, 0] == 1, closed, np.abs(pose - closed.pose).max(axis=1)


@pytest.mark.parametrize("size", [MODEST, LARGE, FAR])
@pytest.mark.parametrize(
    ("kind", "contacts", "ball"), few([*CASES, ("masticatory-curved", 2, 0.0)], *FEW)
)
def test_what_is_accepted_is_on_the_branch_of_home(
    kind: str, contacts: int, ball: float, size: tuple[float, float]
) -> None:
    m = mechanism(kind, contacts, ball)
    accepted, closed, off = compared(m, drawn(m, size, COUNT))
    assert closed.reached[accepted].all()
    assert (off[accepted] < 1e-12).all()


@pytest.mark.parametrize(("kind", "contacts", "ball"), few(CASES, *FEW))
def test_ordinary_samples_are_accepted(kind: str, contacts: int, ball: float) -> None:
    """Poses that are near home in all six coordinates; nearer with three contacts."""
    m = mechanism(kind, contacts, ball)
    angle, length = MODEST if contacts < 3 else (0.1, 0.007)
    accepted, closed, _ = compared(m, drawn(m, (angle, length), COUNT))
    limit = np.repeat([length, angle], 3)
    with np.errstate(invalid="ignore"):
        near = (np.abs(closed.pose) <= limit).all(axis=1)
    assert near.sum() > 50
    assert accepted[near].mean() > 0.98


@pytest.mark.parametrize(("kind", "contacts"), [("quadratic", 2), ("sphere", 1), ("ellipsoid", 3)])
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300, 1e20])
def test_what_is_no_pose_is_not_accepted(kind: str, contacts: int, value: float) -> None:
    m = mechanism(kind, contacts, 0.0)
    lengths = [name in "XYZ" for name in independent_coordinates(m)]
    q = np.eye(6 - contacts)
    q[q == 1] = value
    with np.errstate(all="ignore"):
        accepted = evaluate(function(m), q)[1][:, 0] == 1
    # A turn by a large number of radians is a pose like any other.
    assert not accepted[lengths if np.isfinite(value) else slice(None)].any()


@pytest.mark.slow
def test_home_is_accepted_as_it_is() -> None:
    for kind, contacts, ball in CASES:
        pose, reach = evaluate(
            function(mechanism(kind, contacts, ball)), np.zeros((1, 6 - contacts))
        )
        assert reach[0, 0] == 1
        assert np.abs(pose).max() < 1e-13


def test_different_surfaces_at_once() -> None:
    rng = np.random.default_rng(5)
    for surface in (("quadratic", "profile"), ("plane", "quadratic"), ("sphere", "profile")):
        m = parse(toml_text(random_mechanism(rng, surface=surface)))
        accepted, closed, off = compared(m, drawn(m, MODEST, 300))
        assert (off[accepted] < 1e-12).all()
        assert accepted.sum() > 0.9 * closed.reached.sum()
