"""The nearest home on the surfaces, for contact points that are off them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..errors import InputError
from ..mechanism.home import HOME_WARNING, characteristic_length, home_residuals
from ..mechanism.mechanism import COORDINATES, Mechanism
from .closure import contact_symbols
from .contact import residuals
from .rotation import rotation

ITERATIONS = 50
ON_THE_SURFACE = 1e-12  # metres


@dataclass(frozen=True)
class Projection:
    """Where the platform would be at home with its balls on their surfaces.

    residual: distance of each ball from its surface as given, (k,) [m].
    displacement: X_EE of the nearest pose that meets the contacts, (6,) [m, rad].
    points: the ball centres there, (k, 3) [m]: what `point` would be in the file.
    """

    names: tuple[str, ...]
    residual: np.ndarray
    displacement: np.ndarray
    points: np.ndarray

    @property
    def needed(self) -> bool:
        """Whether a ball is further off its surface than goes without saying."""
        return bool((np.abs(self.residual) > HOME_WARNING).any())

    def data(self) -> dict[str, Any]:
        """For programs, SI."""
        return {
            "displacement": dict(zip(COORDINATES, self.displacement.tolist(), strict=True)),
            "contacts": {
                name: {"residual": float(off), "point": point.tolist()}
                for name, off, point in zip(self.names, self.residual, self.points, strict=True)
            },
        }

    def text(self, per_metre: float) -> str:
        """For people.

        Args: per_metre: the file's lengths in a metre, for points to paste into it.
        """
        width = max(map(len, self.names), default=0)
        lengths = (f"{n} {v * 1e3:+.6g} mm" for n, v in self._coordinates(slice(0, 3)))
        angles = (f"{n} {np.degrees(v):+.6g} deg" for n, v in self._coordinates(slice(3, 6)))
        lines = ["off their surfaces at home"]
        for name, off in zip(self.names, self.residual, strict=True):
            lines.append(f"  {name:<{width}}  {off * 1e3:+.6g} mm")
        lines.append("nearest home on the surfaces: the platform moved by")
        lines.append("  " + ", ".join([*lengths, *angles]))
        lines.append("contact points there, for the file")
        for name, point in zip(self.names, self.points, strict=True):
            numbers = ", ".join(_short(v * per_metre, per_metre) for v in point)
            lines.append(f"  {name:<{width}}  point = [{numbers}]")
        return "\n".join(lines)

    def _coordinates(self, part: slice) -> zip[tuple[str, float]]:
        return zip(COORDINATES[part], self.displacement[part], strict=True)


def project_home(mechanism: Mechanism) -> Projection:
    """The smallest displacement of the platform that puts every ball on its surface.

    Smallest in the six coordinates, angles multiplied by the characteristic length: least-norm
    Newton, x <- C^+ (C x - phi(x)).

    Args:   mechanism: one whose contacts need not be on their surfaces yet.
    Raises: InputError: if no pose near home meets all contacts.
    """
    x = ca.SX.sym("x", 6)
    phi = residuals(contact_symbols(mechanism), x)
    conditions = ca.Function("conditions", [x], [phi, ca.jacobian(phi, x)])
    scale = np.array([1.0] * 3 + [1.0 / characteristic_length(mechanism)] * 3)
    y = np.zeros(6)
    for _ in range(ITERATIONS):
        value, C = (np.asarray(v) for v in conditions(y * scale))
        C = C.reshape(-1, 6) * scale
        if not (np.isfinite(value).all() and np.isfinite(C).all()):
            break
        y = np.linalg.lstsq(C, C @ y - value.ravel(), rcond=1e-12)[0]
    pose = y * scale
    value = np.asarray(conditions(pose)[0]).ravel()
    if not (np.abs(value) < ON_THE_SURFACE).all():
        raise InputError(
            f"{mechanism.name}: no pose near home puts the contacts "
            f"{', '.join(mechanism.contact_names)} on their surfaces; move the surfaces"
        )
    R = np.asarray(ca.DM(ca.evalf(rotation(ca.SX(pose[3:])))))
    points = np.array([pose[:3] + R @ c.point for c in mechanism.contacts]).reshape(-1, 3)
    return Projection(mechanism.contact_names, home_residuals(mechanism), pose, points)


def _short(value: float, per_metre: float) -> str:
    """A length to a picometre, in the file's unit."""
    return repr(round(float(value), 12 - int(np.log10(per_metre))))
