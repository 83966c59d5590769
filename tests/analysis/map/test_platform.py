"""The Gough-Stewart platform: slices whose borders and singular curves are known in closed form."""

import tomllib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.machines import model as model_from

from condyle.analysis.map.axes import Grid, grid_of
from condyle.analysis.map.compute import setup_of
from condyle.analysis.map.lines import Line, lines_of
from condyle.analysis.map.reach import Reach
from condyle.analysis.map.volume import reachable_volume
from condyle.mechanism import bundled_text
from condyle.model.model import Model

RAW = tomllib.loads(bundled_text("gough-stewart"))
BASES, JOINTS = (np.array([c[k] for c in RAW["chain"]], float) for k in ("base", "platform"))
HOME = np.linalg.norm(JOINTS - BASES, axis=1)
ANGLES = (0.1, -0.05, 0.2)
STROKE = (-0.6, 0.5)


def shells() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """At a fixed orientation O_M is between two spheres for each leg: centres, radii."""
    centres = BASES - Rotation.from_euler("XYZ", ANGLES).apply(JOINTS)
    return centres, HOME + STROKE[0], HOME + STROKE[1]


def at_a_height(model: Model, count: int) -> tuple[Grid, Reach]:
    """X and Y at Z = 0.1 and that orientation, and the reach within the strokes."""
    hold = {"Z": 0.1, **dict(zip(("alpha", "beta", "gamma"), ANGLES, strict=True))}
    grid = grid_of(model.mechanism, dict.fromkeys("XY", (-3.0, 3.0, count)), hold)
    return grid, setup_of(model, stroke=f"*={STROKE[0]}:{STROKE[1]}").reach


def test_area_between_spherical_shells() -> None:
    """Exact intervals of Y at many X, summed: the slice Z = 0.1 of an intersection of shells."""
    grid, reach = at_a_height(model_from("gough-stewart"), 60)
    found = reachable_volume(reach.margin, grid, budget=150_000)
    centres, near, far = shells()
    x = (np.arange(40_000) + 0.5) / 40_000 * 6 - 3
    exact = sum(lengths(x, centres, near, far)) * 6 / 40_000
    assert found.value == pytest.approx(exact, rel=1e-3)
    assert abs(found.value - exact) < found.bound
    assert abs(found.value - exact) < 20 * found.error + 1e-6 * exact


def lengths(x: np.ndarray, centres: np.ndarray, near: np.ndarray, far: np.ndarray) -> list[float]:
    """Of {y in [-3, 3]: inside all outer and outside all inner circles} at each x."""
    found = []
    high, low = np.full(len(x), 3.0), np.full(len(x), -3.0)
    holes = []
    for (cx, cy, cz), inner, outer in zip(centres, near, far, strict=True):
        rest = outer**2 - (0.1 - cz) ** 2 - (x - cx) ** 2
        half = np.sqrt(np.maximum(rest, 0))
        high = np.where(rest > 0, np.minimum(high, cy + half), -4.0)
        low = np.maximum(low, cy - half)
        rest = inner**2 - (0.1 - cz) ** 2 - (x - cx) ** 2
        half = np.sqrt(np.maximum(rest, 0))
        holes.append((cy - half, cy + half))
    for i in range(len(x)):
        at, total = low[i], 0.0
        for a, b in sorted((h[0][i], h[1][i]) for h in holes):
            total += max(min(a, high[i]) - at, 0.0)
            at = max(at, b)
        found.append(total + max(high[i] - at, 0.0))
    return found


def test_borders_lie_on_the_spheres() -> None:
    grid, reach = at_a_height(model := model_from("gough-stewart"), 41)
    lines = lines_of(reach, grid)
    borders = [line for line in lines if line.kind == "stroke"]
    assert len(borders) >= 3
    centres, near, far = shells()
    names = model.mechanism.chain_names
    for line in borders:
        at = np.column_stack([line.points, np.full(len(line.points), 0.1)])
        distance = np.linalg.norm(at[:, None] - centres, axis=2)
        own = distance[:, i := names.index(line.name)]
        assert np.minimum(abs(own - near[i]), abs(own - far[i])).max() < 1e-9
        inside = (distance > near - 1e-8) & (distance < far + 1e-8)
        assert inside.all()  # no other leg forbids what is drawn as the border
    ends = np.array([end for line in borders if not line.closed for end in line.points[[0, -1]]])
    for end in ends:  # borders meet in corners
        assert np.sort(np.linalg.norm(ends - end, axis=1))[1] < 1e-6


def sigma(pose: np.ndarray) -> np.ndarray:
    """Singular values of the legs' lines, angles divided by the mean lever: Pluecker rows."""
    R = Rotation.from_euler("XYZ", pose[3:]).as_matrix()
    levers = JOINTS @ R.T
    legs = pose[:3] + levers - BASES
    legs /= np.linalg.norm(legs, axis=1, keepdims=True)
    moments = np.cross(levers, legs)
    return np.linalg.svd(np.hstack([legs, moments]), compute_uv=False)


def singular(over: list[str], hold: str = "") -> list[Line]:
    model = model_from("gough-stewart")
    lines = lines_of(setup_of(model).reach, grid_of(model.mechanism, over, hold))
    return [line for line in lines if line.kind == "singular"]


def test_singular_turns_of_a_quarter() -> None:
    """Parallel to the base, this platform is singular where it is turned by 90 degrees."""
    found = singular(["X=-500:500:11 mm", "gamma=-120:120:31 deg"])
    assert len(found) == 2
    for line in found:
        np.testing.assert_allclose(np.abs(line.points[:, 1]), np.pi / 2, atol=1e-9)
        assert sorted(line.points[[0, -1], 0]) == pytest.approx([-0.5, 0.5])


def test_singular_curves_cross_where_sigma_vanishes() -> None:
    found = singular(["alpha=-60:60:25 deg", "gamma=-120:120:31 deg"], "X=300 mm,beta=0.2")
    points = np.vstack([line.points for line in found])
    assert len(points) > 40 and np.ptp(points[:, 0]) > 1
    for alpha, gamma in points[::3]:
        values = sigma(np.array([0.3, 0, 0, alpha, 0.2, gamma]))
        assert values[-1] < 1e-6 * values[0]
    # Beside the curves it does not vanish: they are crossed, not grazed.
    values = sigma(np.array([0.3, 0, 0, points[0, 0], 0.2, points[0, 1] - 0.05]))
    assert values[-1] > 5e-4 * values[0]
