"""`calibrate` finds planted geometry, says how well, and names what poses cannot tell."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.c3d_file import c3d_bytes
from scipy.spatial.transform import Rotation

import condyle
from condyle.errors import InputError
from condyle.identification.calibrate import Calibrated
from condyle.identification.calibration_study import Markers
from condyle.identification.marked_poses import marked_points
from condyle.mechanism import Mechanism

from .recorded import write_table

pytestmark = pytest.mark.slow

SPREAD, TURN = 5e-4, np.radians(0.5)
POSITION, ANGLE, ENCODER = 5e-5, 1e-3, 1e-4
ZEROS, POINTS = "chain.*.actuator.zero", "chain.*.platform"
FRAME = np.array([0.3, -0.2, 0.5]), Rotation.from_rotvec([0.4, -0.3, 0.8])
TARGET = np.array([0.01, 0.02, -0.03]), Rotation.from_rotvec([0.1, -0.5, 0.2])
SPOTS = {"left": (0.02, 0.03, 0.01), "right": (0.03, -0.03, 0.02)}


def built(rng: np.random.Generator) -> Mechanism:
    """The bundled robot as a workshop would have built it."""
    machine = condyle.load_mechanism("masticatory")
    changes: dict[str, Any] = {}
    for chain in machine.chains:
        moved = np.array(chain.platform) + SPREAD * rng.normal(size=3)
        changes[f"chain.{chain.name}.platform"] = tuple(map(float, moved))
        changes[f"chain.{chain.name}.actuator.zero"] = TURN * rng.normal()
    return machine.set(changes)


def poses(of: Mechanism, rng: np.random.Generator, path: Path, count: int, spots: bool) -> Path:
    """Readings and measured poses of a target, or places of points; rotations are SciPy's."""
    model = condyle.derive(of, backend="numpy")
    middle = np.array([-1e-3, 0.0, 0.0, 0.04])
    q = middle + np.array([1.5e-3, 1.5e-3, 0.05, 0.06]) * rng.uniform(-1, 1, (count, 4))
    found = model.inverse_kinematics(q)
    assert not found.status.any()
    readings = found.joint + of.zeros + ENCODER * rng.normal(size=found.joint.shape)
    columns = {f"joint_{n}": r for n, r in zip(of.chain_names, readings.T, strict=True)}
    place, R = found.pose[:, :3], Rotation.from_euler("XYZ", found.pose[:, 3:])
    if spots:
        own = SPOTS | {"incisor": of.platform.points["incisor"]}
        for name, spot in own.items():
            seen = FRAME[0] + FRAME[1].apply(place + R.apply(spot))
            seen = seen + POSITION * rng.normal(size=seen.shape)
            columns |= {f"{name}_{axis}": seen[:, i] for i, axis in enumerate("xyz")}
    else:
        seen = FRAME[0] + FRAME[1].apply(place + R.apply(TARGET[0]))
        seen = seen + POSITION * rng.normal(size=seen.shape)
        off = Rotation.from_rotvec(ANGLE * rng.normal(size=seen.shape))
        angles = (off * FRAME[1] * R * TARGET[1]).as_euler("XYZ")
        columns |= dict(zip("XYZ", seen.T, strict=True))
        columns |= dict(zip(("alpha", "beta", "gamma"), angles.T, strict=True))
    return write_table(path, columns)


