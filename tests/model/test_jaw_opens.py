"""Free movements of the jaw with muscles: none is infeasible, by a linear program of this file.

Poses by six equations of planes and points, moment arms by vectors in space, speeds and
accelerations by central differences; fibres' curves by SymPy.
"""

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from model.test_muscles import curves
from scipy.interpolate import CubicSpline
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

import condyle
from condyle.analysis.session.cycle_finding import spans
from condyle.markers.session_file import Cycles
from condyle.status import Status

JAW = condyle.load_mechanism("human-jaw-muscles")
INCISOR = np.array(JAW.platform.points["incisor"])
LEFT, RIGHT = (np.array(contact.point) for contact in JAW.contacts)
FALL = np.array(JAW.contacts[0].surface.slope)
STEP, MILLI = 1e-4, 1e-3  # s, of differences;  m
PERIOD = 1.0  # s, there and back
# What each movement prescribes at a part s of it, beside both condyles on their planes.
MOVEMENTS: dict[str, Callable[..., list[float]]] = {
    "opening 45 mm": lambda s, incisor, left, right: [
        incisor[0] + 0.29 * 45e-3 * s, incisor[2] + 45e-3 * s, incisor[1], left[1] + right[1]],
    "protrusion 8 mm": lambda s, incisor, left, right: [
        incisor[0] - 8e-3 * s, incisor[2] + 8e-3 * s, incisor[1], left[1] + right[1]],
    "lateral 8 mm": lambda s, incisor, left, right: [
        incisor[1] - 8e-3 * s, incisor[2] + 6e-3 * s, left[0], left[1]],
}  # fmt: skip


@cache
def path(name: str) -> CubicSpline:
    """The pose over s, by equations of this file."""

    def wrong(pose: np.ndarray, s: float) -> np.ndarray:
        R = Rotation.from_euler("XYZ", pose[3:])
        moved = [pose[:3] + R.apply(p) - p for p in (INCISOR, LEFT, RIGHT)]
        falls = [shift[2] - FALL @ shift[:2] for shift in moved[1:]]
        return np.array([*falls, *MOVEMENTS[name](s, *moved)]) / MILLI

    parts, poses, nudge = np.linspace(0, 1, 31), [np.zeros(6)], 1e-7 * np.eye(6)
    for s in parts[1:]:
        pose = poses[-1]
        for _ in range(5):  # Newton's method, by central differences
            slopes = [(wrong(pose + d, s) - wrong(pose - d, s)) / 2e-7 for d in nudge]
            pose = pose - np.linalg.solve(np.transpose(slopes), wrong(pose, s))
        assert np.abs(wrong(pose, s)).max() < 1e-9
        poses.append(pose)
    return CubicSpline(parts, poses)


def pose_at(name: str, t: float) -> np.ndarray:
    return path(name)((1 - np.cos(2 * np.pi * t / PERIOD)) / 2)


