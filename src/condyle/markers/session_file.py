"""The session file: a marker file for any number of trials, and what is to be made of them.

It is a marker file with `[[trial]]`s: every key of a marker file stays valid, and [markers] may
hold those of the two bodies.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    field_validator,
    model_validator,
)

from ..atomic import file_stem
from ..errors import ProblemsError, few, shown
from ..mechanism.library import bundled_mechanisms
from ..mechanism.quantities import Name
from ..mechanism.table import Table
from ..mechanism.table_schema import schema_of
from .marker_file import MarkerFile, checked_file, tables_of

ROLES = ("fixed", "platform", "weights")
TAKEN = ("trial", "cycle", "start", "duration", "samples_without_result", "statistic")
MEASURES = ("peak_", "impulse_", "range_")  # beginnings of the tables' other columns
FILES = ("mean", "cycles", "report")  # of results, beside those of the trials
PROMINENCE = 0.25

_NAME: TypeAdapter[str] = TypeAdapter(Name)
_Text = Annotated[str, Field(min_length=1, max_length=1000)]
_NotBelow = Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)]
_Above = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]
_Share = Annotated[float, Field(strict=True, gt=0, lt=1)]


class Scale(Table):
    """The mechanism is scaled to the subject."""

    landmarks: Annotated[tuple[_Text, ...], Field(min_length=1)] = Field(
        description="points or contacts whose places [register] gives, four or more"
    )
    kind: Literal["affine", "thin_plate"] = "affine"


class Filter(Table):
    """What is done to the markers before anything is computed."""

    markers: float | str = Field(
        default="auto",
        description='low-pass cut-off frequency [Hz]; "auto" is 10 Hz, "none" keeps noise',
    )
    max_gap: _NotBelow = Field(default=0.1, description="longest gap that a spline fills [s]")
    max_residual: _NotBelow = Field(
        default=2e-3,
        description="residual of a marker in its body beyond which a frame is a gap [m]",
    )
    longest: Annotated[bool, Field(strict=True)] = Field(
        default=False,
        description="if a gap is too long to fill, keep the longest gap-free interval",
    )

    @field_validator("markers", mode="before")
    @classmethod
    def _frequency(cls, value: Any) -> Any:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (number and 0 < value < math.inf) and value not in ("auto", "none"):
            raise ValueError(
                f'expected a frequency above 0 [Hz], "auto" or "none", got {shown(value)}'
            )
        return value

    @property
    def cutoff(self) -> float | str | None:
        """As `Motion.from_arrays` takes it."""
        return None if self.markers == "none" else self.markers


class Cycles(Table):
    """How cycles are found in a trial."""

    by: _Text = Field(
        description='a coordinate ("beta"), a landmark\'s component ("incisor.z"), EMG of a chain '
        '("emg_masseter_left"), or a channel of the recording'
    )
    turn: Literal["minimum", "maximum"] = Field(
        default="minimum", alias="from", description="where cycles begin"
    )
    shortest: _Above = Field(default=0.4, description="shortest duration of a cycle [s]")
    longest: _Above | None = Field(
        default=None, description="longest duration [s]: what lasts longer, as a pause, is no cycle"
    )
    prominence: _Share = Field(
        default=PROMINENCE,
        description="least depth of a turning point, as a part of the signal's range",
    )

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.longest is not None and self.longest <= self.shortest:
            raise ValueError(
                f"longest: expected more than shortest, {self.shortest:g} s, got {self.longest:g} s"
            )
        return self


class Trial(Table):
    """A recording; words of one's own become columns of the tables."""

    model_config: ClassVar[ConfigDict] = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, str | int | float | bool]

    file: _Text = Field(description="the recording; relative paths start at the session file")
    name: Name = Field(default="", description="of its results; default: the name of the file")
    channels: _Text | None = Field(
        default=None,
        description="file of force and EMG channels (.mot, .sto, .csv) on the recording's clock",
    )
    subject: str = Field(default="", description="who it is of; means are by subject too")

    @model_validator(mode="before")
    @classmethod
    def _plain_words(cls, data: Any) -> Any:
        own = {*cls.model_fields}
        for word, value in data.items() if isinstance(data, Mapping) else ():
            if word in own:
                continue
            try:
                _NAME.validate_python(word)
            except ValidationError:
                raise ValueError(f"{shown(word)} cannot be the name of a column") from None
            if word in TAKEN or word.startswith(MEASURES):
                raise ValueError(f"{word} is a column of the tables; choose another word")
            if not isinstance(value, str | int | float):
                raise ValueError(f"{word}: expected text or a number, got {shown(value)}")
        return data

    @model_validator(mode="after")
    def _named(self) -> Self:
        if not self.name:
            object.__setattr__(self, "name", Path(self.file).stem)
        return self

    def entries(self) -> dict[str, Any]:
        return super().entries() | (self.__pydantic_extra__ or {})

    @property
    def words(self) -> dict[str, Any]:
        """Words of one's own, the subject among them where it is named."""
        subject = {"subject": self.subject} if self.subject else {}
        return subject | (self.__pydantic_extra__ or {})


