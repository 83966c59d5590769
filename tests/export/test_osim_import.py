"""Muscles of an OpenSim model as a jaw: moment arms by hand and by OpenSim, and hostile files."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import condyle
from condyle.errors import CondyleError
from condyle.export.osim_import import from_osim

AXES = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
ORIENTATION, PLACE = (0.1, -0.2, 0.3), (0.01, 0.9, 0.02)  # of the skull's frame in ground
OPENING, FORWARD = 0.15, 0.004  # default coordinates
HINGE = (0.0, 0.6, 0.8)
CENTRE = (0.03, -0.05, 0.002)
INERTIA = (9e-5, 1.8e-4, 1.2e-4, 1e-6, -2e-6, 3e-6)
RNG = np.random.default_rng(5)
SKULL, JAW = (RNG.normal((0, up, 0), 0.03, (8, 3)) for up in (0.02, -0.05))


def words(values: Any) -> str:
    return " ".join(repr(float(x)) for x in values)


def frame(name: str, parent: str, at: Any = (0, 0, 0), turned: Any = (0, 0, 0)) -> str:
    return (
        f'<PhysicalOffsetFrame name="{name}"><socket_parent>{parent}</socket_parent>'
        f"<translation>{words(at)}</translation><orientation>{words(turned)}</orientation>"
        "</PhysicalOffsetFrame>"
    )


def point(body: str, at: Any, name: str = "p") -> str:
    return (
        f'<PathPoint name="{name}"><socket_parent_frame>/bodyset/{body}</socket_parent_frame>'
        f"<location>{words(at)}</location></PathPoint>"
    )


def muscle(name: str, points: str) -> str:
    return (
        f'<Millard2012EquilibriumMuscle name="{name}"><max_isometric_force>120'
        "</max_isometric_force><optimal_fiber_length>0.03</optimal_fiber_length>"
        "<tendon_slack_length>0.04</tendon_slack_length><pennation_angle_at_optimal>0.1"
        f'</pennation_angle_at_optimal><GeometryPath name="path"><PathPointSet><objects>{points}'
        "</objects></PathPointSet></GeometryPath></Millard2012EquilibriumMuscle>"
    )


def body(name: str, mass: float, centre: Any, inertia: Any) -> str:
    return (
        f'<Body name="{name}"><mass>{mass}</mass><mass_center>{words(centre)}</mass_center>'
        f"<inertia>{words(inertia)}</inertia></Body>"
    )


def linear(name: str, coordinate: str, axis: Any) -> str:
    law = "<LinearFunction><coefficients>1 0</coefficients></LinearFunction>"
    if not coordinate:
        law = "<Constant><value>0</value></Constant>"
    return (
        f'<TransformAxis name="{name}"><coordinates>{coordinate}</coordinates>'
        f"<axis>{words(axis)}</axis>{law}</TransformAxis>"
    )


def model() -> str:
    """A skull welded to ground, turned; a jaw that opens and slides; muscles, one over a point."""
    axes = linear("rotation1", "opening", HINGE) + linear("rotation2", "", (1, 0, 0))
    axes += linear("rotation3", "", (0, 1, 0)) + linear("translation1", "forward", (1, 0, 0))
    axes += linear("translation2", "", (0, 1, 0)) + linear("translation3", "", (0, 0, 1))
    coordinates = "".join(
        f'<Coordinate name="{name}"><default_value>{value}</default_value></Coordinate>'
        for name, value in (("opening", OPENING), ("forward", FORWARD))
    )
    muscles = ""
    for i, (a, b) in enumerate(zip(SKULL, JAW, strict=True)):
        points = point("skull", a, "a")
        points += point("skull", (a + b) / 2 + (0.01, 0, 0.01), "via") if i == 3 else ""
        points += point("mandible", b, "b")
        points += point("mandible", np.add(b, (0.001, 0.002, 0)), "c") if i == 4 else ""
        muscles += muscle(f"m{i}", points)
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<OpenSimDocument Version="40000"><Model name="head"><gravity>0 -9.81 0</gravity>
<Ground name="ground"/><BodySet name="bodyset"><objects>
{body("skull", 4, (0, 0, 0), (0.01, 0.01, 0.01, 0, 0, 0))}{body("mandible", 0.2, CENTRE, INERTIA)}
</objects></BodySet><JointSet name="jointset"><objects><WeldJoint name="neck">
<socket_parent_frame>ground_offset</socket_parent_frame>
<socket_child_frame>skull_offset</socket_child_frame>
<frames>{frame("ground_offset", "/ground", PLACE, ORIENTATION)}
{frame("skull_offset", "/bodyset/skull")}
</frames></WeldJoint><CustomJoint name="tmj"><socket_parent_frame>skull_offset</socket_parent_frame>
<socket_child_frame>jaw_offset</socket_child_frame><coordinates>{coordinates}</coordinates>
<frames>{frame("skull_offset", "/bodyset/skull", (-0.02, 0.01, 0), (0, 0.1, 0))}
{frame("jaw_offset", "/bodyset/mandible", (0.001, 0.002, 0), (0.05, 0, 0))}</frames>
<SpatialTransform>{axes}</SpatialTransform></CustomJoint></objects></JointSet>
<ForceSet name="forceset"><objects>{muscles}</objects></ForceSet>
<MarkerSet name="markerset"><objects><Marker name="lower_incisor"><socket_parent_frame>
/bodyset/mandible</socket_parent_frame><location>0.08 -0.03 0</location></Marker></objects>
</MarkerSet></Model></OpenSimDocument>"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "head.osim"
    path.write_text(model(), encoding="utf-8")
    return path


def arms(path: Path) -> np.ndarray:
    """Of opening and sliding forward at home, by this library's Jacobian, (n, 2) [m, 1]."""
    made = from_osim(path, "head").mechanism
    derived = condyle.derive(made, backend="numpy", distribution="minimum_norm")
    J = derived.derivatives("joint", "q", q=np.zeros(6))["joint", "q"]
    parent = Rotation.from_euler("XYZ", ORIENTATION) * Rotation.from_euler("Y", 0.1)
    axis, slide = AXES @ parent.apply(HINGE), AXES @ parent.apply((1, 0, 0))
    pivot = AXES @ (on_skull(np.array([-0.02, 0.01, 0])) + FORWARD * parent.apply((1, 0, 0)))
    origin = AXES @ on_jaw(np.array(CENTRE))
    opening = np.concatenate([np.cross(axis, origin - pivot), axis])
    return J @ np.column_stack([opening, np.append(slide, np.zeros(3))])


