"""Loops that `check_gains` calls stable or unstable are so in simulation: some of the 200."""

from __future__ import annotations

import pytest

import condyle
from benchmarks.loops import grid, outcome, path, scenario
from condyle.model.model import Model

SAMPLE = [*(("bite_force", food, delay) for food in ("firm_bolus", "chow") for delay in "24")]
SAMPLE += [("hybrid", "chow", "2"), ("hybrid", "chow", "4")]


@pytest.mark.ci
@pytest.mark.parametrize("law, food, delay", SAMPLE)
def test_what_is_said_of_a_loop_is_what_it_does(
    jaw: Model, law: str, food: str, delay: str
) -> None:
    names = (law, "none", "none", food, delay)
    assert names in set(grid()) and len(set(grid())) == 200
    tables, motion = scenario(*names), path()
    stable = condyle.check_gains(jaw, tables, motion=motion).stable
    assert stable == (delay == "2")
    assert (outcome(jaw, tables, motion)[0] == "calm") == stable


@pytest.mark.ci
@pytest.mark.parametrize(
    "law, food, stable", [("joint_pd", "chow", None), ("computed_torque", "firm_bolus", True)]
)
def test_a_rate_that_still_acts_after_touchdown_is_not_judged(
    jaw: Model, law: str, food: str, stable: bool | None
) -> None:
    """One of nine loops of the 200 that were called stable, and swing at this rate."""
    tables, motion = scenario(law, "none", "effort_rate", food, "1"), path()
    report = condyle.check_gains(jaw, tables, motion=motion)
    assert report.stable is stable and all(point.stable for point in report.points)
    assert bool(report.gaps) is (stable is None)