def lines(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lengths of the muscles, their directions and their levers about O_M, in {S}."""
    lever = Rotation.from_euler("XYZ", pose[3:]).apply([c.platform for c in JAW.chains])
    pull = np.array([c.base for c in JAW.chains]) - pose[:3] - lever
    length = np.linalg.norm(pull, axis=1)
    return length, pull / length[:, None], lever


def held(jaw: Any, name: str, t: float) -> bool:
    """Whether activations of 0 to 1 and joints that push balance the movement at an instant."""
    before, pose, after = (pose_at(name, t + k * STEP) for k in (-1, 0, 1))
    turns = [Rotation.from_euler("XYZ", p[3:]) for p in (before, pose, after)]
    spin = [(b * a.inv()).as_rotvec() / STEP for a, b in pairwise(turns)]
    acceleration = (after - 2 * pose + before)[:3] / STEP**2
    R, omega, turning = turns[1].as_matrix(), sum(spin) / 2, (spin[1] - spin[0]) / STEP
    I = jaw.platform.inertia
    inertia = R @ np.diag([I.xx, I.yy, I.zz]) @ R.T
    force = jaw.platform.mass * (acceleration - np.array(jaw.gravity))
    moment = inertia @ turning + np.cross(omega, inertia @ omega)
    f_L, f_V, f_P = curves()
    length, pull, lever = lines(pose)
    speed = (lines(after)[0] - lines(before)[0]) / (2 * STEP)
    columns, needed = [], np.r_[force, 50 * moment]
    for i, chain in enumerate(jaw.chains):
        m = chain.muscle
        l, v = (length[i] - m.tendon_length) / m.optimal_length, speed[i] / m.optimal_length
        # SymPy's f_P is 1 at a strain of 0.6.
        passive = f_P(1 + (l - 1) * 0.6 / m.passive_strain) if l > 1 else 0.0
        active = f_L(l) * max(f_V(v / m.max_speed), 0.0)
        unit = m.max_force * np.r_[pull[i], 50 * np.cross(lever[i], pull[i])]
        columns.append(active * unit)
        needed = needed - passive * unit
    for ball in (LEFT, RIGHT):
        down = np.r_[FALL, -1.0] / np.linalg.norm(np.r_[FALL, -1.0])
        columns.append(np.r_[down, 50 * np.cross(R @ ball, down)])
    bounds = [(0, 1)] * len(jaw.chains) + [(0, None)] * 2
    found = linprog(np.zeros(len(columns)), A_eq=np.array(columns).T, b_eq=needed, bounds=bounds)
    return bool(found.status == 0)


def solved(jaw: Any, name: str, t: np.ndarray) -> np.ndarray:
    poses = np.array([[pose_at(name, u + k * STEP) for u in t] for k in (-1, 0, 1)])
    q = poses[..., [0, 1, 3, 4]]
    rates = (q[2] - q[0]) / (2 * STEP), (q[2] - 2 * q[1] + q[0]) / STEP**2
    return condyle.derive(jaw, backend="numpy").inverse_dynamics(q[1], *rates).status


@pytest.mark.parametrize("name", MOVEMENTS)
def test_free_movements_are_feasible(name: str) -> None:
    t = np.linspace(0, PERIOD, 61)
    assert (solved(JAW, name, t) == 0).all()
    assert all(held(JAW, name, u) for u in t[::6])


def test_passive_force_of_limbs_would_keep_it_shut() -> None:
    """The program of this file and the library agree where passive forces are too much."""
    stiff = JAW.set({f"chain.{c}.muscle.passive_strain": 0.6 for c in JAW.chain_names})
    t = np.linspace(0, PERIOD, 21)
    ours = np.array([held(stiff, "opening 45 mm", u) for u in t])
    assert 0 < ours.sum() < len(t)
    np.testing.assert_array_equal(solved(stiff, "opening 45 mm", t) == 0, ours)


def test_the_bite_falls_from_its_greatest_with_the_gape() -> None:
    for point, widest in (("right_molar", (0.010, 0.020)), ("incisor", (0.005, 0.015))):
        found = condyle.largest_bite(JAW, point, over="opening=0:40:9")
        force, gape = found.force[:, 0], found.over[1]
        top = int(force.argmax())
        assert widest[0] <= gape[top] <= widest[1]
        assert (np.diff(force[top:]) < 0).all() and force[-1] > 50


def test_what_muscles_cannot_hold_keeps_its_motion() -> None:
    """Infeasible samples have poses, fibres and contact points; cycles are found through them."""
    stiff = JAW.set({f"chain.{c}.muscle.passive_strain": 0.6 for c in JAW.chain_names})
    t = np.linspace(0, 3 * PERIOD, 181)
    poses = np.array([pose_at("opening 45 mm", u) for u in t])
    motion = condyle.Motion.from_arrays(
        t, poses[:, [0, 1, 3, 4]], names=("X", "Y", "alpha", "beta")
    )
    found = condyle.derive(stiff, backend="numpy").solve(motion, flag=True)
    infeasible = found["status"].values == Status.infeasible
    assert 20 < infeasible.sum() < len(t) and not (found["status"].values % 4).any()
    np.testing.assert_allclose(found["pose"].values, poses, atol=1e-9)
    for name in ("fibre_length", "passive_force", "ligament_force", "contact_point"):
        assert np.isfinite(found[name].values).all(), name
    assert np.isnan(found["effort"].values[infeasible]).all()
    cycles = spans(t, found["pose"].values[:, 4], Cycles(by="beta")).ends
    np.testing.assert_allclose(np.diff(cycles, axis=1), PERIOD, atol=0.04)  # it stops at last
