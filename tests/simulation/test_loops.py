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
