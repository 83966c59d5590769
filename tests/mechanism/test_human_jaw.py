"""The human jaw: published numbers, static bites found independently, and that it can chew."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machines import model

import condyle
from condyle.distribution import Outcome, Problem, distribute
from condyle.mechanism import Contact, Mechanism
from condyle.mechanism.chain import limits

TABLE = Path(__file__).parents[1] / "distribution" / "human_jaw.csv"
MIRROR = np.array([1, -1, 1])


@pytest.fixture(scope="module", params=["human-jaw", "human-jaw-curved", "human-jaw-nurbs"])
def jaw(request: pytest.FixtureRequest) -> Mechanism:
    return condyle.load_mechanism(request.param)


def wrench(force: Any, arm: Any) -> list[float]:
    return [*force, *np.cross(arm, force)]


def pull(chain: Any) -> list[float]:
    """Of a unit pull of a chain at home, towards its base."""
    line = np.subtract(chain.base, chain.platform)
    return wrench(line / np.linalg.norm(line), chain.platform)


def height(contact: Contact, x: float, y: float) -> float:
    """z of the surface over (x, y) [m]: its equation is z - f(x, y) = 0."""
    return -float(contact.surface.phi((x, y, 0.0)))


def distributed(jaw: Mechanism, Q: Any, J: Any, normal: Any) -> tuple[np.ndarray, np.ndarray]:
    """Joint loads [N] and activations that balance wrenches, both balls pushed from above."""
    low, high = np.array([limits(chain)[:2] for chain in jaw.chains]).T
    push = np.full(2, -1.0)  # the ball is below: a push is along -n
    J, normal = np.array(J), np.array(normal)
    found = distribute(Problem(np.array(Q), J, normal, low=low, high=high, push=push), "cubic")
    assert (found.status == Outcome.ok).all()
    return -found.contact_force, found.effort / high


def test_numbers_are_published_and_both_sides_mirror_images(jaw: Mechanism) -> None:
    rows = {f"{row['muscle']}_{row['side']}": row for row in csv.DictReader(TABLE.open())}
    assert list(jaw.chain_names) == list(rows)
    for chain in jaw.chains:
        row = rows[chain.name]
        for place, key in ((chain.base, "base"), (chain.platform, "jaw")):
            wanted = [float(row[f"{key}_{axis}_mm"]) / 1e3 for axis in "xyz"]
            np.testing.assert_allclose(place, wanted, atol=1e-12)
        assert chain.kind == "cable"
        assert limits(chain)[:2] == (0.0, float(row["max_force_N"]))
    places = {c.name: [c.base, c.platform] for c in jaw.chains}
    places |= {c.name: [c.point] for c in jaw.contacts}
    places |= {name: [point] for name, point in jaw.platform.points.items()}
    for name, points in places.items():
        if "left" in name:
            other = places[name.replace("left", "right")]
            np.testing.assert_array_equal(np.array(points) * MIRROR, other)
    left, right = jaw.contacts
    assert left.surface == right.surface
    assert all(c.one_sided and c.side == "below" for c in jaw.contacts)
    assert {"incisor", "chin", "left_canine", "left_molar"} <= set(jaw.platform.points)


def test_static_bites_of_the_jaw_on_planes() -> None:
    """Found independently with the same numbers; the model's Jacobian is the one they used."""
    jaw = condyle.load_mechanism("human-jaw")
    pulls = [pull(chain) for chain in jaw.chains]
    slopes = [height(c, 1.0, 0.0) - height(c, 0.0, 0.0) for c in jaw.contacts]
    lines = [np.array([-s, 0.0, 1.0]) / np.hypot(s, 1.0) for s in slopes]
    normals = [wrench(n, c.point) for n, c in zip(lines, jaw.contacts, strict=True)]

    def bite(force: float, point: str) -> tuple[np.ndarray, float]:
        """Joint loads and the greatest activation, at home."""
        load = np.array(wrench([0, 0, -force], jaw.platform.points[point]))
        load[2] -= jaw.platform.mass * 9.81
        joints, activation = distributed(jaw, [-load], [pulls], [normals])
        return joints[0], activation.max()

    molar, activation = bite(100.0, "right_molar")
    np.testing.assert_allclose(molar, [25.2, 18.5], atol=0.05)
    assert activation == pytest.approx(0.178, abs=5e-4)
    np.testing.assert_allclose(bite(100.0, "incisor")[0], 92.9, atol=0.06)
    assert bite(600.0, "right_molar")[1] == pytest.approx(1.0)
    np.testing.assert_allclose(bite(100.0, "left_molar")[0], molar[::-1], rtol=1e-9)
    J_theta = model("human-jaw").jacobians(np.zeros((1, 4))).J_theta[0]
    np.testing.assert_allclose(J_theta, pulls, atol=1e-14)


