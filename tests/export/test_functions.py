"""What exported functions do: recorded samples, bad ones, derivatives, poses from encoders."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from export.conftest import C99, KEPT, Folder, Library
from export.test_compilers import require_right
from support.families import close
from support.machines import model
from support.tools import need, run

import condyle
from condyle.export import c_package, export
from condyle.export.c_samples import clear, vectors
from condyle.model.forward_kinematics import ForwardKinematics
from condyle.questions.law import CONTROLLERS, Control, ControllerTable
from condyle.status import Status

OK, UNREACHABLE, SINGULAR, OUT_OF_BOUNDS, INFEASIBLE = range(5)
ci = pytest.mark.ci


@pytest.fixture(scope="module")
def jaw(folder: Callable[[str], Folder]) -> Library:
    """Every question of the reference mechanism."""
    need("gcc")
    of = folder("jaw")
    return Library(of.exported, of.path)


def test_the_recorded_samples_and_what_is_counted(jaw: Library) -> None:
    """A controller works no less than the inverse dynamics in it."""
    run("gcc", *C99, "-O0", "check.c", "./it.so", "-o", "checker", "-lm", folder=jaw.folder)
    require_right(run("./checker", folder=jaw.folder), jaw.exported)
    inverse, controller = (jaw.exported[q].operations for q in ("inverse", "computed_torque"))
    assert controller > inverse > 1000


@ci
def test_facts_are_measured_wherever_the_folder_is(
    jaw: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a relative path too; a function's code holds that of those that it calls."""
    need("gcc", "nm")
    monkeypatch.chdir(jaw.folder.parent)
    monkeypatch.setattr(c_package, "FLAGS", (*c_package.FLAGS, "-O0"))
    rows = c_package.write_facts(jaw.exported, Path(jaw.folder.name))[0]["functions"]
    assert all(row["error"] < 1e-12 and not row["wrong"] for row in rows.values())
    for what in ("code", "stack"):  # the same work but for the contact forces
        assert rows["jaw_inverse"][what] > rows["jaw_contact"][what] / 2 > 0
    assert rows["jaw_computed_torque"]["code"] > rows["jaw_inverse"]["code"]


def test_no_number_gets_in(jaw: Library) -> None:
    """Not by any argument, and no pose out of reach; and what stood in the results stays. Small and
    denormal numbers are numbers."""
    for question in ("inverse", "forward", "motion", "pose", "closure"):
        for a in jaw.exported[question].inputs:
            for i in range(a.size):
                value = np.zeros(a.size)
                for value[i] in (np.nan, np.inf, -np.inf, 1e60, -1e200, 1e308):
                    status, found = jaw(question, **{a.name: value})
                    assert status == OUT_OF_BOUNDS, (a.name, i)
                    assert all((v == KEPT).all() for v in found.values())
    for question in ("inverse", "contact", "computed_torque"):
        status, found = jaw(question, q=[0.3, 0, 0, 0])
        assert status == UNREACHABLE and (found["effort"] == KEPT).all()
    home = jaw("inverse")[1]["effort"]
    for tiny in (0.0, 5e-324, -1e-310, 1e-200):
        status, found = jaw("inverse", q=tiny, q1=tiny, q2=tiny, force=tiny)
        assert status == OK
        np.testing.assert_allclose(found["effort"], home, rtol=1e-12)


