"""Files of the Jaw Tracking System: poses come back, and hostile files are refused."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.recorded_jaw import record

import condyle
from condyle.errors import InputError
from condyle.markers import MarkerMotion, SessionFile, motion_from_c3d
from condyle.markers.marker_motion import MovedPlaces, with_moved_places
from condyle.markers.recorded_tables import read_recording

AXES = "OXYZ"
JAW = record(seconds=2.0, head=0.0)
# Where the frame of the lower teeth is at home in the frame that the poses are in, as in {S}.
PLACE, TURN = np.array([0.09, 0.0, -0.04]), Rotation.from_rotvec([0.2, -0.4, 1.0])


def poses() -> tuple[np.ndarray, Rotation]:
    """Origin [m] and rotation of the lower teeth's frame over time."""
    turn = Rotation.from_euler("XYZ", JAW.pose[:, 3:])
    return turn.apply(PLACE) + JAW.pose[:, :3], turn * TURN


def write(path: Path, quaternions: bool = True, unit: str = "mm", **datasets: Any) -> Path:
    """As `store_transformations` of jts.helper 1.1.1 writes it."""
    origin, turn = poses()
    with h5py.File(path, "w") as file:
        file.attrs["jts_version"] = "1.1.1"
        group = file.create_group("T_0")
        group.attrs["metadata"] = "lower teeth in upper teeth"
        group.attrs["sample_rate"], group.attrs["unit"] = 100.0, unit
        rotations = turn.as_quat(scalar_first=True) if quaternions else turn.as_matrix()
        factor = {"mm": 1e3, "m": 1.0}[unit]
        given = {"translations": origin * factor, "rotations": rotations} | datasets
        for name, data in given.items():
            group.create_dataset(name, data=data)
    return path


def motion(path: Path, **changes: Any) -> MarkerMotion:
    machine = condyle.load_mechanism("masticatory")
    points = {c.name: c.point for c in machine.contacts} | dict(machine.platform.points)
    tables = {
        "fixed": [f"base_{axis}" for axis in AXES],
        "platform": [f"T_0_{axis}" for axis in AXES],
        "home": [0.0, 0.5],
        "register": {
            n: [1e3 * x for x in points[n]] for n in ("incisor", "left_condyle", "right_condyle")
        },
    }
    return motion_from_c3d(path, tables | changes, machine)


@pytest.mark.parametrize("quaternions", [True, False])
def test_poses_come_back(tmp_path: Path, quaternions: bool) -> None:
    path = write(tmp_path / "jaw.h5", quaternions)
    found = motion(path)
    np.testing.assert_allclose(found.free, JAW.pose, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.motion.value, JAW.pose, rtol=0, atol=1e-9)
    recording, (origin, turn) = read_recording(path), poses()
    places = {n: recording.points[:, i] for i, n in enumerate(recording.labels)}
    np.testing.assert_allclose(places["T_0_O"], origin, atol=1e-12)
    frame = np.stack([places[f"T_0_{axis}"] - origin for axis in "XYZ"], axis=-1) / 0.05
    np.testing.assert_allclose(frame, turn.as_matrix(), atol=1e-12)
    assert (
        recording.rate == 100.0 and recording.unit == "mm" and not np.ptp(places["base_X"], 0).any()
    )


def test_units_and_frames_that_are_not_seen(tmp_path: Path) -> None:
    origin, _ = poses()
    origin[80:85] = np.nan
    found = motion(write(tmp_path / "a.hdf5", unit="m", translations=origin), register={
        "incisor": "T_0_O", "left_condyle": "T_0_X", "right_condyle": "T_0_Y"
    })  # fmt: skip
    assert len(found.gaps) == 1 and found.recording.unit == "m"
    assert (found.measured == np.isfinite(origin).all(axis=1)).all()