def test_the_curve_is_the_published_one() -> None:
    """34.9 degrees falling to 9.9 over 12 mm, and never beyond a micrometre off."""
    for contact in condyle.load_mechanism("human-jaw-curved").contacts:
        x, y, z = contact.point
        u = np.linspace(0, 12, 61)
        down = 0.69813 * u - 0.026733 * u**2 + 0.00027313 * u**3
        found = np.array([height(contact, x + v / 1e3, y) for v in u])
        np.testing.assert_allclose(found, z - down / 1e3, atol=1e-6)
        steep = np.degrees(np.arctan(np.diff(found) / np.diff(u / 1e3)))
        np.testing.assert_allclose(steep[[0, -1]], [-34.8, -10.0], atol=0.2)


def test_the_nurbs_path_is_the_published_one() -> None:
    """Three Bezier arcs, which a quadratic curve of even knots consists of; found by its own
    control points, whose condyles are 51.614 mm beside the middle and 19.922 mm forward.
    """
    places = [[19.081, -73.75], [20.457, -73.682], [25.31, -76.002], [29.926, -77.513]]
    P = np.array([*places, [32.174, -77.219]])
    joints = (P[1:3] + P[2:4]) / 2
    arcs = [(P[0], P[1], joints[0]), (joints[0], P[2], joints[1]), (joints[1], P[3], P[4])]
    u = np.linspace(0, 1, 201)[:, None]
    path = np.concatenate([(1 - u) ** 2 * a + 2 * u * (1 - u) * b + u**2 * c for a, b, c in arcs])
    ways = np.concatenate([(1 - u) * (b - a) + u * (c - b) for a, b, c in arcs])
    home = np.interp(19.922, *path.T)
    for contact in condyle.load_mechanism("human-jaw-nurbs").contacts:
        x, y, z = contact.point
        assert abs(y) == 0.051614
        forward, up = (path - [19.922, home]).T / 1e3
        found = [height(contact, x + v, y) - z for v in forward]
        np.testing.assert_allclose(found, up, atol=1e-6)
        steps = [[height(contact, x + v + e, y) for v in forward] for e in (-1e-6, 1e-6)]
        slopes = np.arctan(np.diff(steps, axis=0)[0] / 2e-6)
        np.testing.assert_allclose(slopes, np.arctan2(*ways.T[::-1]), atol=np.radians(0.2))
        np.testing.assert_allclose(contact.bounds.x, x + forward[[0, -1]], atol=1e-6)


@pytest.mark.parametrize("name", ["human-jaw-curved", "human-jaw-nurbs"])
def test_it_can_chew(name: str) -> None:
    """The bundled path of the incisor is within its surfaces, away from singularities."""
    whole = condyle.reference_motion()
    path = dict(zip("xyz", whole.value[::100].T, strict=True))
    motion = condyle.Motion.from_arrays(whole.t[::100], path, landmark="incisor")
    solution = model(name).solve(motion, condyle.reference_load())
    assert (solution["status"].values == 0).all()
    assert not [n for n in solution.condyle.notices if n.kind in ("bounds", "near_singularity")]
    travel = np.ptp(solution["contact_point"].values[:, :, 0], axis=0)
    assert (travel > 1e-3).all() and (travel < 12e-3).all()
