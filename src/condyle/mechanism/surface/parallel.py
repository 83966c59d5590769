"""The surface at a distance from a wall: where the centre of a ball is that touches the wall.

The closest point w of a point p, where the ball would touch, solves with the wall's equation g

    p = w + mu grad g(w),   g(w) = 0.

Newton goes there from the closest point at home, along the straight line from the home centre to p:
so it is that of home's branch, also for a ball that nearly fills its socket. The number of steps is
fixed, which makes the closest point an expression. With n = grad g / |grad g| at w,

    phi(p) = n . (p - w) + g(w) / |grad g(w)| - distance,   grad phi = n.

phi is stationary in w at the closest point: an error of w enters phi squared, its first and second
derivatives at first order; the last steps start from a converged closest point and remove it from
all three, so that automatic derivatives are exact too. Where Newton has not converged phi is
infinite, never wrong.

The closest point of a wall of second order has one unknown. In the principal axes of
g = sum(h y^2 / 2 + b y) + e that of y is

    w = (y - mu b) / (1 + mu h),   g(w) = 0:

one equation in mu, monotonic as long as all 1 + mu h are positive, as they are at the nearest
closest point. Where they come near zero, for a ball that nearly fills a steep socket, the general
way is the safer one.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, NoReturn

import casadi as ca
import numpy as np

from .base import Smooth

ON_THE_WAY = (1 / 3, 2 / 3)  # parts of the way from home at which Newton makes one step,
STEPS = 6  # and how many it makes at the point itself,
AGAIN = 2  # or from the closest point of a point nearby
CONVERGED = 1e-10  # metres off the closest point's conditions
STILL = 1e-15  # metres of a step that is rounding
DIRECTIONS, STARTS, HOME_STEPS = 1000, 20, 50  # with which the closest point of home is looked for
GUESSES, QUADRIC_STEPS = 2, 5  # from the normal at a guessed closest point, and Newton's, for mu
EASY = 0.5  # least 1 + mu h at home for one unknown
_FUNCTIONS: dict[tuple[str, int], tuple[ca.Function, ca.Function]] = {}


@dataclass(frozen=True)
class Parallel(Smooth):
    """Points at a signed distance [m] from a wall, positive along its normal.

    centre, closest_point, multiplier: a point near the surface, its closest point and mu there:
    where Newton begins.
    start: closest_point and mu, (4,), with which it begins instead: see `started_at`.
    """

    wall: Any
    distance: float
    centre: tuple[float, ...] = (0.0, 0.0, 0.0)
    closest_point: tuple[float, ...] = (0.0, 0.0, 0.0)
    multiplier: float = 0.0
    start: Any = field(default=None, compare=False)

    @property
    def kind(self) -> str:
        return self.wall.kind

    @property
    def closed(self) -> bool:
        return self.wall.closed

    @property
    def form(self) -> str:
        return f"parallel {self.wall.form}"

    def constants(self) -> tuple[float, ...]:
        """distance, centre, closest point, multiplier, then the wall's."""
        start = (*self.centre, *self.closest_point, self.multiplier)
        return (self.distance, *start, *self.wall.constants())

    @staticmethod
    def from_numbers(f: Any) -> NoReturn:
        raise AssertionError("a parallel surface has no numbers in a file; its wall has")

    def phi(self, point: Any, constants: Any = None) -> Any:
        return self._at(point, constants)[0]

    def gradient(self, point: ca.SX, constants: Any = None) -> ca.SX:
        """n at the closest point, (3,)."""
        return self._at(point, constants)[1]

    def bending(self, point: ca.SX, velocity: ca.SX, constants: Any = None) -> ca.SX:
        """v . dn/dt, from the velocity of the closest point."""
        _, n, size, H, inverse, along, _ = self._at(point, constants)
        still = inverse @ velocity
        point_velocity = still - along * (ca.dot(n, still) / ca.dot(n, along))
        turn = (H @ point_velocity) / size
        return ca.dot(velocity, turn) - ca.dot(velocity, n) * ca.dot(n, turn)

    def rounded(self, point: ca.SX, constants: Any) -> ca.SX:
        foot = point - constants[0] * self.gradient(point, constants)
        return self.wall.rounded(foot, constants[8:])

    def started_at(self, point: ca.SX, constants: Any = None) -> Parallel:
        c = self._numbers(constants)
        start = c[4:8] if self.start is None else self._at(point, c)[-1]
        return replace(self, start=start)

    def grip(self) -> float:
        """Smallest eigenvalue of 1 + distance * curvature at the closest point of `centre`.

        It is 1 on a flat wall and 0 for a ball of the wall's radius of curvature; where it is not
        positive, the ball does not fit.
        """
        c = ca.DM(self.constants())
        value, n, size, H, *_ = (np.asarray(v) for v in self._at(ca.DM(self.centre), c))
        if not np.isfinite(value).all():
            return float("nan")
        across = np.eye(3) - n @ n.T
        return float(np.linalg.eigvalsh(np.eye(3) + self.distance * across @ H @ across / size)[0])

    def _at(self, point: Any, constants: Any) -> Any:
        c = self._numbers(constants)
        p = ca.vertcat(point[0], point[1], point[2])
        equation, touching = _functions(self.wall, c.numel() - 8)
        if self.start is None:
            return touching(p, c)
        w, mu = self.start[:3], self.start[3]
        for _ in range(AGAIN):
            w, mu = newton_step(equation, p, w, mu, c[8:])
        phi, _, *more = _at_closest_point(equation, p, w, mu, c)
        return [phi, *more]

    def _numbers(self, constants: Any) -> Any:
        c = self.constants() if constants is None else constants
        return c if hasattr(c, "numel") else ca.DM(c)


