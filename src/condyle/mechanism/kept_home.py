"""Home kept: a surface follows a change that would take its contact off it.

It goes with its offset along Z (planes, quadratics, profiles, expressions), or its centre along the
normal at home (spheres, cylinders, ellipsoids), unless that number is itself among those changed.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, Protocol, get_args

import numpy as np

from ..errors import InputError, brief
from .contact import Contact
from .paths import Path, parsed
from .surface.wall import missed

Keep = Literal["home", "all"]
KEEP = get_args(Keep)


class HasContacts(Protocol):
    """A mechanism, as its contacts see it."""

    @property
    def contacts(self) -> tuple[Contact, ...]: ...


def kept_contacts(mechanism: HasContacts, paths: Iterable[str], keep: str) -> list[int]:
    """Contacts whose home is kept, by number: all but those whose own offset or centre is given.

    Raises: InputError: for another `keep` than `home` or `all`.
    """
    if keep not in KEEP:
        raise InputError(f'keep: expected "home" or "all", got {brief(keep)}')
    given = [parsed(path) for path in paths]
    every = enumerate(mechanism.contacts)
    return [
        i
        for i, c in every
        if keep == "home"
        and c.surface.carrier in c.surface.numbers
        and not any(_carries(keys, i, c) for keys in given)
    ]


def _carries(keys: Path, i: int, contact: Contact) -> bool:
    """Whether a path is, or contains, or is within what carries a contact's surface."""
    if keys[0] != "contact" or (len(keys) > 1 and keys[1] not in (i, contact.name, "*")):
        return False
    return keys[2:4] == ("surface", contact.surface.carrier)[: max(0, len(keys) - 2)]


def followed(old: Contact, new: Contact) -> Contact:
    """The new contact with its surface where home misses it by as much as the old one's did."""
    if old == new or old.surface.kind != new.surface.kind or not new.surface.known:
        return new
    if new.surface.carrier not in new.surface.numbers:
        return new
    _, gradient = old.gradient()
    normal = gradient / np.linalg.norm(gradient)
    before, _ = missed(old, normal)
    same = (old.ball_radius is None) == (new.ball_radius is None)
    after, direction = missed(new, normal, old.offset_surface.form if same else None)
    by = after - before
    if by == 0:
        return new
    return new.model_copy(update={"surface": new.surface.moved_by(by, direction)})
