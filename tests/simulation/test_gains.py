"""What --check-gains predicts is what happens."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import trapezoid
from simulation.scenarios import PD, eased, jaw_path
from support.speeds import first

import condyle
from condyle.errors import UnsupportedError
from condyle.model.model import Model
from condyle.simulation import brake, gains
from condyle.simulation.bind import bind
from condyle.simulation.gains import Sampled, SampledLoop, error_bound
from condyle.simulation.plan import ClosedLoop
from condyle.simulation.scenario import Scenario
from condyle.simulation.simulating import planned

KP, PERIOD = 400.0, 1e-3
A, B = np.array([[0.0, 1.0], [0, 0]]), np.array([[0.0], [1]])  # a double integrator


@pytest.fixture(scope="module")
def rest() -> condyle.Motion:
    """A second of home."""
    return jaw_path(np.linspace(0, 1, 11))


@pytest.fixture(autouse=True)
def few_points(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the path; its end, where the jaw is closed, is one of them."""
    monkeypatch.setattr(gains, "POINTS", 3)


def test_a_continuous_loop_has_the_roots_of_its_gains(plain: Model, rest: condyle.Motion) -> None:
    """e'' + Kv e' + Kp e = 0 in every coordinate, whatever the mechanism does."""
    law = {"kind": "computed_torque", "stiffness": KP, "damping": 24.0, "ideal": True}
    home = condyle.check_gains(plain, {"controller": law}, motion=rest).points[0]
    assert np.allclose(home.eigenvalues.real, -12, rtol=1e-4)
    assert np.allclose(np.abs(home.eigenvalues.imag), 16, rtol=1e-4)
    assert np.isclose(home.damping, 24.0 / 2 / np.sqrt(KP), rtol=1e-4)
    with pytest.raises(UnsupportedError, match="no controller"):
        condyle.check_gains(plain, {})


def sampled(H: Any, T: float, delay: int) -> Sampled:
    """A loop without memory."""
    none = np.zeros((1, 0)), np.zeros((0, 2)), np.zeros((0, 0))
    return Sampled(A, B, np.array(H), *none, T, delay)


def test_the_margin_of_phase() -> None:
    """L = (Kv s + Kp) / s^2 passes 1 at w with w^4 = Kp^2 + (Kv w)^2; holding takes w T / 2."""
    T, Kv = 1e-4, 24.0
    w = np.sqrt((Kv**2 + np.sqrt(Kv**4 + 4 * KP**2)) / 2)
    margin = np.degrees(np.arctan(Kv * w / KP) - w * T / 2)
    assert np.isclose(sampled([[-KP, -Kv]], T, 0).phase(), margin, atol=0.05)


def test_a_sampled_loop_is_late() -> None:
    """A double integrator, held and one period late, beside its recursion run step by step; also
    with memory: x, and the rate as filtered."""
    T, Kv = PERIOD, 2 * np.sqrt(KP)
    for kept in (0.0, 0.6):
        part = (1 - kept) / T
        H, E = [[-KP - Kv * part, 0.0]], [[1.0, 0.0], [part, 0.0]]
        H_m, E_m = [[Kv * part, -Kv * kept]], [[0.0, 0.0], [-part, kept]]
        filtered = Sampled(A, B, *(np.array(a) for a in (H, H_m, E, E_m)), period=T, delay=1)
        for loop, smoothing in ((sampled([[-KP, -Kv]], T, 1), None), (filtered, kept)):
            z = np.linalg.eigvals(loop.closed())
            x, v, late, before, rate, size = 1e-3, 0.0, 0.0, 1e-3, 0.0, []
            for _ in range(4000):
                rate = v if smoothing is None else kept * rate + (1 - kept) * (x - before) / T
                before, asked = x, -KP * x - Kv * rate
                x, v, late = x + T * v + T**2 / 2 * late, v + T * late, asked
                size.append(np.hypot(x, v / np.sqrt(KP)))
            decay = (size[3999] / size[2999]) ** (1 / 1000)
            assert np.isclose(np.abs(z).max(), decay, rtol=2e-4)


