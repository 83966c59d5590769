"""The benchmark's rows are checked before they are timed; times themselves are not tested."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from distribution.cases import random_problem

from benchmarks import own
from benchmarks.motion import motion_rows
from benchmarks.own import Case, Timer, own_probes, thread_probes
from benchmarks.peers.solvers import SOLVERS
from benchmarks.programs import Bites, _arguments, program_probes, tight
from benchmarks.rows import TOLERANCE, Probe, Row, spread, timed
from benchmarks.run import Benchmark
from benchmarks.slopes import slope_probes, slope_ratios
from condyle.distribution import distribute
from condyle.distribution.eliminated import Sample
from condyle.mechanism import load_mechanism
from condyle.model.model import Model


def test_every_row_is_right(monkeypatch: pytest.MonkeyPatch) -> None:
    """A row is timed long after it was made: C must not read columns that are gone."""
    made: list[weakref.ref[np.ndarray]] = []

    def columns(a: np.ndarray) -> np.ndarray:
        found = np.array(a, order="F")
        made.append(weakref.ref(found))
        return found

    monkeypatch.setattr(own.np, "asfortranarray", columns)
    machine = load_mechanism("gough-stewart")
    probes = [*own_probes(machine, ["virtual_power"]), *thread_probes(machine)]
    gc.collect()
    assert made and all(ref() is not None for ref in made)
    rows = list(timed(probes, 1))
    names = [row.name for row in rows]
    for what in ("one", "one, dependent", "batch", "batch, two threads"):
        assert f"gough-stewart virtual_power: {what}" in names
    for what in ("one", "batch"):
        assert f"gough-stewart forward dynamics: {what}" in names
    assert any("straight-line C" in name for name in names)
    for row in rows:
        assert row.error < TOLERANCE, row.name
        assert row.seconds > 0


@pytest.mark.ci
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
    facts = {"processor": "any", "clock": 3e9, "lanes": 8, "versions": {"condyle": "0"}}
    facts |= {"compiler": "cc", "flags": []}
    text = str(Benchmark([Row("a row", 2e-7, 1e-8, 0.0, None)], {}, facts, {"peer": "no pip"}))
    assert "200.0 ns" in text and "not run: peer (no pip)" in text


@pytest.mark.parametrize("name", ["DAQP", "quadprog", "HiGHS", "OSQP"])
def test_other_solvers_are_given_the_same_program(name: str) -> None:
    problem = random_problem(np.random.default_rng(3), 6, 2, 4, one_sided=True, tight=0.8)
    wanted = distribute(problem, "bounded")
    for i in np.flatnonzero(wanted.status == 0):
        one = Sample.of(problem, int(i), np.zeros(2), np.ones(6), 0.0, True)
        assert one is not None
        try:
            got = one.unit * SOLVERS[name](*_arguments(one))
        except ImportError as missing:
            pytest.skip(f"{missing.name} is not installed")
        size = np.abs(wanted.effort[i]).max()
        np.testing.assert_allclose(got, wanted.effort[i], atol=1e-5 * size)
    assert (wanted.status == 0).any()


def test_solvers_that_are_missing_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows beside others, where some are missing; ours is always there."""

    def missing(*_: object) -> None:
        raise ImportError("no solver here")

    some = {"DAQP": SOLVERS["DAQP"], "none": missing}
    monkeypatch.setattr("benchmarks.programs.SOLVERS", some)
    model = Model(
        tight(load_mechanism("masticatory"), 0.2), backend="numpy", distribution="bounded"
    )
    given = Case.of(model.mechanism).many(40)
    unavailable: dict[str, str] = {}
    probes = list(program_probes(Bites("some", model, given), unavailable))
    assert [p.name.rpartition(", ")[2] for p in probes[1:]] == ["DAQP"]
    assert unavailable == {"none": "no solver here"}
    assert all(p.error < p.tolerance and p.run() > 0 for p in probes)


def test_the_command_outside_a_checkout(
    condyle_command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """An installed package has no engine to run."""
    monkeypatch.setattr("condyle.cli.upkeep.__file__", str(tmp_path / "a" / "b" / "c" / "bench.py"))
    outcome = condyle_command("bench")
    assert outcome.status == 2 and "part of the repository" in outcome.err


@pytest.mark.ci
def test_rows_of_derivatives_are_right() -> None:
    """Against CasADi's Jacobian of its own C, and JAX's derivatives of the graph traced anew."""
    probes = list(slope_probes(load_mechanism("masticatory"), Timer(), {}))
    rows = {row.name: row for row in timed(probes, 1)}
    assert max(row.error for row in rows.values()) < TOLERANCE
    ratios = slope_ratios("masticatory", rows)
    assert len(ratios) >= 4 and all(value > 0 for value in ratios.values())
