"""Every formulation by every route gives the same numbers, and those of an independent engine."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, toml_text
from support.loads import load_point_of, parts, with_point
from support.machines import model
from support.speeds import first, slow

import condyle
from condyle import InputError, UnsupportedError
from condyle.dynamics import FORMULATIONS, ROUTES
from condyle.mechanism import parse
from condyle.status import Status

REFERENCE = json.loads((Path(__file__).parents[1] / "oracles" / "reference_cases.json").read_text())
CASES = {key: np.array([case[key] for case in REFERENCE["cases"]]) for key in REFERENCE["cases"][0]}
NAMES = REFERENCE["coordinates"]
KEYS = {
    "effort": "tau", "contact_force": "contact", "pose": "pose", "pose_rate": "pose_d",
    "pose_acceleration": "pose_dd", "joint_rate": "theta_d", "joint_acceleration": "theta_dd",
}  # fmt: skip


def meets(got: np.ndarray, key: str) -> None:
    """To 1e-9 of the largest component of each case."""
    size = np.abs(CASES[key]).max(axis=1, keepdims=True)
    assert (np.abs(got - CASES[key]) < 1e-9 * size).all(), key


def solved(formulation: str, route: str) -> Any:
    by = model("masticatory", formulation=formulation, route=route)
    assert list(by.independent) == NAMES
    force = np.hstack([CASES["F"], np.zeros_like(CASES["F"])])
    load = with_point(force, load_point_of(by, REFERENCE["load_point"]))
    return by.inverse_dynamics(CASES["q"], CASES["qd"], CASES["qdd"], *parts(load), outputs="all")


@pytest.mark.parametrize("formulation", first(FORMULATIONS, 2, rest=slow))
def test_every_model_meets_the_reference_cases(formulation: str) -> None:
    """And shares are those of the paper's formulation."""
    share = solved("momentum", "core").share
    for route in ROUTES:
        found = solved(formulation, route)
        for name, key in KEYS.items():
            meets(getattr(found, name), key)
        for name, key in {"joint": "theta", "beta": "beta_i", "gamma": "gamma_i"}.items():
            meets(getattr(found.configuration, name), key)
        size = np.abs(share).max(axis=(1, 2), keepdims=True)
        assert (np.abs(found.share - share) < 1e-10 * size).all()


def test_the_command_meets_the_reference_cases(condyle_command: Callable[..., Any]) -> None:
    header = [p + name for p in ("", "d", "dd") for name in NAMES] + ["Fx", "Fy", "Fz"]
    rows = np.hstack([CASES[key] for key in ("q", "qd", "qdd", "F")])
    with open("states.csv", "w", newline="") as file:
        csv.writer(file).writerows([header, *rows.tolist()])
    words = "solve masticatory --states states.csv --out out.csv --load-point right_molar"
    outcome = condyle_command(*f"{words} --formulation lagrange --route direct".split())
    assert outcome.status == 0, outcome.err
    with open("out.csv", newline="") as file:
        columns, *found = list(csv.reader(file))
    table = np.array(found, dtype=float)
    assert table.shape == (len(rows), 20)
    for at, end, key in ((0, 6, "tau"), (6, 8, "contact"), (8, 14, "pose"), (14, 20, "theta")):
        meets(table[:, at:end], key)
    assert columns[0] == "tau_temporalis_left" and columns[19] == "joint_pterygoid_right"


@pytest.fixture(scope="module")
def crank() -> tuple[np.ndarray, ...]:
    """Motions nearer and nearer to a stretched crank, and the load."""
    by, low, high = model("masticatory", formulation="momentum", route="core"), 0.0, 0.05
    while low < (middle := (low + high) / 2) < high:  # to the end of the reach along X
        reached = by.inverse_kinematics([middle, 0, 0, 0]).status != Status.unreachable
        low, high = (middle, high) if reached else (low, middle)
    q = np.zeros((9, 4))
    q[:, 0] = low * (1 - 10.0 ** -np.arange(1, 10))
    load = with_point(np.full((9, 6), 0.3), load_point_of(by, None))
    return q, q * [1, 0, 0, 0] + 0.01, q + 0.1, *parts(load)


