"""Reading C3D: against files made byte by byte, and against another library's."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles import c3d_file
from oracles.c3d_file import c3d_bytes

from condyle.errors import InputError, MissingExtraError
from condyle.markers import read_c3d
from condyle.markers.recording import find_label

RNG = np.random.default_rng(0)
LABELS = ["Jaw:Upper FL", "Lower_FL", "*3"]
POINTS = RNG.normal(0, 300, (12, 3, 3))


def written(tmp_path: Path, points: np.ndarray = POINTS, **options: Any) -> Path:
    path = tmp_path / "trial.c3d"
    path.write_bytes(c3d_bytes(LABELS, points, **options))
    return path


def test_single_precision(tmp_path: Path) -> None:
    got = read_c3d(written(tmp_path, rate=59.94))
    assert (got.rate, got.first_frame, got.unit, got.labels) == (59.94, 1, "mm", tuple(LABELS))
    np.testing.assert_allclose(got.points, POINTS / 1e3, atol=1e-6 * 0.1)
    np.testing.assert_allclose(got.t, np.arange(12) / 59.94, rtol=1e-15)
    assert got.warnings == () and got.source == "trial.c3d"


def test_integers(tmp_path: Path) -> None:
    got = read_c3d(written(tmp_path, scale=0.05))
    np.testing.assert_allclose(got.points, POINTS / 1e3, atol=0.0251e-3)


@pytest.mark.parametrize("missing", ["residual", "nan", "zero"])
def test_markers_not_seen(tmp_path: Path, missing: str) -> None:
    points = POINTS.copy()
    points[3:5, 1] = np.nan
    got = read_c3d(written(tmp_path, points, missing=missing))
    np.testing.assert_array_equal(np.isnan(got.points), np.isnan(points))


@pytest.mark.parametrize(
    ("said", "metres"),
    [("m", 1), ("cm", 1e-2), ("mm", 1e-3), ("MM", 1e-3), ("Meters", 1), ("millimetres ", 1e-3)],
)
def test_units(tmp_path: Path, said: str, metres: float) -> None:
    got = read_c3d(written(tmp_path, units=said))
    np.testing.assert_allclose(got.points, POINTS * metres, rtol=1e-6)
    assert got.warnings == ()


@pytest.mark.parametrize("said", [None, ""])
def test_a_unit_that_is_missing_is_assumed_and_said(tmp_path: Path, said: str | None) -> None:
    got = read_c3d(written(tmp_path, units=said))
    assert got.unit == "mm" and "mm was assumed" in got.warnings[0]
    told = read_c3d(written(tmp_path, units=said), "m")
    assert told.unit == "m" and told.warnings == ()
    np.testing.assert_allclose(told.points, POINTS, rtol=1e-6)


def test_frames_count_from_one(tmp_path: Path) -> None:
    got = read_c3d(written(tmp_path, first_frame=501))
    assert got.first_frame == 501 and got.t[0] == 5.0 and len(got.t) == 12


def test_frames_beyond_sixteen_bits(tmp_path: Path) -> None:
    got = read_c3d(written(tmp_path, first_frame=200_001))
    assert got.first_frame == 200_001 and got.t[0] == 2000.0 and len(got.t) == 12


def test_channels_are_means_of_each_frame(tmp_path: Path) -> None:
    analog = RNG.normal(0, 1, (12, 10, 2))
    got = read_c3d(written(tmp_path, channels=[("Fx", "N"), ("EMG1", "V")], analog=analog))
    assert got.channels == ("Fx", "EMG1") and got.channel_units == ("N", "V")
    np.testing.assert_allclose(got.analog, analog.mean(axis=1), atol=1e-6)
    np.testing.assert_allclose(got.points, POINTS / 1e3, atol=1e-7)


def test_more_labels_than_one_parameter_holds(tmp_path: Path) -> None:
    """Another library writes the file, with labels that go on in LABELS2."""
    import ezc3d

    count = 300
    names = [f"M{i:03}" for i in range(count)]
    points = np.ones((4, count, 7))
    points[:3] = RNG.normal(0, 100, (3, count, 7))
    points[:3, 4, 2] = np.nan
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [250.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["m"]
    file["parameters"]["POINT"]["LABELS"]["value"] = names
    file["data"]["points"] = points
    file.write(str(tmp_path / "other.c3d"))
    got = read_c3d(tmp_path / "other.c3d")
    assert got.rate == 250 and got.labels == tuple(names) and got.unit == "m"
    want = points[:3].transpose(2, 1, 0)
    np.testing.assert_array_equal(np.isnan(got.points), np.isnan(want))
    np.testing.assert_allclose(got.points, want, atol=1e-5, equal_nan=True)


def test_labels_are_forgiving() -> None:
    labels = [
        "Anna:Upper_FL",
        "Anna:lower fl",
        "Upper_BR",
        "upper_br",
        "B:Chin",
        "C:Chin",
        "X",
        "X",
    ]
    labels += ["Anna:tip", "Anna:TIP"]
    for name, place in (
        ("Upper_FL", 0),
        ("Anna:Upper_FL", 0),
        ("upper fl", 0),
        ("Lower_FL", 1),
        ("Upper_BR", 2),
        ("upper_br", 3),
        ("B:Chin", 4),
        ("tip", 8),
        ("TIP", 9),
    ):
        assert find_label(name, labels, "a.c3d") == place, name
    for name, said in (
        ("Chin", 'may be any of "B:Chin", "C:Chin"; give the whole label'),
        ("X", "rename one of them"),
        ("Uper_FL", 'has no marker "Uper_FL"'),
    ):
        with pytest.raises(InputError, match=said):
            find_label(name, labels, "a.c3d")


def test_files_that_cannot_be_used(tmp_path: Path) -> None:
    whole = c3d_bytes(LABELS, POINTS)
    path = tmp_path / "trial.c3d"
    for content, said in (
        (b"", "is no C3D file"),
        (b"t,x,y\n" * 300, "is no C3D file"),
        (whole[:1030], "is broken|holds not one whole frame"),
        (c3d_bytes(LABELS, POINTS, rate=0.0), "rate of 0 frames"),
        (c3d_bytes(LABELS, POINTS, units="furlong"), r'"furlong", expected m, cm, mm, um'),
        (c3d_bytes([], POINTS[:, :0]), "holds no markers, only 0 analog channels"),
        (without_markers(), "holds no markers, only 2 analog channels; a motion needs"),
    ):
        path.write_bytes(content)
        with pytest.raises(InputError, match=said) as caught:
            read_c3d(path)
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="no such file"):
        read_c3d(tmp_path / "trail.c3d")
    with pytest.raises(InputError, match="cannot be read"):
        read_c3d(tmp_path)
    path.write_bytes(whole)
    with pytest.raises(InputError, match="unit: expected m, cm, mm, um, got 'inch'"):
        read_c3d(path, "inch")


def test_without_the_reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("condyle.extras.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r'pip install "condyle\[c3d\]"'):
        read_c3d(written(tmp_path))


def without_markers() -> bytes:
    channels = [("Fx", "N"), ("Fz", "N")]
    return c3d_bytes([], POINTS[:, :0], channels=channels, analog=np.ones((len(POINTS), 4, 2)))


def without_analog(groups: dict[str, Any]) -> dict[str, Any]:
    return {name: entries for name, entries in groups.items() if name != "ANALOG"}


@pytest.mark.parametrize("first", [0, 1, 7])
@pytest.mark.parametrize("analog", [True, False])
def test_what_other_programs_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, first: int, analog: bool
) -> None:
    """Frames counted from 0, and no group of analog channels at all."""
    usual = c3d_file._parameters
    if not analog:
        monkeypatch.setattr(
            c3d_file, "_parameters", lambda groups, *more: usual(without_analog(groups), *more)
        )
    path = tmp_path / "trial.c3d"
    path.write_bytes(c3d_bytes(LABELS, POINTS, first_frame=first))
    found = read_c3d(path)
    assert len(found.points) == len(POINTS) and found.first_frame == max(first, 1)
    assert not found.warnings


def test_a_parameter_twice_and_a_header_without_analog(tmp_path: Path) -> None:
    samples = np.arange(len(POINTS) * 8, dtype=float).reshape(len(POINTS), 4, 2)
    channels = [("a", "V"), ("b", "V")]
    whole = bytearray(c3d_bytes(LABELS, POINTS, channels=channels, analog=samples))
    path = tmp_path / "trial.c3d"
    plain = whole.copy()
    plain[4:6] = b"\0\0"  # analog samples a frame
    path.write_bytes(plain)
    found = read_c3d(path)
    np.testing.assert_allclose(found.samples, samples)
    assert any("no analog samples a frame by its header" in one for one in found.warnings)
    # The unit of length takes the name of a parameter that stands before it.
    twice = whole.replace(b"\x05\x01UNITS", b"\x05\x01SCALE", 1)
    assert twice != whole
    path.write_bytes(twice)
    found = read_c3d(path)
    said = " ".join(found.warnings)
    assert "has SCALE twice among its parameters; the first of each counts" in said


@pytest.mark.parametrize(("at", "said"), [(2, 4), (2, 2), (2, 0), (4, 5)])
def test_of_two_counts_the_parameters_are_read(tmp_path: Path, at: int, said: int) -> None:
    """Markers, and analog samples, a frame: as another library has them."""
    import ezc3d

    samples = np.arange(len(POINTS) * 8, dtype=float).reshape(len(POINTS), 4, 2)
    content = bytearray(
        c3d_bytes(LABELS, POINTS, channels=[("a", "V"), ("b", "V")], analog=samples)
    )
    content[at : at + 2] = struct.pack("<H", said)
    path = tmp_path / "trial.c3d"
    path.write_bytes(content)
    found, theirs = read_c3d(path), ezc3d.c3d(str(path))["data"]
    assert any(f"has {said or 'no'} " in one for one in found.warnings)
    np.testing.assert_allclose(found.points * 1e3, theirs["points"][:3].transpose(2, 1, 0))
    np.testing.assert_allclose(found.samples.reshape(-1, 2), theirs["analogs"][0].T)


@pytest.mark.parametrize("scale", [-1.0, 0.05])
@pytest.mark.parametrize("processor", ["dec", "mips"])
def test_other_processors(tmp_path: Path, processor: str, scale: float) -> None:
    """Orders of bytes, and DEC's floating point: all that an Intel file says, plates included."""
    samples = np.arange(len(POINTS) * 8, dtype=float).reshape(len(POINTS), 4, 2)
    plates = {
        "USED": np.int16(1),
        "TYPE": np.array([2], np.int16),
        "CORNERS": RNG.normal(0, 300, (3, 4, 1)).astype(np.float32),
        "ORIGIN": np.array([[1, 2, -40.0]], np.float32).T,
        "CHANNEL": np.arange(1, 7, dtype=np.int16)[:, None],
        "ZERO": np.array([2, 5], np.int16),
    }
    channels = [("a", "V"), ("b", "V")]
    more = {"channels": channels, "analog": samples, "plates": plates, "scale": scale}
    want = read_c3d(written(tmp_path, first_frame=70_000, **more))
    found = read_c3d(written(tmp_path, first_frame=70_000, processor=processor, **more))
    assert found.rate == want.rate and found.first_frame == want.first_frame == 70_000
    assert found.labels == want.labels and found.channels == want.channels
    np.testing.assert_array_equal(found.points, want.points)
    np.testing.assert_array_equal(found.samples, samples)
    (one,), (other,) = found.plates, want.plates
    assert (one.type, one.channels, one.unloaded) == (other.type, other.channels, (2, 5))
    np.testing.assert_array_equal(one.corners, other.corners)
    np.testing.assert_array_equal(one.origin, other.origin)


