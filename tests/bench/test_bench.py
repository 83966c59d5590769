"""The benchmark's rows are checked before they are timed; times themselves are not tested."""

from __future__ import annotations

import pytest

from condyle.bench.motion import motion_rows
from condyle.bench.own import own_probes, thread_probes
from condyle.bench.rows import TOLERANCE, Probe, Row, spread, timed
from condyle.bench.run import Benchmark
from condyle.mechanism import load


def test_every_row_is_right() -> None:
    machine = load("gough-stewart")
    rows = list(timed([*own_probes(machine, ["virtual_power"]), *thread_probes(machine)], 1))
    names = [row.name for row in rows]
    for what in ("one", "one, dependent", "batch", "batch, two threads"):
        assert f"gough-stewart virtual_power: {what}" in names
    for what in ("one", "batch"):
        assert f"gough-stewart forward dynamics: {what}" in names
    assert any("straight-line C" in name for name in names)
    for row in rows:
        assert row.error < TOLERANCE, row.name
        assert row.seconds > 0


def test_a_second_of_motion_is_right() -> None:
    """Of fourth order, against an integration in steps of a fiftieth."""
    unavailable: dict[str, str] = {}
    rows = list(motion_rows("masticatory", None, unavailable))
    assert [row.name.rsplit(", ", 1)[1] for row in rows] == ["2 ms", "1 ms"]
    assert rows[0].error < 1e-6
    assert rows[1].error < rows[0].error / 10
    assert not unavailable


def test_a_wrong_row_says_so() -> None:
    right, wrong = timed([Probe("a", lambda: 1.0, 1e-12), Probe("b", lambda: 1.0, 1e-3)], 3)
    assert right.note == "" and "WRONG by 1.0e-03" in wrong.note


def test_ratios_are_taken_within_rounds() -> None:
    """A machine that becomes slower half way changes no ratio."""
    slow, quick = iter([2.0, 2.0, 9.0, 20.0, 2.0, 2.0]), iter([1.0, 1.0, 9.0, 10.0, 1.0, 1.0])
    a, b = timed([Probe("a", lambda: next(slow), 0.0), Probe("b", lambda: next(quick), 0.0)], 3)
    assert a.over(b) == 2.0


def test_median_and_spread() -> None:
    assert spread([3.0, 1.0, 2.0, 4.0, 100.0]) == (3.0, pytest.approx(50.5))


def test_table_names_what_did_not_run() -> None:
    facts = {
        "processor": "any",
        "clock": 3e9,
        "lanes": 8,
        "versions": {"condyle": "0"},
        "compiler": "cc",
        "flags": [],
    }
    text = str(Benchmark([Row("a row", 2e-7, 1e-8, 0.0, None)], {}, facts, {"peer": "no pip"}))
    assert "200.0 ns" in text and "not run: peer (no pip)" in text
