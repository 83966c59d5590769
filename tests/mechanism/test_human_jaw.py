"""The human jaw: published numbers, static bites found independently, and that it can chew."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.rotations import platform_motion

import condyle
from condyle.distribution import Problem, Status, distribute
from condyle.mechanism import Mechanism
from condyle.mechanism.chain import limits
from condyle.model.model import Model
from condyle.motion.reference_case import reference_load, reference_motion

TABLE = Path(__file__).parents[1] / "distribution" / "human_jaw.csv"
NAMES = ("human-jaw", "human-jaw-curved")


def bite(mechanism: Mechanism, force: float, point: str) -> tuple[np.ndarray, np.ndarray]:
    """Joint loads [N] and activations of a static bite: the wrenches by hand, at home."""
    chains, contacts = mechanism.chains, mechanism.contacts
    pulls, normals = [], []
    for chain in chains:
        line = np.subtract(chain.base, chain.platform)
        line /= np.linalg.norm(line)
        pulls.append([*line, *np.cross(chain.platform, line)])
    for contact in contacts:
        slope = surface_slope(contact)
        n = np.array([-slope, 0.0, 1.0]) / np.hypot(slope, 1.0)
        normals.append([*n, *np.cross(contact.point, n)])
    down = np.array([0.0, 0.0, -force])
    wrench = np.array([*down, *np.cross(mechanism.platform.points[point], down)])
    wrench[2] -= mechanism.platform.mass * 9.81
    bounds = np.array([limits(chain)[:2] for chain in chains])
    found = distribute(
        Problem(
            Q=-wrench[None],
            J=np.array(pulls)[None],
            normal=np.array(normals)[None],
            low=bounds[:, 0],
            high=bounds[:, 1],
            push=np.full(2, -1.0),  # the ball is below: a push is along -n
        ),
        "cubic",
    )
    assert found.status[0] == Status.ok
    return -found.contact_force[0], found.effort[0] / bounds[:, 1]


def surface_slope(contact: condyle.mechanism.Contact) -> float:
    """dz/dx where the ball is at home, by differences of the surface's height."""
    x, y, _ = contact.point
    low, high = (height(contact, x + h, y) for h in (-1e-7, 1e-7))
    return (high - low) / 2e-7


def height(contact: condyle.mechanism.Contact, x: float, y: float) -> float:
    """z of the surface over (x, y) [m]: its equation is z - f(x, y) = 0."""
    import casadi as ca

    return -float(ca.evalf(contact.surface.phi(ca.SX([x, y, 0.0]))))


@pytest.mark.parametrize("name", NAMES)
def test_muscles_are_the_published_ones(name: str) -> None:
    mechanism = condyle.load_mechanism(name)
    rows = {f"{row['muscle']}_{row['side']}": row for row in csv.DictReader(TABLE.open())}
    assert list(mechanism.chain_names) == list(rows)
    for chain in mechanism.chains:
        row = rows[chain.name]
        for place, key in ((chain.base, "base"), (chain.platform, "jaw")):
            wanted = [float(row[f"{key}_{axis}_mm"]) / 1e3 for axis in "xyz"]
            np.testing.assert_allclose(place, wanted, atol=1e-12)
        assert chain.kind == "cable"
        assert limits(chain)[:2] == (0.0, float(row["max_force_N"]))


@pytest.mark.parametrize("name", NAMES)
def test_both_sides_are_mirror_images(name: str) -> None:
    mechanism = condyle.load_mechanism(name)
    mirror = np.array([1, -1, 1])
    for chain in mechanism.chains:
        if chain.name.endswith("_left"):
            other = mechanism.get(f"chain.{chain.name.removesuffix('left')}right")
            np.testing.assert_array_equal(np.array(chain.base) * mirror, other.base)
            np.testing.assert_array_equal(np.array(chain.platform) * mirror, other.platform)
    left, right = mechanism.contacts
    np.testing.assert_array_equal(np.array(left.point) * mirror, right.point)
    assert left.surface == right.surface
    assert all(c.one_sided and c.side == "below" for c in mechanism.contacts)
    points = mechanism.platform.points
    for tooth in ("canine", "molar"):
        np.testing.assert_array_equal(
            np.array(points[f"left_{tooth}"]) * mirror, points[f"right_{tooth}"]
        )
    assert {"incisor", "chin"} <= set(points)


