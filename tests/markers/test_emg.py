"""EMG: envelopes of signals whose envelope is known, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.recorded_jaw import Jaw, record

from condyle.errors import InputError
from condyle.markers import motion_from_c3d

SAMPLES = 10  # a frame, 1000 Hz
CHAINS = ("superficial_masseter_left", "superficial_masseter_right")


def recorded(folder: Path, jaw: Jaw, *signals: np.ndarray) -> Path:
    count = len(jaw.t)
    analog = np.column_stack(signals).reshape(count, -1, len(signals))
    channels = [(f"EMG{i}", "V") for i in range(len(signals))]
    return jaw.write(folder / "a.c3d", channels=channels, analog=analog)


def burst(t: np.ndarray) -> np.ndarray:
    """An amplitude that the low pass lets through: 1 Hz."""
    return 0.5 - 0.4 * np.cos(2 * np.pi * t)


def test_an_envelope_is_the_amplitude_over_its_greatest(tmp_path: Path) -> None:
    jaw = record(mechanism="human-jaw")
    t = np.arange(len(jaw.t) * SAMPLES) / 1000
    carrier = np.sin(2 * np.pi * 130.7 * t) + 3.0  # with an offset that no muscle made
    low = 2 * np.sin(2 * np.pi * 0.8 * t)  # and a cable that moved
    path = recorded(tmp_path, jaw, burst(t) * np.sin(2 * np.pi * 130.7 * t) + low + 3.0, carrier)
    table = {"channels": {CHAINS[0]: "EMG0", CHAINS[1]: "emg0"}, "greatest": {CHAINS[1]: 2.0}}
    got = motion_from_c3d(path, jaw.tables(emg=table), "human-jaw").channels.emg
    inside = slice(30, -30)  # away from the filters' ends
    # The low pass, twice of second order, takes (f / 6 Hz)^4 off 1 Hz: 8e-4.
    np.testing.assert_allclose(got[CHAINS[0]][inside], burst(jaw.t)[inside] / 0.9, atol=0.02)
    # |sin| is 2 / pi on the mean.
    want = burst(jaw.t)[inside] * (2 / np.pi) / 2.0
    np.testing.assert_allclose(got[CHAINS[1]][inside], want, atol=0.01)
    assert got[CHAINS[0]].max() == pytest.approx(1.0, abs=0.02)


def test_an_envelope_that_is_made_already(tmp_path: Path) -> None:
    """At the rate of the markers: no high pass."""
    jaw = record(mechanism="human-jaw")
    path = recorded(tmp_path, jaw, 7 * burst(jaw.t))
    table = {"channels": {CHAINS[0]: "EMG0"}, "high_pass": 0.0, "low_pass": 20.0}
    got = motion_from_c3d(path, jaw.tables(emg=table), "human-jaw").channels.emg
    np.testing.assert_allclose(got[CHAINS[0]][20:-20], burst(jaw.t)[20:-20] / 0.9, atol=5e-3)


@pytest.mark.parametrize(
    ("emg", "said"),
    [
        ({"channels": {"masseter": "EMG0"}}, 'emg: "human-jaw" has no chain "masseter"'),
        ({"channels": {CHAINS[0]: "EMG7"}}, 'emg: has no channel "EMG7".*Available: EMG0, EMG1'),
        ({"channels": {CHAINS[0]: "EMG0"}, "high_pass": 500.0}, "sampled at 1000 Hz, and high"),
        ({"channels": {CHAINS[0]: "EMG0"}, "low_pass": 700.0}, "low_pass is 700 Hz; expected less"),
        ({"channels": {CHAINS[0]: "EMG0"}, "low_pass": 0.5}, "lasts 0.8 s, too short for low_pass"),
        ({"channels": {CHAINS[0]: "EMG1"}}, r'"EMG1" \(superficial_masseter_left\) is constant'),
        ({"channels": {CHAINS[0]: "EMG2"}}, '"EMG2" has samples that are no numbers'),
        ({"channels": {CHAINS[0]: "EMG0"}, "greatest": {CHAINS[1]: 1.0}}, "has no channel in"),
        ({"channels": {CHAINS[0]: "EMG0"}, "greatest": {CHAINS[0]: 0.0}}, "greatest"),
        ({"channels": {CHAINS[0]: "EMG0"}, "high_pass": -1.0}, "high_pass"),
        ({"channels": {CHAINS[0]: "EMG0"}, "low_pass": 0.0}, "low_pass"),
        ({"channels": {CHAINS[0]: 3}}, "channels"),
        ({"channels": {}}, "channels"),
        ({"channels": ["EMG0"]}, "channels"),
        ({}, "channels"),
        ({CHAINS[0]: "EMG0"}, "channels|superficial_masseter_left"),
    ],
)
def test_what_cannot_be(tmp_path: Path, emg: Any, said: str) -> None:
    jaw = record(seconds=0.8, mechanism="human-jaw")
    noise = np.random.default_rng(0).normal(0, 1, len(jaw.t) * SAMPLES)
    path = recorded(tmp_path, jaw, noise, np.ones_like(noise), np.full_like(noise, np.nan))
    with pytest.raises(InputError, match=said) as caught:
        motion_from_c3d(path, jaw.tables(emg=emg), "human-jaw")
    assert len(str(caught.value).splitlines()) <= 3
