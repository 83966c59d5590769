"""The mechanism: a frozen, validated description in SI."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from ..errors import CondyleWarning, InputError, MechanismError, brief, shortened
from .ball_joint import SeparatedContacts
from .bodies import Inertia, Platform
from .chain import Chain
from .contact import Bounds, Contact
from .coordinates import COORDINATES, Coordinate
from .fossa_wall import FossaWall
from .home import home_problems, usable_sets
from .kept_home import Keep, followed, kept_contacts
from .ligament import Ligament
from .mechanism_checks import mechanism_warnings
from .paths import changed, parsed, value_at
from .portrait import in_html, in_words
from .quantities import Gravity, Name
from .table import Table
from .vocabulary import Vocabulary

__all__ = ["COORDINATES", "Bounds", "Contact", "Coordinate", "Inertia", "Mechanism", "Platform"]

_NOTHING: Any = object()


class Mechanism(Table):
    """A platform, the contacts that constrain it and the chains that drive it.

    All values are SI. `set` and `replace` return changed copies; `condyle.dump` writes a file.
    """

    implied: ClassVar[tuple[str, ...]] = ("ligament", "wall")

    name: Name
    vocabulary: Vocabulary | None = Field(
        default=None, description="words of reports and messages: of a jaw, or of a machine"
    )
    gravity: Gravity = Field(default=(0.0, 0.0, -9.81), description="in {S}")
    dependent: tuple[Coordinate, ...] | None = Field(
        default=None, description="pose coordinates that the contacts determine"
    )
    platform: Platform
    contacts: Annotated[tuple[Contact, ...], SeparatedContacts()] = Field(
        default=(), alias="contact", max_length=5
    )
    chains: tuple[Chain, ...] = Field(alias="chain", min_length=1)
    ligaments: tuple[Ligament, ...] = Field(default=(), alias="ligament", max_length=100)
    walls: tuple[FossaWall, ...] = Field(default=(), alias="wall", max_length=20)

    def get(self, path: str) -> Any:
        """The value at a path of the file, SI: `get("chain.masseter_left.base[2]")`.

        Raises: InputError: if there is no such path.
        """
        return value_at(self, path)

    def set(
        self, path: str | Mapping[str, Any], value: Any = _NOTHING, *, keep: Keep = "all"
    ) -> Self:
        """A copy with other values at some paths of the file, validated like a file.

            mechanism.set("platform.mass", 0.25)
            mechanism.set({"contact.left.point[2]": 0.031, "contact.left.surface.offset": 0.021})

        Chains and contacts are addressed by name, entries of lists by index from 0. Several
        changes are made together: what must agree, such as a contact point and its surface, is
        checked at the end. None removes an optional entry. Numbers that are valid and suggest a
        slip, such as a wrong unit, give a `CondyleWarning`, as `condyle check` does, where the
        mechanism had none of that kind before.

        Args:   path: one path, or paths with their values;  value: the new one, SI;
                keep: `home`: a surface that a change takes off its contact's home follows it with
                its offset, or with its centre along the normal, unless that number is changed
                itself; `all`: all else stays.
        Raises: MechanismError: with every problem found;  InputError: for an unknown path.
        """
        if isinstance(path, Mapping):
            if value is not _NOTHING:
                raise InputError("set: expected a path and a value, or one {path: value, ...}")
        elif value is _NOTHING:
            raise InputError(f"set: expected a path and a value, got {brief(path)} alone")
        else:
            parsed(path)
            path = {path: value}
        made = self._set(path, keep)
        if found := mechanism_warnings(made):
            known = {warning.kind for warning in mechanism_warnings(self)}
            for warning in found:
                if warning.kind not in known:
                    warnings.warn(str(warning), CondyleWarning, stacklevel=2)
        return made

    def _set(self, changes: Mapping[str, Any], keep: str) -> Self:
        """`set` without its warnings, for many."""
        followers = set(kept_contacts(self, changes, keep))
        if not followers:
            return self.checked(changed(self, changes), self.name)
        made = super().checked(changed(self, changes), self.name)
        if len(made.contacts) != len(self.contacts):
            raise InputError('set: keep="home" needs as many contacts as before')
        pairs = enumerate(zip(self.contacts, made.contacts, strict=True))
        contacts = tuple(followed(*pair) if i in followers else pair[1] for i, pair in pairs)
        return self.checked({**made.entries(), "contact": contacts}, self.name)

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, validated like a file.

        Raises: MechanismError: with every problem found.
        """
        return self.model_copy(update=changes)

    @classmethod
    def checked(cls, data: Mapping[str, Any], source: str) -> Self:
        made = super().checked(data, source)
        if problems := list(home_problems(made)):
            raise MechanismError(source, problems)
        return made

    @property
    def degrees_of_freedom(self) -> int:
        return 6 - len(self.contacts)

    @cached_property
    def first_usable(self) -> tuple[str, ...] | None:
        """The first set of coordinates that the contacts determine at home, if there is one."""
        return next(usable_sets(self), None)

    @cached_property
    def chain_names(self) -> tuple[str, ...]:
        return tuple(chain.name for chain in self.chains)

    @cached_property
    def zeros(self) -> tuple[float, ...]:
        """What the encoders read at home [rad or m]: readings are joint coordinates plus these."""
        return tuple(chain.actuator.zero for chain in self.chains)

    @cached_property
    def contact_names(self) -> tuple[str, ...]:
        return tuple(contact.name for contact in self.contacts)

    @cached_property
    def ligament_names(self) -> tuple[str, ...]:
        return tuple(ligament.name for ligament in self.ligaments)

    @cached_property
    def wall_names(self) -> tuple[str, ...]:
        return tuple(wall.name for wall in self.walls)

    @cached_property
    def enabled_walls(self) -> tuple[FossaWall, ...]:
        return tuple(wall for wall in self.walls if wall.enabled)

    def __repr__(self) -> str:
        return in_words(self)

    __str__ = __repr__

    def _repr_html_(self) -> str:
        from ..report.cell import mechanism_picture

        return in_html(self, lambda: mechanism_picture(self))

    @field_validator("dependent")
    @classmethod
    def _distinct(cls, value: tuple[str, ...] | None) -> tuple[str, ...] | None:
        if value is not None and len(set(value)) != len(value):
            raise ValueError(f"a coordinate is given twice in {list(value)}")
        return value

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> Self:
        listed = {
            "contact": [{"name": name} for name in self.contact_names],
            "chain": [{"name": name} for name in self.chain_names],
            "ligament": [{"name": name} for name in self.ligament_names],
            "wall": [{"name": name} for name in self.wall_names],
            "dependent": self.dependent,
        }
        problems = list(structural_problems(listed))
        if not problems and (info.context or {}).get("at_home", True):
            problems = list(home_problems(self))
        if problems:
            raise ValueError("; ".join(problems))
        return self


