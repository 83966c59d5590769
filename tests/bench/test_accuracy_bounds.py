"""Bounds hold at a few states of many machines, as `benchmarks/accuracy.py` measures them."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.accuracy import bundled, checked, drawn


def worst(machines: int, states: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = [
        row
        for name, raw in (*bundled(), *drawn(rng, machines))
        for row in checked(rng, name, raw, states, "numpy")
    ]
    over = max(rows, key=lambda row: row.ratio)
    assert over.ratio < 1, over
    assert np.median([row.slack for row in rows]) < 3e4  # 1e3 is wanted: half are next to limits


@pytest.mark.ci
def test_bounds_hold() -> None:
    worst(8, 2, seed=4)


@pytest.mark.slow
def test_bounds_hold_at_a_few_states() -> None:
    rng = np.random.default_rng(4)
    machines = dict(bundled())
    for name in ("gough-stewart", "masticatory"):
        rows = list(checked(rng, name, machines[name], 1, "numpy"))
        assert {"inverse", "forward"} < {row.question for row in rows}
        assert all(row.ratio < 1 for row in rows)
