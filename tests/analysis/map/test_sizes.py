"""Volumes, balls, boxes and curves of sets that are known, and against brute force."""

from itertools import product
from math import pi
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support.loads import parts
from support.machines import model as model_from

from condyle.analysis.map import free_space
from condyle.analysis.map.axes import Axis, Grid, grid_of
from condyle.analysis.map.compute import setup_of
from condyle.analysis.map.free_space import FreeSpace, best_box, greatest_ball, greatest_box
from condyle.analysis.map.lines import trace
from condyle.analysis.map.map_size import WorkspaceSize
from condyle.analysis.map.volume import Volume, reachable_volume
from condyle.mechanism.chain import limits
from condyle.report.map_text import size_text
from condyle.results.contacts import bound_margins


def grid(d: int) -> Grid:
    names = ("X", "Y", "Z")[:d]
    return Grid(names, tuple(Axis(name, -1.0, 1.2, 11) for name in names), (0.0,) * d)


@pytest.mark.parametrize(("d", "exact"), [(1, 1.4), (2, pi * 0.49), (3, 4 / 3 * pi * 0.343)])
def test_volume_of_a_ball(d: int, exact: float) -> None:
    found = reachable_volume(lambda q: 0.49 - (q**2).sum(axis=1), grid(d), budget=300_000)
    assert found.value == pytest.approx(exact, rel=3e-4 if d < 3 else 2.5e-3)
    assert abs(found.value - exact) <= max(found.bound, 1e-12)
    assert abs(found.value - exact) <= 20 * found.error + 1e-9
    assert found.share == pytest.approx(found.value / 2.2**d)


def test_volume_where_the_margin_ends() -> None:
    """Half a disk, beyond which the margin is no number; and a small island."""

    def margin(q: np.ndarray) -> np.ndarray:
        return np.where(q[:, 0] > 0.1, np.nan, 0.49 - (q**2).sum(axis=1))

    found = reachable_volume(margin, grid(2), budget=300_000)
    exact = 0.49 * (pi - np.arccos(0.1 / 0.7)) + 0.1 * np.sqrt(0.49 - 0.01)
    assert abs(found.value - exact) < found.bound < 0.01 * exact
    assert found.value == pytest.approx(exact, rel=2e-3)
    # An island smaller than a first cell: the margin says that the border may be near.
    found = reachable_volume(lambda q: 1e-4 - (q**2).sum(axis=1), grid(2), budget=300_000)
    assert found.value == pytest.approx(pi * 1e-4, rel=1e-2)


def by_brute_force(good: np.ndarray, home: tuple[int, ...], sides: list[np.ndarray]) -> float:
    best = -1.0
    ranges = [
        [(a, b) for a in range(h + 1) for b in range(h, n)]
        for h, n in zip(home, good.shape, strict=True)
    ]
    for box in product(*ranges):
        if good[tuple(slice(a, b + 1) for a, b in box)].all():
            best = max(best, np.prod([s[b] - s[a] for s, (a, b) in zip(sides, box, strict=True)]))
    return best