def test_a_singular_pose_is_named_and_others_balance(tmp_path: Path) -> None:
    """A hexapod a quarter turn about Z is singular; towards it by tenths, what is ok balances."""
    mechanism, own = condyle.load_mechanism("gough-stewart"), model("gough-stewart")
    hexapod = Library(export(mechanism, ("inverse",), prefix="hexapod", lanes=0), tmp_path)
    status, found = hexapod("inverse", q=[0, 0, 0, 0, 0, np.pi / 2], force=[1.0, 0, 0])
    assert status == SINGULAR and (found["effort"] == KEPT).all()
    passed, zero = 0, np.zeros(6)
    for size in 10.0 ** -np.arange(1, 9):
        q = np.array([0.01, -0.02, 0.015, 0.02, -0.03, np.pi / 2 - size])
        status, found = hexapod("inverse", q=q, force=[1.0, 2.0, -30.0])
        if status == OK:
            J = own.jacobians(q).J_theta
            right = own.inverse_dynamics(q, zero, zero, [1.0, 2, -30, 0, 0, 0], zero[:3]).effort
            off = np.abs(J.T @ (found["effort"] - right)).max()
            assert off <= 1e-11 * np.abs(J.T @ np.diag(right)).max()
            passed += 1
    assert passed >= 5


@pytest.mark.parametrize(
    ("precision", "formulation"),
    [
        ("double", "virtual_power"),
        pytest.param("float", "virtual_power", marks=ci),
        ("double", "lagrange"),
    ],
)
def test_a_gimbal_lock_is_named_before_digits_are_lost(
    tmp_path: Path, precision: str, formulation: str
) -> None:
    """Towards it by tenths: accelerations that are given are right, and below there is one word.

    A hexapod held by its efforts: the platform does not accelerate.
    """
    mechanism, own = condyle.load_mechanism("gough-stewart"), model("gough-stewart")
    options = {"precision": precision, "prefix": "p", "lanes": 0, "formulation": formulation}
    hexapod = Library(export(mechanism, ("forward",), **options), tmp_path)
    word, most = int(Status.gimbal_lock), 1e-6 if precision == "double" else 2e-1
    told = []
    for away in 10.0 ** -np.arange(1, 10):
        q = np.array([0, 0, 0, 0.1, np.pi / 2 - away, 0.2])
        effort = own.inverse_dynamics(q, 0 * q, 0 * q).effort
        status, found = hexapod("forward", q=q, effort=effort)
        assert status == word or np.abs(found["acceleration"]).max() < most, away
        told.append(status)
    assert set(told) == {OK, word} and told == sorted(told)


@pytest.mark.parametrize("precision", ["double", pytest.param("float", marks=ci)])
def test_gravity_a_moving_base_and_the_bound(tmp_path: Path, precision: str) -> None:
    """All at every call. The library's bound to a few percent in double; in float it holds, too,
    and is in the scale of float."""
    mechanism, own = condyle.load_mechanism("masticatory"), model("masticatory")
    options = {"inputs": ("base", "gravity"), "outputs": ("bound",), "lanes": 0}
    e = export(mechanism, ("contact", "forward", "motion"), precision=precision, **options)
    jaw, rng = Library(e, tmp_path), np.random.default_rng(3)
    assert [a.name for a in e["contact"].inputs][-2:] == ["gravity", "base"]
    assert e["contact"].inputs[-1].units[2:4] == ("m/s^2", "rad/s")
    assert "base" not in [a.name for a in e["motion"].inputs]
    for size in (0.01, 0.1):
        q, q1, q2 = (rng.uniform(-size, size, (3, 4)) * [0.02, 0.02, 1, 1]).astype(np.float32)
        around = {"gravity": rng.normal(0, 9, 3), "base": rng.normal(0, 6, 9)}
        around = {name: x.astype(np.float32) for name, x in around.items()}
        right = own.inverse_dynamics(q, q1, q2, **around)
        back = own.forward_dynamics(q, q1, right.effort, **around)
        for question, given, best, names in (
            ("contact", {"q2": q2}, right, ("effort", "contact_force")),
            ("forward", {"effort": right.effort}, back, ("acceleration",)),
        ):
            status, found = jaw(question, q=q, q1=q1, **given, **around)
            bound, first = found["bound"][0], getattr(best, names[0])
            assert status == OK
            if precision == "double":
                assert bound == pytest.approx(float(best.bound), rel=0.05)
                for name in names:
                    close(found[name], getattr(best, name), 1e-10)
            else:
                assert np.abs(found[names[0]] - first).max() < bound * np.abs(first).max()
                assert bound == pytest.approx(float(best.bound) * 2.0**29, rel=0.5)


