"""The bar on a terminal, and the steps that long work reports."""

import os
import select
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pytest

import condyle
from condyle.export import export
from condyle.export.c_samples import vectors
from condyle.motion import Motion, bundled_reference, iter_table
from condyle.progress import Step, progress_bar, step, watched_by
from condyle.report.figures import save_solution_figures
from condyle.report.page import write_report
from condyle.results.inverse_rows import solve_states
from condyle.results.pose_rows import pose_states
from condyle.results.row_stream import StatesReport

pty = pytest.importorskip("pty", reason="terminals of this kind are on Unix only")
PATIENCE = 60  # seconds for a picture that never comes
STATES = [prefix + name for prefix in ("", "d", "dd") for name in ("X", "Y", "alpha", "beta")]


@dataclass
class Terminal:
    """A terminal, and what it was sent."""

    end: int
    stream: TextIO
    sent: str = ""

    def wait_for(self, text: str) -> None:
        while text not in self.sent:
            assert self._more(PATIENCE), f"no {text!r} in {self.sent!r}"

    def all(self) -> str:
        while self._more(0):
            pass
        return self.sent

    def _more(self, seconds: float) -> bool:
        ready = bool(select.select([self.end], [], [], seconds)[0])
        if ready:
            self.sent += os.read(self.end, 65536).decode()
        return ready


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[Terminal]:
    monkeypatch.setattr("condyle.progress.DELAY", 0)
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w") as stream:
        yield Terminal(ours, stream)
    os.close(ours)


