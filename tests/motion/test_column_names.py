"""Columns as people name them: units, spaces, other letters; and what is not used."""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np
import pytest

from condyle.errors import InputError
from condyle.motion import Load, Motion, read_table, write_table
from condyle.motion.column_names import read_header
from condyle.motion.column_units import (
    Units,
    dimension,
    name_and_unit,
    parse_units,
    unit_factor,
)
from condyle.motion.csv_file import HINTS
from condyle.motion.table_heads import NUMBER
from condyle.motion.written_values import values_of

KNOWN = ("t", "X", "Y", "alpha", "x", "y", "z", "dX", "ddX", "dalpha", "Fx", "Mx")


@pytest.mark.parametrize(
    ("text", "name", "scale"),
    [
        *(("t", "t", None), (" T ", "t", None), ("Time", "t", None), ("Time (s)", "t", 1)),
        *(("t [ms]", "t", 1e-3), ("t_ms", "t", 1e-3), ("t/ms", "t", 1e-3)),
        *(("time in min", "t", 60), ("x [mm]", "x", 1e-3), ("X (mm)", "X", 1e-3)),
        *(("X(\u00b5m)", "X", 1e-6), ("Alpha [deg]", "alpha", math.pi / 180)),
        *(("ALPHA_mrad", "alpha", 1e-3), ("alpha [\u00b0]", "alpha", math.pi / 180)),
        *(("dX [mm/s]", "dX", 1e-3), ("dX [mm/ms]", "dX", 1), ("ddX [mm/s\u00b2]", "ddX", 1e-3)),
        *(("ddX [m/ms^2]", "ddX", 1e6), ("dalpha (deg/s)", "dalpha", math.pi / 180)),
        *(("Fx [kN]", "Fx", 1e3), ("fx, mN", "Fx", 1e-3), ("Mx [N mm]", "Mx", 1e-3)),
        *(("Mx [N\u00b7m]", "Mx", 1), ("Mx (kN.m)", "Mx", 1e3), ("x []", "x", None)),
    ],
)
def test_a_column_is_read_as_what_it_says(text, name, scale):
    header = read_header("a.csv", [text], KNOWN)
    assert header.index == {name: 0} and header.ignored == ()
    assert header.scale.get(name) == (None if scale is None else pytest.approx(scale))


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["x [inch]"], '"inch" is not a unit of length; expected m, cm, mm, um'),
        (["X_deg"], '"deg" is not a unit of length'),
        (["t [mm]"], 'column "t .mm.": "mm" is not a unit of time; expected s, ms, us, min'),
        (["dX [mm]"], '"mm" is not a unit of length /s; expected m/s, cm/s'),
        (["ddX [mm/s]"], "expected m/s.2, cm/s.2"),
        (["Mx [N]"], '"N" is not a unit of moment; expected Nm'),
        (["x [mm/furlong]"], "is not a unit of length"),
        (["Time", "TIME (s)"], 'columns "Time", "TIME .s." both mean "t"'),
        (["x", "alfa"], 'column "alfa" is not known here. Did you mean "alpha"'),
        (["dxx"], 'got the columns "dxx"'),
        ([f"c{i}" for i in range(50)], r'"c9" and 40 more; expected some of t, X, .* and 2 more'),
        (["x", "x "], 'column "x" is given more than once'),
        (
            ["x [" + " " * 1500 + "mm"],
            "1505 characters in the name of a column, expected at most 1000",
        ),
    ],
)
def test_what_does_not_fit_is_refused(names, message):
    with pytest.raises(InputError, match=message):
        read_header("a.csv", names, KNOWN)


def test_exact_names_win_and_the_rest_is_listed():
    header = read_header("a.csv", ["T", "t", "marker 7", "x", "temp [C]", "run_ms"], KNOWN)
    assert header.index == {"t": 1, "x": 3} and header.scale == {}
    assert header.ignored == ("T", "marker 7", "temp [C]", "run_ms")


def test_a_unit_of_a_column_that_has_none_is_refused():
    joints = {"joint_a": ("angle", 0), "joint_b": ("length", 0)}
    header = read_header("a.csv", ["joint_a [deg]", "joint_b [mm]"], joints)
    assert header.scale == {"joint_a": math.pi / 180, "joint_b": 1e-3}
    with pytest.raises(InputError, match="no unit is known for it"):
        read_header("a.csv", ["joint_a [deg]"], ["joint_a"])


def test_dimensions_of_columns():
    assert dimension("t") == ("time", 0) and dimension("ddalpha") == ("angle", 2)
    assert dimension("dX") == ("length", 1) and dimension("Mz") == ("moment", 0)
    assert dimension("dddX") is None and dimension("dt") is None and dimension("") is None
    assert unit_factor("deg / ms^2", ("angle", 2)) == pytest.approx(math.pi / 180 * 1e6)


