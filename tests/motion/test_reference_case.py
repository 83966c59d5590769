"""The reference motion and load, and the motion for mechanisms that nobody measured."""

from __future__ import annotations

import numpy as np
import pytest
from support.machines import model
from support.speeds import few

import condyle
from condyle.mechanism.home import independent_coordinates
from condyle.motion import (
    Load,
    Motion,
    bundled_reference,
    read_table,
    reference_load,
    reference_motion,
    write_reference,
)


def test_the_bundled_files_are_what_their_formulas_say():
    """To rounding, which the terms of w, up to 540, magnify."""
    motion_file, load_file = bundled_reference()
    motion, load = read_table(motion_file), read_table(load_file)
    assert motion.rows == load.rows == 5001
    u = motion.require(["t"])[:, 0] - 1
    s = np.clip(u / 0.5, 0, 1)
    w = s**5 * (126 - 420 * s + 540 * s**2 - 315 * s**3 + 70 * s**4)
    phase = 2 * np.pi * u / 0.8
    opening = w * (1 - np.cos(phase)) / 2
    path = np.column_stack([-0.00255 * opening, 0.002 * w * np.sin(phase), -0.015 * opening])
    np.testing.assert_allclose(motion.require(["x", "y", "z"]), path, rtol=0, atol=2e-15)
    down = np.zeros(5001)
    for cycle in range(5):
        v = u - (0.8 * cycle + 0.5)
        inside = (v > 0) & (v < 0.25)
        down[inside] = -(100 - 10 * cycle) * np.sin(np.pi * v[inside] / 0.25) ** 2
    force = np.column_stack([-0.1 * down, 0.15 * down, down])
    np.testing.assert_allclose(load.require(["Fx", "Fy", "Fz"]), force, rtol=0, atol=1e-11)


def test_written_and_in_memory_they_are_what_the_files_say(tmp_path):
    motion_file, load_file = bundled_reference()
    for written, bundled in zip(write_reference(tmp_path), (motion_file, load_file), strict=True):
        assert written.name == bundled.name and written.read_bytes() == bundled.read_bytes()
    made, read = reference_motion(), Motion.from_csv(motion_file)
    np.testing.assert_array_equal(made.value, read.value)
    assert (made.kind, made.landmark, read.landmark) == ("landmark", "incisor", None)
    load, read_load = reference_load(), Load.from_csv(load_file)
    np.testing.assert_array_equal(load.wrench, read_load.wrench)
    assert load.point == "right_molar"


def test_it_rests_chews_and_bites_five_times_and_says_that_it_is_synthetic():
    motion, load = reference_motion(), reference_load()
    rest = motion.t < 0.999
    assert np.abs(motion.acceleration[rest]).max() < 1e-10
    x, y, z = motion.value.T
    np.testing.assert_allclose([z.min(), np.ptp(y)], [-0.015, 0.004])
    np.testing.assert_allclose(x, 0.17 * z, atol=1e-17)  # in one plane, seen from the side
    bites = load.wrench[:, 2] < 0
    assert np.count_nonzero(np.diff(bites.astype(int)) == 1) == 5
    assert load.wrench[:, 2].min() == -100
    assert "synthetic" in motion.source and "synthetic" in load.source


@pytest.mark.parametrize("name", few(condyle.bundled_mechanisms(), "gough-stewart", "human-jaw"))
def test_every_bundled_mechanism_follows_it(name: str) -> None:
    """From rest; everything moves."""
    mechanism = condyle.load_mechanism(name)
    motion = condyle.trial_motion(mechanism, rate=5)
    assert motion.names == tuple(independent_coordinates(mechanism)) and len(motion) == 26
    for of in (motion.value, motion.rate, motion.acceleration):
        np.testing.assert_allclose(of[0], 0, atol=1e-6)
    assert (np.ptp(motion.value, axis=0) > 1e-4).all()
    # No two coordinates move alike.
    assert np.linalg.matrix_rank(motion.value, tol=1e-5) == len(motion.names)
    solution = model(name, "interpreted").solve(motion, flag=True)
    held = np.isfinite(solution["effort"].values).all(axis=1)
    # The muscles of half a jaw cannot hold it in every pose near home.
    assert held.mean() > 0.5 if name == "human-jaw-resected" else held.all()
