"""Limits that differ by direction, as of cables: drawn where they are, told of on their side."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import condyle
from condyle.motion import trial_motion
from condyle.report.figures import PLOTS
from condyle.report.page.page_columns import Columns, panel_data
from condyle.report.page.page_facts import alerts, chain_table
from condyle.report.panel import panels_of
from condyle.report.panel_list import effort as effort_panels
from condyle.report.panel_list import load
from condyle.view.snapshot import state_messages

LOW, HIGH = -0.0005, 0.003  # N m, of efforts from -0.001 to 0.0036
FIRST, SECOND, THIRD = "pterygoid_left", "pterygoid_right", "masseter_left"


@pytest.fixture(scope="module")
def solution() -> xr.Dataset:
    """The reference robot where one motor pushes little, and one may only pull."""
    machine = condyle.load_mechanism("masticatory").set(
        {
            f"chain.{FIRST}.actuator.torque_limit": [LOW, HIGH],
            f"chain.{SECOND}.actuator.torque_limit": [0, np.inf],
            f"chain.{THIRD}.actuator": {},
        }
    )
    return condyle.derive(machine, backend="numpy").solve(trial_motion(machine, rate=100))


def effort(solution: xr.Dataset, name: str) -> np.ndarray:
    return solution["effort"].sel(chain=name).values


def test_what_is_beyond_a_limit_is_told_of_on_its_side(solution: xr.Dataset) -> None:
    told = {(n.owner, n.bound): n for n in solution.condyle.notices if n.kind == "effort_limit"}
    first, second = effort(solution, FIRST), effort(solution, SECOND)
    wanted = {
        (FIRST, LOW): (first < LOW, first.min()),
        (FIRST, HIGH): (first > HIGH, first.max()),
        (SECOND, 0.0): (second < 0, second.min()),
    }
    wanted = {key: value for key, value in wanted.items() if value[0].any()}
    assert {(FIRST, LOW), (SECOND, 0.0)} <= set(wanted) == set(told)
    for key, (where, worst) in wanted.items():
        assert (told[key].count, told[key].value) == (where.sum(), worst)
        assert ("below its minimum" in told[key].text) == (key[1] <= 0)


def test_panels_draw_both_levels(solution: xr.Dataset) -> None:
    [panel] = effort_panels(solution)
    data = panel_data("chains", panel, Columns(solution["time"].values), {})
    found = {one["of"]: one for one in data["limits"]}
    first, second = found[(FIRST,)], found[(SECOND,)]
    assert (first["low"], first["high"]) == (LOW, HIGH)
    assert first["label"] == f"limit -0.0005 to 0.003 N m ({FIRST})"
    assert (second["low"], second["high"]) == (0.0, None)
    assert second["label"] == f"limit at least 0 N m ({SECOND})"
    assert not any(THIRD in chains for chains in found)


def test_alerts_hold_where_limits_are_exceeded(solution: xr.Dataset) -> None:
    columns = Columns(solution["time"].values)
    found = {one["text"]: one for one in alerts(solution, columns)}
    assert f"{FIRST} is beyond its effort limit" in found
    assert f"{SECOND} is beyond its effort limit" in found
    assert not any(text.startswith(THIRD) for text in found)


def test_the_table_of_peaks_names_the_limit_on_its_side(solution: xr.Dataset) -> None:
    text = str(chain_table(solution))
    peak = effort(solution, FIRST)[np.abs(effort(solution, FIRST)).argmax()]
    bound = HIGH if peak > 0 else LOW
    assert f"{peak / bound:.0%} of {abs(bound):g} N m" in text
    assert "no limit" in text
    slack = solution.copy(deep=True)
    slack["effort"].loc[{"chain": SECOND}] = -1.0
    assert "beyond at least 0 N m" in str(chain_table(slack))


def test_the_figure_draws_them(solution: xr.Dataset) -> None:
    figure = PLOTS["effort"](solution)
    levels = {
        float(np.ravel(line.get_ydata())[0])
        for axes in figure.axes
        for line in axes.get_lines()
        if line.get_linestyle() == "--" and len(np.unique(line.get_ydata())) == 1
    }
    titles = " ".join(axes.get_title("left") for axes in figure.axes)
    drawn = {level for level in (LOW, HIGH) if level in levels}
    assert drawn == {LOW, HIGH} or "limit -0.0005 to 0.003 N m" in titles
    assert 0.0 not in levels


def test_the_view_tells_of_slack(solution: xr.Dataset) -> None:
    machine = solution.condyle.mechanism
    given = np.array([0.0, 3.1, 9.0, 0.0, -0.01, -0.01])
    messages = state_messages(machine, np.full(2, np.inf), np.zeros(2), given, None)
    assert messages == [
        "temporalis_right is above its effort limit of 3",
        f"{FIRST} is below its minimum effort of -0.0005",
        f"{SECOND} is below its minimum effort of 0",
    ]


def test_a_page_has_a_load_where_there_is_one(fewer_contacts: dict[int, xr.Dataset]) -> None:
    loaded = fewer_contacts[0]
    free = loaded.assign(load=0.0 * loaded["load"])
    for solution, there in ((loaded, {"load", "moment"}), (free, set())):
        assert {p.id for _, p in panels_of(solution)} & {"load", "moment"} == there
    assert [p.id for p in load(free)] == ["load"], "the figure draws a flat line"
