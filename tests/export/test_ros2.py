"""The package for ros2_control, compiled against declared headers and driven without ROS."""

from __future__ import annotations

import ast
import re
import shutil
import signal
import subprocess
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from support.machines import model
from support.tools import need, run

import condyle
from condyle.errors import CondyleError
from condyle.export import ros2
from condyle.export.controller_states import CAUSES
from condyle.simulation import running
from condyle.simulation.control import drive_of
from condyle.simulation.simulating import planned

HEADERS = Path(__file__).parents[1] / "support" / "ros2"
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror")
LAW = {"kind": "computed_torque", "rate": 500.0, "stiffness": 1e3, "delay": 1}
FOLLOW: dict[str, Any] = {
    "duration": 1.0,
    "method": "rk4",
    "step": 1e-3,
    "start": {"X": 5e-4, "beta": 0.02},
    "controller": LAW,
    "sensors": {"velocity": "exact"},
}
BITE: dict[str, Any] = {
    "duration": 0.04,
    "method": "rk4",
    "step": 1e-3,
    "start": {"beta": 0.08},
    "controller": {"kind": "bite_force", "stiffness": 900.0, "force": 40.0, "delay": 1},
    "sensors": {"encoder_noise": 1e-4},
    "observer": {"kind": "kalman"},
    "load": [{"kind": "food", "food": "bolus", "thickness": 4e-3}],
}
DRIVES = {"kind": "joint_pd", "stiffness": 5.0, "damping": 0.1}


def lossy() -> condyle.Mechanism:
    """The reference mechanism with losses at an actuator whose encoder is not zero at home."""
    losses = {"zero": 0.3, "viscous": 0.01, "coulomb": 0.02, "smoothing_speed": 0.1}
    actuator = "chain.masseter_left.actuator"
    changes = {f"{actuator}.{key}": value for key, value in losses.items()}
    return condyle.load_mechanism("masticatory").set(changes)


def compiled(folder: Path, program: str, *plugins: str) -> Path:
    """A program of the tests with plugins of the package in a folder."""
    need("gcc", "g++")
    name = ElementTree.parse(folder / "package.xml").findtext("name")
    sources = sorted((folder / "src").glob("*.c"))
    objects = [folder / f"{c.stem}.o" for c in sources]
    for c, o in zip(sources, objects, strict=True):
        if not o.exists():
            flags = ("-std=c99", "-O0", "-Wall", "-Wextra", "-Werror")
            run("gcc", *flags, "-c", c, "-o", o, folder=folder)
    texts = [HEADERS / f"{program}.cpp", *(folder / "src" / f"{one}.cpp" for one in plugins)]
    flags = ("-std=c++17", "-O0", *STRICT, f"-I{HEADERS}", "-Isrc", f"-DPACKAGE={name}")
    run("g++", *flags, *texts, *objects, "-o", program, "-lm", folder=folder)
    return folder / program


def rows_of(program: Path, *words: object, given: np.ndarray | None = None) -> np.ndarray:
    """What a program says, a row a line, given lines of numbers."""
    text = "" if given is None else "\n".join(" ".join(map(repr, r)) for r in given.tolist())
    call = [str(program), *map(str, words)]
    done = subprocess.run(call, input=text, capture_output=True, text=True, cwd=program.parent)
    assert done.returncode == 0, done.stderr
    return np.array([line.split() for line in done.stdout.splitlines()], dtype=float)


