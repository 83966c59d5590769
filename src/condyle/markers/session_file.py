"""The session file: a marker file for any number of trials, and what is to be made of them.

It is a marker file with `[[trial]]`s: every key of a marker file stays valid, and [markers] may
hold those of the two bodies.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    AfterValidator,
    ConfigDict,
    Field,
    field_validator,
    model_validator,
)

from ..errors import brief, did_you_mean, join
from ..files.atomic import file_stem
from ..mechanism.quantities import Name
from ..mechanism.scaling import ERROR
from ..mechanism.study_file import (
    File,
    Finite,
    LengthUnit,
    MechanismFile,
    NotNegative,
    Positive,
    Seed,
    Text,
)
from ..mechanism.table import Table
from ..motion.smoothing import EDGE, parse_cutoff
from .eminence import Eminence
from .jts_file import ENDINGS as JTS
from .jts_file import PRECISION, TURN_PRECISION
from .marker_file import MarkerFile, checked_places

ROLES = ("fixed", "platform", "weights")
# Of a jaw's cycles -> their unit: columns of the tables.
JAW_MEASURES = {
    **dict.fromkeys(("gape", "protrusion", "lateral_left", "lateral_right"), "m"),
    **dict.fromkeys(("deviation", "deflection", "translation_left", "translation_right"), "m"),
    **dict.fromkeys(("opening_speed", "closing_speed"), "m/s"),
    "rotation": "rad",
    **dict.fromkeys(("sagittal_inclination_left", "sagittal_inclination_right"), "rad"),
    **dict.fromkeys(("transverse_inclination_left", "transverse_inclination_right"), "rad"),
}
TAKEN = (
    *("trial", "subject", "task", "cycle", "start", "duration", "samples_without_result"),
    *("opening", "closing", "occlusal", "rest", "statistic", "measure"),
    *JAW_MEASURES,
)
MEASURES = ("peak_", "impulse_", "range_", "emg_")  # beginnings of the tables' other columns
STATIC = "static"  # a task without cycles
FILES = ("mean", "cycles", "report")  # of results, beside those of the trials
PROMINENCE = 0.25

_Share = Annotated[float, Field(strict=True, gt=0, lt=1)]


class Scale(Table):
    """The mechanism is scaled to the subject."""

    landmarks: Annotated[tuple[Text, ...], Field(min_length=1)] = Field(
        description="points or contacts whose places [register] gives, four or more"
    )
    kind: Literal["affine", "thin_plate"] = "affine"
    error: Annotated[float, Field(strict=True, gt=0, le=0.05)] = Field(
        default=ERROR, description="standard deviation of a landmark's coordinate [m]"
    )
    regularise: Annotated[bool, Field(strict=True)] = Field(
        default=True,
        description="draw the map towards a similarity, as far as the landmarks' error asks for it",
    )


class SkullPlane(Table):
    """The plane of the skull that a jaw's measures are taken against."""

    name: Literal["frankfort", "axis-orbital", "occlusal"] = Field(
        description="what it is called in tables"
    )
    points: Annotated[tuple[Text, ...], Field(min_length=3)] = Field(
        description="three or more at home: of the mechanism, or of places"
    )
    places: dict[Text, Any] = Field(
        default_factory=dict,
        description="points that the mechanism does not have, as in [register]",
    )

    @field_validator("places", mode="before")
    @classmethod
    def _check_places(cls, value: Any) -> Any:
        return checked_places(value, ())


class Filter(Table):
    """What is done to the markers before anything is computed."""

    markers: float | str = Field(
        default="auto",
        description='low-pass cut-off frequency [Hz]; "auto" is 10 Hz, "none" keeps noise',
    )
    max_gap: NotNegative = Field(default=0.1, description="longest gap that a spline fills [s]")
    max_residual: NotNegative = Field(
        default=2e-3,
        description="residual of a marker in its body beyond which a frame is a gap [m]",
    )
    longest: Annotated[bool, Field(strict=True)] = Field(
        default=False,
        description="of intervals between gaps too long to fill keep the longest; default: all",
    )
    trim: NotNegative | Literal["auto"] = Field(
        default="auto",
        description='taken off both ends of a recording, and of its intervals [s]; "auto" is half '
        "a period of the slowest filter, 0 keeps the ends",
    )

    @field_validator("markers", mode="before")
    @classmethod
    def _frequency(cls, value: Any) -> Any:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (number and 0 < value < math.inf) and value not in ("auto", "none"):
            raise ValueError(
                f'expected a frequency above 0 [Hz], "auto" or "none", got {brief(value)}'
            )
        return value

    @property
    def cutoff(self) -> float | str | None:
        """As `Motion.from_arrays` takes it."""
        return None if self.markers == "none" else self.markers


