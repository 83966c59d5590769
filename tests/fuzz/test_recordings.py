"""Broken TRC, tables and OpenSim's storage files: finite motions, or one line for a terminal."""

from __future__ import annotations

import random
import re
import resource
import warnings
from pathlib import Path

import numpy as np
from markers.test_recorded_tables import write_csv, write_mot, write_trc
from support.recorded_jaw import record

import condyle
from condyle.errors import CondyleError
from condyle.markers import motion_of, read_markers
from condyle.markers.recorded_tables import read_recording
from fuzz.mutations import said_in_words

QUARTER_GIB_KB = 1 << 18  # ru_maxrss counts in KB
HEAD = 700  # characters, where the names are
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


def test_broken_recordings(tmp_path: Path, fuzz_seeds: range) -> None:
    jaw = record(seconds=0.8, rate=50.0, noise=1e-4, unit=1.0)
    jaw.at("Lower_FL")[30:32] = np.nan
    machine = condyle.load_mechanism("masticatory")
    writers = {"a.trc": write_trc, "a.csv": write_csv}
    wholes = {name: write(jaw, tmp_path / name).read_text() for name, write in writers.items()}
    wholes["b.csv"] = write_csv(jaw, tmp_path / "b.csv", " [mm]", 1e3).read_text()
    wholes["c.csv"] = wholes["a.csv"].replace(",", ";").replace(".", ",")
    mot = write_mot(tmp_path / "a.mot", end=1.0).read_text()
    channels = {"a.mot": mot, "b.sto": mot, "d.csv": mot.split("\n", 4)[-1].replace("\t", ",")}
    forces = {"channels": ["Fx", "Fy", "Fz"]}
    read = moved = 0
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for seed in fuzz_seeds:
        rng = random.Random(seed)
        name, other = rng.choice([*wholes]), rng.choice([None, *channels])
        for one, text in ((name, wholes[name]), (other, channels.get(other or "", ""))):
            if one is not None:
                data = broken(rng, text) if rng.random() < 0.6 else text.encode()
                (tmp_path / one).write_bytes(data)
        tables = jaw.tables(**({"forces": forces} if other else {}))
        if name in ("a.trc", "b.csv"):
            tables["register"] = {n: [1e3 * x for x in p] for n, p in jaw.register.items()}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                found = read_recording(tmp_path / name, channels=other and tmp_path / other)
                read += 1
                assert np.isfinite(found.t).all() and len(found.t) == len(found.points), seed
                assert not np.isinf(found.points).any(), seed
                assert all(w.isprintable() for w in found.warnings), seed
                if seed % 4:  # a motion takes twenty times as long
                    continue
                got = motion_of(found, read_markers(tables), machine)
        except CondyleError as error:
            said_in_words(error, seed)
        else:
            moved += 1
            assert np.isfinite(got.motion.acceleration).all(), seed
            assert got.load is None or np.isfinite(got.load.wrench).all(), seed
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < QUARTER_GIB_KB
    assert 0.2 * len(fuzz_seeds) < read and 0.03 * len(fuzz_seeds) < moved