class Solve(Table):
    """How efforts and joint loads are computed."""

    distribution: _Text | None = Field(
        default=None, description="objective; default: the mechanism's"
    )
    preload: _NotBelow = Field(default=0.0, description="minimum force on unilateral contacts [N]")
    contact_weight: _NotBelow = Field(default=0.0, description="W, as of condyle run")
    emg_weight: _Above = Field(default=1.0, description="of emg_assisted, as of condyle run")
    load_point: _Text | None = Field(
        default=None, description="where the load acts; default: [forces]'s"
    )
    vary: _Text | None = Field(
        default=None, description="study (TOML) of bands, as of condyle run --vary"
    )


class SessionFile(MarkerFile):
    """What a session file says."""

    refusal: ClassVar[type[ProblemsError]] = ProblemsError

    mechanism: _Text = Field(description="a file, or the name of a bundled mechanism")
    unit: Literal["m", "cm", "mm", "um"] | None = Field(
        default=None, description="of lengths in recordings, in place of what they say"
    )
    scale: Scale | None = Field(default=None, description="to this subject; default: as it is")
    filter: Filter = Field(default_factory=lambda: Filter(), description="of the markers")
    cycles: Cycles | None = Field(default=None, description="default: each trial is one cycle")
    trials: tuple[Trial, ...] = Field(alias="trial", min_length=1)
    solve: Solve = Field(default_factory=lambda: Solve(), description="redundancy, and bands")

    @model_validator(mode="before")
    @classmethod
    def _roles_inside(cls, data: Any) -> Any:
        """[markers] may hold the markers of the two bodies."""
        if not isinstance(data, Mapping) or "markers" not in data:
            return data
        roles = data["markers"]
        if not isinstance(roles, Mapping):
            raise ValueError(f"markers: expected a table of {few(ROLES)}, got {shown(roles)}")
        if unknown := [key for key in roles if key not in ROLES]:
            raise ValueError(f"markers: {few(unknown)} is not a key of it; it has {few(ROLES)}")
        if twice := sorted(roles.keys() & data.keys()):
            raise ValueError(f"{few(twice)} is given twice: at the top and in [markers]")
        return {key: value for key, value in data.items() if key != "markers"} | {**roles}

    @field_validator("trials", mode="before")
    @classmethod
    def _tables(cls, value: Any) -> Any:
        if not isinstance(value, list | tuple):
            raise ValueError(f"expected tables, each under [[trial]], got {shown(value)}")
        return value

    @field_validator("trials")
    @classmethod
    def _trials_apart(cls, value: tuple[Trial, ...]) -> tuple[Trial, ...]:
        stems = [file_stem(trial.name) for trial in value]
        counted = Counter(stem.casefold() for stem in stems)
        if twice := [
            t.name for t, s in zip(value, stems, strict=True) if counted[s.casefold()] > 1
        ]:
            raise ValueError(f"{few(twice)} would be one file of results; name them (name = ...)")
        if taken := [stem for stem in stems if stem.casefold() in FILES]:
            raise ValueError(f"{few(taken)} is a file of the session's own; name it (name = ...)")
        return value

    @model_validator(mode="after")
    def _landmarks_registered(self) -> Self:
        if self.scale is None:
            return self
        if missing := [name for name in self.scale.landmarks if name not in self.places]:
            raise ValueError(f"scale: landmarks: [register] gives no place for {few(missing)}")
        return self

    @property
    def words(self) -> list[str]:
        """Words of all trials, in their order."""
        return list(dict.fromkeys(word for trial in self.trials for word in trial.words))


def read_session(source: str | os.PathLike[str] | Mapping[str, Any] | SessionFile) -> SessionFile:
    """A session from a file (TOML), or from its tables.

    Relative paths in a file start at its folder.

    Raises: InputError: with every problem found, one line each.
    """
    if isinstance(source, SessionFile):
        return source
    data, name = tables_of(source, "session", "session file")
    file, folder = checked_file(SessionFile, data, name), os.path.dirname(name)

    def beside(path: str) -> str:
        return os.path.join(folder, path)

    def placed(trial: Trial) -> Trial:
        files = {"file": trial.file, "channels": trial.channels}
        return trial.model_copy(update={k: p and beside(p) for k, p in files.items()})

    named: dict[str, Any] = {"trials": tuple(map(placed, file.trials))}
    if file.mechanism not in bundled_mechanisms():
        named["mechanism"] = beside(file.mechanism)
    if file.solve.vary is not None:
        named["solve"] = file.solve.model_copy(update={"vary": beside(file.solve.vary)})
    return file.model_copy(update=named)


def json_schema() -> dict[str, Any]:
    """The JSON schema of session files, for editors."""
    schema = schema_of(SessionFile)
    roles = {name: schema["properties"][name] for name in ROLES}
    table = {"type": "object", "properties": roles, "additionalProperties": False}
    described = table | {"description": "markers of the two bodies; they may stand at the top too"}
    return {
        **schema,
        "title": "condyle session",
        "properties": schema["properties"] | {"markers": described},
        "required": [name for name in schema["required"] if name not in ROLES],
    }
