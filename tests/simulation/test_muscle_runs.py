"""Muscles forward in time: activation as a state, what holds and what lets go."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from simulation.scenarios import TORQUE
from support.machines import model
from support.speeds import first

import condyle
from condyle.analysis.bite import opened
from condyle.kinematics.chain.muscle import MuscleState
from condyle.model.model import Model

OPEN = 0.02  # m, at the incisors
BITE = np.array([0.0, 0.0, -100.0])
RUN = {"method": "rk4", "step": 5e-4, "rate": 1000.0}
Given = Callable[..., dict[str, Any]]


@pytest.fixture(scope="module")
def muscles() -> Model:
    return model("human-jaw-muscles")


@pytest.fixture
def given(tmp_path: Path, muscles: Model) -> Given:
    """Efforts of a scenario, from rows of a table."""

    def write(head: str, *rows: tuple[float, Any]) -> dict[str, Any]:
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.csv"
        lines = [",".join(["t", *(head + name for name in muscles.mechanism.chain_names)])]
        lines += [",".join(map(repr, [t, *np.asarray(row, float).tolist()])) for t, row in rows]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return {"efforts": {"file": str(path)}}

    return write


def held(model: Model, force: np.ndarray) -> tuple[dict[str, float], np.ndarray, np.ndarray]:
    """An open jaw at rest under a force at the incisors: start, tensions, activations."""
    q = opened(model, np.array([OPEN]))[0]
    load = np.concatenate([force, np.zeros(3)])
    point = model.mechanism.platform.points["incisor"]
    tension = model.inverse_dynamics(q, 0 * q, 0 * q, load, point).effort
    at = model.kernel("instant").run({"q": q[None], "q1": 0 * q[None]}).values
    state = MuscleState.of(model.mechanism.chains, at["joint"].T, at["joint_rate"].T)
    activation = np.clip((tension - state.passive[0]) / state.active[0], 0, 1)
    return dict(zip(model.independent, q.tolist(), strict=True)), tension, activation


def test_activation_follows_excitation(muscles: Model, given: Given) -> None:
    """The published equation, written here once more and solved by SciPy."""
    start, _, a = held(muscles, BITE)
    efforts = given("excitation_", (0.0, a), (0.01, 0.6 * a), (0.015, 1.3 * a), (0.02, 1.3 * a))
    bite = {"kind": "constant", "force": BITE.tolist(), "point": "incisor"}
    scenario = {**RUN, **efforts, "duration": 0.02, "start": start, "load": [bite]}
    found = condyle.simulate(muscles, scenario)

    def excitation(t: Any) -> Any:
        return np.interp(t, [0, 0.01, 0.015], [1.0, 0.6, 1.3])

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        e = excitation(t) * a
        on, weaker = (1 + np.tanh(10 * (e - y))) / 2, 0.5 + 1.5 * y
        return (on / (0.015 * weaker) + (1 - on) * weaker / 0.060) * (e - y)

    t = found.time.values
    expected = solve_ivp(slope, (0, 0.02), a, rtol=1e-9, atol=1e-10, max_step=1e-3, t_eval=t)
    np.testing.assert_allclose(found.activation.values, expected.y.T, atol=2e-7)
    np.testing.assert_allclose(found.excitation.values, excitation(t)[:, None] * a, atol=1e-12)
    assert np.abs(found.fibre_speed.values).max() > 0.01


def test_held_as_inverse_dynamics_says(muscles: Model, given: Given) -> None:
    """By tensions and by excitations: at rest it stays, to the integrator's tolerance, which is
    relative to the largest tension."""
    start, tension, activation = held(muscles, np.zeros(3))
    scenario = {"duration": 0.005, "rate": 1000.0, "rtol": 1e-8, "start": start}
    bound = scenario["rtol"] * tension.max()
    for head, row in (("tau_", tension), ("excitation_", activation)):
        found = condyle.simulate(muscles, scenario | given(head, (0.0, row)))
        for values, wanted, off in (
            (found.effort.values, tension, bound), (found.excitation.values, activation, 1e-9),
        ):  # fmt: skip
            np.testing.assert_allclose(values, np.tile(wanted, (6, 1)), rtol=0, atol=off)
        assert np.abs(found.pose_rate.values).max() < 1e-6


@pytest.mark.parametrize("breaks", first([{"break_force": 102.0}, {"break_time": 0.0022}]))
def test_unloading(muscles: Model, given: Given, breaks: dict[str, float]) -> None:
    """A bite is let go: the muscles' force falls at once, energy is kept in the books."""
    start, _, activation = held(muscles, BITE)
    pose = muscles.inverse_kinematics(np.array(list(start.values()))).pose
    tip = np.array(muscles.mechanism.platform.points["incisor"])
    height = pose[2] - np.sin(pose[4]) * tip[0] + np.cos(pose[4]) * tip[2] - tip[2]
    bitten = {"kind": "unloading", "point": "incisor", "stiffness": 1e5, "damping": 100.0}
    bitten |= {"rest": height - 100 / 1e5, **breaks}
    scenario = {"duration": 0.005, "rate": 1000.0, "start": start, "rtol": 1e-7, "load": [bitten]}
    efforts = given("excitation_", (0.0, activation), (0.002, 1.5 * activation))
    found = condyle.simulate(muscles, scenario | efforts)
    (event,) = (e for e in found.condyle.events if e["kind"] == "broken")
    if "break_time" in breaks:
        assert event["time"] == pytest.approx(0.0022, abs=1e-9)
    else:
        assert event["force"] == pytest.approx(102.0, abs=1e-6)
    broken = found.time.values > event["time"]
    assert not found.load_force.values[broken].any()
    assert found.load_force.values[~broken, 0, 2].max() < -50.0
    assert (found.load_mode.values[:, 0] == broken).all()
    force = found.effort.values.sum(axis=1)
    assert force[broken][0] < 0.7 * force[~broken][-1]  # f_V, at once
    books = dict(zip(found.account.values.tolist(), found.energy.values.T, strict=True))
    balance = books["kinetic"] + books["potential"] - books["actuators"] - books["load"]
    np.testing.assert_allclose(balance, balance[0], atol=1e-5 * np.ptp(books["kinetic"]))