@lru_cache(maxsize=256)
def parallel(wall: Any, distance: float, point: tuple[float, ...]) -> Any:
    """The surface at a signed `distance` [m] from a wall, positive along its normal.

    Args: point: (3,), near the parallel surface.
    """
    if (simple := wall.at_distance(distance)) is not None:
        return simple
    numbers = wall.constants()
    equation = _functions(wall, len(numbers))[0]
    closest_point, mu = _home_closest_point(equation, numbers, distance, np.array(point))
    kind = Parallel
    if hasattr(wall, "principal"):
        h = np.array(wall.derive("principal")[12:15])
        kind = ParallelQuadric if (1 + mu * h > EASY).all() else Parallel
    return kind(wall, distance, tuple(point), tuple(map(float, closest_point)), float(mu))


def equation_of(wall: Any, count: int) -> ca.Function:
    """(w, constants) -> g, grad g, second derivative of the equation of a wall's form."""
    return _functions(wall, count)[0]


def touching_of(wall: Any, count: int) -> ca.Function:
    """(p, constants) -> what `_touching` returns, of the surfaces parallel to a wall's form."""
    return _functions(wall, count)[1]


def _functions(wall: Any, count: int) -> tuple[ca.Function, ca.Function]:
    """The wall's equation with its derivatives, and the ball that touches it."""
    key = (wall.form, count)
    if key not in _FUNCTIONS:
        equation = _equation(wall, count)
        _FUNCTIONS[key] = equation, _touching(equation, count)
    return _FUNCTIONS[key]


def _equation(wall: Any, count: int) -> ca.Function:
    """(w, constants) -> g, grad g, second derivative of the wall's equation."""
    w, c = ca.SX.sym("w", 3), ca.SX.sym("c", count)
    g = wall.phi(w, c)
    H, gradient = ca.hessian(g, w)
    return ca.Function("wall", [w, c], [g, ca.densify(gradient), ca.densify(H)])