def structural_problems(data: Mapping[str, Any]) -> Iterator[str]:
    """Names given twice, too few chains, a wrong number of dependent coordinates.

    Args: data: the file's top level, as TOML gives it. What is no list of tables is not counted:
          that is another problem.
    """
    counts: dict[str, int | None] = {}
    for kind in ("contact", "chain", "ligament", "wall"):
        tables = data.get(kind, ())
        if not isinstance(tables, list | tuple) or not all(isinstance(t, Mapping) for t in tables):
            counts[kind] = None
            continue
        counts[kind] = len(tables)
        names = Counter(t["name"] for t in tables if isinstance(t.get("name"), str))
        for name, count in names.items():
            if count > 1:
                yield (
                    f'{kind}: the name "{shortened(name, 40)}" is given {count} times; every '
                    f"{kind} needs its own"
                )
    contacts, chains = counts["contact"], counts["chain"]
    if contacts is None:
        return
    freedoms = 6 - contacts
    if freedoms < 1 and sum("coordinate" in str(t.get("surface")) for t in data["contact"]) > 3:
        yield (
            "contact: two ball joints hold six coordinates, and leave the turn about their line "
            "only, for which five are enough. Hold two coordinates of the second centre instead: "
            'contacts with surface = { kind = "coordinate", axis = "x", offset = .. }'
        )
    if chains and chains < freedoms:
        yield (
            f"chain: {chains} actuators cannot drive {freedoms} degrees of freedom "
            f"(6 less {contacts} contacts); at least {freedoms} chains are needed"
        )
    dependent = data.get("dependent")
    if isinstance(dependent, list | tuple) and len(dependent) != contacts:
        yield (
            f"dependent: names {len(dependent)} coordinates, but there are {contacts} "
            "contacts; each contact determines one"
        )
