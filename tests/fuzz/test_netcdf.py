"""Solutions and maps from strangers: labelled numbers, or one line; nothing leaves the file."""

from __future__ import annotations

import random
import resource
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle

from .broken_netcdf import altered
from .mutations import said_in_words

GIB_KB = 1 << 20  # ru_maxrss counts in KB
PATIENCE = 20.0  # s a file


def solution_file(path: Path) -> Path:
    model = condyle.derive("masticatory", backend="numpy")
    t, q = np.linspace(0, 1, 6), np.zeros((6, 4))
    motion = condyle.Motion.from_arrays(t, q, names=model.independent)
    model.solve(motion, reactions=True).condyle.save(path)
    return path


def map_file(path: Path) -> Path:
    model = condyle.derive("masticatory", backend="numpy")
    over = ["X=-6:14:3 mm", "beta=-15:35:4 deg"]
    condyle.workspace_map(model, over, ["ratio", "effort"], out=path)
    return path


@pytest.mark.parametrize(
    ("write", "read"),
    [(solution_file, condyle.open_solution), (map_file, condyle.open_map)],
    ids=["solution", "map"],
)
def test_an_altered_file(
    tmp_path: Path, few_seeds: range, write: Callable[[Path], Path], read: Callable[[Path], Any]
) -> None:
    whole, path = write(tmp_path / "whole.nc"), tmp_path / "a.nc"
    good, before = 0, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for seed in few_seeds:
        shutil.copy(whole, path)
        altered(random.Random(seed), path)
        start = time.monotonic()
        try:
            found = read(path)
            rows = found.condyle.columns()
            assert repr(found.condyle).replace("\n", "").isprintable()
            assert all(isinstance(w, str) for w in getattr(found.condyle, "warnings", []))
            found.condyle.failures  # noqa: B018
        except Exception as error:
            said_in_words(error, seed)
        else:
            good += 1
            assert len({len(column) for column in rows.values()}) == 1
        assert time.monotonic() - start < PATIENCE, seed
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < GIB_KB
    assert 0 < good < 0.7 * len(few_seeds)
