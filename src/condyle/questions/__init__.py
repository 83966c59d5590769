"""The questions: each written once, as expressions with the chains as lanes.

A question is a function of a mechanism's structure that returns the graph of its answer; a new one
is a file that registers its name.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import import_module
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any

from ..dynamics import FORMULATIONS
from ..errors import InputError, brief, did_you_mean
from ..graph.program import Program, Programs
from ..graph.transform import numbers_as_ports
from ..kinematics.chain import FAMILIES
from ..mechanism.surface import table_of
from ..mechanism.surface.wall import Wall
from .numbers import Layout
from .structure import Structure

_FILES = {
    "activated": "activated",
    "allocation": "allocation",
    "inverse": "inverse motion balance system",
    "levelled": "levelled",
    "limited": "limited",
    "forward": "forward forward_system",
    "linear": "linear yielding places",
    "derivative": "derivative",
    "closure": "closure conditions",
    "configuration": "configuration survey",
    "pose": "encoders pose",
    "instant": "instant energy",
    "matrices": "matrices coriolis jacobians",
    "elastic": "elastic elastic_held elastic_yielding",
    "reactions": "reactions",
    "regressor": "regressor",
    "rate": "rate",
    "lifting": "lifting impact",
    "observer": "observer",
    "passive": "passive",
    "curvature": "curvature",
    "kalman": "kalman",
    "tick": "tick",
    "file_numbers": "file_numbers",
}
# Name -> its file in this folder, or the function itself if it is a user's.
QUESTIONS: dict[str, str | Callable[..., Program | Programs]] = {
    name: home for home, names in _FILES.items() for name in names.split()
}


def written(name: str) -> Callable[..., Program | Programs]:
    """The function of a question; its file is imported on first use.

    Raises: InputError: for an unknown question.
    """
    if name not in QUESTIONS:
        raise InputError(
            f"question: unknown question {brief(name)}.{did_you_mean(name, QUESTIONS)}"
        )
    home = QUESTIONS[name]
    return getattr(import_module(f".{home}", __name__), name) if isinstance(home, str) else home


# The rooms whose code shapes a graph.
SOURCES = ("mechanism", "kinematics", "dynamics", "graph", "questions")
# Questions that do not depend on formulation and route, or that twists serve best.
GEOMETRY = (
    "allocation", "levelled", "motion", "closure", "conditions", "configuration", "survey",
    "encoders", "pose", "instant", "energy", "jacobians", "coriolis", "reactions", "linear",
    "yielding", "places", "elastic", "elastic_held", "elastic_yielding", "forward_system",
    "system", "regressor", "passive", "curvature",
)  # fmt: skip
# Questions in which gravity and the base's motion may be given: `Structure.given`.
DYNAMIC = (
    "inverse", "balance", "system", "forward", "forward_system", "linear", "yielding", "reactions",
    "regressor", "limited", "rate", "tick", "kalman",
)  # fmt: skip


@dataclass(frozen=True)
class Question:
    """A question about a structure, not yet written out.

    details: its other arguments, such as the requested outputs.
    ports:   whether the mechanism's numbers are ports, columns as states are: see
             `graph.transform.numbers_as_ports`. Then there is no robust program.
    """

    name: str
    structure: Structure
    details: tuple[Any, ...] = ()
    ports: bool = False

    @staticmethod
    def about(structure: Structure, name: str, *details: Any) -> Question:
        asked = details[1] if name == "derivative" else name
        if asked in GEOMETRY:
            structure = replace(structure, formulation="virtual_power", route="core")
        if asked not in DYNAMIC:
            structure = replace(structure, given=())
        return Question(name, structure, details)

    def with_ports(self) -> Question:
        """The same with the mechanism's numbers as ports."""
        return replace(self, ports=True)

    @property
    def key(self) -> str | None:
        """A text that identifies the answer's graph.

        None where code from outside this package shapes it: then only the graph itself does.
        """
        s = self.structure
        parts = (
            QUESTIONS.get(self.name),
            FORMULATIONS[s.formulation],
            *map(FAMILIES.get, s.families),
            *(table_of(form) for form, _ in s.contacts),
        )
        if _foreign((*parts, *self.details)):
            return None
        shape = replace(s, zeros=frozenset()), sorted(s.zeros)
        return repr((self.name, shape, self.details, self.ports, _casadi(), _sources()))

    def variants(self) -> Programs:
        """The graph."""
        found = written(self.name)(self.structure, *self.details)
        variants = found if isinstance(found, Programs) else Programs(found)
        if not self.ports:
            return variants
        file = self.name == "file_numbers"
        s = self.structure
        layout = Layout.of_file(s, self.details[0]) if file else Layout.of(s)
        return Programs(numbers_as_ports(variants.main, *layout.sizes))


def _foreign(part: Any) -> bool:
    """Whether a function, a class, an object or surface of one, or any in a tuple, is of another
    package."""
    if isinstance(part, tuple):
        return any(map(_foreign, part))
    if isinstance(part, Wall):
        part = table_of(part.form)
    home = getattr(part, "__module__", None) or type(part).__module__
    return home.partition(".")[0] not in (__package__.partition(".")[0], "builtins")


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


__all__ = ["DYNAMIC", "QUESTIONS", "Question"]
