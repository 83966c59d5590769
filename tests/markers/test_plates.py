"""Force plates: against another library, and a press whose wrench is known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.c3d_file import c3d_bytes
from scipy.spatial.transform import Rotation
from support.recorded_jaw import UPPER, Jaw, record

import condyle
from condyle.errors import InputError
from condyle.markers import motion_from_c3d, read_c3d
from condyle.motion import Load

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


def loaded(jaw: Jaw, path: Path, analog: np.ndarray, units: Any, plates: Any = None) -> Path:
    """The jaw's recording with channels F0, F1, ... in these units."""
    channels = [(f"F{i}", unit) for i, unit in enumerate(units)]
    return jaw.write(path / "a.c3d", channels=channels, analog=analog, plates=plates)


def load_of(jaw: Jaw, path: Path, **forces: Any) -> Load:
    load = motion_from_c3d(path, jaw.tables(forces=forces), "masticatory").load
    assert load is not None
    return load


@pytest.mark.parametrize(("kind", "zero"), [(1, None), (2, (1, 3)), (3, None), (4, None)])
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
    jaw = record(seconds=1.2)
    count = len(jaw.t)
    force = RNG.normal(0, 5, (count, 3)) + np.array([0, 0, 80])
    on = RNG.uniform(-0.1, 0.1, (count, 3)) * [1, 1, 0]
    local = force @ TURN
    below = np.cross(on - [-0.001, -0.002, 0.040], local)  # origin = (1, 2, -40) mm
    below[:, 2] += 0.3  # a free moment, N m
    signals = np.repeat(np.hstack([local, below * 1e3])[:, None], 5, axis=1)
    path = loaded(jaw, tmp_path_factory.mktemp("plate"), signals, UNITS[2], described(2))
    return jaw, path, force, on @ TURN.T + CENTRE / 1e3


def in_base(jaw: Jaw) -> tuple[np.ndarray, np.ndarray]:
    """From the laboratory to {S}, s = R (x - p), from markers whose places in {S} are known."""
    shape = np.array(list(UPPER.values()))
    R, p = [], []
    for seen in jaw.points[:, : len(shape)]:
        turn, _ = Rotation.align_vectors(shape - shape.mean(0), seen - seen.mean(0))
        R.append(turn.as_matrix())
        p.append(seen.mean(0) - R[-1].T @ shape.mean(0))
    return np.array(R), np.array(p)