@pytest.mark.parametrize("formulation", first(FORMULATIONS, 2, rest=slow))
def test_near_crank_singularities(formulation: str, crank: tuple[np.ndarray, ...]) -> None:
    """Towards a stretched crank the loss is rounding over the transmission's sine, no more.

    Of root = h - k^2 about eps is lost, so that its square root s, and all that is divided by it,
    loses eps / s^2.
    """
    by = model("masticatory", formulation="momentum", route="core")
    wanted = by.inverse_dynamics(*crank, outputs="configuration")
    sine = np.abs(wanted.configuration.singularity.transmission).min(axis=1)
    assert sine[0] > 0.1 and sine[-1] < 1e-4
    got = model("masticatory", formulation=formulation, route="core").inverse_dynamics(*crank)
    error = np.abs(got.effort - wanted.effort).max(axis=1)
    assert (error < 1e-13 / sine**2 * np.abs(wanted.effort).max(axis=1)).all()


def test_the_choice_of_dependent_coordinates_is_free() -> None:
    """Another choice of q_EE describes the same motion, so the torques are the same."""
    usual, rng = model("masticatory"), np.random.default_rng(0)
    q, q1, q2 = rng.normal(0, 1, (3, 5, 4)) * [0.001, 0.001, 0.05, 0.05]
    load = with_point(rng.normal(0, 5, (5, 6)), load_point_of(usual, None))
    wanted = usual.inverse_dynamics(q, q1, q2, *parts(load), outputs="all")
    whole = (wanted.pose, wanted.pose_rate, wanted.pose_acceleration)
    for dependent in (("Z", "alpha"), ("gamma", "X"), ("X", "alpha")):
        other = condyle.derive(usual.mechanism.replace(dependent=dependent), backend="numpy")
        columns = [("X", "Y", "Z", "alpha", "beta", "gamma").index(n) for n in other.independent]
        free = (a[:, columns] for a in whole)
        got = other.inverse_dynamics(*free, *parts(load), outputs="all")
        assert (got.status == 0).all()
        for name in ("effort", "contact_force", "share", "joint_rate", "joint_acceleration"):
            one, right = getattr(got, name), getattr(wanted, name)
            np.testing.assert_allclose(one, right, rtol=0, atol=1e-10 * np.abs(right).max())


@pytest.mark.usefixtures("compiler_command")
def test_backends_agree_far_from_home() -> None:
    """Kernels with a fixed number of Newton steps: the branch of home, or a second look."""
    options: dict[str, Any] = {"contacts": 2, "surface": "quadratic"}
    mechanism = parse(toml_text(random_mechanism(np.random.default_rng(1), **options)))
    wanted_by, got_by = (condyle.derive(mechanism, backend=b) for b in ("numpy", "auto"))
    unit = np.array([0.006 if name in "XYZ" else 0.2 for name in wanted_by.independent])
    q = np.random.default_rng(0).uniform(-1, 1, (400, len(unit))) * unit
    wanted, got = (m.inverse_dynamics(q, q, q) for m in (wanted_by, got_by))
    np.testing.assert_array_equal(got.status, wanted.status)
    ok = wanted.status == 0
    assert 50 < ok.sum() < 400
    error = np.abs(got.effort - wanted.effort)[ok].max(axis=1)
    assert (error < 1e-9 * np.abs(wanted.effort[ok]).max(axis=1)).all()


def test_what_does_not_exist() -> None:
    jaw = condyle.load_mechanism("masticatory")
    with pytest.raises(InputError, match=r'no formulation "momentun".*Did you mean "momentum"'):
        condyle.derive(jaw, formulation="momentun")
    with pytest.raises(InputError, match=r'no route "care".*Did you mean "core"'):
        condyle.derive(jaw, route="care")
    held = random_mechanism(np.random.default_rng(3), contacts=3)
    with pytest.raises(UnsupportedError):
        condyle.derive(parse(toml_text(held)), route="direct", backend="numpy")