def recorded(of: Mechanism, rng: np.random.Generator, folder: Path, count: int, kind: str) -> Path:
    """Poses held for a quarter of a second each before cameras, the base pushed about between them.

    A marker is hidden now and then. Returns the table of joints, beside its recording.
    """
    table = np.genfromtxt(
        poses(of, rng, folder / "whole.csv", count, True), delimiter=",", names=True
    )
    rate, held = 100.0, 25
    base = FRAME[0] + [[0.1, 0.1, 0.0], [-0.1, 0.1, 0.05], [0.0, -0.1, 0.1], [0.0, 0.1, -0.1]]
    spots = [*SPOTS, "incisor"]
    seen = np.stack([[table[f"{n}_{a}"] for a in "xyz"] for n in spots]).transpose(2, 0, 1)
    seen = np.concatenate([seen, np.broadcast_to(base, (count, 4, 3))], axis=1)
    pushed = Rotation.from_rotvec(0.02 * rng.normal(size=(count, 3)))
    seen = seen @ pushed.as_matrix().swapaxes(1, 2) + 0.03 * rng.normal(size=(count, 1, 3))
    frames = np.repeat(seen, held, axis=0)
    frames += POSITION * rng.normal(size=frames.shape)
    hidden = np.arange(len(frames)) // held % 7 == 3
    frames[hidden, 1] = np.nan
    labels = [f"Jaw:{name}" for name in (*spots, "B1", "B2", "B3", "B4")]
    if kind == "c3d":
        (folder / "trial.c3d").write_bytes(c3d_bytes(labels, 1e3 * frames, rate=rate))
    else:
        t = np.arange(len(frames)) / rate
        rows = np.column_stack([t, frames.reshape(len(frames), -1)])
        names = ",".join(["t", *(f"{name}_{axis}" for name in labels for axis in "xyz")])
        text = "\n".join(",".join("" if np.isnan(x) else f"{x:.12g}" for x in row) for row in rows)
        (folder / "trial.csv").write_text(f"{names}\n{text}\n")
    joints = {"t": (np.arange(count) * held + held // 2) / rate}
    joints |= {name: table[name] for name in table.dtype.names if name.startswith("joint_")}
    return write_table(folder / "joints.csv", joints)


MARKERS = {"platform": [*SPOTS, "incisor"], "fixed": ["B1", "B2", "B3", "B4"], "unit": None}


def good(found: Calibrated, truth: Mechanism) -> None:
    """Errors as large as they are said to be, and a fit that is better than the file."""
    assert found.spread == pytest.approx(1.0, abs=0.3)
    off = np.array([(one.value - truth.get(one.name)) / one.deviation for one in found.numbers])
    assert len(off) == 24 and np.abs(off).max() < 4 and (np.abs(off) < 3).mean() > 0.9
    assert found.after.place[0] < found.before.place[0]


def test_markers_of_a_recording(tmp_path: Path) -> None:
    rng = np.random.default_rng(12)
    truth = built(rng)
    file = recorded(truth, rng, tmp_path, 30, "c3d")
    markers = {"file": str(tmp_path / "trial.c3d")} | MARKERS
    found = condyle.calibrate("masticatory", file, study(markers=markers))
    good(found, truth)
    for name, spot in SPOTS.items():
        np.testing.assert_allclose(found.frames[f"point {name}"], spot, atol=1e-3)


def test_markers_of_a_table(tmp_path: Path) -> None:
    t = np.arange(3) * 0.25 + 0.12
    both = []
    for kind in ("c3d", "csv"):
        rng = np.random.default_rng(3)
        recorded(built(rng), rng, tmp_path, 8, kind)
        found, notes = marked_points(Markers(file=str(tmp_path / f"trial.{kind}"), **MARKERS), t)
        assert not notes
        both.append(np.array([*found.values()]))
    np.testing.assert_allclose(*both, atol=1e-6)


def test_markers_it_refuses(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    file = recorded(built(rng), rng, tmp_path, 8, "c3d")
    text, markers = file.read_text(), {"file": str(tmp_path / "trial.c3d")} | MARKERS
    row = text.split("\n")[4]
    changes: list[tuple[dict[str, Any], str, str, str]] = [
        ({"platform": ["left", "wrong"]}, "", "", 'has no marker "wrong"'),
        ({"fixed": ["B1", "B2"]}, "", "", "3 markers or more"),
        ({"fixed": ["left", "B1", "B2"]}, "", "", "given twice"),
        ({"window": 0.0}, "", "", "window"),
        ({"file": "nowhere.c3d"}, "", "", "nowhere.c3d"),
        ({}, row, "99" + row[row.index(",") :], "row 4 is at 99 s, and trial.c3d runs from 0 to"),
        ({}, "t,", "u,", '"t"'),
    ]
    for change, old, new, said in changes:
        file.write_text(text.replace(old, new, 1) if old else text)
        with pytest.raises(InputError, match=said):
            condyle.calibrate("masticatory", file, study(markers=markers | change))


def test_a_platform_that_moves_is_said(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    recorded(built(rng), rng, tmp_path, 12, "c3d")
    markers = {"file": str(tmp_path / "trial.c3d")} | MARKERS | {"fixed": [], "window": 0.6}
    found, notes = marked_points(Markers(**markers), np.array([1.0]))
    assert found["left"].shape == (1, 3) and "the platform moves by up to" in notes[0]


def study(**more: Any) -> dict[str, Any]:
    return {"numbers": [ZEROS, POINTS], "tolerance": {ZEROS: TURN, POINTS: SPREAD}, **more}


@pytest.mark.parametrize("spots", [False, pytest.param(True, marks=pytest.mark.ci)])
def test_planted_geometry(tmp_path: Path, spots: bool) -> None:
    rng = np.random.default_rng(3 + spots)
    truth = built(rng)
    file = poses(truth, rng, tmp_path / "poses.csv", 40, spots)
    found = condyle.calibrate("masticatory", file, study())
    good(found, truth)
    np.testing.assert_allclose(found.frames["measuring"][:3], FRAME[0], atol=2e-3)
    if spots:
        for name, spot in SPOTS.items():
            np.testing.assert_allclose(found.frames[f"point {name}"], spot, atol=1e-3)
    else:
        np.testing.assert_allclose(found.frames["target"][:3], TARGET[0], atol=2e-3)
    out = tmp_path / "fitted.toml"
    found.save(out)
    again = condyle.load_mechanism(out)
    for one in found.numbers:
        assert again.get(one.name) == pytest.approx(one.value, rel=1e-12)
    assert out.read_text().startswith("# condyle")


def test_what_poses_cannot_tell(tmp_path: Path) -> None:
    """Base points and the measuring frame move together: some are held, and named."""
    rng = np.random.default_rng(8)
    file = poses(built(rng), rng, tmp_path / "poses.csv", 20, True)
    asked = {"numbers": [ZEROS, "chain.masseter_left.base", "chain.masseter_left.crank_tip"]}
    found = condyle.calibrate("masticatory", file, asked)
    held = [one for one in found.numbers if not one.identified]
    assert held and found.warnings
    before = condyle.load_mechanism("masticatory")
    for one in held:
        assert one.value == before.get(one.name) and one.why
        assert found.mechanism.get(one.name) == one.value


def test_the_slope_of_a_contact_in_given_frames(tmp_path: Path) -> None:
    rng, path = np.random.default_rng(5), "contact.left_condyle.surface.slope"
    machine = condyle.load_mechanism("masticatory")
    truth = machine.set({f"{path}[0]": machine.get(f"{path}[0]") + 0.03}, keep="home")
    file = poses(truth, rng, tmp_path / "poses.csv", 30, False)
    frames = {
        name: [*place, *turn.as_euler("XYZ")]
        for name, (place, turn) in (("measuring", FRAME), ("target", TARGET))
    }
    found = condyle.calibrate(machine, file, {"numbers": [path], "frames": frames})
    assert not found.frames
    assert found.spread == pytest.approx(1.0, abs=0.4)
    for one in found.numbers:
        assert one.identified and abs(one.value - truth.get(one.name)) < 4 * one.deviation < 0.02


def test_what_the_study_does_not_have(tmp_path: Path) -> None:
    """Noise beyond the stated is said; a base point that is off counts with a tolerance.

    The truth is planted: the oracle is the error over the stated deviation.
    """
    rng, base = np.random.default_rng(0), "chain.masseter_left.base"
    truth = built(rng)
    file = poses(truth, rng, tmp_path / "poses.csv", 40, False)
    louder = study(noise={"position": POSITION / 4, "angle": ANGLE / 4, "encoder": ENCODER / 4})
    found = condyle.calibrate("masticatory", file, louder)
    assert found.spread > found.likely and "times the stated noise" in found.warnings[0]
    off = [(one.value - truth.get(one.name)) / one.deviation for one in found.numbers]
    assert np.abs(off).max() < 4
    truth = truth.set({f"{base}[0]": truth.get(f"{base}[0]") + 1e-3})
    file = poses(truth, rng, tmp_path / "poses.csv", 40, False)
    asked = {"numbers": [ZEROS, POINTS, base], "tolerance": {ZEROS: TURN, POINTS: SPREAD}}
    asked["tolerance"] |= {base: 1e-3}
    found = condyle.calibrate("masticatory", file, asked)
    off = [(one.value - truth.get(one.name)) / one.deviation for one in found.numbers]
    assert np.abs(off).max() < 4 and not found.warnings


def test_what_it_refuses(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    file = poses(built(rng), rng, tmp_path / "poses.csv", 8, False)
    zeros, text = {"numbers": [ZEROS]}, file.read_text()
    changes: list[tuple[dict[str, Any], str]] = [
        ({"numbers": ["chain.*.bse"]}, "bse"),
        ({"numbers": ["name"]}, "number"),
        (zeros | {"tolerance": {POINTS: 1e-3}}, "not among"),
        (zeros | {"tolerance": {ZEROS: 0}}, "tolerance"),
        ({"numbers": [POINTS], "prior": {POINTS: [[0, 0], [1, 1]]}}, "18 numbers"),
        (zeros | {"frames": {"measuring": [0, 0, 0]}}, "measuring"),
    ]
    for change, said in changes:
        with pytest.raises(InputError, match=said):
            condyle.calibrate("masticatory", file, change)
    for table, said in (
        (text.replace("joint_masseter_left", "joint_maseter_left"), "joint_masseter_left"),
        (text.replace(",X,Y,Z,alpha,beta,gamma", ",a,b,c,d,e,f"), "X .. gamma"),
        (text.replace(",gamma", ",gama"), '"gamma"'),
        ("\n".join(text.split("\n")[:3]), "at least 4"),
        ("\n".join([text.split("\n")[0], *[text.split("\n")[1]] * 8]), "determine the frames"),
    ):
        file.write_text(table)
        with pytest.raises(InputError, match=said):
            condyle.calibrate("masticatory", file, zeros)