def turned(R: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("fij,fj->fi", R, vectors)


@pytest.mark.slow
def test_a_press_becomes_its_wrench(pressed: Any) -> None:
    jaw, path, force, place = pressed
    load = load_of(jaw, path, plate=1)
    assert load.point == "right_molar" and load.warnings == ()
    R, p = in_base(jaw)
    want = turned(R, force)
    np.testing.assert_allclose(load.wrench[:, :3], want, atol=1e-3)
    molar = np.array(condyle.load_mechanism("masticatory").platform.points["right_molar"])
    at = Rotation.from_euler("XYZ", jaw.pose[:, 3:]).apply(molar) + jaw.pose[:, :3]
    moment = np.cross(turned(R, place - p) - at, want) + R @ (0.3 * TURN[:, 2])
    np.testing.assert_allclose(load.wrench[:, 3:], moment, atol=1e-3)
    # A named point takes the force alone.
    load = load_of(jaw, path, plate=1, point="incisor", reverse=True, zero=[0.0, 0.5])
    assert load.point == "incisor" and not load.wrench[:, 3:].any()
    want = -turned(R, force - force[jaw.t <= 0.5].mean(axis=0))
    np.testing.assert_allclose(load.wrench[:, :3], want, atol=1e-3)


@pytest.mark.slow
def test_what_files_say_of_their_plates(tmp_path: Path) -> None:
    """FORCE_PLATFORM:ZERO of many files names frames that have a load: nobody subtracts them.
    Sensors may be above their surface, and newtons have several names."""
    jaw = record(seconds=0.8)
    analog = RNG.normal(0, 50, (len(jaw.t), 1, 6))
    wrench = {}
    for zero in ((0, 0), (1, 0), (3, 7)):
        plates = described(2, ZERO=np.array(zero, np.int16))
        load = load_of(jaw, loaded(jaw, tmp_path, analog, UNITS[2], plates), plate=1)
        said = [w for w in load.warnings if "frames 3 to 7 as without load" in w]
        assert len(said) == (zero == (3, 7))
        wrench[zero] = load.wrench
    assert "zero = [0.02, 0.06] in [forces]" in said[0]
    np.testing.assert_array_equal(wrench[0, 0], wrench[3, 7])
    path = loaded(jaw, tmp_path, np.ones_like(analog), UNITS[2], plates)
    load = load_of(jaw, path, plate=1, zero=[0.02, 0.06])
    assert not load.warnings
    np.testing.assert_allclose(load.wrench, 0, atol=1e-9)
    path = loaded(jaw, tmp_path, analog, ["Nt"] * 3 + ["Nt-mm"] * 3, described(2))
    np.testing.assert_array_equal(load_of(jaw, path, plate=1).wrench, wrench[0, 0])
    for sign in (1, -1):
        plates = described(2, ORIGIN=sign * np.array([[1.0, 2.0, -40.0]], np.float32).T)
        path = loaded(jaw, tmp_path, analog, ["N"] * 3 + [""] * 3, plates)
        got = motion_from_c3d(path, jaw.tables(forces={"plate": 1}), "masticatory")
        np.testing.assert_allclose(got.load.wrench, wrench[0, 0], atol=1e-9)
        assert [w for w in got.warnings if "N mm was assumed" in w]
        assert bool([w for w in got.warnings if "turned over" in w]) == (sign < 0)


@pytest.mark.slow
def test_a_sensor_turns_with_what_it_sits_on(tmp_path: Path) -> None:
    jaw = record(seconds=1.2)
    force = RNG.normal(0, 30, (len(jaw.t), 3))
    path = loaded(jaw, tmp_path, force[:, None] / 1e3, ["kN"] * 3)
    R, _ = in_base(jaw)
    # Axes that turn with a body are the laboratory's at home, which is the mean of its stretch.
    home = Rotation.from_matrix(R[jaw.t <= 0.5]).mean().as_matrix()
    want = {
        "laboratory": turned(R, force),
        "fixed": force @ home.T,
        "platform": Rotation.from_euler("XYZ", jaw.pose[:, 3:]).apply(force @ home.T),
    }
    # The mean of turns and the turn of mean places differ in the second order of the head's motion.
    for axes, wrench in want.items():
        load = load_of(jaw, path, channels=["F0", "F1", "F2"], axes=axes)
        assert load.point is None
        np.testing.assert_allclose(load.wrench[:, :3], wrench, atol=0.05)
    got = motion_from_c3d(path, jaw.tables(), "masticatory", force=("f0", "F1", "F2"))
    np.testing.assert_allclose(got.load.wrench[:, :3], want["laboratory"], atol=1e-3)
    for channels, said in (
        (("F0", "F1", "F9"), 'has no channel "F9"'),
        (("F0", "F1"), "got 2 channels, expected three"),
    ):
        with pytest.raises(InputError, match=said):
            motion_from_c3d(path, jaw.tables(), "masticatory", force=channels)
    path = loaded(jaw, tmp_path, force[:, None], ["V", "N", "N"])
    with pytest.raises(InputError, match='channel "F0": "V" is not a unit of force'):
        motion_from_c3d(path, jaw.tables(), "masticatory", force=("F0", "F1", "F2"))


WRONG: list[tuple[Any, Any, str]] = [
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
    (
        {"channels": ["F0", "F1", "F4"]},
        {},
        'channel "F4": "N.mm" is not a unit of force',
    ),
    ({"channels": ["F0", "F1"]}, {}, "labels of three channels, got"),
    ({"channels": "F0"}, {}, "labels of three channels, got 'F0'"),
    ({"channels": ["F0", "F1", "F2"], "plate": 1}, {}, "either channels .* or plate"),
    ({}, {}, "either channels .* or plate"),
    ({"plate": 0}, {}, "number of a force plate, from 1, got 0"),
    ({"plate": True}, {}, "number of a force plate, from 1, got True"),
    ({"plate": 1, "axes": "fixed"}, {}, "a plate stands in the laboratory"),
    ({"channels": ["F0", "F1", "F2"], "axes": "skull"}, {}, "axes"),
    ({"plate": 1, "zero": [1.0, 0.5]}, {}, r"expected \[from, to\]"),
    ({"plate": 1, "reverse": 1}, {}, "reverse"),
]


def test_what_cannot_be(tmp_path: Path) -> None:
    jaw = record(seconds=0.8)
    for forces, plates, said in WRONG:
        told = None if plates is None else described(2, **plates)
        path = loaded(jaw, tmp_path, np.ones((len(jaw.t), 1, 6)), UNITS[2], told)
        with pytest.raises(InputError, match=said) as caught:
            load_of(jaw, path, **forces)
        assert len(str(caught.value).splitlines()) <= 2


def test_frames_without_a_head_or_without_numbers(tmp_path: Path) -> None:
    """Where the head is not seen a load is between its neighbours."""
    jaw = record(seconds=0.8)
    for name in ("Upper_FL", "Upper_BL"):
        jaw.at(name)[40:44] = np.nan
    analog = np.arange(3.0 * len(jaw.t)).reshape(-1, 1, 3)
    channels = {"channels": ["F0", "F1", "F2"]}
    load = load_of(jaw, loaded(jaw, tmp_path, analog, ["N"] * 3), **channels)
    assert len(load.t) == len(jaw.t) - 4
    assert not set(np.round(load.t * 100)) & {40, 41, 42, 43}
    analog[40] = np.nan
    with pytest.raises(InputError, match='channel "F0" has samples that are no numbers'):
        load_of(jaw, loaded(jaw, tmp_path, analog, ["N"] * 3), **channels)
