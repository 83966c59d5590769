"""A mechanism in a few lines: for a console, and for a notebook."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

import numpy as np

from ..errors import CondyleError, join
from .ball_joint import BallJoint, joined
from .bodies import Platform
from .cells import table
from .coordinates import COORDINATES
from .fossa_wall import FossaWall
from .home import Parts, dependent_coordinates
from .vocabulary import SpokenOf, words_of


class MechanismParts(Parts, SpokenOf, Protocol):
    """A mechanism."""

    @property
    def name(self) -> str: ...
    @property
    def platform(self) -> Platform: ...
    @property
    def ligament_names(self) -> tuple[str, ...]: ...
    @property
    def walls(self) -> tuple[FossaWall, ...]: ...


def in_words(mechanism: MechanismParts) -> str:
    """Name, freedoms, chains by family, contacts by surface, ligaments, walls: a line each."""
    head, *rows = _rows(mechanism)
    lines = [f'Mechanism "{mechanism.name}": {head[1]}']
    return "\n".join([*lines, *(f"  {title}: {text}" for title, text in rows)])


def in_html(mechanism: MechanismParts, draw: Callable[[], str]) -> str:
    """A picture, where it can be drawn, and the same as a small table."""
    try:
        picture = draw()
    except (CondyleError, AttributeError, ValueError):  # a draft: points are missing
        picture = ""
    return table("Mechanism", mechanism.name, _rows(mechanism), picture)


def _rows(mechanism: MechanismParts) -> list[tuple[str, str]]:
    chains = _grouped((chain.kind, chain.name) for chain in mechanism.chains)
    contacts = _grouped(
        (one.kind if isinstance(one, BallJoint) else one.surface.kind, one.name)
        for one in joined(mechanism.contacts)
    )
    radii = np.sqrt(mechanism.platform.inertia.principal() / mechanism.platform.mass) * 1e3
    gyration = ", ".join(f"{radius:.3g}" for radius in radii)
    names = mechanism.ligament_names
    rows = [
        ("freedoms", _freedoms(mechanism)),
        ("chains", chains),
        ("contacts", contacts or "none"),
        *([("ligaments", f"{len(names)} ({join(names)})")] if names else []),
        *([("walls", _walls(mechanism.walls))] if mechanism.walls else []),
        ("platform", f"{mechanism.platform.mass:g} kg, radii of gyration {gyration} mm"),
    ]
    say = words_of(mechanism)
    return [(say(title), text) for title, text in rows]


def _freedoms(mechanism: MechanismParts) -> str:
    count = 6 - len(mechanism.contacts)
    text = f"{count} degree{'s' * (count != 1)} of freedom"
    try:
        dependent = dependent_coordinates(mechanism)
    except (CondyleError, StopIteration):  # a draft, or a note in the place of a surface
        return text
    independent = ", ".join(name for name in COORDINATES if name not in dependent)
    depend = f"; dependent {', '.join(dependent)}" if dependent else ""
    return f"{text} ({independent}{depend})"


def _walls(walls: tuple[FossaWall, ...]) -> str:
    off = sum(not wall.enabled for wall in walls)
    text = f"{len(walls)} ({join(wall.name for wall in walls)})"
    return f"{text}; {off} of them off" if 0 < off < len(walls) else text + "; off" * (off > 0)


def _grouped(kinds: Iterable[tuple[str, str]]) -> str:
    """'4 RSS (a, b, c, d), 2 PSS (e, f)'."""
    groups: dict[str, list[str]] = {}
    for kind, name in kinds:
        groups.setdefault(kind, []).append(name)
    return ", ".join(f"{len(names)} {kind} ({join(names)})" for kind, names in groups.items())
