"""The largest bite against linear programs of another solver, on equations written here."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csc_array, vstack
from scipy.spatial.transform import Rotation
from support.machines import model

import condyle
from condyle.errors import InputError

clarabel = pytest.importorskip("clarabel")
JAW = condyle.load_mechanism("human-jaw")
HOME = np.zeros(4)


def by_clarabel(pose: np.ndarray, at: np.ndarray, towards: np.ndarray) -> float:
    """Cables, planes, weight and the bite in balance about O_M, by vectors in space."""
    place, R = pose[:3], Rotation.from_euler("XYZ", pose[3:]).as_matrix()
    lines, low, high = [], [], []
    for chain in JAW.chains:
        pull = np.array(chain.base) - place - R @ np.array(chain.platform)
        lines.append((R @ np.array(chain.platform), pull / np.linalg.norm(pull)))
        low.append(chain.actuator.effort_range[0])
        high.append(chain.actuator.effort_range[1])
    for contact in JAW.contacts:
        sx, sy = contact.surface.slope
        down = np.array([sx, sy, -1.0]) / np.sqrt(sx * sx + sy * sy + 1)  # the skull is above
        lines.append((R @ np.array(contact.point), down))
        low.append(0.0)
        high.append(np.inf)
    lines.append((R @ at, towards))
    columns = [np.concatenate([force, 50 * np.cross(lever, force)]) for lever, force in lines]
    weight = JAW.platform.mass * np.array(JAW.gravity)
    count, limited = len(columns), np.flatnonzero(np.isfinite(high))
    eye = np.eye(count)
    G = vstack([csc_array(np.array(columns).T), csc_array(-eye), csc_array(eye[limited])])
    h = np.concatenate([-weight, np.zeros(3), -np.array([*low, 0.0]), np.array(high)[limited]])
    cones = [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(count + len(limited))]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    problem = csc_array((count, count)), -eye[-1], csc_array(G), h, cones, settings
    found = clarabel.DefaultSolver(*problem).solve()
    return 0.0 if "Infeasible" in str(found.status) else float(found.x[-1])


@pytest.mark.parametrize(
    ("count", "seed", "some"), [(4, 0, 4), pytest.param(40, 1, 40, marks=pytest.mark.ci)]
)
def test_against_another_solver(count: int, seed: int, some: int) -> None:
    rng, forces = np.random.default_rng(seed), []
    for _ in range(count):
        point = str(rng.choice(["right_molar", "incisor", "left_canine"]))
        over = f"beta={rng.uniform(0, 5):.6f}:{rng.uniform(6, 25):.6f}:2 deg"
        towards = rng.normal(size=3) - [0, 0, 2]
        found = condyle.largest_bite(model("human-jaw"), point, towards, over)
        q = np.zeros((2, 4))
        q[:, 3] = found.over[1]  # type: ignore[index]
        at, towards = np.array(JAW.platform.points[point]), towards / np.linalg.norm(towards)
        poses = model("human-jaw").inverse_kinematics(q).pose
        right = [by_clarabel(pose, at, towards) for pose in poses]
        np.testing.assert_allclose(found.force[:, 0], right, rtol=0, atol=1e-6)
        forces += right
    assert sum(force > 1 for force in forces) >= some


def test_a_bite_at_its_limits() -> None:
    """A little less can be held by efforts within limits, a little more can not."""
    found = condyle.largest_bite("human-jaw")
    force = float(found.force[0, 0])
    assert 400 < force < 1000 and found.saturated()
    assert set(found.saturated()) <= set(found.mechanism.chain_names)
    for share, status in ((0.999, 0), (1.001, 4)):
        wrench = [0, 0, -share * force, 0, 0, 0]
        got = model("human-jaw").inverse_dynamics(HOME, HOME, HOME, wrench, "right_molar")
        assert got.status == status


def test_one_opening_and_a_bite_by_coordinates() -> None:
    one, three = (
        condyle.largest_bite("human-jaw", over=over) for over in ("opening=14", "opening=0:28:3")
    )
    assert one.over is not None and one.over[1].tolist() == [0.014]
    np.testing.assert_array_equal(one.force[0], three.force[1])
    both = condyle.largest_bite("human-jaw", "right_molar;left_molar")
    x, _, z = JAW.platform.points["right_molar"]
    middle = condyle.largest_bite("human-jaw", f"{x!r},0,{z!r}")
    assert both.force[0, 0] == pytest.approx(middle.force[0, 0], rel=1e-9)
    force = both.force[0, 0]
    assert by_clarabel(np.zeros(6), np.array([x, 0.0, z]), np.array([0, 0, -1.0])) == (
        pytest.approx(force, rel=1e-6)
    )


def test_an_opening_and_a_table(tmp_path: Path) -> None:
    """By 30 mm the incisor is where it should be."""
    found = condyle.largest_bite("human-jaw", "incisor", [(0, 0, -1), (0, 1, -1)], "opening=0:30:3")
    assert found.force.shape == (3, 2) and (found.force > 0).all() and found.over is not None
    np.testing.assert_allclose(found.over[1], [0, 0.015, 0.03])
    found.save(tmp_path / "bites.csv")
    head, *rows = (tmp_path / "bites.csv").read_text().strip().split("\n")
    assert head.startswith("opening,direction_x") and len(rows) == 6
    way = np.array([[-0.03 * 5.8 / 20.1, 0, -0.03]])
    poses = model("human-jaw").poses
    q = poses.states(("x", "y", "z"), (way, 0 * way, 0 * way), landmark="incisor")[0]
    pose = model("human-jaw").inverse_kinematics(q).pose[0]
    tip = np.array(JAW.platform.points["incisor"])
    moved = pose[:3] + Rotation.from_euler("XYZ", pose[3:]).apply(tip) - tip
    np.testing.assert_allclose(moved[2], -0.03, atol=1e-9)


def test_muscles_are_weaker_where_they_are_short() -> None:
    machines = ("human-jaw", "human-jaw-muscles")
    cables, fibres = (condyle.largest_bite(name, over="opening=0:20:2") for name in machines)
    assert (fibres.force < cables.force).all() and (fibres.force > 100).all()
    assert fibres.force[1, 0] > fibres.force[0, 0]


def test_what_it_refuses() -> None:
    robot = condyle.load_mechanism("masticatory")
    none = {f"chain.{name}.actuator.torque_limit": None for name in robot.chain_names}
    cases: list[tuple[dict[str, Any], str]] = [
        ({"point": "ear"}, "ear"), ({"direction": (0, 0, 0)}, "direction"),
        ({"direction": (1, 2)}, "direction"), ({"over": "opening=0:40"}, "opening=FROM"),
        ({"over": "opening=10:0:3"}, "opening=FROM"), ({"over": "gape=0:1:3"}, "gape"),
        ({"mechanism": robot.set(none)}, "no chain has an effort limit"),
    ]  # fmt: skip
    for given, said in cases:
        with pytest.raises(InputError, match=said):
            condyle.largest_bite(**{"mechanism": "human-jaw"} | given)
