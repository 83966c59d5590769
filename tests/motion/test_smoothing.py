"""Smoothing: its gain, what it takes off, and what it leaves at the ends."""

from __future__ import annotations

import numpy as np
import pytest

from condyle.errors import InputError
from condyle.motion import AUTO_CUTOFF, Motion, reference_motion
from condyle.motion.smoothing import smoothing_spline

T = np.linspace(0, 4, 2001)


def test_the_gain_is_that_of_a_fourth_order_filter_both_ways_and_nothing_shifts():
    for frequency in (1, 5, 8, 10, 12, 20, 60):
        wave = np.cos(2 * np.pi * frequency * T)[:, None]
        out = smoothing_spline(T, wave, 10.0)(T)[600:1400]
        gain = np.linalg.lstsq(wave[600:1400], out, rcond=None)[0].item()
        ideal = 1 / (1 + (2**0.5 - 1) * (frequency / 10) ** 8)
        assert gain == pytest.approx(ideal, abs=1e-4 if frequency == 10 else 0.012)
        np.testing.assert_allclose(out, gain * wave[600:1400], atol=1e-3)


def test_a_cubic_passes_unchanged_up_to_the_ends_and_on_uneven_times():
    t = np.sort(np.random.default_rng(0).uniform(0, 5, 1000))
    t -= t[0]
    cubic = (t**3 - 2 * t)[:, None]
    np.testing.assert_allclose(smoothing_spline(t, cubic, 8.0)(t), cubic, atol=1e-9)


def test_noise_goes_and_the_motion_stays_to_its_acceleration():
    clean, inner = reference_motion(), slice(100, -100)
    noise = 5e-5 * np.random.default_rng(2).standard_normal(clean.value.shape)
    largest = np.abs(clean.acceleration).max()
    smooth, raw = (
        Motion.from_arrays(clean.t, clean.value + noise, names=clean.names, cutoff=cutoff)
        for cutoff in ("auto", None)
    )
    error, rough = (np.abs(m.acceleration - clean.acceleration)[inner].max() for m in (smooth, raw))
    assert error < 0.15 * largest and rough > 100 * largest


def test_the_removed_part_is_reported():
    slow, fast = 1e-2 * np.sin(2 * np.pi * T), 1e-4 * np.sin(2 * np.pi * 60 * T)
    motion = Motion.from_arrays(T, {"X": slow + fast, "alpha": slow}, cutoff="auto")
    report = motion.smoothing
    assert report is not None and report.cutoff == AUTO_CUTOFF and report.automatic
    assert report.names == motion.names
    assert report.rms[0] == pytest.approx(1e-4 / 2**0.5, rel=0.01)
    assert report.peak[0] == pytest.approx(1e-4, rel=0.1)
    assert report.rms[1] < 1e-7
    assert str(report).startswith("smoothing at 10 Hz removed X 0.07")
    assert not Motion.from_arrays(T, {"X": slow}, cutoff=8).smoothing.automatic
    assert Motion.from_arrays(T, {"X": slow}).smoothing is None


@pytest.mark.parametrize(
    ("t", "cutoff", "message"),
    [
        (T, 250.0, "must be below half the sampling rate, 250 Hz"),
        (T[:50], 10.0, "needs a recording of at least 0.2 s"),
        (T, 0, "expected a frequency above 0 Hz"),
        (T, float("nan"), "expected a frequency"),
        (T, "often", "above 0 Hz, or \"auto\", got 'often'"),
        (np.delete(T, range(1000, 1050)), "auto", r"longest step is 0\.102 s"),
    ],
)
def test_cut_offs_that_cannot_be_used_are_refused(t, cutoff, message):
    with pytest.raises(InputError, match=message):
        Motion.from_arrays(t, {"X": t}, cutoff=cutoff)


def errors(amplitude, frequency, noise, trim):
    """Largest error of the acceleration [m/s^2], of 20 recordings of a sine at 500 Hz."""
    t = np.arange(0, 4, 1 / 500)
    w, worst = 2 * np.pi * frequency, 0.0
    for seed in range(20 if noise else 1):
        measured = amplitude * np.sin(w * t + 1)
        measured += noise * np.random.default_rng(seed).standard_normal(len(t))
        motion = Motion.from_arrays(t, {"X": measured}, cutoff="auto", trim=trim)
        true = -amplitude * w**2 * np.sin(w * motion.t + 1)
        worst = max(worst, np.abs(motion.acceleration[:, 0] - true).max())
    return worst


def test_the_ends_are_less_certain_and_can_be_trimmed():
    """As the documentation says it: noise of 0.02 mm; a component of 5 Hz."""
    for *recording, ends, inside in ((5e-3, 1.0, 2e-5, 0.1, 0.04), (1e-3, 5.0, 0.0, 0.3, 0.005)):
        assert errors(*recording, trim=0.0) > ends
        assert errors(*recording, trim=0.2) < inside
    wave = np.sin(T)
    whole = Motion.from_arrays(T, {"X": wave}, rate=100)
    part = Motion.from_arrays(T, {"X": wave}, rate=100, trim=0.2)
    np.testing.assert_array_equal(part.t, whole.t[20:-20])
    np.testing.assert_array_equal(part.acceleration, whole.acceleration[20:-20])
    np.testing.assert_array_equal(Motion.from_arrays(T, {"X": wave}, times=[0.1, 1], trim=0.2).t, 1)
