"""Balls that overlap their walls beside where they touch: against the distance of a fine grid."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation
from support.machines import model

from condyle import Model
from condyle.errors import MechanismError
from condyle.mechanism import Contact
from condyle.mechanism.home import home_problem
from condyle.mechanism.surface import Ellipsoid, Expression, Profile, Quadratic
from condyle.mechanism.surface.overlap import TOLERANCE, overlaps
from condyle.status import Status

GRID = 301
SURE = 5e-6  # metres off the tolerance that a grid tells: (0.09 mm to a point)^2 / 2 * 1 / 1 mm


def depth(height, c: np.ndarray, radius: float) -> float:
    """How deep the graph of a height is in a ball, by a grid."""
    u = np.linspace(-radius, radius, GRID)
    x, y = np.meshgrid(c[0] + u, c[1] + u)
    off = (x - c[0]) ** 2 + (y - c[1]) ** 2 + (height(x, y) - c[2]) ** 2
    return radius - float(np.sqrt(off.min()))


def quadratic(rng):
    (xx, xy, yy), (i, j) = rng.normal(0, 40, 3).tolist(), rng.normal(0, 0.4, 2).tolist()
    wall = Quadratic(offset=0.0, slope=(i, j), xx=xx, xy=xy, yy=yy)
    return wall, lambda x, y: i * x + j * y + xx * x * x + xy * x * y + yy * y * y


def egg_box(rng):
    size, i, j = rng.uniform((0.0005, 60, 60), (0.004, 300, 300)).tolist()
    wall = Expression(lambda p: p[2] - size * ca.cos(i * p[0]) * ca.cos(j * p[1]))
    return wall, lambda x, y: size * np.cos(i * x) * np.cos(j * y)


def profile(rng):
    s, z = np.linspace(-0.025, 0.025, 6), rng.normal(0, 0.005, 6)
    spline, ends = CubicSpline(s, z, bc_type="natural"), (s[0], s[-1])
    wall = Profile(direction=(1.0, 0.0), points=tuple(map(tuple, np.column_stack([s, z]).tolist())))

    def height(x, y):
        inner = np.clip(x, *ends)
        return spline(inner) + (x - inner) * spline(inner, 1) + 0 * y

    return wall, height


@pytest.mark.parametrize("kind", [quadratic, egg_box, profile])
def test_graphs(kind) -> None:
    rng, verdicts = np.random.default_rng(0), []
    for _ in range(12):
        wall, height = kind(rng)
        radius, push = rng.uniform(0.004, 0.02), rng.choice([-1, 1])
        at, h = rng.normal(0, 0.01, 2), 1e-6
        slope = [(height(*(at + d)) - height(*(at - d))) / (2 * h) for d in np.eye(2) * h]
        n = np.array([*np.ravel(np.negative(slope)), 1.0])
        c = np.array([*at, float(height(*at))]) + push * radius * n / np.linalg.norm(n)
        side = "above" if push > 0 else "below"
        ball = Contact(
            name="b", point=tuple(c.tolist()), surface=wall, ball_radius=radius, side=side
        )
        locus, true = ball.offset_surface, depth(height, c, radius)
        got = overlaps(locus.form, locus.constants(), c[None])[0]
        if abs(true - TOLERANCE) > SURE:
            assert got == (true > TOLERANCE), (wall, c, radius)
        verdicts.append(got)
        assert (home_problem(ball) is None) == (not got)
    assert {True, False} == set(verdicts)


def test_a_ball_in_an_ellipsoid() -> None:
    """It touches the flat side, and the opposite one is too near, unless the surface ends."""
    for radius, fits in ((0.0049, True), (0.0051, False)):
        wall = Ellipsoid(centre=(0.0, 0.0, 0.0), semi_axes=(0.03, 0.03, 0.005))
        point = (0.0, 0.0, 0.005 - radius)
        ball = Contact(name="b", point=point, surface=wall, ball_radius=radius, side="inside")
        problem = home_problem(ball)
        assert (problem is None) == fits, problem
    assert problem is not None and "the surface is 4.9 mm from its centre" in problem
    assert home_problem(ball.model_copy(update={"bounds": {"z": (0.0, 0.01)}})) is None


RADIUS, BEND = 0.01416, 160.0  # of the ball, and of a valley along the plane's slope


def valley(offside: float, written=Quadratic):
    """masticatory with a ball on one flank of a valley, so far beside its bottom."""
    base = model("masticatory").mechanism
    left, *others = base.contacts
    n = np.array([1.1, -BEND * offside, 1.0])
    foot = np.array(left.point) - RADIUS * n / np.linalg.norm(n)
    y = foot[1] - offside
    z = foot[2] + 1.1 * foot[0] - BEND / 2 * offside**2
    wall: object = Quadratic(offset=z + BEND / 2 * y**2, slope=(-1.1, -BEND * y), yy=BEND / 2)
    if written is Expression:
        wall = Expression(lambda p: p[2] - z + 1.1 * p[0] - BEND / 2 * (p[1] - y) ** 2)
    change = {"surface": wall, "side": "above", "ball_radius": RADIUS}
    machine = base.replace(contacts=(left.model_copy(update=change), *others))
    return machine, lambda x, w: z - 1.1 * x + BEND / 2 * (w - y) ** 2


@pytest.mark.parametrize("written", [Quadratic, Expression])
def test_home_is_refused(written) -> None:
    with pytest.raises(MechanismError, match=r"overlaps the surface at home: .* 12\.92 mm"):
        valley(0.009, written)


@pytest.mark.slow
def test_poses_have_a_status() -> None:
    """Farther down the flank than the other one allows."""
    machine, height = valley(0.012)
    poses = Model(machine, backend="numpy")
    q = np.zeros((9, 4))
    q[:, 1] = np.linspace(-0.0017, 0.0003, 9)
    found = poses.inverse_dynamics(q, 0 * q, 0 * q, outputs=("pose",))
    turned = Rotation.from_euler("XYZ", found.pose[:, 3:]).apply(machine.contacts[0].point)
    deep = np.array([depth(height, c, RADIUS) for c in found.pose[:, :3] + turned])
    sure = np.abs(deep - TOLERANCE) > SURE
    expected = np.where(deep > TOLERANCE, Status.overlap, Status.ok)
    np.testing.assert_array_equal(found.status[sure], expected[sure])
    assert set(found.status.tolist()) == {Status.ok, Status.overlap}
    bad = found.status == Status.overlap
    assert np.isnan(found.effort[bad]).all() and np.isfinite(found.effort[~bad]).all()
    for other in (
        poses.inverse_kinematics(q),
        poses.forward_dynamics(q, 0 * q, np.nan_to_num(found.effort)),
        poses.poses.survey(q),
    ):
        np.testing.assert_array_equal(other.status, found.status)
    assert poses.inverse_dynamics(q[0], 0 * q[0], 0 * q[0]).status == found.status[0]


def test_variants_are_refused_as_files_are() -> None:
    assert not model("masticatory-curved").system.may_overlap
    machine, _ = valley(0.012)
    points = np.tile(machine.contacts[0].point, (3, 1))
    points[:, 1] += (0.0, 0.001, -0.0015)
    batch = Model(machine, backend="numpy").variants({"contact.left_condyle.point": points})
    assert batch.status.tolist() == [Status.ok, Status.ok, Status.refused]
    assert "overlaps" in batch.reason(2) and not batch.reason(0)
