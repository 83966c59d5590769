"""Tables as spreadsheets write them, through every command that reads one: the same numbers."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.speeds import few

import condyle
from condyle.motion import read_table, write_table

NAMES = ("X", "Y", "alpha", "beta")
TIMES = np.linspace(0, 1, 21)
COMMANDS = {
    "solve": "solve masticatory --states in.csv --out out.csv",
    "pose": "pose masticatory --joints in.csv --out out.csv",
    "motion": "run --motion in.csv --out .",
    "load": "run --load in.csv --rate 20 --out .",
}


def plain(command: str) -> str:
    """A table for the command, with points and commas."""
    if command == "solve":
        columns = {p + name: 0.001 * (TIMES + 0.5) for p in ("", "d", "dd") for name in NAMES}
    elif command == "pose":
        chains = condyle.load_mechanism("masticatory").chain_names
        columns = {f"joint_{n}": 0 * TIMES for n in chains} | {"t": TIMES}
    elif command == "motion":
        columns = {"t": TIMES} | {name: 0.001 * np.sin(3 * TIMES) for name in NAMES}
    else:
        columns = {"t": 5 * TIMES} | {name: -2.5 * TIMES for name in ("Fx", "Fy", "Fz")}
    rows = [list(columns), *np.transpose([*columns.values()]).tolist()]
    return "".join(",".join(map(str, row)) + "\n" for row in rows)


def european(text: str) -> str:
    return text.replace(",", ";").replace(".", ",")


# Of a table with points and commas; all ways are in tests/motion.
WAYS: dict[str, Callable[[str], bytes]] = {
    "plain": str.encode,
    "tabs, decimal commas, UTF-16": lambda t: european(t).replace(";", "\t").encode("utf-16"),
    "byte order mark and CRLF": lambda t: b"\xef\xbb\xbf" + t.replace("\n", "\r\n").encode(),
}


@pytest.mark.parametrize("command", few(COMMANDS, "solve", rest=pytest.mark.slow))
def test_the_same_numbers(run: Any, command: str) -> None:
    """Of all ways where commands are quick, else of two; and of Parquet, in and out."""
    quick, results = command in ("solve", "pose"), {}
    for way in [*WAYS][: 2 + quick]:
        Path("in.csv").write_bytes(WAYS[way](plain(command)))
        outcome = run(*COMMANDS[command].split())
        assert outcome.status == 0, (way, outcome.err)
        [out] = [p for p in Path().glob("*.csv") if p.name != "in.csv"]
        results[way] = out.read_bytes()
    assert len({*results.values()}) == 1 and len(results["plain"]) > 1000
    text = read_table(out)
    write_table("in.parquet", read_table("in.csv").columns)
    assert run(*COMMANDS[command].replace(".csv", ".parquet").split()).status == 0
    table = read_table("out.parquet" if quick else out).columns
    assert list(table) == list(text.columns)
    for name, column in table.items():
        np.testing.assert_array_equal(column, text.columns[name])


def test_units_in_the_header_and_columns_that_are_not_used(run: Any) -> None:
    columns = {"Time [ms]": 1e3 * TIMES, "X (mm)": np.sin(3 * TIMES), "Y_mm": 0 * TIMES}
    columns |= {"alpha": 0 * TIMES, "BETA [deg]": TIMES, "marker": TIMES}
    write_table("in.csv", columns)
    outcome = run("run", "--motion", "in.csv", "--out", "a")
    assert outcome.status == 0 and 'in.csv: column "marker" is not used' in outcome.err
    si = {"t": TIMES, "X": 1e-3 * np.sin(3 * TIMES), "Y": 0 * TIMES}
    write_table("in.csv", si | {"alpha": 0 * TIMES, "beta": np.radians(TIMES)})
    assert run("run", "--motion", "in.csv", "--out", "b", "--quiet").err == ""
    a, b = (read_table(f"{folder}/masticatory.csv") for folder in "ab")
    np.testing.assert_allclose(a.require(a.columns), b.require(a.columns), rtol=1e-9, atol=1e-12)


def test_what_can_be_read_in_two_ways_is_refused(refused: Any) -> None:
    text = plain("motion")
    for given, said in (
        (text.replace(".", ","), "Decimal commas need semicolons between the columns"),
        (text.replace(",", " "), "expected commas, semicolons or tabs between the columns"),
        (european(text).replace("0,5", "0.5", 1), "as their decimal sign. Use one sign"),
    ):
        Path("in.csv").write_text(given)
        refused(*COMMANDS["motion"].split(), said=said)
