"""Every formulation by every route gives the same torques, shares and contact forces."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from oracles.random_mechanism import random_mechanism, random_state, toml_text
from support.loads import load_point_of, parts, with_point
from support.speeds import few, slow

import condyle
from condyle import InputError, UnsupportedError
from condyle.dynamics import FORMULATIONS, ROUTES
from condyle.mechanism import Mechanism, parse
from condyle.model.model import Model
from condyle.model.model_result import ModelResult
from condyle.status import Status


def models(mechanism: Mechanism) -> Iterator[Model]:
    """Every combination that the mechanism allows, the paper's `momentum` by `core` first."""
    for formulation in sorted(FORMULATIONS, key=lambda name: name != "momentum"):
        for route in ROUTES:
            try:
                yield condyle.derive(
                    mechanism, formulation=formulation, route=route, backend="numpy"
                )
            except UnsupportedError:
                assert route == "direct" and len(mechanism.contacts) > 2


def difference(got: ModelResult, wanted: ModelResult) -> float:
    """Largest difference of anything, over the largest component of its kind in its sample."""
    assert (got.status == 0).all() and (wanted.status == 0).all()
    worst = 0.0
    for name in ("effort", "contact_force", "joint_rate", "joint_acceleration", "share"):
        a, b = getattr(got, name), getattr(wanted, name)
        axes = tuple(i for i in range(b.ndim) if i != b.ndim - 2)
        size = np.abs(b).max(axis=axes, initial=0)
        size = np.maximum(size, 0.1 if name == "contact_force" else 1e-9)
        worst = max(worst, (np.abs(a - b).max(axis=axes, initial=0) / size).max())
    return worst


def compare_all(mechanism: Mechanism, *states: np.ndarray, load: np.ndarray) -> int:
    first, *others = (
        model.inverse_dynamics(*states, *parts(load), outputs="all") for model in models(mechanism)
    )
    for other in others:
        assert difference(other, first) < 1e-10
    return len(others)


@pytest.mark.slow
@settings(max_examples=6, deadline=None, derandomize=True, phases=[Phase.generate])
@given(
    seed=st.integers(0, 10**6),
    chains=st.sampled_from([6, 8]),
    contacts=st.integers(0, 3),
    metres=st.booleans(),
)
def test_random_mechanisms(seed: int, chains: int, contacts: int, metres: bool) -> None:
    """In millimetres, and the same numbers in metres: a robot as tall as a tower."""
    rng = np.random.default_rng(seed)
    raw = random_mechanism(rng, chains=chains, contacts=contacts, tilted_gravity=True)
    raw["length_unit"] = "m" if metres else "mm"
    mechanism = parse(toml_text(raw))
    states = random_state(rng, raw, 4)
    load = with_point(states["wrench"], np.array(mechanism.platform.points["right_molar"]))
    compared = compare_all(mechanism, *(states[key] for key in ("q", "qd", "qdd")), load=load)
    assert compared == len(FORMULATIONS) * (2 if contacts < 3 else 1) - 1


@pytest.mark.slow
def test_the_reference_motion(reference: Mechanism) -> None:
    motion = condyle.reference_motion()
    wrench = condyle.reference_load().at(motion.t)[::25]
    model = condyle.derive(reference)
    (q, q1, q2), _ = model.poses.of_motion(motion)
    load = with_point(wrench, load_point_of(model, "right_molar"))
    compared = compare_all(reference, q[::25], q1[::25], q2[::25], load=load)
    assert compared == len(FORMULATIONS) * 2 - 1


