"""A jaw from a table of muscle points, as AnyBody and other programs write them out: CSV.

    muscle,body,x,y,z,max_force,optimal_length,tendon_length,pennation

A row is a point, in the order of the line: on a fixed body, such as the skull, or on the platform,
whose rows name the body jaw, mandible or platform. Points are in {S} at home, [m] or, under
`x [mm]` and so on, [mm]; the origin is the platform's mass centre. Strength [N], lengths [m] and
pennation [rad] stand in one row of each muscle or more. With lengths it is a muscle, without a
cable that pulls with at most its strength.
"""

from __future__ import annotations

import csv
import math
import os
import re
from dataclasses import dataclass
from typing import Any, NoReturn

from ..errors import InputError, brief, join, printable, shortened
from ..files.limits import TEXT
from ..files.reading import text_of
from ..mechanism.files import from_data
from ..mechanism.library import bundled_text
from ..mechanism.toml import read_tables
from .mjcf_import import ImportResult
from .osim_import import CHARACTERS, muscle_chain

NEEDED = ("muscle", "body", "x", "y", "z", "max_force")
LENGTHS = ("optimal_length", "tendon_length", "pennation")
PLATFORM = re.compile("jaw|mandib|platform", re.IGNORECASE)
LIKE = "human-jaw"  # whose mass and inertia the platform has: a table of points has none


@dataclass
class _Line:
    """The rows of one muscle: places in two bodies, and its numbers."""

    fixed: list[list[float]]
    moving: list[list[float]]
    numbers: dict[str, float]


def from_points(path: str | os.PathLike[str], name: str) -> ImportResult:
    """A mechanism called `name` from a table of muscle points (.csv).

    Raises: InputError: for another table;  MechanismError: if the mechanism breaks the rules of
            the file format.
    """
    lines = _Table(path).lines()
    chains = [_chain(os.fspath(path), key, line) for key, line in lines.items()]
    like = read_tables(bundled_text(LIKE), LIKE)["platform"]
    platform = {key: like[key] for key in ("mass", "inertia")}
    data = {"name": name, "vocabulary": "jaw", "platform": platform, "chain": chains}
    notes = (
        f"mass and inertia of the platform are those of {LIKE}; the origin is its mass centre",
        "there are no joints: add [[contact]] tables for the condyles",
    )
    return ImportResult(from_data(data, os.fspath(path)), notes)


class _Table:
    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = os.fspath(path)
        try:
            rows = list(csv.reader(text_of(path, TEXT).splitlines(), strict=True))
        except csv.Error as error:
            self._refuse(f"is no table of values separated by commas ({error})")
        head = [cell.strip() for cell in rows[0]] if rows else []
        scales = {cell.partition(" [")[0]: cell.endswith("[mm]") for cell in head}
        known = {*NEEDED, *LENGTHS, "x [mm]", "y [mm]", "z [mm]"}
        if unknown := [cell for cell in head if cell not in known]:
            self._refuse(
                f"column {brief(unknown[0])} is unknown; expected {join([*NEEDED, *LENGTHS])}"
            )
        if len(scales) < len(head):
            self._refuse(f"has a column twice: {join(head)}")
        if missing := [c for c in NEEDED if c not in scales]:
            self._refuse(f"has no column {missing[0]}; expected {join(NEEDED)} at least")
        self.scale = {c: 1e-3 if mm else 1.0 for c, mm in scales.items()}
        self.rows = [
            (i, dict(zip(scales, (cell.strip() for cell in row), strict=False)))
            for i, row in enumerate(rows[1:], 2)
            if any(cell.strip() for cell in row)
        ]

    def lines(self) -> dict[str, _Line]:
        """Muscles by name, in the order of the table."""
        found: dict[str, _Line] = {}
        for at, row in self.rows:
            key = CHARACTERS.sub("_", row.get("muscle", ""))
            if not key:
                self._refuse(f"row {at} names no muscle")
            line = found.setdefault(key, _Line([], [], {}))
            place = [self._number(at, row, c) * self.scale[c] for c in "xyz"]
            moves = bool(PLATFORM.search(row.get("body", "")))
            if line.moving and not moves:
                self._refuse(
                    f"row {at}: {key} comes back from the platform; expected points on fixed "
                    "bodies first, then one on jaw, mandible or platform"
                )
            (line.moving if moves else line.fixed).append(place)
            for column in ("max_force", *LENGTHS):
                if row.get(column):
                    line.numbers.setdefault(column, self._number(at, row, column))
        return found

    def _number(self, at: int, row: dict[str, str], column: str) -> float:
        text = row.get(column, "")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            self._refuse(f"row {at}, {column}: expected a finite number, got {brief(text)}")
        return value

    def _refuse(self, problem: str) -> NoReturn:
        raise InputError(printable(f"{self.path}: {shortened(problem, 400)}", lines=False))


def _chain(path: str, key: str, line: _Line) -> dict[str, Any]:
    numbers = dict(line.numbers)
    force = numbers.pop("max_force", None)
    if not line.fixed or not line.moving or force is None:
        raise InputError(
            f"{path}: {key} has {len(line.fixed)} points on fixed bodies, {len(line.moving)} on "
            f"the platform and {'no' if force is None else 'a'} max_force; expected one or more, "
            "one or more, and a number [N]"
        )
    if numbers and not {"optimal_length", "tendon_length"} <= numbers.keys():
        raise InputError(
            f"{path}: {key} has {join(numbers)} alone; expected optimal_length and tendon_length, "
            "which make it a muscle, or none, for a cable"
        )
    lengths = {"pennation": 0.0, "max_speed": 10.0, **numbers} if numbers else {}
    return muscle_chain(path, key, line.fixed, line.moving, force, lengths)
