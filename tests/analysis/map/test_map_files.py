"""Maps that are streamed to a folder: the same numbers, and whole or not at all."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import condyle
from condyle.analysis.map import compute
from condyle.atomic import _host

from .conftest import Models

OVER = ["X=-6:14:9 mm", "beta=-15:35:8 deg"]
QUANTITIES = ["pose", "ratio", "effort"]


def test_streamed_as_in_memory(
    model_of: Models, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = model_of("masticatory")
    right = condyle.workspace_map(model, OVER, QUANTITIES)
    assert {"ratio", "kind", "status", "cause", "effort"} <= set(right)
    monkeypatch.setattr(compute, "BLOCK", 16)  # two rows of the first axis
    found = condyle.workspace_map(model, OVER, QUANTITIES, out=tmp_path / "a.zarr")
    assert found.sizes == right.sizes
    for name in right.variables:
        assert found[name].dtype.kind == right[name].dtype.kind
        np.testing.assert_array_equal(found[name].values, right[name].values)
        assert found[name].attrs.items() >= right[name].attrs.items()
    assert found.attrs["mechanism"] == right.attrs["mechanism"]
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]


def test_blocks_do_not_matter(model_of: Models, monkeypatch: pytest.MonkeyPatch) -> None:
    model = model_of("masticatory")
    right = condyle.workspace_map(model, OVER, QUANTITIES)
    monkeypatch.setattr(compute, "BLOCK", 7)
    xr.testing.assert_identical(condyle.workspace_map(model, OVER, QUANTITIES), right)


@pytest.mark.parametrize("scheduler", ["processes", "threads"])
def test_who_computes_does_not_matter(
    model_of: Models, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scheduler: str
) -> None:
    model = model_of("masticatory")
    right = condyle.workspace_map(model, OVER, QUANTITIES)
    monkeypatch.setattr(compute, "BLOCK", 16)
    others = {"workers": 2, "scheduler": scheduler}
    found = condyle.workspace_map(model, OVER, QUANTITIES, out=tmp_path / "a.zarr", **others)
    for name in right.data_vars:
        np.testing.assert_array_equal(found[name].values, right[name].values)
    with pytest.raises(condyle.InputError, match="expected processes, threads, dask"):
        condyle.workspace_map(model, OVER, scheduler="nobody")


def test_what_fails_leaves_what_was_there(
    model_of: Models, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, store = model_of("masticatory"), tmp_path / "a.zarr"
    before = condyle.workspace_map(model, OVER, "joint", out=store).load()
    monkeypatch.setattr(compute, "BLOCK", 16)
    blocks = iter(range(3))

    def failing(*args: object) -> object:
        if next(blocks) == 2:
            raise KeyboardInterrupt
        return own(*args)

    own = compute.Block
    monkeypatch.setattr(compute, "Block", failing)
    for place in (store, tmp_path / "new.zarr"):
        blocks = iter(range(3))
        with pytest.raises(KeyboardInterrupt):
            condyle.workspace_map(model, OVER, "ratio", out=place)
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]
    xr.testing.assert_identical(xr.open_zarr(store, chunks=None, consolidated=False).load(), before)


def test_what_a_killed_process_left_is_swept(model_of: Models, tmp_path: Path) -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    left = tmp_path / f".a.zarr.{_host()}-{gone.pid}-0123abcd.part"
    mine = tmp_path / f".b.zarr.{_host()}-{os.getpid()}-0123abcd.part"
    for folder in (left, mine):
        folder.mkdir()
        (folder / "x").write_text("")
    condyle.workspace_map(model_of("masticatory"), OVER, out=tmp_path / "a.zarr")
    assert not left.exists() and mine.exists()


def test_other_folders_are_not_replaced(model_of: Models, tmp_path: Path) -> None:
    (tmp_path / "notes.zarr").mkdir()
    (tmp_path / "notes.zarr" / "mine.txt").write_text("keep")
    for place in ("notes.zarr", "notes.zarr/mine.txt/a.zarr"):
        with pytest.raises(condyle.InputError, match=r"cannot be|exists"):
            condyle.workspace_map(model_of("masticatory"), OVER, out=tmp_path / place)
    assert (tmp_path / "notes.zarr" / "mine.txt").read_text() == "keep"