def on_skull(at: np.ndarray) -> np.ndarray:
    return PLACE + Rotation.from_euler("XYZ", ORIENTATION).apply(at)


def on_jaw(at: np.ndarray) -> np.ndarray:
    """A point of the mandible in ground."""
    own = Rotation.from_euler("X", 0.05).inv().apply(at - (0.001, 0.002, 0))
    inside = Rotation.from_rotvec(OPENING * np.array(HINGE)).apply(own)
    turned = Rotation.from_euler("Y", 0.1).apply(np.add(inside, (FORWARD, 0, 0)))
    return on_skull(np.add(turned, (-0.02, 0.01, 0)))


def test_moment_arms_lengths_and_inertia_are_those_of_the_points(file: Path) -> None:
    made = from_osim(file, "head").mechanism
    turn = Rotation.from_euler("XYZ", ORIENTATION) * Rotation.from_euler("Y", 0.1)
    axis, slide = turn.apply(HINGE), turn.apply((1, 0, 0))
    pivot = on_skull(np.array([-0.02, 0.01, 0])) + FORWARD * slide
    wanted = []
    for i, (a, b) in enumerate(zip(SKULL, JAW, strict=True)):
        start = on_skull(a if i != 3 else (a + b) / 2 + (0.01, 0, 0.01))
        pull = (start - on_jaw(b)) / np.linalg.norm(start - on_jaw(b))
        wanted.append([pull @ np.cross(axis, on_jaw(b) - pivot), pull @ slide])
        fibres = made.chains[i].muscle
        assert (fibres.max_force, fibres.optimal_length) == (120.0, 0.03)
        beyond = np.hypot(0.001, 0.002) if i == 4 else 0.0
        assert fibres.tendon_length == pytest.approx(0.04 - beyond, abs=1e-15)
    np.testing.assert_allclose(arms(file), wanted, rtol=0, atol=1e-12)
    xx, yy, zz, xy, xz, yz = INERTIA
    own = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    np.testing.assert_allclose(sorted(made.platform.inertia.principal()), own, rtol=1e-12)
    incisor = AXES @ (on_jaw(np.array([0.08, -0.03, 0])) - on_jaw(np.array(CENTRE)))
    np.testing.assert_allclose(made.platform.points["lower_incisor"], incisor, atol=1e-15)


