"""Motions from files and arrays: what they are, their derivatives, splines and grids."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from condyle.errors import InputError
from condyle.motion import POSE, Motion, write_table
from condyle.motion.spline import Spline

T = np.linspace(0, 2, 201)


def wobble(t, phase=0.0):
    return 1e-2 * np.sin(7 * t + phase) * np.exp(-t)


def test_columns_say_what_the_motion_is():
    column = wobble(T)
    for given, kind, names in (
        ("zyx", "landmark", ("x", "y", "z")),
        (reversed(POSE), "pose", POSE),
        (["beta", "X"], "coordinates", ("beta", "X")),
    ):
        path = Motion.from_arrays(T, dict.fromkeys(given, column))
        assert (path.kind, path.names, path.landmark) == (kind, names, None)
    molar = Motion.from_arrays(T, np.column_stack([column] * 3), "xyz", landmark="left_molar")
    assert molar.landmark == "left_molar" and molar.value.shape == (201, 3) and len(molar) == 201


@pytest.mark.parametrize(
    ("header", "message"),
    [
        *(("t", "got only t; expected pose coordinates"), ("X,Y", 'column "t" is missing')),
        *(("t,x,z", "a landmark's path also needs y"), ("t,x,y,z,X", "not both")),
        ("t,X,Y,alpa", 'column "alpa" is not known here. Did you mean "alpha"'),
    ],
)
def test_columns_that_are_no_motion_are_refused(csv_file, header, message):
    rows = "".join(",".join([str(i)] * len(header.split(","))) + "\n" for i in range(9))
    with pytest.raises(InputError, match=message):
        Motion.from_csv(csv_file(f"{header}\n{rows}"))


@pytest.mark.parametrize(
    ("t", "message"),
    [
        ([0, 1, 2, 3, 4], "5 rows, expected at least 6"),
        ([0, 1, 2, 2, 4, 5], "line 5: t is 2.0 s after 2.0 s; times must be strictly increasing"),
        ([0, 1, 2, 1, 4, 5], "line 5: t is 1.0 s after 2.0 s; times must be strictly increasing"),
    ],
)
def test_times_must_rise_and_be_six(csv_file, t, message):
    with pytest.raises(InputError, match=message):
        Motion.from_csv(csv_file("t,X\n" + "".join(f"{time},0\n" for time in t)))
    with pytest.raises(InputError, match=message.replace("line 5", "motion, sample 3")):
        Motion.from_arrays(t, {"X": np.zeros(len(t))})


@pytest.mark.parametrize(
    ("values", "options", "message"),
    [
        ({"X": T[:-1]}, {}, r'"X" has shape \(200,\), expected \(201,\)'),
        ({"X": [*T[:7], np.nan, *T[8:]]}, {}, 'sample 7: "X" is nan'),
        ({"X": ["a"] * 201}, {}, '"X": expected an array of numbers'),
        (np.zeros((201, 2)), {"names": ["X"]}, "different name"),
        (np.zeros((201, 2)), {"names": ["X", "X"]}, "different name"),
        (np.zeros((201, 1)), {"names": ["X", "X"]}, "different name"),
        (np.zeros(201), {}, r"shape \(201,\); expected a mapping .* or \(samples, columns\)"),
        (np.zeros((4, 201)), {"names": ["X", "Y", "alpha", "beta"]}, "give its transpose"),
        ("motion.csv", {}, "values: expected an array of numbers"),
        ({"X": T}, {"trim": -1}, "trim: expected seconds, at least 0, got -1"),
        ({"X": T}, {"trim": 1.5}, "leaves nothing of 2 s"),
        ({"X": T}, {"units": 5}, "units: got 5, expected text"),
        ({"X": T}, {"landmark": "incisor"}, "a landmark's path has x, y, z"),
        ({"X": T}, {"rate": 200, "times": T}, "expected one of them"),
        ({"X": T}, {"rate": 0}, "rate: .* got 0"),
        ({"X": T}, {"rate": 1e12}, r"would give 2e\+12 samples, which take 5.59e"),
        ({"X": T}, {"times": [0.5, 2.5]}, "must lie within 0 to 2 s"),
        ({"X": T}, {"times": []}, "must lie within"),
        ({"X": T}, {"times": [0.5, 0.5]}, "times must be strictly increasing"),
        ({"X": T}, {"units": "inch"}, "not a unit"),
        ({"X": T * 1e305}, {}, "too extreme"),
    ],
)
def test_arrays_and_options_that_cannot_be_used_are_refused(values, options, message):
    with pytest.raises(InputError, match=message):
        Motion.from_arrays(T, values, **options)


@pytest.mark.parametrize("degree", [3, 5])
@pytest.mark.parametrize("count", [6, 7, 33, 201])
def test_splines_are_scipy_s(count, degree):
    rng = np.random.default_rng(count)
    t = np.cumsum(rng.uniform(0.2, 1.0, count)) * 1e-2
    values = np.column_stack([np.sin(3 * t), np.cos(40 * t), rng.normal(size=count)])
    own, peer = Spline.through(t, values, degree), make_interp_spline(t, values, k=degree)
    wanted = np.concatenate([t, np.linspace(t[0], t[-1], 501)])
    np.testing.assert_allclose(own(t), values, atol=1e-13)
    for nu in range(4):
        off = np.abs(own(wanted, nu) - peer(wanted, nu)).max()
        assert off <= 1e-12 * np.abs(peer(wanted, nu)).max(), nu


def test_a_motion_meets_its_samples_and_the_true_derivatives():
    """A quintic's are exact, on uneven samples too."""
    motion = Motion.from_arrays(T, {"X": wobble(T), "beta": wobble(T, 1.0)})
    np.testing.assert_allclose(motion.value[:, 1], wobble(T, 1.0), atol=1e-17)
    z = 7j - 1  # wobble is the imaginary part of exp(z t)
    true = 1e-2 * np.imag(z**2 * np.exp(z * T))
    np.testing.assert_allclose(motion.acceleration[:, 0], true, atol=2e-5 * np.abs(true).max())
    rng = np.random.default_rng(3)
    t = np.sort(rng.uniform(-1, 1, 40))
    p = np.polynomial.Polynomial(rng.standard_normal(6))
    motion = Motion.from_arrays(t, {"X": p(t)}, rate=77)
    np.testing.assert_allclose(motion.value[:, 0], p(motion.t), atol=1e-11)
    np.testing.assert_allclose(motion.rate[:, 0], p.deriv(1)(motion.t), atol=1e-9)
    np.testing.assert_allclose(motion.acceleration[:, 0], p.deriv(2)(motion.t), atol=1e-6)


