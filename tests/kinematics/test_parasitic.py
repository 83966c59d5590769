"""Closed-form parasitic motion: the paper's eq. (6), and any two planes against Newton."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, toml_text
from support.following import coordinate_closure
from support.interpreter import closure_function

import condyle
from condyle.kinematics.batch import evaluate
from condyle.mechanism import Mechanism, parse
from condyle.mechanism.home import (
    condition_of,
    constraint_jacobian,
    independent_coordinates,
    usable_sets,
)
from condyle.questions.numbers import require_closed_form

ANGLES = {"alpha", "beta", "gamma"}
COUNT = 20


def samples(rng: np.random.Generator, mechanism: Mechanism, size: float) -> tuple[np.ndarray, ...]:
    """q, q', q'' within size * (40 mm, 0.7 rad), (COUNT, m) each."""
    names = independent_coordinates(mechanism)
    unit = np.array([0.7 if name in ANGLES else 0.04 for name in names])
    q = rng.uniform(-size, size, (COUNT, len(names))) * unit
    return q, *(rng.normal(0, 3, (2, COUNT, len(names))) * unit)


def test_equation_6_of_the_paper(reference: Mechanism) -> None:
    """gamma = -atan(s(alpha) / (p1 c(beta) + c(alpha) s(beta))), and Z from either contact."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-1, 1, (50, 4)) * [0.01, 0.01, 0.4, 0.4]
    pose, _, _, reach = evaluate(closure_function(reference), q, q, q)
    X, _, alpha, beta = q.T
    p1, p2 = -1.1, 0.013215
    gamma = -np.arctan(np.sin(alpha) / (p1 * np.cos(beta) + np.cos(alpha) * np.sin(beta)))
    assert (reach > 0).all()
    np.testing.assert_allclose(pose[:, 5], gamma, atol=1e-14)
    np.testing.assert_array_equal(pose[:, [0, 1, 3, 4]], q)
    x, y, z = reference.contacts[0].point
    sb, cb, sa, ca = np.sin(beta), np.cos(beta), np.sin(alpha), np.cos(alpha)
    sg, cg = np.sin(gamma), np.cos(gamma)
    ball_x = X + cb * cg * x - cb * sg * y + sb * z
    lift = (ca * -sb * cg + sa * sg) * x + (ca * sb * sg + sa * cg) * y + ca * cb * z
    np.testing.assert_allclose(pose[:, 2], p1 * ball_x + p2 - lift, atol=1e-15)
    assert np.ptp(pose[:, 5]) > 0.2
    free = reference.replace(contacts=())  # then the pose is given
    given = rng.normal(0, 1, (3, 7, 6))
    for got, wanted in zip(evaluate(closure_function(free), *given)[:3], given, strict=True):
        np.testing.assert_array_equal(got, wanted)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "contacts"), [(0, 1), (1, 2)])
def test_any_planes_and_any_set_agree_with_newton(seed: int, contacts: int) -> None:
    """Two independent ways to the same pose, rate and acceleration, also far from home."""
    rng = np.random.default_rng(seed)
    drawn = parse(toml_text(random_mechanism(rng, contacts=contacts, spread=2.0)))
    compared = 0
    for dependent in usable_sets(drawn):
        condition = condition_of(constraint_jacobian(drawn), dependent)
        if len(ANGLES & set(dependent)) > 1 or condition > 30:
            continue
        mechanism = drawn.replace(dependent=dependent)
        require_closed_form(mechanism)
        q, q1, q2 = samples(rng, mechanism, 0.3 / condition**0.5)
        *closed, reach = evaluate(closure_function(mechanism), q, q1, q2)
        newton = coordinate_closure(mechanism, independent_coordinates(mechanism)).solve(q, q1, q2)
        both = (reach[:, 0] > 0) & newton.reached
        # Newton reaches what the closed form does, but where the way from home leaves the planes.
        assert not (newton.reached & ~both).any()
        compared += both.sum()
        theirs = (newton.pose, newton.rate, newton.acceleration)
        for got, wanted in zip(closed, theirs, strict=True):
            scale = np.abs(wanted[both]).max(axis=1, initial=1.0, keepdims=True)
            # Near the end of the reach everything is steep; its square root is the distance.
            steep = 1 / np.minimum(reach[both], 1.0) ** 2
            assert (np.abs(got[both] - wanted[both]) < 1e-12 * condition * steep * scale).all()
    assert compared > 50


def test_however_far_both_are_on_the_branch_of_home() -> None:
    """Angles up to 90 degrees, also where the way from home leaves the planes."""
    seed = 2
    drawn = parse(toml_text(random_mechanism(np.random.default_rng(seed), spread=2.0)))
    compared = 0
    for dependent in [("Z", "gamma"), ("Z", "alpha"), ("gamma", "X"), ("Z", "beta")]:
        mechanism = drawn.replace(dependent=dependent)
        q, q1, q2 = samples(np.random.default_rng(seed), mechanism, 2.2)
        pose, _, _, reach = evaluate(closure_function(mechanism), q, q1, q2)
        newton = coordinate_closure(mechanism, independent_coordinates(mechanism)).solve(q, q1, q2)
        both = newton.reached & (reach[:, 0] >= 0)
        assert both.sum() == newton.reached.sum()
        turns = (pose - newton.pose)[both, 3:] / (2 * np.pi)
        np.testing.assert_allclose(turns, turns.round(), atol=1e-9)
        np.testing.assert_allclose(pose[both, :3], newton.pose[both, :3], atol=1e-9)
        compared += both.sum()
    assert compared > 30


@pytest.mark.parametrize("contacts, dependent", [(3, None), (2, ("alpha", "gamma"))])
def test_route_direct_names_core_where_there_is_no_closed_form(
    contacts: int, dependent: tuple[str, ...] | None
) -> None:
    raw = random_mechanism(np.random.default_rng(1), contacts=contacts)
    mechanism = parse(toml_text(raw)).replace(dependent=dependent)
    said = f"This mechanism has {contacts}.*Use route core"
    with pytest.raises(condyle.UnsupportedError, match=said):
        condyle.derive(mechanism, route="direct")
    condyle.derive(mechanism, route="core")