# In a process of its own: OpenSim brings another CasADi.
OPENSIM = """
import sys, json, opensim
model = opensim.Model(sys.argv[1])
state, muscles = model.initSystem(), model.getMuscles()
coordinates = [model.getCoordinateSet().get(name) for name in ("opening", "forward")]
each = [muscles.get(i) for i in range(muscles.getSize())]
print("arms", json.dumps([[m.computeMomentArm(state, q) for q in coordinates] for m in each]))
"""


def test_moment_arms_are_those_of_opensim(file: Path) -> None:
    if find_spec("opensim") is None:
        pytest.skip("opensim is not installed")
    done = subprocess.run(
        [sys.executable, "-c", OPENSIM, file.name], cwd=file.parent, capture_output=True, text=True
    )
    wanted = json.loads(done.stdout.rpartition("arms")[2])
    np.testing.assert_allclose(arms(file), wanted, rtol=0, atol=1e-9)


def test_the_command_writes_a_mechanism_file(
    file: Path, monkeypatch: pytest.MonkeyPatch, condyle_command: Any
) -> None:
    monkeypatch.chdir(file.parent)
    outcome = condyle_command("new", "mine", "--from", "head.osim")
    assert outcome.status == 0 and "the platform is the body mandible" in outcome.err
    assert len(condyle.load_mechanism("mine.toml").chains) == 8


BOMB = '<!DOCTYPE a [<!ENTITY b "&#38;b;">]><OpenSimDocument Version="40000"/>'
SWAPS = (
    ('Version="40000"', 'Version="20302"', "expected 40000 or later"),
    ("<mass>0.2</mass>", "<mass>nan</mass>", "mass: expected 1 finite number"),
    ("<axis>0.0 0.6 0.8</axis>", "<axis>0.6 0.8</axis>", "axis: expected 3 finite numbers"),
    ("skull_offset</socket_parent_frame>", "nowhere</socket_parent_frame>", "nowhere' is unknown"),
    ("CustomJoint", "EllipsoidJoint", "is a EllipsoidJoint; expected"),
    ("LinearFunction", "SimmSpline", "no Constant or LinearFunction"),
    ("PathPoint name", "MovingPathPoint name", "is not XML"),
    ("<mass_center>0.03", "<mass_center>1e300", "expected"),
    ("/bodyset/skull</socket_parent>", "/bodyset/mandible</socket_parent>", "leads to ground"),
    ("/bodyset/skull</socket_parent>", "skull_offset</socket_parent>", "frame"),
    ("OpenSimDocument", "robot", "expected an OpenSimDocument"),
    ("<tendon_slack_length>0.04", "<tendon_slack_length>0.0001", "runs 0.00223607 m along"),
)


@pytest.mark.parametrize(("old", "new", "said"), SWAPS, ids=[said for *_, said in SWAPS])
def test_what_it_cannot_be_is_said(file: Path, old: str, new: str, said: str) -> None:
    file.write_text(model().replace(old, new), encoding="utf-8")
    with pytest.raises(CondyleError, match=said):
        from_osim(file, "head")


def test_hostile_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.osim"
    for text, said in (
        (BOMB.encode(), "document type"),
        (BOMB.encode("utf-16"), "document type"),
        (b"<a>" * 200, "XML_DEPTH"),
        (b"<OpenSimDocument", "is not XML"),
        (b"", "is not XML"),
        (b'<?xml version="1.0" encoding="no-such"?><a/>', "is not XML"),
    ):
        path.write_bytes(text)
        with pytest.raises(CondyleError, match=said):
            from_osim(path, "a")