def test_encoders_give_back_the_motion(jaw: Library) -> None:
    """Each pose from the one before, as the library finds them, whatever whole turns joints count;
    from far off they are not guessed. With rates of the joints, the whole state."""
    own, t = model("masticatory"), np.linspace(0, 2 * np.pi, 30)[:, None]
    q = [0.004 * np.sin(t), 0.002 * np.sin(2 * t), 0.08 * (1 - np.cos(t)), 0.03 * np.sin(t)]
    found = own.inverse_kinematics(np.hstack(q))
    start, turns = np.zeros(6), 2 * np.pi * np.arange(-3, 3)
    for joint, pose in zip(found.joint, found.pose, strict=True):
        status, given = jaw("pose", joint=joint + turns, start=start)
        assert status == OK and np.abs(given["residual"]).max() < 1e-11
        np.testing.assert_allclose(given["pose"], pose, atol=1e-11)
        start = given["pose"]
    far = found.joint[15] + [0.1, 0, 0, 0, 0, 0]
    assert jaw("pose", joint=far, start=start)[0] == INFEASIBLE
    right = ForwardKinematics(own.mechanism).solve(found.joint[:1] + 3.0).status[0]
    assert right != OK and jaw("pose", joint=found.joint[0] + 3.0)[0] in (UNREACHABLE, SINGULAR)

    state = {"q": [0.002, 0.001, 0.05, 0.02], "q1": [0.03, -0.02, 0.4, 0.3]}
    status, there = jaw("joints", **state)
    assert status == OK
    near = there["pose"] - 1e-3 * there["pose_rate"]
    read = {name: there[name] for name in ("joint", "joint_rate")}
    status, back = jaw("state", **read, pose_before=near)
    assert status == OK
    np.testing.assert_allclose(back["q"], state["q"], atol=1e-11)
    np.testing.assert_allclose(back["q1"], state["q1"], atol=1e-9)


def test_derivatives_are_differences(jaw: Library) -> None:
    """Of sixth order, along a direction of all inputs; columns by q, q1 and q2 add up to it."""
    rng, h = np.random.default_rng(8), 2e-4
    for question in ("contact", "forward"):
        sizes = {a.name: a.size for a in jaw.exported[question].inputs}
        at = {name: 0.002 * rng.normal(size=n) for name, n in sizes.items()}
        way = {name: rng.normal(size=n) for name, n in sizes.items()}
        tangent = {f"d_{name}": x for name, x in way.items()}
        status, slope = jaw(f"{question}_derivative", **at, **tangent)
        assert status == OK
        differences: dict[str, Any] = {}
        for step, weight in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60)):
            for s in (step, -step):
                moved = {name: at[name] + s * h * way[name] for name in at}
                for name, x in jaw(question, **moved)[1].items():
                    differences[name] = differences.get(name, 0) + np.sign(s) * weight / h * x
        for name, right in differences.items():
            close(slope[f"d_{name}"], right, 1e-8)
        if question == "contact":
            along = {name: d * (name in ("d_q", "d_q1", "d_q2")) for name, d in tangent.items()}
            wanted = jaw("contact_derivative", **at, **along)[1]["d_effort"]
            status, columns = jaw("derivatives", **at)
            states = ("q", "q1", "q2")
            by = [columns[f"effort_by_{q}"].reshape(4, 6).T @ way[q] for q in states]
            assert status == OK
            close(np.sum(by, axis=0), wanted, 1e-11)
            for q, part in zip(states, by, strict=True):
                only = {name: d * (name == f"d_{q}") for name, d in tangent.items()}
                close(part, jaw("contact_derivative", **at, **only)[1]["d_effort"], 1e-11)
    (by_q,) = (a for a in jaw.exported["derivatives"].outputs if a.name == "effort_by_q")
    assert by_q.labels[1] == "temporalis_right by X" and by_q.units[0] == "(N m)/(m)"


