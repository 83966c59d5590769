"""Broken tables: each is read as finite numbers, or refused in a message fit for a terminal."""

from __future__ import annotations

import csv
import io
import json
import random
import re
from pathlib import Path

import numpy as np
import pytest
from support.machines import model

from condyle.analysis.sweep.study_folder import open_sweep
from condyle.errors import CondyleError
from condyle.identification.log import read_log
from condyle.motion import FORCE, LANDMARK, MOMENT, POSE, iter_table, read_table, write_table

from .mutations import tried
from .test_recordings import broken

PLAIN = (
    "t,X,Y,alpha,beta\n0,0.001,-2e-3,0.1,.5\n1,0.5,0.25,-1,+0\n2,1e-5,0,0,7\n",
    "t [ms];x [mm];y [mm];z [mm];note\n0;1,5;0;-2;a\n1;2,5;1;-3;b\n2;1;1;1;\n",
    '# made by hand\n\ufeff"Time (s)","Fz"\n"0","-5"\n"0.5","-10"\n\n',
    "sep=;\r\nX;dX;ddX;Fx\r\n1,0;2,0;3,0;4,0\r\n5,0;6,0;7,0;8,0\r\n;;;\r\n",
    "\tt\tx\ty\tz\t\n\t0\t1\t2\t3\t\n\t1\t2\t3\t4\t\n",
)
WORDS = (
    ", ; \t \n \r \r\n \" ' . - + e E # \0 \x1b[31m _ nan inf 1e999 0x1 1.000,5 NaN #N/A sep=; "
    "[mm] (s) /s^2 [ Fx t x X dX ddX \u00b5 \u0662 \ufeff \u00a0"
)
BITS = (*WORDS.split(" "), " ", "", ",,,", "9" * 400, "\n\n", "\ud800")
KNOWN = ("t", *POSE, *LANDMARK, *(d + n for d in ("d", "dd") for n in POSE), *FORCE, *MOMENT)


def mutated(rng: random.Random) -> bytes:
    """One of the plain tables with a few changes to its text, and perhaps to its bytes."""
    text = rng.choice(PLAIN)
    for _ in range(rng.choice((0, 1, 1, 2, 3, 8))):
        at, size = rng.randrange(len(text) + 1), rng.choice((0, 0, 1, 3, 20))
        new = rng.choice((*BITS, text[rng.randrange(len(text) + 1) :][:30]))
        text = text[:at] + new * rng.choice((1, 1, 1, 30)) + text[at + size :]
        text = text or "t"
    coding = rng.choice(("utf-8",) * 8 + ("utf-16", "utf-16-le", "latin-1"))
    data = bytearray(text.encode(coding, "surrogatepass" if coding[:3] == "utf" else "replace"))
    for _ in range(rng.choice((0, 0, 0, 1, 4))):
        data[rng.randrange(len(data)) :][:1] = bytes([rng.randrange(256)])
        data.insert(rng.randrange(len(data) + 1), rng.randrange(256))
    return bytes(data)


def test_a_broken_table(tmp_path: Path, fuzz_seeds: range) -> None:
    path = tmp_path / "in.csv"

    def attempt(rng: random.Random) -> None:
        path.write_bytes(mutated(rng))
        known = rng.choice((None, KNOWN))
        tables = list(iter_table(path, rng.choice((1, 2, 16384)), known=known))
        for table in tables:
            assert table.rows and all(len(c) == table.rows for c in table.columns.values())
            assert all(np.isfinite(c).all() for c in table.columns.values())
            assert all(warning.isprintable() for warning in table.warnings)
            assert known is None or set(table.columns) <= set(known)
        assert (np.diff(np.concatenate([table.lines for table in tables])) > 0).all()

    assert tried(fuzz_seeds, attempt) > len(fuzz_seeds) / 20