@pytest.fixture(scope="module")
def follower(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package of `FOLLOW`, compiled."""
    folder = tmp_path_factory.mktemp("ros2")
    condyle.export_ros2(lossy(), FOLLOW, folder, solver=True, package="jaw")
    compiled(folder, "drive", "controller", "loopback")
    return folder


def require_same(folder: Path, machine: condyle.Mechanism, scenario: dict[str, Any]) -> Any:
    """Fed with what the simulation measures: its efforts, estimates and memory, and no heap."""
    (plan,) = planned(condyle.derive(machine), [scenario])
    run = running.Batch([plan])
    (trace,) = run.traces()
    control, ticks = run.control, len(plan.ticks())
    assert control is not None and len(trace.command) == ticks
    commands = np.clip(trace.command, plan.low, plan.high)
    late = np.maximum(np.arange(ticks) - 1 - drive_of(plan).delay, 0)

    def sampled(result: str) -> np.ndarray:
        return control.samples[:, control.columns.result(result), 0]

    texts = (folder / "src" / "numbers.hpp").read_text()
    names = re.findall('"([^"]*)"', re.search("MEASURED.*", texts)[0])  # type: ignore[index]
    known = {"position": trace.count, "velocity": sampled("joint_rate"), "effort": commands[late]}
    chains = list(machine.chain_names)
    given = np.empty((ticks, len(names)))
    for i, interface in enumerate(names):
        owner, _, kind = interface.partition("/")
        if owner == "load":
            given[:, i] = sampled("measured_force")[:, "xyz".find(kind[-1])]
        else:
            given[:, i] = known[kind][:, chains.index(owner)]
    found = rows_of(folder / "drive", "feed", folder / "config" / "path.csv", ticks, given=given)
    n, m = len(chains), len(plan.q)
    effort, state, memory, made = np.split(found, [n, n + 2 * m, found.shape[1] - 1], axis=1)
    right = sampled("memory") if drive_of(plan).law.memory.size else np.empty((ticks, 0))
    assert memory.shape == right.shape
    assert np.abs(effort - commands).max() < 1e-12 * np.abs(commands).max()
    assert np.abs(state - trace.estimate).max() < 1e-12 * np.abs(trace.estimate).max()
    assert np.abs(memory - right).max(initial=0.0) < 1e-12 * np.abs(right).max(initial=1.0)
    assert not made.any()
    return trace


def test_the_package_is_the_simulation(follower: Path) -> None:
    """With the simulated hardware, too.

    Both integrate by the same method and step, so that rounding alone parts them.
    """
    trace = require_same(follower, lossy(), FOLLOW | {"duration": 0.08})
    ticks = len(trace.command)
    found = rows_of(follower / "drive", "loop", follower / "config" / "path.csv", ticks)
    effort, joint, state = np.split(found, [6, 12], axis=1)
    assert ticks == 40 and set(state.ravel()) == {3.0}
    assert not trace.events  # which would cut a step of the simulation
    assert np.abs(joint - trace.count).max() < 1e-11
    assert np.abs(effort - trace.command).max() < 1e-9 * np.abs(trace.command).max()
    log = np.genfromtxt(follower / "log.csv", delimiter=",", names=True)
    assert np.array_equal(log["tau_masseter_left"], effort[:, 2])


def test_a_process_that_is_killed_has_written_its_log(follower: Path) -> None:
    call = [follower / "drive", "kill", follower / "config" / "path.csv", "400"]
    done = subprocess.run(call, capture_output=True, text=True, cwd=follower, timeout=120)
    assert done.returncode == -signal.SIGKILL
    effort = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)[:, 2]
    log = np.genfromtxt(follower / "log.csv", delimiter=",", names=True)
    assert np.array_equal(log["tau_masseter_left"][: len(effort)], effort) and len(log) == 400


def test_diagnostics_say_what_the_ticks_did(follower: Path) -> None:
    """Distances to limits by hand from efforts and speeds; one a second, nothing on the heap."""
    ticks = 30
    call = [follower / "drive", "tell", follower / "config" / "path.csv", str(ticks)]
    done = subprocess.run(call, capture_output=True, text=True, cwd=follower, timeout=120)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    rows = np.array([line.split() for line in lines[:ticks]], dtype=float)
    assert not rows[:, -1].any()
    told: list[dict[str, str]] = []
    for line in lines[ticks:]:
        key, _, value = line.partition("=")
        told += [{}] * (key == "level")
        told[-1] = told[-1] | {key: value}
    whole, none, gap, lost, after = told
    (plan,) = planned(condyle.derive(lossy()), [FOLLOW])
    trip = plan.scenario.safety.trips.speed * np.array(plan.speed)
    for name, used, low, high in (
        ("effort limit", rows[:, :6], plan.low, plan.high),
        ("speed that stops", rows[:, 6:12], -trip, trip),
    ):
        least = np.minimum(high - used, used - low).min(axis=0)
        keys = [f"least distance to {name}, {chain}" for chain in lossy().chain_names]
        found = np.array([float(whole[key]) for key in keys])
        assert np.isfinite(found).all() and np.allclose(found, least, rtol=1e-8)
        assert {none[key] for key in keys} == {"inf"}
    assert whole["name"] == "jaw_controller: controller" and whole["hardware_id"] == "jaw"
    assert (whole["level"], whole["message"], whole["state"]) == ("0", "run", "run")
    assert (whole["ticks"], whole["missed ticks"], whole["active"]) == (str(ticks), "0", "true")
    assert 0 < float(whole["longest tick [s]"]) < 10 and float(none["longest tick [s]"]) == 0
    assert none["level"] == "3" and "no tick" in none["message"]
    assert (gap["level"], gap["missed ticks"], gap["late ticks"]) == ("1", "2", "1")
    assert (lost["level"], lost["message"]) == ("2", CAUSES["LOST"].text)
    assert lost["state"] == "off" and CAUSES["LOST"].text in lost["faults since acknowledged"]
    assert (after["level"], after["active"], after["message"]) == ("2", "false", lost["message"])


@pytest.mark.ci
def test_a_bite_is_the_simulations(tmp_path: Path) -> None:
    """A filter with the efforts that acted, a law with memory and a sensor of force."""
    machine = condyle.load_mechanism("masticatory")
    condyle.export_ros2(machine, BITE, tmp_path)
    compiled(tmp_path, "drive", "controller", "loopback")
    require_same(tmp_path, machine, BITE)


def test_it_homes_and_follows_from_off(follower: Path) -> None:
    path = np.loadtxt(follower / "config" / "path.csv", delimiter=",", skiprows=1)
    found = rows_of(follower / "drive", "home", follower / "config" / "path.csv", 3000)
    states = found[:, -1].astype(int).tolist()
    assert list(dict.fromkeys(states)) == [1, 2, 3] and states[-1] == 2  # holds in the end
    goal = model("masticatory").inverse_kinematics(path[-1, 1:5]).joint
    goal = goal + np.array([0, 0, 0.3, 0, 0, 0])
    assert np.abs(found[-1, 6:12] - goal).max() < 1e-3
    assert np.abs(np.diff(found[:, :6], axis=0)).max() < 0.2  # N m in 2 ms, of 3 N m


def test_lost_encoders_and_lost_equations_are_errors(follower: Path) -> None:
    path = follower / "config" / "path.csv"
    states = rows_of(follower / "drive", "lost", path, 2000)[:, -1].astype(int)
    assert set(states[:23]) == {3} and states[23] == 4  # borne for three ticks, then a safe stop
    assert len(states) < 600  # once it is off, update returns ERROR
    start = model("masticatory").inverse_kinematics([5e-4, 0, 0, 0.02]).joint[0]
    for effort in (0, 3):
        positions = rows_of(follower / "drive", "fall", path, effort)[:, 0]
        assert abs(positions[0] - start) < 1e-12  # uncommanded it stands still
        assert (np.diff(positions[:10]) < 0).all()  # under efforts of zero it falls
        assert len(positions) < 1000  # and out of reach it says so


def test_the_solver_is_the_model(follower: Path) -> None:
    machine, h, rng = lossy(), 1e-4, np.random.default_rng(4)
    solve, own = compiled(follower, "solve", "solver"), condyle.derive(machine)
    q = rng.uniform(-1, 1, (20, 4)) * [2e-3, 1e-3, 0.03, 0.08]
    q1, q2 = rng.normal(size=(2, 20, 4)) * [0.01, 0.01, 0.3, 0.5]
    # Along parabolas with these velocities and accelerations; differences are good to 1e-7.
    behind, here, ahead = (
        own.inverse_kinematics(q + s * q1 + s * s / 2 * q2).joint + machine.zeros
        for s in (-h, 0, h)
    )
    rows = np.hstack([here, (ahead - behind) / (2 * h), (ahead - 2 * here + behind) / h**2])
    free = model("masticatory")
    right, still = free.inverse_dynamics(q, q1, q2), free.inverse_dynamics(q, 0 * q, 0 * q)
    found = rows_of(solve, given=rows)
    torque, inertia, coriolis, gravity, friction = np.split(found, [6, 42, 48, 54], axis=1)
    assert np.abs(torque - right.effort).max() < 1e-6 * np.abs(right.effort).max()
    M = inertia.reshape(-1, 6, 6)
    assert np.abs(M - M.transpose(0, 2, 1)).max() < 1e-12 * np.abs(M).max()
    total = np.einsum("kij,kj->ki", M, rows[:, 12:]) + coriolis + gravity
    assert np.abs(total - torque).max() < 1e-11 * np.abs(torque).max()
    assert np.abs(gravity - still.effort).max() < 1e-11
    v = rows[:, 8]
    assert np.allclose(friction[:, 2], 0.01 * v + 0.02 * v / np.sqrt(v**2 + 0.01), rtol=1e-12)
    assert not friction[:, [0, 1, 3, 4, 5]].any()


def test_files_name_one_another(follower: Path, tmp_path: Path) -> None:
    """And names that ROS and C++ do not take are changed in all of them, and said."""
    machine, plain = condyle.load_mechanism("masticatory"), tmp_path / "plain"
    first = machine.chains[0].model_copy(update={"name": "left one"})
    odd = machine.replace(name="2. Jaw -- <A> */ @prefix@", chains=(first, *machine.chains[1:]))
    made = condyle.export_ros2(odd, FOLLOW | {"controller": LAW | {"rate": 250.0}}, plain)
    package = "n2_jaw_a_prefix_ros2"
    assert made.data["package"] == package and ros2._package("class", None) == "class_ros2"
    assert any("left_one" in note for note in made.notes) and not list(plain.rglob("*solver*"))
    assert "left_one/position" in (plain / "src" / "numbers.hpp").read_text()
    for folder, name, solver, rate in ((follower, "jaw", True, 500), (plain, package, False, 250)):
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
        assert driven[1:] == list(machine.chain_names)[1:]
        ast.parse((folder / "launch" / f"{name}.launch.py").read_text())
        for kind in ("txt", "xml", "c", "cpp", "h", "hpp", "yaml", "urdf", "py", "md"):
            for file in folder.rglob(f"*.{kind}"):
                # But for the name of the mechanism itself.
                assert not re.search(r"(?<! )@\w+@", file.read_text()), file


def test_a_folder_with_blanks_launches(follower: Path, tmp_path: Path) -> None:
    """The launch file among stand-ins for ROS: what has a blank is in the file of parameters."""
    share = tmp_path / "the share"
    shutil.copytree(follower / "config", share / "config")
    shutil.copytree(follower / "urdf", share / "urdf")
    made: list[dict[str, Any]] = []
    stand_ins = SimpleNamespace(
        get_package_share_directory=lambda _: str(share), LaunchDescription=list,
        DeclareLaunchArgument=lambda *_, **__: None, LaunchConfiguration=str,
        Node=lambda **given: made.append(given),
    )  # fmt: skip
    text = (follower / "launch" / "jaw.launch.py").read_text()
    scope = vars(stand_ins)
    kept = [line for line in text.splitlines() if not re.match("from (ament|launch)", line)]
    exec("\n".join(kept), scope)
    scope["generate_launch_description"]()
    arguments = made[-1]["arguments"]
    assert str(share) not in "".join(arguments[4])
    settings = yaml.safe_load(Path(arguments[2]).read_text())
    path = Path(settings["jaw_controller"]["ros__parameters"]["path"])
    assert path.is_file() and path.parent == share / "config"


def test_what_ros_cannot_take_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    source = ros2.controller_source("masticatory", FOLLOW, None)
    contracting = replace(source, plan=replace(source.plan, activation=np.ones(6)))
    slow = FOLLOW | {"controller": LAW | {"rate": 999.5}}
    for found, change, words in (
        (source, {"package": "Jaw"}, "small letters"),
        (source, {"package": "a__b"}, "small letters"),
        (source, {"package": "rclcpp"}, "that it uses"),
        (source, {"solver": np.zeros(2)}, "solver"),
        (contracting, {}, "activation of muscles"),
        (None, {"scenario": {k: v for k, v in FOLLOW.items() if k != "sensors"}}, "sensors"),
        (None, {"scenario": slow}, "whole numbers"),
    ):
        with monkeypatch.context() as patch, pytest.raises(CondyleError, match=words):
            if found:
                patch.setattr(ros2, "controller_source", lambda *of, found=found: found)
            given: dict[str, Any] = {"scenario": FOLLOW} | change
            condyle.export_ros2("masticatory", path=tmp_path / "out", **given)
        assert not (tmp_path / "out").exists()


@pytest.mark.ci
@pytest.mark.parametrize(
    ("name", "law", "solver"),
    [("gough-stewart", {}, False), ("cable-robot", {"distribution": "minimum_norm"}, True)],
)
def test_rods_and_cables(name: str, law: dict[str, Any], solver: bool, tmp_path: Path) -> None:
    """They slide; and there are no contacts."""
    scenario = {"controller": DRIVES | law, "sensors": {}}
    made = condyle.export_ros2(name, scenario, tmp_path, solver=solver, package="it")
    assert ((tmp_path / "src" / "solver.cpp") in made) == solver
    if not solver:
        compiled(tmp_path, "drive", "controller", "loopback")
        urdf = ElementTree.parse(tmp_path / "urdf" / "it.urdf").getroot()
        assert {e.get("type") for e in urdf.iterfind("joint")} == {"prismatic"}
