"""Wrong input: one clear message on stderr, status 2, and not a single new file."""

import shlex
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
JOINTS = [f"joint_{name}" for name in condyle.load_mechanism("masticatory").chain_names]
TIMES = np.linspace(0, 1, 21)
JAW = bundled_text("masticatory")


def table(header: list[str], *rows: Any) -> str:
    """Rows of numbers or of text, short ones filled with zeros."""
    filled = [[*row, *[0] * (len(header) - len(row))] for row in rows]
    return "\n".join(",".join(map(str, row)) for row in (header, *filled)) + "\n"


def states(*rows: Any, header: list[str] = STATES) -> str:
    return table(header, *rows)


def motion(header: list[str] = MOTION, **columns: Any) -> str:
    """A small motion; columns by name override it."""
    values = {name: 1e-4 * TIMES for name in header} | {"t": TIMES} | columns
    return table(header, *np.column_stack([values[n] for n in header]))


def spoilt(row: int, column: str, cell: str) -> str:
    """A motion with one cell replaced."""
    lines = [line.split(",") for line in motion().splitlines()]
    lines[row][MOTION.index(column)] = cell
    return "\n".join(map(",".join, lines)) + "\n"


def toml(old: str, new: str) -> str:
    assert old in JAW
    return JAW.replace(old, new, 1)