def test_held_by_a_controller(muscles: Model) -> None:
    """It asks for tensions: activations follow as fast as they can."""
    law = TORQUE | {"damping": 40.0}
    scenario = {**RUN, "duration": 0.01, "controller": law, "start": {"on_motion": True}}
    found = condyle.simulate(muscles, scenario)
    assert np.abs(found.tracking_error.values).max() < 1e-3
    assert 0 <= found.excitation.values.min() <= found.excitation.values.max() <= 1
    with pytest.raises(condyle.UnsupportedError, match="check_gains: activations of muscles"):
        condyle.check_gains(muscles, scenario)


def test_refused(muscles: Model, given: Given) -> None:
    full = np.full(len(muscles.mechanism.chains), 1.5)
    observed = {"sensors": {"encoder_noise": 1e-5}, "observer": {"kind": "kalman"}}
    for tables, said in (
        (given("excitation_", (0.0, full)), r"from 0 to 1, got 1\.5 to 1\.5; for"),
        ({"controller": TORQUE, **observed}, "observer: it takes commands for the efforts"),
        ({"load": [{"kind": "unloading", "stiffness": 1e5}]}, "give break_force"),
    ):
        with pytest.raises(condyle.ScenarioError, match=said):
            condyle.simulate(muscles, tables)


@pytest.mark.ci
@pytest.mark.usefixtures("compiler_command")
def test_in_lockstep(muscles: Model, given: Given) -> None:
    """Compiled, several at once, and by numpy: the same."""
    e = np.ones(len(muscles.mechanism.chains))
    tables = [given("excitation_", (0.0, x * e), (0.01, x / 2 * e)) for x in (0.1, 0.2, 0.4)]
    runs = [{**RUN, "duration": 0.01, **table} for table in tables]
    together = condyle.simulate(condyle.derive("human-jaw-muscles"), runs)
    for run, found in zip(runs, together, strict=True):
        alone = condyle.simulate(muscles, run)
        for name in ("pose", "activation", "excitation", "effort"):
            np.testing.assert_allclose(found[name].values, alone[name].values, rtol=1e-7, atol=1e-9)
