"""Loads: from files and arrays, between samples, and what is none."""

from __future__ import annotations

import numpy as np
import pytest

from condyle.errors import InputError
from condyle.motion import Load


def test_a_load_between_samples_and_at_all_times(csv_file):
    load = Load.from_csv(csv_file("Fz,t,Fx,Fy,Mz,Mx,My\n3,0,1,2,6,4,5\n0,1,0,0,0,0,0\n"), "molar")
    np.testing.assert_array_equal(load.wrench[0], [1, 2, 3, 4, 5, 6])
    np.testing.assert_allclose(load.at([0.25]), [[0.75, 1.5, 2.25, 3, 3.75, 4.5]])
    bare = Load.from_csv(csv_file("t,Fx,Fy,Fz\n0,1,2,3\n1,1,2,3\n"))
    np.testing.assert_array_equal(bare.at([0, 1]), [[1, 2, 3, 0, 0, 0]] * 2)
    assert load.point == "molar" and bare.point is None
    constant = Load.constant([1, 2, 3], [4, 5, 6], "molar")
    np.testing.assert_array_equal(constant.at([-1e9, 1e9]), [[1, 2, 3, 4, 5, 6]] * 2)
    np.testing.assert_array_equal(Load.zero().at([0.0, 1.0]), np.zeros((2, 6)))
    six = Load.from_arrays([0, 1], np.tile(np.arange(6.0), (2, 1)))
    assert six.wrench[1].tolist() == [0, 1, 2, 3, 4, 5]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("t,x\n0,1\n", 'columns "Fx", "Fy", "Fz" are missing.*Available: t, x'),
        ("t,Fx,Fzz\n0,1,2\n", 'column "Fzz" is not known here. Did you mean "Fz"'),
        ("Fx,Fy,Fz\n1,2,3\n", 'column "t" is missing'),
        ("t,Fx,Fy,FZ,fz\n0,1,2,3,4\n", 'columns "FZ", "fz" both mean "Fz"'),
        ("t,Fx,Fy,Fz\n0,1,2,3\n0,1,2,3\n", "line 3: t is 0.0 s after 0.0 s"),
    ],
)
def test_what_is_no_load_is_refused(csv_file, content, message):
    with pytest.raises(InputError, match=message):
        Load.from_csv(csv_file(content))


def test_times_that_the_load_does_not_cover_are_named():
    load = Load.from_arrays([1, 2], np.ones((2, 3)), source="bite.csv")
    with pytest.raises(InputError, match="no load at 0 to 1 s and 2 to 5 s") as caught:
        load.at([0, 1.5, 5])
    assert str(caught.value).startswith("bite.csv: runs from 1 to 2 s, but the motion from 0 to 5")
    with pytest.raises(InputError, match="no load at 3 to 4 s"):
        load.at([3, 4])
    assert load.at([1 - 1e-12, 2 + 1e-12]).shape == (2, 6)  # rounding is forgiven
    assert load.at([]).shape == (0, 6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0, 1], np.ones((2, 2))), r"force has shape \(2, 2\), expected \(2, 3\)"),
        (([0, 1], np.ones((2, 3)), np.ones(3)), "moment has shape"),
        (([0, 1], np.full((2, 3), np.nan)), "not finite"),
        (([0, 1], [["a", "b", "c"]] * 2), "force: expected an array of numbers"),
        (([], np.ones((0, 3))), "at least one sample"),
        (([1, 0], np.ones((2, 3))), "sample 1: t is 0.0 s after 1.0 s"),
        (([0, 1], np.zeros((3, 2))), r"\(2, 3\): Fx, Fy, Fz; give its transpose"),
    ],
)
def test_arrays_that_are_no_load_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        Load.from_arrays(*arguments)
    with pytest.raises(InputError, match="force has shape"):
        Load.constant([1, 2])
