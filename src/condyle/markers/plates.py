"""Force plates of a C3D file (FORCE_PLATFORM): which channels, where, and the wrench they give."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

CHANNELS = {1: 6, 2: 6, 3: 8, 4: 6}  # of each type that is known
MOST = 64  # plates


@dataclass(frozen=True, eq=False)
class Plate:
    """A force plate as the file describes it.

    Attributes: type: 1 to 4 are known;  channels: their numbers, from 0.
                corners: (4, 3) [m] in the laboratory, of the plate's quadrants +x+y, -x+y, -x-y
                    and +x-y.
                origin: (3,) [m], of types 2 and 4 from where the sensor's moments are about to the
                    middle of the surface, in the plate's axes; of type 3 the sensors' distances.
                matrix: (6, 6) from the channels to forces and moments, of type 4.
                unloaded: first and last frame that the file names as without load (ZERO), or None.
    """

    type: int
    channels: tuple[int, ...]
    corners: np.ndarray
    origin: np.ndarray
    matrix: np.ndarray
    unloaded: tuple[int, int] | None = None

    @property
    def centre(self) -> np.ndarray:
        """Middle of the surface in the laboratory, (3,) [m]."""
        return self.corners.mean(axis=0)

    @property
    def axes(self) -> np.ndarray:
        """The rotation from the plate's axes to the laboratory's, (3, 3)."""
        one, two, _, four = self.corners
        x, z = one - two, np.cross(one - two, one - four)
        x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
        return np.column_stack([x, np.cross(z, x), z])

    @property
    def stands(self) -> bool:
        """Whether its corners span a surface."""
        sides = np.cross(self.corners[0] - self.corners[1], self.corners[0] - self.corners[3])
        return bool(np.isfinite(self.corners).all() and np.linalg.norm(sides) > 1e-6)

    def wrench(self, signals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Force and moment about the middle of the surface, (..., 3) each, in the plate's axes.

        Args: signals: (..., 6 or 8) of its channels [N, N m; m of type 1].
        """
        s = signals
        a, b, _ = np.abs(self.origin)
        if self.type == 3:  # sensors 1 to 4 at (a, b), (-a, b), (-a, -b), (a, -b)
            x12, x34, y14, y23, z1, z2, z3, z4 = np.moveaxis(s, -1, 0)
            force = np.stack([x12 + x34, y14 + y23, z1 + z2 + z3 + z4], -1)
            mx, my = b * (z1 + z2 - z3 - z4), a * (-z1 + z2 + z3 - z4)
            moment = np.stack([mx, my, b * (x34 - x12) + a * (y14 - y23)], -1)
            return force, moment + np.cross(force, [0.0, 0.0, self.origin[2]])
        if self.type == 1:  # force, where it acts on the surface, and the moment left over there
            force, at = s[..., :3], np.concatenate([s[..., 3:5], np.zeros_like(s[..., :1])], -1)
            free = np.concatenate([np.zeros_like(at[..., :2]), s[..., 5:]], -1)
            return force, np.cross(at, force) + free
        six = s @ self.matrix.T if self.type == 4 else s
        return six[..., :3], six[..., 3:] + np.cross(six[..., :3], self.origin)


def read_plates(file: Any, metres: float) -> tuple[Plate, ...]:
    """The plates of an open file whose unit of length is `metres`; none where it has none."""
    used = int(np.nan_to_num(_numbers(file, "USED", 1))[0])
    if not 1 <= used <= MOST:
        return ()
    types = np.clip(np.nan_to_num(_numbers(file, "TYPE", used)), 0, 999).astype(int)
    rows = np.clip(np.nan_to_num(_numbers(file, "CHANNEL", -1)), 0, 1e6).astype(int) - 1
    rows = rows.reshape(used, -1) if rows.size % used == 0 else np.zeros((used, 0), int)
    corners = _numbers(file, "CORNERS", 12 * used).reshape(used, 4, 3) * metres
    origins = np.nan_to_num(_numbers(file, "ORIGIN", 3 * used).reshape(used, 3) * metres)
    matrices = _numbers(file, "CAL_MATRIX", 36 * used).reshape(used, 6, 6).transpose(0, 2, 1)
    first, last = np.clip(np.nan_to_num(_numbers(file, "ZERO", 2)), 0, 1e9).astype(int).tolist()
    unloaded = (first, last) if 1 <= first <= last else None
    channels = [
        tuple(r[: CHANNELS.get(kind, 0)]) for kind, r in zip(types, rows.tolist(), strict=True)
    ]
    described = zip(types.tolist(), channels, corners, origins, matrices, strict=True)
    return tuple(Plate(*one, unloaded) for one in described)


def _numbers(file: Any, key: str, count: int) -> np.ndarray:
    """Numbers of a parameter, as they stand; zeros where it is missing or too short.

    Args: count: expected; -1 for as many as there are.
    """
    param = file.get(f"FORCE_PLATFORM:{key}")
    if param is None or not param.bytes:
        return np.zeros(max(count, 0))
    kind = {4: "float", 2: "int16"}.get(param.bytes_per_element, "int8")
    found = getattr(param, f"{kind}_array" if param.dimensions else f"{kind}_value")
    found = np.ravel(found).astype(float)
    return found[: None if count < 0 else count] if found.size >= count else np.zeros(count)
