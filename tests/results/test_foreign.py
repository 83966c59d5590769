"""NetCDF from strangers: what such a file can try, one by one."""

from __future__ import annotations

import json
import resource
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

import condyle


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    model = condyle.derive("masticatory", backend="numpy")
    motion = condyle.Motion.from_arrays(
        np.linspace(0, 1, 6), np.zeros((6, 4)), names=model.independent
    )
    path = tmp_path_factory.mktemp("nc") / "whole.nc"
    model.solve(motion).condyle.save(path)
    return path


def put(name: str, *shape: int, **how: object) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file[name]
        file.create_dataset(name, shape, "f8", **how)

    return change


def link(name: str, to: object) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        file[name] = to

    return change


def say(key: str, value: object, of: str = "/") -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        file[of].attrs[key] = value

    return change


def write(name: str, value: object) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        file[name][...] = value

    return change


MOVING = json.dumps(
    dict.fromkeys(("formulation", "route", "motion", "load", "landmark", "load_point"), "a")
    | {"solve_seconds": 1.0, "motion": "a\x7f"}
)
STRANGE = {
    "options are a list": (say("options", "[]"), '"options" is damaged'),
    "options without a motion": (say("options", '{"formulation": "x"}'), "Field required"),
    "options that move a cursor": (say("options", MOVING), "cannot be shown"),
    "options with none": (lambda file: file.attrs.__delitem__("options"), 'it has no "options"'),
    "a notice of another kind": (say("notices", '[{"kind": 3}]'), '"notices" is damaged'),
    "an event is a list": (say("events", "[[]]"), '"events" is damaged'),
    "another mechanism": (say("mechanism", "name = 3"), "expected"),
    "no variable": (lambda file: file.__delitem__("pose"), 'it has no "pose"'),
    "no time": (lambda file: file.__delitem__("time"), "time"),
    "sizes that do not go together": (put("joint", 6, 5), "dimension|is over"),
    "times that fall": (write("time", np.arange(6)[::-1]), "times that rise"),
    "a code nobody has": (write("status", 77), "codes beyond"),
    "other chains": (write("chain", "a"), '"chain" is along'),
    "44.7 GiB": (put("effort", 10**9, 6, chunks=(1000, 6)), "GiB of arrays in a file"),
    "a link out": (link("more", h5py.ExternalLink("/etc/passwd", "/x")), "is a link"),
    "a link inside": (link("more", h5py.SoftLink("/effort")), "is a link"),
    "another file's bytes": (
        put("joint", 6, 6, external=[("/etc/passwd", 0, 288)]),
        "is stored in another file",
    ),
    "a group": (lambda file: file.create_group("more"), "is a group"),
    "a unit that turns the line": (write("effort_unit", "\u202e"), "cannot be shown"),
    "words that move a cursor": (say("long_name", "\x1b[2J", "effort"), "cannot be shown"),
}


@pytest.mark.parametrize("case", STRANGE)
def test_refused(whole: Path, tmp_path: Path, case: str) -> None:
    change, words = STRANGE[case]
    path = tmp_path / "a.nc"
    path.write_bytes(whole.read_bytes())
    with h5py.File(path, "r+") as file:
        change(file)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(condyle.InputError, match=words):
        condyle.open_solution(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1 << 18  # 256 MB


def test_what_is_not_of_the_table_is_not_read(whole: Path, tmp_path: Path) -> None:
    """Neither its names nor units that turn numbers into dates."""
    path = tmp_path / "a.nc"
    path.write_bytes(whole.read_bytes())
    with h5py.File(path, "r+") as file:
        file["secret"] = np.zeros(3)
        file.attrs["note"] = "x"
        file["time"].attrs["units"] = "days since 1900-01-01"
    found = condyle.open_solution(path)
    assert "secret" not in found and "note" not in found.attrs
    assert found["time"].dtype == float
    found.attrs["options"] = json.dumps({})
    xr.testing.assert_equal(found, condyle.open_solution(whole))


def test_folders_and_empty_files(tmp_path: Path) -> None:
    (tmp_path / "a.nc").touch()
    for path in (tmp_path, tmp_path / "a.nc", tmp_path / "none.nc"):
        for read in (condyle.open_solution, condyle.open_map):
            with pytest.raises(condyle.InputError):
                read(path)