class Cycles(Table):
    """How cycles are found in a trial."""

    by: Text = Field(
        description='a coordinate ("beta"), "gape", "lateral" or "protrusion" of the incisor, a '
        'landmark\'s component ("incisor.z"), EMG of a chain ("emg_masseter_left"), or a channel '
        "of the recording"
    )
    turn: Literal["minimum", "maximum"] = Field(
        default="minimum", alias="from", description="where cycles begin"
    )
    shortest: Positive = Field(default=0.4, description="shortest duration of a cycle [s]")
    longest: Positive | None = Field(
        default=None, description="longest duration [s]: what lasts longer, as a pause, is no cycle"
    )
    least: Positive | None = Field(
        default=None,
        description="smallest amplitude of a cycle [mm or degrees; of a channel, its unit]; "
        "default: by prominence",
    )
    prominence: _Share = Field(
        default=PROMINENCE,
        description="smallest amplitude as a part of the signal's range, where least is not given",
    )
    rest: Positive = Field(
        default=0.5, description="a stop that lasts longer is rest, part of no cycle [s]"
    )
    within: tuple[Finite, Finite] | None = Field(
        default=None, description="cycles outside this interval of the trial do not count [s]"
    )

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.longest is not None and self.longest <= self.shortest:
            raise ValueError(
                f"longest: expected more than shortest, {self.shortest:g} s, got {self.longest:g} s"
            )
        if self.within is not None and self.within[1] <= self.within[0]:
            raise ValueError(f"within: expected [from, to] in order, got {brief(self.within)}")
        return self


def _as_label(word: str) -> str:
    measure = word.removesuffix("_low").removesuffix("_high")
    if word in TAKEN or measure in JAW_MEASURES or word.startswith(MEASURES):
        raise ValueError(f"{word} is a column of the tables; choose another word")
    return word


_Label = Annotated[Name, AfterValidator(_as_label)]


class Trial(Table):
    """A recording of one task."""

    file: File = Field(description="the recording; relative paths start at the session file")
    name: Name = Field(default="", description="of its results; default: the name of the file")
    channels: File | None = Field(
        default=None,
        description="file of force and EMG channels (.mot, .sto, .csv) on the recording's clock",
    )
    subject: str = Field(default="", description="who it is of; means are by subject")
    task: str = Field(
        default="", description='such as "chew"; means are by task; "static" has no cycles'
    )
    cycles: Cycles | None = Field(default=None, description="of this trial; default: the session's")
    labels: dict[_Label, str | int | float | bool] = Field(
        default_factory=dict, description="words of your own: columns of the tables"
    )

    @model_validator(mode="before")
    @classmethod
    def _labels_apart(cls, data: Any) -> Any:
        """Words of one's own stood beside the keys once."""
        plain = data.items() if isinstance(data, Mapping) else ()
        own = {k: v for k, v in plain if k not in cls.model_fields and not isinstance(v, Mapping)}
        if own:
            line = ", ".join(f"{word} = {_toml(value)}" for word, value in own.items())
            keys = did_you_mean(next(iter(own)), cls.model_fields)
            raise ValueError(
                f"{join(own)}: no key of a trial.{keys} Words of your own are labels: write "
                f"labels = {{ {line} }}"
            )
        return data

    @model_validator(mode="after")
    def _named(self) -> Self:
        if not self.name:
            object.__setattr__(self, "name", Path(self.file).stem)
        return self

    @property
    def words(self) -> dict[str, Any]:
        """Subject and task where they are named, and the labels."""
        named = {"subject": self.subject, "task": self.task}
        return {key: word for key, word in named.items() if word} | self.labels


