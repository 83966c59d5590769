"""How the command ends: closed streams, Ctrl-C before it begins, missing extras, odd words."""

import signal
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from support.recorded_jaw import record
from support.speeds import first

from condyle import extras
from condyle.errors import MissingExtraError

COMMAND = [sys.executable, "-m", "condyle"]
C3D = "motion from-c3d a.c3d --markers m.toml --mechanism masticatory --out o.csv"
INTERRUPT = """
import sys
class Person:
    def find_spec(self, name, *rest):
        if name == "condyle.cli.commands":
            raise KeyboardInterrupt
sys.meta_path.insert(0, Person())
from condyle.cli import main
main()
"""


def test_ctrl_c_while_it_loads() -> None:
    done = subprocess.run([sys.executable, "-c", INTERRUPT], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "condyle: stopped\n")


@pytest.mark.slow
def test_nobody_reads_stderr() -> None:
    """Closed from the start, or a pipe whose reader is gone: the status is that of the error."""
    command = [*COMMAND, "--nope"]
    closed = subprocess.run(["sh", "-c", 'exec "$@" 2>&-', "sh", *command], capture_output=True)
    assert (closed.returncode, closed.stdout) == (2, b"")
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as gone:
        assert gone.stderr is not None and gone.stdout is not None
        gone.stderr.close()
        assert gone.stdout.read() == b""
    assert gone.returncode == 2


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_full_stdout() -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run([*COMMAND, "schema"], stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2 and "No space left" in done.stderr
    assert "Traceback" not in done.stderr and "Exception ignored" not in done.stderr


@pytest.mark.slow
def test_a_missing_extra_is_named(run: Any, refused: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """What nobody asked for is left out with a word; where warnings are errors, it is one."""
    real = extras.find_spec
    gone: set[str] = set()
    monkeypatch.setattr(extras, "find_spec", lambda n: None if n in gone else real(n))
    for words, package in (
        *(("plot", "matplotlib"), ("report a.nc", "plotly"), ("view --no-browser", "viser")),
        *(("run --figures", "matplotlib"), ("run --report", "plotly"), (C3D, "c3d")),
    ):
        gone = {package}
        err = refused(*words.split(), said=f"needs {package}, which is not installed")
        assert 'pip install "condyle[' in err
    gone = {"matplotlib", "contourpy"}
    words = ("map", "masticatory", "--over", "X=-1:1:3 mm", "--out", "maps")
    refused(*words, "--strict", said="no figures are drawn")
    done = run(*words)
    assert done.status == 0 and "no figures are drawn" in done.err
    assert [file.name for file in Path("maps").iterdir()] == ["masticatory-map.nc"]


def test_extras_that_are_named_exist() -> None:
    text = (Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8")
    stated = tomllib.loads(text)["project"]["optional-dependencies"]
    named = {"matplotlib": "figures", "plotly": "report", "viser": "view", "c3d": "c3d"}
    for package, extra in named.items():
        assert any(line.startswith(package) for line in stated[extra])
        assert extra in stated["all"][0] and extra in str(MissingExtraError(package, extra))


ODD = [
    "",
    "nan",
    "inf",
    "-1",
    "1e400",
    "9" * 400,
    "x" * 5000,
    ".",
    "\udcff",
    "--",
    "[]",
    "\n",
    "\0",
]
TAKE_A_WORD = """\
check *|new *|solve masticatory --states * --out o.csv|pose masticatory --joints * --out o.csv
report *|plot *|run --motion *|run --load *|run --load-point ?*|run --formulation *|run --route *
run --units *|run --rate *|run --backend *|run --threads 1.5*|view --port *|bench --seconds *
cache *|schema --*x|motion *|C3D --max-gap *|C3D --max-residual *|C3D --units *|C3D --measured *
C3D --markers *|C3D --out *|C3D --mechanism *|C3D --force * --load l.csv
C3D --force a,b,c --load *|motion from-c3d * --markers m.toml --mechanism masticatory --out o.csv"""


@pytest.mark.slow
@pytest.mark.parametrize("turn", first(range(2)))
def test_odd_words_anywhere(run: Any, turn: int) -> None:
    """A message and status 2, or a word that is fine: never a traceback."""
    jaw = record(seconds=0.8)
    jaw.write(Path("a.c3d"))
    jaw.write_tables(Path("m.toml"))
    lines = TAKE_A_WORD.replace("\n", "|").replace("C3D", C3D).split("|")
    for i, line in enumerate(lines):
        for odd in ODD[(i + turn) % 8 :: 8]:
            words = [word.replace("*", odd) for word in line.split()]
            outcome = run(*words)
            assert outcome.status in (0, 2), (words, outcome)
            assert bool(outcome.status) == (outcome.err != ""), (words, outcome)
            assert "Traceback" not in outcome.err


def test_signals_are_left_as_they_were(run: Any) -> None:
    """A process that runs the command and goes on can still be ended."""
    numbers = signal.SIGTERM, signal.SIGHUP
    before = [signal.signal(number, signal.SIG_DFL) for number in numbers]
    try:
        for handler, word, status in (
            (signal.SIG_DFL, "masticatory", 0),
            (signal.SIG_IGN, "nope", 2),
        ):
            for number in numbers:
                signal.signal(number, handler)
            assert run("check", word).status == status
            assert [signal.getsignal(number) for number in numbers] == [handler] * 2
    finally:
        for number, own in zip(numbers, before, strict=True):
            signal.signal(number, own)
