"""The drawing of a chain in pictures and MuJoCo's files: straight bodies between named points."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

CABLE = 0.4  # thickness of a cable over a slender rod's


@dataclass(frozen=True)
class DrawnRod:
    """A straight body between two points of its chain.

    body:      the singular of one of the family's `bodies`, where it is one of them.
    thickness: of its radius, relative to a slender rod;  moving: whether it shows the chain.
    """

    body: str
    start: str
    end: str
    thickness: float = 1.0
    moving: bool = True


@dataclass(frozen=True)
class ChainDrawing:
    """The points, rods and balls that one chain is drawn as.

    points: name -> (3,) where fixed in {S}, (N, 3) where moving [m]; "M" is on the platform.
    rods:   the bodies;  balls: points with a ball joint.
    """

    points: dict[str, np.ndarray]
    rods: tuple[DrawnRod, ...]
    balls: tuple[str, ...]


def line_drawing(line: Any, M: np.ndarray) -> ChainDrawing:
    """A thin line from its base by its via points to M, (N, 3), without a joint at its ends."""
    fixed = [np.asarray(point, dtype=float) for point in (line.base, *getattr(line, "via", ()))]
    names = ["B", *(f"via_{i}" for i in range(1, len(fixed))), "M"]
    rods = (DrawnRod("cable", a, b, CABLE) for a, b in pairwise(names))
    return ChainDrawing(dict(zip(names, [*fixed, M], strict=True)), tuple(rods), ())
