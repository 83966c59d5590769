"""The package for ros2_control, compiled against declared headers and driven without ROS."""

from __future__ import annotations

import ast
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from support.tools import need

import condyle
from condyle.errors import CondyleError
from condyle.simulation import running
from condyle.simulation.control import drive_of
from condyle.simulation.simulating import planned

pytestmark = pytest.mark.usefixtures("compiler_command")

HEADERS = Path(__file__).parents[1] / "support" / "ros2"
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror")
LAW = {"kind": "computed_torque", "rate": 1000.0, "stiffness": 1e4, "delay": 1}
CHEW: dict[str, Any] = {
    "duration": 5.0,
    "method": "rk4",
    "step": 1e-3,
    "controller": LAW,
    "sensors": {"encoder_resolution": 1e-5, "velocity_cutoff": 200.0},
    "load": [{"kind": "food", "food": "bolus", "point": "right_molar"}],
}
BITE: dict[str, Any] = {
    "duration": 1.0,
    "method": "rk4",
    "step": 1e-3,
    "start": {"beta": 0.08},
    "controller": {"kind": "bite_force", "stiffness": 900.0, "force": 40.0, "delay": 1},
    "sensors": {"encoder_resolution": 1e-5},
    "load": [{"kind": "food", "food": "bolus", "thickness": 4e-3}],
}
SOFT: dict[str, Any] = {
    "duration": 1.0,
    "method": "rk4",
    "step": 2e-3,
    "start": {"X": 5e-4, "beta": 0.05},
    "controller": {
        "kind": "impedance", "point": "incisor", "stiffness": 500.0, "damping": 20.0,
        "rate": 250.0, "delay": 2,
    },
    "sensors": {"velocity": "exact"},
}  # fmt: skip
FOLLOW: dict[str, Any] = {
    "duration": 1.0,
    "start": {"X": 5e-4, "beta": 0.02},
    "controller": LAW,
    "sensors": {"velocity_cutoff": 200.0},
}
CASES = {
    "chew": CHEW,
    "bite": BITE,
    "filter": BITE | {"observer": {"kind": "kalman"}, "sensors": {"encoder_noise": 1e-4}},
    "impedance": SOFT,
}


def changed(**changes: float) -> condyle.Mechanism:
    """The reference mechanism with other numbers of an actuator."""
    actuator = "chain.masseter_left.actuator"
    machine = condyle.load_mechanism("masticatory")
    return machine.set({f"{actuator}.{key}": value for key, value in changes.items()})


def compiled(folder: Path, program: str, *plugins: str, optimised: str = "-O0") -> Path:
    """A program of the tests with plugins of the package in a folder."""
    need("gcc", "g++")
    name = ElementTree.parse(folder / "package.xml").findtext("name")
    source, objects = folder / "src", []
    for c in source.glob("*.c"):
        objects.append(folder / f"{c.stem}.o")
        flags = ("-std=c99", optimised, "-Wall", "-Wextra", "-Werror")
        subprocess.run(["gcc", *flags, "-c", c, "-o", objects[-1]], check=True)
    made = folder / program
    texts = [HEADERS / f"{program}.cpp", *(source / f"{one}.cpp" for one in plugins)]
    flags = ("-std=c++17", optimised, *STRICT, f"-I{HEADERS}", f"-I{source}", f"-DPACKAGE={name}")
    subprocess.run(["g++", *flags, *texts, *objects, "-o", made, "-lm"], check=True)
    return made


def rows_of(program: Path, *words: object, given: np.ndarray | None = None) -> np.ndarray:
    """What a program says, a row a line."""
    text = "" if given is None else "\n".join(" ".join(map(repr, r)) for r in given.tolist())
    call = [str(program), *map(str, words)]
    done = subprocess.run(call, input=text, capture_output=True, text=True, cwd=program.parent)
    assert done.returncode == 0, done.stderr
    return np.array([line.split() for line in done.stdout.splitlines()], dtype=float)


