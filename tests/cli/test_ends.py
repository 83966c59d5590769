"""How the command ends: closed streams, Ctrl-C before it begins, missing extras, wrong words."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from condyle import extras
from condyle.errors import MissingExtraError

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
@pytest.mark.parametrize("arguments", [("check", "nope"), ("--nope",)])
def test_nobody_reads_stderr(arguments: tuple[str, ...], tmp_path: Path) -> None:
    """Closed from the start, or a pipe whose reader is gone: the status is that of the error."""
    command = [sys.executable, "-m", "condyle", *arguments]
    closed = subprocess.run(["sh", "-c", 'exec "$@" 2>&-', "sh", *command], capture_output=True)
    assert (closed.returncode, closed.stdout) == (2, b"")
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as gone:
        assert gone.stderr is not None and gone.stdout is not None
        gone.stderr.close()
        assert gone.stdout.read() == b""
    assert gone.returncode == 2


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_full_stdout(tmp_path: Path) -> None:
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "condyle", "schema"]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2 and "No space left" in done.stderr
    assert "Traceback" not in done.stderr and "Exception ignored" not in done.stderr


@pytest.mark.parametrize(
    ("arguments", "package"),
    [
        (("plot",), "matplotlib"),
        (("report", "a.nc"), "plotly"),
        (("view", "--no-browser"), "viser"),
        (("run", "--figures"), "matplotlib"),
        (("run", "--report"), "plotly"),
        (
            ("motion", "from-c3d", "a.c3d", "--markers", "m", "--mechanism", "x", "--out", "o"),
            "c3d",
        ),
    ],
)
def test_a_missing_extra_is_named(
    condyle_command: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    package: str,
) -> None:
    real = extras.find_spec
    monkeypatch.setattr(extras, "find_spec", lambda n: None if n == package else real(n))
    outcome = condyle_command(*arguments)
    assert outcome.status == 2 and f"needs {package}, which is not installed" in outcome.err
    assert 'pip install "condyle[' in outcome.err and [*Path().iterdir()] == []


def test_a_map_without_matplotlib(
    condyle_command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What nobody asked for is left out with a word; where warnings are errors, it is one."""
    real, gone = extras.find_spec, {"matplotlib", "contourpy"}
    monkeypatch.setattr(extras, "find_spec", lambda n: None if n in gone else real(n))
    words = ("map", "masticatory", "--over", "X=-1:1:3 mm", "--out", "maps")
    assert condyle_command(*words, "--strict").status == 2 and not Path("maps").exists()
    done = condyle_command(*words)
    assert done.status == 0 and "no figures are drawn" in done.err
    assert [file.name for file in Path("maps").iterdir()] == ["masticatory-map.nc"]


def test_extras_that_are_named_exist() -> None:
    import tomllib

    text = (Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8")
    stated = tomllib.loads(text)["project"]["optional-dependencies"]
    for package, extra in (
        ("matplotlib", "figures"),
        ("plotly", "report"),
        ("viser", "view"),
        ("c3d", "c3d"),
    ):
        assert any(line.startswith(package) for line in stated[extra])
        assert extra in stated["all"][0]
        assert extra in str(MissingExtraError(package, extra))


ODD = ["", "nan", "inf", "-1", "1e400", "9" * 400, "x" * 5000, ".", "\udcff", "--", "[]", "\n"]


@pytest.mark.parametrize("word", ODD)
def test_odd_words_anywhere(condyle_command: Callable[..., Any], word: str) -> None:
    """A message and status 2, or a word that is fine: never a traceback."""
    for arguments in (
        ("check", word),
        ("new", word),
        ("solve", "masticatory", "--states", word, "--out", "o.csv"),
        ("pose", "masticatory", "--joints", word, "--out", "o.csv"),
        ("report", word),
        ("plot", word),
        ("run", "--motion", word),
        ("run", "--load", word),
        ("run", "--load-point", word or "?"),
        ("run", "--formulation", word),
        ("run", "--route", word),
        ("run", "--units", word),
        ("run", "--rate", word),
        ("run", "--backend", word),
        ("run", "--threads", "1.5" + word),
        ("view", "--port", word),
        ("bench", "--seconds", word),
        ("cache", word),
        ("schema", f"--{word}x"),
    ):
        outcome = condyle_command(*arguments)
        assert outcome.status in (0, 2), (arguments, outcome)
        assert bool(outcome.status) == (outcome.err != "") and "Traceback" not in outcome.err


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_signals_are_left_as_they_were(condyle_command: Callable[..., Any], name: str) -> None:
    """A process that runs the command and goes on can still be ended."""
    number = getattr(signal, name)
    before = signal.signal(number, signal.SIG_DFL)
    try:
        assert condyle_command("check", "masticatory").status == 0
        assert signal.getsignal(number) == signal.SIG_DFL
        signal.signal(number, signal.SIG_IGN)
        assert condyle_command("check", "nope").status == 2
        assert signal.getsignal(number) == signal.SIG_IGN
    finally:
        signal.signal(number, before)
