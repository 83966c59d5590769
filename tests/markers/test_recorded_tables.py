"""Recordings in other files than C3D say what the C3D file says."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.recorded_jaw import Jaw, record
from support.recorded_session import write_session

import condyle
from condyle.errors import InputError
from condyle.markers import motion_from_c3d
from condyle.markers.recorded_tables import read_recording


def write_trc(jaw: Jaw, path: Path) -> Path:
    """As OpenSim's files are; a marker that was not seen is three empty cells."""
    head = ["PathFileType\t4\t(X/Y/Z)\tjaw.trc", "DataRate\tCameraRate\tNumFrames\tUnits"]
    head += [f"100.00\t100.00\t{len(jaw.t)}\tmm"]
    head += ["Frame#\tTime\t" + "\t\t\t".join(jaw.labels) + "\t\t", "\t\tX1\tY1\tZ1", ""]
    rows = [
        "\t".join(
            [str(k), f"{t:.5f}", *("" if np.isnan(x) else f"{1e3 * x:.9f}" for x in row.ravel())]
        )
        for k, (t, row) in enumerate(zip(jaw.t, jaw.points, strict=True), 1)
    ]
    path.write_text("\n".join([*head, *rows]) + "\n")
    return path


def write_csv(jaw: Jaw, path: Path, unit: str = "", scale: float = 1.0) -> Path:
    names = [f"{label}_{axis}{unit}" for label in jaw.labels for axis in "xyz"]
    rows = [
        ",".join([f"{t}", *("" if np.isnan(x) else repr(float(x * scale)) for x in row.ravel())])
        for t, row in zip(jaw.t, jaw.points, strict=True)
    ]
    path.write_text("\n".join([",".join(["t", *names]), *rows]))
    return path


def write_mot(path: Path, rate: float = 500.0, end: float = 4.0) -> Path:
    t = np.arange(0, end, 1 / rate)
    rows = [f"{a:.6f}\t{3 * a:.9f}\t0\t{-50 * a:.9f}" for a in t]
    head = ["bite", "nRows=1", "inDegrees=no", "endheader", "time\tFx\tFy\tFz"]
    path.write_text("\n".join([*head, *rows]))
    return path


@pytest.fixture
def trc(tmp_path: Path) -> Path:
    return write_trc(record(seconds=0.5), tmp_path / "a.trc")


def test_the_same_markers(tmp_path: Path) -> None:
    jaw = record(noise=1e-4, seconds=0.5)
    jaw.at("Lower_FL")[30:40] = np.nan
    theirs = read_recording(jaw.write(tmp_path / "a.c3d"))
    paths = write_trc(jaw, tmp_path / "a.trc"), write_csv(jaw, tmp_path / "a.csv")
    for path in (*paths, write_csv(jaw, tmp_path / "b.csv", " [mm]", 1e3)):
        mine = read_recording(path)
        assert mine.labels == theirs.labels and mine.rate == theirs.rate
        np.testing.assert_allclose(mine.t, theirs.t, atol=1e-9)
        np.testing.assert_allclose(mine.points, jaw.points, atol=1e-12)
        np.testing.assert_allclose(mine.points, theirs.points, atol=1e-7)
    assert read_recording(paths[0]).up == (0, 1, 0) and mine.unit == "mm"


def test_other_separators(trc: Path, tmp_path: Path) -> None:
    """Spaces, commas, semicolons in the place of tabs, and decimal commas."""
    want, (head, rows) = read_recording(trc), trc.read_text().split("\n", 1)
    for old, new in (("\t", " "), ("\t", ","), ("\t", ";"), (".", ",")):
        text = rows.replace("\t\t\t", "\t").replace("\t\t\n", "\n") if new == " " else rows
        trc.write_text(f"{head}\n{text.replace(old, new)}")
        found = read_recording(trc)
        assert found.labels == want.labels and not found.warnings
        np.testing.assert_array_equal(found.points, want.points)
        np.testing.assert_array_equal(found.t, want.t)
    path = write_csv(record(seconds=0.5), tmp_path / "a.csv")
    given = read_recording(path).points
    path.write_text(path.read_text().replace(",", ";").replace(".", ","))
    np.testing.assert_array_equal(read_recording(path).points, given)


