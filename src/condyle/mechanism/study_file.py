"""What every study file is: tables of TOML, frozen and checked, with unknown keys refused."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, ValidationError

from ..errors import InputError, ProblemsError, as_name, as_path, require_file, shown
from .messages import describe
from .quantities import listed
from .table import Table
from .toml import nests_too_deep, read_tables, read_text, too_deep

MOST_SHOWN = 3  # problems in one line

Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Count = Annotated[int, Field(strict=True, ge=1)]


def numbers(value: Any) -> Any:
    """Numbers are SI; text with a unit is refused."""
    value = listed(value)
    for one in value if isinstance(value, list | tuple) else (value,):
        if isinstance(one, str):
            raise ValueError(f'expected numbers in SI (m, kg, rad, N), got "{one[:40]}"')
    return tuple(value) if isinstance(value, list) else value


class StudyFile(Table):
    """The tables of a study."""

    refusal: ClassVar[type[ProblemsError]] = ProblemsError

    @classmethod
    def checked(cls, data: Mapping[str, Any], source: str) -> Self:
        """A study of `data`; `source` names it in messages.

        Raises: InputError: with the problem, in one line.
        """
        as_name(source, "source")
        if not isinstance(data, Mapping):
            raise InputError(f"data: expected the tables of a study, got {shown(data)}")
        if nests_too_deep(data):
            raise too_deep(source)
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            problems = [" ".join(p.split()) for p in describe(error, data, cls)]
        raise InputError(f"{source}: {some_of(problems, MOST_SHOWN)}")

    @classmethod
    def read(cls, source: Any) -> tuple[Self, Path | None]:
        """A study from a TOML file or from its tables, and the file's folder, if it is one.

        Raises: InputError: with the problem, in one line.
        """
        if isinstance(source, cls):
            return source, None
        if isinstance(source, Mapping):
            return cls.checked(source, "study"), None
        path = Path(as_path(source, "study", "a study, a file or tables"))
        require_file(path)
        return cls.checked(read_tables(read_text(path), str(path)), str(path)), path.parent

    def title(self) -> str:
        return "study"

    def data(self) -> dict[str, Any]:
        """The study as JSON, without defaults."""
        return json.loads(self.model_dump_json(exclude_defaults=True, by_alias=True))


def some_of(problems: list[str], most: int) -> str:
    """The first problems, in one line, and how many more there are."""
    more = len(problems) - most
    return "; ".join(problems[:most]) + (f"; and {more} more" if more > 0 else "")
