"""References of a result: whole entries, of what it used."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import xarray as xr

import condyle


def keys(text: str) -> set[str]:
    return set(re.findall(r"^@\w+\{(\w+),$", text, re.MULTILINE))


def test_every_entry_is_whole() -> None:
    found = condyle.cite()
    assert keys(found) == {"Cheng2023", "condyle", "CasADi", "xarray"}
    assert condyle.__version__ in found and "VERSION" not in found
    assert found.count("{") == found.count("}")


def test_a_solution_names_its_solvers_and_muscles(tmp_path: Path) -> None:
    motion = condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], rate=5)
    jaw = condyle.derive("human-jaw-muscles", distribution="cubic", backend="numpy").solve(motion)
    jaw.condyle.save(tmp_path / "jaw.nc")
    assert {"DAQP", "HiGHS", "DeGroote2016", "Hannam2008"} <= keys(
        condyle.cite(tmp_path / "jaw.nc")
    )
    plain = condyle.derive("masticatory", backend="numpy").solve(motion)
    assert keys(condyle.cite(plain)) == keys(condyle.cite())


def test_what_is_not_ours_is_refused() -> None:
    with pytest.raises(condyle.InputError, match="expected a solution of condyle"):
        condyle.cite(xr.Dataset())
