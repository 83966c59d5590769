"""The benchmark's rows are checked before they are timed; times themselves are not tested."""

from __future__ import annotations

import pytest

from condyle.bench.own import TOLERANCE, own_rows
from condyle.bench.rows import Row, spread
from condyle.bench.run import Benchmark
from condyle.mechanism import load


def test_every_row_is_right() -> None:
    rows = list(own_rows(load("gough-stewart"), 0.01, ["virtual_power"], threads=True))
    names = [row.name for row in rows]
    for what in ("one", "one, dependent", "batch", "batch, two threads"):
        assert f"gough-stewart virtual_power: {what}" in names
    assert any("straight-line C" in name for name in names)
    for row in rows:
        assert row.error < TOLERANCE, row.name
        assert row.seconds > 0


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