@pytest.fixture(scope="module")
def follower(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package of `FOLLOW`, compiled; an encoder does not read zero at home."""
    folder = tmp_path_factory.mktemp("ros2")
    condyle.export_ros2(changed(zero=0.3), FOLLOW, folder, solver=True, package="jaw")
    compiled(folder, "drive", "controller", "loopback")
    return folder


@pytest.mark.parametrize(
    "name",
    [
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("chew", "impedance")),
        *(pytest.param(name, marks=pytest.mark.ci) for name in ("bite", "filter")),
    ],
)
def test_update_is_the_simulations_tick(name: str, tmp_path: Path) -> None:
    """Fed with what the simulation measures: its efforts, estimates and memory, and no heap."""
    scenario = CASES[name]
    (plan,) = planned(condyle.derive("masticatory"), [scenario])
    condyle.export_ros2("masticatory", scenario, tmp_path)
    optimised = "-O2" if name == "chew" else "-O0"
    driver = compiled(tmp_path, "drive", "controller", "loopback", optimised=optimised)
    run = running.Run([plan])
    (trace,) = run.traces()
    control, ticks = run.control, len(plan.ticks())
    assert control is not None and len(trace.command) == ticks
    commands = np.clip(trace.command, plan.low, plan.high)
    late = np.maximum(np.arange(ticks) - 1 - drive_of(plan).delay, 0)

    def sampled(result: str) -> np.ndarray:
        return control.samples[:, control.columns.result(result), 0]

    texts = (tmp_path / "src" / "numbers.hpp").read_text()
    names = re.findall('"([^"]*)"', re.search("MEASURED.*", texts)[0])  # type: ignore[index]
    known = {"position": trace.count, "velocity": sampled("joint_rate"), "effort": commands[late]}
    chains = list(plan.model.mechanism.chain_names)
    given = np.empty((ticks, len(names)))
    for i, interface in enumerate(names):
        owner, _, kind = interface.partition("/")
        axis = "xyz".find(kind[-1])
        force = owner == "load"
        given[:, i] = (
            sampled("measured_force")[:, axis] if force else known[kind][:, chains.index(owner)]
        )
    found = rows_of(driver, "feed", tmp_path / "config" / "path.csv", ticks, given=given)
    n, m = len(chains), len(plan.q)
    effort, state, memory, made = np.split(found, [n, n + 2 * m, found.shape[1] - 1], axis=1)
    right = sampled("memory") if drive_of(plan).law.memory.size else np.empty((ticks, 0))
    assert memory.shape == right.shape
    assert np.abs(effort - commands).max() < 1e-12 * np.abs(commands).max()
    assert np.abs(state - trace.estimate).max() < 1e-12 * np.abs(trace.estimate).max()
    assert np.abs(memory - right).max(initial=0.0) < 1e-12 * np.abs(right).max(initial=1.0)
    assert not made.any()


@pytest.mark.slow
def test_controller_and_simulated_hardware_are_the_simulation(tmp_path: Path) -> None:
    """Both integrate by the same method and step, so that rounding alone parts them.

    Over a second of a stable loop they stay within 1e-14; compilers that fuse products differ by
    more. Steps that are finer change joints by 7e-10 rad, those of twice the size by 1e-8.
    """
    machine = changed(zero=0.3)
    condyle.export_ros2(machine, SOFT, tmp_path)
    driver = compiled(tmp_path, "drive", "controller", "loopback")
    (plan,) = planned(condyle.derive(machine), [SOFT])
    trace = running.run(plan)
    found = rows_of(driver, "loop", tmp_path / "config" / "path.csv", len(plan.ticks()))
    effort, joint, state = np.split(found, [6, 12], axis=1)
    assert set(state.ravel()) == {3.0}
    assert np.abs(joint - trace.count).max() < 1e-10
    assert np.abs(effort - trace.command).max() < 1e-9 * np.abs(trace.command).max()
    log = np.genfromtxt(tmp_path / "log.csv", delimiter=",", names=True)
    assert np.array_equal(log["tau_masseter_left"], effort[:, 2])


def test_it_homes_and_follows_from_off(follower: Path) -> None:
    path = np.loadtxt(follower / "config" / "path.csv", delimiter=",", skiprows=1)
    found = rows_of(follower / "drive", "home", follower / "config" / "path.csv", 6000)
    states = found[:, -1].astype(int).tolist()
    assert list(dict.fromkeys(states)) == [1, 2, 3] and states[-1] == 2  # holds in the end
    model = condyle.derive("masticatory")
    goal = model.inverse_kinematics(path[-1, 1:5]).joint + np.array([0, 0, 0.3, 0, 0, 0])
    assert np.abs(found[-1, 6:12] - goal).max() < 1e-3
    assert np.abs(np.diff(found[:, :6], axis=0)).max() < 0.1  # N m in 1 ms, of 3 N m


def test_lost_encoders_and_lost_equations_are_errors(follower: Path) -> None:
    path = follower / "config" / "path.csv"
    states = rows_of(follower / "drive", "lost", path, 2000)[:, -1].astype(int)
    assert set(states[:23]) == {3} and states[23] == 4  # borne for three ticks, then a safe stop
    assert len(states) < 600  # once it is off, update returns ERROR
    start = condyle.derive("masticatory").inverse_kinematics([5e-4, 0, 0, 0.02]).joint[0]
    for effort in (0, 3):
        positions = rows_of(follower / "drive", "fall", path, effort)[:, 0]
        assert abs(positions[0] - start) < 1e-12  # uncommanded it stands still
        assert (np.diff(positions[:10]) < 0).all()  # under efforts of zero it falls
        assert len(positions) < 1000  # and out of reach it says so


@pytest.mark.slow
def test_the_solver_is_the_model(tmp_path: Path) -> None:
    machine = changed(zero=0.3, viscous=0.01, coulomb=0.02)
    condyle.export_ros2(machine, FOLLOW, tmp_path, solver=True)
    solve = compiled(tmp_path, "solve", "solver")
    rng = np.random.default_rng(4)
    model, rows, right = condyle.derive("masticatory"), [], []
    q = rng.uniform(-1, 1, (20, 4)) * [2e-3, 1e-3, 0.03, 0.08]
    q1, q2 = rng.normal(size=(2, 20, 4)) * [0.01, 0.01, 0.3, 0.5]
    h = 1e-4

    def joint(at: np.ndarray) -> np.ndarray:
        return np.asarray(model.inverse_kinematics(at).joint + machine.zeros)

    for one in zip(q, q1, q2, strict=True):
        # Along a parabola with that velocity and acceleration; differences are good to 1e-7.
        behind, here, ahead = (joint(one[0] + s * one[1] + s * s / 2 * one[2]) for s in (-h, 0, h))
        rows.append(
            np.hstack([here, (ahead - behind) / (2 * h), (ahead - 2 * here + behind) / h**2])
        )
        right.append(model.inverse_dynamics(*one).effort)
    found = rows_of(solve, given=np.array(rows))
    torque, inertia, coriolis, gravity, friction = np.split(found, [6, 42, 48, 54], axis=1)
    assert np.abs(torque - right).max() < 1e-6 * np.abs(right).max()
    M = inertia.reshape(-1, 6, 6)
    assert np.abs(M - M.transpose(0, 2, 1)).max() < 1e-12 * np.abs(M).max()
    total = np.einsum("kij,kj->ki", M, np.array(rows)[:, 12:]) + coriolis + gravity
    assert np.abs(total - torque).max() < 1e-11 * np.abs(torque).max()
    still = [model.inverse_dynamics(one, 0 * one, 0 * one).effort for one in q]
    assert np.abs(gravity - still).max() < 1e-11
    v = np.array(rows)[:, 8]
    assert np.allclose(friction[:, 2], 0.01 * v + 0.02 * v / np.sqrt(v**2 + 1e-6), rtol=1e-12)
    assert not friction[:, [0, 1, 3, 4, 5]].any()


def test_files_name_one_another(follower: Path, tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    made = condyle.export_ros2("masticatory", SOFT, plain)
    assert made.data["package"] == "masticatory_ros2" and not list(plain.rglob("*solver*"))
    for folder, name, solver, rate in (
        (follower, "jaw", True, 1000),
        (plain, "masticatory_ros2", False, 250),
    ):
        cmake = (folder / "CMakeLists.txt").read_text()
        listed = re.findall(r"src/\S+?\.c(?:pp)?\b|\w+_plugin\.xml", cmake)
        assert listed and all((folder / file).is_file() for file in listed)
        for text in re.findall(r"install\(DIRECTORY (.*?) DESTINATION", cmake):
            assert all((folder / part).is_dir() for part in text.split())
        needs = {e.text for e in ElementTree.parse(folder / "package.xml").iter("depend")}
        found = set(re.findall(r"find_package\((\w+)", cmake)) - {"ament_cmake", "Eigen3"}
        assert found == needs - {"eigen"} and ("inverse_dynamics_solver" in needs) == solver
        classes = set()
        for plugin in folder.glob("*_plugin.xml"):
            library = ElementTree.parse(plugin).getroot()
            assert f"add_library({library.get('path')} SHARED" in cmake
            classes |= {e.get("name") for e in library.iter("class")}
        settings = yaml.safe_load((folder / "config" / "controllers.yaml").read_text())
        manager = settings["controller_manager"]["ros__parameters"]
        assert manager[f"{name}_controller"]["type"] in classes and manager["update_rate"] == rate
        urdf = ElementTree.parse(folder / "urdf" / f"{name}.urdf").getroot()
        assert urdf.findtext("ros2_control/hardware/plugin") in classes
        driven = [e.get("name") for e in urdf.iterfind("ros2_control/joint")]
        assert driven == [e.get("name") for e in urdf.iterfind("joint")]
        assert driven == list(condyle.load_mechanism("masticatory").chain_names)
        ast.parse((folder / "launch" / f"{name}.launch.py").read_text())
        for file in folder.rglob("*"):
            if file.suffix not in ("", ".o"):
                assert not re.search(r"@\w+@", file.read_text()), file


def renamed(mechanism: str, chain: str) -> condyle.Mechanism:
    machine = condyle.load_mechanism("masticatory")
    first = machine.chains[0].model_copy(update={"name": chain})
    return machine.replace(name=mechanism, chains=(first, *machine.chains[1:]))


@pytest.mark.parametrize(
    ("name", "package"),
    [("2. Jaw -- <A> */ @prefix@", "n2_jaw_a_prefix_ros2"), ("class", "class_ros2")],
)
def test_names_are_made_valid(name: str, package: str, tmp_path: Path) -> None:
    made = condyle.export_ros2(renamed(name, "left one"), SOFT, tmp_path)
    assert made.data["package"] == package
    assert any("left_one" in note for note in made.notes)
    for file in ("package.xml", f"urdf/{package}.urdf"):
        ElementTree.parse(tmp_path / file)
    assert "left_one/position" in (tmp_path / "src" / "numbers.hpp").read_text()
    ast.parse((tmp_path / "launch" / f"{package}.launch.py").read_text())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda: {"package": "Jaw"}, "small letters"),
        (lambda: {"package": "a__b"}, "small letters"),
        (lambda: {"package": "rclcpp"}, "that it uses"),
        (lambda: {"solver": np.zeros(2)}, "solver"),
        (lambda: {"scenario": SOFT | {"sensors": None}}, "sensors"),
        (lambda: {"scenario": SOFT | {"controller": LAW | {"rate": 999.5}}}, "whole numbers"),
    ],
)  # fmt: skip
def test_what_ros_cannot_take_is_refused(
    change: Callable[[], dict[str, Any]], words: str, tmp_path: Path
) -> None:
    given = {"scenario": SOFT} | change()
    given["scenario"] = {k: v for k, v in given["scenario"].items() if v is not None}
    with pytest.raises(CondyleError, match=words):
        condyle.export_ros2("masticatory", path=tmp_path / "out", **given)
    assert not (tmp_path / "out").exists()


def test_muscles_are_refused_and_cables_are_not(tmp_path: Path) -> None:
    law = {"kind": "joint_pd", "stiffness": 5.0, "damping": 0.1, "distribution": "minimum_norm"}
    scenario = {"controller": law, "sensors": {}}
    with pytest.raises(CondyleError, match="activation of muscles"):
        condyle.export_ros2("human-jaw-muscles", scenario, tmp_path / "out")
    made = condyle.export_ros2("cable-robot", scenario, tmp_path / "cables", solver=True)
    assert (tmp_path / "cables" / "src" / "solver.cpp") in made


@pytest.mark.slow
def test_rods_that_slide_and_no_contacts(tmp_path: Path) -> None:
    scenario = {"controller": {"kind": "joint_pd", "stiffness": 5.0, "damping": 0.1}, "sensors": {}}
    condyle.export_ros2("gough-stewart", scenario, tmp_path)
    compiled(tmp_path, "drive", "controller", "loopback")
    urdf = ElementTree.parse(tmp_path / "urdf" / "gough_stewart_ros2.urdf").getroot()
    assert {e.get("type") for e in urdf.iterfind("joint")} == {"prismatic"}
