"""The loop of `condyle bench --realtime`, and the rows of exported C."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import condyle
from benchmarks import real_time, realtime
from benchmarks.exported import call, exported_probes
from condyle.export import export


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs clock_nanosleep")
def test_loops_count_every_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(realtime, "RATES", (1000,))
    found = real_time(condyle.load_mechanism("gough-stewart"), 0.05)
    empty, busy = found.loops
    assert [empty.work, busy.work] == [False, True] and empty.rate == 1000
    for loop in found.loops:
        assert loop.ticks + loop.missed >= 50
        assert 0 <= loop.within(0.5) <= loop.within(0.999) <= loop.late
        assert 0 <= loop.mean <= loop.longest
    assert "1000 Hz" in str(found) and len(str(found).splitlines()) == 4
    assert len(found.data()["loops"]) == 2


def test_shares_come_from_the_histogram() -> None:
    loop = realtime.Loop(1, True, 100, 1e-3, 0.0, 0.0, 0, (50, 49, 0, 1), True)
    assert np.isclose(loop.within(0.5), 256e-9) and np.isclose(loop.within(0.99), 512e-9)
    assert np.isclose(loop.within(1.0), 2048e-9)


def test_exported_rows_are_right() -> None:
    for probe in exported_probes(condyle.load_mechanism("gough-stewart")):
        assert probe.error < 1e-12 and probe.run() > 0


def test_a_call_names_every_argument() -> None:
    made = export(condyle.load_mechanism("gough-stewart"), ("inverse",), prefix="h")
    assert call(made) == "h_inverse(in + 0, in + 6, in + 12, in + 18, in + 21, in + 24, out)"
