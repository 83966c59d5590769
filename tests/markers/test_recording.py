"""Reading C3D: against files made byte by byte, and against another library's."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np
import pytest
from oracles import c3d_file
from oracles.c3d_file import c3d_bytes

from condyle.errors import InputError, MissingExtraError
from condyle.files.limits import WorkLimit
from condyle.files.reading import content_of
from condyle.markers import read_c3d
from condyle.markers.recorded_tables import read_recording
from condyle.markers.recording import find_label

RNG = np.random.default_rng(0)
LABELS = ["Jaw:Upper FL", "Lower_FL", "*3"]
POINTS = RNG.normal(0, 300, (12, 3, 3))
SAMPLES = np.arange(len(POINTS) * 8, dtype=float).reshape(len(POINTS), 4, 2)
ANALOG: dict[str, Any] = {"channels": [("a", "V"), ("b", "V")], "analog": SAMPLES}


def written(tmp_path: Path, points: np.ndarray = POINTS, **options: Any) -> Path:
    return stored(tmp_path, c3d_bytes(LABELS, points, **options))


def stored(tmp_path: Path, content: bytes) -> Path:
    path = tmp_path / "trial.c3d"
    path.write_bytes(content)
    return path


def test_numbers_and_channels(tmp_path: Path) -> None:
    """Single precision, integers; channels are means of each frame."""
    got = read_c3d(written(tmp_path, rate=59.94, **ANALOG))
    assert (got.rate, got.first_frame, got.unit, got.labels) == (59.94, 1, "mm", tuple(LABELS))
    np.testing.assert_allclose(got.points, POINTS / 1e3, atol=1e-7)
    np.testing.assert_allclose(got.t, np.arange(12) / 59.94, rtol=1e-15)
    assert got.warnings == () and got.source == "trial.c3d"
    assert got.channels == ("a", "b") and got.channel_units == ("V", "V")
    np.testing.assert_allclose(got.analog, SAMPLES.mean(axis=1), atol=1e-6)
    got = read_c3d(written(tmp_path, scale=0.05))
    np.testing.assert_allclose(got.points, POINTS / 1e3, atol=0.0251e-3)


def test_markers_not_seen_units_and_first_frames(tmp_path: Path) -> None:
    """However programs write them; frames count from one, even beyond sixteen bits."""
    points = POINTS.copy()
    points[3:5, 1] = np.nan
    for missing in ("residual", "nan", "zero"):
        got = read_c3d(written(tmp_path, points, missing=missing))
        np.testing.assert_array_equal(np.isnan(got.points), np.isnan(points))
    metres = {"m": 1, "cm": 1e-2, "mm": 1e-3, "MM": 1e-3, "Meters": 1, "millimetres ": 1e-3}
    for said, scale in metres.items():
        got = read_c3d(written(tmp_path, units=said))
        np.testing.assert_allclose(got.points, POINTS * scale, rtol=1e-6)
        assert got.warnings == ()
    for missing in (None, ""):
        got = read_c3d(written(tmp_path, units=missing))
        assert got.unit == "mm" and "mm was assumed" in got.warnings[0]
        told = read_c3d(written(tmp_path, units=missing), "m")
        assert told.unit == "m" and told.warnings == ()
        np.testing.assert_allclose(told.points, POINTS, rtol=1e-6)
    for first, start in ((0, 0.0), (7, 0.06), (501, 5.0), (200_001, 2000.0)):
        got = read_c3d(written(tmp_path, first_frame=first))
        assert got.first_frame == max(first, 1) and got.t[0] == pytest.approx(start)
        assert len(got.t) == len(got.points) == 12 and not got.warnings


def test_more_labels_than_one_parameter_holds(tmp_path: Path) -> None:
    """Another library writes the file, with labels that go on in LABELS2."""
    count = 300
    names = [f"M{i:03}" for i in range(count)]
    points = np.ones((4, count, 7))
    points[:3] = RNG.normal(0, 100, (3, count, 7))
    points[:3, 4, 2] = np.nan
    file = ezc3d.c3d()
    for key, value in {"RATE": [250.0], "UNITS": ["m"], "LABELS": names}.items():
        file["parameters"]["POINT"][key]["value"] = value
    file["data"]["points"] = points
    file.write(str(tmp_path / "other.c3d"))
    got = read_c3d(tmp_path / "other.c3d")
    assert got.rate == 250 and got.labels == tuple(names) and got.unit == "m"
    want = points[:3].transpose(2, 1, 0)
    np.testing.assert_array_equal(np.isnan(got.points), np.isnan(want))
    np.testing.assert_allclose(got.points, want, atol=1e-5, equal_nan=True)


def test_labels_are_forgiving() -> None:
    labels = "Anna:Upper_FL,Anna:lower fl,Upper_BR,upper_br,B:Chin,C:Chin,X,X,Anna:tip,Anna:TIP"
    names = "Upper_FL Anna:Upper_FL,Lower_FL,Upper_BR,upper_br,B:Chin,,,,tip,TIP"
    assert find_label("upper fl", labels.split(","), "a.c3d") == 0
    for place, group in enumerate(names.split(",")):
        for name in group.split():
            assert find_label(name, labels.split(","), "a.c3d") == place, name
    for name, said in (
        ("Chin", 'may be any of "B:Chin", "C:Chin"; give the whole label'),
        ("X", "rename one of them"),
        ("Uper_FL", 'has no marker "Uper_FL"'),
    ):
        with pytest.raises(InputError, match=said):
            find_label(name, labels.split(","), "a.c3d")


def test_files_that_cannot_be_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = c3d_bytes(LABELS, POINTS)
    for content, said in (
        (b"", "is no C3D file"),
        (b"t,x,y\n" * 300, "is no C3D file"),
        (whole[:1030], "is broken|holds not one whole frame"),
        (c3d_bytes(LABELS, POINTS, rate=0.0), "rate of 0 frames"),
        (c3d_bytes(LABELS, POINTS, units="furlong"), r'"furlong", expected m, cm, mm, um'),
        (c3d_bytes([], POINTS[:, :0]), "holds no markers, only 0 analog channels"),
        (c3d_bytes([], POINTS[:, :0], **ANALOG), "only 2 analog channels; a motion needs"),
    ):
        with pytest.raises(InputError, match=said) as caught:
            read_c3d(stored(tmp_path, content))
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="no such file"):
        read_c3d(tmp_path / "trail.c3d")
    with pytest.raises(InputError, match="is a folder"):
        read_c3d(tmp_path)
    with pytest.raises(InputError, match="unit: expected m, cm, mm, um, got 'inch'"):
        read_c3d(stored(tmp_path, whole), "inch")
    monkeypatch.setattr("condyle.extras.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r'pip install "condyle\[c3d\]"'):
        read_c3d(written(tmp_path))


Groups = dict[str, Any]


def without_analog(groups: Groups) -> Groups:
    return {name: entries for name, entries in groups.items() if name != "ANALOG"}


def without_counts(groups: Groups) -> Groups:
    own = {k: v for k, v in groups["ANALOG"].items() if k not in ("USED", "RATE")}
    return groups | {"ANALOG": own}


def columns(groups: Groups) -> Groups:
    """TRIAL:ACTUAL_START_FIELD of 2 by 1."""
    ends = {"ACTUAL_START_FIELD": [7, 1], "ACTUAL_END_FIELD": [18, 1]}
    words = {key: np.array(two, np.uint16)[:, None] for key, two in ends.items()}
    return groups | {"TRIAL": words}


@pytest.mark.parametrize(
    ("change", "first"), [(without_analog, 1), (without_counts, 1), (columns, 65536 + 7), (None, 1)]
)
def test_what_other_programs_write(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    change: Callable[[Groups], Groups] | None,
    first: int,
) -> None:
    """No group of analog channels, counts in the header alone, numbers of frames in a column, and
    entries that end where their empty description would stand."""
    usual = c3d_file._parameters
    if change is None:
        monkeypatch.setattr(c3d_file, "UNDESCRIBED", b"")
    else:
        monkeypatch.setattr(
            c3d_file, "_parameters", lambda groups, *more: usual(change(groups), *more)
        )
    analog = ANALOG if change is without_counts else {}
    found = read_c3d(written(tmp_path, **analog))
    assert found.labels == tuple(LABELS) and found.first_frame == first and not found.warnings
    np.testing.assert_allclose(found.points, POINTS / 1e3, atol=1e-7)
    if analog:
        assert found.channels == ("a", "b")
        np.testing.assert_allclose(found.samples, SAMPLES)


def test_what_is_broken_a_little_is_said(tmp_path: Path) -> None:
    """A header without analog, a parameter twice or cut short, fewer frames than it says."""
    whole = c3d_bytes(LABELS, POINTS, **ANALOG)
    found = read_c3d(stored(tmp_path, whole[:4] + b"\0\0" + whole[6:]))  # samples a frame
    np.testing.assert_allclose(found.samples, SAMPLES)
    assert any("no analog samples a frame by its header" in one for one in found.warnings)
    # The unit of length takes the name of a parameter that stands before it.
    found = read_c3d(stored(tmp_path, whole.replace(b"\x05\x01UNITS", b"\x05\x01SCALE", 1)))
    said = " ".join(found.warnings)
    assert "has SCALE twice among its parameters; the first of each counts" in said
    at = whole.index(b"UNITS") + len("UNITS") + 3  # the number of dimensions
    found = read_c3d(stored(tmp_path, whole[:at] + b"\3\xff\xff\xff" + whole[at + 4 :]))
    assert any("has UNITS among its parameters cut short" in one for one in found.warnings)
    np.testing.assert_allclose(found.points, POINTS / 1e3, atol=1e-7)
    found = read_c3d(stored(tmp_path, c3d_bytes(LABELS, POINTS)[:-512]))
    assert 0 < len(found.points) < len(POINTS)
    assert any("says 12 frames" in one for one in found.warnings)
    np.testing.assert_allclose(found.points, POINTS[: len(found.points)] / 1e3, atol=1e-7)


def test_of_two_counts_the_parameters_are_read(tmp_path: Path) -> None:
    """Markers, and analog samples, a frame: as another library has them."""
    for at, said in ((2, 4), (2, 2), (2, 0), (4, 5)):
        content = bytearray(c3d_bytes(LABELS, POINTS, **ANALOG))
        content[at : at + 2] = struct.pack("<H", said)
        path = stored(tmp_path, content)
        found, theirs = read_c3d(path), ezc3d.c3d(str(path))["data"]
        assert any(f"has {said or 'no'} " in one for one in found.warnings)
        np.testing.assert_allclose(found.points * 1e3, theirs["points"][:3].transpose(2, 1, 0))
        np.testing.assert_allclose(found.samples.reshape(-1, 2), theirs["analogs"][0].T)


@pytest.mark.parametrize(("processor", "scale"), [("dec", -1.0), ("dec", 0.05), ("mips", -1.0)])
def test_other_processors(tmp_path: Path, processor: str, scale: float) -> None:
    """Orders of bytes, and DEC's floating point: all that an Intel file says, plates included."""
    plates = {
        "USED": np.int16(1),
        "TYPE": np.array([2], np.int16),
        "CORNERS": RNG.normal(0, 300, (3, 4, 1)).astype(np.float32),
        "ORIGIN": np.array([[1, 2, -40.0]], np.float32).T,
        "CHANNEL": np.arange(1, 7, dtype=np.int16)[:, None],
        "ZERO": np.array([2, 5], np.int16),
    }
    options = ANALOG | {"plates": plates, "scale": scale, "first_frame": 70_000}
    want = read_c3d(written(tmp_path, **options))
    found = read_c3d(written(tmp_path, processor=processor, **options))
    assert found.rate == want.rate and found.first_frame == want.first_frame == 70_000
    assert found.labels == want.labels and found.channels == want.channels
    np.testing.assert_array_equal(found.points, want.points)
    np.testing.assert_array_equal(found.samples, SAMPLES)
    (one,), (other,) = found.plates, want.plates
    assert (one.type, one.channels, one.unloaded) == (other.type, other.channels, (2, 5))
    np.testing.assert_array_equal(one.corners, other.corners)
    np.testing.assert_array_equal(one.origin, other.origin)


def test_what_is_no_file_is_not_waited_for(tmp_path: Path) -> None:
    """A device could be read for ever."""
    (tmp_path / "zero.c3d").symlink_to("/dev/zero")
    for name in ("pipe.c3d", "pipe.trc", "pipe.csv"):
        os.mkfifo(tmp_path / name)
    for name in ("zero.c3d", "pipe.c3d", "pipe.trc", "pipe.csv"):
        with pytest.raises(InputError, match="is a device or a pipe; expected a file"):
            read_recording(tmp_path / name)
    with pytest.raises(InputError, match=r"11 bytes in a file, expected at most 10 .limit A"):
        content_of(stored(tmp_path, b"x" * 11), WorkLimit("A", 10, "bytes in a file"))
