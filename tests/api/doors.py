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
from support.machines import model
from support.recorded_jaw import record
from support.recorded_session import write_session

import condyle
from condyle.mechanism import bundled_text
from condyle.mechanism.study_file import StudyFile
from condyle.results.solution import Results

MACHINE = "masticatory"
T = np.linspace(0.0, 1.0, 8)
PATH = np.column_stack([1e-3 * np.sin(T), 0 * T, -2e-3 * T])
STUDY = {"vary": [{"what": "platform.mass", "values": [0.1, 0.2]}]}


class Stage:
    """What doors are tried on; each is made when first needed, files in the current folder."""

    def __init__(self) -> None:
        self.model = model(MACHINE)
        self.mechanism = self.model.mechanism
        self.study = condyle.Study.checked(STUDY, "study")
        self.motion = condyle.Motion.from_arrays(T, PATH, ["x", "y", "z"])
        self.load = condyle.Load.from_arrays(T, np.ones((8, 3)), point="incisor")

    @cached_property
    def soft(self) -> condyle.Model:
        """A model whose drives give."""
        stiff = {f"chain.{name}.actuator.stiffness": 400.0 for name in self.mechanism.chain_names}
        return condyle.Model(self.mechanism.set(stiff), backend="numpy")

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


@dataclass(frozen=True)
class Of:
    """An argument that is an attribute of the stage."""

    name: str


@dataclass(frozen=True)
class Door:
    """How to call it rightly, with arguments, or functions of the stage that give them.

    calls: how often the fuzzer calls it;  words: what messages may call an argument besides its
    name, with commas;  model: the argument that takes a model, a mechanism, a path or a name;
    states: those of any leading shape;  long: those that ask for long work where they are None or
    empty;  dear: its right call is made in `make ci` only: the door's own room makes it too.
    """

    right: Mapping[str, Any] = field(default_factory=dict)
    words: str = ""
    calls: int = 48
    model: str | None = None
    states: str = ""
    long: str = ""
    dear: bool = False

    def arguments(self, stage: Stage) -> dict[str, Any]:
        def value(v: Any) -> Any:
            if isinstance(v, Of):
                return getattr(stage, v.name)
            return v(stage) if inspect.isfunction(v) else v

        return {key: value(v) for key, v in self.right.items()}


Q, EFFORT, WRENCH, ONES = np.zeros(4), np.zeros(6), np.ones(6), np.ones((8, 3))
STATE: dict[str, Any] = {"q": Q, "v": Q, "a": Q}
PUSHED: dict[str, Any] = {"wrench": WRENCH, "at": "incisor"}
FORCED = PUSHED | {"outputs": "pose", "threads": 1}
TAKEN = STATE | PUSHED | {"effort": None, "joint": None, "zeros": False}
MODEL, SOLUTION, MECHANISM = Of("model"), Of("solution"), Of("mechanism")
FILES = "path,file,folder,no such,mechanism"  # what messages say of files
CONTROL = ",controller,sensors"
STAGED: dict[str, Any] = {"mechanism": MECHANISM, "motion": Of("motion"), "load": Of("load")}
STAGED |= {"load_point": "incisor"}
TO_FOLDER: dict[str, Any] = {"model": MECHANISM, "path": "out"}
TO_C: dict[str, Any] = {"question": "inverse", "coordinates": (), "landmark": None}
TO_C |= {"precision": "double", "constants": "inside", "prefix": None, "lanes": 8}
TO_C |= {"formulation": None, "route": None}
CHAINS = [f"{m}_{s}" for m in ("temporalis", "masseter", "pterygoid") for s in ("left", "right")]
CSV, ROWS = "t,Fx\n0,1\n1,2\n", "t,X\n" + "".join(f"{t},{t / 1000}\n" for t in range(8))
STATES = "X,Y,alpha,beta\n0,0,0,0\n"
EFFORTS = "X,Y,alpha,beta," + ",".join(f"tau_{c}" for c in CHAINS) + "\n0" + 9 * ",0" + "\n"
JOINTS = ",".join(f"joint_{c}" for c in CHAINS) + "\n0" + 5 * ",0" + "\n"
ROWWISE: dict[str, Any] = {"model": MODEL, "states": lambda s: s.file("states.csv", STATES)}
ROWWISE |= {"out": "out.csv", "load_point": "incisor", "flag": False, "strict": False}
CONTROLLED = {"controller": {"kind": "joint_pd", "stiffness": 5.0, "damping": 0.01}}
SENSED = CONTROLLED | {"sensors": {}}
MASS = {"numbers": ["platform.mass"]}
REST = {"X": 0.0, "Y": 0.0, "alpha": 0.0}
PERIODIC = {"kind": "periodic", "pose": [REST | {"beta": b} for b in (0.0, 0.02, 0.01)]}
PERIODIC |= {"period": 1.0, "rate": 20.0}
OPTIMAL = {"pose": [REST | {"t": t, "beta": b} for t, b in ((0.0, 0.0), (0.5, 0.05))]}
OPTIMAL |= {"period": 1.0, "bounds": {"beta": (-0.005, 0.055)}, "cost": {"jerk": 1.0}}
DESIGN = {"minimise": "peak_effort", "motion": {"file": "reference", "rate": 10.0}}
DESIGN |= {"vary": [{"what": "platform.mass", "scale": [0.9, 1.1]}], "backend": "numpy"}
TABLE = {"values": PATH, "names": ["x", "y", "z"], "units": "mm", "landmark": "incisor"}


