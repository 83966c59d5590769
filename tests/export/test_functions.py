"""What exported functions do: bad samples, constants that change, poses from encoders."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from export.conftest import Folder
from support.loads import parts
from support.tools import run

import condyle
from condyle.errors import InputError
from condyle.export import Exported, export
from condyle.model.forward_kinematics import ForwardKinematics
from condyle.questions.law import CONTROLLERS, Control, ControllerTable
from condyle.status import Status

Folders = Callable[[str], Folder]
OK, UNREACHABLE, SINGULAR, OUT_OF_BOUNDS, INFEASIBLE = range(5)
KEPT = 77.0  # what stands in results before a call


class Library:
    """Exported functions on arrays: by question, arguments by name."""

    def __init__(self, exported: Exported, folder: Path) -> None:
        self.exported = exported
        (folder / f"{exported.prefix}.c").write_text(exported.source)
        (folder / f"{exported.prefix}.h").write_text(exported.header)
        flags = ("-std=c99", "-O1", "-ffp-contract=fast", "-shared", "-fPIC")
        run("gcc", *flags, f"{exported.prefix}.c", "-o", "exported.so", "-lm", folder=folder)
        self._library = ctypes.CDLL(str(folder / "exported.so"))

    def __call__(
        self, question: str, **given: np.ndarray | float
    ) -> tuple[int, dict[str, np.ndarray]]:
        f = self.exported[question]
        real = np.float32 if self.exported.precision == "float" else np.float64
        arrays = {
            a.name: np.full(a.size, 0.0 if a.given else KEPT, dtype=real) for a in f.arguments
        }
        for name, value in given.items():
            arrays[name][:] = value
        pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in arrays.values()]
        status = getattr(self._library, f.name)(*pointers)
        return status, {a.name: arrays[a.name] for a in f.outputs}


@pytest.fixture(scope="module")
def jaw(folder: Folders, tmp_path_factory: pytest.TempPathFactory) -> Library:
    return Library(folder("jaw").exported, tmp_path_factory.mktemp("library"))


def test_operations_are_of_all_that_a_function_does(jaw: Library) -> None:
    """A controller works no less than the inverse dynamics in it."""
    inverse, controller = (jaw.exported[q].operations for q in ("inverse", "computed_torque"))
    assert controller > inverse > 1000


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e60, -1e200, 1e308])
@pytest.mark.parametrize("question", ["inverse", "forward", "motion", "pose", "closure"])
def test_no_number_gets_in(jaw: Library, question: str, bad: float) -> None:
    """Not by any argument; and what stood in the results stays."""
    for a in jaw.exported[question].inputs:
        for i in range(a.size):
            value = np.zeros(a.size)
            value[i] = bad
            status, found = jaw(question, **{a.name: value})
            assert status == OUT_OF_BOUNDS, (a.name, i)
            assert all((v == KEPT).all() for v in found.values())


def test_out_of_reach(jaw: Library) -> None:
    for question in ("inverse", "contact", "computed_torque"):
        status, found = jaw(question, q=[0.3, 0, 0, 0])
        assert status == UNREACHABLE and (found["effort"] == KEPT).all()


def test_a_singular_pose_is_named_and_others_balance(tmp_path: Path) -> None:
    """A hexapod a quarter turn about Z is singular; towards it by tenths, what is ok balances."""
    mechanism = condyle.load_mechanism("gough-stewart")
    hexapod = Library(export(mechanism, ("inverse",), prefix="hexapod", lanes=0), tmp_path)
    status, found = hexapod("inverse", q=[0, 0, 0, 0, 0, np.pi / 2], force=[1.0, 0, 0])
    assert status == SINGULAR and (found["effort"] == KEPT).all()
    model = condyle.derive(mechanism, backend="numpy")
    passed = 0
    for size in 10.0 ** -np.arange(1, 9):
        q = np.array([0.01, -0.02, 0.015, 0.02, -0.03, np.pi / 2 - size])
        status, found = hexapod("inverse", q=q, force=[1.0, 2.0, -30.0])
        if status == OK:
            J = model.jacobians(q[None]).J_theta[0]
            right = model.inverse_dynamics(
                q[None],
                0 * q[None],
                0 * q[None],
                *parts(np.array([[1.0, 2, -30, 0, 0, 0, 0, 0, 0]])),
            ).effort[0]
            off = np.abs(J.T @ (found["effort"] - right)).max()
            assert off <= 1e-11 * np.abs(J.T @ np.diag(right)).max()
            passed += 1
    assert passed >= 5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("precision", "formulation"),
    [("double", "virtual_power"), ("float", "virtual_power"), ("double", "lagrange")],
)
def test_a_gimbal_lock_is_named_before_digits_are_lost(
    tmp_path: Path, precision: str, formulation: str
) -> None:
    """Towards it by tenths: accelerations that are given are right, and below there is one word.

    A hexapod held by its efforts: the platform does not accelerate.
    """
    mechanism = condyle.load_mechanism("gough-stewart")
    model = condyle.derive(mechanism, backend="numpy")
    options = {"precision": precision, "prefix": "p", "lanes": 0, "formulation": formulation}
    hexapod = Library(export(mechanism, ("forward",), **options), tmp_path)
    word, most = int(Status.gimbal_lock), 1e-6 if precision == "double" else 2e-1
    told = []
    for away in 10.0 ** -np.arange(1, 10):
        q = np.array([0, 0, 0, 0.1, np.pi / 2 - away, 0.2])
        effort = model.inverse_dynamics(q, 0 * q, 0 * q).effort
        status, found = hexapod("forward", q=q, effort=effort)
        assert status == word or np.abs(found["acceleration"]).max() < most, away
        told.append(status)
    assert set(told) == {OK, word} and told == sorted(told)


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "float"])
def test_the_bound_of_the_library(tmp_path: Path, precision: str) -> None:
    """To a few percent in double; in float it holds, too, and is in the scale of float."""
    mechanism = condyle.load_mechanism("masticatory")
    questions = ("inverse", "contact", "forward")
    jaw = Library(export(mechanism, questions, outputs=("bound",), precision=precision), tmp_path)
    model = condyle.derive(mechanism, backend="numpy")
    rng = np.random.default_rng(3)
    for size in (0.01, 0.05, 0.1):
        q, q1, q2 = (rng.uniform(-size, size, (3, 4)) * [0.02, 0.02, 1, 1]).astype(np.float32)
        right = model.inverse_dynamics(q, q1, q2)
        back = model.forward_dynamics(q, q1, right.effort)
        for question in questions:
            given = {"effort": right.effort} if question == "forward" else {"q2": q2}
            status, found = jaw(question, q=q, q1=q1, **given)
            assert status == OK
            own, name = (back, "acceleration") if question == "forward" else (right, "effort")
            if precision == "double":
                assert found["bound"][0] == pytest.approx(float(own.bound), rel=0.05)
                continue
            best = getattr(own, name)
            off = np.abs(found[name] - best).max() / np.abs(best).max()
            assert off < found["bound"][0]
            assert found["bound"][0] == pytest.approx(float(own.bound) * 2.0**29, rel=0.5)


@pytest.mark.slow
def test_gravity_and_a_moving_base_at_every_call(tmp_path: Path) -> None:
    mechanism = condyle.load_mechanism("masticatory")
    questions = ("contact", "forward", "motion")
    jaw = Library(export(mechanism, questions, inputs=("base", "gravity"), lanes=0), tmp_path)
    assert [a.name for a in jaw.exported["contact"].inputs][-2:] == ["gravity", "base"]
    assert jaw.exported["contact"].inputs[-1].units[2:4] == ("m/s^2", "rad/s")
    assert "base" not in [a.name for a in jaw.exported["motion"].inputs]
    model, rng = condyle.derive(mechanism, backend="numpy"), np.random.default_rng(3)
    q, q1, q2 = rng.uniform(-0.05, 0.05, (3, 4)) * [0.02, 0.02, 1, 1]
    around = {"gravity": rng.normal(0, 9, 3), "base": rng.normal(0, 6, 9)}
    right = model.inverse_dynamics(q, q1, q2, **around)
    status, found = jaw("contact", q=q, q1=q1, q2=q2, **around)
    assert status == OK
    np.testing.assert_allclose(found["effort"], right.effort, rtol=1e-11)
    np.testing.assert_allclose(found["contact_force"], right.contact_force, rtol=1e-11)
    status, found = jaw("forward", q=q, q1=q1, effort=right.effort, **around)
    assert status == OK
    np.testing.assert_allclose(found["acceleration"], q2, atol=1e-9)


def test_inputs_that_there_are_not() -> None:
    mechanism = condyle.load_mechanism("masticatory")
    with pytest.raises(InputError, match="expected gravity or base"):
        export(mechanism, ("inverse",), inputs=("wind",))
    with pytest.raises(InputError, match="none of motion, pose has gravity or inertia"):
        export(mechanism, ("motion", "pose"), inputs=("base",))


def test_outputs_that_there_are_not() -> None:
    mechanism = condyle.load_mechanism("masticatory")
    with pytest.raises(InputError, match="expected bound"):
        export(mechanism, ("inverse",), outputs=("share",))
    with pytest.raises(InputError, match="none of motion, pose has a bound"):
        export(mechanism, ("motion", "pose"), outputs=("bound",))


def test_small_and_denormal_numbers_are_numbers(jaw: Library) -> None:
    home = jaw("inverse")
    assert home[0] == OK
    for tiny in (5e-324, -1e-310, 1e-200):
        status, found = jaw("inverse", q=tiny, q1=tiny, q2=tiny, force=tiny)
        assert status == OK
        np.testing.assert_allclose(found["effort"], home[1]["effort"], rtol=1e-12)


def test_poses_from_encoders_follow_a_motion(jaw: Library) -> None:
    """Each from the one before, as the library finds them; from far off they are not guessed."""
    model = condyle.derive(condyle.load_mechanism("masticatory"))
    t = np.linspace(0, 2 * np.pi, 60)[:, None]
    q = np.hstack(
        [0.004 * np.sin(t), 0.002 * np.sin(2 * t), 0.08 * (1 - np.cos(t)), 0.03 * np.sin(t)]
    )
    poses, _ = model.poses.whole(q, 0 * q, 0 * q)
    joints = model.kernel("encoders").run({"pose": poses["pose"]}).values["joint"].T
    start = np.zeros(6)
    for joint, pose in zip(joints, poses["pose"], strict=True):
        status, found = jaw("pose", joint=joint, start=start)
        assert status == OK
        np.testing.assert_allclose(found["pose"], pose, atol=1e-11)
        assert np.abs(found["residual"]).max() < 1e-11
        start = found["pose"]
    assert jaw("pose", joint=joints[30] + [0.1, 0, 0, 0, 0, 0], start=start)[0] == INFEASIBLE
    right = ForwardKinematics(model.mechanism).solve(joints[:1] + 3.0).status[0]
    assert right != OK and jaw("pose", joint=joints[0] + 3.0)[0] in (UNREACHABLE, SINGULAR)


def test_the_state_from_encoders_and_their_rates(jaw: Library) -> None:
    """Joints and rates of a state give it back."""
    q, q1 = np.array([[0.002, 0.001, 0.05, 0.02], [0.03, -0.02, 0.4, 0.3]])
    status, found = jaw("joints", q=q, q1=q1)
    assert status == OK
    near = found["pose"] - 1e-3 * found["pose_rate"]
    given = {"joint": found["joint"], "joint_rate": found["joint_rate"], "pose_before": near}
    status, back = jaw("state", **given)
    assert status == OK
    np.testing.assert_allclose(back["q"], q, atol=1e-11)
    np.testing.assert_allclose(back["q1"], q1, atol=1e-9)


@pytest.mark.parametrize("question", ["contact", "forward"])
def test_derivatives_are_differences(jaw: Library, question: str) -> None:
    rng = np.random.default_rng(8)
    sizes = {a.name: a.size for a in jaw.exported[question].inputs}
    at = {name: 0.002 * rng.normal(size=n) for name, n in sizes.items()}
    way = {name: rng.normal(size=n) for name, n in sizes.items()}
    status, slope = jaw(f"{question}_derivative", **at, **{f"d_{k}": v for k, v in way.items()})
    assert status == OK
    h = 1e-6
    ends = [jaw(question, **{k: at[k] + s * h * way[k] for k in at})[1] for s in (1, -1)]
    for name in ends[0]:
        found = (ends[0][name] - ends[1][name]) / (2 * h)
        scale = np.abs(found).max()
        np.testing.assert_allclose(slope[f"d_{name}"], found, rtol=0, atol=1e-6 * scale)


def test_slopes_of_efforts(jaw: Library) -> None:
    """By q, q1 and q2: against differences of the exported inverse dynamics, of sixth order."""
    rng, h = np.random.default_rng(3), 2e-4
    sizes = {a.name: a.size for a in jaw.exported["inverse"].inputs}
    at = {name: 0.002 * rng.normal(size=n) for name, n in sizes.items()}
    status, found = jaw("derivatives", **at)
    assert status == OK
    (by_q,) = (a for a in jaw.exported["derivatives"].outputs if a.name == "effort_by_q")
    assert by_q.labels[1] == "temporalis_right by X" and by_q.units[0] == "(N m)/(m)"
    for name in ("q", "q1", "q2"):
        columns = []
        for unit in np.eye(4):
            total = 0.0
            for step, weight in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60)):
                for sign in (1, -1):
                    moved = at | {name: at[name] + sign * step * h * unit}
                    total = total + sign * weight / h * jaw("inverse", **moved)[1]["effort"]
            columns.append(total)
        right = np.concatenate(columns)
        error = np.abs(found[f"effort_by_{name}"] - right).max()
        assert error <= 1e-9 * np.abs(right).max(), name


def test_turning_joints_may_count_whole_turns(jaw: Library) -> None:
    assert jaw("pose", joint=2 * np.pi * np.arange(-3, 3))[0] == OK


def test_the_controller_is_the_inverse_at_a_corrected_acceleration(jaw: Library) -> None:
    rng = np.random.default_rng(5)
    q, q1, q_d, q1_d, q2_d = 0.01 * rng.normal(size=(5, 4))
    kp, kd = rng.uniform(1, 100, (2, 4))
    load = {"force": [1.0, -2.0, 3.0], "point": [0.05, 0.02, -0.01]}
    wanted = {"q_d": q_d, "q1_d": q1_d, "q2_d": q2_d, "kp": kp, "kd": kd}
    status, found = jaw("computed_torque", q=q, q1=q1, **wanted, **load)
    q2 = q2_d + kd * (q1_d - q1) + kp * (q_d - q)
    model = condyle.derive(condyle.load_mechanism("masticatory"))
    acting = np.hstack([load["force"], np.zeros(3), load["point"]])
    right = model.unchecked().inverse_dynamics(q, q1, q2, *parts(acting))
    assert status == OK
    np.testing.assert_allclose(found["effort"], right, rtol=0, atol=1e-13 * np.abs(right).max())


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


def test_a_law_of_ones_own_is_exported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(CONTROLLERS, "homing", Homing)
    mechanism = condyle.load_mechanism("gough-stewart")
    law = Library(export(mechanism, ("homing",), prefix="arm", lanes=0), tmp_path)
    given = [a.name for a in law.exported["homing"].inputs]
    assert given == ["q", "q1", "memory_before", "stiffness", "loss"]
    q, q1 = 0.01 * np.random.default_rng(7).normal(size=(2, 6))
    stiffness = np.arange(1.0, 7.0)
    gains = {"stiffness": stiffness, "loss": 3.0}
    status, found = law("homing", q=q, q1=q1, memory_before=4.0, **gains)
    assert status == OK and found["memory"] == 5.0
    model = condyle.derive(mechanism, backend="numpy")
    right = model.unchecked().inverse_dynamics(q, q1, -stiffness * q - 3.0 * q1)
    np.testing.assert_allclose(found["effort"], right, rtol=0, atol=1e-12 * np.abs(right).max())


def test_limits_bind_in_the_recorded_samples(folder: Folders) -> None:
    """Else the samples of `bounded` would say nothing that those of `contact` do not."""
    of = folder("limited")
    text = (of.path / f"{of.exported.prefix}_vectors.h").read_text()

    def recorded(name: str) -> np.ndarray:
        body = text.partition(f"{of.exported.prefix}_{name}[")[2].partition("= {")[2]
        rows = body.partition("};")[0]
        return np.array(
            [float(x) for x in rows.replace("{", "").replace("}", "").split(",") if x.strip()]
        )

    status = recorded("bounded_status")
    efforts = recorded("bounded_effort").reshape(len(status), -1)
    at_limit = np.isclose(np.abs(efforts), 0.35, atol=1e-12).any(axis=1)
    assert (status == INFEASIBLE).any() and at_limit.sum() >= 3
    assert np.abs(efforts).max() <= 0.35 + 1e-12


def test_forward_undoes_inverse(jaw: Library) -> None:
    rng = np.random.default_rng(6)
    q, q1, q2 = 0.004 * rng.normal(size=(3, 4)) * [[1], [10], [100]]
    states = {"q": q, "q1": q1, "force": [3.0, 1.0, -9.0], "point": 0.03}
    status, found = jaw("contact", q2=q2, **states)
    assert status == OK
    status, back = jaw("forward", effort=found["effort"], **states)
    assert status == OK
    np.testing.assert_allclose(back["acceleration"], q2, rtol=1e-10)
    np.testing.assert_allclose(back["contact_force"], found["contact_force"], rtol=1e-10)


def test_numbers_that_change_are_another_mechanism(tmp_path: Path) -> None:
    """A calibrated mechanism's numbers in the same code: its efforts."""
    nominal = condyle.load_mechanism("gough-stewart")
    chains = list(nominal.chains)
    chains[2] = chains[2].model_copy(update={"platform": tuple(np.add(chains[2].platform, 1e-3))})
    calibrated = nominal.model_copy(update={"chains": tuple(chains)})
    asked = {"questions": ("inverse",), "constants": "struct", "prefix": "arm"}
    one, other = (export(m, **asked) for m in (nominal, calibrated))
    assert one.source == other.source and one.header != other.header
    told = []
    for name, e in (("one", one), ("other", other)):
        (tmp_path / f"{e.prefix}.h").write_text(e.header)
        (tmp_path / f"{e.prefix}.c").write_text(e.source)
        program = """#include <stdio.h>
#include "arm.h"
int main(void) {
    arm_numbers numbers = ARM_NUMBERS;
    arm_constants constants;
    double q[6] = {0.01, 0.02, 0.01, 0.1, 0.2, 0.1}, zero[6] = {0}, effort[6];
    arm_prepare(&numbers, &constants);
    if (arm_inverse(&constants, q, zero, zero, zero, zero, zero, effort)) return 1;
    for (int i = 0; i < 6; i++) printf("%.17g\\n", effort[i]);
    return 0;
}
"""
        (tmp_path / "main.c").write_text(program)
        run("gcc", "-std=c99", "-O0", "main.c", "arm.c", "-o", name, "-lm", folder=tmp_path)
        told.append(np.array(run(f"./{name}", folder=tmp_path).split(), dtype=float))
    q = np.array([0.01, 0.02, 0.01, 0.1, 0.2, 0.1])
    for found, mechanism in zip(told, (nominal, calibrated), strict=True):
        right = (
            condyle.derive(mechanism, backend="numpy").unchecked().inverse_dynamics(q, 0 * q, 0 * q)
        )
        np.testing.assert_allclose(found, right, rtol=0, atol=1e-12 * np.abs(right).max())
    assert np.abs(told[0] - told[1]).max() > 1e-4 * np.abs(told[0]).max()