@pytest.mark.parametrize("dependent", [("Z", "alpha"), ("gamma", "X"), ("X", "alpha")])
def test_the_choice_of_dependent_coordinates_is_free(
    reference: Mechanism, dependent: tuple[str, ...]
) -> None:
    """Another choice of q_EE describes the same motion, so the torques are the same."""
    model = condyle.derive(reference, backend="numpy")
    rng = np.random.default_rng(0)
    q, q1, q2 = rng.normal(0, 1, (3, 5, 4)) * [0.001, 0.001, 0.05, 0.05]
    load = with_point(rng.normal(0, 5, (5, 6)), load_point_of(model, None))
    wanted = model.inverse_dynamics(q, q1, q2, *parts(load), outputs="all")
    other = condyle.derive(reference.replace(dependent=dependent), backend="numpy")
    columns = [("X", "Y", "Z", "alpha", "beta", "gamma").index(n) for n in other.independent]
    whole = (wanted.pose, wanted.pose_rate, wanted.pose_acceleration)
    got = other.inverse_dynamics(*(a[:, columns] for a in whole), *parts(load), outputs="all")
    assert difference(got, wanted) < 1e-10


@pytest.mark.parametrize("backend", few(["numpy", "compiled"], "numpy", rest=slow))
def test_near_crank_singularities(reference: Mechanism, backend: str) -> None:
    """Towards a stretched crank the loss is rounding over the transmission's sine, no more.

    Of root = h - k^2 about eps is lost, so that its square root s, and all that is divided by it,
    loses eps / s^2.
    """
    wanted_by = condyle.derive(reference, formulation="momentum", route="core", backend="numpy")
    low, high = 0.0, 0.05
    for _ in range(60):  # to the end of the reach along X
        middle = (low + high) / 2
        pose = np.array([[middle, 0, 0, 0]])
        status = wanted_by.inverse_dynamics(pose, 0 * pose, 0 * pose).status[0]
        reached = status != Status.unreachable
        low, high = (middle, high) if reached else (low, middle)
    q = np.zeros((9, 4))
    q[:, 0] = low * (1 - 10.0 ** -np.arange(1, 10))
    q1, q2 = q * [1, 0, 0, 0] + 0.01, q + 0.1
    load = with_point(np.full((9, 6), 0.3), load_point_of(wanted_by, None))
    wanted = wanted_by.inverse_dynamics(q, q1, q2, *parts(load), outputs="all")
    sine = np.abs(wanted.configuration.singularity.transmission).min(axis=1)
    assert sine[0] > 0.1 and sine[-1] < 1e-4
    for formulation in FORMULATIONS if backend == "numpy" else ["virtual_power"]:
        got = condyle.derive(reference, formulation=formulation, backend=backend).inverse_dynamics(
            q, q1, q2, *parts(load), outputs="all"
        )
        error = np.abs(got.effort - wanted.effort).max(axis=1)
        error /= np.abs(wanted.effort).max(axis=1)
        assert (error < 1e-13 / sine**2).all()


@pytest.mark.usefixtures("compiler_command")
@pytest.mark.parametrize(
    "options", [{"contacts": 3}, {"contacts": 2, "surface": "quadratic"}], ids=str
)
def test_backends_agree_far_from_home(options: dict[str, Any]) -> None:
    """Kernels with a fixed number of Newton steps: the branch of home, or a second look."""
    raw = random_mechanism(np.random.default_rng(1), **options)
    mechanism = parse(toml_text(raw))
    wanted_by, got_by = (condyle.derive(mechanism, backend=b) for b in ("numpy", "auto"))
    unit = np.array([0.006 if name in "XYZ" else 0.2 for name in wanted_by.independent])
    q = np.random.default_rng(0).uniform(-1, 1, (400, len(unit))) * unit
    wanted, got = (m.inverse_dynamics(q, q, q, outputs="all") for m in (wanted_by, got_by))
    np.testing.assert_array_equal(got.status, wanted.status)
    ok = wanted.status == 0
    assert 50 < ok.sum() < 400
    error = np.abs(got.effort - wanted.effort)[ok].max(axis=1)
    assert (error < 1e-9 * np.abs(wanted.effort[ok]).max(axis=1)).all()


def test_names_that_do_not_exist(reference: Mechanism) -> None:
    with pytest.raises(InputError, match=r'no formulation "momentun".*Did you mean "momentum"'):
        condyle.derive(reference, formulation="momentun")
    with pytest.raises(InputError, match=r'no route "care".*Did you mean "core"'):
        condyle.derive(reference, route="care")
