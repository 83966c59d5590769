"""Tables as spreadsheets write them, through every command that reads one: the same numbers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.motion import read_table, write_table

NAMES = ("X", "Y", "alpha", "beta")
TIMES = np.linspace(0, 1, 21)
COMMANDS = {
    "solve": ("solve", "masticatory", "--states", "in.csv", "--out", "out.csv"),
    "pose": ("pose", "masticatory", "--joints", "in.csv", "--out", "out.csv"),
    "motion": ("run", "--motion", "in.csv", "--out", "."),
    "load": ("run", "--load", "in.csv", "--rate", "20", "--out", "."),
}


def plain(command: str) -> str:
    """A table for the command, with points and commas."""
    if command == "solve":
        columns = {p + name: 0.001 * (TIMES + 0.5) for p in ("", "d", "dd") for name in NAMES}
    elif command == "pose":
        columns = {
            f"joint_{n}": 0.01 * TIMES for n in condyle.load_mechanism("masticatory").chain_names
        }
        columns = dict.fromkeys(columns, 0 * TIMES) | {"t": TIMES}
    elif command == "motion":
        columns = {"t": TIMES} | {name: 0.001 * np.sin(3 * TIMES) for name in NAMES}
    else:
        columns = {"t": 5 * TIMES} | {name: -2.5 * TIMES for name in ("Fx", "Fy", "Fz")}
    lines = [
        ",".join(columns),
        *(",".join(map(repr, r)) for r in np.transpose([*columns.values()]).tolist()),
    ]
    return "\n".join(lines) + "\n"


def european(text: str) -> str:
    return text.replace(",", ";").replace(".", ",")


def quoted(text: str) -> str:
    return "".join(
        ",".join(f'"{cell}"' for cell in line.split(",")) + "\n" for line in text.splitlines()
    )


WAYS: dict[str, Callable[[str], bytes]] = {
    "byte order mark and CRLF": lambda t: b"\xef\xbb\xbf" + t.replace("\n", "\r\n").encode(),
    "semicolons and decimal commas": lambda t: european(t).encode(),
    "the same with sep=": lambda t: b"sep=;\r\n" + european(t).replace("\n", "\r\n").encode(),
    "tabs, decimal commas, UTF-16": lambda t: european(t).replace(";", "\t").encode("utf-16"),
    "quotes": lambda t: quoted(t).encode(),
    "quotes and decimal commas": lambda t: quoted(t).replace(".", ",").encode(),
    "empty columns": lambda t: t.replace("\n", ",,\n").encode(),
    "empty columns, decimal commas": lambda t: european(t).replace("\n", ";;\n").encode(),
    "empty rows": lambda t: (t + ",,,,\n\n,,,,\n").encode(),
}


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_the_same_numbers(
    condyle_command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.setenv("CONDYLE_BACKEND", "numpy")
    results = {}
    for way, write in {"plain": str.encode, **WAYS}.items():
        Path("in.csv").write_bytes(write(plain(command)))
        outcome = condyle_command(*COMMANDS[command])
        assert outcome.status == 0, (way, outcome.err)
        [out] = [p for p in Path().glob("*.csv") if p.name != "in.csv"]
        results[way] = out.read_bytes()
    assert all(result == results["plain"] for result in results.values())
    assert len(results["plain"]) > 1000


@pytest.mark.parametrize("command", COMMANDS)
def test_parquet_gives_the_same_numbers(
    condyle_command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    """In and out, for every command that reads or writes a table."""
    monkeypatch.setenv("CONDYLE_BACKEND", "numpy")
    Path("in.csv").write_text(plain(command))
    write_table("in.parquet", read_table("in.csv").columns)
    tables = []
    for ending in ("csv", "parquet"):
        words = [word.replace(".csv", f".{ending}") for word in COMMANDS[command]]
        assert condyle_command(*words).status == 0
        [out] = [p for p in Path().glob("*.csv") if p.name != "in.csv"]
        if "out.parquet" in words:
            out = Path("out.parquet")
        tables.append(read_table(out).columns)
    assert list(tables[0]) == list(tables[1])
    for name, column in tables[0].items():
        np.testing.assert_array_equal(column, tables[1][name])


def test_units_in_the_header_and_columns_that_are_not_used(
    condyle_command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CONDYLE_BACKEND", "numpy")
    columns = {"Time [ms]": 1e3 * TIMES, "X (mm)": np.sin(3 * TIMES), "Y_mm": 0 * TIMES}
    columns |= {"alpha": 0 * TIMES, "BETA [deg]": TIMES, "marker": TIMES}
    write_table("in.csv", columns)
    outcome = condyle_command("run", "--motion", "in.csv", "--out", "a")
    assert outcome.status == 0 and 'in.csv: column "marker" is not used' in outcome.err
    si = {"t": TIMES, "X": 1e-3 * np.sin(3 * TIMES), "Y": 0 * TIMES}
    write_table("in.csv", si | {"alpha": 0 * TIMES, "beta": np.radians(TIMES)})
    assert condyle_command("run", "--motion", "in.csv", "--out", "b", "--quiet").err == ""
    a, b = (read_table(f"{folder}/masticatory.csv") for folder in "ab")
    np.testing.assert_allclose(a.require(a.columns), b.require(a.columns), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (lambda t: t.replace(".", ","), "Decimal commas need semicolons between the columns"),
        (lambda t: t.replace(",", " "), "expected commas, semicolons or tabs between the columns"),
        (lambda t: european(t).replace("0,5", "0.5", 1), "as their decimal sign. Use one sign"),
    ],
)
def test_what_can_be_read_in_two_ways_is_refused(
    condyle_command: Callable[..., Any], write: Callable[[str], str], message: str
) -> None:
    Path("in.csv").write_text(write(plain("motion")))
    outcome = condyle_command(*COMMANDS["motion"])
    assert outcome.status == 2 and message in outcome.err and outcome.out == ""
