"""The functions of vector.h against the standard library, at every lane width."""

from __future__ import annotations

import ctypes
import math
from pathlib import Path

import numpy as np
import pytest

from condyle.backends.c import emit
from condyle.backends.compiler import find_compiler

WIDTHS = (2, 4, 8)
ZERO = 1e-24  # what three parts of pi / 2 leave of a multiple of it
FUNCTIONS = """
typedef const double *restrict from;
typedef double *restrict to;
#define BOTH(name, vectors, scalars) \
    void name##_vector(size_t count, from a, from b, to x, to y) { \
        for (size_t i = 0; i < count; i += W) { \
            vec p = load(a + i), q = load(b + i), u, v; (void)q; \
            vectors; store(x + i, u); store(y + i, v); } } \
    void name##_scalar(size_t count, from a, from b, to x, to y) { \
        for (size_t i = 0; i < count; i++) { scalars; } }
BOTH(sincos, sincos_v(p, &u, &v), sincos_s(a[i], x + i, y + i))
BOTH(root, u = rsqrt_v(p); v = sqrt_v(p), x[i] = rsqrt_s(a[i]); y[i] = sqrt_s(a[i]))
BOTH(extreme, u = fmin_v(p, q); v = fmax_v(p, q),
     x[i] = fmin_s(a[i], b[i]); y[i] = fmax_s(a[i], b[i]))
BOTH(order, u = le_v(p, q); v = lt_v(p, q), x[i] = le_s(a[i], b[i]); y[i] = lt_s(a[i], b[i]))
BOTH(arc, u = atan2_v(p, q); v = fabs_v(q), x[i] = atan2_s(a[i], b[i]); y[i] = fabs_s(b[i]))
BOTH(sign, u = copysign_v(p, q); v = p, x[i] = copysign_s(a[i], b[i]); y[i] = a[i])
BOTH(lanes, u = spread(lanes_sum(p)); v = spread(lanes_least(p)), (void)a)
"""
DOUBLES = np.ctypeslib.ndpointer(np.float64)
NAN, INF = math.nan, math.inf


class Functions:
    def __init__(self, library: ctypes.CDLL, width: int) -> None:
        self.library, self.width = library, width

    def __call__(self, name: str, a: np.ndarray, b: np.ndarray | None = None) -> np.ndarray:
        """Both results, (2, N), of a function at N arguments."""
        padding = (0, -len(a) % 8)
        a, b = (np.pad(v, padding, mode="edge") for v in (a, a if b is None else b))
        result = np.full((2, len(a)), np.nan)
        function = getattr(self.library, name)
        function.argtypes, function.restype = [ctypes.c_size_t, *[DOUBLES] * 4], None
        function(len(a), a, np.ascontiguousarray(b, dtype=float), result[0], result[1])
        return result[:, : len(result[0]) - padding[1]]

    def both(self, name: str, a: np.ndarray, b: np.ndarray | None = None) -> list[np.ndarray]:
        return [self(f"{name}_{shape}", a, b) for shape in ("vector", "scalar")]


@pytest.fixture(scope="module", params=WIDTHS)
def vector(
    compiler_command: object,
    request: pytest.FixtureRequest,
    tmp_path_factory: pytest.TempPathFactory,
) -> Functions:
    folder = tmp_path_factory.mktemp("vector")
    source, library = folder / "vector.c", folder / "vector.so"
    header = (Path(emit.__file__).parent / "vector.h").read_text(encoding="utf-8")
    source.write_text(f"#define W {request.param}\n{header}\n{FUNCTIONS}", encoding="utf-8")
    find_compiler().build(library, source)
    return Functions(ctypes.CDLL(str(library)), request.param)


def require_sincos(vector: Functions, x: np.ndarray, ulps: float) -> None:
    """Where x is no number, neither are they."""
    finite = np.isfinite(x)
    for got in vector.both("sincos", x):
        assert np.isnan(got[:, ~finite]).all()
        for row, function in zip(got[:, finite], (math.sin, math.cos), strict=True):
            wanted = np.array([function(v) for v in x[finite]])
            assert (np.abs(row - wanted) <= ulps * np.spacing(np.abs(wanted)) + ZERO).all()


def test_sine_and_cosine(vector: Functions) -> None:
    """All over the range, and next to every kind of multiple of pi / 2; what is beyond 2^20, in any
    lane and whatever its neighbours are, goes to the library."""
    rng = np.random.default_rng(0)
    sizes = 10.0 ** rng.uniform(-300, 6, 2000) * rng.choice([-1, 1], 2000)
    turns = np.concatenate([np.arange(-40, 41), rng.integers(-600_000, 600_000, 300)])
    quarter = turns * (np.pi / 2)
    near = [quarter, np.nextafter(quarter, np.inf), np.nextafter(quarter, -np.inf)]
    eighths = (turns + 0.5) * (np.pi / 2)
    ends = [[0.0, 1e6, -1e6], sizes, *near, eighths, rng.uniform(-7, 7, 2000)]
    require_sincos(vector, np.concatenate(ends), 2)
    require_sincos(vector, np.array([NAN, 1.0, INF, 2.0, -INF, 3.0, 4.0, NAN]), 2)
    far = [2.0**20, -(2.0**20), 1048575.9, 1e7, 0.3, 1e22, -1e300, 1.0, 1.7e308]
    require_sincos(vector, np.array(far), 1)


