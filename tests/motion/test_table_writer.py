"""Tables come back in the same bits; what goes wrong, or is killed, leaves no half of a file."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from condyle.errors import InputError
from condyle.files.atomic import file_stem, replacing, write_text
from condyle.motion.table_reader import iter_table, read_table
from condyle.motion.table_writer import TableWriter, write_table

FINITE = st.floats(allow_nan=False, allow_infinity=False)


@settings(
    max_examples=30,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(values=arrays(float, st.tuples(st.integers(1, 20), st.integers(1, 4)), elements=FINITE))
def test_every_number_comes_back_in_the_same_bits(tmp_path, values):
    columns = {f"c{j}": column for j, column in enumerate(values.T)}
    write_table(tmp_path / "out.csv", columns)
    back = read_table(tmp_path / "out.csv").require(columns)
    assert back.tobytes() == np.ascontiguousarray(values).tobytes()


def test_nan_is_an_empty_cell_and_chunks_are_appended_under_one_header(tmp_path):
    out = tmp_path / "out.csv"
    columns = {"a": np.array([0.1, np.nan]), "one, two": [1, 2], "status": ["ok", 'not "ok", nan']}
    write_table(out, columns)
    assert out.read_text() == 'a,"one, two",status\n0.1,1,"ok"\n,2,"not ""ok"", nan"\n'
    write_table(tmp_path / "in.csv", {"x": np.arange(100) / 3})
    with TableWriter(out) as file:
        for chunk in iter_table(tmp_path / "in.csv", 7):
            file.write(chunk.columns)
    assert out.read_bytes() == (tmp_path / "in.csv").read_bytes()


@pytest.mark.parametrize("old", [None, "old"])
def test_after_an_error_there_is_no_file_or_the_old_one(tmp_path, old):
    path = tmp_path / "out.csv"
    if old:
        path.write_text(old)
    before = os.listdir(tmp_path)
    for failure in (ZeroDivisionError, KeyboardInterrupt):
        with pytest.raises(failure), TableWriter(path) as out:
            out.write({"x": np.zeros(100_000)})
            assert len(os.listdir(tmp_path)) == len(before) + 1
            raise failure
    with pytest.raises(InputError, match="one length"):
        write_table(path, {"x": np.zeros(3), "y": np.zeros(4)})
    with pytest.raises(InputError, match="first chunk"), TableWriter(path) as out:
        out.write({"x": np.zeros(3)})
        out.write({"y": np.zeros(3)})
    with TableWriter(path):
        pass
    assert os.listdir(tmp_path) == before
    assert not old or path.read_text() == old


def test_places_that_cannot_be_written_and_links_that_stay(tmp_path):
    for path, said in (
        (tmp_path, "is a folder"),
        (tmp_path / "nowhere" / "out.csv", "nowhere does not exist"),
        ("a\0b", "expected the path of a file"),
    ):
        with pytest.raises(InputError, match=said):
            write_table(path, {"x": [1.0]})
    with pytest.raises(FileNotFoundError), replacing(tmp_path / "out.csv"):
        (tmp_path / "other").read_bytes()  # trouble with another file keeps its own name
    (tmp_path / "real.csv").write_text("old")
    (tmp_path / "link.csv").symlink_to("real.csv")
    (tmp_path / "real.csv").chmod(0o600)
    write_table(tmp_path / "link.csv", {"x": [1.0]})
    assert (tmp_path / "real.csv").stat().st_mode & 0o777 == 0o600
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_text() == "x\n1\n"


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is always full")
def test_a_full_disk_is_an_input_error_and_devices_stay():
    with pytest.raises(InputError, match="/dev/full: cannot be written"):
        write_table("/dev/full", {"x": np.zeros(100_000)})
    write_table("/dev/null", {"x": [1.0]})
    assert not os.path.isfile("/dev/null")


KILLED = """
import os, signal, sys
from condyle.files.atomic import replacing
with replacing(sys.argv[1]) as temporary:
    temporary.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
def test_what_a_killed_process_left_is_swept(tmp_path):
    subprocess.run([sys.executable, "-c", KILLED, tmp_path / "a.csv"], check=False)
    [left] = tmp_path.iterdir()
    assert left.name.startswith(".a.csv.") and left.suffix == ".part"
    write_text(tmp_path / "b.csv", "whole")
    assert os.listdir(tmp_path) == ["b.csv"]


def test_what_others_may_still_write_stays_for_a_day(tmp_path):
    with replacing(tmp_path / "a.csv") as temporary:
        temporary.write_text("half")
        mine = temporary.name.replace("a.csv", "mine")
        here = temporary.name.rpartition(".part")[0].rpartition(".")[2].split("-")[0]
        elsewhere = temporary.name.replace(here, "00000000").replace("a.csv", "elsewhere")
        strange = {".a.csv.part", ".a.12345-0123abcd.part", "a.csv.0-1-2.part"}
        others = {mine, elsewhere, *strange}
        for name in others:
            (tmp_path / name).write_text("half")
        old = time.time() - 90_000
        for kept in (others, strange):
            write_text(tmp_path / "b.csv", "whole")
            assert {*os.listdir(tmp_path)} == {temporary.name, "b.csv", *kept}
            for name in others & {*os.listdir(tmp_path)}:
                os.utime(tmp_path / name, (old, old))
    assert (tmp_path / "a.csv").read_text() == "half"


def test_no_file_is_named_as_a_device_of_windows():
    """Whatever a mechanism is called, its results can be taken there."""
    for name in ("con", "NUL", "com1", "aux.v2", "lpt9"):
        assert file_stem(name) == f"_{name}"
    for name in ("console", "com", "nullspace", "my-robot", "com12"):
        assert file_stem(name) == name
