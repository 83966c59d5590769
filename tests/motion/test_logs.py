"""Logs as MCAP and CSV: the same numbers, what a killed process leaves, and strangers' files."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machine_log import write_log as write_own
from support.machines import model

import condyle
from condyle.errors import CondyleError, InputError
from condyle.identification.log import read_log
from condyle.motion import log_writer, read_table

writers = pytest.importorskip("mcap.writer")

KILLED = """
import os, signal, sys, time
import condyle
log = condyle.LogWriter(sys.argv[1], ["t", "x"])
start = last = time.monotonic()
stall = 0.0  # the longest time that this process was not let run
while last < start + 1.7:
    time.sleep(0.002)
    now = time.monotonic()
    stall, last = max(stall, now - last), now
    log.write([now - start, 1 / (1 + now)])
print(last - start, stall, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def made(messages: list[Any], topic: str = "/a", encoding: str = "json", **how: Any) -> bytes:
    """A file that another program could have written: a message every millisecond from 5 s on."""
    file = BytesIO()
    writer = writers.Writer(file, **how)
    writer.start()
    for name in topic.split():
        channel = writer.register_channel(name, encoding, 0)
        for k, message in enumerate(messages):
            data = message if isinstance(message, bytes) else json.dumps(message).encode()
            writer.add_message(channel, 5_000_000_000 + 1_000_000 * k, data, 0)
    writer.finish()
    return file.getvalue()


def chunks_of(path: Path, sizes: list[int]) -> tuple[list[str], np.ndarray]:
    """A log in chunks of so many rows."""
    rows = np.random.default_rng(1).normal(size=(sum(sizes), 3))
    rows[:, 0] = np.arange(len(rows)) / 7 - 1.0  # from before zero
    names = ["t", 'joint_"left"', "tau_ä"]
    with open(path, "wb") as file:
        log = log_writer.McapRows(file, names)
        for size, end in zip(sizes, np.cumsum(sizes), strict=True):
            for row in rows[end - size : end].tolist():
                log.write(row)
            log.flush()
        log.finish()
    return names, rows


@pytest.mark.slow
def test_a_simulation_s_log_is_the_same_in_csv_and_mcap(tmp_path: Path) -> None:
    """For `identify`, and for the reader of MCAP itself."""
    from mcap.reader import make_reader

    own = model("masticatory")
    run = own.solve(condyle.trial_motion(own.mechanism, rate=250.0))
    for file in ("a.csv", "a.mcap"):
        condyle.write_log(run, tmp_path / file, encoder_noise=1e-5)
    csv, mcap = (read_table(tmp_path / file) for file in ("a.csv", "a.mcap"))
    assert list(csv.columns) == list(mcap.columns) and not mcap.notes
    assert all(np.array_equal(csv.columns[name], mcap.columns[name]) for name in csv.columns)
    logs = [read_log(own, tmp_path / file, 10.0) for file in ("a.csv", "a.mcap")]
    assert np.array_equal(logs[0].q, logs[1].q) and np.array_equal(logs[0].effort, logs[1].effort)
    with open(tmp_path / "a.mcap", "rb") as file:
        found = list(make_reader(file, validate_crcs=True).iter_messages())
    assert len(found) == csv.rows
    for k, (schema, channel, message) in enumerate(found):
        assert schema is not None and (channel.topic, channel.message_encoding) == ("/log", "json")
        properties = json.loads(schema.data)["properties"]
        assert properties == {name: {"type": "number"} for name in csv.columns}
        row = json.loads(message.data)
        assert row == {name: column[k] for name, column in csv.columns.items()}
        assert abs(message.log_time * 1e-9 - row["t"]) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", ["log.csv", "log.mcap"])
def test_a_process_that_is_killed_loses_a_second_at_most(tmp_path: Path, name: str) -> None:
    call = [sys.executable, "-c", KILLED, str(tmp_path / name)]
    done = subprocess.run(call, capture_output=True, text=True, timeout=120)
    assert done.returncode == -signal.SIGKILL, done.stderr
    end, stall = map(float, done.stdout.split())
    if name.endswith(".csv"):  # whose last row may be cut
        rows = (tmp_path / name).read_bytes().rpartition(b"\n")[0]
        (tmp_path / name).write_bytes(rows)
    found = read_table(tmp_path / name)
    assert found.columns["t"][0] < 0.1 + stall and np.diff(found.columns["t"]).max() <= stall
    assert end - found.columns["t"][-1] < 1.0 + stall
    assert bool(found.notes) == name.endswith(".mcap")


@pytest.mark.slow
def test_a_file_that_ends_early_is_read_up_to_its_last_chunk(tmp_path: Path) -> None:
    sizes, path = [5, 40, 1, 30], tmp_path / "a.mcap"
    names, rows = chunks_of(path, sizes)
    whole = path.read_bytes()
    assert np.array_equal(read_table(path).require(names), rows)
    seen = set()
    for cut in range(0, len(whole), 7):
        path.write_bytes(whole[:cut])
        try:
            found = read_table(path)
        except InputError as error:
            assert not seen and ("no MCAP file" in str(error) or "no messages" in str(error))
            continue
        assert np.array_equal(found.require(names), rows[: found.rows])
        assert found.rows == len(rows) or "last complete chunk" in found.notes[0]
        seen.add(found.rows)
    assert seen == set(np.cumsum(sizes))
    own = model("masticatory")
    columns = read_table(write_own(tmp_path / "own.csv")).columns
    with condyle.LogWriter(tmp_path / "own.mcap", list(columns)) as log:
        for row in np.column_stack(list(columns.values())):
            log.write(row)
        log._rows.flush()
        (tmp_path / "cut.mcap").write_bytes((tmp_path / "own.mcap").read_bytes())
    assert not read_log(own, tmp_path / "own.mcap", 5.0).notes
    assert "cut.mcap: has no end" in read_log(own, tmp_path / "cut.mcap", 5.0).notes[0]


def test_logs_of_other_programs(tmp_path: Path) -> None:
    """Numbers of flat messages; the time is the message's where no column is."""
    path, messages = tmp_path / "a.mcap", [{"x": k / 3, "s": "a", "deep": [k]} for k in range(9)]
    kinds = writers.CompressionType
    for how in (*({"compression": kind} for kind in kinds), {"use_chunking": False}):
        path.write_bytes(made(messages, **how))
        found = read_table(path)
        assert list(found.columns) == ["x", "t"]
        assert np.array_equal(found.columns["x"], np.arange(9) / 3)
        assert np.allclose(found.columns["t"], np.arange(9) * 1e-3, rtol=0, atol=1e-9)
    path.write_bytes(made([{"time [ms]": 1, "x": 2}, {"time [ms]": 3.5, "x": None}]))
    known = {"t": ("time", 0), "x": ("length", 1)}
    found = read_table(path, known=known, gaps=True)
    assert found.columns["t"].tolist() == [1e-3, 3.5e-3] and np.isnan(found.columns["x"][1])


def test_files_that_would_harm_are_refused(tmp_path: Path) -> None:
    path, row = tmp_path / "a.mcap", {"t": 0.0, "x": 1.0}
    lz4, plain = (writers.CompressionType[name] for name in ("LZ4", "NONE"))
    bomb, many = b'{"t":' + b" " * (1 << 26), [row] * 3
    flipped = bytearray(made(many, compression=plain))
    flipped[flipped.index(b'"x": 1') + 5] ^= 1
    endless = bytearray(made(many, use_chunking=False))
    at = endless.index(b"\x05", 30)  # a message: its length becomes larger than the file
    endless[at + 1 : at + 9] = b"\xff" * 8
    for data, words in (
        (b"t,x\n0,1\n", "is no MCAP file"),
        (made([]), "no messages in JSON"),
        (made(many, encoding="cdr"), r"no messages in JSON; it has /a \(cdr\)"),
        (made(many, topic="/a /b"), 'JSON of the topics "/a", "/b"'),
        (made([bomb]), "limit CHUNK"),
        (made([bomb], compression=lz4), "limit CHUNK"),
        (made([bomb], use_chunking=False), "limit CHUNK"),
        (made([b'{"t": ' + b" " * (1 << 21) + b"0}"]), "message 1: 2097160 bytes.*limit MESSAGE"),
        (made([row, b'{"t": 1, "x": ' + b"[" * 100_000]), "message 2: is no JSON"),
        (made([row, [0, 1]]), "message 2: expected an object"),
        (made([row, {"t": 1.0}]), 'message 2, column "x": is left out'),
        (made([row, {"t": 1, "x": True}]), "got True, expected a number"),
        (made([row, {"t": 1, "x": 10**400}]), "too large"),
        (made([row, b'{"t": 1, "x": NaN}']), "expected a finite number"),
        (bytes(flipped), "checksum"),
        (bytes(endless), "no messages in JSON"),
    ):
        path.write_bytes(data)
        with pytest.raises(InputError, match=words):
            read_table(path)


def test_broken_logs_are_finite_numbers_or_refused(tmp_path: Path) -> None:
    path, read = tmp_path / "a.mcap", 0
    chunks_of(path, [5, 5])
    whole = path.read_bytes()
    for seed in range(150):
        rng, data = random.Random(seed), bytearray(whole)
        for _ in range(rng.randrange(1, 4)):
            data[rng.randrange(len(data) // 2)] = rng.randrange(256)
        path.write_bytes(bytes(data))
        try:
            found = read_table(path)
        except CondyleError as error:
            assert str(error).isprintable()
            continue
        assert all(np.isfinite(column).all() for column in found.columns.values())
        read += 1
    assert 0 < read < 150


@pytest.mark.parametrize("name", ["log.csv", "log.mcap"])
def test_a_row_that_is_none_is_refused_and_the_rest_stays(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    for names, words in ((["x"], "expected t"), (["t", "t"], "more than once"), (["t", ""], "t")):
        with pytest.raises(InputError, match=words):
            condyle.LogWriter(path, names)
    with pytest.raises(InputError, match=r"\.csv or \.mcap"):
        condyle.LogWriter(tmp_path / "log.txt", ["t"])
    assert not list(tmp_path.iterdir())
    with condyle.LogWriter(path, ["t", "x"]) as log:
        log.write([0.5, np.float32(0.25)])
        for row, words in (
            ([1.0], "expected 2 numbers"),
            (["a", 1.0], "expected 2 numbers"),
            (3.0, "expected 2 numbers"),
            ([0.5, 1.0], "rising times"),
            ([np.nan, 1.0], "rising times"),
        ):
            with pytest.raises(InputError, match=words):
                log.write(row)  # type: ignore[arg-type]
        log.write([1.0, np.nan])
    with pytest.raises(InputError, match="closed"):
        log.write([2.0, 0.0])
    log.close()
    found = read_table(path, gaps=True)
    assert found.columns["t"].tolist() == [0.5, 1.0]
    assert np.array_equal(found.columns["x"], [0.25, np.nan], equal_nan=True)