@pytest.mark.parametrize("cutoff", [None, 12.0])
def test_rate_and_acceleration_are_the_derivatives_of_what_is_returned(cutoff):
    h, middle = 1e-5, np.linspace(0.1, 1.9, 50)
    noisy = wobble(T) + 1e-5 * np.random.default_rng(0).standard_normal(201)
    below, at, above = (
        Motion.from_arrays(T, {"X": noisy}, times=middle + d, cutoff=cutoff) for d in (-h, 0, h)
    )
    rate, acceleration = (
        (getattr(above, name) - getattr(below, name)) / (2 * h) for name in ("value", "rate")
    )
    np.testing.assert_allclose(at.rate, rate, atol=1e-6 * np.abs(rate).max())
    bound = 1e-5 * np.abs(acceleration).max()
    np.testing.assert_allclose(at.acceleration, acceleration, atol=bound)


@pytest.mark.parametrize("start", [0.0, 0.3, 1.7e9])
@pytest.mark.parametrize("cutoff", [None, "auto"])
def test_output_grids_meet_in_the_same_numbers(start, cutoff):
    noise = 1e-5 * np.random.default_rng(1).standard_normal(201)
    columns = {"X": wobble(T) + noise, "alpha": wobble(T, 2.0)}
    fine, coarse = (
        Motion.from_arrays(start + T, columns, rate=rate, cutoff=cutoff) for rate in (1000, 200)
    )
    assert len(fine) == 2001 and len(coarse) == 401
    np.testing.assert_array_equal(fine.t[::5], coarse.t)
    for name in ("value", "rate", "acceleration"):
        a, b = getattr(fine, name)[::5], getattr(coarse, name)
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * np.abs(a).max())
    motion = Motion.from_arrays(T, {"X": T}, rate=30.3)  # it stays within the input
    assert motion.t[-1] <= T[-1] and len(motion) == 61


def test_units_of_a_file_become_si(csv_file):
    t, path = np.arange(9) / 10, csv_file("")
    write_table(path, {"t": t, "beta": 90 * t, "X": 50 * t})
    motion = Motion.from_csv(path, units="mm,deg")
    np.testing.assert_allclose(motion.value, np.column_stack([np.pi / 2 * t, 0.05 * t]))
    np.testing.assert_allclose(motion.rate, [[np.pi / 2, 0.05]] * 9)
    assert motion.source == str(path)
