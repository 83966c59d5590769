"""Broken recordings: each gives a motion of finite numbers, or one message fit for a terminal."""

from __future__ import annotations

import random
import warnings
from pathlib import Path

import numpy as np
from support.recorded_jaw import record

import condyle
from condyle.errors import CondyleError
from condyle.markers import motion_from_c3d

HEAD = 3 * 512  # header and parameters, where single bytes matter


def broken(rng: random.Random, whole: bytes) -> bytes:
    data = bytearray(whole)
    if rng.random() < 0.3:
        del data[rng.randrange(len(data)) :]
    for _ in range(rng.choice((0, 1, 1, 2, 5, 40))):
        if data:
            reach = rng.choice((24, HEAD, HEAD, len(data)))
            at, size = rng.randrange(min(reach, len(data))), rng.choice((1, 1, 1, 2, 4, 30))
            new = rng.choice((b"\x00", b"\xff", b"\x7f", rng.randbytes(1)))
            data[at : at + size] = new * rng.choice((size, size, size, 0, 200))
    return bytes(data)


def test_a_broken_recording(tmp_path: Path, fuzz_seeds: range) -> None:
    """With a force plate and a muscle, so that all that is read of a file is in it."""
    jaw = record(seconds=1.2, noise=1e-4, mechanism="human-jaw")
    analog = np.random.default_rng(0).normal(0, 1, (len(jaw.t), 2, 7))
    corners = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]]) * 200.0
    plates = {
        "USED": np.int16(1),
        "TYPE": np.array([2], np.int16),
        "CORNERS": corners.T[:, :, None].astype(np.float32),
        "ORIGIN": np.array([[0, 0, -40.0]], np.float32).T,
        "CHANNEL": np.arange(1, 7, dtype=np.int16)[:, None],
    }
    units = ["N"] * 3 + ["Nmm"] * 3 + ["V"]
    channels = [(f"F{i}", unit) for i, unit in enumerate(units)]
    path = jaw.write(tmp_path / "a.c3d", analog=analog, channels=channels, plates=plates)
    emg = {"channels": {"deep_masseter_left": "F6"}}
    whole, tables, read = path.read_bytes(), jaw.tables(forces={"plate": 1}, emg=emg), 0
    machine = condyle.load_mechanism("human-jaw")
    for seed in fuzz_seeds:
        path.write_bytes(broken(random.Random(seed), whole))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                got = motion_from_c3d(path, tables, machine)
        except CondyleError as error:
            message = str(error)
            assert len(message) < 4000 and message.isprintable(), (seed, message)
        else:
            read += 1
            assert np.isfinite(got.motion.acceleration).all(), seed
            assert got.load is not None and np.isfinite(got.load.wrench).all(), seed
            assert all(np.isfinite(one).all() for one in got.channels.emg.values()), seed
            assert all(w.isprintable() for w in got.warnings), seed
    assert 0.02 * len(fuzz_seeds) < read < 0.9 * len(fuzz_seeds)
