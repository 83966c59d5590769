"""The public page as a table: one row a door, with a call that is right.

A door is a function of `condyle`, or a public method of a class on the page. Tests call each with
what is right, and with what is wrong. A new door needs one row here, and fails without it.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from functools import cached_property
from io import StringIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock, patch

import numpy as np
from support.machine_log import write_log, write_poses
from support.recorded_jaw import record
from support.recorded_session import write_session

import condyle
from condyle.mechanism import bundled_text
from condyle.mechanism.study_file import StudyFile
from condyle.results.solution import Results

MACHINE = "masticatory"
T = np.linspace(0.0, 1.0, 8)
PATH = np.column_stack([1e-3 * np.sin(T), 0 * T, -2e-3 * T])


class Stage:
    """What doors are tried on; each is made when first needed, files in the current folder."""

    @cached_property
    def mechanism(self) -> condyle.Mechanism:
        return condyle.load_mechanism(MACHINE)

    @cached_property
    def model(self) -> condyle.Model:
        return condyle.derive(self.mechanism, backend="numpy")

    @cached_property
    def recording(self) -> tuple[Path, Path]:
        """A C3D file and its marker file."""
        jaw = record(seconds=1.0)
        return jaw.write(Path("jaw.c3d").resolve()), jaw.write_tables(Path("jaw.toml").resolve())

    @cached_property
    def log(self) -> Path:
        return write_log(Path("log.csv").resolve())

    @cached_property
    def session(self) -> Path:
        return write_session(Path.cwd(), 1, 1.0)[0]

    @cached_property
    def poses(self) -> Path:
        return write_poses(Path("poses.csv").resolve())

    @cached_property
    def motion(self) -> condyle.Motion:
        return condyle.Motion.from_arrays(T, PATH, ["x", "y", "z"])

    @cached_property
    def load(self) -> condyle.Load:
        return condyle.Load.from_arrays(T, np.ones((8, 3)), point="incisor")

    @cached_property
    def frame(self) -> Any:
        import pandas as pd

        return pd.DataFrame({"t": T, "X": T, "Fx": T})

    def file(self, name: str, text: str) -> str:
        Path(name).write_text(text, encoding="utf-8")
        return name

    @cached_property
    def solution(self) -> Any:
        return self.model.solve(self.motion)

    @cached_property
    def map(self) -> Any:
        return condyle.workspace_map(self.model, over={"X": (-0.1, 0.1, 3)})

    @property
    def results(self) -> Any:
        return self.solution.condyle

    def saved(self, kind: str) -> str:
        getattr(self, kind).condyle.save("saved.nc")
        return "saved.nc"

    @property
    def mechanism_file(self) -> str:
        return self.file("machine.toml", bundled_text(MACHINE))


Value = Any  # or a function of the stage that gives it


@dataclass(frozen=True)
class Door:
    """How to call it rightly.

    right: its arguments;  calls: how often the fuzzer calls it;  model: the argument that takes
    a model, a mechanism, a path or a name;  states: those of any leading shape;
    words: what messages may call an argument besides its name.
    long: arguments that ask for long work where they are None or empty; the fuzzer leaves that out.
    """

    right: Mapping[str, Value] = field(default_factory=dict)
    calls: int = 200
    model: str | None = None
    states: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    long: tuple[str, ...] = ()

    def arguments(self, stage: Stage) -> dict[str, Any]:
        return {k: v(stage) if inspect.isfunction(v) else v for k, v in self.right.items()}


Q, EFFORT, WRENCH = np.zeros(4), np.zeros(6), np.ones(6)
STATE: dict[str, Value] = {"q": Q, "v": Q, "a": Q}
FORCED: dict[str, Value] = {"wrench": WRENCH, "at": "incisor", "outputs": "pose", "threads": 1}
TAKEN: dict[str, Value] = (
    STATE
    | {"wrench": WRENCH, "at": "incisor", "effort": None}
    | {
        "joint": None,
        "zeros": False,
    }
)
OWN_MODEL: dict[str, Value] = {"model": lambda stage: stage.mechanism}
CSV = "t,Fx\n0,1\n1,2\n"
FILES = ("path", "file", "folder", "no such", "mechanism")  # what messages say of files
STAGED: dict[str, Value] = {
    "mechanism": lambda stage: stage.mechanism,
    "motion": lambda stage: stage.motion,
    "load": lambda stage: stage.load,
    "load_point": "incisor",
}
TO_FOLDER: dict[str, Value] = {"model": lambda stage: stage.mechanism, "path": "out"}
CHAINS = [f"{m}_{s}" for m in ("temporalis", "masseter", "pterygoid") for s in ("left", "right")]
EFFORTS = "X,Y,alpha,beta," + ",".join(f"tau_{c}" for c in CHAINS) + "\n0" + 9 * ",0" + "\n"
JOINTS = ",".join(f"joint_{c}" for c in CHAINS) + "\n0" + 5 * ",0" + "\n"
ROWWISE: dict[str, Value] = {
    "model": lambda stage: stage.model,
    "states": lambda stage: stage.file("states.csv", "X,Y,alpha,beta\n0,0,0,0\n"),
    "out": "out.csv",
    "load_point": "incisor",
    "flag": False,
    "threads": 1,
    "strict": False,
}
STUDY = {"vary": [{"what": "platform.mass", "values": [0.1, 0.2]}]}
ROWS = "t,X\n" + "".join(f"{t},{t / 1000}\n" for t in range(8))

DOORS: dict[str, Door] = {
    "load_mechanism": Door({"name_or_path": MACHINE}, words=("mechanism",)),
    "bundled_mechanisms": Door(),
    "dump": Door(
        {"mechanism": lambda stage: stage.mechanism, "path": "out.toml"}, model="mechanism"
    ),
    "dumps": Door({"mechanism": lambda stage: stage.mechanism}, model="mechanism"),
    "reference_motion": Door(),
    "reference_load": Door(),
    "trial_motion": Door(
        OWN_MODEL | {"cutoff": None, "rate": 10.0, "trim": 0.1},
        calls=60,
        model="model",
        words=("mechanism",),
    ),
    "motion_from_c3d": Door(
        {
            "path": lambda stage: stage.recording[0],
            "markers": lambda stage: stage.recording[1],
            "model": lambda stage: stage.mechanism,
            "max_residual": 1e-3,
            "max_gap": 0.1,
            "longest": False,
            "unit": "mm",
            "force": None,
            "cutoff": None,
        },
        calls=100,
        words=("mechanism", "jaw.c3d", "jaw.toml", "cut-off", *FILES),
    ),
    "measure_session": Door(
        {"session": lambda stage: stage.session, "out": None, "strict": False},
        calls=40,
        words=("mechanism", "session.toml", "key", "trial", *FILES),
    ),
    "derive": Door(
        {
            "mechanism": lambda stage: stage.mechanism,
            "formulation": "virtual_power",
            "route": "core",
            "distribution": None,
            "backend": "numpy",
        },
        words=("masticatory",),
    ),
    "Model": Door({"mechanism": MACHINE, "backend": "numpy"}, words=("masticatory",)),
    "Distribution": Door(
        {"name": "bounded", "preload": 1.0, "contact_weight": 0.0}, words=("distribution",)
    ),
    "Model.inverse_dynamics": Door(STATE | FORCED, states=("q", "v", "a"), calls=60),
    "Model.forward_dynamics": Door(
        {"q": Q, "v": Q, "effort": EFFORT} | FORCED, states=("q", "v", "effort"), calls=60
    ),
    "Model.inverse_kinematics": Door(STATE, states=("q", "v", "a"), calls=60),
    "Model.mass_matrix": Door({"q": Q}, states=("q",), calls=60),
    "Model.bias": Door({"q": Q, "v": Q}, states=("q", "v"), calls=60),
    "Model.coriolis": Door({"q": Q, "v": Q}, states=("q", "v"), calls=60),
    "Model.gravity": Door({"q": Q}, states=("q",), calls=60),
    "Model.regressor": Door(STATE | {"wrench": WRENCH, "at": "incisor"}, calls=60),
    "Model.base_parameters": Door({"motion": lambda stage: stage.motion}, calls=40),
    "Model.jacobians": Door({"q": Q}, states=("q",), calls=60),
    "Model.linearise": Door(
        {"q": Q, "v": Q, "effort": EFFORT, "wrench": WRENCH, "at": "incisor"},
        states=("q", "v", "effort"),
        calls=60,
    ),
    "Model.derivatives": Door(
        {"of": "effort", "wrt": ("q", "wrench")} | TAKEN,
        states=("q", "v", "a"),
        calls=60,
        words=("derivatives", "q", "cannot depend"),
    ),
    "Model.jvp": Door(
        {"of": "effort", "tangents": {"q": Q, "at": np.ones(3)}} | TAKEN,
        states=("q", "v", "a"),
        calls=60,
        words=("derivatives", "wrt"),
    ),
    "Model.vjp": Door(
        {"of": "effort", "cotangents": EFFORT, "wrt": "q"} | TAKEN,
        states=("q", "v", "a"),
        calls=60,
        words=("derivatives",),
    ),
    "Model.forward_kinematics": Door(
        {"joint": EFFORT, "start": EFFORT, "time": None, "tolerance": 1e-6},
        states=("joint",),
        calls=60,
    ),
    "Model.solve": Door(
        {"motion": lambda stage: stage.motion, "load": lambda stage: stage.load}
        | {"load_point": "incisor", "flag": False, "reactions": False, "threads": 1},
        calls=20,
        words=("X", "Fx", "no such"),
    ),
    "Model.to_jax": Door({"method": "graph", "numbers": ()}, words=("jax", "JAX"), calls=60),
    "Model.to_torch": Door(words=("torch",)),
    "Model.to_casadi": Door(words=("kernels",)),
    "Model.with_distribution": Door({"distribution": "minimum_norm"}),
    "Model.variants": Door(
        {"table": {"platform.mass": [0.2, 0.3]}, "keep": "home"},
        words=("platform.mass", "mechanism"),
        calls=20,
    ),
    "Model.kernel": Door({"question": "inverse"}),
    "Model.unchecked": Door(),
    "open_solution": Door({"path": lambda stage: stage.saved("solution")}, words=FILES, calls=20),
    "open_map": Door({"path": lambda stage: stage.saved("map")}, words=FILES, calls=60),
    "open_sweep": Door({"folder": "a study"}, words=("folder",), calls=60),
    "workspace_map": Door(
        {"model": lambda stage: stage.model, "over": {"X": (-1e-3, 1e-3, 3)}, "quantities": "ratio"}
        | {"hold": "", "load": "", "load_point": "incisor", "direction": None, "stiffness": None}
        | {"stroke": (), "out": None, "threads": 1, "workers": None, "scheduler": None},
        model="model",
        words=("mechanism", "Dask"),
    ),
    "workspace_size": Door(
        {"map": lambda stage: stage.map, "margin": 1e-3, "model": lambda stage: stage.model},
        calls=30,
        words=FILES,
        long=("model",),
    ),
    "sweep": Door(
        {"study": STUDY, "out": None, "workers": 1, "scheduler": "threads", "resume": False}
        | {"mechanism": None, "motion": lambda stage: stage.motion, "load": None},
        calls=20,
    ),
    "run": Door(
        STAGED
        | {"formulation": "momentum", "route": "core", "backend": "numpy", "threads": 1}
        | {"distribution": None, "reactions": False, "flag": False, "measured": None, "vary": None},
        calls=20,
        model="mechanism",
        words=("study", *FILES),
    ),
    "compare": Door(
        STAGED | {"formulations": "momentum", "distribution": None}, calls=20, model="mechanism"
    ),
    "tradeoff": Door(STAGED | {"weights": (0.0, 1.0), "preload": 0.0}, calls=20, model="mechanism"),
    "export_c": Door(
        TO_FOLDER
        | {"question": "inverse", "coordinates": (), "landmark": None, "precision": "double"}
        | {"constants": "inside", "prefix": None, "lanes": 8, "formulation": None, "route": None},
        calls=40,
        words=FILES,
    ),
    "export_controller": Door(
        TO_FOLDER
        | {
            "scenario": {
                "controller": {"kind": "joint_pd", "stiffness": 5.0, "damping": 0.01},
                "sensors": {},
            },
            "prefix": "x",
        },
        calls=10,
        words=(*FILES, "controller", "sensors"),
        long=("scenario",),
    ),
    "export_ros2": Door(
        TO_FOLDER
        | {
            "scenario": {
                "controller": {"kind": "joint_pd", "stiffness": 5.0, "damping": 0.01},
                "sensors": {},
            },
            "package": "jaw",
            "prefix": "x",
            "solver": False,
        },
        calls=10,
        words=(*FILES, "controller", "sensors"),
        long=("scenario",),
    ),
    "export_fmu": Door(TO_FOLDER | {"kind": "inverse", "fmi": 3}, calls=10, words=FILES),
    "export_acados": Door(TO_FOLDER | {"step": 0.01}, calls=60, words=FILES),
    "export_matlab": Door(TO_FOLDER | {"question": "inverse"}, calls=60, words=FILES),
    "export_mjcf": Door(TO_FOLDER | {"path": "out/machine.xml"}, calls=60, words=FILES),
    "solve_states": Door(
        ROWWISE | {"reactions": False, "mat": None, "noise": {"X": 1e-5}}, calls=60, words=FILES
    ),
    "derivative_states": Door(
        {k: v for k, v in ROWWISE.items() if k != "threads"}
        | {"of": "effort", "wrt": ["q", "platform.mass"], "zeros": False},
        calls=60,
        words=(*FILES, "derivatives"),
    ),
    "forward_states": Door(
        ROWWISE | {"states": lambda stage: stage.file("states.csv", EFFORTS)}, calls=60, words=FILES
    ),
    "pose_states": Door(
        {"mechanism": MACHINE, "joints": lambda stage: stage.file("joints.csv", JOINTS)}
        | {"out": "out.csv", "flag": False, "tolerance": 1e-6, "every": False, "seed": None},
        calls=60,
        words=FILES,
    ),
    "video": Door(
        {"solution": lambda stage: stage.solution, "out": "film.gif", "speed": 5.0, "fps": 1.0}
        | {"width": 160, "view": "Top"},
        calls=20,
        words=FILES,
    ),
    "write_report": Door(
        {"solution": lambda stage: stage.solution, "path": "out.html", "tables": None}
        | {"files": None, "measured": None, "sweep": None},
        calls=30,
        words=FILES,
    ),
    "new_mechanism": Door(
        {"name": "mine", "from_bundled": "jaw", "from_mjcf": None, "force": True, "strict": False},
        words=FILES,
        calls=60,
    ),
    "new_study": Door({"name": "mine", "kind": "session", "force": True}, words=FILES, calls=60),
    "Results.save": Door({"path": "out.nc"}, calls=60),
    "Results.columns": Door(),
    "Results.with_measured": Door({"measured": "measured.csv"}, words=FILES),
    "simulate": Door(
        {
            "model": lambda stage: stage.model,
            "scenario": {"duration": 0.002, "rate": 1000.0, "method": "rk4", "step": 1e-3},
        },
        words=("mechanism", "duration", "rate"),
        long=("scenario",),
    ),
    "check_gains": Door(
        {
            "model": lambda stage: stage.model,
            "scenario": {"controller": {"kind": "joint_pd", "stiffness": 5.0, "damping": 0.01}},
        },
        words=("mechanism", "controller"),
        calls=60,
        long=("scenario", "model"),
    ),
    "load_scenario": Door(
        {"source": lambda stage: stage.file("run.toml", "duration = 0.1")}, words=("path",)
    ),
    "identify": Door(
        {
            "mechanism": MACHINE,
            "logs": lambda stage: stage.log,
            "study": {"numbers": ["platform.mass"]},
        },
        words=("mechanism", "log"),
        long=("study",),
        calls=20,
    ),
    "calibrate": Door(
        {
            "mechanism": MACHINE,
            "poses": lambda stage: stage.poses,
            "study": {"numbers": ["chain.*.actuator.zero"]},
        },
        words=("mechanism",),
        long=("study",),
        calls=20,
    ),
    "excite": Door(
        {
            "mechanism": MACHINE,
            "study": {"numbers": ["platform.mass"], "harmonics": 1, "starts": 1, "steps": 1},
            "backend": "numpy",
        },
        words=("mechanism",),
        long=("study",),
        calls=10,
    ),
    "plan_path": Door(
        {
            "mechanism": MACHINE,
            "study": {
                "kind": "periodic",
                "pose": [{"X": 0.0, "Y": 0.0, "alpha": 0.0, "beta": b} for b in (0.0, 0.02, 0.01)],
                "period": 1.0,
                "rate": 20.0,
            },
            "backend": "numpy",
        },
        words=("mechanism",),
        long=("study",),
        calls=10,
    ),
    "optimise": Door(
        {
            "study": {
                "period": 1.0,
                "pose": [
                    {"t": t, "X": 0.0, "Y": 0.0, "alpha": 0.0, "beta": b}
                    for t, b in ((0.0, 0.0), (0.5, 0.05))
                ],
                "bounds": {"beta": (-0.005, 0.055)},
                "cost": {"jerk": 1.0},
                "intervals": 8,
                "rate": 20.0,
            },
            "mechanism": MACHINE,
            "backend": "numpy",
        },
        words=("mechanism", "path"),
        long=("study",),
        calls=10,
    ),
    "design": Door(
        {
            "study": {
                "minimise": "peak_effort",
                "motion": {"file": "reference", "rate": 10.0},
                "vary": [{"what": "platform.mass", "scale": [0.9, 1.1]}],
                "sampling": {"kind": "sobol", "count": 1},
                "backend": "numpy",
            },
            "mechanism": MACHINE,
        },
        words=("mechanism", "path"),
        long=("study",),
        calls=10,
    ),
    "write_log": Door(
        {"solution": lambda stage: stage.solution, "path": "log.csv"}
        | {"encoder_noise": 1e-4, "effort_noise": 0.0, "seed": 1},
        calls=40,
        words=FILES,
    ),
    "literature": Door(calls=1),
    "cite": Door({"solution": lambda stage: stage.solution}, words=("path",), calls=20),
    "largest_bite": Door(
        {"mechanism": MACHINE, "point": "incisor", "direction": (0, 0, -1.0), "over": None},
        calls=60,
        model="mechanism",
        words=("mechanism",),
    ),
    "check": Door({"mechanism": lambda stage: stage.mechanism}, calls=30),
    "schema": Door({"of": "mechanism"}),
    "write_reference": Door({"folder": "."}, calls=60, words=("no such", "folder")),
    "Mechanism.get": Door({"path": "platform.mass"}, words=("mechanism",)),
    "Mechanism.set": Door(
        {"path": "platform.mass", "value": 0.2}, words=("mass", MACHINE, "mechanism")
    ),
    "Mechanism.replace": Door({"name": "other"}),
    "Mechanism.checked": Door(
        {"data": lambda stage: stage.mechanism.entries(), "source": "machine.toml"},
        words=("machine.toml", "expected a table", "is missing", "problem"),
    ),
    "Mechanism": Door(
        {"name": "mine", "gravity": (0, 0, -9.81)}
        | {
            "platform": lambda stage: stage.mechanism.platform,
            "contact": lambda stage: stage.mechanism.contacts,
            "chain": lambda stage: stage.mechanism.chains,
        },
    ),
    "Scenario": Door({"duration": 0.1, "rate": 1000.0, "method": "DOP853", "rtol": 1e-6}),
    "Study": Door(STUDY | {"formulation": "momentum", "preload": 0.0, "solutions": False}),
    "Study.read": Door({"source": STUDY}, long=("source",), words=("study",)),
    "Study.checked": Door(
        {"data": STUDY, "source": "study.toml"}, words=("study.toml", "vary", "key")
    ),
    "Study.data": Door(),
    "Study.title": Door(),
    "serve_view": Door(
        {"mechanism": lambda stage: stage.mechanism, "solution": None, "host": "127.0.0.1"}
        | {"port": 8080, "open_browser": False, "map": None, "scenario": None},
        words=FILES,
        long=("scenario",),
    ),
    "Motion.from_csv": Door(
        {"path": lambda stage: stage.file("motion.csv", ROWS), "units": "mm"},
        words=("motion.csv",),
    ),
    "Motion.from_arrays": Door(
        {
            "t": T,
            "values": PATH,
            "names": ["x", "y", "z"],
            "units": "mm",
            "landmark": "incisor",
            "cutoff": None,
            "rate": None,
            "times": None,
            "trim": 0.0,
            "source": "motion",
        }
    ),
    "Motion.from_frame": Door({"frame": lambda stage: stage.frame[["t", "X"]]}, words=("motion",)),
    "Load.from_csv": Door(
        {"path": lambda stage: stage.file("load.csv", CSV), "point": None},
        words=("load.csv",),
    ),
    "Load.from_arrays": Door(
        {"t": T, "force": np.ones((8, 3)), "moment": np.ones((8, 3)), "point": None}
    ),
    "Load.from_frame": Door({"frame": lambda stage: stage.frame[["t", "Fx"]]}, words=("load",)),
    "Load.constant": Door({"force": (0, 0, 1), "moment": (0, 0, 0), "point": None}),
    "Load.zero": Door(),
    "Load.at": Door({"times": T}),
}

# Without a row: records of arrays that `from_arrays` and others have checked.
RECORDS = {"Motion", "Load"}


def target(name: str, stage: Stage) -> Callable[..., Any]:
    """What a row calls: a function of the page, or a method of an object of the stage."""
    owner, _, method = name.rpartition(".")
    if name == "Results.save":  # takes any number of paths
        return lambda path: stage.results.save(path)
    if name == "serve_view":
        return unserved
    if name in ("Study.data", "Study.title"):
        return getattr(condyle.Study.checked(STUDY, "study"), method)
    if owner == "Study":
        return getattr(condyle.Study, method)
    return getattr(getattr(stage, owner.lower()) if owner else condyle, method)


def unserved(**arguments: Any) -> None:
    """As `serve_view` without a page, interrupted at once."""
    from condyle.view import serve

    page = SimpleNamespace(port=8080, url="", close=lambda: None)
    with (
        patch.object(serve, "View", lambda *_: page),
        patch.object(serve, "time", Mock(sleep=Mock(side_effect=KeyboardInterrupt))),
        patch("webbrowser.open"),
        redirect_stdout(StringIO()),
    ):
        condyle.serve_view(**arguments)


def public_doors() -> set[str]:
    """Every function on the page, and every public method of the classes that have rows."""
    page = {name: getattr(condyle, name) for name in condyle.__all__} | {"Results": Results}
    found = {
        name
        for name, value in page.items()
        if inspect.isfunction(value)
        or (isinstance(value, type) and not issubclass(value, Exception | Results))
    }
    for name in {row.partition(".")[0] for row in DOORS if "." in row}:
        found |= {
            f"{name}.{method}"
            for owner in (page[name], *(StudyFile,) * issubclass(page[name], StudyFile))
            for method, value in vars(owner).items()
            if not method.startswith("_")
            and (inspect.isfunction(value) or isinstance(value, classmethod | staticmethod))
        }
    return found - RECORDS
