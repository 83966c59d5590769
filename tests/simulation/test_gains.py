"""What --check-gains predicts is what happens."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import trapezoid

import condyle
from condyle.errors import UnsupportedError
from condyle.model.model import Model
from condyle.simulation.bind import bind
from condyle.simulation.gains import Loop, Sampled, error_bound
from condyle.simulation.plan import ClosedLoop
from condyle.simulation.running import run
from condyle.simulation.scenario import scenario_from

KP, PERIOD = 400.0, 1e-3


def report(model: Model, **controller: Any) -> Any:
    table = {"kind": "computed_torque", "stiffness": KP} | controller
    t = np.linspace(0, 1, 11)
    rest = condyle.Motion.from_arrays(t, {n: 0 * t for n in model.independent})
    return condyle.check_gains(model, {"controller": table}, motion=rest)


def test_a_continuous_loop_has_the_roots_of_its_gains(jaw: Model) -> None:
    """e'' + Kv e' + Kp e = 0 in every coordinate, whatever the mechanism does."""
    home = report(jaw, damping=24.0, ideal=True).points[0]
    assert np.allclose(home.eigenvalues.real, -12, rtol=1e-4)
    assert np.allclose(np.abs(home.eigenvalues.imag), 16, rtol=1e-4)
    assert np.isclose(home.damping, 24.0 / 2 / np.sqrt(KP), rtol=1e-4)


def sampled(A: np.ndarray, B: np.ndarray, H: Any, T: float, delay: int) -> Sampled:
    """A loop without memory."""
    return Sampled(
        A, B, np.array(H), np.zeros((1, 0)), np.zeros((0, 2)), np.zeros((0, 0)), T, delay
    )


def test_the_margin_of_phase() -> None:
    """L = (Kv s + Kp) / s^2 passes 1 at w with w^4 = Kp^2 + (Kv w)^2; holding takes w T / 2."""
    T, Kv = 1e-4, 24.0
    A, B = np.array([[0.0, 1.0], [0, 0]]), np.array([[0.0], [1]])
    w = np.sqrt((Kv**2 + np.sqrt(Kv**4 + 4 * KP**2)) / 2)
    margin = np.degrees(np.arctan(Kv * w / KP) - w * T / 2)
    assert np.isclose(sampled(A, B, [[-KP, -Kv]], T, 0).phase(), margin, atol=0.05)


@pytest.mark.parametrize("smoothing", [None, 0.0, 0.6])
def test_a_sampled_loop_is_late(jaw: Model, smoothing: float | None) -> None:
    """A double integrator, held and one period late, beside its recursion run step by step."""
    T, Kv = PERIOD, 2 * np.sqrt(KP)
    A, B = np.array([[0.0, 1.0], [0, 0]]), np.array([[0.0], [1]])
    loop = sampled(A, B, [[-KP, -Kv]], T, 1)
    if smoothing is not None:  # memory: x, and the rate as filtered
        part, kept = (1 - smoothing) / T, smoothing
        H, E = [[-KP - Kv * part, 0.0]], [[1.0, 0.0], [part, 0.0]]
        H_m, E_m = [[Kv * part, -Kv * kept]], [[0.0, 0.0], [-part, kept]]
        loop = Sampled(A, B, *(np.array(a) for a in (H, H_m, E, E_m)), period=T, delay=1)
    z = np.linalg.eigvals(loop.closed())
    x, v, late, before, rate = 1e-3, 0.0, 0.0, 1e-3, 0.0
    size = []
    for _ in range(4000):
        rate = v if smoothing is None else smoothing * rate + (1 - smoothing) * (x - before) / T
        before, asked = x, -KP * x - Kv * rate
        x, v, late = x + T * v + T**2 / 2 * late, v + T * late, asked
        size.append(np.hypot(x, v / np.sqrt(KP)))
    decay = (size[3999] / size[2999]) ** (1 / 1000)
    assert np.isclose(np.abs(z).max(), decay, rtol=2e-4)


