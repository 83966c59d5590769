"""The largest bite against linear programs of another solver, on equations written here."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import condyle
from condyle.errors import InputError

clarabel = pytest.importorskip("clarabel")


def programs(machine: condyle.Mechanism, pose: np.ndarray, at: np.ndarray) -> Any:
    """Equality rows of cables, planes and weight, about O_M, by vectors in space."""
    place, R = pose[:3], Rotation.from_euler("XYZ", pose[3:]).as_matrix()
    columns, low, high = [], [], []
    for chain in machine.chains:
        lever = R @ np.array(chain.platform)
        pull = np.array(chain.base) - place - lever
        columns.append(pull / np.linalg.norm(pull))
        columns[-1] = np.concatenate([columns[-1], np.cross(lever, columns[-1])])
        ends = chain.actuator.effort_range
        low.append(ends[0])
        high.append(ends[1])
    for contact in machine.contacts:
        sx, sy = contact.surface.slope
        down = np.array([sx, sy, -1.0]) / np.sqrt(sx * sx + sy * sy + 1)  # the skull is above
        lever = R @ np.array(contact.point)
        columns.append(np.concatenate([down, np.cross(lever, down)]))
        low.append(0.0)
        high.append(np.inf)
    weight = machine.platform.mass * np.array(machine.gravity)
    needed = -np.concatenate([weight, np.zeros(3)])
    lever = R @ at
    return np.array(columns).T, needed, lever, np.array(low), np.array(high)


def by_clarabel(
    machine: condyle.Mechanism, pose: np.ndarray, at: np.ndarray, towards: np.ndarray
) -> float:
    from scipy.sparse import csc_array, vstack

    A, needed, lever, low, high = programs(machine, pose, at)
    push = np.concatenate([towards, np.cross(lever, towards)])
    rows = np.column_stack([A, push]) * [[1], [1], [1], [50], [50], [50]]
    right = needed * [1, 1, 1, 50, 50, 50]
    count = A.shape[1] + 1
    own = np.flatnonzero(np.isfinite(high))
    G = vstack([csc_array(rows), csc_array(-np.eye(count)), csc_array(np.eye(count)[own])])
    h = np.concatenate([right, -low, [0.0], high[own]])
    cones = [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(count + len(own))]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    cost = np.zeros(count)
    cost[-1] = -1.0
    found = clarabel.DefaultSolver(
        csc_array((count, count)), cost, csc_array(G), h, cones, settings
    ).solve()
    return 0.0 if "Infeasible" in str(found.status) else float(found.x[-1])


def compared(count: int, seed: int) -> int:
    rng, jaw = np.random.default_rng(seed), condyle.load_mechanism("human-jaw")
    model = condyle.derive(jaw, backend="numpy")
    some = 0
    for _ in range(count):
        point = str(rng.choice(["right_molar", "incisor", "left_canine"]))
        over = f"beta={rng.uniform(0, 5):.6f}:{rng.uniform(6, 25):.6f}:2 deg"
        towards = rng.normal(size=3) - [0, 0, 2]
        found = condyle.largest_bite(model, point, towards, over)
        q = np.zeros((2, 4))
        q[:, 3] = found.over[1]  # type: ignore[index]
        poses = model.inverse_kinematics(q).pose
        at = np.array(jaw.platform.points[point])
        for pose, force in zip(poses, found.force[:, 0], strict=True):
            right = by_clarabel(jaw, pose, at, towards / np.linalg.norm(towards))
            assert abs(force - right) < 1e-6, (point, towards, force, right)
            some += force > 1
    return some


def test_against_another_solver() -> None:
    assert compared(4, 0) >= 4


@pytest.mark.ci
def test_two_hundred_against_another_solver() -> None:
    assert compared(100, 1) > 100


def test_a_bite_at_its_limits() -> None:
    """A little less can be held by efforts within limits, a little more can not."""
    found = condyle.largest_bite("human-jaw")
    force = float(found.force[0, 0])
    assert 400 < force < 1000 and found.saturated()
    assert set(found.saturated()) <= set(found.mechanism.chain_names)
    model, home = condyle.derive("human-jaw", backend="numpy"), np.zeros(4)
    for share, status in ((0.999, 0), (1.001, 4)):
        wrench = [0, 0, -share * force, 0, 0, 0]
        assert model.inverse_dynamics(home, home, home, wrench, "right_molar").status == status


def test_an_opening_and_a_table(tmp_path: Path) -> None:
    found = condyle.largest_bite("human-jaw", "incisor", [(0, 0, -1), (0, 1, -1)], "opening=0:30:3")
    assert found.force.shape == (3, 2) and (found.force > 0).all()
    assert found.over is not None
    np.testing.assert_allclose(found.over[1], [0, 0.015, 0.03])
    found.save(tmp_path / "bites.csv")
    head, *rows = (tmp_path / "bites.csv").read_text().strip().split("\n")
    assert head.startswith("opening,direction_x") and len(rows) == 6
    # The incisor is where it should be.
    model = condyle.derive("human-jaw", backend="numpy")
    q = model.poses.states(
        ("x", "y", "z"), tuple(np.array([[-0.03 * 5.8 / 20.1, 0, -0.03]]) * x for x in (1, 0, 0)),
        landmark="incisor",
    )[0]  # fmt: skip
    pose = model.inverse_kinematics(q).pose[0]
    tip = np.array(found.mechanism.platform.points["incisor"])
    moved = pose[:3] + Rotation.from_euler("XYZ", pose[3:]).apply(tip) - tip
    np.testing.assert_allclose(moved[2], -0.03, atol=1e-9)


def test_muscles_are_weaker_where_they_are_short() -> None:
    cables = condyle.largest_bite("human-jaw", over="opening=0:20:2")
    fibres = condyle.largest_bite("human-jaw-muscles", over="opening=0:20:2")
    assert (fibres.force < cables.force).all() and (fibres.force > 100).all()
    assert fibres.force[1, 0] > fibres.force[0, 0]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"point": "ear"}, "ear"),
        ({"direction": (0, 0, 0)}, "direction"),
        ({"direction": (1, 2)}, "direction"),
        ({"over": "opening=0:40"}, "opening=FROM"),
        ({"over": "opening=10:0:3"}, "opening=FROM"),
        ({"over": "gape=0:1:3"}, "gape"),
    ],
)
def test_what_it_refuses(given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        condyle.largest_bite("human-jaw", **given)


def test_a_machine_without_limits() -> None:
    robot = condyle.load_mechanism("masticatory")
    none = {f"chain.{name}.actuator.torque_limit": None for name in robot.chain_names}
    with pytest.raises(InputError, match="no chain has a limit"):
        condyle.largest_bite(robot.set(none))
