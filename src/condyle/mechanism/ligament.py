"""A ligament: a line from base to platform that pulls where it is longer than its slack length."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Annotated, Any, ClassVar

from pydantic import Field, PlainValidator, TypeAdapter, WithJsonSchema

from .bodies import distance
from .quantities import (
    LARGEST_LIMIT,
    LIMIT,
    SHORTEST,
    Damping,
    Name,
    Point,
    PositiveLength,
    Stiffness,
    listed,
)
from .table import Table

Rows = tuple[tuple[float, float], ...]
MOST_ROWS = 50
_NUMBER: TypeAdapter[float] = TypeAdapter(Stiffness)


def _stiffness(value: Any) -> float | Rows:
    """A number, or rows of strain and force."""
    value = listed(value)
    if not isinstance(value, list | tuple):
        return _NUMBER.validate_python(value)
    form = "expected a number [N/m], or rows of [strain, force in N] such as [[0, 0], [0.05, 20]]"
    if not all(isinstance(row, list | tuple) and len(row) == 2 for row in value):
        raise ValueError(f"{form}, got {value}"[:300])
    if any(isinstance(x, bool) or not isinstance(x, int | float) for row in value for x in row):
        raise ValueError(f"{form}; every entry is a number")
    if not all(abs(x) <= LARGEST_LIMIT for row in value for x in row):  # before float(): overflow
        raise ValueError(f"{form}: numbers up to {LARGEST_LIMIT:g}")
    rows = tuple((float(strain), float(force)) for strain, force in value)
    if not 2 <= len(rows) <= MOST_ROWS:
        raise ValueError(f"{form}: 2 to {MOST_ROWS} rows, got {len(rows)}")
    if rows[0] != (0.0, 0.0):
        raise ValueError(f"a table of strain and force begins with [0, 0], got {list(rows[0])}")
    for (e0, f0), (e1, f1) in pairwise(rows):
        if not e1 - e0 >= SHORTEST or f1 < f0:
            raise ValueError(
                "a table of strain and force has rising strains, and forces that do not fall; "
                f"after [{e0:g}, {f0:g}] comes [{e1:g}, {f1:g}]"
            )
    return rows


_PAIR: dict[str, Any] = {
    "type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2
}  # fmt: skip
StiffnessOrRows = Annotated[
    float | Rows,
    replace(LIMIT, unit="N/m"),
    PlainValidator(_stiffness),
    WithJsonSchema(
        {
            "anyOf": [
                _NUMBER.json_schema(),
                {"type": "array", "items": _PAIR, "minItems": 2, "maxItems": MOST_ROWS},
            ]
        }
    ),
]


class Ligament(Table):
    """A line that only pulls: a passive part of the balance, with no actuator.

    With L its length, force = elastic(L) + damping L', the latter between -elastic and elastic: so
    it begins at 0 where L is slack_length, and never pushes.
    Strain is L / slack_length - 1; a table is linear between its rows and beyond the last one.
    """

    implied: ClassVar[tuple[str, ...]] = ("damping",)

    name: Name
    base: Point = Field(description="origin, in {S}")
    platform: Point = Field(description="insertion, in {M}")
    slack_length: PositiveLength = Field(description="longest length without force")
    stiffness: StiffnessOrRows = Field(
        description="beyond the slack length, or rows of strain and force in N from [0, 0]"
    )
    damping: Damping = Field(default=0.0, description="where taut")

    @property
    def rows(self) -> int:
        """Rows of its table; 0 where the stiffness is a number."""
        return len(self.stiffness) if isinstance(self.stiffness, tuple) else 0

    @property
    def length(self) -> float:
        """The length at home [m]."""
        return distance(self.base, self.platform)