@pytest.mark.parametrize(("said", "tabs"), [("60.00", "\t"), ("", "\t\t")])
def test_times_rounded_to_a_millisecond(tmp_path: Path, said: str, tabs: str) -> None:
    """As of most files that OpenSim comes with: 0, 0.017, 0.033 s at 60 Hz."""
    jaw = record(seconds=1.0, rate=60.0)
    path = write_trc(jaw, tmp_path / "a.trc")
    lines = path.read_text().split("\n")
    lines[2] = tabs.join(["  60.00", said or "-", str(len(jaw.t)), "  mm"])
    lines[1] = "CameraRate\tDataRate\tNumFrames\tUnits"
    for k, t in enumerate(jaw.t, 6):
        number, _, rest = lines[k].split("\t", 2)
        lines[k] = f"{number}\t{t:.3f}000\t{rest}"
    path.write_text("\n".join(lines))
    found = read_recording(path)
    assert found.rate == pytest.approx(60.0, rel=1e-15 if said else 2e-3) and not found.warnings
    np.testing.assert_allclose(found.t, jaw.t, atol=1e-12 if said else 5e-4)
    assert np.ptp(np.diff(found.t)) < 1e-12
    path.write_text("\n".join([*lines[:20], *lines[21:]]))  # a frame is not there
    with pytest.raises(InputError, match="times are not even"):
        read_recording(path)


def cut(path: Path, row: int, cells: int, end: str = "\n") -> None:
    """Leave so many cells of a row of numbers; below the last row stands `end`."""
    lines = path.read_text().splitlines()
    at = 6 + row if row >= 0 else row
    lines[at] = "\t".join(lines[at].split("\t")[:cells])
    path.write_text("\n".join(lines) + end)


def test_a_row_cut_short_is_said(trc: Path) -> None:
    want = read_recording(trc).points
    cut(trc, 7, 32)  # of 38, as programs that write no empty cells
    found = read_recording(trc)
    assert np.isnan(found.points[7, -2:]).all()
    np.testing.assert_array_equal(found.points[7, :-2], want[7, :-2])
    (said,) = found.warnings
    assert "1 of its rows, the first on line 14, end before 38 cells" in said
    cut(trc, 7, 30)
    with pytest.raises(InputError, match="line 14: 30 cells, expected 38"):
        read_recording(trc)


def test_a_file_cut_short_is_said(trc: Path) -> None:
    want, whole = read_recording(trc).points, trc.read_text()
    for cells, end in ((20, ""), (20, "\n"), (19, "\n"), (1, "")):
        trc.write_text(whole)
        cut(trc, -1, cells, end)
        found = read_recording(trc)
        said = " ".join(found.warnings)
        if cells == 20 and end:  # a row that ends, without six of its markers
            assert len(found.points) == 50 and "markers without cells" in said
        else:
            np.testing.assert_array_equal(found.points, want[:-1])
            assert "its last row (line 56) is cut short" in said
            assert "says 50 frames (NumFrames) and holds 49" in said


def test_units_as_programs_write_them(trc: Path) -> None:
    before, (head, names, values, rest) = read_recording(trc), trc.read_text().split("\n", 3)
    assert values.split("\t")[-1].strip() == "mm"
    for unit in ("MM", "millimeters", "meters", ""):
        trc.write_text("\n".join([head, names, values.rpartition("\t")[0] + f"\t{unit}", rest]))
        found = read_recording(trc)
        scale = 1000.0 if unit == "meters" else 1.0
        np.testing.assert_allclose(found.points, scale * before.points)
        assert bool(found.warnings) == (not unit)
    trc.write_text("\n".join([head, "", "", rest]))
    found = read_recording(trc)
    assert found.unit == "mm" and found.up == (0, 1, 0) and "mm was assumed" in found.warnings[0]


@pytest.mark.parametrize("write", [write_trc, write_csv])
def test_a_motion_of_them(tmp_path: Path, write: Any) -> None:
    """One reader: what a command takes of a C3D file it takes of tables."""
    jaw = record(seconds=0.8)
    path = write(jaw, tmp_path / f"a.{write.__name__[-3:]}")
    scale = 1.0 if write is write_trc else 1e-3  # from mm to the recording's unit
    register = {name: (scale * np.array(place)).tolist() for name, place in jaw.register.items()}
    found = motion_from_c3d(path, jaw.tables(register=register), "masticatory")
    np.testing.assert_allclose(found.motion.value, jaw.pose, atol=1e-9)


