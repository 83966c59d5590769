"""A landmark's path: the kernel against following from home, and what it vouches for alone."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, toml_text
from support.following import landmark_closure
from support.speeds import few

import condyle
from condyle.backends.choose import Backend
from condyle.backends.kernel import AGAIN
from condyle.mechanism import Mechanism, parse
from condyle.model.closing import Closure, FollowedClosure

COUNT = 400
SURFACES = ("plane", "quadratic", "sphere", "ellipsoid")


@cache
def mechanism(surface: str) -> Mechanism:
    if surface in ("masticatory", "masticatory-curved"):
        return condyle.load_mechanism(surface)
    raw = random_mechanism(np.random.default_rng(12), surface=surface)
    return parse(toml_text(raw))


def landmark(m: Mechanism) -> str:
    return "incisor" if "incisor" in m.platform.points else next(iter(m.platform.points))


def paths(size: float) -> tuple[np.ndarray, ...]:
    """Displacements of a landmark [m] with rates, the fourth condition at rest."""
    rng = np.random.default_rng(2)
    s = np.hstack([rng.uniform(-size, size, (COUNT, 3)), np.zeros((COUNT, 1))])
    return s, rng.normal(0, 0.1, (COUNT, 4)), rng.normal(0, 1, (COUNT, 4))


def kernel_alone(closure: Closure, s: np.ndarray, s1: np.ndarray, s2: np.ndarray) -> tuple:
    answer = closure.kernel.run({"s": s, "s1": s1, "s2": s2})
    names = ("pose", "pose_rate", "pose_acceleration")
    return [answer.values[name].T for name in names], answer.status


@pytest.mark.parametrize("size", few([0.002, 0.006, 0.03], 0.006))
@pytest.mark.parametrize(
    "surface",
    few(["masticatory", "masticatory-curved", *SURFACES], "masticatory-curved", "plane", "sphere"),
)
def test_equal_or_flagged(surface: str, size: float) -> None:
    """What the kernel vouches for is what the witness finds by following from home."""
    m = mechanism(surface)
    given = paths(size)
    closure = Closure(m, landmark=landmark(m), backend=Backend("numpy"))
    with np.errstate(all="ignore"):
        found, status = kernel_alone(closure, *given)
        wanted = landmark_closure(m, landmark(m)).solve(*given)
        whole = closure.solve(*given)
    assert set(status) <= {0, AGAIN}
    sure = status == 0
    assert wanted.reached[sure].all()
    truth = (wanted.pose, wanted.rate, wanted.acceleration)
    for got, right in zip(found, truth, strict=True):
        scale = np.abs(right[sure]).max(initial=1.0)
        assert np.abs(got - right)[sure].max(initial=0) < 1e-9 * scale
    if size == 0.002:
        assert sure.mean() > 0.5
    np.testing.assert_array_equal(whole.reached, wanted.reached)
    reached = wanted.reached
    assert np.isnan(whole.pose[~reached]).all()
    np.testing.assert_allclose(whole.pose[reached], wanted.pose[reached], atol=1e-11)


@pytest.mark.usefixtures("compiler_command")
def test_compiled_is_numpy() -> None:
    m = mechanism("masticatory-curved")
    given = paths(0.006)
    answers = [
        kernel_alone(Closure(m, landmark="incisor", backend=Backend(b)), *given)
        for b in ("numpy", "compiled")
    ]
    np.testing.assert_array_equal(answers[0][1], answers[1][1])
    sure = answers[0][1] == 0
    for a, b in zip(answers[0][0], answers[1][0], strict=True):
        np.testing.assert_allclose(b[sure], a[sure], atol=1e-12 * np.abs(a[sure]).max())


def test_the_reference_path_is_certified_by_the_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not one sample has to be followed from home."""
    monkeypatch.setattr(
        FollowedClosure, "solve", lambda *given: pytest.fail("a sample was followed")
    )
    m, motion = condyle.load_mechanism("masticatory"), condyle.reference_motion()
    assert motion.kind == "landmark" and motion.landmark == "incisor"
    model = condyle.derive(m, backend="numpy")
    (q, _, _), _ = model.poses.of_motion(motion)
    assert np.isfinite(q).all() and np.ptp(q, axis=0).max() > 0.05


@pytest.mark.parametrize("surface", ["masticatory", "masticatory-curved"])
def test_rates_are_slopes_of_the_path(surface: str) -> None:
    m = mechanism(surface)
    closure = Closure(m, landmark=landmark(m), backend=Backend("numpy"))
    s, s1, s2 = (a[:50] for a in paths(0.002))
    s1, s2 = s1 * [1, 1, 1, 0], s2 * [1, 1, 1, 0]
    h = 1e-4
    path = [closure.solve(s + s1 * t + s2 * t * t / 2, s1, s2).pose for t in (-h, 0.0, h)]
    found = closure.solve(s, s1, s2)
    good = found.reached
    first, second = (path[2] - path[0]) / (2 * h), (path[2] - 2 * path[1] + path[0]) / h**2
    np.testing.assert_allclose(found.rate[good], first[good], atol=1e-4 * np.abs(first).max())
    size = np.abs(second[good]).max()
    np.testing.assert_allclose(found.acceleration[good], second[good], atol=1e-3 * size)
