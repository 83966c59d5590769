"""Cycles of synthetic chewing, whose times are known."""

from typing import Any

import numpy as np

from condyle.analysis.session import at_times
from condyle.analysis.session.cycle_finding import spans as spans_of
from condyle.markers.session_file import Cycles

RATE = 100.0


def spans(t: np.ndarray, x: np.ndarray, **given: Any) -> np.ndarray:
    return spans_of(t, x, Cycles.model_validate({"by": "beta", **given}))


def chewing(durations: list[float], rest: float = 0.5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, an opening that is 0 where cycles meet and at rest, and the times of meeting."""
    turns = rest + np.concatenate([[0.0], np.cumsum(durations)])
    t = np.arange(0.0, turns[-1] + rest, 1 / RATE)
    phase = np.interp(t, turns, np.arange(len(turns)))
    return t, 0.1 * (1 - np.cos(2 * np.pi * phase)), turns


def test_every_cycle_is_found() -> None:
    """The first begins at rest, where nothing turns, and the last one ends so; turns lie between
    samples."""
    durations = [0.7, 0.62, 0.81, 0.75, 0.68, 0.9]
    t, x, turns = chewing(durations)
    found = spans(t, x)
    np.testing.assert_allclose(found[:, 0], turns[1:-2], atol=2e-3)
    np.testing.assert_allclose(np.diff(found, axis=1)[:, 0], durations[1:-1], atol=3e-3)
    np.testing.assert_array_equal(found[1:, 0], found[:-1, 1])
    np.testing.assert_array_equal(spans(t, -x, **{"from": "maximum"}), found)
    t = np.arange(0, 5, 1 / RATE)
    found = spans(t, -np.cos(2 * np.pi * 1.3 * (t - 0.6234)))
    expected = 0.6234 + np.arange(len(found)) / 1.3
    np.testing.assert_allclose(found[:, 0], expected, atol=2e-5)


def test_noise_makes_no_cycles() -> None:
    rng = np.random.default_rng(0)
    t, x, turns = chewing([0.7] * 8)
    for _ in range(20):
        found = spans(t, x + rng.normal(0, 4e-3, len(t)))
        assert len(found) in (6, 7, 8)  # with ends that lie in the rest or not
        inner = found[(found[:, 0] > 1.0) & (found[:, 1] < turns[-2] + 0.1)]
        np.testing.assert_allclose(np.diff(inner, axis=1), 0.7, atol=0.08)


def test_what_is_too_short_or_too_long_is_no_cycle_and_gaps_end_them() -> None:
    t, x, _ = chewing([0.7, 0.3, 0.3, 0.7, 0.7, 0.7])
    assert np.diff(spans(t, x, shortest=0.5), axis=1).min() >= 0.5
    paused = np.concatenate([x[:300], np.zeros(400), x[60:300]])
    times = np.arange(len(paused)) / RATE
    assert np.diff(spans(times, paused), axis=1).max() > 2
    assert np.diff(spans(times, paused, longest=1.5), axis=1).max() < 1.5
    t, x, turns = chewing([0.7] * 6)
    gap = turns[2] + 0.3
    x[np.abs(t - gap) < 0.03] = np.nan
    found = spans(t, x)
    assert len(found) == 3 and not ((found[:, 0] < gap) & (found[:, 1] > gap)).any()
    assert not len(spans(t, np.full_like(t, np.nan))) and not len(spans(t, np.ones_like(t)))


def test_samples_at_other_times() -> None:
    rng = np.random.default_rng(1)
    t = np.sort(rng.uniform(0, 1, 30))
    values, times = rng.normal(size=(30, 2, 3)), rng.uniform(t[0], t[-1], (4, 5))
    times[0, 0], times[0, 1] = t[0], t[-1]
    columns = [np.interp(times, t, column) for column in values.reshape(30, 6).T]
    expected = np.stack(columns, axis=-1).reshape(4, 5, 2, 3)
    np.testing.assert_allclose(at_times(t, values, times), expected, atol=1e-14)
    values[7] = np.nan
    assert np.isfinite(at_times(t, values, t[[6, 8]])).all()
