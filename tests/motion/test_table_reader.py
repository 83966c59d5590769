"""Tables as programs and spreadsheets write them, read whole or in chunks, or refused in words."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.children import PATIENCE, start

from condyle.errors import InputError
from condyle.files import limits
from condyle.motion.table_reader import iter_table, read_table

PLAIN = "t,x,y\n0,1.5,-2\n0.5,2.5e-3,+.25\n"


@pytest.mark.parametrize(
    "content",
    [
        *(PLAIN, PLAIN.rstrip("\n"), PLAIN.replace("\n", "\r\n"), PLAIN.replace("\n", "\r")),
        *("\ufeff" + PLAIN, PLAIN.encode("utf-16"), "\n\n" + PLAIN + "\n\n\n"),
        *(PLAIN + ",,\n , , \n", PLAIN.replace(",", " , "), PLAIN.replace(",", ";")),
        *(PLAIN.replace(",", "\t"), PLAIN.replace(",", ";").replace(".", ",")),
        PLAIN.replace(",", "\t").replace(".", ","),
        "sep=;\r\n" + PLAIN.replace(",", ";").replace(".", ","),
        't, "x" ,y\n"0","1.5","-2"\n0.5, "2.5e-3",.25\n',
        *('t,x,y\n0,"1,5",-2\n"0,5","2,5e-3","0,25"\n', PLAIN.replace("\n", ",,\n")),
        *(PLAIN.replace("\n", ",,\n").replace("y,,", "y"), PLAIN.replace("y\n", "y,,\n")),
        ";;;;\n" + PLAIN.replace(",", ";").replace(".", ",").replace("\n", ";\n"),
        *("t,,x,y\n0,,1.5,-2\n0.5, ,2.5e-3,.25\n", ",t,x,y\n,0,1.5,-2\n,0.5,2.5e-3,.25\n"),
        *("# measured on Monday\n" + PLAIN, PLAIN.replace("\n", "\n# 1,2,3\n")),
        *(PLAIN.replace("\n", "\n# 1,2,3\n") + "\n# end\n\n", "# " + PLAIN),
    ],
    ids=str,
)
def test_the_ways_programs_and_spreadsheets_write_a_table(csv_file, content):
    table = read_table(csv_file(content))
    assert tuple(table.columns) == ("t", "x", "y") and table.rows == 2
    np.testing.assert_array_equal(table.require("yxt"), [[-2, 1.5, 0], [0.25, 2.5e-3, 0.5]])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        *(("", "is empty"), ("\n \n", "is empty")),
        *(("t,x\n", "no rows"), ("t,x\n,\n\n", "no rows")),
        ("0,1\n1,2\n", "line 1: got numbers, expected names"),
        ("t,x,\n0,1,2\n", 'line 2: got "2" in column 3, which has no name'),
        ("t,x,x\n0,1,2\n", 'line 1: column "x" is given more than once'),
        ("t,x\n0,1\n1,abc\n", 'line 3, column "x": got "abc", expected a number'),
        ("t,x\n0,1\n1,1_0\n", 'line 3, column "x": got "1_0", expected a number'),
        ("t,x\n0,1\n1,\u0662\n", "expected a number"),
        ("t,x\n0,1\n1,1 000\n", 'got "1 000", expected a number'),
        ("t,x\n0,0x10\n", 'got "0x10", expected a number'),
        ("t,x\n0,1\n1,nan\n", 'line 3, column "x": got nan, expected a finite number'),
        ("t,x\n0,-Inf\n", "got -inf, expected a finite number"),
        ("t,x\n0,#DIV/0!\n", "expected a number. Fill the gap"),
        ("t,x\n0,1e999\n", "got inf, expected a finite number"),
        ("t,x\n0,1\n1,\n", 'line 3, column "x": the cell is empty'),
        ("t,x\n0,1\n\n2,1\n", "line 3: is empty, but rows follow"),
        ("t,x\n0,1\n,\n2,1\n", "line 3: is empty, but rows follow"),
        ("\nt,x\n0,1\n1\n", "line 4: 1 cells, expected 2"),
        ("t,x\n0,1\n1,2,3\n4\n", "line 3: 3 cells, expected 2 (t, x). Decimal commas need semi"),
        ('t,x\n0,"1\n1,2\n', "line 2: a quotation mark is not closed"),
        ('t,x\n0,1\n1,"2', "line 3: a quotation mark is not closed"),
        ("t;x\n0;1.5\n1;2,5\n", 'line 3, column "x": got "2,5" where the numbers before have "."'),
        ("t;x\n0;1,5\n1;1.000,5\n", "expected a number. Thousands are written without sep"),
        ("t;x\n0;1 000,5\n", "Thousands are written without separators"),
        ("t x\n0 1\n", "expected commas, semicolons or tabs between the columns"),
        ("t,,x\n0,1\n", "line 2: 2 cells, expected 3"),
        ("t,,x\n0,5,1\n", 'got "5" in column 2, which has no name'),
        ("t,x\n0,5,1,25\n", "Decimal commas need semicolons between the columns"),
        ("t,x\n0," + "9" * 200_000 + "x\n", "line 2: cannot be read"),
        (b"t,x\n0,\xff\n", "is not UTF-8 text"),
        (b"t,x\n\0\0\0", "is not text"),
        (b"PK\x03\x04 and so on", "spreadsheet or zip file"),
        (b"PAR1 and so on", "its name must end in .parquet"),
        ("t,x\n0,\x1b[31m\n", "is not text"),
        ("t,x\n" + "0,1\n" * 40_000 + "0,\x1b[31m\n", 'got "\\x1b[31m", expected a number'),
        ("t,x\n" + "0,1\n" * 40_000 + "0,\0\n", 'line 40002, column "x": got "\\x00"'),
        ("t," + "x" * 200_000 + "\n0,1\n", "line 1: cannot be read"),
        ("t," + ",".join(map(str, range(20_000))), "20001 columns, expected at most 10000"),
        (",".join(f"c{i // 2}" for i in range(200_000)), '"c9" and 99990 more are given more than'),
        ("t,x\n0," + "1" * (1 << 25), "16777217 bytes in a line"),
        ("# 1,2\n0,1\n", "got numbers, expected names"),
        ("t,x\n0,1\n\n# end\n1,2\n", "line 3: is empty, but rows follow"),
        ("t,x\n#N/A,1\n", 'line 2, column "t": got "#N/A", expected a number. Fill the gap'),
        ("t,x\n0,1\n1,2\r2\n", "line 4: 1 cells"),
    ],
)
def test_what_is_not_a_table_of_numbers_is_refused(csv_file, content, message):
    with pytest.raises(InputError) as caught:
        read_table(csv_file(content))
    assert message in str(caught.value)
    assert "data.csv" in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "chunk_rows", "message"),
    [
        ("t;x\n0;1,5\n1;2.5\n", 1, r'line 3, column "x": got "2\.5" where'),
        *[("t,x\n0,1\n1,1\n\n\n2,1\n", n, "line 4: is empty, but rows follow") for n in (1, 2, 3)],
        ("t,x\n" + "0,1\n" * 100 + "0,one\n", 4, "line 102"),
    ],
)
def test_what_is_wrong_between_chunks_is_found(csv_file, content, chunk_rows, message):
    """After all that comes before."""
    chunks, seen = iter_table(csv_file(content), chunk_rows), 0
    with pytest.raises(InputError, match=message):
        while True:
            seen += next(chunks).rows
    assert seen < 100 and (len(content) < 100 or seen >= 80)


def test_a_missing_file_is_named_with_its_folder_and_its_neighbours(csv_file, tmp_path):
    csv_file(PLAIN, "chewing.csv")
    for path, message in (
        (tmp_path / "chewin.csv", rf"no such file in {tmp_path}\. Did you mean chewing\.csv\?"),
        (tmp_path / "nowhere" / "chewing.csv", "the folder .* does not exist"),
        (tmp_path, "is a folder"),
        ("a\0b", "expected the path of a file"),
    ):
        with pytest.raises(InputError, match=message):
            read_table(path)


def test_columns_are_required_and_allowed_by_name(csv_file):
    with pytest.raises(InputError, match=r'column "alfa" is not known here\. Did you mean "alpha"'):
        read_table(csv_file("t,alfa,x\n0,1,text\n"), known=("t", "alpha", "x"))  # before the text
    table = read_table(csv_file("t,alpha\n0,1\n"))
    with pytest.raises(InputError, match=r'"beta", "gamma" are missing.*Available: alpha, t'):
        table.require(["t", "beta", "gamma"])


def test_chunks_join_to_the_whole_and_know_their_lines(csv_file):
    rows = "".join(f"{i},{i / 7:.17g}\n" for i in range(20))
    path = csv_file("\nt,x\n" + rows + "\n" * 9)
    for chunk_rows in (1, 3, 7, 1000):
        chunks = list(iter_table(path, chunk_rows))
        x = np.concatenate([chunk.columns["x"] for chunk in chunks])
        np.testing.assert_array_equal(x, np.arange(20) / 7)
        assert np.concatenate([c.lines for c in chunks]).tolist() == list(range(3, 23))
        assert 20 / chunk_rows <= len(chunks) <= 20 and max(c.rows for c in chunks) <= chunk_rows
        assert chunks[0].where(0) == f"{path}, line 3"


def test_reading_in_chunks_takes_flat_memory(csv_file):
    """Whole, the numbers alone take 1.6 MB."""
    path: Path = csv_file("t,x\n" + "0.125,-17.25\n" * 100_000)
    tracemalloc.start()
    rows = sum(chunk.rows for chunk in iter_table(path, 1000))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert rows == 100_000 and peak < 1.5e6


def test_a_table_of_too_many_numbers_is_refused_on_the_way(
    csv_file: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A megabyte of Parquet holds gigabytes of zeros."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    monkeypatch.setattr(limits, "NUMBERS", replace(limits.NUMBERS, most=100))
    zeros = np.zeros(60)
    pq.write_table(pa.table({"t": zeros, "x": zeros}), tmp_path / "a.parquet")
    for path in (tmp_path / "a.parquet", csv_file("t,x\n" + "0,0\n" * 60)):
        with pytest.raises(
            InputError, match=r"120 numbers in a table .* at most 100 .limit NUMBERS."
        ):
            read_table(path)


@pytest.mark.slow
def test_a_footer_of_ten_thousand_columns_is_refused_in_little_memory(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = tmp_path / "wide.parquet"
    table = pa.table({f"c{i}": pa.array(np.zeros(8)) for i in range(10_000)})
    pq.write_table(table, path, row_group_size=2)
    code = (
        "import resource, sys, pyarrow.parquet, condyle.motion.table_reader as reader\n"
        "from condyle.errors import InputError\n"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "try:\n    list(reader.iter_table(sys.argv[1], 100, known={'t': ''}))\n"
        "except InputError as error:\n    print(len(str(error)) < 1000)\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)\n"
    )
    child = start(code, path)
    out, err = child.communicate(timeout=PATIENCE)
    assert not err and out.split()[0] == "True"
    assert int(out.split()[1]) < 400_000  # KiB
