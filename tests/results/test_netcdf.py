"""A disk that is full: a clear word, no half-written file, and a process that lives on."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.machines import model

import condyle

resource = pytest.importorskip("resource")

FULL = """
    import resource, signal, sys
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    import condyle
    model = condyle.derive(condyle.load_mechanism("masticatory"), backend="numpy")
    motion = condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], rate=200)
    solution = model.solve(motion, condyle.reference_load())
    resource.setrlimit(resource.RLIMIT_FSIZE, (20480, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
    for name in ("full.nc", "full.csv"):
        try:
            solution.condyle.save(name)
        except condyle.InputError as error:
            print(error)
    del solution
    print("alive")
"""


@pytest.mark.slow
def test_a_full_disk(tmp_path: Path) -> None:
    # A measurement of coverage would meet the full disk, too.
    env = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_")}
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(FULL)],
        cwd=tmp_path,
        env=env,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0 and done.stderr == "", done.stderr
    assert "full.nc: cannot be written" in done.stdout and done.stdout.endswith("alive\n")
    assert [*tmp_path.iterdir()] == []


def test_the_file_is_the_dataset(tmp_path: Path) -> None:
    names = model("hexaglide").independent
    motion = condyle.Motion.from_arrays(np.linspace(0, 1, 9), np.zeros((9, 5)), names=names)
    solution = model("hexaglide").solve(motion)
    solution.condyle.save(tmp_path / "a.nc")
    xr.testing.assert_identical(solution, condyle.open_solution(tmp_path / "a.nc"))