def test_unstable_drives_are_predicted(plain: Model, rest: condyle.Motion, tmp_path: Path) -> None:
    """A damper against a rotor of 6.6e-5 kg m^2 at 1 kHz: what is said is what happens."""
    for damping, stable in ((0.03, True), (0.4, False)):
        pd = PD | {"stiffness": 3.0, "damping": damping, "rate": 1000.0}
        tables = {"duration": 0.02, "controller": pd, "start": {"beta": 1e-5}}
        tables |= {"method": "rk4", "step": 1e-3}  # efforts are held as long
        said = condyle.check_gains(plain, tables, motion=rest)
        assert said.stable == stable and bool(said.warnings) != stable
        assert ("touchdown on loads is not covered" in str(said)) == stable
        assert all((point.phase > 0) == point.stable for point in said.points)
        assert said.data["stable"] == stable and said.data["mechanism"] == "masticatory"
        said.save(tmp_path / "points.csv")
        rows = (tmp_path / "points.csv").read_text().splitlines()
        assert rows[0] == "time,holds,radius,damping,phase_margin,brake" and rows[1].startswith(
            ",,0.9" if stable else ",,"
        )
        assert len(rows) == 1 + len(said.points)
        error = np.abs(condyle.simulate(plain, tables, motion=rest)["tracking_error"].values)
        assert (error[-1].max() < 2e-5) == stable


def test_foods_that_are_met_are_held_together(plain: Model) -> None:
    """That a bite which swings is predicted, `test_observer.py` asks."""
    t = np.linspace(0, 0.5, 51)
    shut = jaw_path(t, beta=0.15 - 0.17 * eased(t / 0.5))
    bite = {"kind": "bite_force", "stiffness": 900.0, "force": 50.0, "delay": 3}
    half = {"kind": "food", "food": "firm_bolus", "stiffness": 13.75e3 / 2, "damping": 5.0}
    loads = [half | {"name": p, "point": p} for p in ("right_molar", "left_molar")]
    tables = {"duration": 0.6, "start": {"on_motion": True}, "controller": bite, "load": loads}
    two = condyle.check_gains(plain, tables, motion=shut)
    assert two.stable and {p.holds for p in two.points} == {
        None,
        "right_molar",
        "right_molar and left_molar",
    }


MEETS = {"kind": "food", "food": "firm_bolus", "thickness": 4e-3}
BITE = {"kind": "bite_force", "stiffness": 900.0, "force": 30.0, "rise": 0.0}
HYBRID = {"kind": "hybrid", "stiffness": 900.0, "forces": 30.0, "directions": [[0, 0, 1]]}


def closing(load: Any = MEETS, **law: Any) -> Any:
    """A scenario, and a path that closes the jaw and stays there."""
    t = np.linspace(0, 0.4, 41)
    motion = jaw_path(t, beta=0.12 * (1 - eased(t / 0.3)))
    tables = {"duration": 0.4, "start": {"on_motion": True}, "controller": law}
    return tables | {"load": [load]}, motion


def checked(model: Any, *args: Any, **law: Any) -> gains.GainReport:
    tables, motion = closing(*args, **law)
    return condyle.check_gains(model, tables, motion=motion)


def test_given_forces_have_the_loop_of_a_bite(plain: Model) -> None:
    """One direction: the same law by other equations. Two: nothing resists along the second, and
    the loop of the first and of all else stays."""
    bite, one = checked(plain, **BITE), checked(plain, **HYBRID)
    two = checked(plain, **HYBRID | {"directions": [[0, 0, 1], [1, 0, 0]], "forces": [30.0, 0.0]})
    assert bite.stable and one.stable and two.stable
    held = {point.time: point.radius for point in bite.points if point.holds}
    assert {point.time: point.radius for point in one.points} == pytest.approx(held, rel=1e-5)
    assert {point.time: point.radius for point in two.points} == pytest.approx(held, rel=1e-3)


def test_memory_that_the_loop_does_not_hold_is_left_out(plain: Model) -> None:
    """An integral whose gain is 0 grows for ever, and does nothing: its loop is that of the
    smallest gain but for an eigenvalue near 1."""
    none, small = (checked(plain, **BITE | {"integral": x}) for x in (0.0, 1e-6))
    assert none.stable
    for one, other in zip(none.points, small.points, strict=True):
        if one.holds:
            near = np.abs(other.eigenvalues).min()
            assert near < 1e-3 and len(one.eigenvalues) == len(other.eigenvalues) - 1
            assert np.abs(one.eigenvalues).min() > 1.0


def test_what_was_not_judged_says_so(plain: Model) -> None:
    """A bite that its path does not meet; limits that take part; a rate that does not suffice."""
    far = checked(plain, MEETS | {"thickness": 1e-3, "point": "incisor"}, **BITE)
    robot = plain.mechanism
    weak = robot.set({f"chain.{name}.actuator.torque_limit": 0.02 for name in robot.chain_names})
    for report, said in (
        (far, "nowhere on its path"),
        (checked(weak, **BITE), "limits take part"),
        (checked(plain, **BITE | {"effort_rate": 1e-3}), "faster than effort_rate"),
        (checked(plain, **BITE | {"rise": 0.1, "effort_rate": 2.0}), "its force, in 0.1 s"),
    ):
        assert report.stable is None and report.data["stable"] is None
        assert any("not judged" in one and said in one for one in report.warnings)
        assert str(report).endswith("not judged")


