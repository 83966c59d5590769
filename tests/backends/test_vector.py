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
#define EACH(i) for (size_t i = 0; i < count; i += W)
typedef const double *restrict from;
typedef double *restrict to;
void sincos_vector(size_t count, from a, from b, to x, to y) {
    EACH(i) { vec s, c; sincos_v(load(a + i), &s, &c); store(x + i, s); store(y + i, c); }
}
void sincos_scalar(size_t count, from a, from b, to x, to y) {
    for (size_t i = 0; i < count; i++) sincos_s(a[i], x + i, y + i);
}
void root_vector(size_t count, from a, from b, to x, to y) {
    EACH(i) { store(x + i, rsqrt_v(load(a + i))); store(y + i, sqrt_v(load(a + i))); }
}
void root_scalar(size_t count, from a, from b, to x, to y) {
    for (size_t i = 0; i < count; i++) x[i] = rsqrt_s(a[i]), y[i] = sqrt_s(a[i]);
}
void extreme_vector(size_t count, from a, from b, to x, to y) {
    EACH(i) {
        store(x + i, fmin_v(load(a + i), load(b + i)));
        store(y + i, fmax_v(load(a + i), load(b + i)));
    }
}
void extreme_scalar(size_t count, from a, from b, to x, to y) {
    for (size_t i = 0; i < count; i++) x[i] = fmin_s(a[i], b[i]), y[i] = fmax_s(a[i], b[i]);
}
void order_vector(size_t count, from a, from b, to x, to y) {
    EACH(i) {
        store(x + i, le_v(load(a + i), load(b + i)));
        store(y + i, lt_v(load(a + i), load(b + i)));
    }
}
void order_scalar(size_t count, from a, from b, to x, to y) {
    for (size_t i = 0; i < count; i++) x[i] = le_s(a[i], b[i]), y[i] = lt_s(a[i], b[i]);
}
void arc_vector(size_t count, from a, from b, to x, to y) {
    EACH(i) { store(x + i, atan2_v(load(a + i), load(b + i))); store(y + i, fabs_v(load(b + i))); }
}
void arc_scalar(size_t count, from a, from b, to x, to y) {
    for (size_t i = 0; i < count; i++) x[i] = atan2_s(a[i], b[i]), y[i] = fabs_s(b[i]);
}
void sign_vector(size_t count, from a, from b, to x, to y) {
    EACH(i) {
        store(x + i, copysign_v(load(a + i), load(b + i)));
        store(y + i, load(a + i));
    }
}
void sign_scalar(size_t count, from a, from b, to x, to y) {
    for (size_t i = 0; i < count; i++) x[i] = copysign_s(a[i], b[i]), y[i] = a[i];
}
void lanes_vector(size_t count, from a, from b, to x, to y) {
    EACH(i) {
        store(x + i, spread(lanes_sum(load(a + i))));
        store(y + i, spread(lanes_least(load(a + i))));
    }
}
"""
DOUBLES = np.ctypeslib.ndpointer(np.float64)


@pytest.fixture(scope="module", params=WIDTHS)
def vector(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Functions:
    folder = tmp_path_factory.mktemp("vector")
    source, library = folder / "vector.c", folder / "vector.so"
    header = (Path(emit.__file__).parent / "vector.h").read_text(encoding="utf-8")
    source.write_text(f"#define W {request.param}\n{header}\n{FUNCTIONS}", encoding="utf-8")
    find_compiler().build(library, source)
    return Functions(ctypes.CDLL(str(library)), request.param)


class Functions:
    def __init__(self, library: ctypes.CDLL, width: int) -> None:
        self.library, self.width = library, width

    def __call__(self, name: str, a: np.ndarray, b: np.ndarray | None = None) -> np.ndarray:
        """Both results, (2, N), of a function at N arguments."""
        a = np.ascontiguousarray(a, dtype=float)
        padding = (0, -len(a) % 8)
        a, b = (np.pad(v, padding, mode="edge") for v in (a, a if b is None else b))
        result = np.full((2, len(a)), np.nan)
        function = getattr(self.library, name)
        function.argtypes = [ctypes.c_size_t, *[DOUBLES] * 4]
        function.restype = None
        function(len(a), a, np.ascontiguousarray(b, dtype=float), result[0], result[1])
        return result[:, : len(result[0]) - padding[1]]

    def both(self, name: str, a: np.ndarray, b: np.ndarray | None = None) -> list[np.ndarray]:
        return [self(f"{name}_{shape}", a, b) for shape in ("vector", "scalar")]


def angles() -> np.ndarray:
    """All over the range, and next to every kind of multiple of pi / 2."""
    rng = np.random.default_rng(0)
    sizes = 10.0 ** rng.uniform(-300, 6, 4000) * rng.choice([-1, 1], 4000)
    turns = np.concatenate([np.arange(-40, 41), rng.integers(-600_000, 600_000, 500)])
    quarter = turns * (np.pi / 2)
    near = [quarter, np.nextafter(quarter, np.inf), np.nextafter(quarter, -np.inf)]
    eighths = (turns + 0.5) * (np.pi / 2)
    return np.concatenate([[0.0, 1e6, -1e6], sizes, *near, eighths, rng.uniform(-7, 7, 4000)])


def check_sincos(got: np.ndarray, x: np.ndarray, ulps: float) -> None:
    for row, function in zip(got, (math.sin, math.cos), strict=True):
        wanted = np.array([function(v) for v in x])
        assert (np.abs(row - wanted) <= ulps * np.spacing(np.abs(wanted)) + ZERO).all()


def test_sine_and_cosine(vector: Functions) -> None:
    x = angles()
    for got in vector.both("sincos", x):
        check_sincos(got, x, 2)


def test_far_angles_go_to_the_library(vector: Functions) -> None:
    """Beyond 2^20, in any lane and whatever its neighbours are."""
    x = np.array([2.0**20, -(2.0**20), 1048575.9, 1e7, 0.3, 1e22, -1e300, 1.0, 1.7e308])
    for got in vector.both("sincos", x):
        check_sincos(got, x, 1)


def test_angles_that_are_no_numbers(vector: Functions) -> None:
    x = np.array([np.nan, 1.0, np.inf, 2.0, -np.inf, 3.0, 4.0, np.nan])
    finite = np.isfinite(x)
    for got in vector.both("sincos", x):
        assert np.isnan(got[:, ~finite]).all()
        check_sincos(got[:, finite], x[finite], 2)


def test_square_roots(vector: Functions) -> None:
    rng = np.random.default_rng(1)
    x = np.concatenate([10.0 ** rng.uniform(-290, 290, 5000), rng.uniform(0.1, 10, 5000), [1, 4]])
    for inverse, root in vector.both("root", x):
        assert (root == np.sqrt(x)).all()
        assert (np.abs(inverse * np.sqrt(x) - 1) < 6e-16).all()


def test_roots_of_the_negative_are_none(vector: Functions) -> None:
    """What cannot be reached turns into NaN, which the status catches."""
    for got in vector.both("root", np.array([-1.0, -1e-300, np.nan, 2.0])):
        assert np.isnan(got[:, :3]).all() and np.isfinite(got[:, 3]).all()


def test_extremes_treat_nan_alike(vector: Functions) -> None:
    """The second operand where they cannot be compared, in every shape and width."""
    nan = np.nan
    a = np.array([1.0, 2.0, nan, 1.0, nan, -np.inf, 0.0, 5.0])
    b = np.array([2.0, 1.0, 1.0, nan, nan, np.inf, 0.0, -5.0])
    for least, most in vector.both("extreme", a, b):
        np.testing.assert_array_equal(least, [1, 1, 1, nan, nan, -np.inf, 0, -5])
        np.testing.assert_array_equal(most, [2, 2, 1, nan, nan, np.inf, 0, 5])


def test_comparisons_are_one_or_nothing(vector: Functions) -> None:
    a = np.array([1.0, 2.0, 3.0, np.nan, 1.0, -np.inf, 0.0, 0.0])
    b = np.array([2.0, 2.0, 2.0, 1.0, np.nan, np.inf, -0.0, 1.0])
    for at_most, less in vector.both("order", a, b):
        assert at_most.tolist() == [1, 1, 0, 0, 0, 1, 1, 1]
        assert less.tolist() == [1, 0, 0, 0, 0, 1, 0, 1]


def check_arcs(got: np.ndarray, y: np.ndarray, x: np.ndarray, ulps: float) -> None:
    wanted = np.array([math.atan2(*point) for point in zip(y, x, strict=True)])
    np.testing.assert_array_equal(np.isnan(got), np.isnan(wanted))
    real = ~np.isnan(wanted)
    np.testing.assert_array_equal(np.signbit(got[real]), np.signbit(wanted[real]))
    assert (np.abs(got - wanted)[real] <= ulps * np.spacing(np.abs(wanted[real]))).all()


def test_arcs(vector: Functions) -> None:
    """In every quadrant, next to every multiple of pi / 8 and at every ratio."""
    rng = np.random.default_rng(2)
    turns = np.arange(-64, 65) * (np.pi / 64)
    near = [turns, np.nextafter(turns, 4), np.nextafter(turns, -4), turns + 1e-9, turns - 1e-9]
    around = np.concatenate([*near, rng.uniform(-np.pi, np.pi, 20_000)])
    size = 10.0 ** rng.uniform(-150, 150, len(around))
    y, x = size * np.sin(around), size * np.cos(around)
    sizes = 10.0 ** rng.uniform(-323, 307, (2, 5000)) * rng.choice([-1, 1], (2, 5000))
    for b, a in ((y, x), sizes):
        for arc, _ in vector.both("arc", b, a):
            check_arcs(arc, b, a, 2)


def test_arcs_of_special_points(vector: Functions) -> None:
    """Zeros of either sign, halves, equals, infinities, the smallest, the largest and none."""
    values = [0.0, 0.5, 1.0, 2.0, 5e-324, 1e-310, 2.3e-308, 9e307, 1.7e308, np.inf, np.nan]
    signed = np.array([s * v for v in values for s in (1, -1)])
    y, x = (v.ravel() for v in np.meshgrid(signed, signed))
    for arc, size in vector.both("arc", y, x):
        check_arcs(arc, y, x, 2)
        np.testing.assert_array_equal(size, np.abs(x))


def test_a_strange_point_leaves_its_neighbours_alone(vector: Functions) -> None:
    rng = np.random.default_rng(4)
    y, x = rng.normal(size=(2, 64))
    plain, _ = vector("arc_vector", y, x)
    for lane in range(8):
        b, a = y.copy(), x.copy()
        b[lane::8], a[lane::8] = -0.0, -0.0
        arc, _ = vector("arc_vector", b, a)
        assert (arc[lane::8] == -np.pi).all()
        others = np.arange(64) % 8 != lane
        assert (arc[others] == plain[others]).all()


def test_signs(vector: Functions) -> None:
    values = np.array([0.0, -0.0, 1.5, -1.5, np.inf, -np.inf, 5e-324, -1e308])
    a, b = (v.ravel() for v in np.meshgrid(values, values))
    for got, _ in vector.both("sign", a, b):
        np.testing.assert_array_equal(got, np.copysign(a, b))
        np.testing.assert_array_equal(np.signbit(got), np.signbit(b))


def test_sums_over_lanes(vector: Functions) -> None:
    x = np.random.default_rng(3).integers(-50, 50, 64).astype(float)
    blocks = x.reshape(-1, vector.width)
    total, least = vector("lanes_vector", x)
    assert (total == np.repeat(blocks.sum(axis=1), vector.width)).all()
    assert (least == np.repeat(blocks.min(axis=1), vector.width)).all()
