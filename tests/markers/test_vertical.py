"""Gravity and the head's motion, from the recording: against the head that was put into it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.c3d_file import c3d_bytes
from support.machines import model
from support.recorded_jaw import Jaw, head_at, record

import condyle
from condyle.errors import InputError
from condyle.markers import MarkerMotion, motion_from_c3d, read_c3d, write_motion
from condyle.motion import Motion

STEP = 1e-3  # s, of differences


def measured(jaw: Jaw, folder: Path, **vertical: Any) -> MarkerMotion:
    tables = jaw.tables(vertical=vertical)
    return motion_from_c3d(jaw.write(folder / "a.c3d"), tables, "masticatory")


def truth(jaw: Jaw, up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gravity (F, 3) and the base's motion (F, 9), by central differences of fourth order."""

    def head(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        H, h = head_at(t)
        return H @ jaw.A, H @ jaw.b + h

    def first(of: Any, t: np.ndarray) -> Any:
        a, b, c, d = (of(t + k * STEP) for k in (-2, -1, 1, 2))
        return (a - 8 * b + 8 * c - d) / (12 * STEP)

    def spin(t: np.ndarray) -> np.ndarray:
        S = head(t)[0].transpose(0, 2, 1) @ first(lambda x: head(x)[0], t)
        return np.column_stack([S[:, 2, 1], S[:, 0, 2], S[:, 1, 0]])

    W = head(jaw.t)[0].transpose(0, 2, 1)
    a = first(lambda x: first(lambda y: head(y)[1], x), jaw.t)
    base = [np.einsum("fij,fj->fi", W, a), spin(jaw.t), first(spin, jaw.t)]
    return -9.81 * W @ up / np.linalg.norm(up), np.hstack(base)


def test_gravity_and_the_head_come_back(tmp_path: Path) -> None:
    jaw, up = record(seconds=3.0), np.array([0.3, -0.2, 2.0])
    got = measured(jaw, tmp_path, up=up.tolist())
    gravity, base = truth(jaw, up)
    assert got.motion.gravity is not None and got.motion.base is not None
    np.testing.assert_allclose(got.motion.gravity, gravity, atol=2e-4)
    inner = slice(60, -60)  # a smoothed motion is least accurate at its ends
    np.testing.assert_allclose(got.motion.base[inner], base[inner], atol=3e-3)
    np.testing.assert_allclose(np.linalg.norm(got.motion.gravity, axis=1), 9.81, rtol=1e-12)
    down = np.arccos(gravity @ [0, 0, -1] / 9.81)
    np.testing.assert_allclose(got.vertical.tilt, down, atol=1e-4)
    text = str(got)
    assert "Gravity in {S}: on average (" in text and "Motion of the base, in the motion" in text


def test_gravity_without_the_heads_motion_reaches_files_and_solutions(tmp_path: Path) -> None:
    jaw = record(seconds=1.2)
    got = measured(jaw, tmp_path, moving=False)
    assert got.motion.base is None and got.motion.gravity is not None
    assert "left out (moving = false)" in str(got)
    files = write_motion(got, tmp_path / "m.csv")
    back = Motion.from_csv(files[0])
    np.testing.assert_allclose(back.gravity, got.motion.gravity, rtol=1e-12)
    solved = model("masticatory").solve(got.motion)
    np.testing.assert_allclose(solved["gravity"].values, got.motion.gravity, rtol=1e-12)


def test_noise_of_markers_stays_small(tmp_path: Path) -> None:
    """A head at rest, 0.2 mm: below 2 % of gravity on average."""
    jaw = record(noise=2e-4, head=0.0, seconds=4.0)
    got = measured(jaw, tmp_path, up=jaw.A[:, 2].tolist())
    data = got.vertical.data()
    assert data["base_acceleration"]["rms"] < 0.2 and data["tilt"]["largest"] < 0.02
    assert data["inertia_force"]["rms"] == pytest.approx(
        data["base_acceleration"]["rms"] * condyle.load_mechanism("masticatory").platform.mass
    )


def test_the_recordings_own_vertical(tmp_path: Path) -> None:
    """Z, or the axis that the file draws upwards; a mechanism on its side is said, one on its head
    refused."""
    jaw = record(seconds=1.0)
    path = tmp_path / "a.c3d"
    down = (-jaw.A[:, 2]).round(3).tolist()
    said = r"upwards: vertical\.up = .* has the wrong sign\. .* write up = \["
    with pytest.raises(InputError, match=said + f"{-down[0]:g}"):
        measured(jaw, tmp_path, up=down)
    for screen, up in ((None, [0, 0, 1]), ("+Y", [0, 1, 0]), ("-X", [-1, 0, 0]), ("Z", [0, 0, 1])):
        path.write_bytes(c3d_bytes(jaw.labels, jaw.points * 1e3, y_screen=screen))
        assert read_c3d(path).up == tuple(up)
        got = motion_from_c3d(path, jaw.tables(vertical={}), "masticatory")
        W = head_at(jaw.t)[0] @ jaw.A
        want = -9.81 * W.transpose(0, 2, 1) @ np.array(up, dtype=float)
        np.testing.assert_allclose(got.motion.gravity, want, atol=2e-3)
        tilted = np.arccos(want @ [0, 0, -1] / 9.81).mean() > np.radians(60)
        assert any("vertical.up" in said for said in got.warnings) == tilted
