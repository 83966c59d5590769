"""What people hand over for a motion or a load: frames, paths, and things that are neither."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from condyle.errors import InputError
from condyle.motion import Load, Motion, as_load, as_motion, write_table

T = np.arange(9) / 10


def test_a_frame_with_a_column_of_times():
    frame = pd.DataFrame({"Time [ms]": 1e3 * T, "X": 2 * T, "beta": T, "who": ["a"] * 9})
    motion = as_motion(frame)
    np.testing.assert_allclose(motion.t, T)
    np.testing.assert_allclose(motion.rate, [[2, 1]] * 9, atol=1e-10)
    assert motion.names == ("X", "beta") and motion.warnings == (
        'motion: column "who" is not used',
    )
    assert Motion.from_frame(frame, units="mm").rate[0, 0] == pytest.approx(2e-3)


@pytest.mark.parametrize(
    "index",
    [
        pd.Index(T),
        pd.Index(T, name="time"),
        pd.Index(1e3 * T, name="t [ms]"),
        pd.to_timedelta(T, unit="s"),
    ],
)
def test_without_one_the_index_is_the_time(index):
    frame = pd.DataFrame({"X": T}, index=index)
    np.testing.assert_allclose(as_motion(frame).t, T)
    np.testing.assert_allclose(as_load(frame.rename(columns={"X": "Fz"})).at(T)[:, 2], T)


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (pd.DataFrame({"t": T, "X": ["a"] * 9}), 'column "X": is not made of numbers'),
        (pd.DataFrame({"t": T, "X": [np.nan, *T[1:]]}), 'row 1, column "X": got nan'),
        (
            pd.DataFrame({"X": T}, index=pd.Index(T, name="frame")),
            "no column .t., nor is its index one .index: got the columns .frame.",
        ),
        (pd.DataFrame({"X": T}, index=list("abcdefghi")), "index: is not made of numbers"),
        (pd.DataFrame({"t": T, "a": T}), "got only t"),
        (pd.DataFrame({"t": T[::-1], "X": T}), "row 2: t is 0.7 s after 0.8 s"),
    ],
)
def test_frames_that_cannot_be_used_are_refused(frame, message):
    with pytest.raises(InputError, match=message):
        as_motion(frame)


def test_a_path_is_a_motion_or_a_load(tmp_path):
    path = tmp_path / "in.csv"
    write_table(path, {"t": T, "X": T})
    assert as_motion(str(path)).source == as_motion(path).source == str(path)
    motion = as_motion(path)
    assert as_motion(motion) is motion
    write_table(path, {"t": T, "Fz": T})
    load = as_load(path)
    assert load.wrench[3, 2] == T[3] and as_load(load) is load
    assert not as_load(None).at(T).any()


def test_other_things_are_named_with_what_is_taken():
    motion, load = Motion.from_arrays(T, {"X": T}), Load.zero()
    with pytest.raises(InputError, match=r"got Load\. .* The order is motion, load"):
        as_motion(load)
    with pytest.raises(InputError, match=r"got Motion\. .* The order is motion, load"):
        as_load(motion)
    with pytest.raises(
        InputError,
        match=r"motion: expected a Motion, the path of a file or a DataFrame, got ndarray",
    ):
        as_motion(T)
    with pytest.raises(InputError, match=r"load: .*got int.*Load.from_arrays\(t, force, moment"):
        as_load(5)
    with pytest.raises(InputError, match="got a list, expected a pandas DataFrame"):
        Motion.from_frame([1, 2])


def test_nothing_imports_pandas_or_pyarrow_before_it_is_needed():
    code = "import sys, condyle.motion; print(sorted({'pandas', 'pyarrow'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
