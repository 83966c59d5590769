"""The motion that a direct singularity leaves the platform, as a screw in words."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..mechanism.mechanism_checks import length_text
from .singularities import admitted_twists

SAME = 1e-6  # of the characteristic length: a point this near an axis is on it


def free_twist(J_W: np.ndarray, N: np.ndarray, length: float) -> tuple[np.ndarray, np.ndarray]:
    """V [m/s] of the platform's origin and omega [rad/s], (3,) each, that locked actuators resist
    least, of any size.

    Args: J_W: on [V; L omega], dimensionless, (n, 6);  N: wrenches of the contacts, dual to these,
          (k, 6), both at one pose;  length: L [m].
    """
    free = admitted_twists(N[None])[0]
    twist = np.linalg.svd(J_W @ free.T)[2][-1] @ free
    return twist[:3], twist[3:] / length


def screw_text(
    V: np.ndarray, omega: np.ndarray, length: float, points: Mapping[str, np.ndarray]
) -> str:
    """A twist in words, such as 'turns about the axis along (0, 1, 0) through left and right'.

    Args: V: of the platform's origin, (3,);  omega: (3,);  length: characteristic [m];
          points: of the platform by name, (3,) [m] each, from its origin along the axes of {S}.
    """
    turning = np.linalg.norm(omega)
    if length * turning < SAME * np.linalg.norm(V):
        return f"moves along {_direction(V)}"
    axis, pitch = omega / turning, omega @ V / turning**2
    place = np.cross(omega, V) / turning**2
    on_axis = [
        f'"{name}"'
        for name, point in points.items()
        if np.linalg.norm(np.cross(point - place, axis)) < SAME * length
    ]
    through = " and ".join(on_axis[:2])
    if not on_axis:
        through = f"{', '.join(map(length_text, place))} from the platform's origin"
    text = f"turns about the axis along {_direction(axis)} through {through}"
    if abs(pitch) > SAME * length:
        text += f", moving along it by {length_text(2 * np.pi * pitch)} a turn"
    return text


def _direction(vector: np.ndarray) -> str:
    """'(0, 0.6, 0.8)', of length 1, the largest component positive."""
    unit = vector / vector[np.argmax(np.abs(vector))]
    unit /= np.linalg.norm(unit)
    return f"({', '.join(f'{x:.4g}' for x in np.where(np.abs(unit) < SAME, 0.0, unit))})"