def _toml(value: Any) -> str:
    """A value as a TOML file has it."""
    return str(value).lower() if isinstance(value, bool) else json.dumps(value, default=str)


class Solve(Table):
    """How efforts and joint loads are computed."""

    distribution: Text | None = Field(
        default=None, description="objective; default: the mechanism's"
    )
    preload: NotNegative = Field(
        default=0.0, description="minimum force on unilateral contacts [N]"
    )
    contact_weight: NotNegative = Field(default=0.0, description="W, as of condyle run")
    emg_weight: Positive = Field(default=1.0, description="of emg_assisted, as of condyle run")
    load_point: Text | None = Field(
        default=None, description="where the load acts; default: [forces]'s"
    )
    vary: File | None = Field(
        default=None, description="study (TOML) of bands, as of condyle run --vary"
    )


class SessionBands(Table):
    """Variants of the session itself, each with all those of [solve]'s `vary`."""

    registrations: Annotated[int, Field(strict=True, ge=0)] = Field(
        default=0, description="times that all places of [register] are moved at random"
    )
    error: Positive | None = Field(
        default=None,
        description="standard deviation of each coordinate of those places [m]; default: "
        "[scale]'s; where all trials are of the Jaw Tracking System 0.18e-3, and all are turned "
        "together by 0.13 degrees besides",
    )
    seed: Seed = Field(default=0, description="of the random numbers")
    distributions: tuple[Text, ...] = Field(
        default=(), description="objectives, one after the other; default: [solve]'s"
    )

    @model_validator(mode="after")
    def _has_variants(self) -> Self:
        if not self.registrations and not self.distributions:
            raise ValueError("expected registrations (a number of them) or distributions")
        if twice := [n for n, count in Counter(self.distributions).items() if count > 1]:
            raise ValueError(f"distributions: {join(twice)} is given twice")
        return self


def _with_roles_inside(schema: dict[str, Any]) -> None:
    """The markers of the two bodies may stand in [markers] too."""
    properties = schema["properties"]
    properties["markers"] = {
        "type": "object",
        "properties": {name: properties[name] for name in ROLES},
        "additionalProperties": False,
        "description": "markers of the two bodies; they may stand at the top too",
    }
    schema["required"] = [name for name in schema["required"] if name not in ROLES]


