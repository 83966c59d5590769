"""The observer of state and load in closed loop: how right, how sure, and its exported C."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from export.test_functions import Library
from scipy.stats import chi2

import condyle
from condyle.errors import ScenarioError
from condyle.export import export
from condyle.model.model import Model

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("compiler_command")]

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
    s = np.clip(t / 0.15, 0, 1)
    fall = 1 - s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
    return condyle.Motion.from_arrays(
        t, {"X": 0 * t, "Y": 0 * t, "alpha": 0 * t, "beta": 0.08 * fall}
    )


@pytest.fixture(scope="module")
def runs(jaw: Model) -> list[xr.Dataset]:
    seeds = [SCENARIO | {"sensors": {"encoder_noise": NOISE, "seed": i}} for i in range(1, 9)]
    return condyle.simulate(jaw, seeds, motion=closing())


def test_a_bite_is_estimated_and_the_filter_is_consistent(
    runs: list[xr.Dataset], jaw: Model
) -> None:
    """50 N within 2 N 20 ms after contact; innovations within the band of their chi-square."""
    surprise, freedoms = [], runs[0].sizes["independent"]
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


def test_exported_c_says_the_same_tick_by_tick(
    runs: list[xr.Dataset], jaw: Model, tmp_path: Path
) -> None:
    run = runs[0]
    machine = jaw.mechanism
    filter_ = Library(export(machine, ("kalman",), prefix="jaw"), tmp_path)
    size, length = run.sizes["estimated"], jaw.characteristic_length
    scale = [length if n in "XYZ" else 1.0 for n in jaw.independent]
    names = list(jaw.independent)
    states = (run[n].sel(coordinate=names).values[0] for n in ("pose", "pose_rate"))
    first = np.concatenate([*states, np.zeros(3)])
    given: dict[str, Any] = {
        "period": 1e-3, "encoder_std": NOISE, "force_std": WALK,
        "acceleration_std": 0.1 * np.array(scale), "estimate_before": first,
        "load_point": machine.platform.points["right_molar"],
    }  # fmt: skip
    lower = np.tril_indices(size)
    for k in range(run.sizes["time"] - 1):
        acted = run["effort"].values[max(k - 1, 0)]
        status, found = filter_(
            "kalman", joint=run["measured_joint"].values[k], acted=acted, **given
        )
        assert status == 0
        given |= {f"{n}_before": found[n] for n in ("estimate", "covariance", "begun")}
        P = run["estimate_covariance"].values[k][lower]
        np.testing.assert_allclose(found["covariance"], P, rtol=0, atol=1e-12 * np.abs(P).max())
        for name, mine in (("q", "estimate"), ("q1", "estimate_rate"), ("force", "load_estimate")):
            right = run[mine].values
            bound = 1e-12 * np.abs(right).max()
            np.testing.assert_allclose(found[name], right[k], rtol=0, atol=bound, err_msg=name)


def test_the_loop_with_it(jaw: Model) -> None:
    """What the linearised loop says is what the simulation does."""
    for delay, stable in ((2, True), (3, False)):
        tables = SCENARIO | {"controller": SCENARIO["controller"] | {"delay": delay}}
        assert condyle.check_gains(jaw, tables, motion=closing()).stable == stable
        force = condyle.simulate(jaw, tables, motion=closing())["load_force"].values[-30:, 0, 2]
        assert (abs(force + 50).max() < 2) == stable


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"sensors": {}}, "give sensors.encoder_noise"),
        ({"sensors": {"encoder_noise": 1e-4, "velocity": "exact"}}, "sensors.velocity"),
        ({"observer": {"kind": "kalman", "point": "incisor"}}, 'measures at "right_molar"'),
        ({"observer": {"kind": "kalman", "acceleration_noise": (1.0, 2.0)}}, "one for each of"),
        ({"controller": None}, "there is no controller for it"),
    ],
)
def test_observers_that_do_not_fit(jaw: Model, tables: dict[str, Any], said: str) -> None:
    own = {k: v for k, v in (SCENARIO | tables).items() if v is not None}
    if "controller" not in own:
        own["start"] = {}
    with pytest.raises(ScenarioError, match=said):
        condyle.simulate(jaw, own)