def study(words: str = "mechanism", calls: int = 4, **right: Any) -> Door:
    """A door that takes a machine and a study of it."""
    return Door({"mechanism": MACHINE} | right, words, calls, long="study", dear=True)


def export(words: str = "", calls: int = 4, long: str = "", **right: Any) -> Door:
    return Door(TO_FOLDER | right, FILES + words, calls, long=long, dear=True)


def of_states(states: str, words: str = "", **right: Any) -> Door:
    """A method of a model whose arguments `states` have any leading shape."""
    return Door(right, words, calls=16, states=states)


DOORS: dict[str, Door] = {
    "load_mechanism": Door({"name_or_path": MACHINE}, "mechanism"),
    "bundled_mechanisms": Door(),
    "dump": Door({"mechanism": MECHANISM, "path": "out.toml"}, model="mechanism"),
    "dumps": Door({"mechanism": MECHANISM}, model="mechanism"),
    "reference_motion": Door(),
    "reference_load": Door(),
    "trial_motion": Door(
        {"model": MECHANISM, "cutoff": None, "rate": 10.0, "trim": 0.1}, "mechanism", 16, "model"
    ),
    "motion_from_c3d": Door(
        {"path": lambda s: s.recording[0], "markers": lambda s: s.recording[1], "model": MECHANISM}
        | {"max_residual": 1e-3, "max_gap": 0.1, "longest": False, "unit": "mm", "force": None}
        | {"cutoff": None},
        f"{FILES},jaw.c3d,jaw.toml,cut-off",
        calls=16,
    ),
    "measure_session": Door(
        {"session": Of("session"), "out": None, "strict": False},
        f"{FILES},session.toml,key,trial",
        calls=6,
        dear=True,
    ),
    "derive": Door(
        {"mechanism": MECHANISM, "formulation": "virtual_power", "route": "core"}
        | {"distribution": None, "backend": "numpy"},
        MACHINE,
    ),
    "Model": Door({"mechanism": MACHINE, "backend": "numpy"}, MACHINE),
    "Distribution": Door(
        {"name": "bounded", "preload": 1.0, "contact_weight": 0.0}, "distribution"
    ),
    "Model.inverse_dynamics": of_states("q v a", **STATE, **FORCED),
    "Model.forward_dynamics": of_states("q v effort", q=Q, v=Q, effort=EFFORT, **FORCED),
    "Model.inverse_kinematics": of_states("q v a", **STATE),
    "Model.mass_matrix": of_states("q", q=Q),
    "Model.bias": of_states("q v", q=Q, v=Q),
    "Model.coriolis": of_states("q v", q=Q, v=Q),
    "Model.gravity": of_states("q", q=Q),
    "Model.stiffness": of_states("q effort", q=Q, effort=EFFORT, **PUSHED),
    "Model.modes": of_states("q effort", q=Q, effort=EFFORT, **PUSHED),
    "Model.regressor": of_states("", **STATE, **PUSHED),
    "Model.base_parameters": Door({"motion": Of("motion")}, calls=10),
    "Model.jacobians": of_states("q", q=Q),
    "Model.linearise": of_states("q v effort", q=Q, v=Q, effort=EFFORT, **PUSHED),
    "Model.derivatives": of_states(
        "q v a", "derivatives,q,cannot depend", of="effort", wrt=("q", "wrench"), **TAKEN
    ),
    "Model.jvp": of_states(
        "q v a", "derivatives,wrt", of="effort", tangents={"q": Q, "at": np.ones(3)}, **TAKEN
    ),
    "Model.vjp": of_states(
        "q v a", "derivatives", of="effort", cotangents=EFFORT, wrt="q", **TAKEN
    ),
    "Model.forward_kinematics": of_states(
        "joint", joint=EFFORT, start=EFFORT, time=None, tolerance=1e-6
    ),
    "Model.solve": Door(
        {"motion": Of("motion"), "load": Of("load"), "load_point": "incisor", "flag": False}
        | {"reactions": False, "threads": 1},
        "X,Fx,no such",
        calls=6,
    ),
    "Model.to_jax": Door({"method": "graph", "numbers": ()}, "jax,JAX", calls=16),
    "Model.to_torch": Door(words="torch"),
    "Model.to_casadi": Door(words="kernels"),
    "Model.with_distribution": Door({"distribution": "minimum_norm"}),
    "Model.variants": Door(
        {"table": {"platform.mass": [0.2, 0.3]}, "keep": "home"}, "platform.mass,mechanism", calls=6
    ),
    "Model.kernel": Door({"question": "inverse"}),
    "Model.unchecked": Door(),
    "open_solution": Door({"path": lambda s: s.saved("solution")}, FILES, calls=6),
    "open_map": Door({"path": lambda s: s.saved("map")}, FILES, calls=6),
    "open_sweep": Door({"folder": "a study"}, "folder", calls=16),
    "workspace_map": Door(
        {"model": MODEL, "over": {"X": (-1e-3, 1e-3, 3)}, "quantities": "ratio", "hold": ""}
        | {"load": "", "load_point": None, "direction": None, "stiffness": None, "stroke": ()}
        | {"out": None, "threads": 1, "workers": None, "scheduler": None},
        "mechanism,Dask",
        model="model",
    ),
    "workspace_size": Door(
        {"map": Of("map"), "margin": 1e-3, "model": MODEL}, FILES, 6, long="model", dear=True
    ),
    "sweep": Door(
        {"study": STUDY, "out": None, "workers": 1, "scheduler": "threads", "resume": False}
        | {"mechanism": None, "motion": Of("motion"), "load": None},
        calls=6,
        dear=True,
    ),
    "run": Door(
        STAGED
        | {"formulation": "momentum", "route": "core", "backend": "numpy", "threads": 1}
        | {"distribution": None, "reactions": False, "flag": False, "measured": None, "vary": None},
        f"{FILES},study",
        calls=6,
        model="mechanism",
        dear=True,
    ),
    "compare": Door(
        STAGED | {"formulations": "momentum", "distribution": None}, "", 4, "mechanism", dear=True
    ),
    "tradeoff": Door(
        STAGED | {"weights": (0.0, 1.0), "preload": 0.0}, "", 4, "mechanism", dear=True
    ),
    "export_c": export(calls=10, **TO_C),
    "export_controller": export(CONTROL, long="scenario", scenario=SENSED, prefix="x"),
    "export_ros2": export(
        CONTROL, long="scenario", scenario=SENSED, package="jaw", prefix="x", solver=False
    ),
    "export_fmu": export(CONTROL, long="scenario", kind="controller", fmi=3, scenario=SENSED),
    "export_acados": export(calls=6, step=0.01),
    "export_matlab": export(calls=6, question="inverse"),
    "export_mjcf": export(calls=6, path="out/machine.xml"),
    "solve_states": Door(
        ROWWISE | {"threads": 1, "reactions": False, "mat": None, "noise": {"X": 1e-5}},
        FILES,
        calls=16,
    ),
    "derivative_states": Door(
        ROWWISE | {"of": "effort", "wrt": ["q", "platform.mass"], "zeros": False},
        f"{FILES},derivatives",
        calls=16,
    ),
    "forward_states": Door(
        ROWWISE | {"threads": 1, "states": lambda s: s.file("states.csv", EFFORTS)}, FILES, calls=16
    ),
    "pose_states": Door(
        {"mechanism": MACHINE, "joints": lambda s: s.file("joints.csv", JOINTS), "out": "out.csv"}
        | {"flag": False, "tolerance": 1e-6, "every": False, "seed": None},
        FILES,
        calls=10,
    ),
    "video": Door(
        {"solution": SOLUTION, "out": "film.gif", "speed": 5.0, "fps": 1.0, "width": 160}
        | {"view": "Top"},
        FILES,
        calls=6,
        dear=True,
    ),
    "moving_scene": Door(
        {"solution": SOLUTION, "speed": 5.0, "fps": 1.0, "dark": True},
        FILES,
        calls=6,
        dear=True,
    ),
    "write_report": Door(
        {"solution": SOLUTION, "path": "out.html", "tables": None, "files": None}
        | {"measured": None, "sweep": None, "pdf": None},
        FILES,
        calls=6,
        dear=True,
    ),
    "new_mechanism": Door(
        {"name": "mine", "from_bundled": "jaw", "from_mjcf": None, "force": True, "strict": False},
        FILES,
        calls=16,
    ),
    "new_study": Door({"name": "mine", "kind": "session", "force": True}, FILES, calls=16),
    "Results.save": Door({"path": "out.nc"}, calls=10),
    "Results.columns": Door(),
    "Results.with_measured": Door({"measured": "measured.csv"}, FILES),
    "simulate": Door(
        {"model": MODEL}
        | {"scenario": {"duration": 0.002, "rate": 1000.0, "method": "rk4", "step": 1e-3}},
        "mechanism,duration,rate",
        calls=16,
        long="scenario",
    ),
    "check_gains": Door(
        {"model": MODEL, "scenario": CONTROLLED},
        "mechanism,controller",
        calls=16,
        long="scenario model",
        dear=True,
    ),
    "load_scenario": Door({"source": lambda s: s.file("run.toml", "duration = 0.1")}, "path"),
    "identify": study("mechanism,log", 6, logs=Of("log"), study=MASS),
    "calibrate": study(calls=6, poses=Of("poses"), study={"numbers": ["chain.*.actuator.zero"]}),
    "excite": study(study=MASS | {"harmonics": 1, "starts": 1, "steps": 1}, backend="numpy"),
    "plan_path": study(study=PERIODIC, backend="numpy"),
    "optimise": study(
        "mechanism,path", study=OPTIMAL | {"intervals": 8, "rate": 20.0}, backend="numpy"
    ),
    "design": study("mechanism,path", study=DESIGN | {"sampling": {"kind": "sobol", "count": 1}}),
    "write_log": Door(
        {"solution": SOLUTION, "path": "log.csv"}
        | {"encoder_noise": 1e-4, "effort_noise": 0.0, "seed": 1},
        FILES,
        calls=10,
    ),
    "LogWriter": Door({"path": "log.csv", "names": ["t", "x"]}, FILES),
    "literature": Door(calls=1, dear=True),
    "cite": Door({"solution": SOLUTION}, "path", calls=6),
    "largest_bite": Door(
        {"mechanism": MACHINE, "point": "incisor", "direction": (0, 0, -1.0), "over": None},
        "mechanism",
        calls=16,
        model="mechanism",
    ),
    "check": Door({"mechanism": MECHANISM}, calls=6, dear=True),
    "schema": Door({"of": "mechanism"}),
    "write_reference": Door({"folder": "."}, "no such,folder", calls=10),
    "Mechanism.get": Door({"path": "platform.mass"}, "mechanism"),
    "Mechanism.set": Door({"path": "platform.mass", "value": 0.2}, f"mass,{MACHINE},mechanism"),
    "Mechanism.replace": Door({"name": "other"}),
    "Mechanism.checked": Door(
        {"data": lambda s: s.mechanism.entries(), "source": "machine.toml"},
        "machine.toml,expected a table,is missing,problem",
    ),
    "Mechanism": Door(
        {"name": "mine", "gravity": (0, 0, -9.81), "platform": lambda s: s.mechanism.platform}
        | {"contact": lambda s: s.mechanism.contacts, "chain": lambda s: s.mechanism.chains},
    ),
    "Scenario": Door({"duration": 0.1, "rate": 1000.0, "method": "DOP853", "rtol": 1e-6}),
    "Study": Door(STUDY | {"formulation": "momentum", "preload": 0.0, "solutions": False}),
    "Study.read": Door({"source": STUDY}, "study", long="source"),
    "Study.checked": Door({"data": STUDY, "source": "study.toml"}, "study.toml,vary,key"),
    "Study.data": Door(),
    "Study.title": Door(),
    "serve_view": Door(
        {"mechanism": MECHANISM, "solution": None, "host": "127.0.0.1", "port": 8080}
        | {"open_browser": False, "map": None, "scenario": None},
        FILES,
        calls=10,
        long="scenario",
    ),
    "Motion.from_csv": Door(
        {"path": lambda s: s.file("motion.csv", ROWS), "units": "mm"}, "motion.csv"
    ),
    "Motion.from_arrays": Door(
        {"t": T, "cutoff": None, "rate": None, "times": None, "trim": 0.0, "source": "motion"}
        | TABLE
    ),
    "Motion.from_frame": Door({"frame": lambda s: s.frame[["t", "X"]]}, "motion"),
    "Load.from_csv": Door({"path": lambda s: s.file("load.csv", CSV), "point": None}, "load.csv"),
    "Load.from_arrays": Door({"t": T, "force": ONES, "moment": ONES, "point": None}),
    "Load.from_frame": Door({"frame": lambda s: s.frame[["t", "Fx"]]}, "load"),
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
    if name in ("Model.stiffness", "Model.modes"):
        return getattr(stage.soft, method)
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
