"""The observer of state and load in closed loop: how right, and how sure."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2
from simulation.scenarios import eased, jaw_path

import condyle
from condyle.errors import ScenarioError
from condyle.model.model import Model
from condyle.simulation import gains

pytestmark = pytest.mark.usefixtures("compiler_command")

NOISE, WALK = 1e-4, 15.0
SCENARIO: dict[str, Any] = {
    "duration": 0.3,
    "method": "rk4",
    "step": 2e-4,
    "start": {"on_motion": True},
    "controller": {"kind": "bite_force", "stiffness": 900.0, "force": 50.0},
    "sensors": {"encoder_noise": NOISE},
    "observer": {"kind": "kalman"},
    "load": [{"kind": "food", "food": "chow", "thickness": 6e-3}],
}


def closing() -> condyle.Motion:
    """From 0.08 rad open to closed within 0.15 s."""
    t = np.linspace(0, 0.3, 301)
    return jaw_path(t, beta=0.08 * (1 - eased(t / 0.15)))


@pytest.mark.ci
def test_a_bite_is_estimated_and_the_filter_is_consistent(jaw: Model) -> None:
    """50 N within 2 N 20 ms after contact; innovations within the band of their chi-square."""
    seeds = [SCENARIO | {"sensors": {"encoder_noise": NOISE, "seed": i}} for i in range(1, 9)]
    runs, surprise = condyle.simulate(jaw, seeds, motion=closing()), []
    freedoms = runs[0].sizes["independent"]
    for run in runs:
        (touched, *_) = (e["time"] for e in run.condyle.events if e["kind"] == "food_touched")
        true, found = run["load_force"].values[:, 0], run["load_estimate"].values
        late = run["time"].values > touched + 0.02
        assert late.sum() > 150 and -true[-1, 2] == pytest.approx(50.0, abs=2.0)
        assert np.sqrt(((found - true)[late] ** 2).sum(axis=1).mean()) < 2.0
        np.testing.assert_allclose(run["bite_force"], np.linalg.norm(found, axis=1), rtol=1e-12)
        surprise.append(run["innovation"].values.mean())
        off = run["measured_joint"].values - run["joint"].values
        assert np.std(off) == pytest.approx(NOISE, rel=0.1)
        # Errors are what the covariance says, over all that it estimates.
        m = freedoms
        x = np.hstack([run["estimate"], run["estimate_rate"], found])
        q = run["pose"].sel(coordinate=list(jaw.independent)).values
        q1 = run["pose_rate"].sel(coordinate=list(jaw.independent)).values
        error = (x - np.hstack([q, q1, true]))[late]
        P = run["estimate_covariance"].values[late]
        square = np.einsum("ni,ni->n", error, np.linalg.solve(P, error[..., None])[..., 0])
        assert 0.3 * (2 * m + 3) < square.mean() < 1.5 * (2 * m + 3)  # nothing wanders late
    count = freedoms * runs[0].sizes["time"]
    low, high = chi2.ppf([0.025, 0.975], count) / runs[0].sizes["time"]
    assert low < np.mean(surprise) < high


DELAYS = ((2, True), (3, False))  # periods, and whether the loop is stable


def late(delay: int) -> dict[str, Any]:
    return SCENARIO | {"controller": SCENARIO["controller"] | {"delay": delay}}


def test_gains_of_the_loop_with_it(jaw: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    """A delay of three periods is one too many, says the linearised loop."""
    monkeypatch.setattr(gains, "POINTS", 3)
    for delay, stable in DELAYS:
        assert condyle.check_gains(jaw, late(delay), motion=closing()).stable == stable


@pytest.mark.ci
def test_the_loop_with_it(jaw: Model) -> None:
    """What the linearised loop says is what the simulation does."""
    for delay, stable in DELAYS:
        force = condyle.simulate(jaw, late(delay), motion=closing())["load_force"]
        assert (abs(force.values[-30:, 0, 2] + 50).max() < 2) == stable


def test_observers_that_do_not_fit(plain: Model) -> None:
    for tables, said in (
        ({"sensors": {}}, "give sensors.encoder_noise"),
        ({"sensors": {"encoder_noise": 1e-4, "velocity": "exact"}}, "sensors.velocity"),
        ({"observer": {"kind": "kalman", "point": "incisor"}}, 'measures at "right_molar"'),
        ({"observer": {"kind": "kalman", "acceleration_noise": (1.0, 2.0)}}, "one for each of"),
        ({"controller": {"kind": "none"}, "start": {}}, "there is no controller for it"),
    ):
        with pytest.raises(ScenarioError, match=said):
            condyle.simulate(plain, SCENARIO | tables)