def _touching(equation: ca.Function, count: int) -> ca.Function:
    """(p, constants) -> phi, n, |grad g|, H, (1 + mu H)^-1, (1 + mu H)^-1 n, w and mu."""
    p, c = ca.SX.sym("p", 3), ca.SX.sym("c", count + 8)
    home, w, mu, wall = c[1:4], c[4:7], c[7], c[8:]
    for part in (*ON_THE_WAY, *[1.0] * STEPS):
        w, mu = newton_step(equation, home + part * (p - home) if part < 1 else p, w, mu, wall)
    phi, converged, *more = _at_closest_point(equation, p, w, mu, c)
    return ca.Function("touching", [p, c], [phi / converged, *more])


def _at_closest_point(
    equation: ca.Function, p: ca.SX, w: ca.SX, mu: ca.SX, c: ca.SX
) -> list[ca.SX]:
    """phi, whether w is the closest point, and the rest of what `_touching` returns."""
    g, a, H = equation(w, c[8:])
    size = ca.norm_2(a)
    n = a / size
    off = p - w - mu * a
    converged = ca.dot(off, off) + g * g <= CONVERGED**2
    phi = (ca.dot(n, p - w) + g / size) - c[0]
    inverse = ca.inv_minor(ca.SX.eye(3) + mu * H)
    return [phi, converged, n, size, H, inverse, inverse @ n, ca.vertcat(w, mu)]


def newton_step(equation: ca.Function, p: Any, w: Any, mu: Any, constants: Any) -> tuple[Any, Any]:
    """One step of w and mu towards the closest point of p.

    (1 + mu H) dw + a dmu = p - w - mu a,   a . dw = -g,   a = grad g.
    """
    g, a, H = equation(w, constants)
    inverse = ca.inv_minor(ca.DM.eye(3) + mu * H)
    rest, along = inverse @ (p - w - mu * a), inverse @ a
    step = (ca.dot(a, rest) + g) / ca.dot(a, along)
    return w + rest - step * along, mu + step


def _home_closest_point(
    equation: ca.Function, constants: tuple[float, ...], distance: float, p: np.ndarray
) -> tuple[np.ndarray, float]:
    """Foot and mu of a point at about `distance` from the wall.

    The ball's own surface passes through the closest point: points all over it that are nearest the
    wall, with radii nearest the normal, start Newton; the one whose distance is nearest `distance`
    is taken.
    """
    numbers = ca.DM(constants)
    u = spread_directions(DIRECTIONS)
    starts = p - distance * u
    g, a, _ = (np.asarray(v) for v in equation(starts.T, ca.repmat(numbers, 1, len(u))))
    with np.errstate(all="ignore"):
        size = np.linalg.norm(a, axis=0)
        miss = np.abs(g[0]) / size + abs(distance) * np.linalg.norm(a / size - u.T, axis=0)
    closest_points = []
    for k in np.argsort(np.where(np.isfinite(miss), miss, np.inf))[:STARTS]:
        w, mu = ca.DM(starts[k]), ca.DM(distance / size[k])
        for _ in range(HOME_STEPS):
            last, (w, mu) = w, newton_step(equation, ca.DM(p), w, mu, numbers)
            if not float(ca.norm_2(w - last)) > STILL:
                break
        off = abs(float(mu * ca.norm_2(equation(w, numbers)[1])) - distance)
        closest_points.append(
            (off if np.isfinite(off) else np.inf, np.asarray(w).ravel(), float(mu))
        )
        if off < CONVERGED:
            break
    return min(closest_points, key=lambda closest_point: closest_point[0])[1:]


