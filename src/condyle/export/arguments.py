"""The arguments of exported functions: what ports and results are, entry by entry."""

from __future__ import annotations

from collections.abc import Sequence

from ..kinematics.chain import FAMILIES
from ..mechanism.home import independent_coordinates
from ..mechanism.mechanism import COORDINATES, Mechanism
from .exported import Argument

AXES = ("x", "y", "z")


class Arguments:
    """Arguments about one mechanism."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self.independent = independent_coordinates(mechanism)
        self.chains = tuple(chain.name for chain in mechanism.chains)
        families = [FAMILIES[chain.kind] for chain in mechanism.chains]
        self.joint_units = tuple(family.joint_unit for family in families)
        self.effort_units = tuple(family.effort_unit for family in families)
        self.contacts = tuple(mechanism.contact_names)

    def coordinates(
        self, name: str, text: str, names: Sequence[str], per: str = "", given: bool = True
    ) -> Argument:
        """Pose coordinates, or their rates."""
        units = tuple(f"{'m' if n in 'XYZ' else 'rad'}{per}" for n in names)
        return Argument(name, text, tuple(names), units, given, name)

    def states(self, names: Sequence[str] | None = None) -> list[Argument]:
        """q, q' and q''."""
        own = self.independent if names is None else names
        return [
            self.coordinates("q", "independent coordinates", own),
            self.coordinates("q1", "rates of q", own, "/s"),
            self.coordinates("q2", "accelerations of q", own, "/s^2"),
        ]

    def load(self) -> list[Argument]:
        """Force, moment and the point they act at."""
        return [
            _vector("force", "force on the platform, axes of {S}", "F", "N"),
            _vector("moment", "moment on the platform, axes of {S}", "M", "N m"),
            _vector("point", "where the force acts, in the platform's frame {M}", "", "m"),
        ]

    def pose(self) -> list[Argument]:
        """X_EE and its rates, written."""
        return [
            self.coordinates("pose", "the platform's pose X_EE", COORDINATES, given=False),
            self.coordinates("pose_rate", "its rates", COORDINATES, "/s", False),
            self.coordinates("pose_acceleration", "its accelerations", COORDINATES, "/s^2", False),
        ]

    def effort(self, given: bool = False) -> Argument:
        text = "efforts of the actuators at their joints"
        return Argument("effort", text, self.chains, self.effort_units, given, "effort")

    def joint(self) -> Argument:
        text = "joint coordinates, zero at home"
        return Argument("joint", text, self.chains, self.joint_units, True, "joint")

    def contact_force(self) -> list[Argument]:
        """Nothing, where there is no contact."""
        text = "contact forces on the platform, along the unit normals of the surfaces"
        units = ("N",) * len(self.contacts)
        if not self.contacts:
            return []
        return [Argument("contact_force", text, self.contacts, units, False, "contact_force")]


def _vector(name: str, text: str, letter: str, unit: str) -> Argument:
    return Argument(name, text, tuple(f"{letter}{a}" for a in AXES), (unit,) * 3, True, name)
