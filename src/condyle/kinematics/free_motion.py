"""The motion that a direct singularity leaves the platform: a twist, and its screw in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..mechanism.mechanism_checks import length_text
from .singularities import admitted_twists

SAME = 1e-6  # of the characteristic length: a point this near an axis is on it


@dataclass(frozen=True)
class FreeMotion:
    """A twist of the platform, of any size.

    V: of its origin, (3,) [m/s];  omega: (3,) [rad/s];  length: characteristic [m].
    """

    V: np.ndarray
    omega: np.ndarray
    length: float

    @classmethod
    def of(cls, J_W: np.ndarray, N: np.ndarray, length: float) -> FreeMotion:
        """The one that locked actuators resist least.

        Args: J_W: on [V; L omega], dimensionless, (n, 6);  N: wrenches of the contacts, dual to
              these, (k, 6), both at one pose.
        """
        free = admitted_twists(N[None])[0]
        twist = np.linalg.svd(J_W @ free.T)[2][-1] @ free
        return cls(twist[:3], twist[3:] / length, length)

    @property
    def turns(self) -> bool:
        """Whether it has an axis; else it is a translation."""
        turning = self.length * np.linalg.norm(self.omega)
        return bool(turning >= SAME * np.linalg.norm(self.V))

    @property
    def axis(self) -> tuple[np.ndarray, np.ndarray]:
        """A point of the axis, from the platform's origin, and a unit vector along it, (3,) each,
        along the axes of {S}; of a motion that turns."""
        turning = np.linalg.norm(self.omega)
        return np.cross(self.omega, self.V) / turning**2, self.omega / turning

    def text(self, points: Mapping[str, np.ndarray]) -> str:
        """The motion in words: 'turns about the axis along (0, 1, 0) through left and right'.

        Args: points: of the platform by name, (3,) [m] each, from its origin along the axes of {S}.
        """
        if not self.turns:
            return f"moves along {_direction(self.V)}"
        place, axis = self.axis
        pitch = axis @ self.V / np.linalg.norm(self.omega)
        on_axis = [
            f'"{name}"'
            for name, point in points.items()
            if np.linalg.norm(np.cross(point - place, axis)) < SAME * self.length
        ]
        through = " and ".join(on_axis[:2])
        if not on_axis:
            through = f"{', '.join(map(length_text, place))} from the platform's origin"
        text = f"turns about the axis along {_direction(axis)} through {through}"
        if abs(pitch) > SAME * self.length:
            text += f", moving along it by {length_text(2 * np.pi * pitch)} a turn"
        return text


def _direction(vector: np.ndarray) -> str:
    """'(0, 0.6, 0.8)', of length 1, the largest component positive."""
    unit = vector / vector[np.argmax(np.abs(vector))]
    unit /= np.linalg.norm(unit)
    return f"({', '.join(f'{x:.4g}' for x in np.where(np.abs(unit) < SAME, 0.0, unit))})"
