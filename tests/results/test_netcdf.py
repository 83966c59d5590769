"""NetCDF on a full disk, and from strangers: what such a file can try, one by one."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import textwrap
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from support.machines import model

import condyle

resource = pytest.importorskip("resource")

Change = Callable[[h5py.File], object]
FULL = """
    import resource, signal, sys
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    import condyle
    model = condyle.derive(condyle.load_mechanism("masticatory"), backend="numpy")
    motion = condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], rate=20)
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
    """A clear word, no half-written file, and a process that lives on."""
    # A measurement of coverage would meet the full disk, too.
    env = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_")}
    call = [sys.executable, "-c", textwrap.dedent(FULL)]
    done = subprocess.run(call, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    assert "full.nc: cannot be written" in done.stdout and done.stdout.endswith("alive\n")
    assert [*tmp_path.iterdir()] == []


@pytest.fixture(scope="module")
def solution() -> xr.Dataset:
    names = model("masticatory").independent
    motion = condyle.Motion.from_arrays(np.linspace(0, 1, 6), np.zeros((6, 4)), names=names)
    return model("masticatory").solve(motion)


@pytest.fixture(scope="module")
def whole(solution: xr.Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("nc") / "whole.nc"
    solution.condyle.save(path)
    return path


def put(name: str, *shape: int, **how: object) -> Change:
    def change(file: h5py.File) -> None:
        del file[name]
        file.create_dataset(name, shape, "f8", **how)

    return change


def link(to: object) -> Change:
    return lambda file: file.__setitem__("more", to)


def say(key: str, value: object, of: str = "/") -> Change:
    return lambda file: file[of].attrs.__setitem__(key, value)


def write(name: str, value: object) -> Change:
    return lambda file: file[name].__setitem__(..., value)


def remove(name: str) -> Change:
    return lambda file: file.__delitem__(name)


MOVING = json.dumps(
    dict.fromkeys(("formulation", "route", "motion", "load", "landmark", "load_point"), "a")
    | {"solve_seconds": 1.0, "motion": "a\x7f"}
)
ELSEWHERE = [("/etc/passwd", 0, 288)]
STRANGE: list[tuple[Change, str]] = [
    (say("options", "[]"), '"options" is damaged'),
    (say("options", '{"formulation": "x"}'), "Field required"),
    (say("options", MOVING), "cannot be shown"),
    (lambda file: file.attrs.__delitem__("options"), 'it has no "options"'),
    (say("notices", '[{"kind": 3}]'), '"notices" is damaged'),
    (say("events", "[[]]"), '"events" is damaged'),
    (say("mechanism", "name = 3"), "expected"),
    (remove("pose"), 'it has no "pose"'),
    (remove("time"), 'it has no "time"|is not a NetCDF solution'),
    (put("joint", 6, 5), "dimension|is over"),  # sizes that do not go together
    (write("time", np.arange(6)[::-1]), "times that rise"),
    (write("status", 77), "codes beyond"),
    (write("chain", "a"), '"chain" is along'),
    (put("effort", 10**9, 6, chunks=(1000, 6)), "GiB of arrays in a file"),  # 44.7 of them
    (link(h5py.ExternalLink("/etc/passwd", "/x")), "is a link"),
    (link(h5py.SoftLink("/effort")), "is a link"),
    (put("joint", 6, 6, external=ELSEWHERE), "is stored in another file"),
    (lambda file: file.create_group("more"), "is a group"),
    (write("effort_unit", "\u202e"), "cannot be shown"),  # turns the line
    (say("long_name", "\x1b[2J", "effort"), "cannot be shown"),  # moves a cursor
]


@pytest.mark.slow
def test_strange_files_are_refused(whole: Path, tmp_path: Path) -> None:
    """In little memory."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for i, (change, words) in enumerate(STRANGE):
        path = tmp_path / f"case-{i}.nc"
        path.write_bytes(whole.read_bytes())
        with h5py.File(path, "r+") as file:
            change(file)
        with pytest.raises(condyle.InputError, match=words):
            condyle.open_solution(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1 << 18  # 256 MB
    (tmp_path / "empty.nc").touch()
    for path in (tmp_path, tmp_path / "empty.nc", tmp_path / "none.nc"):
        for read in (condyle.open_solution, condyle.open_map):
            with pytest.raises(condyle.InputError):
                read(path)


def test_what_is_not_of_the_table_is_not_read(
    solution: xr.Dataset, whole: Path, tmp_path: Path
) -> None:
    """Neither its names nor units that turn numbers into dates; what is of it comes back."""
    xr.testing.assert_identical(solution, condyle.open_solution(whole))
    path = tmp_path / "a.nc"
    path.write_bytes(whole.read_bytes())
    with h5py.File(path, "r+") as file:
        file["secret"] = np.zeros(3)
        file.attrs["note"] = "x"
        file["time"].attrs["units"] = "days since 1900-01-01"
    found = condyle.open_solution(path)
    assert "secret" not in found and "note" not in found.attrs
    assert found["time"].dtype == float
    xr.testing.assert_equal(found, solution)


def test_texts_of_any_length_are_refused_before_there_is_room_for_them(
    whole: Path, tmp_path: Path
) -> None:
    """HDF5 makes room for what a file says, and looks only then."""
    path = tmp_path / "a.nc"
    with h5py.File(path, "w") as file:  # of the first version, whose messages have no checksum
        file.attrs["mechanism"] = "x" * 1234
    data = whole.read_bytes(), path.read_bytes()
    with h5py.File(whole) as file:
        places = file["chain"].id.get_offset() + 16, data[1].index(struct.pack("<I", 1234))
    for content, at in zip(data, places, strict=True):
        path.write_bytes(content[:at] + b"\xff\xff\xff\x7f" + content[at + 4 :])
        with pytest.raises(condyle.InputError, match=r"2.15e\+09 characters of text"):
            condyle.open_solution(path)


def test_a_block_that_unpacks_to_more_than_it_is_refused(whole: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.nc"
    path.write_bytes(whole.read_bytes())
    with h5py.File(path, "r+") as file:
        del file["effort"]
        made = file.create_dataset("effort", (6, 6), "f8", chunks=(6, 6), compression="gzip")
        made.id.write_direct_chunk((0, 0), zlib.compress(bytes(1 << 27)))
    with pytest.raises(condyle.InputError, match="has a block larger than 0"):
        condyle.open_solution(path)
