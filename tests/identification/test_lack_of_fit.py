"""Deviations hold in logs that are not the model's own, or what is missing is said.

Kinds of logs, and their figures over many seeds, are those of `benchmarks/identifying.py`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.speeds import few

import condyle
from benchmarks.identifying import judged, machines

pytestmark = pytest.mark.slow

# Of 16 errors over their deviations the root mean square is hardly ever beyond.
LEAST, MOST = 0.4, 2.0
SECONDS = 8.0


@pytest.mark.parametrize(
    "kind", few(["coloured", "outlying", "late", "white"], "coloured", rest=pytest.mark.ci)
)
def test_what_noise_does_is_in_the_deviations(kind: str) -> None:
    found = judged(kind, [1], SECONDS)
    assert LEAST < found.rms < MOST and not found.said and not found.unsettled


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("one late", 'delay = "channel"'),
        pytest.param("gain", "gain is off", marks=pytest.mark.ci),
        pytest.param("drag", "speed of alpha", marks=pytest.mark.ci),
    ],
)
def test_what_is_missing_is_said(kind: str, said: str) -> None:
    """And deviations are wide enough for it."""
    found = judged(kind, [1], SECONDS)
    assert found.said == 1 and found.rms < MOST
    assert any(said in words for words in found.words), found.words


def test_a_log_that_is_late_is_fitted_with_a_delay() -> None:
    found = judged("all late", [1], SECONDS)
    assert not found.unsettled and found.rms < MOST


def test_a_tilted_machine(tmp_path: Path) -> None:
    """Gravity of a log, gx .. gz, counts: by the file's alone the mass is a quarter off."""
    before, truth = machines()
    motion = condyle.trial_motion(truth, rate=250.0)
    leaning = replace(motion, gravity=np.tile([4.0, -3.0, -8.4], (len(motion.t), 1)))
    solution = condyle.derive(truth, backend="numpy").solve(leaning)
    condyle.write_log(solution, tmp_path / "log.csv", encoder_noise=1e-5, effort_noise=1e-4)
    study = {"numbers": ["platform.mass"], "noise": {"effort": 1e-4, "encoder": 1e-5}}
    known = before.set({path: truth.get(path) for path in ("platform.com",)})
    known = known.set({
        f"chain.{name}.actuator.{key}": truth.get(f"chain.{name}.actuator.{key}")
        for name in truth.chain_names for key in ("viscous", "coulomb")
    })  # fmt: skip
    (mass,) = condyle.identify(known, tmp_path / "log.csv", study).numbers
    assert abs(mass.value - 0.23) < 4 * mass.deviation < 1e-3