def test_a_parameter_cut_short(tmp_path: Path) -> None:
    whole = c3d_bytes(LABELS, POINTS)
    at = whole.index(b"UNITS") + len("UNITS") + 3  # the number of dimensions
    path = tmp_path / "trial.c3d"
    path.write_bytes(whole[:at] + b"\3\xff\xff\xff" + whole[at + 4 :])
    found = read_c3d(path)
    assert any("has UNITS among its parameters cut short" in one for one in found.warnings)
    np.testing.assert_allclose(found.points, POINTS / 1e3, atol=1e-7)


def test_channels_that_only_the_header_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither ANALOG:USED nor ANALOG:RATE."""
    usual = c3d_file._parameters

    def fewer(groups: dict[str, Any], processor: str) -> bytes:
        own = {k: v for k, v in groups["ANALOG"].items() if k not in ("USED", "RATE")}
        return usual(groups | {"ANALOG": own}, processor)

    monkeypatch.setattr(c3d_file, "_parameters", fewer)
    samples = np.arange(len(POINTS) * 8, dtype=float).reshape(len(POINTS), 4, 2)
    found = read_c3d(written(tmp_path, channels=[("a", "V"), ("b", "V")], analog=samples))
    np.testing.assert_allclose(found.samples, samples)
    np.testing.assert_allclose(found.points, POINTS / 1e3, atol=1e-7)
    assert found.channels == ("a", "b") and not found.warnings


def test_parameters_without_the_length_of_a_description(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some programs end an entry where its empty description would stand."""
    monkeypatch.setattr(c3d_file, "UNDESCRIBED", b"")
    found = read_c3d(written(tmp_path))
    assert found.labels == tuple(LABELS)
    np.testing.assert_allclose(found.points, POINTS / 1e3, atol=1e-7)