def test_static_bites_of_the_jaw_on_planes() -> None:
    """Found independently with the same numbers."""
    jaw = condyle.load_mechanism("human-jaw")
    (left, right), activation = bite(jaw, 100.0, "right_molar")
    assert (left, right) == (pytest.approx(25.2, abs=0.05), pytest.approx(18.5, abs=0.05))
    assert activation.max() == pytest.approx(0.178, abs=5e-4)
    joints, _ = bite(jaw, 100.0, "incisor")
    np.testing.assert_allclose(joints, 92.9, atol=0.06)
    _, activation = bite(jaw, 600.0, "right_molar")
    assert activation.max() == pytest.approx(1.0)
    mirrored, _ = bite(jaw, 100.0, "left_molar")
    np.testing.assert_allclose(mirrored, (right, left), rtol=1e-9)


def test_the_model_puts_the_same_wrenches_on_the_platform() -> None:
    """Jacobian and normals of the model are those that the bites were computed with."""
    jaw = condyle.load_mechanism("human-jaw")
    rows = Model(jaw, backend="numpy").jacobians(np.zeros((1, 4))).J_theta[0]
    for chain, row in zip(jaw.chains, rows, strict=True):
        line = np.subtract(chain.base, chain.platform)
        line /= np.linalg.norm(line)
        np.testing.assert_allclose(row, [*line, *np.cross(chain.platform, line)], atol=1e-14)


def test_the_curve_is_the_published_one() -> None:
    """34.9 degrees falling to 9.9 over 12 mm, and never beyond a micrometre off."""
    for contact in condyle.load_mechanism("human-jaw-curved").contacts:
        x, y, z = contact.point
        u = np.linspace(0, 12, 121)
        down = 0.69813 * u - 0.026733 * u**2 + 0.00027313 * u**3
        found = np.array([height(contact, x + v / 1e3, y) for v in u])
        np.testing.assert_allclose(found, z - down / 1e3, atol=1e-6)
        steep = np.degrees(np.arctan(np.diff(found) / np.diff(u / 1e3)))
        assert (steep[0], steep[-1]) == (
            pytest.approx(-34.8, abs=0.2),
            pytest.approx(-10.0, abs=0.2),
        )


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_it_chews(name: str) -> None:
    """`condyle run` gives it the bundled path of the incisor, which it can follow on its curves."""
    jaw = condyle.load_mechanism(name)
    motion = reference_motion()
    solution = condyle.derive(jaw, backend="numpy").solve(motion)
    assert (solution["status"].values == 0).all()
    assert not [n for n in solution.condyle.notices if n.kind in ("bounds", "near_singularity")]
    travel = np.ptp(solution["contact_point"].values[:, :, 0], axis=0)
    assert (travel > 1e-3).all() and (travel < 12e-3).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_muscles_can_chew_the_bundled_load(name: str) -> None:
    """Within their limits, both condyles pushed, at every 100th sample of the reference case.

    What is to be balanced is what efforts of least norm balance, pulling condyles or not.
    """
    jaw = condyle.load_mechanism(name)
    solution = condyle.derive(jaw, backend="numpy").solve(reference_motion(), reference_load())
    rows = slice(1000, 5001, 100)
    pulls, normals = [], []
    for i, pose in enumerate(solution["pose"].values[rows]):
        motion = platform_motion(pose)
        lines = [(chain.platform, np.asarray(chain.base)) for chain in jaw.chains]
        pulls.append([wrench(motion, point, base) for point, base in lines])
        n = solution["contact_normal"].values[rows][i]
        at = [motion.point(np.asarray(c.point))[0] - motion.origin for c in jaw.contacts]
        normals.append([[*v, *np.cross(r, v)] for r, v in zip(at, n, strict=True)])
    J, N = np.array(pulls), np.array(normals)
    effort, force = (solution[v].values[rows] for v in ("effort", "contact_force"))
    balanced = np.einsum("nij,ni->nj", J, effort) + np.einsum("nij,ni->nj", N, force)
    low, high = np.array([limits(chain)[:2] for chain in jaw.chains]).T
    push = np.full(2, -1.0)
    found = distribute(Problem(balanced, J, N, low=low, high=high, push=push), "cubic")
    assert (found.status == Status.ok).all()
    assert (found.contact_force < 0).all()
    assert 0.1 < (found.effort / high).max() < 0.3


def wrench(motion: Any, point: tuple[float, ...], base: np.ndarray) -> list[float]:
    """Of a unit pull at a point of the platform towards the base, about O_M."""
    M = motion.point(np.asarray(point))[0]
    line = (base - M) / np.linalg.norm(base - M)
    return [*line, *np.cross(M - motion.origin, line)]