def test_bands_draw_the_precision_of_places_and_of_turns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each as a draw of its own; a turn keeps the distances of the points."""
    path = write(tmp_path / "jaw.h5")
    variants = import_module("condyle.analysis.session.session_variants")
    tables: dict[str, Any] = {
        "mechanism": "masticatory",
        "fixed": [f"base_{axis}" for axis in AXES],
        "platform": [f"T_0_{axis}" for axis in AXES],
        "home": [0.0, 0.5],
        "register": {"incisor": "T_0_O", "left_condyle": "T_0_X", "right_condyle": "T_0_Y"},
        "trial": [{"file": str(path)}],
        "bands": {"registrations": 400},
    }
    file = SessionFile.model_validate(tables)
    drawn: list[MovedPlaces] = []
    monkeypatch.setattr(variants, "subject_of", lambda _, moved: drawn.append(moved))
    variants.session_variants(SimpleNamespace(file=file), None, None, None)
    offsets = [x for one in drawn for place in one.offsets.values() for x in place]
    assert np.std(offsets) == pytest.approx(0.18e-3, rel=0.1)
    turns = np.array([one.turn for one in drawn])
    assert np.std(turns, axis=0) == pytest.approx(np.radians(0.13), rel=0.2)
    still = MovedPlaces(dict.fromkeys(file.places, np.zeros(3)), np.array([0.0, 0.0, 0.1]))
    recording = read_recording(path)
    moved = with_moved_places(file, recording, None, still).places
    plain = with_moved_places(file, recording, None, MovedPlaces(still.offsets)).places
    was, now = (np.array([*places.values()]) for places in (plain, moved))
    np.testing.assert_allclose(now.mean(axis=0), was.mean(axis=0), atol=1e-12)
    turned = Rotation.from_rotvec(still.turn).apply(was - was.mean(axis=0))
    np.testing.assert_allclose(now - now.mean(axis=0), turned, atol=1e-12)
    given = SessionFile.model_validate(tables | {"bands": {"registrations": 1, "error": 1e-3}})
    assert (given.error, given.turn_error) == (1e-3, 0.0)


def test_the_package_itself(tmp_path: Path) -> None:
    helper = pytest.importorskip("jts.helper", reason="jaw-tracking-system is not installed")
    origin, turn = poses()
    T = np.tile(np.eye(4), (len(origin), 1, 1))
    T[:, :3, 3], T[:, :3, :3] = origin * 1e3, turn.as_matrix()
    for k, quaternions in enumerate((True, False)):
        path = tmp_path / f"{k}.h5"
        helper.store_transformations(
            [T], [100.0], str(path), ["lower teeth"], store_as_quaternion=quaternions,
            derivative_order=1,
        )  # fmt: skip
        np.testing.assert_allclose(motion(path).free, JAW.pose, rtol=0, atol=1e-12)


def bomb(file: h5py.File) -> None:
    del file["T_0/translations"]
    file["T_0"].create_dataset(
        "translations", (5_000_000, 3), "f8", chunks=(5_000_000, 3), compression="gzip"
    )


def outside(file: h5py.File) -> None:
    del file["T_0/translations"]
    file["T_0/translations"] = h5py.ExternalLink("other.h5", "/T_0/translations")


def virtual(file: h5py.File) -> None:
    del file["T_0/rotations"]
    layout = h5py.VirtualLayout((200, 4), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", (200, 4))
    file["T_0"].create_virtual_dataset("rotations", layout)


def second(file: h5py.File) -> None:
    file.copy("T_0", "T_1")
    file["T_1"].attrs["sample_rate"] = 50.0


def soft(file: h5py.File) -> None:
    file["again"] = h5py.SoftLink("/T_0")


def doubled(file: h5py.File) -> None:
    file["T_0/rotations"][:] *= 2


def renamed(key: str, value: Any) -> Callable[[h5py.File], None]:
    def spoil(file: h5py.File) -> None:
        del file["T_0"].attrs[key]
        if value is not None:
            file["T_0"].attrs[key] = value

    return spoil


def integers(file: h5py.File) -> None:
    del file["T_0/translations"]
    file["T_0/translations"] = np.zeros((200, 3), dtype=int)


def distant(file: h5py.File) -> None:
    file["T_0/translations"][3] = 1e300


def shorter(file: h5py.File) -> None:
    del file["T_0/translations"]
    file["T_0/translations"] = np.zeros((100, 3))


@pytest.mark.parametrize(
    ("spoil", "text"),
    [
        (bomb, "damaged|stand for|takes|limit"), (outside, "is missing, or a link"),
        (virtual, "stored in another file"), (second, "different rates"), (soft, "is a link"),
        (doubled, "frame 1 is no quaternion of length 1"), (integers, "no decimal numbers"),
        (shorter, "different frames"), (distant, "farther than 100000 m away"),
        (lambda file: file.pop("T_0"), "holds no frame over time"),
        (renamed("unit", "furlong"), "unit of length"), (renamed("unit", 3.0), "expected text"),
        (renamed("unit", "m" * (1 << 21)), "unit of length"),
        (renamed("sample_rate", None), 'attribute "sample_rate" is missing'),
        (renamed("sample_rate", "fast"), "expected a number"),
        (renamed("sample_rate", [1.0, 2.0]), "expected a number"),
        (renamed("sample_rate", float("nan")), "got a rate of nan"),
        (renamed("sample_rate", 0.0), "got a rate of 0"),
    ],
)  # fmt: skip
def test_hostile_files(tmp_path: Path, spoil: Callable[[h5py.File], Any], text: str) -> None:
    path = write(tmp_path / "jaw.h5")
    with h5py.File(path, "r+") as file:
        spoil(file)
    with pytest.raises(InputError, match=text) as caught:
        read_recording(path)
    assert str(caught.value).count(str(path)) == 1


def test_what_is_no_such_file(tmp_path: Path) -> None:
    path = write(tmp_path / "jaw.h5")
    whole = path.read_bytes()
    for k, content in enumerate((b"", b"text", whole[:1000], whole[: len(whole) // 2])):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"is broken, or no file|is missing") as caught:
            read_recording(path)
        assert str(path) in str(caught.value), k