def test_numbers_of_frames_in_a_column(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """TRIAL:ACTUAL_START_FIELD of 2 by 1, as some programs write it."""
    usual = c3d_file._parameters

    def columns(groups: dict[str, Any], processor: str) -> bytes:
        ends = {"ACTUAL_START_FIELD": [7, 1], "ACTUAL_END_FIELD": [18, 1]}
        words = {key: np.array(two, np.uint16)[:, None] for key, two in ends.items()}
        return usual(groups | {"TRIAL": words}, processor)

    monkeypatch.setattr(c3d_file, "_parameters", columns)
    found = read_c3d(written(tmp_path))
    assert found.first_frame == 65536 + 7 and len(found.t) == 12 and not found.warnings


def test_fewer_frames_than_it_says(tmp_path: Path) -> None:
    whole = c3d_bytes(LABELS, POINTS)
    path = tmp_path / "trial.c3d"
    path.write_bytes(whole[: len(whole) - 512])
    found = read_c3d(path)
    assert 0 < len(found.points) < len(POINTS)
    assert any("says 12 frames" in one for one in found.warnings)
    np.testing.assert_allclose(found.points, read_c3d_of(whole, tmp_path)[: len(found.points)])


def read_c3d_of(content: bytes, folder: Path) -> np.ndarray:
    path = folder / "whole.c3d"
    path.write_bytes(content)
    return read_c3d(path).points