class Homing(ControllerTable):
    """A law of one's own: it brings the state home, and counts its calls."""

    ports: ClassVar[Mapping[str, str | int]] = {"stiffness": "coordinate", "loss": 1}
    memory: ClassVar[tuple[float, ...]] = (0.0,)
    kind: Literal["homing"]

    def numbers(self, machine: Any) -> Mapping[str, Any]:
        return {}

    @staticmethod
    def equations(c: Control) -> Any:
        q2 = -c.gains.stiffness * c.measured.q - c.gains.loss * c.measured.q1
        return c.inverse(c.measured.q, c.measured.q1, q2), c.memory + 1


def test_controllers_are_the_inverse_at_a_corrected_acceleration(
    jaw: Library, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Ours, and a law of one's own; and forward dynamics undoes inverse dynamics."""
    rng = np.random.default_rng(5)
    q, q1, q_d, q1_d, q2_d = 0.01 * rng.normal(size=(5, 4))
    kp, kd = rng.uniform(1, 100, (2, 4))
    load = {"force": [1.0, -2.0, 3.0], "point": [0.05, 0.02, -0.01]}
    wanted = {"q_d": q_d, "q1_d": q1_d, "q2_d": q2_d, "kp": kp, "kd": kd}
    status, found = jaw("computed_torque", q=q, q1=q1, **wanted, **load)
    q2 = q2_d + kd * (q1_d - q1) + kp * (q_d - q)
    acting = np.hstack([load["force"], np.zeros(3)]), load["point"]
    assert status == OK
    free = model("masticatory").unchecked()
    close(found["effort"], free.inverse_dynamics(q, q1, q2, *acting), 1e-13)

    states = {"q": 0.4 * q, "q1": 4 * q1, **load}
    status, found = jaw("contact", q2=40 * q_d, **states)
    again, back = jaw("forward", effort=found["effort"], **states)
    assert status == again == OK
    np.testing.assert_allclose(back["acceleration"], 40 * q_d, rtol=1e-10)
    np.testing.assert_allclose(back["contact_force"], found["contact_force"], rtol=1e-10)

    monkeypatch.setitem(CONTROLLERS, "homing", Homing)
    mechanism = condyle.load_mechanism("gough-stewart")
    law = Library(export(mechanism, ("homing",), prefix="arm", lanes=0), tmp_path)
    given = [a.name for a in law.exported["homing"].inputs]
    assert given == ["q", "q1", "memory_before", "stiffness", "loss"]
    q, q1 = 0.01 * rng.normal(size=(2, 6))
    stiffness = np.arange(1.0, 7.0)
    status, found = law("homing", q=q, q1=q1, memory_before=4.0, stiffness=stiffness, loss=3.0)
    assert status == OK and found["memory"] == 5.0
    right = model("gough-stewart").unchecked().inverse_dynamics(q, q1, -stiffness * q - 3.0 * q1)
    close(found["effort"], right, 1e-12)


def test_recorded_samples_keep_a_distance_from_borders() -> None:
    """Where rounding of another processor could turn a status, none is recorded."""

    def reference(question: str, given: Mapping[str, np.ndarray]) -> Any:
        x = given["x"][:, 0]
        return {}, np.where(np.isnan(x), OUT_OF_BOUNDS, np.where(x > 0.5, UNREACHABLE, OK))

    x = np.array([0.2, 0.5, 0.5 + 1e-12, 0.5 - 1e-11, 0.9, np.nan])[:, None]
    status = reference("", {"x": x})[1]
    sure = clear(reference, "", {"x": x}, status, 1e-9)  # type: ignore[arg-type]
    assert list(sure) == [True, False, False, False, True, True]
    exported = export(condyle.load_mechanism("masticatory"), ("inverse",), lanes=0)
    (recorded,) = vectors(exported)
    assert len(recorded.status) == 40 and {OK, UNREACHABLE} < {*recorded.status}
