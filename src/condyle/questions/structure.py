"""The structure of a mechanism: all that shapes a question but the numbers."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from ..mechanism.home import dependent_coordinates
from ..mechanism.mechanism import Mechanism
from ..mechanism.surface import ParallelQuadric
from ..mechanism.surface.wall import Wall, wall_of

# What samples may give instead of, or besides, the mechanism's numbers: gravity in {S}, and of the
# base its acceleration, angular velocity and angular acceleration in {S}; with their units.
GIVEN = {"gravity": (3, "m/s^2"), "base": (9, "m/s^2, rad/s, rad/s^2")}


@dataclass(frozen=True)
class Structure:
    """Mechanisms of one structure share every kernel; their numbers are its constants.

    chains:    (family, count) of each group, in the order in which families first occur.
    contacts:  (form of the surface, number of its constants).
    dependent: the coordinates that the contacts determine.
    parallel:  two contacts on planes of one slope, written as their mean and difference.
    losses:    whether an actuator has a rotor or friction of its own.
    gives:     whether a chain gives under a load.
    friction:  contacts with friction, by number.
    ligaments: rows of each one's table of strain and force; 0 where its stiffness is a number.
    walls:     sign of the push of each enabled wall.
    given:     of `GIVEN`, what every sample gives: then a port has it.
    zeros:     parameters that are zero, (-1, i), and constants that are zero in every chain of a
               group, (group, i): their products are omitted.
    """

    formulation: str
    route: str
    chains: tuple[tuple[str, int], ...]
    contacts: tuple[tuple[str, int], ...]
    dependent: tuple[str, ...]
    parallel: bool = False
    losses: bool = False
    gives: bool = False
    friction: tuple[int, ...] = ()
    ligaments: tuple[int, ...] = ()
    walls: tuple[int, ...] = ()
    given: tuple[str, ...] = ()
    zeros: frozenset[tuple[int, int]] = frozenset()

    @property
    def n(self) -> int:
        """Chains."""
        return sum(count for _, count in self.chains)

    @property
    def m(self) -> int:
        """Degrees of freedom."""
        return 6 - len(self.contacts)

    @property
    def counts(self) -> tuple[int, ...]:
        """Chains of each group."""
        return tuple(count for _, count in self.chains)

    @property
    def families(self) -> tuple[str, ...]:
        """The family of each group."""
        return tuple(kind for kind, _ in self.chains)


def structure_of(
    mechanism: Mechanism, formulation: str = "virtual_power", route: str = "core"
) -> Structure:
    """The structure of a mechanism, without its zeros: see `numbers.specialised`."""
    counts: dict[str, int] = {}
    for chain in mechanism.chains:
        counts[chain.kind] = counts.get(chain.kind, 0) + 1
    loci = [c.offset_surface for c in mechanism.contacts]
    contacts = tuple((locus.form, len(locus.constants())) for locus in loci)
    planes = [locus for locus in loci if locus.flat]
    friction = tuple(i for i, c in enumerate(mechanism.contacts) if c.friction.coefficient)
    return Structure(
        formulation=formulation,
        route=route,
        chains=tuple(counts.items()),
        contacts=contacts,
        dependent=dependent_coordinates(mechanism),
        parallel=not friction
        and len(contacts) == len(planes) == 2
        and planes[0].constants()[:2] == planes[1].constants()[:2],
        losses=any(not chain.actuator.ideal for chain in mechanism.chains),
        gives=any(not chain.rigid for chain in mechanism.chains),
        friction=friction,
        ligaments=tuple(ligament.rows for ligament in mechanism.ligaments),
        walls=tuple(wall.push for wall in mechanism.enabled_walls),
    )


def smooth_forms(mechanism: Mechanism) -> tuple[tuple[str, int], ...]:
    """`Structure.contacts` of which the kernel's numbers have derivatives everywhere.

    Principal axes of a paraboloid that is equally curved all round have none; its general form
    does without.
    """
    forms = []
    for contact in mechanism.contacts:
        locus, wall = contact.offset_surface, contact.surface
        form, count = locus.form, len(locus.constants())
        if wall.curved_alike and isinstance(locus, ParallelQuadric):
            form, count = f"parallel {wall.form}", 8 + len(wall.constants())
        forms.append((form, count))
    return tuple(forms)


def walls_of(
    mechanism: Mechanism, structure: Structure, home_kept: Collection[int] = ()
) -> tuple[Wall, ...]:
    """The contacts' surfaces, as `file_numbers` takes them.

    Args: structure: whose numbers of the kernel are wanted;
          home_kept: contacts whose home is kept, by number.
    """
    forms = [form for form, _ in structure.contacts]
    return tuple(wall_of(c, i in home_kept, forms[i]) for i, c in enumerate(mechanism.contacts))
