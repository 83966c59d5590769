"""What every study file is: tables of TOML, frozen and checked, with unknown keys refused.

A number of a study is one of the types here, and a file that it names stands beside it:

class SpringStudy(StudyFile):
    "A spring for the platform's weight."

    mechanism: MechanismFile = "masticatory"
    motion: MotionName = REFERENCE
    stiffness: Positive = Field(description="of the spring [N/m]")

`condyle.analysis.studies` has the kinds that there are.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from ..errors import InputError, ProblemsError, as_name, as_path, brief, join, nearest
from ..files.limits import TOML
from ..files.reading import text_of
from .library import bundled_mechanisms
from .messages import describe, of_file
from .quantities import listed
from .table import FrozenTable, Table
from .toml import nests_too_deep, read_tables, too_deep

REFERENCE, TRIAL, NONE = "reference", "trial", "none"  # in the place of a file


def numbers(value: Any) -> Any:
    """Numbers are SI; text with a unit is refused."""
    value = listed(value)
    for one in value if isinstance(value, list | tuple) else (value,):
        if isinstance(one, str):
            raise ValueError(f"expected numbers in SI (m, kg, rad, N), got {brief(one)}")
    return tuple(value) if isinstance(value, list) else value


def study_path(*words: str) -> AfterValidator:
    """A validator of a file's name: it starts from the study's folder, unless it is a word."""
    return AfterValidator(lambda value, info: _in_folder(value, info, words))


def _in_folder(value: str, info: ValidationInfo, words: Iterable[str] = ()) -> str:
    folder = (info.context or {}).get("folder")
    return value if folder is None or value in words else str(Path(folder, value))


def _mechanism(value: str, info: ValidationInfo) -> str:
    return _in_folder(value, info, bundled_mechanisms())


Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Finite, Field(gt=0)]
NotNegative = Annotated[Finite, Field(ge=0)]
Fraction = Annotated[float, Field(strict=True, ge=0, le=1)]
Share = Annotated[float, Field(strict=True, gt=0, le=1)]
BelowOne = Annotated[float, Field(strict=True, ge=0, lt=1)]
Count = Annotated[int, Field(strict=True, ge=1)]
Seed = Annotated[int, Field(strict=True, ge=0)]
Text = Annotated[str, Field(min_length=1, max_length=1000)]
Label = Annotated[str, Field(min_length=1, max_length=200)]
Numbers = BeforeValidator(numbers)
File = Annotated[Text, study_path()]
MechanismFile = Annotated[Text, AfterValidator(_mechanism)]
MotionName = Annotated[Text, study_path(REFERENCE, TRIAL)]
LoadName = Annotated[Text, study_path(REFERENCE, NONE)]
LengthUnit = Literal["m", "cm", "mm", "um"]


class StudyFile(Table):
    """The tables of a study."""

    refusal: ClassVar[type[ProblemsError]] = ProblemsError
    _noun: ClassVar[str] = "study"

    @classmethod
    def checked(cls, data: Mapping[str, Any], source: str) -> Self:
        """A study of `data`; `source` names it in messages.

        Raises: InputError: with every problem found.
        """
        return cls._of(data, as_name(source, "source"), None)

    @classmethod
    def read(cls, source: Any) -> Self:
        """A study from a TOML file or from its tables.

        Files that it names start from the file's folder.

        Raises: InputError: with every problem found.
        """
        if isinstance(source, cls):
            return source
        if isinstance(source, Mapping):
            return cls._of(source, cls._noun, None)
        path = Path(as_path(source, cls._noun, f"the path of a {cls._noun} file (TOML) or tables"))
        return cls._of(read_tables(text_of(path, TOML), str(path)), str(path), path.parent)

    @classmethod
    def _of(cls, data: Mapping[str, Any], source: str, folder: Path | None) -> Self:
        if not isinstance(data, Mapping):
            raise InputError(f"data: expected the tables of a {cls._noun}, got {brief(data)}")
        if nests_too_deep(data):
            raise too_deep(source)
        try:
            return cls.model_validate(dict(data), context={"folder": folder})
        except ValidationError as error:
            problems = of_file(describe(error, data, cls), data, cls, source)
            raise cls.refusal(source, problems) from None

    @model_validator(mode="after")
    def _frozen(self) -> Self:
        """Tables of free keys stay as they were validated."""
        for name, value in self:
            if type(value) is dict:
                object.__setattr__(self, name, FrozenTable(value))
        return self

    def title(self) -> str:
        return self._noun

    def data(self) -> dict[str, Any]:
        """The study as JSON, without defaults."""
        return json.loads(self.model_dump_json(exclude_defaults=True, by_alias=True))


def require_known(given: Iterable[str], known: Iterable[str], where: str) -> None:
    """Raises InputError for names that are not among the known ones."""
    known = list(known)
    if unknown := [name for name in given if name not in known]:
        near = nearest(unknown[0], known)
        guess = f'. Did you mean "{near[0]}"?' if near else ""
        raise InputError(f"{where}: {join(unknown)} not among {join(known)}{guess}")
