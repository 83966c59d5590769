"""Processes killed while they write: what is there afterwards is whole, the old or the new."""

from __future__ import annotations

import os
import random
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from support.children import PATIENCE, start, wait_for

import condyle
from condyle.motion import read_table
from condyle.results.solution import open_solution

RUNS_A_KILL = 30  # of the other fuzzers' runs: a kill takes longer than a broken file
MOST = 100

FILES = {"s.nc", "s.csv", "m.nc", "t.csv", "t.parquet", "t.html", "j.toml"}

# A process that has imported everything, and forks one that writes whenever it is told to.
NURSERY = """
import os, sys
from itertools import count
import numpy as np
import condyle
from condyle.files.atomic import write_text
from condyle.motion import Motion, bundled_reference, write_table
import h5netcdf, pyarrow.csv, pyarrow.parquet, xarray

model = condyle.derive("masticatory", backend="numpy")
solution = model.solve(Motion.from_csv(bundled_reference()[0], rate=20))
mapped = condyle.workspace_map(model, ["X=-6:14:9 mm", "beta=-15:35:8 deg"])

def write_for_ever():
    for n in count():
        solution["effort"].values[:] = n
        solution.condyle.save("s.nc", "s.csv")
        mapped["ratio"].values[:] = n
        mapped.condyle.save("m.nc")
        condyle.dump(model.mechanism.set("platform.mass", 1.0 + n), "j.toml")
        write_table("t.csv", {"a": np.full(20000, float(n)), "b": np.full(20000, float(n))})
        write_table("t.parquet", {"a": np.full(20000, float(n)), "b": np.full(20000, float(n))})
        write_text("t.html", str(n) * 100_000)

os.chdir(sys.argv[1])
print("ready", flush=True)
for line in sys.stdin:
    child = os.fork()
    if not child:
        os.close(0)
        write_for_ever()
    print(child, flush=True)
    os.waitpid(child, 0)
    print("gone", flush=True)
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="needs signals")
def test_kills_leave_no_torn_file(tmp_path: Path, fuzz_seeds: range) -> None:
    kills = min(max(len(fuzz_seeds) // RUNS_A_KILL, 1), MOST)
    rng = random.Random(fuzz_seeds.start)
    nursery = start(NURSERY, tmp_path)
    try:
        assert nursery.stdout is not None and nursery.stdin is not None
        assert nursery.stdout.readline() == "ready\n"
        for kill in range(kills):
            print("go", file=nursery.stdin, flush=True)
            child = int(nursery.stdout.readline())
            if not kill:
                wait_for(lambda: {path.name for path in tmp_path.iterdir()} >= FILES, nursery)
            time.sleep(rng.uniform(0.0, 0.25))
            os.kill(child, signal.SIGKILL)
            assert nursery.stdout.readline() == "gone\n"
            check(tmp_path)
    finally:
        nursery.kill()
        nursery.wait(PATIENCE)
    left = [path.name for path in tmp_path.iterdir() if path.name.startswith(".")]
    assert len(left) <= 5, "what the killed left is swept by those after them"


def check(folder: Path) -> None:
    """Every file is of one writing, from its first number to its last."""
    effort = open_solution(folder / "s.nc")["effort"].values
    assert effort.shape == (101, 6) and len(np.unique(effort)) == 1
    assert len(np.unique(condyle.open_map(folder / "m.nc")["ratio"].values)) == 1
    assert condyle.load_mechanism(folder / "j.toml").platform.mass % 1 == 0
    table = read_table(folder / "s.csv")
    assert table.rows == 101 and len(np.unique(table.columns["tau_temporalis_left"])) == 1
    for name in ("t.csv", "t.parquet"):
        table = read_table(folder / name)
        assert table.rows == 20000 and len(np.unique([*table.columns.values()])) == 1
    text = (folder / "t.html").read_text()
    assert len(text) % 100_000 == 0 and text == text[: len(text) // 100_000] * 100_000
