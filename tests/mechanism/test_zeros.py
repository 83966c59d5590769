"""What encoders read at home: readings are joint coordinates plus `actuator.zero`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from oracles.description import joint, read
from oracles.random_mechanism import random_mechanism, random_state
from oracles.rotations import platform_motion
from support.machines import model

import condyle
from condyle.mechanism import Mechanism, dumps, parse
from condyle.mechanism.actuator import LinearActuator
from condyle.mechanism.files import from_data
from condyle.questions.number_paths import number_jacobian

KINDS = ("RSS", "PSS", "SPS", "cable")


def zeroed(mechanism: Mechanism, zeros: np.ndarray) -> Mechanism:
    for name, zero in zip(mechanism.chain_names, zeros.tolist(), strict=True):
        mechanism = mechanism.set(f"chain.{name}.actuator.zero", zero)
    return mechanism


def test_readings_of_a_random_machine_give_its_pose() -> None:
    """Of every family at once."""
    rng = np.random.default_rng(0)
    raw = random_mechanism(rng, KINDS, contacts=1, chains=8)
    zeros = rng.uniform(-0.5, 0.5, len(raw["chain"]))
    d = read(raw)
    pose = random_state(rng, d, scale=0.3)["pose"][0]
    motion = platform_motion(pose)
    joints = np.array([joint(c, motion.point(c.M)[0])[0] for c in d.chains])
    machine = condyle.derive(zeroed(from_data(raw), zeros), backend="numpy")
    found = machine.forward_kinematics(joints + zeros)
    np.testing.assert_allclose(found.pose, pose, rtol=0, atol=1e-9)


def test_a_zero_is_a_number_of_the_file_and_of_readings_alone(reference: Mechanism) -> None:
    path, home = f"chain.{reference.chain_names[1]}.actuator.zero", np.zeros(4)
    machine, own = reference.set(path, 0.25), model("masticatory")
    assert machine.zeros == (0.0, 0.25, 0.0, 0.0, 0.0, 0.0)
    assert parse(dumps(machine)) == machine and "zero" not in dumps(reference)
    found = condyle.derive(machine, backend="numpy")
    assert abs(found.inverse_kinematics(home).joint[1]) < 1e-14
    effort, wanted = (m.inverse_dynamics(home, home, home).effort for m in (found, own))
    np.testing.assert_array_equal(effort, wanted)
    slopes = number_jacobian(reference, own.system.unreduced.structure, [path])
    assert np.count_nonzero(slopes) == 1 and slopes.max() == 1.0
    slider = LinearActuator.model_validate({"zero": 2.0}, context={"per_metre": 1000.0})
    assert slider.zero == 0.002  # millimetres of a sliding joint


def simulated(machine: Mechanism, **own: str) -> xr.Dataset:
    t = np.linspace(0, 0.05, 51)
    s = t / 0.05
    rise = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
    columns = {"X": 0.001 * rise, "Y": 0 * t, "alpha": 0 * t, "beta": 0.01 * rise}
    controller = {"kind": "joint_pd", "stiffness": 20.0, "damping": 0.2, **own}
    scenario = {"duration": 0.002, "rtol": 1e-6, "controller": controller, "sensors": {}}
    motion = condyle.Motion.from_arrays(t, columns)
    return condyle.simulate(condyle.derive(machine, backend="numpy"), scenario, motion=motion)


@pytest.mark.slow
def test_a_simulation_differs_in_what_encoders_read(reference: Mechanism, tmp_path: Path) -> None:
    """But for their rounding, of numbers of 2 rad, times levers and gains of some 10.

    A controller that knows other zeros sees another pose.
    """
    zeros = np.array([0.3, -0.2, 0.1, 1.0, -2.0, 0.5])
    before, after = simulated(reference), simulated(zeroed(reference, zeros))
    for name in ("joint", "effort", "estimate"):
        scale = np.abs(before[name].values).max()
        assert np.abs(after[name].values - before[name].values).max() < 1e-9 * scale + 1e-14
    read = after["measured_joint"].values - before["measured_joint"].values
    np.testing.assert_allclose(read, np.broadcast_to(zeros, read.shape), atol=1e-9)
    condyle.dump(reference, tmp_path / "own.toml")
    error = 1e-3 * np.array([1.0, -1.0, 0.5, 0.5, -0.5, 1.0])
    found = simulated(zeroed(reference, error), model=str(tmp_path / "own.toml"))
    # At home, of readings taken for joints.
    wrong = model("masticatory").forward_kinematics(error, tolerance=1.0).q
    assert np.abs(wrong).max() > 1e-5
    np.testing.assert_allclose(found["estimate"].values[0], wrong, atol=1e-3 * np.abs(wrong).max())
