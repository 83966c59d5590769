"""Numbers that no machine makes are warned of; those of machines are not."""

from __future__ import annotations

import numpy as np
import pytest

from condyle.errors import InputError
from condyle.motion import (
    Load,
    Motion,
    reference_load,
    reference_motion,
    resolve_landmark,
    resolve_load_point,
)
from condyle.motion import memory as memory_module

T = np.linspace(0, 2, 2001)
CHEW = 0.015 * np.sin(2 * np.pi * T)


def said(t=T, **columns):
    return Motion.from_arrays(t, columns).warnings


def test_what_machines_do_is_not_warned_of():
    assert said(X=CHEW, beta=0.3 * np.sin(T)) == ()
    assert said(X=1.2 * np.sin(T)) == ()
    assert said(t=np.arange(50.0), X=np.zeros(50)) == ()  # few and slow
    assert said(t=np.arange(500.0), X=np.sin(np.arange(500.0))) == ()  # slow steps, but it moves
    assert reference_motion().warnings == () and reference_load().warnings == ()


def test_times_in_milliseconds():
    [warning] = said(t=1e3 * T, X=CHEW)
    assert "2001 rows in steps of 1 s, 2000 s in all; if t is in milliseconds" in warning
    assert Motion.from_arrays(1e3 * T, {"X": CHEW}, units="ms").warnings == ()
    [warning] = Load.from_arrays(1e3 * T, np.zeros((2001, 3))).warnings
    assert 'name the column "t [ms]"' in warning


def test_lengths_in_millimetres_and_angles_in_degrees():
    assert "X goes over 30 m; if lengths are in mm, say --units mm" in said(X=1e3 * CHEW)[0]
    assert "beta reaches 20 rad, more than a turn" in said(beta=20 * np.sin(T))[0]
    assert "X moves at 9425 m/s, faster than sound" in said(X=1e5 * CHEW)[0]


def test_forces_of_ships():
    assert Load.from_arrays([0, 1], [[0, 0, 2e6]] * 2).warnings[0].startswith("load: reaches 2e+06")
    assert Load.from_arrays([0, 1], [[0, 0, 900.0]] * 2).warnings == ()


@pytest.mark.parametrize(
    ("resolve", "default"), [(resolve_landmark, "incisor"), (resolve_load_point, "right_molar")]
)
def test_the_point_that_is_meant(resolve, default):
    points = {"tip": [0, 0, 0], default: [1, 0, 0]}
    assert resolve(None, points) == default and resolve("tip", points) == "tip"
    assert resolve(None, ["tip"]) == "tip"
    with pytest.raises(InputError, match=r'2 points; choose one of "a", "b" with --l'):
        resolve(None, ["a", "b"])
    with pytest.raises(InputError, match=r"no points; give it some in platform\.points"):
        resolve(None, [])
    with pytest.raises(InputError, match=r'no l.* "tap". Did you mean "tip"'):
        resolve("tap", points)


def test_a_rate_is_refused_by_the_memory_at_hand(monkeypatch):
    monkeypatch.setattr("condyle.motion.path.memory_at_hand", lambda: 3_000_000)
    assert len(Motion.from_arrays(T, {"X": CHEW}, rate=450)) == 901
    with pytest.raises(InputError, match=r"1.2e\+03 samples, .* about 0.0036 GB .there are 0.003"):
        Motion.from_arrays(T, {"X": CHEW}, rate=600)


def test_memory_is_what_the_system_says(monkeypatch):
    assert 1 << 20 < memory_module.memory_at_hand() < 1 << 50

    def refuse(*_, **__):
        raise OSError

    monkeypatch.setattr("builtins.open", refuse)
    assert 1 << 20 < memory_module.memory_at_hand() < 1 << 50
    monkeypatch.setattr("os.sysconf", refuse)
    assert memory_module.memory_at_hand() == 8 << 30


def test_arrays_of_six_are_force_and_moment_and_transposes_are_named():
    load = Load.from_arrays([0, 1], np.tile(np.arange(6.0), (2, 1)))
    assert load.wrench[1].tolist() == [0, 1, 2, 3, 4, 5]
    with pytest.raises(InputError, match=r"\(2, 3\): Fx, Fy, Fz; give its transpose"):
        Load.from_arrays([0, 1], np.zeros((3, 2)))
