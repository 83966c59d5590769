"""Force plates: against another library, and a press whose wrench is known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.c3d_file import c3d_bytes
from scipy.spatial.transform import Rotation
from support.recorded_jaw import Jaw, record

import condyle
from condyle.errors import InputError
from condyle.markers import motion_from_c3d, read_c3d

RNG = np.random.default_rng(5)
TURN = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
CENTRE = np.array([100.0, 200.0, 50.0])  # mm
QUADRANTS = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
UNITS = {
    1: ["N"] * 3 + ["mm"] * 2 + ["Nmm"],
    2: ["N"] * 3 + ["N.mm"] * 3,
    3: ["N"] * 8,
    4: ["V"] * 6,
}


def described(kind: int, **changes: Any) -> dict[str, Any]:
    """FORCE_PLATFORM of one plate, 400 by 600 mm, whose sensor is 40 mm below its surface."""
    corners = QUADRANTS * [200, 300, 1] @ TURN.T + CENTRE
    origin = [120.0, 200.0, -40.0] if kind == 3 else [1.0, 2.0, -40.0]
    found = {
        "USED": np.int16(1),
        "TYPE": np.array([kind], np.int16),
        "CORNERS": corners.T[:, :, None].astype(np.float32),
        "ORIGIN": np.array(origin, np.float32)[:, None],
        "CHANNEL": np.arange(1, len(UNITS[kind]) + 1, dtype=np.int16)[:, None],
    }
    if kind == 4:
        matrix = np.random.default_rng(6).normal(0, 1, (6, 6))
        found["CAL_MATRIX"] = matrix[:, :, None].astype(np.float32)
    return found | changes


@pytest.mark.parametrize("zero", [None, (1, 3)])
@pytest.mark.parametrize("kind", [1, 2, 3, 4])
def test_wrenches_are_those_of_another_library(
    tmp_path: Path, kind: int, zero: tuple[int, int] | None
) -> None:
    """Which subtracts nothing for FORCE_PLATFORM:ZERO."""
    import ezc3d

    from condyle.markers.forces import _plate, _wrench

    units = UNITS[kind]
    analog = RNG.normal(0, 50, (6, 4, len(units)))
    channels = [(f"c{i}", unit) for i, unit in enumerate(units)]
    content = c3d_bytes(
        ["a", "b", "c"],
        RNG.normal(0, 300, (6, 3, 3)),
        channels=channels,
        analog=analog,
        plates=described(kind) | ({} if zero is None else {"ZERO": np.array(zero, np.int16)}),
    )
    path = tmp_path / "plate.c3d"
    path.write_bytes(content)
    plate, assumed = _plate(read_c3d(path), 1)
    force, moment = _wrench(read_c3d(path), plate)
    other = ezc3d.c3d(str(path), extract_forceplat_data=True)["data"]["platform"][0]
    shape = 6, 4, 3
    assert assumed == ()
    np.testing.assert_allclose(force @ plate.axes.T, other["force"].T.reshape(shape), atol=1e-5)
    # Of type 1 alone that library takes f x r, and turns its free moment over.
    want = other["moment"].T.reshape(shape) / 1e3 * (-1 if kind == 1 else 1)
    np.testing.assert_allclose(moment @ plate.axes.T, want, atol=1e-5)
    # Where the force's line meets the surface, and the moment left over there.
    at = np.stack([-moment[..., 1], moment[..., 0], 0 * force[..., 0]], -1) / force[..., 2:]
    pressed = other["center_of_pressure"].T.reshape(shape) / 1e3
    np.testing.assert_allclose(at @ plate.axes.T + plate.centre, pressed, atol=1e-6)
    free = other["Tz"].T.reshape(shape) / 1e3
    np.testing.assert_allclose((moment - np.cross(at, force)) @ plate.axes.T, free, atol=1e-4)


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Jaw, Path, np.ndarray, np.ndarray]:
    """A jaw that presses on a plate; the force on the jaw [N] and where [m], (F, 3) in the
    laboratory."""
    jaw = record()
    n, count = 5, len(jaw.t)
    force = RNG.normal(0, 5, (count, 3)) + np.array([0, 0, 80])
    axes = TURN
    on = RNG.uniform(-0.1, 0.1, (count, 3)) * [1, 1, 0]
    place = on @ axes.T + CENTRE / 1e3
    local = force @ axes
    below = np.cross(on - [-0.001, -0.002, 0.040], local)  # origin = (1, 2, -40) mm
    below[:, 2] += 0.3  # a free moment, N m
    signals = np.repeat(np.hstack([local, below * 1e3])[:, None], n, axis=1)
    path = tmp_path_factory.mktemp("plate") / "a.c3d"
    channels = [(f"F{i}", unit) for i, unit in enumerate(UNITS[2])]
    jaw.write(path, channels=channels, analog=signals, plates=described(2))
    return jaw, path, force, place


def in_base(jaw: Jaw, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """From the laboratory to {S}, s = R (x - p), from markers whose places in {S} are known."""
    from support.recorded_jaw import UPPER

    shape = np.array(list(UPPER.values()))
    R, p = [], []
    for seen in jaw.points[:, : len(shape)]:
        turn, _ = Rotation.align_vectors(shape - shape.mean(0), seen - seen.mean(0))
        R.append(turn.as_matrix())
        p.append(seen.mean(0) - R[-1].T @ shape.mean(0))
    return np.array(R), np.array(p)


def test_a_press_becomes_its_wrench(pressed: Any) -> None:
    jaw, path, force, place = pressed
    load = motion_from_c3d(path, jaw.tables(forces={"plate": 1}), "masticatory").load
    assert load is not None and load.point == "right_molar" and load.warnings == ()
    R, p = in_base(jaw, path)
    want = np.einsum("fij,fj->fi", R, force)
    np.testing.assert_allclose(load.wrench[:, :3], want, atol=1e-3)
    molar = np.array(condyle.load_mechanism("masticatory").platform.points["right_molar"])
    at = Rotation.from_euler("XYZ", jaw.pose[:, 3:]).apply(molar) + jaw.pose[:, :3]
    free = np.einsum("fij,j->fi", R, 0.3 * TURN[:, 2])
    arm = np.einsum("fij,fj->fi", R, place - p) - at
    np.testing.assert_allclose(load.wrench[:, 3:], np.cross(arm, want) + free, atol=1e-3)


def test_frames_without_load_are_named(tmp_path: Path) -> None:
    """FORCE_PLATFORM:ZERO of many files names frames that have a load: nobody subtracts them."""
    jaw = record(seconds=0.8)
    analog = np.ones((len(jaw.t), 1, 6))
    channels = [(f"F{i}", unit) for i, unit in enumerate(UNITS[2])]
    loads = []
    for zero in ((0, 0), (1, 0), (3, 7)):
        plates = described(2, ZERO=np.array(zero, np.int16))
        jaw.write(tmp_path / "a.c3d", channels=channels, analog=analog, plates=plates)
        tables = jaw.tables(forces={"plate": 1})
        load = motion_from_c3d(tmp_path / "a.c3d", tables, "masticatory").load
        assert load is not None
        said = [w for w in load.warnings if "frames 3 to 7 as without load" in w]
        assert len(said) == (zero == (3, 7))
        loads.append(load.wrench)
    assert "zero = [0.02, 0.06] in [forces]" in said[0]
    np.testing.assert_array_equal(loads[0], loads[2])
    tables = jaw.tables(forces={"plate": 1, "zero": [0.02, 0.06]})
    load = motion_from_c3d(tmp_path / "a.c3d", tables, "masticatory").load
    assert load is not None and not load.warnings
    np.testing.assert_allclose(load.wrench, 0, atol=1e-9)


def test_a_named_point_takes_the_force_alone(pressed: Any) -> None:
    jaw, path, force, _ = pressed
    table = {"plate": 1, "point": "incisor", "reverse": True, "zero": [0.0, 0.5]}
    load = motion_from_c3d(path, jaw.tables(forces=table), "masticatory").load
    assert load is not None and load.point == "incisor" and not load.wrench[:, 3:].any()
    R, _ = in_base(jaw, path)
    rest = force[jaw.t <= 0.5].mean(axis=0)
    want = -np.einsum("fij,fj->fi", R, force - rest)
    np.testing.assert_allclose(load.wrench[:, :3], want, atol=1e-3)


@pytest.mark.parametrize("axes", ["laboratory", "fixed", "platform"])
def test_a_sensor_turns_with_what_it_sits_on(tmp_path: Path, axes: str) -> None:
    jaw = record()
    force = RNG.normal(0, 30, (len(jaw.t), 3))
    channels = [(f"F{i}", "kN") for i in range(3)]
    jaw.write(tmp_path / "a.c3d", channels=channels, analog=force[:, None] / 1e3)
    tables = jaw.tables(forces={"channels": ["F0", "F1", "F2"], "axes": axes})
    load = motion_from_c3d(tmp_path / "a.c3d", tables, "masticatory").load
    assert load is not None and load.point is None
    R, _ = in_base(jaw, tmp_path / "a.c3d")
    # Axes that turn with a body are the laboratory's at home, which is the mean of its stretch.
    home = Rotation.from_matrix(R[jaw.t <= 0.5]).mean().as_matrix()
    want = {
        "laboratory": np.einsum("fij,fj->fi", R, force),
        "fixed": force @ home.T,
        "platform": Rotation.from_euler("XYZ", jaw.pose[:, 3:]).apply(force @ home.T),
    }[axes]
    # The mean of turns and the turn of mean places differ in the second order of the head's motion.
    np.testing.assert_allclose(load.wrench[:, :3], want, atol=0.05)


def test_a_sensor_above_its_surface_is_turned_over(tmp_path: Path) -> None:
    jaw = record(seconds=0.8)
    channels = [(f"F{i}", unit) for i, unit in enumerate(["N"] * 3 + [""] * 3)]
    analog = RNG.normal(0, 50, (len(jaw.t), 1, 6))
    loads = []
    for sign in (1, -1):
        origin = sign * np.array([[1.0, 2.0, -40.0]], np.float32).T
        plates = described(2, ORIGIN=origin)
        jaw.write(tmp_path / "a.c3d", channels=channels, analog=analog, plates=plates)
        got = motion_from_c3d(tmp_path / "a.c3d", jaw.tables(forces={"plate": 1}), "masticatory")
        loads.append(got.load.wrench)
        assert [w for w in got.warnings if "N mm was assumed" in w]
        assert bool([w for w in got.warnings if "turned over" in w]) == (sign < 0)
    np.testing.assert_allclose(*loads, atol=1e-9)


def test_newtons_as_laboratories_write_them(tmp_path: Path) -> None:
    jaw = record(seconds=0.8)
    analog = RNG.normal(0, 50, (len(jaw.t), 1, 6))
    loads = []
    for names in (UNITS[2], ["Nt"] * 3 + ["Nt-mm"] * 3):
        channels = [(f"F{i}", unit) for i, unit in enumerate(names)]
        jaw.write(tmp_path / "a.c3d", channels=channels, analog=analog, plates=described(2))
        tables = jaw.tables(forces={"plate": 1})
        loads.append(motion_from_c3d(tmp_path / "a.c3d", tables, "masticatory").load.wrench)
    np.testing.assert_array_equal(*loads)


@pytest.mark.parametrize(
    ("forces", "plates", "said"),
    [
        ({"plate": 2}, {}, "plate 2 asked for, and it has 1"),
        ({"plate": 1}, None, r"has no force plate \(FORCE_PLATFORM:USED\); name three channels"),
        ({"plate": 1}, {"TYPE": np.array([7], np.int16)}, "type 7, expected 1, 2, 3, 4"),
        ({"plate": 1}, {"CHANNEL": np.array([[1], [2]], np.int16)}, "names 1, 2"),
        ({"plate": 1}, {"CHANNEL": np.arange(5, 11, dtype=np.int16)[:, None]}, "names 5, 6, 7"),
        ({"plate": 1}, {"CORNERS": np.zeros((3, 4, 1), np.float32)}, "span no surface"),
        ({"plate": 1}, {"TYPE": np.array([4], np.int16)}, "CAL_MATRIX"),
        ({"plate": 1, "point": "incisr"}, {}, '"incisr". Did you mean "incisor"'),
        ({"plate": 1, "zero": [9.0, 10.0]}, {}, "no frame from 9 to 10 s; it runs from 0 to 0.79"),
        ({"channels": ["F0", "F1", "F9"]}, {}, 'forces: has no channel "F9".*Available: F0, F1'),
        ({"channels": ["F0", "F1", "F4"]}, {}, 'channel "F4" is in N.mm; a force is in N, kN'),
        ({"channels": ["F0", "F1"]}, {}, "labels of three channels, got"),
        ({"channels": ["F0", "F1", "F1"]}, {}, "labels of three channels, got"),
        ({"channels": "F0"}, {}, "labels of three channels, got 'F0'"),
        ({"channels": ["F0", "F1", "F2"], "plate": 1}, {}, "either channels .* or plate"),
        ({}, {}, "either channels .* or plate"),
        ({"plate": 0}, {}, "number of a force plate, from 1, got 0"),
        ({"plate": "1"}, {}, "number of a force plate, from 1, got '1'"),
        ({"plate": True}, {}, "number of a force plate, from 1, got True"),
        ({"plate": 1, "axes": "fixed"}, {}, "a plate stands in the laboratory"),
        ({"channels": ["F0", "F1", "F2"], "axes": "skull"}, {}, "axes"),
        ({"plate": 1, "zero": [1.0, 0.5]}, {}, r"expected \[from, to\]"),
        ({"plate": 1, "reverse": 1}, {}, "reverse"),
        ({"plate": 1, "sign": -1}, {}, "sign"),
    ],
)
def test_what_cannot_be(tmp_path: Path, forces: Any, plates: Any, said: str) -> None:
    jaw = record(seconds=0.8)
    channels = [(f"F{i}", unit) for i, unit in enumerate(UNITS[2])]
    analog = np.ones((len(jaw.t), 1, 6))
    told = None if plates is None else described(2, **plates)
    jaw.write(tmp_path / "a.c3d", channels=channels, analog=analog, plates=told)
    with pytest.raises(InputError, match=said) as caught:
        motion_from_c3d(tmp_path / "a.c3d", jaw.tables(forces=forces), "masticatory")
    assert len(str(caught.value).splitlines()) <= 2


def test_samples_that_are_no_numbers(tmp_path: Path) -> None:
    jaw = record(seconds=0.8)
    analog = np.ones((len(jaw.t), 1, 3))
    analog[40] = np.nan
    jaw.write(tmp_path / "a.c3d", channels=[(f"F{i}", "N") for i in range(3)], analog=analog)
    with pytest.raises(InputError, match='channel "F0" has samples that are no numbers'):
        motion_from_c3d(tmp_path / "a.c3d", jaw.tables(), "masticatory", force=("F0", "F1", "F2"))


def test_where_the_head_is_not_seen_a_load_is_between_its_neighbours(tmp_path: Path) -> None:
    jaw = record(seconds=0.8)
    for name in ("Upper_FL", "Upper_BL"):
        jaw.at(name)[40:44] = np.nan
    analog = np.arange(3.0 * len(jaw.t)).reshape(-1, 1, 3)
    jaw.write(tmp_path / "a.c3d", channels=[(f"F{i}", "N") for i in range(3)], analog=analog)
    load = motion_from_c3d(
        tmp_path / "a.c3d", jaw.tables(), "masticatory", force=("F0", "F1", "F2")
    ).load
    assert load is not None and len(load.t) == len(jaw.t) - 4
    assert not set(np.round(load.t * 100)) & {40, 41, 42, 43}
