"""Maps in files: whoever computes them, however large, the same numbers or none."""

from __future__ import annotations

from pathlib import Path

import pytest
import xarray as xr

import condyle
from condyle.analysis.map import compute

from .conftest import Models

OVER = ["X=-6:14:9 mm", "beta=-15:35:8 deg"]
QUANTITIES = ["pose", "ratio", "effort"]


def test_the_file_is_the_map(model_of: Models, tmp_path: Path) -> None:
    model = model_of("masticatory")
    right = condyle.workspace_map(model, OVER, QUANTITIES, out=tmp_path / "a")
    assert {"ratio", "kind", "status", "cause", "effort"} <= set(right)
    assert [path.name for path in tmp_path.iterdir()] == ["a.nc"]
    xr.testing.assert_identical(condyle.open_map(tmp_path / "a.nc"), right)


def test_blocks_do_not_matter(model_of: Models, monkeypatch: pytest.MonkeyPatch) -> None:
    model = model_of("masticatory")
    right = condyle.workspace_map(model, OVER, QUANTITIES)
    monkeypatch.setattr(compute, "BLOCK", 7)
    xr.testing.assert_identical(condyle.workspace_map(model, OVER, QUANTITIES), right)


@pytest.mark.parametrize("scheduler", ["processes", "threads"])
def test_who_computes_does_not_matter(
    model_of: Models, monkeypatch: pytest.MonkeyPatch, scheduler: str
) -> None:
    model = model_of("masticatory")
    right = condyle.workspace_map(model, OVER, QUANTITIES)
    monkeypatch.setattr(compute, "BLOCK", 16)
    found = condyle.workspace_map(model, OVER, QUANTITIES, workers=2, scheduler=scheduler)
    xr.testing.assert_identical(found, right)
    with pytest.raises(condyle.InputError, match="expected processes, threads, or"):
        condyle.workspace_map(model, OVER, scheduler="nobody")


def test_more_than_memory_is_refused(model_of: Models, tmp_path: Path) -> None:
    over = ["X=-6:14:100000 mm", "beta=-15:35:100000 deg"]
    with pytest.raises(condyle.InputError, match=r"takes .* GiB, and .* GiB are free"):
        condyle.workspace_map(model_of("masticatory"), over, out=tmp_path / "a.nc")
    assert [*tmp_path.iterdir()] == []


def test_what_fails_leaves_what_was_there(
    model_of: Models, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, place = model_of("masticatory"), tmp_path / "a.nc"
    before = condyle.workspace_map(model, OVER, "joint", out=place)
    monkeypatch.setattr(compute, "BLOCK", 16)
    blocks = iter(range(3))

    def failing(*args: object) -> object:
        if next(blocks) == 2:
            raise KeyboardInterrupt
        return own(*args)

    own = compute.Block
    monkeypatch.setattr(compute, "Block", failing)
    with pytest.raises(KeyboardInterrupt):
        condyle.workspace_map(model, OVER, "ratio", out=place)
    assert [path.name for path in tmp_path.iterdir()] == ["a.nc"]
    xr.testing.assert_identical(condyle.open_map(place), before)
