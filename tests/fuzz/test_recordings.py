"""Broken C3D, TRC, tables and storage files: finite motions, or one line for a terminal."""

from __future__ import annotations

import random
import re
import resource
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from markers.test_recorded_tables import write_csv, write_mot, write_trc
from support.recorded_jaw import Jaw, record

import condyle
from condyle.markers import MarkerFile, motions_of
from condyle.markers.recorded_tables import read_recording

from .mutations import tried

pytestmark = pytest.mark.slow

QUARTER_GIB_KB = 1 << 18  # ru_maxrss counts in KB
HEAD, C3D_HEAD = 700, 3 * 512  # where names are, and single bytes matter
WORDS = (
    "\t ; , \n \r \x0b \u2028 \0 \x1b[31m \u202e . - e 1e308 -1e308 1e-308 1e999 nan inf 0x1 1_0 "
    "\u0662 9e9 Units mm furlong NumFrames Frame# Time t endheader "
    "_x [mm] [x] Lower_FL PathFileType"
)
LONG = "9" * 400, "\t" * 3000, "\n" * 3000
BITS = (*WORDS.split(" "), " ", "", "\n\n", "\t\t\t", "\ud800", *LONG)


def broken(rng: random.Random, text: str) -> bytes:
    """The text of a file after a few accidents to words, separators and bytes."""
    if rng.random() < 0.3:
        old, new = rng.choice("\t,.;\n"), rng.choice(("\t", ",", ".", ";", " ", ""))
        text = text.replace(old, new)
    if rng.random() < 0.3:  # one cell, often a row's first, where times are
        lines = text.split("\n")
        row = rng.randrange(len(lines))
        cells = re.split(r"([\t,;])", lines[row])
        cells[rng.choice((0, 2 * (len(cells) > 2), 2 * rng.randrange(len(cells) // 2 + 1)))] = (
            rng.choice(("", "nan", rng.choice(BITS)))
        )
        text = "\n".join([*lines[:row], "".join(cells), *lines[row + 1 :]])
    if rng.random() < 0.2:
        text = text[: rng.randrange(len(text) + 1)]
    for _ in range(rng.choice((0, 0, 1, 1, 2, 5))):
        at = rng.randrange(rng.choice((HEAD, len(text) + 1, len(text) + 1)))
        new = rng.choice((*BITS, text[rng.randrange(len(text) + 1) :][:30]))
        text = text[:at] + new * rng.choice((1, 1, 1, 30)) + text[at + rng.choice((0, 1, 5, 60)) :]
    data = bytearray(text.encode("utf-8", "surrogatepass"))
    for _ in range(rng.choice((0, 0, 0, 0, 3))):
        data[rng.randrange(len(data) + 1) :][:1] = rng.randbytes(1)
        data.insert(rng.randrange(len(data) + 1), rng.randrange(256))
    return bytes(data)


def broken_c3d(rng: random.Random, whole: bytes) -> bytes:
    data = bytearray(whole)
    if rng.random() < 0.3:
        del data[rng.randrange(len(data)) :]
    for _ in range(rng.choice((0, 1, 1, 2, 5, 40))):
        if data:
            reach = rng.choice((24, C3D_HEAD, C3D_HEAD, len(data)))
            at, size = rng.randrange(min(reach, len(data))), rng.choice((1, 1, 1, 2, 4, 30))
            new = rng.choice((b"\x00", b"\xff", b"\x7f", rng.randbytes(1)))
            data[at : at + size] = new * rng.choice((size, size, size, 0, 200))
    return bytes(data)


def finite(path: Path, tables: dict[str, Any], machine: condyle.Mechanism, **how: Any) -> None:
    """Read a recording; of some make a motion, which takes twenty times as long."""
    whole = how.pop("whole")
    found = read_recording(path, **how)
    assert np.isfinite(found.t).all() and len(found.t) == len(found.points)
    assert not np.isinf(found.points).any() and all(w.isprintable() for w in found.warnings)
    if whole:
        got = motions_of(found, MarkerFile.read(tables), machine)[0]
        assert np.isfinite(got.motion.acceleration).all()
        assert got.load is None or np.isfinite(got.load.wrench).all()
        assert all(np.isfinite(one).all() for one in got.channels.emg.values())
        assert all(w.isprintable() for w in got.warnings)


@pytest.fixture(autouse=True)
def little_memory() -> Any:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < QUARTER_GIB_KB


def test_broken_texts(tmp_path: Path, few_seeds: range) -> None:
    jaw, machine = record(seconds=0.8, rate=50.0, noise=1e-4, unit=1.0), "masticatory"
    jaw.at("Lower_FL")[30:32] = np.nan
    writers = {"a.trc": write_trc, "a.csv": write_csv}
    wholes = {name: write(jaw, tmp_path / name).read_text() for name, write in writers.items()}
    wholes["b.csv"] = write_csv(jaw, tmp_path / "b.csv", " [mm]", 1e3).read_text()
    wholes["c.csv"] = wholes["a.csv"].replace(",", ";").replace(".", ",")
    mot = write_mot(tmp_path / "a.mot", end=1.0).read_text()
    channels = {"a.mot": mot, "b.sto": mot, "d.csv": mot.split("\n", 4)[-1].replace("\t", ",")}

    def attempt(rng: random.Random) -> None:
        name, other = rng.choice([*wholes]), rng.choice([None, *channels])
        for one, text in ((name, wholes[name]), (other, channels.get(other or "", ""))):
            if one is not None:
                data = broken(rng, text) if rng.random() < 0.6 else text.encode()
                (tmp_path / one).write_bytes(data)
        tables = jaw.tables(**({"forces": {"channels": ["Fx", "Fy", "Fz"]}} if other else {}))
        if name in ("a.trc", "b.csv"):
            tables["register"] = {n: [1e3 * x for x in p] for n, p in jaw.register.items()}
        how = {"channels": other and tmp_path / other, "whole": rng.random() < 0.25}
        finite(tmp_path / name, tables, condyle.load_mechanism(machine), **how)

    assert tried(few_seeds, attempt)


def with_plate_and_muscle(path: Path) -> tuple[Jaw, bytes]:
    """A recording in which is all that is read of a C3D file."""
    jaw = record(seconds=0.8, rate=50.0, noise=1e-4, mechanism="human-jaw")
    analog = np.random.default_rng(0).normal(0, 1, (len(jaw.t), 2, 7))
    corners = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]]) * 200.0
    plates = {
        "USED": np.int16(1),
        "TYPE": np.array([2], np.int16),
        "CORNERS": corners.T[:, :, None].astype(np.float32),
        "ORIGIN": np.array([[0, 0, -40.0]], np.float32).T,
        "CHANNEL": np.arange(1, 7, dtype=np.int16)[:, None],
    }
    channels = [(f"F{i}", unit) for i, unit in enumerate(["N"] * 3 + ["Nmm"] * 3 + ["V"])]
    return jaw, jaw.write(
        path, rate=50.0, analog=analog, channels=channels, plates=plates
    ).read_bytes()


def test_broken_c3d_files(tmp_path: Path, few_seeds: range) -> None:
    path, machine = tmp_path / "a.c3d", condyle.load_mechanism("human-jaw")
    jaw, whole = with_plate_and_muscle(path)
    emg = {"channels": {"deep_masseter_left": "F6"}}
    tables = jaw.tables(forces={"plate": 1}, emg=emg)
    finite(path, tables, machine, whole=True)

    def attempt(rng: random.Random) -> None:
        path.write_bytes(broken_c3d(rng, whole))
        finite(path, tables, machine, whole=rng.random() < 0.25)

    tried(few_seeds, attempt)
