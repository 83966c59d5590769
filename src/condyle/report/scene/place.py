"""A mechanism at poses, in {S}."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...kinematics.chain import FAMILIES
from ...kinematics.chain.chain_drawing import ChainDrawing, line_drawing
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
        chain.name: FAMILIES[chain.kind].drawing(
            chain, joint[:, i], on_platform(position, R, chain.platform)
        )
        for i, chain in enumerate(mechanism.chains)
    }
    chains |= {
        of_ligament(one.name): line_drawing(one, on_platform(position, R, one.platform))
        for one in mechanism.ligaments
    }
    contacts = {c.name: on_platform(position, R, c.point) for c in mechanism.contacts}
    landmarks = {n: on_platform(position, R, p) for n, p in mechanism.platform.points.items()}
    return Scene(position, R, chains, contacts, landmarks)


PLATFORM_JOINT = "M"
