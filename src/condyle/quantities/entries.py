"""What stands along each dimension of an array: labels of the entries, and their units."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from ..kinematics.chain import FAMILIES
from ..mechanism.home import independent_coordinates
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..motion.column_units import BASE, FORCE, MOMENT

AXES = ("x", "y", "z")
WRENCH = (*FORCE, *MOMENT)
TURNS = ("rx", "ry", "rz")
SCREW = (*AXES, *TURNS)  # a small displacement
# What the energy of a simulation went to.
ACCOUNTS = (
    "kinetic", "potential", "actuators", "load", "actuator_losses", "contact_friction"
)  # fmt: skip
Labels = Sequence[Any]


class Entries(NamedTuple):
    """The entries along one dimension.

    text:   what stands along it, in words;  "": results have no such dimension.
    labels: of a mechanism, where this determines them.
    unit:   an entry's, by its label.
    """

    text: str = ""
    labels: Callable[[Mechanism], Labels] | None = None
    unit: Callable[[str], str] | None = None


def turn_or_length(coordinate: str) -> str:
    """The unit of a coordinate of a pose or of a point."""
    return "m" if coordinate in "XYZxyz" else "rad"


def _estimated(mechanism: Mechanism) -> Labels:
    free = independent_coordinates(mechanism)
    return (*free, *(f"d{name}" for name in free), *FORCE)


def _of_base(label: str) -> str:
    return {"a": "m/s^2", "w": "rad/s", "dw": "rad/s^2"}[label[:-1]]


OF_FILE = "names of the mechanism file"
DIMENSIONS: dict[str, Entries] = {
    "time": Entries("samples [s]"),
    "chain": Entries(OF_FILE, lambda m: m.chain_names),
    "contact": Entries(OF_FILE, lambda m: m.contact_names),
    "ligament": Entries(f"{OF_FILE}, where it has any", lambda m: m.ligament_names),
    "wall": Entries(
        "names of enabled walls, where there are any",
        lambda m: tuple(wall.name for wall in m.enabled_walls),
    ),
    "coordinate": Entries(", ".join(COORDINATES), lambda m: COORDINATES, turn_or_length),
    "independent": Entries(
        "the independent coordinates; `J_W_sigma` has as many values, falling",
        independent_coordinates,
        turn_or_length,
    ),
    "part": Entries(
        "platform, links of the chains and, where there is one, the base's motion, the "
        "passive forces of ligaments and walls, and the load; shares add up to the effort"
    ),
    "axis": Entries(f"{', '.join(AXES)} in {{S}}", lambda m: AXES),
    "component": Entries(
        ", ".join(WRENCH), lambda m: WRENCH, lambda label: "N" if label in FORCE else "N m"
    ),
    "source": Entries("loads of a scenario, by name"),
    "account": Entries(", ".join(ACCOUNTS), lambda m: ACCOUNTS),
    "estimated": Entries(
        "the independent coordinates, their rates, and the load's components", _estimated
    ),
    "beside": Entries("the same: columns of a covariance", _estimated),
    "marker": Entries("measured markers, by name"),
    # Of maps.
    "mode": Entries("", lambda m: range(1, len(independent_coordinates(m)) + 1)),
    "row": Entries("", independent_coordinates),
    "column": Entries("", independent_coordinates),
    # Of mechanisms that give.
    "screw": Entries("", lambda m: SCREW, lambda label: "rad" if label in TURNS else "m"),
    "principal": Entries("", lambda m: range(1, 4)),
    "eigenscrew": Entries("", lambda m: range(1, 7)),
    # Of arguments.
    "base": Entries("", lambda m: [name.removeprefix("base_") for name in BASE], _of_base),
    "prescribed": Entries("", None, turn_or_length),
    "solution": Entries(),
    "state": Entries(),
}
OF_RESULTS = tuple(name for name, entries in DIMENSIONS.items() if entries.text)


def labels_of(mechanism: Mechanism, *dimensions: str) -> dict[str, Labels]:
    """Labels along dimensions that a mechanism determines; by default along those of results,
    without those of ligaments and walls that it has not."""
    names = dimensions or [n for n in OF_RESULTS if n not in ("estimated", "beside", "account")]
    found = {n: entries(mechanism) for n in names if (entries := DIMENSIONS[n].labels) is not None}
    optional = () if dimensions else ("ligament", "wall")
    return {name: labels for name, labels in found.items() if labels or name not in optional}


def chain_units(mechanism: Mechanism, kind: str) -> list[str]:
    """Units of the chains' efforts or joints."""
    return [getattr(FAMILIES[chain.kind], f"{kind}_unit") for chain in mechanism.chains]
