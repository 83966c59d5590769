"""Designs: right values, and any rows without those before them."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest, norm

from condyle.analysis.sweep.sampling import Design
from condyle.analysis.sweep.study import Study

KINDS = ("grid", "sobol", "latin", "random", "saltelli")


def design(kind: str, count: int = 64, **first: Any) -> Design:
    vary: list[dict[str, Any]] = [
        {"what": "a", **(first or {"range": [1.0, 3.0]})},
        {"what": "b", "normal": [5.0, 2.0]},
        {"what": "c", "scale": [0.5, 1.5]},
    ]
    sampling: dict[str, Any] = {"kind": kind, "seed": 7}
    if kind == "grid":
        vary = [{**one, "count": 4} if "values" not in one else one for one in vary]
    else:
        sampling["count"] = count
    study = Study.checked({"vary": vary, "sampling": sampling}, "study")
    return Design(study.vary, study.sampling, (0.0, 0.0, -10.0))


@pytest.mark.parametrize("kind", KINDS)
def test_rows_are_the_same_in_pieces(kind: str) -> None:
    one = design(kind)
    whole = one.rows(0, one.count)
    assert whole.shape == ({"grid": 64, "saltelli": 64 * 5}.get(kind, 64), 3)
    cuts = [0, 1, 7, 8, 33, one.count]
    pieces = [one.rows(a, b) for a, b in pairwise(cuts)]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)
    assert len(np.unique(whole[:, 0])) > 3


@pytest.mark.parametrize("kind", KINDS[1:])
def test_distributions(kind: str) -> None:
    """Against the closed forms, by Kolmogorov and Smirnov at 1e-4 (seeds are fixed)."""
    one = design(kind, 512)
    rows = one.rows(0, one.count)
    assert kstest(rows[:, 0], "uniform", (1.0, 2.0)).pvalue > 1e-4
    assert kstest(rows[:, 1], norm(5.0, 2.0).cdf).pvalue > 1e-4
    assert kstest(rows[:, 2], "uniform", (-15.0, 10.0)).pvalue > 1e-4


def test_a_grid_has_its_ends_and_parts_of_equal_chance() -> None:
    rows = design("grid").rows(0, 64)
    np.testing.assert_allclose(np.unique(rows[:, 0]), [1.0, 5 / 3, 7 / 3, 3.0])
    np.testing.assert_allclose(np.unique(rows[:, 2]), [-15.0, -35 / 3, -25 / 3, -5.0])
    middle = norm(5.0, 2.0).ppf([0.125, 0.375, 0.625, 0.875])
    np.testing.assert_allclose(np.unique(rows[:, 1]), middle)


def test_values_come_as_they_are() -> None:
    for kind in KINDS:
        one = design(kind, values=[1.0, 4.0, 9.0])
        assert set(one.rows(0, one.count)[:, 0]) == {1.0, 4.0, 9.0}


def test_saltelli_exchanges_one_column_after_the_other() -> None:
    blocks = design("saltelli").rows(0, 320).reshape(64, 5, 3)
    A, B = blocks[:, 0], blocks[:, -1]
    assert (A != B).all()
    for i in range(3):
        expected = A.copy()
        expected[:, i] = B[:, i]
        np.testing.assert_array_equal(blocks[:, i + 1], expected)


def test_a_seed_decides() -> None:
    one = design("random")
    other = Design(one.vary, one.sampling.model_copy(update={"seed": 8}), one.base)
    assert (one.rows(0, 64) != other.rows(0, 64)).all()
