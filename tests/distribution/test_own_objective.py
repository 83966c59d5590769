"""A class with its cost is all that an objective needs, from outside the package too."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from scipy.optimize import minimize
from support.machines import model
from support.pages import module_of

import condyle
from condyle.cli import completion
from condyle.distribution import OBJECTIVES, distribute
from condyle.mechanism.chain import limits
from distribution.cases import random_problem

Q = np.array([1e-3, 0.0, 0.01, 0.1])
STILL = np.zeros(4)
FORCE = np.array([0.0, 0.0, -30.0, 0.0, 0.0, 0.0])


@pytest.fixture(autouse=True)
def _added() -> Iterator[None]:
    module_of("how-to/extend.md", "Quartic")
    yield
    del OBJECTIVES["quartic"]


def efforts(own: Any, force: np.ndarray = FORCE) -> np.ndarray:
    answer = own.inverse_dynamics(Q, STILL, STILL, force, np.zeros(3))
    assert answer.status == 0
    return np.asarray(answer.effort)


def test_efforts_are_least() -> None:
    """No step that leaves the balance as it is makes the sum of fourth powers less."""
    first = model("masticatory")
    own = first.with_distribution("quartic")  # type: ignore[arg-type]
    least, square = efforts(own), efforts(first)
    greatest = np.array([limits(chain).greatest for chain in own.mechanism.chains])
    # Efforts of a balance differ by what leaves the generalised force as it is.
    rows = np.array([efforts(first, FORCE + one) for one in 3 * np.eye(6)]) - square
    free = np.linalg.svd(rows)[2][4:]
    found = minimize(
        lambda y: np.sum(((square + y @ free) / greatest) ** 4),
        np.zeros(len(free)),
        method="BFGS",
        options={"gtol": 1e-14},
    )
    np.testing.assert_allclose(least, square + found.x @ free, atol=1e-4 * abs(square).max())
    assert np.sum((least / greatest) ** 4) < 0.999 * np.sum((square / greatest) ** 4)


def test_kernels_minimise_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nearly all samples, by the inverse of its slope; efforts are those of the robust solver."""
    problem = random_problem(np.random.default_rng(3), 9, 3, 60, tight=1.0)
    wanted = distribute(problem, "quartic", None)
    solver = import_module("condyle.distribution.distribute")
    alone = Mock(wraps=solver._alone)
    monkeypatch.setattr(solver, "_alone", alone)
    found = distribute(problem, "quartic", "numpy")
    assert alone.call_count < 5 and not wanted.status.any() and not found.status.any()
    atol = 1e-9 * abs(wanted.effort).max()
    np.testing.assert_allclose(found.effort, wanted.effort, atol=atol)


def test_derivatives_are_differences() -> None:
    own = model("masticatory").with_distribution("quartic")  # type: ignore[arg-type]
    step = np.array([0, 0, 1e-3, 0, 0, 0])
    given = {"q": Q, "v": STILL, "a": STILL, "wrench": FORCE}
    found = own.derivatives("effort", "wrench", **given)
    wanted = (efforts(own, FORCE + step) - efforts(own, FORCE - step)) / 2e-3
    got = np.asarray(found["effort", "wrench"])[:, 2]
    np.testing.assert_allclose(got, wanted, atol=1e-6 * abs(wanted).max())


def test_it_appears_where_objectives_appear() -> None:
    assert "quartic" in completion.listed("distribution")
    assert "fourth powers of activations" in completion.choices_text("distribution")
    with pytest.raises(condyle.InputError, match='Did you mean "quartic"'):
        condyle.derive("masticatory", distribution="quartik")  # type: ignore[arg-type]
    still = {name: np.zeros(6) for name in ("X", "Y", "alpha", "beta")}
    motion = condyle.Motion.from_arrays(np.linspace(0.0, 1.0, 6), still)
    own = model("masticatory").with_distribution("quartic")  # type: ignore[arg-type]
    assert "by distribution quartic" in own.solve(motion)["effort"].attrs["long_name"]
