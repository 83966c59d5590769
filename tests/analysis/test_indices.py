"""The indices of eq. (67), by hand."""

from __future__ import annotations

import numpy as np
import pytest

from condyle.analysis.torque_indices import indices

PARTS = ["platform", "legs", "load"]


def share(platform: list[list[float]], legs: list[list[float]]) -> np.ndarray:
    """Shares of two parts, and a load that must not enter."""
    return np.array([platform, legs, np.full(np.shape(platform), 1e6)], dtype=float)


@pytest.mark.parametrize("load", ["load", "bite"])  # bite: in older solutions
def test_mean_of_norms_without_the_load(load: str) -> None:
    given = share([[3, 4], [0, 0]], [[0, 0], [5, 12]])
    (found,) = indices(given, [*PARTS[:2], load], ["N m", "N m"])
    assert found.unit == "N m"
    assert found.samples == 2
    assert found.values == {"all": 9.0, "platform": 2.5, "legs": 6.5}


def test_norm_of_the_sum_not_sum_of_norms() -> None:
    (found,) = indices(share([[3, 0]], [[-3, 4]]), PARTS, ["N m", "N m"])
    assert found.values == {"all": 4.0, "platform": 3.0, "legs": 5.0}


def test_units_are_never_mixed() -> None:
    torque, force = indices(share([[3, 4, 12]], [[0, 0, 0]]), PARTS, ["N m", "N", "N m"])
    assert (torque.unit, force.unit) == ("N m", "N")
    assert torque.values["platform"] == pytest.approx(np.hypot(3, 12))
    assert force.values["platform"] == 4.0


def test_samples_without_a_result_are_left_out() -> None:
    nan = float("nan")
    (found,) = indices(share([[3, 4], [nan, nan]], [[0, 0], [0, 0]]), PARTS, ["N m"] * 2)
    assert found.samples == 1
    assert found.values["all"] == 5.0
    (none,) = indices(share([[nan, nan]], [[0, 0]]), PARTS, ["N m"] * 2)
    assert none.samples == 0
    assert np.isnan(none.values["all"])


def test_no_load_part_at_all() -> None:
    (found,) = indices(np.ones((1, 1, 4)), ["platform"], ["N"] * 4)
    assert found.values == {"all": 2.0, "platform": 2.0}
