"""What people hand over for a motion or a load, and numbers that no machine makes."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from condyle.errors import InputError
from condyle.files import memory
from condyle.motion import (
    Load,
    Motion,
    as_load,
    as_motion,
    reference_load,
    reference_motion,
    resolve_landmark,
    resolve_load_point,
    write_table,
)

T = np.arange(9) / 10


def test_a_frame_with_a_column_of_times():
    frame = pd.DataFrame({"Time [ms]": 1e3 * T, "X": 2 * T, "beta": T, "who": ["a"] * 9})
    motion = as_motion(frame)
    np.testing.assert_allclose(motion.t, T)
    np.testing.assert_allclose(motion.rate, [[2, 1]] * 9, atol=1e-10)
    assert motion.names == ("X", "beta")
    assert motion.warnings == ('motion: column "who" is not used',)
    assert Motion.from_frame(frame, units="mm").rate[0, 0] == pytest.approx(2e-3)


def test_without_one_the_index_is_the_time():
    named = pd.Index(T, name="time"), pd.Index(1e3 * T, name="t [ms]")
    for index in (pd.Index(T), *named, pd.to_timedelta(T, unit="s")):
        frame = pd.DataFrame({"X": T}, index=index)
        np.testing.assert_allclose(as_motion(frame).t, T)
        np.testing.assert_allclose(as_load(frame.rename(columns={"X": "Fz"})).at(T)[:, 2], T)


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (pd.DataFrame({"t": T, "X": ["a"] * 9}), 'column "X": expected an array of numbers'),
        (pd.DataFrame({"t": T, "X": [np.nan, *T[1:]]}), 'row 1, column "X": got nan'),
        (
            pd.DataFrame({"X": T}, index=pd.Index(T, name="frame")),
            "no column .t., nor is its index one .index: got the columns .frame.",
        ),
        (pd.DataFrame({"X": T}, index=list("abcdefghi")), "index: expected an array of numbers"),
        (pd.DataFrame({"t": T, "a": T}), "got only t"),
        (pd.DataFrame({"t": T, "X": [None, *T[1:]]}, dtype=object), "expected an array of numbers"),
        (pd.DataFrame({"t": T[::-1], "X": T}), "row 2: t is 0.7 s after 0.8 s"),
    ],
)
def test_frames_that_cannot_be_used_are_refused(frame, message):
    with pytest.raises(InputError, match=message):
        as_motion(frame)


def test_a_path_is_a_motion_or_a_load(tmp_path):
    path = tmp_path / "in.csv"
    write_table(path, {"t": T, "X": T})
    motion = as_motion(path)
    assert as_motion(str(path)).source == motion.source == str(path) and as_motion(motion) is motion
    write_table(path, {"t": T, "Fz": T})
    load = as_load(path)
    assert load.wrench[3, 2] == T[3] and as_load(load) is load and not as_load(None).at(T).any()


def test_other_things_are_named_with_what_is_taken():
    for take, thing, said in (
        (as_motion, Load.zero(), r"got Load\. .* The order is motion, load"),
        (as_load, Motion.from_arrays(T, {"X": T}), r"got Motion\. .* The order is motion, load"),
        (as_motion, T, "expected a Motion, the path of a file or a DataFrame, got ndarray"),
        (as_load, 5, r"load: .*got int.*Load.from_arrays\(t, force, moment"),
        (Motion.from_frame, [1, 2], "got a list, expected a pandas DataFrame"),
    ):
        with pytest.raises(InputError, match=said):
            take(thing)


def test_nothing_imports_pandas_or_pyarrow_before_it_is_needed():
    code = "import sys, condyle.motion; print(sorted({'pandas', 'pyarrow'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize(
    ("resolve", "default"), [(resolve_landmark, "incisor"), (resolve_load_point, "right_molar")]
)
def test_the_point_that_is_meant(resolve, default):
    points = {"tip": [0, 0, 0], default: [1, 0, 0]}
    assert resolve(None, points) == default and resolve("tip", points) == "tip"
    assert resolve(None, ["tip"]) == "tip"
    for name, among, said in (
        (None, ["a", "b"], r'2 points; choose one of "a", "b" with --l'),
        (None, [], r"no points; give it some in platform\.points"),
        ("tap", points, r'no l.* "tap". Did you mean "tip"'),
    ):
        with pytest.raises(InputError, match=said):
            resolve(name, among)


# -- numbers that no machine makes -----------------------------------------------------------

LONG = np.linspace(0, 2, 2001)
CHEW = 0.015 * np.sin(2 * np.pi * LONG)


def said(t=LONG, **columns):
    return Motion.from_arrays(t, columns).warnings


def test_what_machines_do_is_not_warned_of():
    assert said(X=CHEW, beta=0.3 * np.sin(LONG)) == said(X=1.2 * np.sin(LONG)) == ()
    assert said(t=np.arange(50.0), X=np.zeros(50)) == ()  # few and slow
    assert said(t=np.arange(500.0), X=np.sin(np.arange(500.0))) == ()  # slow steps, but it moves
    assert reference_motion().warnings == () and reference_load().warnings == ()
    assert Load.from_arrays([0, 1], [[0, 0, 900.0]] * 2).warnings == ()


def test_milliseconds_millimetres_degrees_and_forces_of_ships():
    [warning] = said(t=1e3 * LONG, X=CHEW)
    assert "2001 rows in steps of 1 s, 2000 s in all; if t is in milliseconds" in warning
    assert Motion.from_arrays(1e3 * LONG, {"X": CHEW}, units="ms").warnings == ()
    [warning] = Load.from_arrays(1e3 * LONG, np.zeros((2001, 3))).warnings
    assert 'name the column "t [ms]"' in warning
    assert "X goes over 30 m; if lengths are in mm, say --units mm" in said(X=1e3 * CHEW)[0]
    assert "beta reaches 20 rad, more than a turn" in said(beta=20 * np.sin(LONG))[0]
    assert "X moves at 9425 m/s, faster than sound" in said(X=1e5 * CHEW)[0]
    [warning] = Load.from_arrays([0, 1], [[0, 0, 2e6]] * 2).warnings
    assert warning.startswith("load: reaches 2e+06")


def test_a_rate_is_refused_by_the_memory_that_the_system_says(monkeypatch):
    with monkeypatch.context() as little:
        little.setattr(memory, "available_memory", lambda: 3_000_000)
        assert len(Motion.from_arrays(LONG, {"X": CHEW}, rate=450)) == 901
        with pytest.raises(InputError, match=r"1.2e\+03 samples, .* 3.43 MiB, and 2.86 MiB are"):
            Motion.from_arrays(LONG, {"X": CHEW}, rate=600)
    assert 1 << 20 < memory.available_memory() < 1 << 50

    def refuse(*_, **__):
        raise OSError

    monkeypatch.setattr("builtins.open", refuse)
    assert 1 << 20 < memory.available_memory() < 1 << 50
    monkeypatch.setattr("os.sysconf", refuse)
    assert memory.available_memory() == 8 << 30