def spread_directions(count: int) -> np.ndarray:
    """Unit vectors spread evenly over the sphere (a golden spiral), (count, 3)."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - z * z)
    return np.column_stack([across * np.cos(turn), across * np.sin(turn), z])


@dataclass(frozen=True)
class ParallelQuadric(Parallel):
    """Points at a signed distance [m] from a wall with `principal`."""

    @property
    def form(self) -> str:
        return "parallel-quadric"

    def constants(self) -> tuple[float, ...]:
        """distance; origin (3), axes (9, by columns), h (3), b (3) and e of g."""
        return (self.distance, *self.wall.derive("principal"))

    def bending(self, point: ca.SX, velocity: ca.SX, constants: Any = None) -> ca.SX:
        """v . dn/dt, in principal axes."""
        c = self._numbers(constants)
        *_, size, _, shrink, a, _ = self._at(point, c)
        v, n, h = _axes(c).T @ velocity, a / size, c[13:16]
        still, along = shrink * v, shrink * n
        turn = h * (still - along * (ca.dot(n, still) / ca.dot(n, along))) / size
        return ca.dot(v, turn) - ca.dot(v, n) * ca.dot(n, turn)

    def rounded(self, point: ca.SX, constants: Any) -> ca.SX:
        return ca.SX(0)

    def started_at(self, point: ca.SX, constants: Any = None) -> ParallelQuadric:
        return replace(self, start=self._at(point, constants)[-1])

    def _at(self, point: Any, constants: Any) -> Any:
        p, c = ca.vertcat(point[0], point[1], point[2]), self._numbers(constants)
        if self.start is None:
            return _touching_quadric()(p, c)
        y, mu = _axes(c).T @ (p - c[1:4]), self.start
        for _ in range(AGAIN):
            mu = _mu_step(y, mu, c)
        phi, _, *more = _at_closest_mu(y, mu, c)
        return [phi, *more]


def _axes(c: ca.SX) -> ca.SX:
    return ca.reshape(c[4:13], 3, 3)


@lru_cache(maxsize=1)
def _touching_quadric() -> ca.Function:
    """(p, constants) -> phi, n, |grad g|, H, and in principal axes 1 / (1 + mu h), grad g; mu."""
    p, c = ca.SX.sym("p", 3), ca.SX.sym("c", 20)
    h, b = c[13:16], c[16:19]
    y = w = _axes(c).T @ (p - c[1:4])
    for _ in range(GUESSES):
        a = h * w + b
        w = y - a * (c[0] / ca.norm_2(a))
    mu = c[0] / ca.norm_2(h * w + b)
    for _ in range(QUADRIC_STEPS):
        mu = _mu_step(y, mu, c)
    phi, converged, *more = _at_closest_mu(y, mu, c)
    return ca.Function("touching", [p, c], [phi / converged, *more])


def _mu_step(y: ca.SX, mu: ca.SX, c: ca.SX) -> ca.SX:
    g, a, shrink, _ = _foot(y, mu, c[13:16], c[16:19], c[19])
    return mu + g / ca.dot(a, a * shrink)


def _at_closest_mu(y: ca.SX, mu: ca.SX, c: ca.SX) -> list[ca.SX]:
    """phi, whether mu has converged, and the rest of what `_touching_quadric` returns."""
    axes, h = _axes(c), c[13:16]
    g, a, shrink, w = _foot(y, mu, h, c[16:19], c[19])
    size = ca.norm_2(a)
    stretch = 1 + mu * h
    least = ca.fmin(ca.fmin(stretch[0], stretch[1]), stretch[2])
    converged = (ca.fabs(g) <= CONVERGED) * (least > 0)
    phi = (ca.dot(a, y - w) + g) / size - c[0]
    return [phi, converged, axes @ (a / size), size, axes @ ca.diag(h) @ axes.T, shrink, a, mu]


def _foot(y: ca.SX, mu: ca.SX, h: ca.SX, b: ca.SX, e: ca.SX) -> tuple[ca.SX, ...]:
    """g, grad g and 1 / (1 + mu h) at w(mu), and w."""
    shrink = 1 / (1 + mu * h)
    w = (y - mu * b) * shrink
    half = h * w / 2 + b
    return ca.dot(w, half) + e, h * w + b, shrink, w
