from __future__ import annotations

import numpy as np

from condyle.motion import (
    Load,
    Motion,
    bundled_reference,
    read_table,
    reference_load,
    reference_motion,
    write_reference,
)


def test_the_generator_makes_the_bundled_files(tmp_path):
    """Byte for byte where numpy's power is the one it was made with, else to the last digit."""
    for written, bundled in zip(write_reference(tmp_path), bundled_reference(), strict=True):
        assert written.name == bundled.name
        lines, expected = written.read_text().split("\n"), bundled.read_text().split("\n")
        assert len(lines) == len(expected) == 5003
        assert np.mean([a == b for a, b in zip(lines, expected, strict=True)]) > 0.98
        a, b = read_table(written), read_table(bundled)
        assert a.names == b.names
        np.testing.assert_allclose(a.require(b.names), b.require(b.names), rtol=1e-15, atol=1e-15)


def test_in_memory_and_from_files_are_the_same_motion_and_load():
    motion_file, load_file = bundled_reference()
    made, read = reference_motion(), Motion.from_csv(motion_file)
    np.testing.assert_array_equal(made.t, read.t)
    np.testing.assert_allclose(made.value, read.value, rtol=0, atol=1e-15)
    assert (made.kind, made.landmark, read.landmark) == ("landmark", "incisor", "incisor")
    load, read_load = reference_load(), Load.from_csv(load_file)
    np.testing.assert_allclose(load.at(made.t), read_load.at(made.t), rtol=1e-15)
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


def test_coarse_and_fine_output_of_the_reference_have_the_same_accelerations():
    path = bundled_reference()[0]
    fine, coarse = (Motion.from_csv(path, rate=rate).acceleration for rate in (1000, 200))
    np.testing.assert_allclose(fine[::5], coarse, rtol=0, atol=1e-9 * np.abs(fine).max())
