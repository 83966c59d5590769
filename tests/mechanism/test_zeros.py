"""What encoders read at home: readings are joint coordinates plus `actuator.zero`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from oracles.description import joint, read
from oracles.random_mechanism import random_mechanism, random_state
from oracles.rotations import platform_motion

import condyle
from condyle.mechanism import dumps, parse
from condyle.mechanism.actuator import LinearActuator
from condyle.mechanism.files import from_data
from condyle.questions.number_paths import number_jacobian

KINDS = ("RSS", "PSS", "SPS", "cable")


@pytest.fixture(scope="module")
def jaw() -> condyle.Mechanism:
    return condyle.load_mechanism("masticatory")


def zeroed(mechanism: condyle.Mechanism, zeros: np.ndarray) -> condyle.Mechanism:
    for name, zero in zip(mechanism.chain_names, zeros.tolist(), strict=True):
        mechanism = mechanism.set(f"chain.{name}.actuator.zero", zero)
    return mechanism


@pytest.mark.parametrize("kind", KINDS)
def test_readings_of_a_random_machine_give_its_pose(kind: str) -> None:
    rng = np.random.default_rng(KINDS.index(kind))
    raw = random_mechanism(rng, [kind], contacts=1)
    zeros = rng.uniform(-0.5, 0.5, len(raw["chain"]))
    machine = zeroed(from_data(raw), zeros)
    d = read(raw)
    pose = random_state(rng, d, scale=0.3)["pose"][0]
    motion = platform_motion(pose)
    joints = np.array([joint(c, motion.point(c.M)[0])[0] for c in d.chains])
    found = condyle.derive(machine, backend="numpy").forward_kinematics(joints + zeros)
    np.testing.assert_allclose(found.pose, pose, rtol=0, atol=1e-9)


def test_a_zero_is_a_number_of_the_file(jaw: condyle.Mechanism) -> None:
    name = jaw.chain_names[1]
    machine = jaw.set(f"chain.{name}.actuator.zero", 0.25)
    assert machine.zeros == (0.0, 0.25, 0.0, 0.0, 0.0, 0.0)
    assert parse(dumps(machine)) == machine
    assert "zero" not in dumps(jaw)
    model = condyle.derive(machine, backend="numpy")
    own = condyle.derive(jaw, backend="numpy")
    home = np.zeros(4)
    assert abs(model.inverse_kinematics(home).joint[1]) < 1e-14
    assert (
        model.inverse_dynamics(home, home, home).effort
        == own.inverse_dynamics(home, home, home).effort
    ).all()


def test_a_zero_moves_nothing_but_readings(jaw: condyle.Mechanism) -> None:
    structure = condyle.derive(jaw, backend="numpy").system.wide.structure
    found = number_jacobian(jaw, structure, [f"chain.{jaw.chain_names[2]}.actuator.zero"])
    assert np.count_nonzero(found) == 1
    assert found.max() == 1.0


def test_millimetres_of_a_sliding_joint() -> None:
    found = LinearActuator.model_validate({"zero": 2.0}, context={"per_metre": 1000.0})
    assert found.zero == 0.002


def simulated(machine: condyle.Mechanism, model: str | None = None) -> xr.Dataset:
    t = np.linspace(0, 0.05, 51)
    rise = (t / 0.05) ** 4 * (35 - 84 * t / 0.05 + 70 * (t / 0.05) ** 2 - 20 * (t / 0.05) ** 3)
    columns = {"X": 0.001 * rise, "Y": 0 * t, "alpha": 0 * rise, "beta": 0.01 * rise}
    controller = {"kind": "joint_pd", "stiffness": 20.0, "damping": 0.2}
    if model is not None:
        controller["model"] = model
    scenario = {"duration": 0.004, "rtol": 1e-6, "controller": controller, "sensors": {}}
    return condyle.simulate(
        condyle.derive(machine, backend="numpy"),
        scenario,
        motion=condyle.Motion.from_arrays(t, columns),
    )


def test_a_simulation_is_the_same_but_for_what_encoders_read(
    jaw: condyle.Mechanism,
) -> None:
    zeros = np.array([0.3, -0.2, 0.1, 1.0, -2.0, 0.5])
    before, after = simulated(jaw), simulated(zeroed(jaw, zeros))
    for name in ("joint", "effort", "estimate"):
        scale = np.abs(before[name].values).max()
        assert np.abs(after[name].values - before[name].values).max() < 1e-9 * scale
    read = after["measured_joint"].values - before["measured_joint"].values
    np.testing.assert_allclose(read, np.broadcast_to(zeros, read.shape), atol=1e-9)


def test_a_controller_that_knows_other_zeros_estimates_another_pose(
    jaw: condyle.Mechanism, tmp_path: Path
) -> None:
    path = tmp_path / "own.toml"
    condyle.dump(jaw, path)
    error = 1e-3 * np.array([1.0, -1.0, 0.5, 0.5, -0.5, 1.0])
    found = simulated(zeroed(jaw, error), str(path))
    own = condyle.derive(jaw, backend="numpy")
    wrong = own.forward_kinematics(error, tolerance=1.0).q  # at home, of readings taken for joints
    assert np.abs(wrong).max() > 1e-5
    np.testing.assert_allclose(found["estimate"].values[0], wrong, atol=1e-3 * np.abs(wrong).max())
