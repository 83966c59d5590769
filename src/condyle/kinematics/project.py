"""Projection of home onto the contact surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..errors import InputError
from ..mechanism.home import HOME_WARNING, characteristic_length, home_residuals
from ..mechanism.mechanism import COORDINATES, Mechanism
from .constraints import contacts_of, residuals

ITERATIONS = 50
ON_THE_SURFACE = 1e-12  # metres


@dataclass(frozen=True)
class Projection:
    """The nearest home on the contact surfaces.

    residual:     distance of each ball from its surface as given, (k,) [m].
    displacement: X_EE of the nearest pose that meets the contacts, (6,) [m, rad].
    points:       with the platform where it is, the nearest ball centres on the surfaces, (k, 3)
                  [m] in {M}: values for `point` in the file.
    """

    names: tuple[str, ...]
    residual: np.ndarray
    displacement: np.ndarray
    points: np.ndarray

    @property
    def needed(self) -> bool:
        """Whether a ball is off its surface by more than the tolerance."""
        return bool((np.abs(self.residual) > HOME_WARNING).any())

    def data(self) -> dict[str, Any]:
        """As JSON, SI."""
        return {
            "displacement": dict(zip(COORDINATES, self.displacement.tolist(), strict=True)),
            "contacts": {
                name: {"residual": float(off), "point": point.tolist()}
                for name, off, point in zip(self.names, self.residual, self.points, strict=True)
            },
        }

    def text(self, per_metre: float) -> str:
        """As text.

        Args: per_metre: file units per metre, for points to paste into the file.
        """
        width = max(map(len, self.names), default=0)
        lines = ["off their surfaces at home"]
        for name, off in zip(self.names, self.residual, strict=True):
            lines.append(f"  {name:<{width}}  {off * 1e3:+.6g} mm")
        moved = [f"{v * 1e3:+.6g} mm" for v in self.displacement[:3]]
        moved += [f"{np.degrees(v):+.6g} deg" for v in self.displacement[3:]]
        lines.append("nearest home on the surfaces: the platform moved by")
        lines.append("  " + ", ".join(map(" ".join, zip(COORDINATES, moved, strict=True))))
        lines.append("or, with the platform where it is, the nearest points for the file")
        for name, point in zip(self.names, self.points, strict=True):
            numbers = ", ".join(_short(v * per_metre, per_metre) for v in point)
            lines.append(f"  {name:<{width}}  point = [{numbers}]")
        return "\n".join(lines)


def project_home(mechanism: Mechanism) -> Projection:
    """The smallest displacement of the platform that puts every ball on its surface.

    Smallest in the six coordinates, angles multiplied by the characteristic length.

    Args:   mechanism: one whose contacts need not be on their surfaces yet.
    Raises: InputError: if no pose near home meets all contacts.
    """
    contacts = contacts_of(mechanism)
    x, d = ca.SX.sym("x", 6), ca.SX.sym("d", 3)
    length = characteristic_length(mechanism)
    scale = np.array([1.0, 1.0, 1.0, 1 / length, 1 / length, 1 / length])
    displacement = _nearest_root(residuals(contacts, x), x, scale)
    found = [_nearest_root(c.phi(c.point + d), d, np.ones(3)) for c in contacts]
    moves = [move for move in found if move is not None]
    if displacement is None or len(moves) < len(found):
        raise InputError(
            f"{mechanism.name}: no pose near home puts the contacts "
            f"{', '.join(mechanism.contact_names)} on their surfaces; move the surfaces"
        )
    points = [np.add(c.point, move) for c, move in zip(mechanism.contacts, moves, strict=True)]
    return Projection(
        mechanism.contact_names,
        home_residuals(mechanism),
        displacement,
        np.array(points).reshape(-1, 3),
    )


def _nearest_root(phi: ca.SX, x: ca.SX, scale: np.ndarray) -> np.ndarray | None:
    """The root of phi with the least |x / scale|, by least-norm Newton; None if there is none.

    y <- C^+ (C y - phi), y = x / scale, C = d phi / d y.
    """
    conditions = ca.Function("conditions", [x], [ca.densify(phi), ca.densify(ca.jacobian(phi, x))])
    y = np.zeros(len(scale))
    for _ in range(ITERATIONS):
        value, C = (np.asarray(v) for v in conditions(y * scale))
        if not (np.isfinite(value).all() and np.isfinite(C).all()):
            return None
        C = C.reshape(-1, len(scale)) * scale
        y = np.linalg.lstsq(C, C @ y - value.ravel(), rcond=1e-12)[0]
    off = np.asarray(conditions(y * scale)[0])
    return y * scale if (np.abs(off) < ON_THE_SURFACE).all() else None


def _short(value: float, per_metre: float) -> str:
    """A length to a picometre, in the file's unit."""
    return repr(round(float(value), 12 - round(np.log10(per_metre))))
