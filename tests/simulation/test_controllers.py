"""Controllers: what theory says of their errors, and what stands between them and the machine.

Their equations are held to numpy in `questions/test_laws.py`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from simulation.scenarios import FILTER, PD, RK4, TORQUE, eased, jaw_path
from support.points import moved

import condyle
from condyle.model.model import Model
from condyle.simulation.gains import error_bound

Kp, Kv = 2500.0, 100.0
HEAVIER = 1.1
TICKS = {"method": "rk4", "step": 1e-3}  # one a tick


@pytest.fixture(scope="module")
def opening() -> condyle.Motion:
    """A tenth of a second in which the jaw opens by 0.05 rad, from rest to rest."""
    t = np.linspace(0, 0.1, 101)
    rise = eased(t / 0.1)
    return jaw_path(t, X=0.003 * rise, alpha=0.01 * rise, beta=0.05 * rise)


def controlled(model: Model, motion: condyle.Motion, **tables: Any) -> xr.Dataset:
    law = {"kind": "computed_torque", "stiffness": Kp, "damping": Kv}
    tables = {"duration": 0.12, "controller": law | tables.pop("controller", {})} | tables
    return condyle.simulate(model, tables, motion=motion)


def test_a_perfect_model_tracks_at_the_integrator_s_error(
    jaw: Model, opening: condyle.Motion
) -> None:
    ideal = {"controller": {"ideal": True}, "start": {"on_motion": True}}
    found = controlled(jaw, opening, **ideal, rtol=1e-12, duration=0.1)
    assert np.abs(found["tracking_error"]).max() < 1e-10


def test_ten_percent_heavier(
    jaw: Model, plain: Model, opening: condyle.Motion, tmp_path: Path
) -> None:
    """With all masses 1/1.1 of the plant's, M'' = M / 1.1, and so
    e'' + (Kv e' + Kp e) / 1.1 = (1 - 1/1.1) (q_d'' + M^-1 b), which bounds the error.

    The law's model comes from a function in Python and, the same, from a file.
    """
    plant = condyle.derive(scaled(jaw.mechanism, HEAVIER))

    def law(now: Any, aim: Any) -> np.ndarray:
        q2 = aim.q2 + Kv * (aim.q1 - now.q1) + Kp * (aim.q - now.q)
        return plain.unchecked().inverse_dynamics(now.q, now.q1, q2)

    found = condyle.simulate(plant, {"duration": 0.12, **TICKS}, controller=law, motion=opening)
    q, q1, q2 = plain.poses.of_motion(opening)[0]
    by = condyle.derive(plant.mechanism, backend="numpy")
    right = by.bias(q, q1) + by.gravity(q)
    d = q2 + np.linalg.solve(by.mass_matrix(q), right[..., None])[..., 0]
    d *= 1 - 1 / HEAVIER
    for i, name in enumerate(jaw.independent):
        worst = np.abs(found["tracking_error"].sel(independent=name)).max().item()
        bound = error_bound(Kp / HEAVIER, Kv / HEAVIER, np.abs(d[:, i]).max())
        assert worst < 1.05 * bound  # 5 %: b at the state, not at the path, and held efforts
    assert np.abs(found["tracking_error"]).max() > 1e-4
    condyle.dump(jaw.mechanism, tmp_path / "light.toml")
    other = controlled(plant, opening, controller={"model": str(tmp_path / "light.toml")}, **TICKS)
    assert np.abs(found["pose"] - other["pose"]).max() < 1e-12


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


def test_servo_drives_hold_against_gravity(jaw: Model, opening: condyle.Motion) -> None:
    pd = PD | {"stiffness": 20.0, "damping": 0.05, "rate": 1000.0}
    found = condyle.simulate(jaw, {"duration": 0.2, "controller": pd, **RK4}, motion=opening)
    assert np.abs(found["tracking_error"].values[-1]).max() < 1e-6


def test_sensors_count(jaw: Model, opening: condyle.Motion) -> None:
    step = 1e-3
    found = controlled(jaw, opening, sensors=FILTER | {"encoder_resolution": step})
    counts = found["measured_joint"].values / step
    assert np.abs(counts - np.round(counts)).max() < 1e-6
    off = np.abs(found["measured_joint"] - found["joint"])[:-1].max()
    assert 0 < off <= step / 2 + 1e-12
    # Counts off by half a step, through A^+, are what the estimate is off by.
    pose = found["pose"].sel(coordinate=list(jaw.independent)).values
    assert 1e-6 < np.abs(found["estimate"].values - pose)[:-1].max() < 5 * step


def test_delay_holds_and_limits_cut(jaw: Model, opening: condyle.Motion) -> None:
    """What acts at a tick is what was asked two periods before, cut at the limit."""
    name = jaw.mechanism.chain_names[0]
    weak = jaw.mechanism.set(f"chain.{name}.actuator.torque_limit", 0.004)
    found = controlled(condyle.derive(weak), opening, controller={"delay": 2})
    command, effort = found["command"].values[:-3], found["effort"].values[2:-1]
    assert np.array_equal(effort[:, 0], np.clip(command[:, 0], -0.004, 0.004))
    assert np.array_equal(effort[:, 1:], command[:, 1:])
    assert ("saturated", name) in {(e["kind"], e["owner"]) for e in found.condyle.events}


def test_hybrid_presses_while_it_moves_on(jaw: Model) -> None:
    """8 N along z on a spring at the molar, while the jaw goes on along X; off the path it goes
    only where the force may lead it, along M^-1 J."""
    t = np.linspace(0, 0.5, 51)
    law = {"kind": "hybrid", "stiffness": 2500.0, "directions": [[0, 0, 1]], "forces": 8.0}
    spring = {"kind": "spring", "stiffness": 2e4, "damping": 10.0}
    tables = {"duration": 0.5, **RK4, "controller": law | {"integral": 20.0}, "load": [spring]}
    run = condyle.simulate(jaw, tables, motion=jaw_path(t, X=1e-3 * t * t))
    assert abs(-run["load_force"].values[-1, 0, 2] - 8) < 0.08
    q = run["pose"].sel(coordinate=list(jaw.independent)).values[-1]
    off, M, h = run["tracking_error"].values[-1], jaw.mass_matrix(q), 1e-5
    molar = np.array(jaw.mechanism.platform.points["right_molar"])
    ends = [[jaw.inverse_kinematics(q + s * h * u).pose for s in (1, -1)] for u in np.eye(4)]
    J = np.array([(moved(a, molar) - moved(b, molar))[2] / (2 * h) for a, b in ends])
    along = np.linalg.solve(M, J)
    rest = off - along * (along @ M @ off) / (along @ M @ along)
    assert rest @ M @ rest < 1e-4 * (off @ M @ off)


@pytest.mark.ci
def test_no_food_is_bitten_harder_than_asked(compiler_command: object) -> None:
    """50 N on every food that bears it, met at 0.1 m/s: less than 5 % too much, none breaks, and
    efforts, rates, sockets and unilateral contacts keep their limits; `bite_damping` by delay."""
    machine = condyle.load_mechanism("masticatory")
    limits = {f"chain.{name}.actuator.torque_limit": 0.5 for name in machine.chain_names}
    for name in machine.contact_names:
        limits |= {f"contact.{name}.side": "below", f"contact.{name}.one_sided": True}
    jaw = condyle.derive(machine.set(limits))
    t = np.linspace(0, 0.6, 601)
    path = jaw_path(t, beta=0.12 * (1 - eased(t / 0.25)))
    bite = {"kind": "bite_force", "stiffness": 400.0, "force": 50.0}
    bite |= {"distribution": "bounded", "preload": 2.0, "keep_bounds": True}
    cases = [
        (food, bite | {"delay": delay, "bite_damping": damping})
        for delay, damping in ((0, 300.0), (1, 150.0), (2, 100.0), (3, 70.0))
        for food in ("firm_bolus", "chow")
    ]
    steps = {"duration": 0.6, "method": "rk4", "step": 2e-4, "start": {"on_motion": True}}
    scenarios = [
        steps | {"controller": law, "load": [{"kind": "food", "food": food}]} for food, law in cases
    ]
    for case, run in zip(cases, condyle.simulate(jaw, scenarios, motion=path), strict=True):
        force = -run["load_force"].values[:, 0, 2]
        kinds = {event["kind"] for event in run.condyle.events}
        assert 50 < force.max() < 52.5 and abs(force[-1] - 50) < 0.5, case
        assert not kinds - {"food_touched", "food_left"}, case


def test_bounds_are_kept_where_the_path_leaves_them(plain: Model) -> None:
    """A path out of the sockets, and faster than the drives may: the law goes as far as it may."""
    t = np.linspace(0, 0.08, 81)
    path, found = jaw_path(t, X=-0.004 * eased(t / 0.06)), []
    tables = {"duration": 0.05, "method": "rk4", "step": 2e-3, "rate": 500.0}
    for keep in (False, True):
        law = TORQUE | {"stiffness": Kp, "keep_bounds": keep}
        scenario = tables | {"start": {"on_motion": True}, "controller": law}
        found.append(condyle.simulate(plain, scenario, motion=path))
    passed, kept = found
    assert {e["kind"] for e in passed.condyle.events} == {"bound", "speed"}
    assert not kept.condyle.events and kept.sizes["time"] == passed.sizes["time"]
    assert float(passed["bound_margin"].min()) < 0 < float(kept["bound_margin"].min()) < 5e-4  # m