def test_channels_of_another_file(tmp_path: Path) -> None:
    path = write_csv(record(seconds=2.0), tmp_path / "a.csv")
    found = read_recording(path, channels=write_mot(tmp_path / "a.mot"))
    assert found.channels == ("Fx", "Fy", "Fz") and found.channel_rate == 500
    t = found.t[:, None] + np.arange(5) / 500
    np.testing.assert_allclose(found.samples[..., 2], -50 * t, atol=1e-6)
    with pytest.raises(InputError, match=r"runs from 0 to 0.998 s, and a.csv from 0 to 1.99"):
        read_recording(path, channels=write_mot(tmp_path / "b.mot", end=1.0))
    for text in ("time Fx\n0 1", "endheader\nFx Fy\n1 2\n3 4", "endheader\nt F\n1 x"):
        (tmp_path / "a.sto").write_text(text)
        with pytest.raises(InputError, match=r"a\.sto"):
            read_recording(path, channels=tmp_path / "a.sto")


@pytest.mark.slow
def test_a_session_of_them(tmp_path: Path) -> None:
    """Markers in a table, the bite in a file of OpenSim: the load is that one, turned into {S}."""
    trial = [{"file": "jaw.csv", "channels": "bite.sto"}]
    forces = {"channels": ["Fx", "Fy", "Fz"], "point": "incisor"}
    options = {"head": 0.0, "unit": 1.0}
    path, (jaw,) = write_session(tmp_path, 1, 2.0, options, trial=trial, forces=forces)
    write_csv(jaw, tmp_path / "jaw.csv")
    write_mot(tmp_path / "bite.sto")
    solution = condyle.measure_session(path).solutions["jaw"]
    t = solution["time"].values + 2 / 500  # the mean of the five samples of a frame
    force = np.column_stack([3 * t, 0 * t, -50 * t]) @ jaw.A
    np.testing.assert_allclose(solution["load"].values[:, :3], force, atol=1e-5)


TRC = "PathFileType\na\nb\nFrame#\tTime\tA\t\t\nX\n"
CSV = "t,A_x,A_y,A_z\n"


NO_TABLES = [
    ("a.txt", "t", "ends in .c3d, .csv, .parquet, .trc, .h5 or .hdf5"),
    ("a.trc", "Path", "is no TRC file"),
    ("a.trc", TRC.replace("A\t\t", "A\tB") + "1\t0\t3", "line 4: expected Frame#"),
    ("a.trc", TRC + "1\t0\tx\t2\t3", 'line 6, column "A_x": got "x"'),
    ("a.trc", TRC + "1\t0\t1\t2\t3", "holds 1 frames"),
    ("a.csv", "x\n1\n2\n", 'column "t" is missing'),
    ("a.csv", "t,A_x,A_y\n0,1,2\n1,1,2\n", "has no marker"),
    ("a.csv", CSV + "0,1,2,3\n1,1,2,3\n5,1,2,3\n", "times are not even"),
    (
        "a.csv",
        "t,A_x [ft],A_y [ft],A_z [ft]\n0,1,2,3\n1,1,2,3\n",
        '(of its columns) is "ft"',
    ),
    ("a.csv", "t,A_x,A_y [mm],A_z\n0,1,2,3\n1,1,2,3\n", "lengths in m, mm; expected one"),
    ("a.csv", CSV + "0,1,2,3\n1,1,2\n2,1,2,3\n", "line 3"),
    ("a.csv", CSV + "0,1,2,3\n1e-9,1,2,3\n", "each 1e-09 after the one before"),
    ("a.csv", CSV + "-1e308,1,2,3\n1e308,1,2,3\n", "expected times in s"),
    ("a.csv", CSV + "0,1,2,3\n,1,2,3\n2,1,2,3\n", 'line 3, column "t": got nan'),
]


def test_files_that_are_none(tmp_path: Path) -> None:
    for name, text, said in NO_TABLES:
        (tmp_path / name).write_text(text)
        with pytest.raises(InputError, match=re.escape(said)):
            read_recording(tmp_path / name)