def test_plain_tables_are_what_another_reader_gets(tmp_path: Path, few_seeds: range) -> None:
    """Python's own reader of CSV."""
    forms = ("{!r}", "{:.3f}", " {:.17g} ", "{:+.4e}", '"{:.6g}"', "{:.0f}")
    path = tmp_path / "plain.csv"
    for seed in few_seeds:
        rng = random.Random(seed)
        width, rows = rng.randrange(1, 6), rng.randrange(1, 30)
        lines = [",".join(f"c{i}" for i in range(width))]
        for _ in range(rows):
            values = [rng.uniform(-1, 1) * 10 ** rng.uniform(-30, 30) for _ in range(width)]
            lines.append(",".join(rng.choice(forms).format(value) for value in values))
        path.write_text(text := "\n".join(lines) + "\n")
        chunks = list(iter_table(path, rng.choice((1, 5, 16384))))
        got = np.vstack([np.column_stack(list(chunk.columns.values())) for chunk in chunks])
        wanted = [[float(cell) for cell in row] for row in [*csv.reader(io.StringIO(text))][1:]]
        np.testing.assert_array_equal(got, wanted)


def test_a_broken_parquet_file(tmp_path: Path, few_seeds: range) -> None:
    path = tmp_path / "in.PARQUET"
    write_table(path, {"t": np.arange(50.0), "x": np.arange(50) / 7, "label": ["a"] * 50})
    whole = path.read_bytes()

    def attempt(rng: random.Random) -> None:
        data = bytearray(whole)
        for _ in range(rng.randrange(1, 5)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        path.write_bytes(bytes(data[: rng.choice((len(data), rng.randrange(len(data))))]))
        table = read_table(path, known=("t", "x"))
        assert all(np.isfinite(column).all() for column in table.columns.values())

    tried(few_seeds, attempt, quiet=True)


def test_messages_never_carry_a_terminal_s_orders(tmp_path: Path) -> None:
    path = tmp_path / "in.csv"
    path.write_bytes(b"t,x\n" + b"0,1\n" * 40000 + "0,\u202e\x1b]0;title\x07\n".encode())
    with pytest.raises(CondyleError) as caught:
        read_table(path)
    assert re.search(r'got "\\u202e\\x1b\]0;title\\x07"', str(caught.value))


def test_a_broken_log(tmp_path: Path, few_seeds: range) -> None:
    machine, path, t = model("masticatory"), tmp_path / "log.csv", np.arange(150) / 50
    names = [*machine.independent, *(f"tau_{name}" for name in machine.mechanism.chain_names)]
    moved = {name: 1e-3 * np.sin(5 * t + i) for i, name in enumerate(names)}
    write_table(path, {"t": t} | moved)
    read_log(machine, path, 5.0)
    text = path.read_text()

    def attempt(rng: random.Random) -> None:
        path.write_bytes(broken(rng, text))
        found = read_log(machine, path, 5.0)
        assert all(np.isfinite(a).all() for a in (found.t, found.q, found.a, found.effort))

    tried(few_seeds, attempt)


def test_a_broken_folder_of_a_sweep(tmp_path: Path, few_seeds: range) -> None:
    rows, study = tmp_path / "rows" / "all.parquet", tmp_path / "study.json"
    rows.parent.mkdir()
    said = {"condyle": "1", "study": {}, "rows": 50, "parameters": ["x"], "measures": ["y"]}
    said |= {"part": 4, "motions": ["1"]}
    study.write_text(json.dumps(said | {"units": {"y": "N"}, "better": {}}))
    texts = {"status": ["ok"] * 50, "reason": ["", "slack"] * 25}
    write_table(rows, {"variant": np.arange(50), "x": np.ones(50), "y": np.arange(50.0)} | texts)
    wholes = {path: path.read_bytes() for path in (rows, study)}
    assert open_sweep(tmp_path)["reason"].values[1] == "slack"

    def attempt(rng: random.Random) -> None:
        for path, whole in wholes.items():
            data = bytearray(whole)
            for _ in range(rng.choice((0, 1, 4))):
                data[rng.randrange(len(data))] = rng.randrange(256)
            path.write_bytes(bytes(data[: rng.choice((len(data), len(data), 99))]))
        assert open_sweep(tmp_path).sizes["row"] <= 50

    tried(few_seeds, attempt, quiet=True)