def test_laws_of_places_are_judged_on_the_food_too(plain: Model) -> None:
    """Stiff food and a delay: stable where nothing is touched, and not on it."""
    hard = MEETS | {"stiffness": 3e5}
    report = checked(plain, hard, kind="computed_torque", stiffness=2500.0, delay=6)
    assert {p.holds: p.stable for p in report.points} == {None: True, "food": False}


SENSORS = {"encoder_resolution": 0.0, "velocity_cutoff": 150.0}


@pytest.mark.parametrize("sensors", first([SENSORS, None]))
def test_the_loop_s_derivatives_are_its_differences(plain: Model, sensors: Any) -> None:
    """Plant with loads and tick, exact, beside central differences of the same kernels."""
    spring = {"kind": "spring", "point": "incisor", "stiffness": 90.0, "damping": 2.0}
    impedance = {"kind": "impedance", "stiffness": 900.0, "damping": 9.0}
    tables = {"controller": impedance, "load": [spring]} | ({"sensors": sensors} if sensors else {})
    plan = bind(plain, Scenario.read(tables))
    assert isinstance(plan.drive, ClosedLoop)
    loop = SampledLoop(plan, plan.drive)
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


@pytest.mark.parametrize("sensors", first([{"sensors": {"velocity_cutoff": 150.0}}, {}]))
def test_a_function_in_python_has_the_loop_of_its_law(plain: Model, sensors: Any) -> None:
    law = PD | {"rate": 1000.0, "gravity": False, "delay": 1}
    tables = {"duration": 0.2, "controller": law, **sensors}

    def own(now: Any, aim: Any) -> Any:
        return 2.0 * (aim.joint - now.joint) + 0.02 * (aim.joint_rate - now.joint_rate)

    exact, found = (condyle.check_gains(plain, tables, controller=x) for x in (None, own))
    for one, other in zip(found.points, exact.points, strict=True):
        assert one.radius == pytest.approx(other.radius, rel=1e-6)
        assert one.phase == pytest.approx(other.phase, abs=1e-3)


def test_the_brake_of_a_stop_does_what_is_said_of_it(
    plain: Model, rest: condyle.Motion, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Thrown, and braked by a function in Python: rates grow by the radius every tick, or die."""
    free = condyle.derive(plain.mechanism.set({"gravity": (0.0, 0.0, 0.0)}))
    law = {"kind": "computed_torque", "stiffness": KP, "delay": 1}
    tables = {"duration": 0.06, "method": "rk4", "step": 2.5e-4, "start": {"dbeta": 1e-6}}
    tables |= {"controller": law, "sensors": {"velocity_cutoff": 200.0}}
    falls = condyle.check_gains(plain, tables, motion=rest)  # which no damper keeps from it
    assert falls.stable and np.less(falls.columns["brake"], 1).all()
    monkeypatch.setattr(brake, "CONSTANTS", 1e9)
    for lag, stable in ((brake.LAG, True), (4.0, False)):
        monkeypatch.setattr(brake, "LAG", lag)
        (plan,) = planned(free, [tables], motion=rest)
        assert isinstance(plan.drive, ClosedLoop)
        B = brake.brake(plan, plan.drive)
        said = condyle.check_gains(free, tables, motion=rest)
        radius = said.points[0].brake
        assert radius is not None and (radius < 1) == stable == said.stable
        assert any("brake" in text for text in said.warnings) != stable
        run = condyle.simulate(
            free, tables, motion=rest, controller=lambda now, _, B=B: -B * now.joint_rate
        )
        size = np.linalg.norm(run["joint_rate"].values, axis=1)
        grown = (np.linalg.norm(size[-20:]) / np.linalg.norm(size[-40:-20])) ** (1 / 20)
        assert (grown < 1) == stable and (stable or np.isclose(grown, radius, rtol=0.01))


def test_the_bound_of_errors() -> None:
    """int |h| of the impulse response, by sampling it."""
    t = np.linspace(0, 10, 200001)
    for damping in (10.0, 30.0, 40.0, 60.0):
        roots = np.roots([1, damping, 400.0 + 1e-9]).astype(complex)
        h = ((np.exp(roots[0] * t) - np.exp(roots[1] * t)) / (roots[0] - roots[1])).real
        area = trapezoid(np.abs(h), x=t)
        assert np.isclose(error_bound(400.0, damping, 3.0), 3 * area, rtol=1e-4), damping