@pytest.mark.parametrize("shape", [(9,), (7, 8), (5, 5, 4)])
def test_boxes_against_brute_force(shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(3)
    for seed in range(15):
        good = rng.random(shape) < 0.9
        home = tuple(int(rng.integers(n)) for n in shape)
        sides = [np.cumsum(rng.random(n) + 0.1) for n in shape]
        found, best = best_box(good, home, sides), by_brute_force(good, home, sides)
        if found is None:
            assert best == -1.0
            continue
        assert good[tuple(slice(a, b + 1) for a, b in found)].all(), seed
        assert all(a <= h <= b for (a, b), h in zip(found, home, strict=True))
        size = np.prod([s[b] - s[a] for s, (a, b) in zip(sides, found, strict=True)])
        assert size == pytest.approx(best, abs=1e-12)


def known(d: int, *margins: Any) -> Any:
    """In the place of a mechanism, margins that are negative where poses are not free."""
    model = SimpleNamespace(characteristic_length=1.0)
    return SimpleNamespace(
        margins=lambda q: np.array([margin(q) for margin in margins]),
        reasons=["plane", "blob"],
        costly=False,
        setup=SimpleNamespace(model=model),
    )


@pytest.mark.parametrize("d", [1, 2, 3])
def test_ball_in_a_known_set(d: int) -> None:
    """FreeSpace but beyond a slanted plane 0.4 away, and in a blob 0.6 away, which has no slope."""
    way = np.array([0.48, 0.6, 0.64])[:d]
    way /= np.linalg.norm(way)
    far = -np.eye(3)[0, :d]

    def plane(q: np.ndarray) -> np.ndarray:
        return 0.4 - q @ way

    def blob(q: np.ndarray) -> np.ndarray:
        return np.where(np.linalg.norm(q - 0.7 * far, axis=1) < 0.1, -1.0, 1.0)

    found = greatest_ball(known(d, plane, blob), grid(d), points=4000)
    assert found.radius == pytest.approx(0.4, rel=1e-7) and found.stops == "plane"
    found = greatest_ball(known(d, lambda q: plane(q) + 1, blob), grid(d), points=4000)
    assert found.radius == pytest.approx(0.6, rel=2e-3)
    found = greatest_ball(known(d, lambda q: 9 - q[:, 0]), grid(d), points=100)
    assert (found.radius, found.stops) == (1.0, "the range")
    none = greatest_ball(known(d, lambda q: np.full(len(q), np.nan)), grid(d), points=100)
    assert none.radius == 0.0


@pytest.mark.slow
def test_room_of_a_mechanism() -> None:
    """Ball and box against the same conditions at many poses, taken from its own evaluations."""
    model = model_from("masticatory")
    over = grid_of(model.mechanism, ["X=-4:9:20 mm", "beta=-6:12:20 deg"])
    setup = setup_of(model, "Fz=-30 N")
    free = FreeSpace(setup, margin=0.1)
    ball, box = greatest_ball(free, over, points=3000), greatest_box(free, over)
    assert box is not None
    assert "bounds" in ball.stops

    def fine(q: np.ndarray) -> np.ndarray:
        load = np.tile(setup.load, (len(q), 1))
        bounded = model.with_distribution("bounded")
        e = bounded.inverse_dynamics(q, 0 * q, 0 * q, *parts(load), outputs="all")
        inside = (bound_margins(model.mechanism, e.configuration.contact_point) >= 0).all(axis=1)
        ok = (e.status == 0) & inside & (e.configuration.singularity.ratio >= 0.1)
        high = np.array([limits(chain).high for chain in model.mechanism.chains])
        return ok & (np.abs(e.effort) <= high * (1 + 1e-9)).all(axis=1)

    rng = np.random.default_rng(5)
    length = model.characteristic_length
    angle = rng.uniform(0, 2 * pi, 400)
    circle = np.column_stack([np.cos(angle), np.sin(angle) / length])
    assert fine(over.states((1 - 1e-9) * ball.radius * circle)).all()
    assert not fine(over.states(1.001 * ball.radius * circle)).all()
    u = rng.uniform(0, 1, (400, 2))
    low, high = np.array(box.low), np.array(box.high)
    assert fine(over.states(low + u * (high - low))).all()
    for k in range(2):  # a step more on either side finds a pose that is not free
        for end, step in ((low, -1), (high, 1)):
            points = low + u * (high - low)
            points[:, k] = end[k] + step * 1.01 * box.spacing[k]
            assert not fine(over.states(points)).all()


def test_limits_stop_the_ball() -> None:
    model = model_from("hexaglide")
    over = grid_of(model.mechanism, ["X=-50:50:20 mm"])
    assert greatest_ball(FreeSpace(setup_of(model)), over, points=200).radius == pytest.approx(0.05)
    heavy = FreeSpace(setup_of(model, "Fz=-715 N"))
    found = greatest_ball(heavy, over, points=200)
    assert found.stops == "the limits of efforts" and found.radius < 0.049


def values_on(f: Any, n: int = 30) -> np.ndarray:
    u = np.linspace(0, 1, n)
    return f(np.stack(np.meshgrid(u, u, indexing="ij"), axis=-1).reshape(-1, 2)).reshape(n, n)


def test_curves_are_followed() -> None:
    """A circle closes, branches that pass within a cell stay apart, a pole is no curve."""

    def circle(p: np.ndarray) -> np.ndarray:
        return (p[:, 0] - 0.5) ** 2 + (p[:, 1] - 0.45) ** 2 - 0.09

    (found,) = trace(circle, values_on(circle))
    assert found.closed and np.abs(circle(found.points)).max() < 1e-14
    steps = np.linalg.norm(np.diff(np.vstack([found.points, found.points[:1]]), axis=0), axis=1)
    assert steps.sum() == pytest.approx(2 * pi * 0.3, rel=5e-3) and steps.max() < 0.05

    def hyperbola(p: np.ndarray) -> np.ndarray:
        return (p[:, 0] - 0.51) * (p[:, 1] - 0.52) - 1e-4

    branches = trace(hyperbola, values_on(hyperbola))
    assert len(branches) == 2 and not any(b.closed for b in branches)
    for branch in branches:
        assert np.abs(hyperbola(branch.points)).max() < 1e-13
        ends = branch.points[[0, -1]]
        assert (np.isclose(ends, 0) | np.isclose(ends, 1)).any(axis=1).all()

    def pole(p: np.ndarray) -> np.ndarray:
        with np.errstate(divide="ignore"):
            return 1 / (p[:, 0] - 0.4567)

    assert trace(pole, values_on(pole)) == []


def test_what_is_certain_when_time_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """A smaller ball, and the room it may have yet."""
    model = model_from("masticatory-curved")
    monkeypatch.setattr(free_space, "QUICK", np.inf)
    complete = free_space.ball_around_home(model)
    monkeypatch.setattr(free_space, "QUICK", 0.0)
    hurried = free_space.ball_around_home(model)
    assert 0 < hurried.radius <= complete.radius == complete.at_most < hurried.at_most


def test_a_box_with_home_on_its_face_says_so() -> None:
    volume = Volume(1e-6, 1e-9, 1e-8, 0.5, (1e-3, 1e-3), 100)
    ball = free_space.Ball(1e-3, "a singularity", 10, 1e-4, 1e-3)
    box = free_space.Box((0.0, -1e-3), (2e-3, 1e-3), (1e-5, 1e-5))
    text = size_text(WorkspaceSize(volume, "m^2", ball, box, ("X", "Y"), 1e-3))
    assert "home is on its face at the least X;" in text and "Y;" not in text.split("face")[1]
