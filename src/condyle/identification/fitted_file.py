"""Fitted numbers of a mechanism, and its file with them, all else as a person wrote it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import join
from ..extras import require
from ..files.atomic import write_text
from ..mechanism.ball_joint import is_ball, separated
from ..mechanism.mechanism import Mechanism
from ..mechanism.paths import parsed, value_at
from ..mechanism.toml import read_text
from ..mechanism.writing import dumps
from ..results.study_answer import StudyAnswer, named_lines
from ..version import __version__

MILLIMETRE = 1e-3


@dataclass(frozen=True)
class Number:
    """A number after the fit. SI; deviation is NaN where the data do not tell it."""

    name: str
    unit: str
    value: float
    deviation: float
    before: float
    identified: bool
    why: str = ""

    def __str__(self) -> str:
        why = "" if self.identified else f"(not identified: {self.why})"
        said = f"+- {self.deviation:<8.2g} " if self.identified else ""
        return f"{self.value:12.6g} {said}{self.unit} {why}"

    @property
    def data(self) -> dict[str, Any]:
        """For programs."""
        entry: dict[str, Any] = {"value": self.value, "unit": self.unit, "before": self.before}
        entry |= {
            "deviation": self.deviation if self.identified else None,
            "identified": self.identified,
        }
        return entry | ({"why": self.why} if self.why else {})


def fitted_numbers(
    about: Sequence[tuple[str, str]],
    x: np.ndarray,
    covariance: np.ndarray,
    before: np.ndarray,
    identified: Sequence[bool],
    why: Mapping[int, str],
) -> tuple[Number, ...]:
    """Numbers by name and unit, from the unknowns of a fit, of which they are the first."""
    numbers = []
    for i, (name, unit) in enumerate(about):
        deviation = float(np.sqrt(covariance[i, i])) if identified[i] else float("nan")
        values = float(x[i]), deviation, float(before[i])
        numbers.append(Number(name, unit, *values, bool(identified[i]), why.get(i, "")))
    return tuple(numbers)


@dataclass(frozen=True, eq=False)
class FittedNumbers(StudyAnswer):
    """Numbers of a mechanism's file that measurements told.

    mechanism: with the numbers fitted;  numbers: one a number;  source: the mechanism or file
    before.
    """

    mechanism: Mechanism
    numbers: tuple[Number, ...]
    source: Mechanism | str | os.PathLike[str]

    @property
    def untold(self) -> str:
        """Names of the numbers that stay as they were."""
        return join([one.name for one in self.numbers if not one.identified])

    @property
    def number_lines(self) -> list[str]:
        return named_lines({one.name: str(one) for one in self.numbers})

    @property
    def data(self) -> dict[str, Any]:
        numbers = {one.name: one.data for one in self.numbers}
        warnings = list(self.warnings)
        return {"mechanism": self.mechanism.name, "numbers": numbers, "warnings": warnings}

    @property
    def tables(self) -> dict[str, dict[str, list[Any]]]:
        shown = ("name", "value", "deviation", "before", "unit", "why")
        return {"Numbers": {key: [getattr(one, key) for one in self.numbers] for key in shown}}

    @property
    def header(self) -> str:
        """For the top of the file."""
        raise NotImplementedError

    @property
    def units(self) -> dict[str, str]:
        """Units of the numbers in the file, by path."""
        return {one.name: one.unit for one in self.numbers}

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the mechanism's file with the fitted numbers, its comments kept.

        Raises: InputError: if it cannot be written.  MissingExtraError: without tomlkit.
        """
        write_fitted(self.source, self.mechanism, self.units, path, self.header)


def write_fitted(
    source: Mechanism | str | os.PathLike[str],
    mechanism: Mechanism,
    paths: Mapping[str, str],
    path: str | os.PathLike[str],
    header: str,
) -> None:
    """Write a fitted mechanism into its file's text, comments kept.

    Args: source: the file that it comes from, or a mechanism, which has no text;
          mechanism: with the fitted numbers;  paths: of these numbers, with their units;
          header: lines for the top.
    """
    require("tomlkit", "identify")
    import tomlkit

    text = dumps(source) if isinstance(source, Mechanism) else read_text(source)
    document = tomlkit.parse(text)
    if any(map(is_ball, document.get("contact", ()))):
        document["contact"] = tomlkit.item(separated(document["contact"].unwrap()))
    unit = MILLIMETRE if document.get("length_unit", "m") == "mm" else 1.0
    for whole in dict.fromkeys(one.partition("[")[0] for one in paths):
        own = next(u for p, u in paths.items() if p.partition("[")[0] == whole)
        _put(document, parsed(whole), value_at(mechanism, whole), unit if own == "m" else 1.0)
    for line in reversed([f"condyle {__version__}", *header.splitlines()]):
        document.body.insert(0, (None, tomlkit.comment(line)))
    written = tomlkit.dumps(document)
    write_text(Path(path), written)


def _put(document: Any, keys: tuple[Any, ...], value: Any, unit: float) -> None:
    """Set an entry, making the tables that it stands in."""
    import tomlkit

    here = document
    if keys[0] in ("chain", "contact"):
        name = keys[1]
        here = next(table for table in document[keys[0]] if table["name"] == name)
        keys = keys[2:]
    for key in keys[:-1]:
        if key not in here:
            here[key] = tomlkit.inline_table()
        here = here[key]
    numbers = [x / unit for x in value] if isinstance(value, tuple | list) else value / unit
    here[keys[-1]] = numbers
