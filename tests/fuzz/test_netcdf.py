"""Solutions and maps from strangers, read and on the live page: labelled numbers or one line."""

from __future__ import annotations

import random
import resource
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
from support.machines import model

import condyle
from condyle.view import open_view
from condyle.view.controls import ControlPanel
from condyle.view.playback import Playback
from condyle.view.readout import status_html, tables_html

from .broken_netcdf import altered
from .mutations import tried

pytestmark = pytest.mark.slow

GIB_KB = 1 << 20  # ru_maxrss counts in KB
PATIENCE = 20.0  # s of processor time a file


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A solution and a map that are whole."""
    folder, machine = tmp_path_factory.mktemp("whole"), model("masticatory")
    t, q = np.linspace(0, 1, 6), np.zeros((6, 4))
    motion = condyle.Motion.from_arrays(t, q, names=machine.independent)
    machine.solve(motion, reactions=True).condyle.save(folder / "solution.nc")
    over = ["X=-6:14:3 mm", "beta=-15:35:4 deg"]
    condyle.workspace_map(machine, over, ["ratio", "effort"], out=folder / "map.nc")
    return {kind: folder / f"{kind}.nc" for kind in ("solution", "map")}


def read(path: Path, open_: Callable[[Path], Any]) -> None:
    start = time.process_time()
    try:
        found = open_(path)
        rows = found.condyle.columns()
        assert repr(found.condyle).replace("\n", "").isprintable()
        assert all(isinstance(w, str) for w in getattr(found.condyle, "warnings", []))
        found.condyle.failures  # noqa: B018
        assert len({len(column) for column in rows.values()}) == 1
    finally:
        assert time.process_time() - start < PATIENCE


def upload(path: Path) -> None:
    """What the page does with an upload, but for the drawing."""
    played: list[Playback] = []
    page = SimpleNamespace(play_solution=lambda solution: played.append(Playback(solution)))
    file = SimpleNamespace(name="from a stranger.nc", content=path.read_bytes())
    ControlPanel.open_nc(SimpleNamespace(_view=page), file)  # type: ignore[arg-type]
    for sample in (0, len(played[0].time) - 1):
        played[0].index = sample
        shown = played[0].snapshot()
        text = status_html(shown) + tables_html(shown)
        assert "<iframe" not in text and "<img" not in text


DOORS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "solution": ("solution", lambda path: read(path, condyle.open_solution)),
    "map": ("map", lambda path: read(path, condyle.open_map)),
    "upload": ("solution", upload),
    "view of a map": ("map", lambda path: open_view(map=path, port=0).close()),
}


@pytest.mark.parametrize("door", DOORS)
def test_an_altered_file(
    tmp_path: Path, few_seeds: range, files: dict[str, Path], door: str
) -> None:
    path, (kind, opened) = tmp_path / "a.nc", DOORS[door]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    def attempt(rng: random.Random) -> None:
        shutil.copy(files[kind], path)
        altered(rng, path)
        opened(path)

    tried(few_seeds, attempt, quiet=True)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < GIB_KB


def test_a_solution_without_one_of_its_parts(
    tmp_path: Path, few_seeds: range, files: dict[str, Path]
) -> None:
    """A variable or an attribute: played without it, or one line."""
    whole, path = files["solution"], tmp_path / "a.nc"
    with h5py.File(whole) as file:
        names, parts = [*file], [*file, *file.attrs]

    def attempt(rng: random.Random) -> None:
        shutil.copy(whole, path)
        with h5py.File(path, "r+") as file:
            del (file if (name := rng.choice(parts)) in names else file.attrs)[name]
        Playback(condyle.open_solution(path)).snapshot()

    tried(few_seeds, attempt, quiet=True)