REST, TRIAL, ZERO, BYTES = states([0]), motion(), table(JOINTS, [0]), bytes(range(256))
COMMANDS = {
    "solve": "solve masticatory --states in.csv --out out.csv",
    "pose": "pose masticatory --joints in.csv --out out.csv",
    "run": "run --motion in.csv --out out",
    "load": "run --load in.csv --rate 20",
    "check": "check in.csv",
}
# Of each command: what is added to its line, its file (None: there is none), what is said.
# A line that begins with ! is a command of its own.
CASES: dict[str, list[tuple[str, str | bytes | None, str]]] = {
    "check": [
        ("!run jaw.toml", None, "jaw.toml does not exist"),
        ("!check masticatry", None, 'Did you mean "masticatory"'),
        ("!check .", None, "is a folder"),
        ("", "mass: 3", "is not TOML"), ("", "", "name: is missing"),
        ("", BYTES, "is not a text file"),
        ("", toml("crank_tip = [-22.16, 59", "crank_tip = [-5.14, 63.04, 94.39]#"), "zero length"),
        ("", toml("mass = 0.2 ", "mass = -0.2 "), "platform.mass: expected a val"),
        ("", toml("xx = 125.2e-6", "xx = 300e-6"), "triangle inequality"),
        ("", toml('kind = "RSS"', 'kind = "RSR"'), "the kind 'RSR' is unknown"),
        ("", toml("mass = 0.2 ", 'mass = "0.2" '), "expected a number"),
        ("", toml("mass = 0.2 ", "mass = nan "), "expected a finite number"),
        ("", "[[chain]]".join(JAW.split("[[chain]]")[:4]),
         "3 actuators cannot drive 4 degrees of freedom"),
        ("", toml("[-26.65, -72, 42.53]", "[-26.65, 72, 42.53]"), "cannot hold the platform"),
        ("", toml("mass = 0.2 ", "mas = 0.2 "), 'Did you mean "mass"'),
        ("", toml("crank_tip =", "cranktip ="), 'Did you mean "crank_tip"'),
        ("", toml("offset =", "ofset ="), 'Did you mean "offset"'),
        ("", toml("[[chain]]", "[[chains]]"), 'Did you mean "chain"'),
        ("", toml('kind = "RSS"', 'kind = "rss"'), 'Did you mean "RSS"'),
        ("", toml('kind = "RSS"', 'kind = "RUS"'), 'unknown. Did you mean "RSS"'),
        ("", toml('kind = "plane"', 'kind = "plain"'), 'Did you mean "plane"'),
    ],
    "solve": [
        ("", None, "in.csv: no such file"), ("--states .", REST, "is a folder"),
        ("", "", "is empty"), ("", states(), "no rows"), ("", BYTES, "is not text"),
        ("", states([0], header=STATES[:-1]), '"ddbeta" is missing'),
        ("", states([0], header=[*STATES, "Fxx"]), '"Fxx" is not known'),
        ("", states([0], header=[*STATES, "fx", "FX"]), 'both mean "Fx"'),
        ("", states([0], header=[*STATES, "Fx [lb]"]), '"lb" is not a unit'),
        ("", states([0], header=[*STATES, "X"]), "more than once"),
        ("", states([0], header=[*STATES, "dZ"]), "dZ"),
        ("", states([0], header=[*STATES[:-1], "dbeta2"]), "dbeta2"),
        ("", states([0], header=["X", "dX", "ddX"]), "got the pose coordinates X;"),
        ("", states([0], header=["Z", *STATES]), "got the pose coordinates X, Y, Z"),
        ("", states([0], header=[n.replace("Y", "Z") for n in STATES]), "not independent"),
        ("", states([0], ["nan"]), 'line 3, column "X": got nan'),
        ("", states([0], [0, "-inf"]), 'line 3, column "Y": got -inf'),
        ("", states(["one"]), 'line 2, column "X": got "one", expected a number'),
        ("", states([0], [0, ""]), 'line 3, column "Y": the cell is empty'),
        ("", REST + "1,2\n", "line 3: 2 cells, expected 12"),
        ("", states([0], [0.4]), "cannot reach M"),
        ("", states([0], [1e300] * 4), "cannot reach M"),
        ("", states([0], [0, 0, 1.5], header=ROLLED),
         "no pose with the given coordinates has the contacts"),
        ("", states([0], [0, 0, 0, 0, *[1e300] * 8]), "efforts at row 2 are not finite"),
        ("", states(["1e999"]), "got inf"), ("--strict", states([0, 0.004]), "leaves its bounds"),
        ("--load-point molar", REST, 'no load point "molar"'),
        ("--formulation newton", REST, 'no formulation "newton"'),
        ("--route cor", REST, 'Did you mean "core"'), ("--out .", REST, "is a folder"),
        ("--out no/out.csv", REST, "does not exist"),
        ("--out /dev/full", REST, "cannot be written"),
    ],
    "run": [
        ("", None, "in.csv: no such file"), ("", "\n".join(TRIAL.split("\n")[:6]), "5 rows"),
        ("", motion([*NAMES]), '"t" is missing'),
        ("", motion(MOTION[:-1]), "got the 3 coordinates X, Y, alpha"),
        ("", motion(["t", "X", "Z", "alpha", "beta"]), "not independent"),
        ("", motion(["t", "X", "y"]), "not both"), ("", motion(["t", "x", "z"]), "also needs y"),
        ("", motion([*MOTION, "gama"]), 'Did you mean "gamma"'),
        ("--units cm", TRIAL.replace("X", "X [mm]", 1),
         'the header of column "X" and the units asked for differ'),
        ("", motion(t=TIMES[::-1]), "times must be strictly increasing"),
        ("", spoilt(3, "t", "0.05"), "line 4: t is 0.05 s after 0.05 s"),
        ("", spoilt(3, "X", "NaN"), 'line 4, column "X": got nan'),
        ("", spoilt(5, "beta", "1,5"), "line 6: 6 cells, expected 5"),
        ("", motion(X=1e300 * TIMES), "condyle: "), ("", motion(X=0.1 * TIMES), "cannot reach M"),
        ("--strict", motion(Y=0.005 * TIMES), "leaves its bounds"),
        ("--units furlong", TRIAL, '"furlong" is not a unit'),
        ("--units mm,m", TRIAL, "two units of length"), ("!run --units mm", None, "--motion"),
        ("!run --landmark incisors", None, 'Did you mean "incisor"'),
        ("--landmark incisor", TRIAL, "x, y, z"), ("--rate 0", TRIAL, "above 0"),
        ("--rate 1e15", TRIAL, "1e+15 samples, which take"),
        ("--rate 1e8", TRIAL, "1e+08 samples, which take"),
        ("--trim 0.6", TRIAL, "leaves nothing of 1 s"), ("--trim -1", TRIAL, "--trim"),
        ("--rate fast", TRIAL, "Invalid value"), ("--smooth soft", TRIAL, "soft"),
        ("--smooth 500", TRIAL, "below half the sampling rate"),
        ("--out in.csv", TRIAL, "--out in.csv"), ("--out in.csv/x", TRIAL, "--out in.csv/x"),
        ("--out /proc/results", TRIAL, "--out /proc/results"),
        ("!compare --motion in.csv --out in.csv", TRIAL, "--out in.csv"),
        ("!reference --out in.csv", TRIAL, "--out in.csv"),
    ],
    "load": [
        ("", None, "in.csv: no such file"), ("", table(["t", "a"], [0]), '"Fz" are miss'),
        ("", table(LOAD, [0, 0, 0, -5], [1, 0, 0, -5]), "no load at 1 to 5 s"),
        ("", table(LOAD, [1], [0]), "strictly increasing"),
        ("", table(LOAD, [0, "a"]), 'got "a"'),
        ("!run --load-point nose", None, 'no load point "nose"'),
        ("!run gough-stewart --landmark nose", None, "--landmark nose"),
    ],
    "pose": [
        ("", None, "in.csv: no such file"), ("", "", "is empty"),
        ("", "joint_left\n0\n", "joint_left"), ("", table(JOINTS, ["nan"] * 6), 'got nan'),
        ("", table(JOINTS, [3] * 6), "no pose has the joint coordinates"),
        ("", table(["t", *JOINTS], [1], [1]), "times must be strictly increasing"),
        ("", table(JOINTS, [1e-3]), "raise --tolerance"),
        ("--all --flag", ZERO, "--all and --flag"), ("--seed 1", ZERO, "--seed requires --all"),
        ("--tolerance -1", ZERO, "tolerance"), ("--out .", ZERO, "is a folder"),
        ("--tolerance inf", ZERO, "tolerance: expected a finite number"),
    ],
    "solutions, scenarios, commands and names": [
        ("!plot a.nc", None, "a.nc: no such file"), ("!report .", None, "is a folder"),
        ("!report in.csv", "t\n0\n", "is not a NetCDF solution"),
        ("!plot in.csv", "", "is not a NetCDF solution"),
        ("!plot --figure efort", None, 'Did you mean "effort"'),
        ("!view --no-browser --solution a.nc", None, "no such file"),
        ("!view --no-browser --simulate in.csv", "duration = -1\n[controller]\nkind = 'pid'\n",
         "2 problems"),
        ("!view --no-browser --simulate in.csv", "[start]\ndZ = 1.0\n", "dZ is not free"),
        ("!view --no-browser --simulate in.csv --solution in.csv", "", "shows no solution"),
        ("!view --port 99999", None, "65535"),
        ("!chekc", None, "'check'"), ("!run --montion a.csv", None, "--motion"),
        ("!solve masticatory", None, "--states"), ("!bench --seconds nan", None, "--seconds"),
        ("!bench --out .", None, "in .json"), ("!bench --out in.csv/a.json", "", "--out in.csv"),
        ("!new ..", None, "cannot be the name"), ("!new 'a\"b'", None, "cannot be the name"),
        ("!new ''", None, "expected a name"), (f"!new {'n' * 300}", None, "at most 80 letters"),
        ("!new NUL", None, "no device of Windows"), ("!new con.a --study fit", None, "(con, nul"),
        ("!new no/where", None, "does not exist"), ("!new", None, "needs a name"),
        ("!new x --from hexaglyde", None, 'Did you mean "hexaglide"'),
        ("!new x --from jaw --study fit", None, "--from and --study each say"),
        ("!new x --from jaw --from-mjcf a.xml", None, "--from and --from-mjcf each say"),
        ("!new x --study session --from-mjcf a.xml", None, "take one"),
        ("!new x --study sessoin", None, 'Did you mean "session"'),
        ("!new x --list", None, "--list writes no file"),
        ("!sweep", None, "expected a study"), ("!sweep a.toml", None, "no such file"),
        ("!sweep --show .", None, "is not the folder of a sweep"),
        ("!map masticatory --over 'X=5:-5:9 mm'", None, "must be increasing"),
        ("!map masticatory --quantity ratoi", None, "ratoi"),
        ("!map masticatory --run missing.nc", None, "missing.nc"),
        ("!map masticatory --margin 2", None, "margin"),
        ("!map masticatory --scheduler nobody", None, "expected processes, threads, or"),
        ("!map masticatory --distribution bouned", None, "bounded"),
    ],
    "words of the command line": [
        ("!export controller masticatory --out a", None, "condyle simulate --new FILE.toml writes"),
        ("!export ros2 masticatory --out a", None, "'--scenario'. condyle simulate --new"),
        ("!path masticatory --out a.csv", None, "'--study'. condyle new NAME --study KIND writes"),
        ("!identify masticatory --out a.toml --log in.csv", REST, "condyle new NAME --study"),
        ("!calibrate masticatory --poses in.csv --out a.toml", REST, "condyle new NAME --study"),
        ("!optimise", None, "Missing argument 'study'. condyle new NAME --study"),
        ("!solve", None, "Missing argument 'mechanism'. It is a file or a bundled mechanism"),
        ("!report", None, "Missing argument 'solution'. condyle run writes one"),
        ("!video a.nc", None, "Missing option '--out'. Help: condyle video --help"),
        ("!export cc", None, "Did you mean 'c'? Help: condyle export --help"),
        ("!run --montion a.csv", None, "--motion, --reactions) Help: condyle run --help"),
        ("!run a b c", None, "unexpected extra argument(s) (b c) Help: condyle run --help"),
        ("!run --rate", None, "'--rate' requires an argument. Help:"),
        ("!run --quiet=3", None, "'--quiet' does not take a value. Help:"),
        ("!view --port x", None, "'--port': Input should be a valid integer"),
        ("!simulate --log-noise encoder=1", None, "--log-noise requires --log"),
        ("!simulate --log a.csv --log-noise encodr=1", None, 'Did you mean "encoder"'),
        ("!view gough-stewart --solution in.csv", REST, "leave gough-stewart out"),
        ("!view gough-stewart --map in.csv", REST, "--map contains its mechanism"),
        ("!new x --from hexaglyde", None, "condyle: --from: no bundled mechanism"),
        ("!new x --study sessoin", None, "condyle: --study: no study is called"),
        ("!bite --point nose", None, "condyle: --point: unknown point 'nose'; available: incisor"),
        ("!derivatives masticatory --states in.csv --of mass --out a.csv", REST,
         "condyle: --of: unknown result 'mass'. Available: acceleration"),
        ("!export fmu masticatory --kind plantt --out x", None, '--kind: no FMU "plantt". Did you'),
        ("!cite in.csv", REST, "is not a NetCDF solution: it does not begin as one"),
        ("!video in.csv --out a.gif", REST, "does not begin as one"),
        ("!map --run in.csv", REST, "does not begin as one"),
        ("!view --map in.csv", REST, "is not a NetCDF map: it does not begin as one"),
    ],
    "what would be ignored or replaced": [
        ("!solve masticatory --states in.csv --out in.csv", REST, "replace the file of states"),
        ("!run in.csv --out in.csv", JAW, "--out in.csv: cannot be made a folder"),
        ("!simulate --scenario in.csv --log in.csv", "duration = 0.01", "the file of scenario"),
        ("!motion from-c3d a.csv --markers k.toml --mechanism masticatory --out o.csv --load o.csv",
         None, "--out and --load are o.csv: two files to write have one name"),
        ("!motion from-c3d in.csv --markers k --mechanism masticatory --out o.csv --load in.csv",
         TRIAL, "--load in.csv would replace the file of recording"),
        ("!modes masticatory --states in.csv --motion in.csv", REST, "the file of states"),
        *((f"!export {kind} masticatory --out in.csv", TRIAL, "condyle: --out in.csv: cannot be")
          for kind in ("c", "controller --scenario a.toml", "fmu", "matlab", "mjcf")),
        ("!plot a.nc --out in.csv", TRIAL, "--out in.csv: cannot be made a folder"),
        ("!session a.toml --out in.csv", TRIAL, "--out in.csv: cannot be made a folder"),
        ("!export c masticatory --question closure --out a", None, "condyle: --from: got none; t"),
        ("!check in.csv --project", "duration = 0.01\n", "--project and --picture are for mech"),
        ("!check masticatory --project --picture a.svg", None, "leave --project out"),
        ("!solve masticatory --states in.csv --out a.xlsx", REST, "--out a.xlsx: expected a name"),
        *(
            (f"!{line} --out a.txt", None, "condyle: --out a.txt: expected a name that ends in .")
            for line in (
                "bite", "optimise a.toml", "path masticatory --study a.toml",
                "pose masticatory --joints a.csv", "excite masticatory",
                *(f"{name} masticatory --states a" for name in ("solve", "forward", "derivatives")),
                "motion from-c3d a.c3d --markers a.toml --mechanism masticatory",
            )
        ),
        ("!calibrate masticatory --poses a --study a --out a.txt", None, "that ends in .toml"),
        ("!identify masticatory --log a --study a --out a", None, "--out a: expected a name that"),
        ("!identify masticatory --log a --study a --out no/a.toml", None, "no does not exist"),
        ("!identify masticatory --log a --study a --out a.toml --report a.txt", None,
         "condyle: --report a.txt: expected a name that ends in .html or .htm"),
        ("!report a.nc --out a.txt", None, "--out a.txt: expected a name that ends in .html or"),
        ("!report a.nc --pdf a.txt", None, "--pdf a.txt: expected a name that ends in .pdf"),
        ("!video a.nc --out a.txt", None, "--out a.txt: expected a name that ends in .gif or .mp4"),
        ("!simulate --log a.txt", None, "--log a.txt: expected a name that ends in .csv"),
        ("!simulate --new a.txt", None, "--new a.txt: expected a name that ends in .toml"),
        ("!bench --out a.txt", None, "a.txt: expected a name that ends in .json"),
        ("!plot --figure effort", None, "to draw them name the results, as in condyle plot"),
        ("!new --list --force", None, "--list writes no file"),
        ("!simulate --new a.toml --check-gains", None, "--new only writes a scenario"),
        ("!map --over X=0:5:3 --load 'Fz=-5 N'", None, "--load: no quantity of the map depends"),
        ("!map --over X=0:5:3 --load-point incisor", None, "--load-point: requires load or dir"),
        ("!export c masticatory --question nope --out a", None, 'no question "nope" to export'),
        ("!map --over X=0:5:3 --stiffness 5", None, "depends on it: add stiffness, or leave"),
    ],
    "numbers of the command line": [
        ("!map --over 'X=-5:5:2.5 mm'", None, "--over: X: expected a whole count of at least 2"),
        ("!map --over 'X=-5:5:100000' --over 'Y=-5:5:100000'", None, "choose fewer points"),
        ("!solve masticatory --states in.csv --out a.csv --noise X=1mm", REST,
         "--noise: X=1mm: expected a number, got '1mm'; a unit stands behind a space"),
        ("!compare --rate -3", None, "--rate: expected samples per second, above 0, got -3"),
        ("!bite --direction 0,nan,1", None, 'such as "0,0,-1", (3,) or (D, 3), of a length'),
        ("!bite --over openning=0:40:3", None, '--over: expected a coordinate or opening, got'),
        ("!bite --over 'beta=0:20:1e8 deg'", None, "--over: expected at most 10000 poses, got 1"),
        ("!derivatives masticatory --states in.csv --wrt effort --out a.csv", REST,
         "numbers of the file. --zeros (zeros=True) gives zeros"),
        ("!solve masticatory --states in.csv --out a.csv --max-error 1e-30", REST,
         "more than --max-error 1e-30. Keep away"),
        ("!schema studdy", None, "condyle: expected a kind of file, got 'studdy'. Did you mean"),
        ("!bite --direction 1,2", None, '--direction: expected three numbers, such as "0,0,-1"'),
        ("!motion from-c3d a.csv --units ft --markers in.csv --mechanism masticatory --out o.csv",
         'fixed = ["a", "b", "c"]\nplatform = ["d", "e", "f"]\nhome = 0.0\n[register]\n'
         'incisor = "a"\nleft_condyle = "b"\nright_condyle = "c"\n',
         "--units: expected m, cm, mm, um, got 'ft'"),
        ("!new a --from-mjcf none.xml", None, "none.xml: no such file"),
    ],
    "mistakes in studies": [
        ("!identify masticatory --log in.csv --study in.csv --out a.toml", "numbers = []\n",
         "numbers: expected at least 1 entries, got 0"),
        ("!identify masticatory --log in.csv --study in.csv --out a.toml",
         'numbers = ["platform.mass"]\n[options]\nvalidate = 1.5\ndelay = "chanel"\n',
         "delay: expected true or false or 'channel', got 'chanel'\n"),
        ("!identify masticatory --log b.csv --log b.csv --study in.csv --out a.toml",
         'numbers = ["platform.mass"]\n', "logs: b.csv is given twice"),
        ("!excite masticatory --study in.csv --out a.csv", "[wanted]\n'platform.mas' = 1.0\n",
         'Did you mean "platform.mass"'),
        ("!excite masticatory --study in.csv --out a.csv", "rate = 1.0\n", "smooth: expected"),
        ("!sweep in.csv", 'motion = { file = "trial", rate = 0.0 }\nvary = []\n', "rate: expected"),
        ("!simulate --scenario in.csv", '[controller]\nkind = "impedance"\ndelay = 1.5\n',
         "delay: expected a whole number, got 1.5"),
        ("!simulate --scenario in.csv", '[[load]]\nkind = "food"\nfood = "apple"\n',
         "load[0].food: expected a preset, got 'apple'"),
    ],
    "files of another kind": [
        (line, 'duration = 1.0\nrate = 500\n[controller]\nkind = "computed_torque"\n',
         f'is a file of kind "scenario"{expected}; condyle simulate MECHANISM --scenario in.csv')
        for line, expected in (
            ("!run in.csv", ', expected "mechanism"'),
            ("!check in.csv --of mechanism", ', expected "mechanism"'),
            ("!sweep in.csv", ', expected "study"'),
            ("!design in.csv", ', expected "design"'),
            ("!optimise in.csv --out a.csv", ', expected "optimise"'),
            ("!session in.csv", ', expected "session"'),
            ("!path masticatory --study in.csv --out a.csv", ', expected "path"'),
            ("!excite masticatory --study in.csv --out a.csv", ', expected "excitation"'),
        )
    ] + [
        ("!simulate --scenario in.csv", JAW,
         'is a file of kind "mechanism", expected "scenario"; condyle run in.csv takes it'),
        ("!simulate --scenario in.csv", "", "is empty, and would be a free fall; condyle simulate"),
        ("!simulate --scenario in.csv", '[controller]\nkind = "none"\nstiffness = 5.0\n',
         "controller.stiffness: is not a key"),
        ("!simulate --scenario in.csv", "duraton = 1\n", 'Did you mean "duration"'),
        ("!check in.csv", toml("[[chain]]", "[[chains]]"), '1 problem\n'),
    ],
    "how efforts are chosen": [
        (f"!{command} masticatory {more}", REST, said)
        for command in ("run", "solve --states in.csv --out a.csv", "compare")
        for more, said in (
            ("--distribution cubik", 'unknown objective "cubik". Did you mean "cubic"'),
            ("--distribution cubic", "efforts that only pull"),
            ("--preload 1", "minimum_norm knows none"),
            ("--distribution bounded --preload -1", "at least 0, got -1"),
            ("--distribution bounded --preload nan", "at least 0, got nan"),
            ("--contact-weight 1", "does not weigh contact forces"),
            ("--distribution weighted --contact-weight -1", "at least 0, got -1"),
        )
    ] + [
        (f"!compare --tradeoff {more}", None, "leave --distribution and --contact-weight out")
        for more in ("--distribution bounded", "--contact-weight 1")
    ],
}  # fmt: skip


