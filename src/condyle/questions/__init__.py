"""What can be asked: each question once, as expressions over chains as lanes.

A question is a function of a mechanism's structure that returns the graph of its answer; a new one
is a file that registers its name.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any

from ..graph.program import Program, Variants
from .allocation import allocation
from .closure import Prescribed, closure, conditions
from .configuration import configuration
from .forward import forward, forward_system
from .instant import energy, instant
from .inverse import balance, inverse, motion, system
from .limited import limited
from .linear import linear
from .matrices import jacobians, matrices
from .observer import observer
from .pose import encoders, pose
from .rate import rate
from .reactions import reactions
from .structure import Structure
from .survey import survey
from .tick import tick

QUESTIONS: dict[str, Callable[..., Program | Variants]] = {
    "allocation": allocation,
    "inverse": inverse,
    "limited": limited,
    "forward": forward,
    "forward_system": forward_system,
    "motion": motion,
    "balance": balance,
    "system": system,
    "linear": linear,
    "closure": closure,
    "conditions": conditions,
    "configuration": configuration,
    "survey": survey,
    "encoders": encoders,
    "pose": pose,
    "instant": instant,
    "energy": energy,
    "matrices": matrices,
    "jacobians": jacobians,
    "reactions": reactions,
    "rate": rate,
    "observer": observer,
    "tick": tick,
}
# What shapes a graph: the rooms that a question is written in.
SOURCES = ("mechanism", "kinematics", "dynamics", "graph", "questions")
# Questions that formulation and route make no difference to.
GEOMETRY = (
    "allocation",
    "motion",
    "closure",
    "conditions",
    "configuration",
    "survey",
    "encoders",
    "pose",
    "instant",
    "energy",
    "jacobians",
    "reactions",
    "linear",
)


@dataclass(frozen=True)
class Question:
    """A question about a structure, not yet written out.

    details: what it takes besides, such as the outputs that are wanted.
    """

    name: str
    structure: Structure
    details: tuple[Any, ...] = ()

    @staticmethod
    def about(structure: Structure, name: str, *details: Any) -> Question:
        if name in GEOMETRY:
            structure = replace(structure, formulation="virtual_power", route="core")
        return Question(name, structure, details)

    @property
    def key(self) -> str:
        """A text of everything that shapes the answer's graph."""
        s = self.structure
        told = replace(s, zeros=frozenset()), sorted(s.zeros)
        known = repr((self.name, told, self.details, _casadi(), _sources()))
        return known + (self.variants().digest if _foreign(self.details) else "")

    def variants(self) -> Variants:
        """The graph."""
        found = QUESTIONS[self.name](self.structure, *self.details)
        return found if isinstance(found, Variants) else Variants(found)


def _foreign(details: Any) -> bool:
    """Whether a law or a load from outside is among them, whose code is not in the rooms."""
    if isinstance(details, tuple):
        return any(map(_foreign, details))
    return isinstance(details, type) and not details.__module__.startswith(f"{__package__}.")


@lru_cache(maxsize=1)
def _casadi() -> str:
    return version("casadi")


@lru_cache(maxsize=1)
def _sources() -> str:
    """A hash of the code that questions are written in."""
    h = hashlib.sha256()
    for room in SOURCES:
        for path in sorted(Path(str(files("condyle") / room)).rglob("*.py")):
            data = path.read_bytes()
            h.update(f"{path.name} {len(data)} ".encode())
            h.update(data)
    return h.hexdigest()


__all__ = ["QUESTIONS", "Prescribed", "Question"]
