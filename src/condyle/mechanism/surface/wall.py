"""A contact's surface by the numbers of its file: what a kernel's constants are made of.

Written once, in CasADi's operations: with symbols for any mechanism, with numbers for one.

Home is *kept* where a change that takes the ball's centre off its surface is met by the surface: by
its offset along Z, or by its centre along the normal there. `miss` says by how much it would have
to move for home to be on it; kept is what the nominal mechanism misses.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from . import of_form
from .base import named
from .parallel import equation_of, newton_step

STEPS = 8  # of Newton, to where the ball touches


@dataclass(frozen=True)
class WallConstants:
    """What a contact's numbers lead to.

    constants: of the locus;  numbers: of the surface, by name, moved where home is kept.
    rest:  how far Newton is from the touching point, squared;  turned: cosine by which the normal
           has turned from where it began;  fits: positive where the ball can touch there.
    """

    constants: ca.SX
    numbers: Any
    rest: ca.SX | None = None
    turned: ca.SX | None = None
    fits: ca.SX | None = None


@dataclass(frozen=True)
class Wall:
    """The surface of a contact, without its numbers.

    form:  of the surface;  sizes: of its numbers in the file.
    locus: form of the surface on which the ball's centre stays.
    push:  sign of the side on which a ball is; 0 where the contact has none.
    home_kept: whether home is.
    """

    form: str
    sizes: tuple[tuple[str, int], ...]
    locus: str
    push: int
    home_kept: bool = False

    @property
    def size(self) -> int:
        """How many numbers the surface has in the file."""
        return sum(count for _, count in self.sizes)

    @property
    def general(self) -> bool:
        """Whether where the ball touches is found by Newton."""
        return self.locus.startswith("parallel")

    @cached_property
    def surface(self) -> Any:
        """A surface of its kind, without numbers."""
        return of_form(self.form)

    def constants(self, numbers: ca.SX, point: ca.SX, ball: ca.SX, home: ca.SX) -> WallConstants:
        """The constants of the locus.

        Args: numbers, point, ball: of the file;
              home: unit normal (3,) and `miss` of the nominal mechanism.
        """
        f, distance = named(numbers, dict(self.sizes)), self.push * ball
        if self.home_kept:
            f = self._moved(f, point, distance, home)
        if not self.general:
            return WallConstants(self._own(f, distance), f)
        w, mu, n = self._foot(f, point, distance, home)
        g, a, H = self._equation(f)(w)
        off = point - w - mu * a
        rest = ca.dot(off, off) + g * g
        across = ca.SX.eye(3) - n @ n.T
        grip = ca.SX.eye(3) + distance * across @ H @ across / ca.norm_2(a)
        # Of its eigenvalues one is 1; both others are positive where their product and sum are.
        fits = ca.fmin(ca.det(grip), ca.trace(grip) - 1)
        if self.locus == "parallel-quadric":
            own = ca.vertcat(distance, self.surface.principal(f))
        else:
            own = ca.vertcat(distance, point, w, mu, self.surface.from_numbers(f))
        return WallConstants(own, f, rest, ca.dot(n, home[:3]), fits)

    def miss(self, numbers: Any, point: Any, ball: Any, normal: Any) -> tuple[ca.SX, ca.SX]:
        """How far the surface would have to move for home to be on it [m], and along what, (3,)."""
        return self._miss(named(numbers, dict(self.sizes)), point, self.push * ball, normal)

    def _own(self, f: Any, distance: ca.SX) -> ca.SX:
        return self.surface.from_numbers(self.surface.beyond(f, distance) if self.push else f)

    def _moved(self, f: Any, point: ca.SX, distance: ca.SX, home: ca.SX) -> Any:
        off, n = self._miss(f, point, distance, home)
        return self.surface.moved(f, off - home[3], n)

    def _miss(self, f: Any, point: ca.SX, distance: ca.SX, home: ca.SX) -> tuple[ca.SX, ca.SX]:
        surface, up = self.surface, ca.SX([0, 0, 1])
        if not surface.lifted:
            size, n = surface.nearest(f, point, lambda f: self._foot(f, point, distance, home))
            return size - distance, n
        if not self.general:
            return surface.phi(point, self._own(f, distance)), up
        equation, w = self._equation(f), point - distance * home[:3]
        for _ in range(STEPS):
            _, a, H = equation(w)
            size = ca.norm_2(a)
            n = a / size
            turn = (H - n @ (n.T @ H)) / size
            w += ca.inv_minor(ca.SX.eye(3) + distance * turn) @ (point - w - distance * n)
        return equation(w)[0], up

    def _equation(self, f: Any) -> Any:
        c = self.surface.from_numbers(f)
        equation = equation_of(self.surface, c.numel())
        return lambda w: equation(w, c)

    def _foot(
        self, f: Any, point: ca.SX, distance: ca.SX, home: ca.SX
    ) -> tuple[ca.SX, ca.SX, ca.SX]:
        """The closest point, its mu, and the unit normal there."""
        c, w = self.surface.from_numbers(f), point - distance * home[:3]
        equation = equation_of(self.surface, c.numel())
        mu = distance / ca.norm_2(equation(w, c)[1])
        for _ in range(STEPS):
            w, mu = newton_step(equation, point, w, mu, c)
        a = equation(w, c)[1]
        return w, mu, a / ca.norm_2(a)


@lru_cache(maxsize=64)
def _missing(wall: Wall) -> ca.Function:
    sizes = {"f": wall.size, "p": 3, "r": 1, "n": 3}
    given = [ca.SX.sym(name, size) for name, size in sizes.items()]
    return ca.Function("miss", given, [ca.densify(x) for x in wall.miss(*given)])


def wall_of(contact: Any, keep_home: bool = False, locus: str | None = None) -> Wall:
    """The wall of a contact. Args: locus: another form for where the ball's centre stays."""
    push = contact.push if contact.ball_radius is not None else 0
    form = contact.offset_surface.form if locus is None else locus
    sizes = tuple(contact.surface.sizes().items())
    return Wall(contact.surface.form, sizes, form, push, keep_home)


def home_of(contact: Any, keep_home: bool = True) -> tuple[float, ...]:
    """Unit normal and `miss` of a contact at home; 0 where it is not kept."""
    _, gradient = contact.gradient()
    normal = gradient / (gradient @ gradient) ** 0.5
    return (*map(float, normal), missed(contact, normal)[0] if keep_home else 0.0)


def missed(contact: Any, normal: Any, locus: str | None = None) -> tuple[float, Any]:
    """`Wall.miss` of a contact, and along what, (3,).

    Args: normal: about that at home, (3,);  locus: as of `wall_of`.
    """
    wall = wall_of(contact, locus=locus)
    by, along = _missing(wall)(
        contact.surface.own_numbers(), contact.point, contact.ball_radius or 0.0, normal
    )
    return float(by), np.asarray(along).ravel()