T = np.arange(9) / 10
PATH = {"t [ms]": 1e3 * T, "x [mm]": 50 * T, "y": 0 * T, "z (cm)": 5 * T**2, "note": T}


@pytest.mark.parametrize("name", ["in.csv", "in.parquet", "in.PARQUET"])
def test_a_motion_with_units_in_its_header(tmp_path, name):
    """Against the derivatives of the formula, in SI."""
    path = tmp_path / name
    write_table(path, PATH)
    expected = np.column_stack([0.05 * T, 0 * T, 0.05 * T**2])
    for motion in (Motion.from_csv(path), Motion.from_csv(path, units="ms,deg")):
        np.testing.assert_allclose(motion.t, T, atol=1e-15)
        np.testing.assert_allclose(motion.value, expected, atol=1e-15)
        np.testing.assert_allclose(motion.rate[:, [0, 2]].T, [[0.05] * 9, 0.1 * T], atol=1e-12)
        assert motion.warnings == (f'{path}: column "note" is not used',)
        assert motion.sha256 is not None
    for units in ("s", "mm", "m,rad"):
        with pytest.raises(InputError, match="and the units asked for differ; leave out the unit"):
            Motion.from_csv(path, units=units)


def test_a_load_of_one_component_in_its_own_unit(tmp_path):
    write_table(tmp_path / "in.parquet", {"Time (ms)": [0, 1000], "Fz [kN]": [-0.1, 0]})
    load = Load.from_csv(tmp_path / "in.parquet")
    np.testing.assert_allclose(load.at([0.25]), [[0, 0, -75, 0, 0, 0]], atol=1e-12)
    write_table(tmp_path / "in.csv", {"t": [0, 1], "My [N mm]": [500, 500]})
    assert Load.from_csv(tmp_path / "in.csv").wrench[0].tolist() == [0, 0, 0, 0, 0.5, 0]


def test_what_is_not_a_parquet_table_is_refused(tmp_path):
    path = tmp_path / "in.parquet"
    path.write_text("t,x\n0,1\n")
    with pytest.raises(InputError, match=r"in.parquet: cannot be read as Parquet"):
        read_table(path)
    with pytest.raises(InputError, match="no such file"):
        read_table(tmp_path / "im.parquet")
    for columns, message in (
        (
            {"t": [0.0, 1, 2], "x": [1, np.nan, 3]},
            r'in.parquet, column "x", row 2: the cell is',
        ),
        ({"t": [0.0, 1], "x": [1, np.inf]}, r'in.parquet, row 2, column "x": got inf'),
        ({"t": ["a", "b"]}, r'column "t": holds string, expected numbers'),
        ({"t": np.zeros(0)}, "no rows"),
    ):
        write_table(path, columns)
        with pytest.raises(InputError, match=message):
            read_table(path)


def test_units_are_read_in_either_order_and_scale_lengths_and_angles_alone():
    turn = math.pi / 180
    for text, *factors in (
        *(("m,rad", 1, 1), ("mm,deg", 1e-3, turn), (" deg , cm ", 1e-2, turn)),
        *(("mm", 1e-3, 1), ("deg", 1, turn)),
    ):
        assert parse_units(text) == Units(*factors)
    for text, message in (
        *(("mm,degs", '"degs" is not a unit. Did you mean "deg"'), ("", '"" is not a unit')),
        *(("mm,cm", "two units of length"), ("deg,rad", "two units of angle")),
    ):
        with pytest.raises(InputError, match=message):
            parse_units(text)
    units = Units(2.0, 3.0)
    assert {units.scale(name) for name in (*"XYZxyz", "dX", "ddZ", "dx")} == {2.0}
    assert {units.scale(name) for name in ["alpha", "beta", "gamma", "dalpha", "ddgamma"]} == {3.0}
    assert {units.scale(name) for name in ("t", "Fx", "Mz")} == {1.0}


@pytest.mark.parametrize("piece", ["9", "1.234", "x [", " ", "_", " in ", "/", ",", "#", ".5", '"'])
def test_strangers_texts_take_time_in_proportion_to_their_length(piece: str) -> None:
    """In proportion to their square it would take hours."""
    text = piece * (1 << 18)
    for one in (text, f"{text}!", f"x{text}]", f"-{text}e5"):
        assert name_and_unit(one)[0]
        assert not any(form.fullmatch(one) for form in (NUMBER, HINTS[0][0]) if "!" in one)
        with suppress(InputError):
            values_of(one, KNOWN, "load")
