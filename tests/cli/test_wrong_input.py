"""Wrong input: one clear message on stderr, status 2, and not a single new file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.mechanism import bundled_text

NAMES = ("X", "Y", "alpha", "beta")
STATES = [prefix + name for prefix in ("", "d", "dd") for name in NAMES]
ROLLED = [name.replace("alpha", "gamma") for name in STATES]
MOTION = ["t", *NAMES]
LOAD = ["t", "Fx", "Fy", "Fz"]
TIMES = np.linspace(0, 1, 21)


def table(header: list[str], rows: Any) -> str:
    lines = [",".join(header), *(",".join(map(str, row)) for row in rows)]
    return "\n".join(lines) + "\n"


def states(*rows: Any, header: list[str] = STATES) -> str:
    return table(header, [[*row, *[0] * (len(header) - len(row))] for row in rows])


def motion(header: list[str] = MOTION, rows: Any = None, **columns: Any) -> str:
    """A small motion; columns by name override it."""
    values = {name: 1e-4 * TIMES for name in header} | {"t": TIMES} | columns
    return table(header, np.column_stack([values[n] for n in header]) if rows is None else rows)


def spoilt(row: int, column: str, cell: str) -> str:
    """A motion with one cell replaced."""
    lines = motion().splitlines()
    cells = lines[row].split(",")
    cells[MOTION.index(column)] = cell
    return "\n".join([*lines[:row], ",".join(cells), *lines[row + 1 :]]) + "\n"


def toml(old: str, new: str, count: int = 1) -> str:
    text = bundled_text("masticatory")
    assert old in text
    return text.replace(old, new, count)


LOADED = table(LOAD, [[0, 0, 0, -5], [1, 0, 0, -5]])
SOLVE = ("solve", "masticatory", "--states", "in.csv", "--out", "out.csv")
RUN = ("run", "--motion", "in.csv", "--out", "out")
CHECK = ("check", "in.toml")
POSE = ("pose", "masticatory", "--joints", "in.csv", "--out", "out.csv")
JOINTS = [f"joint_{name}" for name in condyle.load_mechanism("masticatory").chain_names]

Case = tuple[tuple[str, ...], str | bytes | None, str]
CASES: dict[str, Case] = {
    # mechanism files
    "mechanism missing": (("run", "jaw.toml"), None, "jaw.toml does not exist"),
    "mechanism misspelt": (("check", "masticatry"), None, 'Did you mean "masticatory"'),
    "mechanism is a folder": (("check", "."), None, "cannot be read"),
    "mechanism is not TOML": (CHECK, "mass: 3", "is not TOML"),
    "mechanism is empty": (CHECK, "", "name: is missing"),
    "mechanism is binary": (CHECK, bytes(range(256)), "is not a text file"),
    "zero length": (
        CHECK,
        toml("crank_tip = [-22.16, 59", "crank_tip = [-5.14, 63.04, 94.39]#"),
        "zero length",
    ),
    "negative mass": (CHECK, toml("mass = 0.2 ", "mass = -0.2 "), "platform.mass: expected a val"),
    "triangle inequality": (CHECK, toml("xx = 125.2e-6", "xx = 300e-6"), "triangle inequality"),
    "unknown chain": (CHECK, toml('kind = "RSS"', 'kind = "RSR"'), "the kind 'RSR' is unknown"),
    "text in a number": (CHECK, toml("mass = 0.2 ", 'mass = "0.2" '), "expected a number"),
    "nan": (CHECK, toml("mass = 0.2 ", "mass = nan "), "expected a finite number"),
    "too few actuators": (
        CHECK,
        "[[chain]]".join(bundled_text("masticatory").split("[[chain]]")[:4]),
        "3 actuators cannot drive 4 degrees of freedom",
    ),
    "contacts that cannot hold": (
        CHECK,
        toml("[-26.65, -72, 42.53]", "[-26.65, 72, 42.53]"),
        "cannot hold the platform",
    ),
    # states
    "states missing": (SOLVE, None, "in.csv: no such file"),
    "states is a folder": ((*SOLVE[:3], ".", *SOLVE[4:]), None, "is a folder"),
    "states empty": (SOLVE, "", "is empty"),
    "states without rows": (SOLVE, states(), "no rows"),
    "states binary": (SOLVE, bytes(range(256)), "is not text"),
    "states without a rate": (SOLVE, states([0], header=STATES[:-1]), '"ddbeta" is missing'),
    "states unknown column": (SOLVE, states([0], header=[*STATES, "Fxx"]), '"Fxx" is not known'),
    "states in two cases": (SOLVE, states([0], header=[*STATES, "fx", "FX"]), 'both mean "Fx"'),
    "states in pounds": (SOLVE, states([0], header=[*STATES, "Fx [lb]"]), '"lb" is not a unit'),
    "states column twice": (SOLVE, states([0], header=[*STATES, "X"]), "more than once"),
    "states rate of another": (SOLVE, states([0], header=[*STATES, "dZ"]), "dZ"),
    "states too few": (
        SOLVE,
        states([0], header=["X", "dX", "ddX"]),
        "got the pose coordinates X;",
    ),
    "states too many": (
        SOLVE,
        states([0], header=["Z", *STATES]),
        "got the pose coordinates X, Y, Z",
    ),
    "states dependent": (
        SOLVE,
        states([0], header=[n.replace("Y", "Z") for n in STATES]),
        "not independent",
    ),
    "states nan": (SOLVE, states([0], ["nan"]), 'line 3, column "X": got "nan"'),
    "states inf": (SOLVE, states([0], [0, "-inf"]), 'line 3, column "Y": got "-inf"'),
    "states text": (SOLVE, states(["one"]), 'line 2, column "X": got "one", expected a number'),
    "states empty cell": (SOLVE, states([0], [0, ""]), 'line 3, column "Y": the cell is empty'),
    "states ragged": (SOLVE, states([0]) + "1,2\n", "line 3: 2 cells, expected 12"),
    "states unreachable": (SOLVE, states([0], [0.4]), "cannot reach M"),
    "states beyond the contacts": (
        SOLVE,
        states([0], [0, 0, 1.5], header=ROLLED),
        "no pose with the given coordinates has the contacts",
    ),
    "states huge": (SOLVE, states([0], [1e300, 1e300, 1e300, 1e300]), "cannot reach M"),
    "states huge rates": (
        SOLVE,
        states([0], [0, 0, 0, 0, *[1e300] * 8]),
        "efforts at row 2 are not finite",
    ),
    "states too large": (SOLVE, states(["1e999"]), "too large"),
    "states out of bounds": ((*SOLVE, "--strict"), states([0, 0.004]), "leaves its bounds"),
    "load point": ((*SOLVE, "--load-point", "molar"), states([0]), 'no load point "molar"'),
    "formulation": ((*SOLVE, "--formulation", "newton"), states([0]), 'no formulation "newton"'),
    "route": ((*SOLVE, "--route", "cor"), states([0]), 'Did you mean "core"'),
    "out is a folder": ((*SOLVE[:5], "."), states([0]), "is a folder"),
    "out has no folder": ((*SOLVE[:5], "no/out.csv"), states([0]), "does not exist"),
    "out is full": ((*SOLVE[:5], "/dev/full"), states([0]), "cannot be written"),
    # motions
    "motion missing": (RUN, None, "in.csv: no such file"),
    "motion of 5 rows": (RUN, motion(rows=[[t, 0, 0, 0, 0] for t in range(5)]), "5 rows, expected"),
    "motion without t": (RUN, motion([*NAMES]), '"t" is missing'),
    "motion without beta": (RUN, motion(MOTION[:-1]), "got the 3 coordinates X, Y, alpha"),
    "motion dependent": (RUN, motion(["t", "X", "Z", "alpha", "beta"]), "not independent"),
    "motion mixed": (RUN, motion(["t", "X", "y"]), "not both"),
    "motion of half a landmark": (RUN, motion(["t", "x", "z"]), "also needs y"),
    "motion misspelt column": (RUN, motion([*MOTION, "gama"]), 'Did you mean "gamma"'),
    "motion in two units": (
        (*RUN, "--units", "cm"),
        motion().replace("X", "X [mm]", 1),
        'the header of column "X" and the units asked for differ',
    ),
    "motion falls": (RUN, motion(t=TIMES[::-1]), "times must be strictly increasing"),
    "motion stands": (RUN, spoilt(3, "t", "0.05"), "line 4: t is 0.05 s after 0.05 s"),
    "motion nan": (RUN, spoilt(3, "X", "NaN"), 'line 4, column "X": got "NaN"'),
    "motion text": (RUN, spoilt(5, "beta", "1,5"), "line 6: 6 cells, expected 5"),
    "motion huge": (RUN, motion(X=1e300 * TIMES), "condyle: "),
    "motion unreachable": (RUN, motion(X=0.1 * TIMES), "cannot reach M"),
    "motion out of bounds": ((*RUN, "--strict"), motion(Y=0.005 * TIMES), "leaves its bounds"),
    "units": ((*RUN, "--units", "furlong"), motion(), '"furlong" is not a unit'),
    "units twice": ((*RUN, "--units", "mm,m"), motion(), "two units of length"),
    "units of the bundled motion": (("run", "--units", "mm"), None, "--motion"),
    "landmark": (("run", "--landmark", "incisors"), None, 'Did you mean "incisor"'),
    "landmark of coordinates": ((*RUN, "--landmark", "incisor"), motion(), "x, y, z"),
    "rate": ((*RUN, "--rate", "0"), motion(), "above 0"),
    "rate too high": ((*RUN, "--rate", "1e15"), motion(), "1e+15 samples, which take about"),
    "rate of 1e8 samples": ((*RUN, "--rate", "1e8"), motion(), "1e+08 samples, which take about"),
    "trim everything": ((*RUN, "--trim", "0.6"), motion(), "leaves nothing of 1 s"),
    "trim is negative": ((*RUN, "--trim", "-1"), motion(), "--trim"),
    "rate is text": ((*RUN, "--rate", "fast"), motion(), "Invalid value"),
    "cut-off": ((*RUN, "--smooth", "soft"), motion(), "soft"),
    "cut-off too high": ((*RUN, "--smooth", "500"), motion(), "below half the sampling rate"),
    "folder is a file": ((*RUN[:3], "--out", "in.csv"), motion(), "--out in.csv"),
    "folder below a file": ((*RUN[:3], "--out", "in.csv/x"), motion(), "--out in.csv/x"),
    "folder cannot be": ((*RUN[:3], "--out", "/proc/results"), motion(), "--out /proc/results"),
    "compare in a file": (("compare", *RUN[1:3], "--out", "in.csv"), motion(), "--out in.csv"),
    "reference in a file": (("reference", "--out", "in.csv"), motion(), "--out in.csv"),
    # loads
    "load missing": (("run", "--load", "in.csv"), None, "in.csv: no such file"),
    "load of nothing": (("run", "--load", "in.csv"), table(["t", "a"], [[0, 0]]), '"Fz" are miss'),
    "load too short": (("run", "--load", "in.csv"), LOADED, "no load at 1 to 5 s"),
    "load falls": (
        ("run", "--load", "in.csv"),
        table(LOAD, [[1, 0, 0, 0], [0, 0, 0, 0]]),
        "strictly increasing",
    ),
    "load text": (("run", "--load", "in.csv"), table(LOAD, [[0, "a", 0, 0]]), 'got "a"'),
    "load point of run": (("run", "--load-point", "nose"), None, 'no load point "nose"'),
    "landmark elsewhere": (("run", "gough-stewart", "--landmark", "nose"), None, "--landmark nose"),
    # keys and kinds
    "key misspelt": (CHECK, toml("mass = 0.2 ", "mas = 0.2 "), 'Did you mean "mass"'),
    "key of a chain": (CHECK, toml("crank_tip =", "cranktip ="), 'Did you mean "crank_tip"'),
    "key of a surface": (CHECK, toml("offset =", "ofset ="), 'Did you mean "offset"'),
    "table misspelt": (CHECK, toml("[[chain]]", "[[chains]]"), 'Did you mean "chain"'),
    "chain family": (CHECK, toml('kind = "RSS"', 'kind = "rss"'), 'Did you mean "RSS"'),
    "surface kind": (CHECK, toml('kind = "plane"', 'kind = "plain"'), 'Did you mean "plane"'),
    "column misspelt": (SOLVE, states([0], header=[*STATES[:-1], "dbeta2"]), "dbeta2"),
    # joints
    "joints missing": (POSE, None, "in.csv: no such file"),
    "joints empty": (POSE, "", "is empty"),
    "joints of others": (POSE, "joint_left\n0\n", "joint_left"),
    "joints nan": (POSE, table(JOINTS, [["nan"] * 6]), 'got "nan"'),
    "joints unreachable": (POSE, table(JOINTS, [[3] * 6]), "no pose has the joint coordinates"),
    "joints whose times fall": (
        POSE,
        table(["t", *JOINTS], [[1, *[0] * 6]] * 2),
        "times must be strictly increasing",
    ),
    "joints that disagree": (POSE, table(JOINTS, [[1e-3] + [0] * 5]), "raise --tolerance"),
    "all poses and flags": (
        (*POSE, "--all", "--flag"),
        table(JOINTS, [[0] * 6]),
        "--all and --flag",
    ),
    "seed of no search": (
        (*POSE, "--seed", "1"),
        table(JOINTS, [[0] * 6]),
        "--seed requires --all",
    ),
    "tolerance below zero": ((*POSE, "--tolerance", "-1"), table(JOINTS, [[0] * 6]), "tolerance"),
    "tolerance without end": (
        (*POSE, "--tolerance", "inf"),
        table(JOINTS, [[0] * 6]),
        "tolerance: expected a finite number",
    ),
    "poses in a folder": ((*POSE[:5], "."), table(JOINTS, [[0] * 6]), "is a folder"),
    # solutions
    "solution missing": (("plot", "a.nc"), None, "a.nc: no such file"),
    "solution is a folder": (("report", "."), None, "is a folder"),
    "solution is none": (("report", "in.csv"), "t\n0\n", "is not a NetCDF solution"),
    "solution empty": (("plot", "in.csv"), "", "is not a NetCDF solution"),
    "solution to view": (("view", "--no-browser", "--solution", "a.nc"), None, "no such file"),
    "scenario to view": (
        ("view", "--no-browser", "--simulate", "in.csv"),
        "duration = -1\n[controller]\nkind = 'pid'\n",
        "2 problems",
    ),
    "scenario that does not fit": (
        ("view", "--no-browser", "--simulate", "in.csv"),
        "[start]\ndZ = 1.0\n",
        "dZ is not free",
    ),
    "solution and scenario to view": (
        ("view", "--no-browser", "--simulate", "in.csv", "--solution", "in.csv"),
        "",
        "shows no solution",
    ),
    "figure": (("plot", "--figure", "efort"), None, 'Did you mean "effort"'),
    # commands, options and numbers
    "command": (("chekc",), None, "'check'"),
    "option": (("run", "--montion", "a.csv"), None, "--motion"),
    "port": (("view", "--port", "99999"), None, "65535"),
    "seconds of a row": (("bench", "--seconds", "nan"), None, "--seconds"),
    "bench in a folder": (("bench", "--out", "."), None, "is a folder"),
    "bench below a file": (("bench", "--out", "in.csv/a.json"), "", "--out in.csv"),
    # names
    "new hidden": (("new", ".."), None, "cannot be the name"),
    "new with a quote": (("new", 'a"b'), None, "cannot be the name"),
    "new without a name": (("new", ""), None, "expected a name"),
    "new with a long name": (("new", "n" * 300), None, "at most 80 letters"),
    "new in no folder": (("new", "no/where"), None, "does not exist"),
}


@pytest.mark.parametrize("case", CASES)
def test_wrong_input(condyle_command: Callable[..., Any], case: str) -> None:
    arguments, content, message = CASES[case]
    if content is not None:
        name = "in.toml" if arguments[:1] == ("check",) else "in.csv"
        Path(name).write_bytes(content if isinstance(content, bytes) else content.encode())
    before = {path: path.stat().st_size for path in Path().rglob("*")}
    outcome = condyle_command(*arguments)
    assert outcome.status == 2
    assert message in outcome.err
    assert outcome.out == "" and "Traceback" not in outcome.err and "Warning" not in outcome.err
    assert outcome.err.startswith(("condyle: ", "Usage: "))
    if outcome.err.startswith("condyle: "):  # one line, or a list under one
        first, *others = outcome.err.rstrip("\n").split("\n")
        assert all(line.startswith("  - ") for line in others), outcome.err
        assert len(first) < 500
    assert {path: path.stat().st_size for path in Path().rglob("*")} == before