class SessionFile(MarkerFile):
    """What a session file says."""

    model_config = ConfigDict(json_schema_extra=_with_roles_inside)
    _noun: ClassVar[str] = "session"

    mechanism: MechanismFile = Field(description="a file, or the name of a bundled mechanism")
    unit: LengthUnit | None = Field(
        default=None, description="of lengths in recordings, in place of what they say"
    )
    scale: Scale | None = Field(default=None, description="to this subject; default: as it is")
    plane: SkullPlane | None = Field(
        default=None, description="of reference for a jaw; default: X and Y of {S}"
    )
    eminence: Eminence | None = Field(
        default=None, description="this subject's surfaces; default: the mechanism's"
    )
    filter: Filter = Field(default_factory=lambda: Filter(), description="of the markers")
    cycles: Cycles | None = Field(default=None, description="default: each trial is one cycle")
    trials: tuple[Trial, ...] = Field(alias="trial", min_length=1)
    group_by: tuple[Text, ...] = Field(
        default=(), description="labels that means and reports tell apart, as subject and task"
    )
    solve: Solve = Field(default_factory=lambda: Solve(), description="redundancy, and bands")
    bands: SessionBands | None = Field(
        default=None, description="bands over registrations and objectives; default: none"
    )

    @model_validator(mode="before")
    @classmethod
    def _roles_inside(cls, data: Any) -> Any:
        """[markers] may hold the markers of the two bodies."""
        if not isinstance(data, Mapping) or "markers" not in data:
            return data
        roles = data["markers"]
        if not isinstance(roles, Mapping):
            raise ValueError(f"markers: expected a table of {join(ROLES)}, got {brief(roles)}")
        if unknown := [key for key in roles if key not in ROLES]:
            raise ValueError(f"markers: {join(unknown)} is not a key of it; it has {join(ROLES)}")
        if twice := sorted(roles.keys() & data.keys()):
            raise ValueError(f"{join(twice)} is given twice: at the top and in [markers]")
        return {key: value for key, value in data.items() if key != "markers"} | {**roles}

    @field_validator("trials", mode="before")
    @classmethod
    def _tables(cls, value: Any) -> Any:
        if not isinstance(value, list | tuple):
            raise ValueError(f"expected tables, each under [[trial]], got {brief(value)}")
        return value

    @field_validator("trials")
    @classmethod
    def _trials_apart(cls, value: tuple[Trial, ...]) -> tuple[Trial, ...]:
        stems = [file_stem(trial.name) for trial in value]
        counted = Counter(stem.casefold() for stem in stems)
        if twice := [
            t.name for t, s in zip(value, stems, strict=True) if counted[s.casefold()] > 1
        ]:
            raise ValueError(f"{join(twice)} would be one file of results; name them (name = ...)")
        if taken := [stem for stem in stems if stem.casefold() in FILES]:
            raise ValueError(f"{join(taken)} is a file of the session's own; name it (name = ...)")
        return value

    @model_validator(mode="after")
    def _landmarks_registered(self) -> Self:
        if self.scale is None:
            return self
        if missing := [name for name in self.scale.landmarks if name not in self.places]:
            raise ValueError(f"scale: landmarks: [register] gives no place for {join(missing)}")
        return self

    @model_validator(mode="after")
    def _places_to_move(self) -> Self:
        if self.bands is not None and self.bands.registrations and self.directed:
            raise ValueError(
                "bands: registrations: [register] gives directions; expected places of points"
            )
        return self

    @model_validator(mode="after")
    def _subjects_of_mvc(self) -> Self:
        if self.emg is None or not isinstance(self.emg.mvc, Mapping):
            return self
        by_subject = self.emg.mvc
        subjects = dict.fromkeys(trial.subject for trial in self.trials)
        if unknown := [name for name in by_subject if name not in subjects]:
            raise ValueError(
                f"emg: mvc: {join(unknown)} is no subject of the trials; they have "
                f"{join(name for name in subjects if name) or 'none'}"
            )
        if missing := [name for name in subjects if name not in by_subject]:
            without = join(name or "a trial without subject" for name in missing)
            raise ValueError(f"emg: mvc: {without} has none; give a recording of each subject")
        return self

    @model_validator(mode="after")
    def _labels_given(self) -> Self:
        given = [word for trial in self.trials for word in trial.labels]
        if missing := [word for word in self.group_by if word not in given]:
            known = f"they have {join(dict.fromkeys(given))}" if given else "they have none"
            raise ValueError(f"group_by: {join(missing)} is no label of the trials; {known}")
        return self

    @property
    def trim(self) -> float:
        """Taken off either end of what was filtered [s]."""
        if self.filter.trim != "auto":
            return self.filter.trim
        cutoff = self.filter.cutoff
        filters = [] if cutoff is None else [parse_cutoff(cutoff)]
        filters += [self.vertical.cutoff] if self.vertical.moving else []
        filters += [] if self.emg is None else [self.emg.low_pass]
        return EDGE / min(filters, default=math.inf)

    @property
    def error(self) -> float:
        """Standard deviation of a registered point's coordinates [m]."""
        if self.bands is not None and self.bands.error is not None:
            return self.bands.error
        if self._of_jaw_tracking:
            return PRECISION
        return ERROR if self.scale is None else self.scale.error

    @property
    def turn_error(self) -> float:
        """Standard deviation of the turn of all registered points together, about each axis of the
        laboratory [rad]."""
        given = self.bands is not None and self.bands.error is not None
        return TURN_PRECISION if self._of_jaw_tracking and not given else 0.0

    @property
    def _of_jaw_tracking(self) -> bool:
        return all(Path(trial.file).suffix.lower() in JTS for trial in self.trials)

    def cycles_of(self, trial: Trial) -> Cycles | None:
        """How a trial's cycles are found; None: it is one."""
        return trial.cycles or self.cycles

    @property
    def words(self) -> list[str]:
        """Words of all trials, in their order."""
        return list(dict.fromkeys(word for trial in self.trials for word in trial.words))
