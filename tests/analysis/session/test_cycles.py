"""Cycles of synthetic chewing, whose times are known."""

from typing import Any

import numpy as np
from scipy.signal import savgol_filter
from support.recorded_session import movements

from condyle.analysis.session import at_times
from condyle.analysis.session.cycle_finding import _speed
from condyle.analysis.session.cycle_finding import spans as spans_of
from condyle.markers.session_file import Cycles

RATE = 100.0


def spans(t: np.ndarray, x: np.ndarray, **given: Any) -> np.ndarray:
    return spans_of(t, x, Cycles.model_validate({"by": "beta", **given})).ends


def chewing(durations: list[float], rest: float = 0.5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, an opening that is 0 where cycles meet and at rest, and the times of meeting."""
    turns = rest + np.concatenate([[0.0], np.cumsum(durations)])
    t = np.arange(0.0, turns[-1] + rest, 1 / RATE)
    phase = np.interp(t, turns, np.arange(len(turns)))
    return t, 0.1 * (1 - np.cos(2 * np.pi * phase)), turns


def test_every_cycle_is_found() -> None:
    """The first begins at rest, and the last ends so; turns lie between samples."""
    durations = [0.7, 0.62, 0.81, 0.75, 0.68, 0.9]
    t, x, turns = chewing(durations)
    found = spans(t, x)
    faster = np.arcsin(0.1) / (2 * np.pi)  # of a cycle, until a tenth of the largest speed
    np.testing.assert_allclose(found[:, 0] - turns[:-1], faster * np.array(durations), atol=0.012)
    np.testing.assert_allclose(np.diff(found, axis=1)[:-1, 0], durations[:-1], atol=8e-3)
    np.testing.assert_array_equal(found[1:, 0], found[:-1, 1])
    np.testing.assert_array_equal(spans(t, -x, **{"from": "maximum"}), found)
    t = np.arange(0, 5, 1 / RATE)
    found = spans(t, -np.cos(2 * np.pi * 1.3 * (t - 0.6234)))
    assert len(found) == 5
    expected = 0.6234 + (np.arange(5) + faster) / 1.3
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-3)


def test_speeds_are_those_of_savitzky_and_golay() -> None:
    y = np.random.default_rng(0).normal(size=300).cumsum()
    for count, width in ((5, 5), (6, 3), (300, 11)):
        wanted = savgol_filter(y[:count], width, 2, deriv=1, delta=0.01)
        np.testing.assert_allclose(_speed(y[:count], width, 0.01), wanted, atol=1e-9)


def test_noise_makes_no_cycles() -> None:
    rng = np.random.default_rng(0)
    t, x, _ = chewing([0.7] * 8)
    for _ in range(20):
        found = spans(t, x + rng.normal(0, 4e-3, len(t)))
        np.testing.assert_allclose(np.diff(found, axis=1)[:, 0], [0.7] * 8, atol=0.09)


def test_what_is_too_short_or_too_long_is_no_cycle_and_gaps_end_them() -> None:
    t, x, _ = chewing([0.7, 0.3, 0.3, 0.7, 0.7, 0.7])
    assert np.diff(spans(t, x, shortest=0.5), axis=1).min() >= 0.5
    held = np.concatenate([x[:85], np.full(200, x[85]), x[85:]])  # open for two seconds
    times = np.arange(len(held)) / RATE
    assert np.diff(spans(times, held), axis=1).max() > 2
    assert np.diff(spans(times, held, longest=1.5), axis=1).max() < 1.5
    t, x, turns = chewing([0.7] * 6)
    gap = turns[2] + 0.3
    x[np.abs(t - gap) < 0.03] = np.nan
    found = spans(t, x)
    assert len(found) == 5 and not ((found[:, 0] < gap) & (found[:, 1] > gap)).any()
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


def test_phases_and_rest_are_cut_at_speeds() -> None:
    """Stops below `rest` belong to the cycle, longer ones to none; with noise of a recording."""
    rng = np.random.default_rng(3)
    for stop, occlusal, rest in ((0.2, 0.2, 0.0), (1.5, 0.0, 1.5)):
        gape = 0.02 * movements(5, 0.4, 0.3, stop)
        gape += rng.normal(0, 5e-5, len(gape))
        t = np.arange(len(gape)) / RATE
        found = spans_of(t, gape, Cycles.model_validate({"by": "gape", "least": 5.0}), "m")
        assert len(found.ends) == 5
        opening, closing, slow, until_next = found.phases.T
        np.testing.assert_allclose(opening, 0.4, atol=0.035)
        np.testing.assert_allclose(closing, 0.3, atol=0.035)
        np.testing.assert_allclose(slow[:-1], occlusal, atol=0.05)
        np.testing.assert_allclose(until_next[:-1], rest, atol=0.05)
        assert np.isnan(until_next[-1])
        np.testing.assert_allclose(found.phases[:, :3].sum(axis=1), np.diff(found.ends)[:, 0])


def test_a_movement_is_a_cycle_from_the_stated_amplitude_on() -> None:
    """Of a rest with tremor none; where the recording ends amid a movement, it is none."""
    gape = np.concatenate([0.02 * movements(3, 0.4, 0.3, 0.3), 0.004 * movements(4, 0.4, 0.3, 0.3)])
    t = np.arange(len(gape)) / RATE

    def count(least: float | None, x: np.ndarray = gape) -> int:
        given = {"by": "gape"} | ({} if least is None else {"least": least})
        return len(spans_of(t[: len(x)], x, Cycles.model_validate(given), "m").ends)

    assert [count(least) for least in (2.0, 5.0, 25.0)] == [7, 3, 0]
    assert count(None) == 3 and count(None, 1e-4 * np.sin(9 * t)) == 0
    assert count(2.0, gape[: round(0.95 * RATE)]) == 0 and count(2.0, gape[90:]) == 6
