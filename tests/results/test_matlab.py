"""Results for MATLAB: scipy reads back what was written, and Octave does."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.io import loadmat
from support.machines import model
from support.tools import run

import condyle
from condyle.motion import bundled_reference
from condyle.results.mat_file import matlab_name

OCTAVE = ("octave-cli", "--quiet", "--no-init-file", "--eval")


@pytest.fixture(scope="module")
def solution() -> xr.Dataset:
    motion = condyle.Motion.from_csv(bundled_reference()[0], rate=20)
    return model("masticatory").solve(motion, condyle.reference_load())


@pytest.fixture(scope="module")
def saved(solution: xr.Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mat") / "run.mat"
    solution.condyle.save(path)
    return path


def test_every_variable_comes_back(solution: xr.Dataset, saved: Path) -> None:
    read = loadmat(saved, simplify_cells=True)
    assert list(read["chain"]) == list(solution["chain"].values)
    assert read["info"]["mechanism_name"] == "masticatory"
    for name, variable in solution.data_vars.items():
        entry = read[name]
        np.testing.assert_array_equal(np.ravel(entry["values"]), np.ravel(variable.values))
        assert entry["units"] == variable.attrs["units"]
        assert entry["long_name"] == variable.attrs["long_name"]
        assert list(np.atleast_1d(entry["dims"])) == list(variable.dims)
    assert read["effort"]["values"].shape == solution["effort"].shape
    assert matlab_name("masseter left") == "masseter_left"
    assert matlab_name("2nd") == "x2nd" and matlab_name("_x") == "x_x"
    assert len(matlab_name("a" * 100)) == 63


@pytest.mark.slow
def test_octave_reads_it(solution: xr.Dataset, saved: Path) -> None:
    lines = (
        f's = load("{saved}");',
        'printf("%d %d\\n", size(s.effort.values));',
        'printf("%.17g\\n", s.effort.values(3, 2));',
        'printf("%s|%s|%s\\n", s.effort.units, s.chain{2}, s.effort.dims{1});',
    )
    size, value, words = run(*OCTAVE, "\n".join(lines), folder=saved.parent).split("\n")[:3]
    assert size.split() == [str(n) for n in solution["effort"].shape]
    assert float(value) == float(solution["effort"].values[2, 1])
    assert words == f"N m|{solution.condyle.mechanism.chain_names[1]}|time"


@pytest.mark.slow
def test_commands_write_it(condyle_command: Callable[..., Any], tmp_path: Path) -> None:
    """Beside the table of the same numbers."""
    rows = ["X,Y,alpha,beta", "0,0,0,0", ",".join(["0.001"] * 4)]
    (tmp_path / "states.csv").write_text("\n".join(rows))
    command = "solve masticatory --states states.csv --out x.csv --backend numpy --mat --reactions"
    outcome = condyle_command(*command.split())
    assert outcome.status == 0 and "x.mat" in outcome.out
    read = loadmat(tmp_path / "x.mat", simplify_cells=True)
    written = np.genfromtxt(tmp_path / "x.csv", delimiter=",", names=True)
    columns = np.column_stack([written[f"tau_{chain}"] for chain in read["chain"]])
    np.testing.assert_array_equal(read["effort"]["values"], columns)
    assert read["effort"]["units"] == "N m" and read["pose"]["values"].shape == (2, 6)
    reaction = read["reaction_shaft_force_masseter_left"]
    assert reaction["units"] == "N" and reaction["values"].shape == (2, 3)
    outcome = condyle_command("run", "--rate", "5", "--backend", "numpy", "--mat")
    assert outcome.status == 0, outcome.err
    assert {path.suffix for path in (tmp_path / "results").iterdir()} == {".nc", ".csv", ".mat"}