@pytest.fixture
def on_terminal(terminal: Terminal, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Puts the terminal in the place of stderr; to be called in the test, as pytest puts its own
    there before each."""
    return lambda: monkeypatch.setattr(sys, "stderr", terminal.stream)


def test_a_bar_shows_the_innermost_step_and_goes(terminal: Terminal, on_terminal: Any) -> None:
    on_terminal()
    with progress_bar():
        with step("shearing", 4) as advance:
            advance(1)
            terminal.wait_for("shearing")
            terminal.wait_for("25%")
            advance(2)
            terminal.wait_for("75%")
            with step("sharpening"):
                terminal.wait_for("sharpening")
        terminal.wait_for("working")
        print("a warning", file=sys.stderr)
    sent = terminal.all()
    assert "a warning" in sent
    last = sent.rpartition("\x1b[?25h")[2]  # the cursor is back, the line wiped
    assert last.endswith("\x1b[2K") and "working" not in last


def test_quick_work_shows_no_bar(
    terminal: Terminal, on_terminal: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    on_terminal()
    monkeypatch.setattr("condyle.progress.DELAY", 3600)
    with progress_bar(), step("shearing", 4) as advance:
        advance(4)
    assert terminal.all() == ""


def test_a_name_is_shown_as_it_stands(terminal: Terminal, on_terminal: Any) -> None:
    on_terminal()
    with progress_bar(), step("reading a[1].csv"):
        terminal.wait_for("a[1].csv")


@pytest.mark.parametrize("switch", [None, "--quiet", "--json", "no terminal"])
def test_a_bar_of_a_command(
    condyle_command: Any,
    terminal: Terminal,
    on_terminal: Any,
    monkeypatch: pytest.MonkeyPatch,
    switch: str | None,
) -> None:
    """On a terminal's stderr, while it works; never with --quiet or --json; stdout has the answer
    alone."""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("CONDYLE_BACKEND", "numpy")

    def solve(*_: Any, **options: Any) -> StatesReport:
        with step("solving a file", 10) as advance:
            advance(4)
            if switch is None:
                terminal.wait_for("40%")
        return StatesReport({"rows": 10, "warnings": [], "files": []})

    monkeypatch.setattr("condyle.results.inverse_rows.solve_states", solve)
    if switch != "no terminal":
        on_terminal()
    words = ["solve", "masticatory", "--states", "a.csv", "--out", "b.csv"]
    outcome = condyle_command(*words, *[switch] * (switch in ("--quiet", "--json")))
    assert outcome.status == 0 and "\x1b" not in outcome.out
    assert ("solving a file" in terminal.all()) == (switch is None)
    assert switch is None or terminal.sent == ""


def test_a_bar_goes_when_work_fails(terminal: Terminal, on_terminal: Any) -> None:
    on_terminal()
    with pytest.raises(KeyboardInterrupt), progress_bar(), step("shearing"):
        terminal.wait_for("shearing")
        raise KeyboardInterrupt
    assert terminal.all().endswith("\x1b[2K")


class OpenSteps(list[Step]):
    """Notes every step by what is done."""

    def __init__(self) -> None:
        self.noted: dict[str, Step] = {}

    def append(self, step: Step) -> None:
        super().append(step)
        self.noted[step.what] = step

    def __getitem__(self, what: str) -> Step:  # type: ignore[override]
        return self.noted[what]


@pytest.fixture
def steps() -> Iterator[OpenSteps]:
    steps = OpenSteps()
    with watched_by(steps):
        yield steps
    assert len(steps) == 0  # each has ended


def test_rows_of_a_file(steps: OpenSteps, tmp_path: Path) -> None:
    """Progress is by bytes of the file, to its end."""
    states = tmp_path / "states.csv"
    np.savetxt(states, np.zeros((50, 12)), delimiter=",", header=",".join(STATES), comments="")
    solve_states(condyle.derive("masticatory"), states, tmp_path / "out.csv")
    assert "deriving the equations" in steps.noted
    solving, size = steps["solving states.csv"], states.stat().st_size
    assert (solving.total, solving.done) == (size, size - len(",".join(STATES)) - 1)
    assert all(len(steps) == 1 for _ in iter_table(states, 10))
    assert steps["reading states.csv"].done == solving.done
    mechanism, joints = condyle.load_mechanism("masticatory"), tmp_path / "joints.csv"
    joints.write_text(",".join(f"joint_{n}" for n in mechanism.chain_names) + "\n0,0,0,0,0,0\n")
    pose_states(mechanism, joints, tmp_path / "out.csv")
    assert "finding poses" in steps.noted


@pytest.mark.slow
def test_steps_of_a_run(steps: OpenSteps, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    solution = condyle.derive("masticatory").solve(
        Motion.from_csv(bundled_reference()[0], rate=20, cutoff="auto")
    )
    assert {"smoothing", "solving"} <= set(steps.noted)
    solution.condyle.save(tmp_path / "a.nc")
    assert "writing results" in steps.noted
    write_report(solution, tmp_path / "a.html")
    assert "writing the report" in steps.noted
    monkeypatch.setattr("condyle.report.figures.saving.save", lambda *_: [])
    save_solution_figures(solution, tmp_path)
    drawing = steps["drawing figures"]
    assert drawing.total == drawing.done > 5


@pytest.mark.usefixtures("compiler_command")
def test_building_a_kernel(
    steps: OpenSteps, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CONDYLE_CACHE", str(tmp_path))
    condyle.derive("gough-stewart", backend="compiled").inverse_dynamics(*np.zeros((3, 1, 6)))
    assert "building a kernel" in steps.noted


def test_a_library_that_nobody_watches_never_loads_a_bar() -> None:
    work = "import condyle, sys\nfrom condyle.progress import step\nwith step('work'):\n"
    loaded = "    condyle.load_mechanism('masticatory')\nsys.exit('rich' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", work + loaded], check=False).returncode == 0


def test_exports_of_c_say_how_far_they_are(steps: OpenSteps) -> None:
    """Functions one by one, then their samples."""
    vectors(export(condyle.load_mechanism("gough-stewart"), ("inverse", "motion"), lanes=0))
    assert steps["writing functions"].done == steps["recording samples"].done == 2
