"""What every contact surface is: an equation phi(p) = 0 of a point p in {S}.

phi is distance-like: in metres, with a gradient of order 1 that points along the unit normal of
the file format, upwards for surfaces z = f(x, y), outwards for closed ones. Its numbers are its
second argument, so that one expression serves every surface of a kind; it is written with
operations that numbers and CasADi symbols share and never branches on a number, so that exact
derivatives come from CasADi.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar

from ..table import Table
from .parallel import Parallel
from .smooth import Smooth

Scalar = Any  # a float or a CasADi scalar
Coordinates = Any  # anything with [0], [1], [2]

GRAPH_SIDES = ("below", "above")
CLOSED_SIDES = ("inside", "outside")


class SurfaceTable(Smooth, Table):
    """A surface of a mechanism file: its `kind`, and whether it is `closed` around an inside."""

    kind: str
    closed: ClassVar[bool] = False

    @abstractmethod
    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        """How far a point (3,) is off the surface [m], positive along the normal.

        Args: constants: `constants()` of this or another surface of the kind; default: its own.
        """

    @abstractmethod
    def constants(self) -> tuple[float, ...]:
        """The numbers of the equation, SI."""

    @property
    def form(self) -> str:
        """Surfaces of one form and one number of constants share one expression phi."""
        return self.kind

    def parallel(self, distance: float, point: Coordinates) -> Any:
        """The surface at a signed `distance` [m] from this one, positive along the normal.

        Args: point: (3,), near the parallel surface.
        """
        return Parallel.near(self, distance, point)


def sides(closed: bool) -> tuple[str, str]:
    """Names of the two sides of a surface: against its normal, and along it."""
    return CLOSED_SIDES if closed else GRAPH_SIDES


def numbers_of(constants: Coordinates) -> int:
    """How many constants there are, whatever holds them."""
    return constants.numel() if hasattr(constants, "numel") else len(constants)
