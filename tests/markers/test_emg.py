"""EMG: envelopes of signals whose envelope is known, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.recorded_jaw import Jaw, c3d_bytes, record

from condyle.errors import InputError
from condyle.markers import motion_from_c3d
from condyle.motion.table_writer import write_table

LEFT, RIGHT = "superficial_masseter_left", "superficial_masseter_right"
FIRST = {"channels": {LEFT: "EMG0"}}


def envelopes(folder: Path, jaw: Jaw, emg: Any, *signals: np.ndarray) -> dict[str, np.ndarray]:
    """Of signals that are recorded with the jaw, at the rate that their lengths say."""
    analog = np.column_stack(signals).reshape(len(jaw.t), -1, len(signals))
    channels = [(f"EMG{i}", "V") for i in range(len(signals))]
    path = jaw.write(folder / "a.c3d", channels=channels, analog=analog)
    return motion_from_c3d(path, jaw.tables(emg=emg), "human-jaw").channels.emg


def burst(t: np.ndarray) -> np.ndarray:
    """An amplitude that the low pass lets through: 1 Hz."""
    return 0.5 - 0.4 * np.cos(2 * np.pi * t)


@pytest.mark.slow
def test_an_envelope_is_the_amplitude_over_its_greatest(tmp_path: Path) -> None:
    jaw = record(mechanism="human-jaw", seconds=3.0)
    t = np.arange(len(jaw.t) * 10) / 1000
    carrier = np.sin(2 * np.pi * 130.7 * t)
    low = 2 * np.sin(2 * np.pi * 0.8 * t)  # a cable that moved, and an offset that no muscle made
    table = {"channels": {LEFT: "EMG0", RIGHT: "emg0"}, "greatest": {RIGHT: 2.0}}
    got = envelopes(tmp_path, jaw, table, burst(t) * carrier + low + 3.0, carrier)
    inside = slice(30, -30)  # away from the filters' ends
    # The low pass, twice of second order, takes (f / 6 Hz)^4 off 1 Hz: 8e-4.
    want = burst(jaw.t)[inside]
    np.testing.assert_allclose(got[LEFT][inside], want / 0.9, atol=0.02)
    # |sin| is 2 / pi on the mean.
    np.testing.assert_allclose(got[RIGHT][inside], want * (2 / np.pi) / 2.0, atol=0.01)
    assert got[LEFT].max() == pytest.approx(1.0, abs=0.02)
    # An envelope that is made already, at the rate of the markers: no high pass.
    made = FIRST | {"high_pass": 0.0, "low_pass": 20.0}
    got = envelopes(tmp_path, jaw, made, 7 * burst(jaw.t))
    np.testing.assert_allclose(got[LEFT][20:-20], burst(jaw.t)[20:-20] / 0.9, atol=5e-3)


def test_a_maximal_contraction_is_1(tmp_path: Path) -> None:
    """Of a file without markers, or a table; more than it is a warning."""
    jaw = record(mechanism="human-jaw", seconds=1.5)
    carrier = np.sin(2 * np.pi * 130.7 * np.arange(1500) / 1000)
    pulled = np.column_stack([4 * carrier, carrier / 2]).reshape(150, 10, 2)
    channels = [("EMG0", "V"), ("EMG1", "V")]
    none = np.empty((150, 0, 3))
    (tmp_path / "mvc.c3d").write_bytes(c3d_bytes([], none, channels=channels, analog=pulled))
    write_table(tmp_path / "weak.csv", {"t": np.arange(1500) / 1000, "EMG0": 2 * carrier})
    mvc = [str(tmp_path / name) for name in ("weak.csv", "mvc.c3d")]
    channels_of = {LEFT: "EMG0", RIGHT: "EMG1"}
    path = jaw.write(
        *(tmp_path / "a.c3d",),
        channels=channels,
        analog=np.stack([carrier] * 2, 1).reshape(150, 10, 2),
    )
    got = motion_from_c3d(path, jaw.tables(emg={"channels": channels_of, "mvc": mvc}), "human-jaw")
    middle = slice(40, 110)
    np.testing.assert_allclose(got.channels.emg[LEFT][middle], 0.25, rtol=0.02)
    np.testing.assert_allclose(got.channels.emg[RIGHT][middle], 2.0, rtol=0.02)
    (said,) = [text for text in got.warnings if "greatest" in text]
    assert RIGHT in said and LEFT not in said
    for wrong, text in (("nothing.c3d", "nothing.c3d"), (mvc[0], 'no channel "EMG1"')):
        tables = jaw.tables(emg={"channels": channels_of, "mvc": wrong})
        with pytest.raises(InputError, match=text):
            motion_from_c3d(path, tables, "human-jaw")


WRONG: list[tuple[Any, str]] = [
    ({"channels": {"masseter": "EMG0"}}, 'emg: "human-jaw" has no chain "masseter"'),
    ({"channels": {LEFT: "EMG7"}}, 'emg: has no channel "EMG7".*Available: EMG0, EMG1'),
    (FIRST | {"high_pass": 500.0}, "sampled at 1000 Hz, and high"),
    (FIRST | {"low_pass": 700.0}, "low_pass is 700 Hz; expected less"),
    (FIRST | {"low_pass": 0.5}, "lasts 0.8 s, too short for low_pass"),
    ({"channels": {LEFT: "EMG1"}}, r'"EMG1" \(superficial_masseter_left\) is constant'),
    ({"channels": {LEFT: "EMG2"}}, '"EMG2" has samples that are no numbers'),
    (FIRST | {"greatest": {RIGHT: 1.0}}, "has no channel in"),
    (FIRST | {"greatest": {LEFT: 0.0}}, "greatest"),
    (FIRST | {"high_pass": -1.0}, "high_pass"),
    (FIRST | {"low_pass": 0.0}, "low_pass"),
    *(({"channels": wrong}, "channels") for wrong in ({LEFT: 3}, {}, ["EMG0"])),
    ({}, "channels"),
    ({LEFT: "EMG0"}, "channels|superficial_masseter_left"),
]


def test_what_cannot_be(tmp_path: Path) -> None:
    jaw = record(seconds=0.8, mechanism="human-jaw")
    noise = np.random.default_rng(0).normal(0, 1, len(jaw.t) * 10)
    for emg, said in WRONG:
        with pytest.raises(InputError, match=said) as caught:
            envelopes(tmp_path, jaw, emg, noise, np.ones_like(noise), np.full_like(noise, np.nan))
        assert len(str(caught.value).splitlines()) <= 3