def test_square_roots(vector: Functions) -> None:
    """Those of the negative are none: what cannot be reached is NaN, which the status catches."""
    rng = np.random.default_rng(1)
    x = np.concatenate([10.0 ** rng.uniform(-290, 290, 3000), rng.uniform(0.1, 10, 3000), [1, 4]])
    for inverse, root in vector.both("root", x):
        assert (root == np.sqrt(x)).all()
        assert (np.abs(inverse * np.sqrt(x) - 1) < 6e-16).all()
    for got in vector.both("root", np.array([-1.0, -1e-300, NAN, 2.0])):
        assert np.isnan(got[:, :3]).all() and np.isfinite(got[:, 3]).all()


def test_extremes_comparisons_and_signs(vector: Functions) -> None:
    """Extremes are the second operand where they cannot be compared; comparisons are 1 or 0."""
    a = np.array([1.0, 2.0, NAN, 1.0, NAN, -INF, 0.0, 5.0, 2.0, 0.0])
    b = np.array([2.0, 1.0, 1.0, NAN, NAN, INF, -0.0, -5.0, 2.0, 1.0])
    for least, most in vector.both("extreme", a, b):
        np.testing.assert_array_equal(least, [1, 1, 1, NAN, NAN, -INF, 0, -5, 2, 0])
        np.testing.assert_array_equal(most, [2, 2, 1, NAN, NAN, INF, 0, 5, 2, 1])
    for at_most, less in vector.both("order", a, b):
        assert at_most.tolist() == [1, 0, 0, 0, 0, 1, 1, 0, 1, 1]
        assert less.tolist() == [1, 0, 0, 0, 0, 1, 0, 0, 0, 1]
    values = np.array([0.0, -0.0, 1.5, -1.5, INF, -INF, 5e-324, -1e308])
    a, b = (v.ravel() for v in np.meshgrid(values, values))
    for got, _ in vector.both("sign", a, b):
        np.testing.assert_array_equal(got, np.copysign(a, b))
        np.testing.assert_array_equal(np.signbit(got), np.signbit(b))


def require_arcs(vector: Functions, y: np.ndarray, x: np.ndarray) -> None:
    """Within two units of the last place, with the sign of the library's."""
    wanted = np.array([math.atan2(*point) for point in zip(y, x, strict=True)])
    real = ~np.isnan(wanted)
    for got, size in vector.both("arc", y, x):
        np.testing.assert_array_equal(size, np.abs(x))
        np.testing.assert_array_equal(np.isnan(got), ~real)
        np.testing.assert_array_equal(np.signbit(got[real]), np.signbit(wanted[real]))
        assert (np.abs(got - wanted)[real] <= 2 * np.spacing(np.abs(wanted[real]))).all()


def test_arcs(vector: Functions) -> None:
    """In every quadrant, next to every multiple of pi / 8 and at every ratio; zeros of either sign,
    halves, equals, infinities, the smallest, the largest and none."""
    rng = np.random.default_rng(2)
    turns = np.arange(-64, 65) * (np.pi / 64)
    near = [turns, np.nextafter(turns, 4), np.nextafter(turns, -4), turns + 1e-9, turns - 1e-9]
    around = np.concatenate([*near, rng.uniform(-np.pi, np.pi, 8000)])
    size = 10.0 ** rng.uniform(-150, 150, len(around))
    require_arcs(vector, size * np.sin(around), size * np.cos(around))
    sizes = 10.0 ** rng.uniform(-323, 307, (2, 3000)) * rng.choice([-1, 1], (2, 3000))
    require_arcs(vector, *sizes)
    values = [0.0, 0.5, 1.0, 2.0, 5e-324, 1e-310, 2.3e-308, 9e307, 1.7e308, INF, NAN]
    signed = np.array([s * v for v in values for s in (1, -1)])
    require_arcs(vector, *(v.ravel() for v in np.meshgrid(signed, signed)))


def test_sums_over_lanes(vector: Functions) -> None:
    x = np.random.default_rng(3).integers(-50, 50, 64).astype(float)
    blocks = x.reshape(-1, vector.width)
    total, least = vector("lanes_vector", x)
    assert (total == np.repeat(blocks.sum(axis=1), vector.width)).all()
    assert (least == np.repeat(blocks.min(axis=1), vector.width)).all()
