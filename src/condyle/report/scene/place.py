"""A mechanism at poses, in {S}; a new family of chains adds one function to `DRAWINGS`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...kinematics.chain import FAMILIES
from ...mechanism import Mechanism
from ...mechanism.coordinates import rotations


@dataclass(frozen=True)
class Scene:
    """Positions in {S} at N poses [m].

    position: O_M, (N, 3).   rotation: R from {M} to {S}, (N, 3, 3).
    chains: by name, and ligaments by `of_ligament`;  contacts, landmarks: by name, (N, 3) each.
    """

    position: np.ndarray
    rotation: np.ndarray
    chains: dict[str, ChainDrawing]
    contacts: dict[str, np.ndarray]
    landmarks: dict[str, np.ndarray]

    def on_platform(self, point: tuple[float, ...]) -> np.ndarray:
        """A point of the platform, (3,) in {M}, in {S}, (N, 3)."""
        return on_platform(self.position, self.rotation, point)

    def line(self, chain: str, points: Sequence[str], sample: int) -> np.ndarray:
        """Points of a chain at a sample, (m, 3)."""
        at = self.chains[chain].points
        return np.array([at[p] if at[p].ndim == 1 else at[p][sample] for p in points])


def of_ligament(name: str) -> str:
    """What a ligament is called among chains: no name has quotes."""
    return f'ligament "{name}"'


def on_platform(position: np.ndarray, R: np.ndarray, point: tuple[float, ...]) -> np.ndarray:
    """O_M + R m for one point m of the platform, (N, 3)."""
    return position + R @ np.asarray(point)


def place(mechanism: Mechanism, pose: np.ndarray, joint: np.ndarray) -> Scene:
    """Place every point that a picture needs.

    Args: pose: X_EE, (N, 6) [m, rad];  joint: joint coordinates, (N, n) [rad or m].
    """
    position, R = pose[:, :3], rotations(pose[:, 3:])

    chains = {
        chain.name: drawing_points(chain, joint[:, i], on_platform(position, R, chain.platform))
        for i, chain in enumerate(mechanism.chains)
    }
    chains |= {
        of_ligament(one.name): _cable(one, joint, on_platform(position, R, one.platform))
        for one in mechanism.ligaments
    }
    contacts = {c.name: on_platform(position, R, c.point) for c in mechanism.contacts}
    landmarks = {n: on_platform(position, R, p) for n, p in mechanism.platform.points.items()}
    return Scene(position, R, chains, contacts, landmarks)


PLATFORM_JOINT = "M"
CABLE = 0.4  # thickness of a cable over a slender rod's
BARREL = 0.6  # length of a telescopic leg's cylinder over the whole leg at home


@dataclass(frozen=True)
class DrawnRod:
    """A straight body between two points of its chain.

    thickness: of its radius, relative to a slender rod;  moving: whether it shows the chain.
    """

    body: str
    start: str
    end: str
    thickness: float = 1.0
    moving: bool = True


@dataclass(frozen=True)
class ChainDrawing:
    """What to draw of one chain.

    points: name -> (3,) where fixed in {S}, (N, 3) where moving [m]; "M" is on the platform.
    rods:   the bodies;  balls: points with a ball joint.
    """

    points: dict[str, np.ndarray]
    rods: tuple[DrawnRod, ...]
    balls: tuple[str, ...]


def drawing_points(chain: Any, joint: np.ndarray, M: np.ndarray) -> ChainDrawing:
    """Draw a chain whose joint coordinate is `joint`, (N,), and platform joint at M, (N, 3)."""
    return DRAWINGS.get(chain.kind, _unknown)(chain, joint, M)


def _rss(chain: Any, joint: np.ndarray, M: np.ndarray) -> ChainDrawing:
    c = FAMILIES["RSS"].constants(chain)
    G, (x, y, z) = np.asarray(c["G"]), np.asarray(c["C"]).T
    crank = np.cos(joint)[:, None] * x + np.sin(joint)[:, None] * y
    shaft = 0.25 * c["l"] * z
    points = {
        "G": G,
        "shaft_start": G - shaft,
        "shaft_end": G + shaft,
        "S": G + c["l"] * crank,
        "M": M,
    }
    rods = (
        DrawnRod("shaft", "shaft_start", "shaft_end", 2.0, moving=False),
        DrawnRod("crank", "G", "S", 1.6),
        DrawnRod("coupler", "S", "M"),
    )
    return ChainDrawing(points, rods, ("S", "M"))


def _pss(chain: Any, joint: np.ndarray, M: np.ndarray) -> ChainDrawing:
    base = np.asarray(chain.base, dtype=float)
    axis = np.asarray(chain.axis) / np.linalg.norm(chain.axis)
    travel = joint[np.isfinite(joint)]
    spare = 0.2 * np.linalg.norm(np.subtract(chain.platform, base))
    low, high = travel.min(initial=0.0) - spare, travel.max(initial=0.0) + spare
    points = {
        "rail_start": base + low * axis,
        "rail_end": base + high * axis,
        "S": base + joint[:, None] * axis,
        "M": M,
    }
    rods = (
        DrawnRod("rail", "rail_start", "rail_end", 0.8, moving=False),
        DrawnRod("rod", "S", "M"),
    )
    return ChainDrawing(points, rods, ("S", "M"))


def _sps(chain: Any, joint: np.ndarray, M: np.ndarray) -> ChainDrawing:
    base = np.asarray(chain.base, dtype=float)
    home = np.linalg.norm(np.subtract(chain.platform, base))
    leg = M - base
    length = np.linalg.norm(leg, axis=1, keepdims=True)
    points = {"B": base, "barrel": base + leg * (BARREL * home / length), "M": M}
    rods = (DrawnRod("cylinder", "B", "barrel", 2.0), DrawnRod("piston", "barrel", "M"))
    return ChainDrawing(points, rods, ("B", "M"))


def _cable(chain: Any, joint: np.ndarray, M: np.ndarray) -> ChainDrawing:
    """A thin line; where it holds the platform there is no joint to be seen."""
    line = [chain.base, *getattr(chain, "via", ())]
    names = ["B", *(f"via_{i}" for i in range(1, len(line))), "M"]
    points = dict(zip(names, [*(np.asarray(p, dtype=float) for p in line), M], strict=True))
    rods = (DrawnRod("cable", a, b, CABLE) for a, b in pairwise(names))
    return ChainDrawing(points, tuple(rods), ())


def _unknown(chain: Any, joint: np.ndarray, M: np.ndarray) -> ChainDrawing:
    """A family without a drawing of its own: a line from its base."""
    points = {"B": np.asarray(chain.base, dtype=float), "M": M}
    return ChainDrawing(points, (DrawnRod("chain", "B", "M"),), ("M",))


Drawing = Callable[[Any, np.ndarray, np.ndarray], ChainDrawing]
DRAWINGS: dict[str, Drawing] = {
    "RSS": _rss,
    "PSS": _pss,
    "SPS": _sps,
    "cable": _cable,
    "muscle": _cable,
}