@pytest.mark.parametrize(("damping", "stable"), [(0.03, True), (0.4, False)])
def test_unstable_drives_are_predicted(jaw: Model, damping: float, stable: bool) -> None:
    """A damper against a rotor of 6.6e-5 kg m^2 at 1 kHz: what is said is what happens."""
    pd = {"kind": "joint_pd", "stiffness": 3.0, "damping": damping}
    t = np.linspace(0, 1, 11)
    rest = condyle.Motion.from_arrays(t, {n: 0 * t for n in jaw.independent})
    tables = {"duration": 0.03, "controller": pd, "start": {"beta": 1e-5}}
    said = condyle.check_gains(jaw, tables, motion=rest)
    assert said.stable == stable and bool(said.warnings) != stable
    assert all((point.phase > 0) == point.stable for point in said.points)
    error = np.abs(condyle.simulate(jaw, tables, motion=rest)["tracking_error"].values)
    assert (error[-1].max() < 2e-5) == stable


FIRM = {"kind": "food", "food": "firm_bolus", "point": "right_molar"}


@pytest.mark.parametrize(("delay", "stable"), [(3, True), (4, False), (6, False)])
def test_a_bite_that_swings_is_predicted(jaw: Model, delay: int, stable: bool) -> None:
    """50 N on a firm bolus at 1 kHz: while it bites, late efforts pump it up."""
    bite = {"kind": "bite_force", "stiffness": 900.0, "force": 50.0, "delay": delay}
    t = np.linspace(0, 0.5, 51)
    s = 3 * (t / 0.5) ** 2 - 2 * (t / 0.5) ** 3
    shut = condyle.Motion.from_arrays(
        t, {"X": 0 * t, "Y": 0 * t, "alpha": 0 * t, "beta": 0.15 * (1 - s) - 0.02 * s}
    )
    tables = {"duration": 0.6, "method": "rk4", "step": 2e-4, "start": {"on_motion": True}}
    tables |= {"controller": bite, "load": [FIRM]}
    said = condyle.check_gains(jaw, tables, motion=shut)
    holding = [point for point in said.points if point.holds == "food"]
    assert holding and all(point.stable == stable for point in holding)
    assert all((point.phase > 0) == stable for point in holding)
    assert all(point.stable for point in said.points if point.holds is None)
    force = run(bind(jaw, scenario_from(tables), motion=shut)).force[-100:]
    assert (np.ptp(force) < 5.0) == stable


@pytest.mark.parametrize(("delay", "stable"), [(3, True), (4, False)])
def test_food_in_two_halves_is_the_whole_of_it(jaw: Model, delay: int, stable: bool) -> None:
    """Each half alone is held at ease; together they are as stiff, and swing, as the whole.

    Touched without a ramp, so that a swing has something to grow from.
    """
    t = np.linspace(0, 0.5, 51)
    s = 3 * (t / 0.5) ** 2 - 2 * (t / 0.5) ** 3
    shut = condyle.Motion.from_arrays(
        t, {"X": 0 * t, "Y": 0 * t, "alpha": 0 * t, "beta": 0.15 * (1 - s) - 0.02 * s}
    )
    bite = {"kind": "bite_force", "stiffness": 900.0, "force": 50.0, "delay": delay, "rise": 0.0}
    tables = {"duration": 0.6, "method": "rk4", "step": 2e-4, "start": {"on_motion": True}}
    tables |= {"controller": bite}
    half = FIRM | {"stiffness": 13.75e3 / 2, "damping": 5.0}
    first = half | {"name": "first"}
    halves = tables | {"load": [first, half | {"name": "second"}]}
    apart = [first, half | {"name": "left", "point": "left_molar"}]
    whole = condyle.check_gains(jaw, tables | {"load": [FIRM]}, motion=shut)
    said = condyle.check_gains(jaw, halves, motion=shut)
    found = {
        name: np.array([point.radius for point in report.points if point.holds == name])
        for report, name in ((whole, "food"), (said, "first and second"), (said, "second"))
    }
    assert np.allclose(found["first and second"], found["food"], rtol=1e-7)
    assert len(found["second"]) and (found["second"] < 1).all()
    assert said.stable == stable
    force = run(bind(jaw, scenario_from(halves), motion=shut)).force[-100:]
    assert (np.abs(force - 50.0).max() < 5.0) == stable
    two = condyle.check_gains(jaw, tables | {"load": apart}, motion=shut)
    assert {point.holds for point in two.points} == {None, "first", "first and left"}