def test_nothing_that_is_read_is_replaced(refused: Any) -> None:
    """Nor a file that another names, or that stands where results are written."""
    law = "stiffness = 400.0\ndamping = 40.0\nmotion = 'chew.csv'\n"
    Path("law.toml").write_text(f"duration = 0.01\n[controller]\nkind = 'computed_torque'\n{law}")
    Path("results").mkdir()
    for name in ("chew.csv", "results/masticatory.csv"):
        Path(name).write_text(TRIAL)
    Path("a.mat").write_text(REST)
    for line, file in (
        ("simulate --scenario law.toml --log chew.csv", "chew.csv"),
        ("run --motion results/masticatory.csv", "results/masticatory.csv"),
        ("solve masticatory --states a.mat --out a.csv --mat", "a.mat"),
    ):
        refused(*line.split(), said=f"{file}: would replace what this command reads")


@pytest.mark.parametrize("kind", CASES)
def test_wrong_input(refused: Any, kind: str) -> None:
    """One line, or a list under one."""
    for more, content, message in CASES[kind]:
        line = more[1:] if more[:1] == "!" else f"{COMMANDS[kind]} {more}"
        Path("in.csv").unlink(missing_ok=True)
        if content is not None:
            Path("in.csv").write_bytes(content if isinstance(content, bytes) else content.encode())
        err = refused(*shlex.split(line), said=message)
        assert "Warning" not in err and err.startswith("condyle: ")
        first, *others = err.rstrip("\n").split("\n")
        assert all(line.startswith("  - ") for line in others) and len(first) < 500, err
