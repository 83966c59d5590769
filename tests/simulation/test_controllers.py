"""Controllers: what theory says of their errors, and what stands between them and the machine."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.points import moved

import condyle
from condyle.model.model import Model
from condyle.simulation.gains import error_bound

Kp, Kv = 2500.0, 100.0
TORQUE = {"kind": "computed_torque", "stiffness": Kp, "damping": Kv}
HEAVIER = 1.1


@pytest.fixture(scope="module")
def opening() -> condyle.Motion:
    """A tenth of a second in which the jaw opens by 0.05 rad, from rest to rest."""
    t = np.linspace(0, 0.1, 101)
    s = t / 0.1
    rise = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
    columns = {"X": 0.003 * rise, "Y": 0 * t, "alpha": 0.01 * rise, "beta": 0.05 * rise}
    return condyle.Motion.from_arrays(t, columns)


def controlled(model: Model, motion: condyle.Motion, **tables: Any) -> xr.Dataset:
    controller = TORQUE | tables.pop("controller", {})
    return condyle.simulate(
        model, {"duration": 0.12, "controller": controller} | tables, motion=motion
    )


def test_a_perfect_model_tracks_at_the_integrator_s_error(
    jaw: Model, opening: condyle.Motion
) -> None:
    found = controlled(
        jaw,
        opening,
        controller={"ideal": True},
        rtol=1e-12,
        duration=0.1,
        start={"on_motion": True},
    )
    assert np.abs(found["tracking_error"]).max() < 1e-10


def test_ten_percent_heavier(jaw: Model, opening: condyle.Motion) -> None:
    """With all masses 1/1.1 of the plant's, M'' = M / 1.1, and so
    e'' + (Kv e' + Kp e) / 1.1 = (1 - 1/1.1) (q_d'' + M^-1 b), which bounds the error."""
    machine = jaw.mechanism
    heavier = scaled(machine, HEAVIER)
    plant = condyle.derive(heavier)
    law = Lighter(jaw)
    found = condyle.simulate(
        plant, {"duration": 0.12, "rtol": 1e-9}, controller=law, motion=opening
    )
    q, q1, q2 = jaw.poses.of_motion(opening)[0]
    right = plant.bias(q, q1) + plant.gravity(q)
    d = q2 + np.linalg.solve(plant.mass_matrix(q), right[..., None])[..., 0]
    d *= 1 - 1 / HEAVIER
    for i, name in enumerate(jaw.independent):
        worst = np.abs(found["tracking_error"].sel(independent=name)).max().item()
        bound = error_bound(Kp / HEAVIER, Kv / HEAVIER, np.abs(d[:, i]).max())
        assert worst < 1.05 * bound  # 5 %: b at the state, not at the path, and held efforts
    assert np.abs(found["tracking_error"]).max() > 1e-4


class Lighter:
    """Computed torque by a model of its own."""

    def __init__(self, model: Model) -> None:
        self.model = model

    def __call__(self, now: Any, aim: Any) -> np.ndarray:
        q2 = aim.q2 + Kv * (aim.q1 - now.q1) + Kp * (aim.q - now.q)
        return self.model.unchecked().inverse_dynamics(now.q, now.q1, q2)


def scaled(machine: condyle.Mechanism, by: float) -> condyle.Mechanism:
    """All masses and inertias of an RSS machine, times a number."""
    platform = machine.platform
    inertia = {k: by * v for k, v in platform.inertia.entries().items()}
    changes: dict[str, Any] = {"platform.mass": by * platform.mass, "platform.inertia": inertia}
    for chain in machine.chains:
        changes[f"chain.{chain.name}.crank.inertia"] = by * chain.crank.inertia
        for key in ("mass", "transverse", "axial"):
            changes[f"chain.{chain.name}.coupler.{key}"] = by * getattr(chain.coupler, key)
    return machine.set(changes)


def test_a_model_of_its_own_from_a_file(jaw: Model, opening: Any, tmp_path: Any) -> None:
    """The same through the scenario: its `model` is what the law computes with."""
    condyle.dump(jaw.mechanism, tmp_path / "light.toml")
    plant = condyle.derive(scaled(jaw.mechanism, HEAVIER))
    file = str(tmp_path / "light.toml")
    one = controlled(plant, opening, controller={"model": file})
    other = condyle.simulate(plant, {"duration": 0.12}, controller=Lighter(jaw), motion=opening)
    assert np.abs(one["pose"] - other["pose"]).max() < 1e-12


def test_impedance_gives_way_as_a_spring(jaw: Model) -> None:
    """A steady force at the point moves it by force over stiffness, along each axis."""
    stiffness = [2000.0, 3000.0, 4000.0]
    force = np.array([0.5, 0.3, -0.8])
    t = np.linspace(0, 1, 11)
    rest = condyle.Motion.from_arrays(t, {n: 0 * t for n in jaw.independent})
    tables = {
        "duration": 0.25,
        "controller": {"kind": "impedance", "stiffness": stiffness, "damping": 60.0},
        "load": [{"kind": "constant", "point": "right_molar", "force": force.tolist()}],
    }
    pose = condyle.simulate(jaw, tables, motion=rest)["pose"].values[-1]
    moved_by = moved(pose, np.array(jaw.mechanism.platform.points["right_molar"]))
    # Contacts carry what lies across them: compare along what the point can do.
    J = jaw_jacobian(jaw)
    assert np.abs(J.T @ (stiffness * moved_by - force)).max() < 1e-3 * np.abs(J.T @ force).max()


def jaw_jacobian(jaw: Model) -> np.ndarray:
    """Of right_molar at home, (3, m), by differences of poses."""
    p, h = np.array(jaw.mechanism.platform.points["right_molar"]), 1e-6
    columns = []
    for i in range(len(jaw.independent)):
        q = np.zeros((2, len(jaw.independent)))
        q[:, i] = -h, h
        poses = jaw.inverse_dynamics(q, 0 * q, 0 * q, outputs="all").pose
        columns.append((moved(poses[1], p) - moved(poses[0], p)) / (2 * h))
    return np.column_stack(columns)


def test_servo_drives_hold_against_gravity(jaw: Model, opening: condyle.Motion) -> None:
    pd = {"kind": "joint_pd", "stiffness": 20.0, "damping": 0.05}
    found = condyle.simulate(jaw, {"duration": 0.2, "controller": pd}, motion=opening)
    assert np.abs(found["tracking_error"].values[-1]).max() < 1e-6


def test_sensors_count_and_differences_are_late(jaw: Model, opening: condyle.Motion) -> None:
    step = 1e-3
    found = controlled(jaw, opening, sensors={"encoder_resolution": step, "velocity_cutoff": 200.0})
    counts = found["measured_joint"].values / step
    assert np.abs(counts - np.round(counts)).max() < 1e-6
    off = np.abs(found["measured_joint"] - found["joint"])[:-1].max()
    assert 0 < off <= step / 2 + 1e-12
    # Counts off by half a step, through A^+, are what the estimate is off by.
    pose = found["pose"].sel(coordinate=list(jaw.independent)).values
    assert 1e-6 < np.abs(found["estimate"].values - pose)[:-1].max() < 5 * step
    exact = controlled(jaw, opening, sensors={"velocity": "exact"})
    assert np.abs(exact["estimate_rate"] - exact_rate(exact, jaw))[:-1].max() < 1e-10


def exact_rate(solution: xr.Dataset, jaw: Model) -> np.ndarray:
    return solution["pose_rate"].sel(coordinate=list(jaw.independent)).values


def test_delay_holds_and_limits_cut(jaw: Model, opening: condyle.Motion) -> None:
    """What acts at a tick is what was asked two periods before, cut at the limit."""
    name = jaw.mechanism.chain_names[0]
    weak = jaw.mechanism.set(f"chain.{name}.actuator.torque_limit", 0.004)
    found = controlled(condyle.derive(weak), opening, controller={"delay": 2})
    command, effort = found["command"].values, found["effort"].values
    limited = np.clip(command[:-3, 0], -0.004, 0.004)
    assert np.array_equal(effort[2:-1, 0], limited)
    assert np.array_equal(effort[2:-1, 1:], command[:-3, 1:])
    kinds = {(e["kind"], e["owner"]) for e in found.condyle.events}
    assert ("saturated", name) in kinds


@pytest.fixture(scope="module")
def biting(jaw: Model) -> xr.Dataset:
    """From rest 6 mm open the jaw closes on firm food, and bites it with 50 N."""
    start = {"beta": 0.14, "X": 0.002}
    t = np.linspace(0, 0.4, 41)
    s = np.clip(t / 0.25, 0, 1)
    fall = 1 - s**3 * (10 - 15 * s + 6 * s**2)
    path = condyle.Motion.from_arrays(
        t, {"X": 0.002 * fall, "Y": 0 * t, "alpha": 0 * t, "beta": 0.14 * fall}
    )
    tables = {
        "duration": 0.4,
        "start": start,
        "controller": {"kind": "bite_force", "stiffness": 400.0, "force": 50.0, "delay": 1},
        "load": [{"kind": "food", "food": "firm_bolus", "point": "right_molar"}],
        "sensors": {"encoder_resolution": 1e-5},
    }
    return condyle.simulate(jaw, tables, motion=path)


def test_a_bite_settles_without_overshoot(biting: xr.Dataset) -> None:
    force = biting["bite_force"].values
    assert force.max() < 50 * 1.05
    assert abs(force[-1] - 50) < 1 and force[0] == 0
    assert [e["kind"] for e in biting.condyle.events if e["kind"].startswith("food")] == [
        "food_touched"
    ]


# `bite_damping` by delay in milliseconds.
CALMED = {0: 300.0, 1: 150.0, 2: 100.0, 3: 70.0}


@pytest.mark.slow
@pytest.mark.parametrize("delay", CALMED)
def test_no_food_is_bitten_harder_than_asked(delay: int, compiler_command: object) -> None:
    """50 N on every food that bears it, met at 0.1 m/s: less than 5 % too much, none breaks, and
    efforts, rates, sockets and unilateral contacts keep their limits."""
    machine = condyle.load_mechanism("masticatory")
    limits = {f"chain.{name}.actuator.torque_limit": 0.5 for name in machine.chain_names}
    for name in machine.contact_names:
        limits |= {f"contact.{name}.side": "below", f"contact.{name}.one_sided": True}
    jaw = condyle.derive(machine.set(limits))
    t = np.linspace(0, 0.6, 601)
    s = np.clip(t / 0.25, 0, 1)
    fall = 1 - s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
    path = condyle.Motion.from_arrays(
        t, {"X": 0 * t, "Y": 0 * t, "alpha": 0 * t, "beta": 0.12 * fall}
    )
    bite = {"kind": "bite_force", "stiffness": 400.0, "force": 50.0, "delay": delay}
    bite |= {"bite_damping": CALMED[delay], "distribution": "bounded", "preload": 2.0}
    bite["keep_bounds"] = True
    tables = {"duration": 0.6, "method": "rk4", "step": 2e-4, "start": {"on_motion": True}}
    foods = ("firm_bolus", "peanut", "carrot", "chow")
    scenarios = [
        tables | {"controller": bite, "load": [{"kind": "food", "food": food}]} for food in foods
    ]
    for food, run in zip(foods, condyle.simulate(jaw, scenarios, motion=path), strict=True):
        force = -run["load_force"].values[:, 0, 2]
        kinds = {event["kind"] for event in run.condyle.events}
        assert 50 < force.max() < 52.5 and abs(force[-1] - 50) < 0.5, food
        assert not kinds - {"food_touched", "food_left"}, food


@pytest.mark.slow
def test_bounds_are_kept_where_the_path_leaves_them(compiler_command: object) -> None:
    """The chewing path, in joints half as fast and sockets that end 2 mm too soon."""
    machine = condyle.load_mechanism("masticatory")
    tables: dict[str, Any] = {
        "duration": 2.0, "method": "rk4", "step": 2e-4, "rate": 500.0,
        "controller": {"kind": "computed_torque", "stiffness": 2500.0},
    }  # fmt: skip
    free = condyle.simulate(machine, tables)
    fastest = float(abs(free["joint_rate"]).max())
    reach = float(free["contact_point"].sel(axis="x").max())
    change = {f"chain.{name}.actuator.speed_limit": fastest / 2 for name in machine.chain_names}
    change |= {
        f"contact.{c.name}.bounds.x": [c.bounds.x[0], reach - 2e-3] for c in machine.contacts
    }  # type: ignore[index]
    narrow = machine.set(change)
    passed = condyle.simulate(narrow, tables)
    assert {e["kind"] for e in passed.condyle.events} == {"bound", "speed"}
    tables["controller"]["keep_bounds"] = True
    kept = condyle.simulate(narrow, tables)
    assert not kept.condyle.events and kept.sizes["time"] == free.sizes["time"]
    assert float(kept["contact_point"].sel(axis="x").max()) > reach - 2.5e-3  # it goes there
    assert float(abs(kept["joint_rate"]).max()) > 0.45 * fastest


def test_hybrid_presses_while_it_moves_on(jaw: Model) -> None:
    """8 N along z on a spring at the molar, while the jaw goes on along X."""
    t = np.linspace(0, 0.5, 51)
    path = condyle.Motion.from_arrays(
        t, {"X": 1e-3 * t * t, "Y": 0 * t, "alpha": 0 * t, "beta": 0 * t}
    )
    press = {"kind": "hybrid", "stiffness": 2500.0, "directions": [[0, 0, 1]], "forces": 8.0}
    tables = {
        "duration": 0.5,
        "method": "rk4",
        "step": 5e-4,
        "controller": press | {"integral": 20.0},
        "load": [{"kind": "spring", "stiffness": 2e4, "damping": 10.0}],
    }
    run = condyle.simulate(jaw, tables, motion=path)
    assert abs(-run["load_force"].values[-1, 0, 2] - 8) < 0.08
    q = run["pose"].sel(coordinate=list(jaw.independent)).values[-1]
    off, M, h = run["tracking_error"].values[-1], jaw.mass_matrix(q), 1e-5
    molar = np.array(jaw.mechanism.platform.points["right_molar"])
    ends = [
        [np.asarray(jaw.inverse_kinematics(q + s * h * u).pose) for s in (1, -1)] for u in np.eye(4)
    ]
    J = np.array([(moved(a, molar) - moved(b, molar))[2] / (2 * h) for a, b in ends])
    along = np.linalg.solve(M, J)  # where the force may lead it off the path
    rest = off - along * (along @ M @ off) / (along @ M @ along)
    assert rest @ M @ rest < 1e-4 * (off @ M @ off)


def test_a_solution_of_a_simulation_is_one(biting: xr.Dataset, tmp_path: Any) -> None:
    """It goes to files and comes back, with events as data."""
    path = tmp_path / "bite.nc"
    biting.condyle.save(path, tmp_path / "bite.csv")
    again = condyle.open_solution(path)
    assert again.condyle.events == biting.condyle.events and again.condyle.events[0][
        "state"
    ].keys() >= {
        "X",
        "dbeta",
    }
    assert np.array_equal(again["tracking_error"], biting["tracking_error"])
    header = (tmp_path / "bite.csv").read_text().partition("\n")[0].split(",")
    assert {"command_masseter_left", "error_beta", "bite_force", "load_food"} <= {*header}
