"""Simulations whose reference motion brings gravity and a moving base."""

from __future__ import annotations

import numpy as np
import pytest
from simulation.scenarios import eased

import condyle
from condyle.model.model import Model
from condyle.motion import Motion
from condyle.simulation import gains

T = np.linspace(0, 0.05, 26)
TORQUE = {"kind": "computed_torque", "stiffness": 2500.0, "damping": 100.0}


def nodding(names: tuple[str, ...], **more: np.ndarray) -> Motion:
    """A platform at rest for a while, on a base that nods and rises."""
    rise = eased(T / T[-1])
    angle = 0.1 * rise
    values = {name: 0 * T for name in names} | {names[-1]: 0.01 * rise}
    values |= {"gx": 9.81 * np.sin(angle), "gy": 0 * T, "gz": -9.81 * np.cos(angle)}
    values |= {"base_az": 3 * np.sin(80 * T), "base_wy": np.gradient(angle, T)}
    return Motion.from_arrays(T, values | more)


def test_computed_torque_knows_the_base(plain: Model) -> None:
    motion = nodding(plain.independent)
    law = {**TORQUE, "ideal": True}
    scenario = {"duration": 0.006, "rate": 1000, "rtol": 1e-8, "controller": law}
    found = condyle.simulate(plain, scenario, motion=motion)
    assert float(np.abs(found["tracking_error"]).max()) < 1e-6
    # Efforts are those of inverse dynamics, gravity and base linear between the motion's samples.
    path = Motion.from_arrays(T, motion.value, motion.names, times=found["time"].values)
    given = {
        name: np.stack([np.interp(path.t, T, one) for one in a.T], axis=1)
        for name, a in motion.given.items()
    }
    wanted = plain.inverse_dynamics(path.value, path.rate, path.acceleration, **given)
    np.testing.assert_allclose(found["effort"], wanted.effort, atol=1e-5)
    still = plain.inverse_dynamics(path.value, path.rate, path.acceleration)
    assert np.abs(still.effort - wanted.effort).max() > 1e-3
    np.testing.assert_allclose(found["share"].sum("part"), found["effort"], atol=1e-12)
    np.testing.assert_allclose(found["gravity"], given["gravity"], atol=1e-14)
    assert "base" in found["part"] and "energy" not in found


def test_efforts_within_limits_know_the_base_too(plain: Model) -> None:
    motion, found = nodding(plain.independent), []
    for distribution in ("minimum_norm", "bounded"):  # limits are far
        controller = {**TORQUE, "rate": 1000, "distribution": distribution}
        scenario = {"duration": 0.003, "rate": 1000, "method": "rk4", "step": 1e-3}
        found.append(condyle.simulate(plain, {**scenario, "controller": controller}, motion=motion))
    one, other = (run["effort"].values for run in found)
    np.testing.assert_allclose(one, other, atol=1e-8)


def test_a_platform_stays_in_space_while_the_base_rises() -> None:
    """Without gravity, masses of chains and efforts: what it does in {S} is the base's doing."""
    machine = condyle.load_mechanism("gough-stewart")
    light = {"mass": 1e-9, "transverse": 1e-12, "axial": 1e-12}
    changes = {
        f"chain.{name}.{body}.{key}": value
        for name in machine.chain_names
        for body in ("cylinder", "piston")
        for key, value in light.items()
    }
    model = condyle.derive(machine.set(changes), backend="numpy")
    zero = {name: 0 * T for name in ("gx", "gy", "gz")}
    rise = {"base_az": 0 * T + 0.5, "base_wy": 0 * T}
    motion = Motion.from_arrays(T, {n: 0 * T for n in model.independent} | zero | rise)
    scenario = {"duration": 0.02, "rate": 100}

    def idle(now: object, reference: object) -> np.ndarray:
        return np.zeros(len(machine.chains))

    found = condyle.simulate(model, scenario, controller=idle, motion=motion)
    fallen = found["pose"].sel(coordinate="Z").values
    np.testing.assert_allclose(fallen, -0.25 * found["time"].values ** 2, atol=1e-7)


@pytest.mark.ci
def test_compiled_steps_are_those_of_python(plain: Model, jaw: Model) -> None:
    scenario = {"duration": 0.02, "rate": 100, "method": "rk4", "step": 1e-3, "controller": TORQUE}
    motion = nodding(plain.independent)
    one, other = (condyle.simulate(m, scenario, motion=motion) for m in (plain, jaw))
    for name in ("effort", "pose"):
        np.testing.assert_allclose(one[name], other[name], atol=1e-9)


def test_gains_are_those_of_a_base_at_rest(plain: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gains, "POINTS", 2)
    motion = nodding(plain.independent)
    scenario = {"duration": 0.1, "controller": TORQUE}
    still = Motion.from_arrays(T, motion.value, motion.names)
    one, other = (condyle.check_gains(plain, scenario, motion=m) for m in (motion, still))
    assert str(one) == str(other)
