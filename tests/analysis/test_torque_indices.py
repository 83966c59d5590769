"""The indices of eq. (67) by hand, and the paper's Table 2 on the reference case."""

from __future__ import annotations

import numpy as np
import pytest

import condyle
from condyle.analysis import paper
from condyle.analysis.comparison import Comparison
from condyle.analysis.torque_indices import indices

pytestmark = pytest.mark.slow

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


@pytest.mark.parametrize("contacts", [True, False], ids=["RAPM", "6RSS"])
@pytest.mark.parametrize("part", paper.TABLE_2)
def test_table_2_within_a_fifth(reference: Comparison, contacts: bool, part: str) -> None:
    published = paper.TABLE_2 if contacts else paper.TABLE_2_FREE
    (found,) = reference.indices(contacts)
    assert found.unit == "N m"
    assert found.samples == 5001
    assert found.values[part] == pytest.approx(published[part], rel=0.2)


def test_table_2_does_not_depend_on_the_model(comparison: Comparison) -> None:
    (first,) = comparison.indices()
    share, parts, units = (comparison.solution[n].values for n in ("share", "part", "effort_unit"))
    (again,) = indices(share, list(parts), list(units))
    assert first.values == pytest.approx(again.values, rel=1e-12)
    assert first.values["all"] == pytest.approx(0.0209, abs=1e-4)


def test_totals_as_printed() -> None:
    printed = {"momentum direct": 35.861, "lagrange direct": 61.265, "momentum core": 8.582}
    printed["lagrange core"] = 10.041
    totals = {" ".join(key): seconds.total for key, seconds in paper.TABLE_1.items()}
    assert totals == pytest.approx(printed)
    free = {name: seconds.total for name, seconds in paper.TABLE_1_FREE.items()}
    assert free == pytest.approx({"momentum": 7.258, "lagrange": 10.018})


def test_percentages_as_printed() -> None:
    saved = {p: 1 - v / paper.TABLE_2_FREE[p] for p, v in paper.TABLE_2.items() if p != "all"}
    printed = {"platform": 0.7232, "couplers": 0.5294, "cranks": 0.0909}
    assert saved == pytest.approx(printed, abs=5e-5)


def test_what_may_stand_beside_the_paper() -> None:
    mechanism = condyle.load_mechanism("masticatory")
    assert paper.is_paper_class(mechanism) and paper.is_stand_in(mechanism)
    other = mechanism.replace(gravity=(0, 0, -1.62))
    assert paper.is_paper_class(other) and not paper.is_stand_in(other)
    for contacts in ((), mechanism.contacts[:1]):
        assert not paper.is_paper_class(mechanism.replace(contacts=contacts, dependent=None))


def test_what_is_synthetic() -> None:
    assert paper.is_synthetic(condyle.reference_motion().source)
    assert paper.is_synthetic("/anywhere/condyle/motion/data/bite-force.csv")
    assert not paper.is_synthetic("recordings/bite-force.csv")