@pytest.mark.parametrize("sensors", [None, {"encoder_resolution": 0.0, "velocity_cutoff": 150.0}])
def test_the_loop_s_derivatives_are_its_differences(jaw: Model, sensors: Any) -> None:
    """Plant with loads and tick, exact, beside central differences of the same kernels."""
    spring = {"kind": "spring", "point": "incisor", "stiffness": 90.0, "damping": 2.0}
    impedance = {"kind": "impedance", "stiffness": 900.0, "damping": 9.0}
    tables = {"controller": impedance, "load": [spring], "sensors": sensors}
    plan = bind(jaw, scenario_from({k: v for k, v in tables.items() if v is not None}))
    assert isinstance(plan.drive, ClosedLoop)
    loop = Loop(plan, plan.drive)
    loop.at(0.3, plan.drive.path.at(np.array([0.3]))[0])
    for exact, columns in ((loop.rate, loop.plant.columns), (loop.tick, loop.control.columns)):
        found = exact()
        rows = np.concatenate([columns.rows(name) for name in exact.by])
        for i, row in enumerate(rows):
            ends = []
            for h in (-1e-6, 1e-6):
                columns.given[row, 0] += h
                assert columns.run() == 0
                ends.append({name: columns[name] for name in found})
                columns.given[row, 0] -= h
            for name, value in found.items():
                slope = (ends[1][name] - ends[0][name]) / 2e-6
                scale = max(np.abs(value).max(), np.abs(ends[0][name]).max())
                assert np.abs(value[:, i] - slope).max() < 1e-5 * scale, (name, i)


def test_no_loop_no_gains(jaw: Model) -> None:
    with pytest.raises(UnsupportedError, match="no controller"):
        condyle.check_gains(jaw, {})


@pytest.mark.parametrize("sensors", [{}, {"sensors": {"velocity_cutoff": 150.0}}])
def test_a_function_in_python_has_the_loop_of_its_law(jaw: Model, sensors: Any) -> None:
    law = {"kind": "joint_pd", "stiffness": 2.0, "damping": 0.02, "gravity": False, "delay": 1}
    tables = {"duration": 0.2, "controller": law, **sensors}
    own = lambda now, aim: 2.0 * (aim.joint - now.joint) + 0.02 * (aim.joint_rate - now.joint_rate)  # noqa: E731
    exact, found = (condyle.check_gains(jaw, tables, controller=x) for x in (None, own))
    for one, other in zip(found.points, exact.points, strict=True):
        assert one.radius == pytest.approx(other.radius, rel=1e-6)
        assert one.phase == pytest.approx(other.phase, abs=1e-3)


@pytest.mark.parametrize("damping", [10.0, 30.0, 40.0, 60.0])
def test_the_bound_of_errors(damping: float) -> None:
    """int |h| of the impulse response, by sampling it."""
    t = np.linspace(0, 10, 200001)
    roots = np.roots([1, damping, 400.0 + 1e-9]).astype(complex)
    h = ((np.exp(roots[0] * t) - np.exp(roots[1] * t)) / (roots[0] - roots[1])).real
    area = trapezoid(np.abs(h), x=t)
    assert np.isclose(error_bound(400.0, damping, 3.0), 3 * area, rtol=1e-4)
