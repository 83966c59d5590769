"""Solutions and maps from strangers on the live page: shown, or one line; it goes on."""

from __future__ import annotations

import random
import shutil
from pathlib import Path
from types import SimpleNamespace

import h5py

import condyle
from condyle.errors import CondyleError
from condyle.view import open_view
from condyle.view.playback import Playback
from condyle.view.readout import status_html, tables_html

from .broken_netcdf import altered
from .mutations import said_in_words
from .test_netcdf import map_file, solution_file


def test_an_altered_solution_is_uploaded(tmp_path: Path, few_seeds: range) -> None:
    """What the page does with an upload, but for the drawing."""
    from condyle.view.controls import Panel

    whole, path = solution_file(tmp_path / "whole.nc"), tmp_path / "a.nc"
    played: list[Playback] = []
    page = SimpleNamespace(play_solution=lambda solution: played.append(Playback(solution)))
    for seed in few_seeds:
        shutil.copy(whole, path)
        altered(random.Random(seed), path)
        upload = SimpleNamespace(name="from a stranger.nc", content=path.read_bytes())
        before = len(played)
        try:
            Panel.open_nc(SimpleNamespace(_view=page), upload)  # type: ignore[arg-type]
            for sample in (0, len(played[-1].time) - 1):
                played[-1].index = sample
                shown = played[-1].snapshot()
                text = status_html(shown) + tables_html(shown)
                assert "<iframe" not in text and "<img" not in text
        except Exception as error:
            said_in_words(error, seed)
            del played[before:]
    assert played  # some are harmless


def test_a_solution_without_one_of_its_parts(tmp_path: Path) -> None:
    """Every variable and attribute in turn: played without it, or one line."""
    whole, path = solution_file(tmp_path / "whole.nc"), tmp_path / "a.nc"
    with h5py.File(whole) as file:
        names, attributes = [*file], [*file.attrs]
    for at, name in enumerate([*names, *attributes]):
        shutil.copy(whole, path)
        with h5py.File(path, "r+") as file:
            del (file if at < len(names) else file.attrs)[name]
        try:
            Playback(condyle.open_solution(path)).snapshot()
        except CondyleError as error:
            said_in_words(error, at)


def test_an_altered_map_is_opened(tmp_path: Path, few_seeds: range) -> None:
    whole, path = map_file(tmp_path / "whole.nc"), tmp_path / "a.nc"
    for seed in few_seeds:
        shutil.copy(whole, path)
        altered(random.Random(seed), path)
        try:
            open_view(map=path, port=0).close()
        except CondyleError as error:
            said_in_words(error, seed)
