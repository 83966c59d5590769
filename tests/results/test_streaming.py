"""A file of any length goes through in flat memory, and whole or not at all."""

from __future__ import annotations

import gc
import os
import signal
import tracemalloc
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
import pytest
from support import machines
from support.cases import case
from support.children import PATIENCE, end, start, wait_for
from support.speeds import few

from condyle.errors import CondyleError
from condyle.model.model import Model
from condyle.results import row_stream
from condyle.results.inverse_rows import solve_states

NAME = "masticatory"
CHUNK = 100
HEADER = ",".join(p + n for p in ("", "d", "dd") for n in ("X", "Y", "alpha", "beta")) + "\n"
SOLVE = f"""
import sys
from condyle.results import row_stream
row_stream.CHUNK_ROWS = {CHUNK}
from condyle.cli import main
sys.argv = ["condyle", "solve", "{NAME}", *sys.argv[1:], "--backend", "numpy"]
main()
"""


@pytest.fixture(scope="module")
def model() -> Model:
    return machines.model(NAME)


@pytest.fixture(autouse=True)
def short_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(row_stream, "CHUNK_ROWS", CHUNK)


def rows(count: int) -> list[str]:
    samples = np.tile(case(NAME).samples[:3, :12], (count // 3 + 1, 1))[:count]  # always good
    samples[:, 0] += np.linspace(-1e-4, 1e-4, count)
    return [",".join(map(repr, row)) + "\n" for row in samples.tolist()]


def write(path: Path, count: int, row_733: str | None = None) -> Path:
    """A states file, with something else in row 733, counted from 1."""
    lines = rows(count)
    if row_733 is not None:
        lines[732] = row_733 + "\n"
    path.write_text(HEADER + "".join(lines))
    return path


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def feed(pipe: Path, then: Any) -> None:
    """Four chunks into a pipe, which is left open until `then` is done."""
    with open(pipe, "w") as file:
        file.write(HEADER + "".join(rows(4 * CHUNK)))
        file.flush()
        then()


@pytest.mark.slow
def test_memory_does_not_grow(model: Model, tmp_path: Path) -> None:
    peaks = []
    for count in (CHUNK, 3 * CHUNK, 12 * CHUNK):  # the first warms up
        path = write(tmp_path / f"{count}.csv", count)
        gc.collect()
        tracemalloc.start()
        try:
            assert solve_states(model, path, tmp_path / "out.csv").data["rows"] == count
            peaks.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
    assert peaks[2] < 1.5 * peaks[1], "four times the rows"


def test_as_in_one_piece(model: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "states.csv", 2 * CHUNK + 7)
    solve_states(model, path, tmp_path / "pieces.csv")
    monkeypatch.setattr(row_stream, "CHUNK_ROWS", 65536)
    solve_states(model, path, tmp_path / "whole.csv")
    assert (tmp_path / "pieces.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()
    assert names(tmp_path) == ["pieces.csv", "states.csv", "whole.csv"]


# Something wrong in row 733 of 800, which is line 734.
FAR = "0,3" + ",0" * 10
LATE = [
    (FAR, "row 733"),
    ("0,x" + ",0" * 10, 'line 734, column "Y": got "x"'),
    ("0,nan" + ",0" * 10, 'line 734, column "Y": got nan'),
    ("0," + ",0" * 10, 'line 734, column "Y": the cell is empty'),
    ("0,0", "line 734: 2 cells, expected 12"),
    ("", "line 734: is empty"),
    ("0,0,0,0,1e200" + ",0" * 7, "row 733"),
]


def test_a_bad_row_late(model: Model, tmp_path: Path) -> None:
    """The error names it, counted from the top of the file; nothing is written, unless it is to be
    kept: then it alone has a status.
    """
    path, out = tmp_path / "states.csv", tmp_path / "out.csv"
    for text, said in LATE:
        write(path, 800, text)
        with pytest.raises(CondyleError) as failure:
            solve_states(model, path, out)
        assert said in str(failure.value)
        assert names(tmp_path) == ["states.csv"]
    write(path, 800, FAR)
    assert solve_states(model, path, out, flag=True).data["rows"] == 800
    lines = out.read_text().splitlines()
    assert len(lines) == 801 and lines[733].endswith(",unreachable,chain temporalis_left")
    assert all(line.endswith(",ok,") for i, line in enumerate(lines) if i not in (0, 733))
    write(path, 800, "0,0.004" + ",0" * 10)
    warnings = solve_states(model, path, out).data["warnings"]
    assert any("in 1 rows" in text and "in row 733" in text for text in warnings)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), MemoryError()])
def test_interrupted(
    model: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    """The file from before stays, and no other."""
    real, calls = Model.inverse_dynamics, []

    def stops(*arguments: Any, **given: Any) -> Any:
        calls.append(names(tmp_path))
        if len(calls) == 3:
            raise error
        return real(*arguments, **given)

    monkeypatch.setattr(Model, "inverse_dynamics", stops)
    path = write(tmp_path / "states.csv", 4 * CHUNK)
    (tmp_path / "out.csv").write_text("old")
    with pytest.raises(type(error)):
        solve_states(model, path, tmp_path / "out.csv")
    assert len(calls[-1]) == 3  # the temporary file was there
    assert names(tmp_path) == ["out.csv", "states.csv"]
    assert (tmp_path / "out.csv").read_text() == "old"


STOPS = few([signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL], signal.SIGTERM)


@pytest.mark.slow
@pytest.mark.parametrize("number", STOPS)
def test_stopped_from_outside(tmp_path: Path, number: signal.Signals) -> None:
    """Amid a file that comes through a pipe: no half file, and the old one as it was."""
    pipe, out = tmp_path / "states", tmp_path / "out.csv"
    os.mkfifo(pipe)
    out.write_text("old")
    child = start(SOLVE, "--states", pipe, "--out", out)

    def stop() -> None:
        wait_for(lambda: any(p.stat().st_size for p in tmp_path.glob(".out.csv*.part")), child)
        end(child, number)

    feed(pipe, stop)
    assert child.returncode != 0
    assert out.read_text() == "old"
    assert "Traceback" not in child.stderr.read()
    if number != signal.SIGKILL:
        assert names(tmp_path) == ["out.csv", "states"]


@pytest.mark.slow
def test_through_pipes(tmp_path: Path) -> None:
    """In and out: a row as soon as its chunk is done, no file in between."""
    pipe, seen = tmp_path / "states", Event()
    os.mkfifo(pipe)
    child = start(SOLVE, "--states", pipe, "--out", "/dev/stdout", "-q")
    feeder = Thread(target=feed, args=(pipe, lambda: seen.wait(PATIENCE)))
    feeder.start()
    assert child.stdout.readline().startswith("tau_")
    assert feeder.is_alive()
    seen.set()
    assert child.stdout.read().count("\n") == 4 * CHUNK
    feeder.join()
    assert (child.wait(PATIENCE), child.stderr.read()) == (0, "")
    assert names(tmp_path) == ["states"]
