from __future__ import annotations

import os
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from condyle.atomic import replacing
from condyle.errors import InputError
from condyle.motion.table_reader import iter_table, read_table
from condyle.motion.table_writer import TableWriter, write_table

FINITE = st.floats(allow_nan=False, allow_infinity=False)


@settings(
    max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(values=arrays(float, st.tuples(st.integers(1, 20), st.integers(1, 4)), elements=FINITE))
def test_every_number_comes_back_in_the_same_bits(tmp_path, values):
    columns = {f"c{j}": column for j, column in enumerate(values.T)}
    write_table(tmp_path / "out.csv", columns)
    back = read_table(tmp_path / "out.csv").require(columns)
    assert back.tobytes() == np.ascontiguousarray(values).tobytes()


def test_nan_is_an_empty_cell_and_text_is_quoted_where_needed(tmp_path):
    columns = {"a": np.array([0.1, np.nan]), "one, two": [1, 2], "status": ["ok", 'not "ok", nan']}
    write_table(tmp_path / "out.csv", columns)
    assert (tmp_path / "out.csv").read_text() == (
        'a,"one, two",status\n0.1,1,"ok"\n,2,"not ""ok"", nan"\n'
    )


def test_chunks_are_appended_under_one_header(tmp_path):
    write_table(tmp_path / "in.csv", {"x": np.arange(100) / 3})
    with TableWriter(tmp_path / "out.csv") as out:
        for chunk in iter_table(tmp_path / "in.csv", 7):
            out.write(chunk.columns)
    assert (tmp_path / "out.csv").read_bytes() == (tmp_path / "in.csv").read_bytes()


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


def test_a_place_that_cannot_be_written_is_an_error(tmp_path):
    with pytest.raises(InputError, match="is a folder"):
        write_table(tmp_path, {"x": [1.0]})
    with pytest.raises(InputError, match="nowhere does not exist"):
        write_table(tmp_path / "nowhere" / "out.csv", {"x": [1.0]})
    with pytest.raises(InputError, match="expected the path of a file"):
        write_table("a\0b", {"x": [1.0]})


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is always full")
def test_a_full_disk_is_an_input_error_and_devices_stay(tmp_path):
    with pytest.raises(InputError, match="/dev/full: cannot be written"):
        write_table("/dev/full", {"x": np.zeros(100_000)})
    write_table("/dev/null", {"x": [1.0]})
    assert not os.path.isfile("/dev/null")


def test_a_link_stays_a_link_and_its_target_is_replaced(tmp_path):
    (tmp_path / "real.csv").write_text("old")
    (tmp_path / "link.csv").symlink_to("real.csv")
    write_table(tmp_path / "link.csv", {"x": [1.0]})
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_text() == "x\n1\n"


def test_trouble_with_another_file_keeps_its_own_name(tmp_path):
    with pytest.raises(FileNotFoundError), replacing(tmp_path / "out.csv"):
        (tmp_path / "other").read_bytes()


def test_5001_rows_of_60_columns_take_well_under_a_second(tmp_path):
    values = np.random.default_rng(0).standard_normal((60, 5001))
    columns = {f"c{j}": column for j, column in enumerate(values)}
    start = time.process_time()
    write_table(tmp_path / "out.csv", columns)
    written = time.process_time()
    assert read_table(tmp_path / "out.csv").rows == 5001
    assert written - start < 1 and time.process_time() - written < 1
