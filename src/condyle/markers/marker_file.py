"""The marker file: which markers move with which body, when the mechanism is at home, and where.

It may name other channels too: [forces] for the load, [emg] for the muscles; a static trial
([static]) where the mechanism is at home and its points are given; and the vertical ([vertical]).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    field_validator,
    model_validator,
)

from ..errors import InputError, brief, join
from ..mechanism.study_file import File, Finite, Label, NotNegative, Positive, StudyFile
from ..mechanism.table import Table
from .rigid import FEWEST

DIRECTIONS = ("forward", "up")
ORIGIN = "origin"
CUTOFF = 5.0  # Hz: heads move slower than jaws
HIGH_PASS, LOW_PASS = 20.0, 6.0  # Hz: below are movements of cables; above, single firings

Place = str | tuple[float, float, float]
"""In the laboratory: the label of a marker, or three numbers in the file's unit."""

_Labels = Annotated[tuple[Label, ...], Field(min_length=FEWEST)]
_Interval = tuple[Finite, Finite]


def _as_interval(value: Any) -> Any:
    return (value, value) if _is_number(value) else value


def _in_order(value: tuple[float, float] | None) -> tuple[float, float] | None:
    if value is not None and value[1] < value[0]:
        raise ValueError(f"expected [from, to] or one time, got [{value[0]:g}, {value[1]:g}] s")
    return value


_Home = Annotated[_Interval, BeforeValidator(_as_interval), AfterValidator(_in_order)]


class Static(Table):
    """A static trial: another recording of the same markers, with the mechanism at home."""

    file: File = Field(description="the recording; relative paths start at the marker file")
    home: _Home = Field(description="when the mechanism is at home in it [s]")


class Vertical(Table):
    """Gravity and the base's motion, from the recording."""

    up: tuple[float, float, float] | None = Field(
        None, description="the vertical in the laboratory; default: the recording's"
    )
    moving: Annotated[bool, Field(strict=True)] = Field(
        True, description="the base's acceleration and rotation are in the motion too"
    )
    cutoff: Positive = Field(CUTOFF, description="that the base's motion is smoothed at [Hz]")

    @field_validator("up", mode="before")
    @classmethod
    def _direction(cls, value: Any) -> Any:
        three = isinstance(value, list | tuple) and len(value) == 3 and all(map(_is_number, value))
        if value is not None and not (three and any(value)):
            raise ValueError(f"expected three numbers, not all zero, got {brief(value)}")
        return value


class Forces(Table):
    """The load on the platform, from three channels or from a force plate."""

    channels: tuple[Label, Label, Label] | None = Field(None, description="along x, y, z")
    plate: int | None = Field(None, description="number of a force plate, from 1")
    point: Label | None = Field(None, description="point of the platform where it acts")
    axes: Literal["laboratory", "fixed", "platform"] = Field(
        "laboratory",
        description="frame that the sensor's axes follow; at home they are the laboratory's",
    )
    reverse: Annotated[bool, Field(strict=True)] = Field(
        False, description="the channels measure the force of the platform on the sensor"
    )
    zero: Annotated[_Interval, AfterValidator(_in_order)] | None = Field(
        None, description="when there is no load [s]"
    )

    @field_validator("channels", mode="before")
    @classmethod
    def _three_labels(cls, value: Any) -> Any:
        if value is None:
            return value
        labels = value if isinstance(value, list | tuple) else ()
        if len({*map(str, labels)}) != 3 or len(labels) != 3:
            raise ValueError(f"expected the labels of three channels, got {brief(value)}")
        return value

    @field_validator("plate", mode="before")
    @classmethod
    def _number(cls, value: Any) -> Any:
        number = isinstance(value, int) and not isinstance(value, bool) and value >= 1
        if value is not None and not number:
            raise ValueError(f"expected the number of a force plate, from 1, got {brief(value)}")
        return value

    @model_validator(mode="after")
    def _require_either(self) -> Self:
        if (self.channels is None) == (self.plate is None):
            raise ValueError("expected either channels (three of them) or plate (its number)")
        if self.plate is not None and self.axes != "laboratory":
            raise ValueError('a plate stands in the laboratory; axes is for "channels"')
        return self


class Emg(Table):
    """Muscles' channels, and how their envelopes are made."""

    channels: dict[Label, Label] = Field(min_length=1, description="chain -> channel")
    high_pass: NotNegative = Field(HIGH_PASS, description="before rectifying [Hz]; 0: none")
    low_pass: Positive = Field(LOW_PASS, description="after rectifying [Hz]")
    greatest: dict[Label, Positive] = Field(
        default_factory=dict, description="chain -> envelope that counts as 1, in its unit"
    )
    mvc: tuple[File, ...] | dict[str, tuple[File, ...]] = Field(
        default=(),
        description="recordings of maximal voluntary contractions, whose greatest envelope counts "
        "as 1 where greatest gives none; of a session by subject",
    )

    @field_validator("mvc", mode="before")
    @classmethod
    def _listed(cls, value: Any) -> Any:
        if isinstance(value, Mapping):
            return {subject: _files(paths) for subject, paths in value.items()}
        return _files(value)

    def mvc_of(self, subject: str) -> tuple[str, ...]:
        """Recordings of a subject's maximal contractions.

        Raises: InputError: where they are by subject, and this one has none.
        """
        if not isinstance(self.mvc, dict):
            return self.mvc
        if subject not in self.mvc:
            raise InputError(
                f"emg: mvc is by subject ({join(self.mvc)}), as of a session; expected a file or "
                "several"
            )
        return self.mvc[subject]

    @property
    def mvc_files(self) -> list[str]:
        """All of them."""
        several = self.mvc.values() if isinstance(self.mvc, dict) else [self.mvc]
        return [path for paths in several for path in paths]

    @model_validator(mode="after")
    def _of_channels(self) -> Self:
        if unknown := sorted(self.greatest.keys() - self.channels.keys()):
            raise ValueError(f"greatest: {', '.join(unknown)} has no channel in channels")
        return self


class MarkerFile(StudyFile):
    """What a marker file says.

    places: of points of the mechanism at home, in the laboratory; three or more, or
    forward, up: the laboratory's directions at home, (3,) each, and origin: the one place that is
    known, of O_M (numbers), or of the point of the mechanism of that name.
    """

    _noun: ClassVar[str] = "marker"

    fixed: _Labels = Field(description="markers that move with the base")
    platform: _Labels = Field(description="markers that move with the platform")
    home: _Home | None = Field(
        None,
        description="when the mechanism is at home [s]; with a static trial not needed",
    )
    places: dict[str, Any] = Field(alias="register")
    forces: Forces | None = Field(None, description="channels of the load")
    emg: Emg | None = Field(None, description="channels of the muscles")
    weights: dict[Label, Positive] = Field(
        default_factory=dict,
        description="platform marker -> weight in the pose on the contacts; the others' is 1",
    )
    static: Static | None = Field(None, description="a static trial")
    vertical: Vertical = Field(
        default_factory=lambda: Vertical.model_validate({}),
        description="gravity and the base's motion",
    )

    @property
    def directed(self) -> bool:
        """Whether directions stand in the place of points."""
        return bool(self.places.keys() & {*DIRECTIONS, ORIGIN})

    @model_validator(mode="before")
    @classmethod
    def _directions_outside(cls, data: Any) -> Any:
        """Directions may stand at the top, in place of [register]."""
        names = {*DIRECTIONS, ORIGIN}
        if not isinstance(data, Mapping) or "register" in data or not data.keys() & names:
            return data
        kept = {key: value for key, value in data.items() if key not in names}
        return kept | {"register": {key: data[key] for key in data.keys() & names}}

    @field_validator("fixed", "platform", mode="before")
    @classmethod
    def _labels(cls, value: Any) -> Any:
        if not isinstance(value, list | tuple):
            raise ValueError(f"expected a list of markers' labels, got {brief(value)}")
        return value

    @field_validator("fixed", "platform")
    @classmethod
    def _once(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        if twice := [name for name, count in Counter(value).items() if count > 1]:
            raise ValueError(f"{join(twice)} is listed more than once")
        return value

    @field_validator("places", mode="before")
    @classmethod
    def _registered(cls, value: Any) -> Any:
        return checked_places(value, DIRECTIONS, _problems)

    @model_validator(mode="after")
    def _apart(self) -> Self:
        if both := sorted({*self.fixed} & {*self.platform}):
            raise ValueError(
                f"{join(both)} is listed in fixed and in platform; a marker belongs to one body"
            )
        return self

    @model_validator(mode="after")
    def _of_platform(self) -> Self:
        if unknown := sorted(self.weights.keys() - {*self.platform}):
            raise ValueError(f"weights: {join(unknown)} is not listed in platform")
        return self

    @model_validator(mode="after")
    def _at_home(self) -> Self:
        if self.home is None and self.static is None:
            raise ValueError(
                "home: is missing; name a stretch in which the mechanism is at home [s], or a "
                "static trial (static)"
            )
        return self


def _files(value: Any) -> tuple[str, ...]:
    """One file or several."""
    paths = (value,) if isinstance(value, str) else value
    if not isinstance(paths, list | tuple) or not all(
        isinstance(p, str) and 0 < len(p) <= 1000 for p in paths
    ):
        raise ValueError(f"expected a file or several, or a table by subject, got {brief(value)}")
    return tuple(paths)


def checked_places(
    value: Any,
    directions: Collection[str],
    more: Callable[[Mapping[str, Any]], Iterator[str]] = lambda _: iter(()),
) -> Any:
    """Names with their places: labels of markers, or three numbers, which directions must be.

    Raises: ValueError: for other values, and what `more` finds wrong.
    """
    if not isinstance(value, Mapping):
        return value
    problems = []
    for name, place in value.items():
        words = "" if name in directions else "the label of a marker, or "
        if isinstance(place, str) and words and place:
            continue
        three = isinstance(place, list | tuple) and len(place) == 3
        if not (three and all(map(_is_number, place))):
            problems.append(f"{name}: expected {words}three numbers, got {brief(place)}")
        elif name in directions and not any(place):
            problems.append(f"{name}: a direction cannot be the zero vector")
    if problems := [*problems, *more(value)]:
        raise ValueError("; ".join(problems))
    return {k: v if isinstance(v, str) else tuple(map(float, v)) for k, v in value.items()}


def _problems(places: Mapping[str, Any]) -> Iterator[str]:
    """What is wrong with [register] as a whole."""
    directed = places.keys() & {*DIRECTIONS, ORIGIN}
    if not directed:
        if len(places) < FEWEST:
            got = f"got {len(places)} points of the mechanism, expected {FEWEST} or more"
            yield f"{got}; or forward, up and origin"
        return
    if missing := [name for name in (*DIRECTIONS, ORIGIN) if name not in places]:
        yield f"{join(missing)} missing: directions need forward, up and origin"
        return
    named = places[ORIGIN] if isinstance(places[ORIGIN], str) else ""
    if others := places.keys() - {*DIRECTIONS, ORIGIN, named}:
        yield (
            f"{join(sorted(others))} beside forward and up; give points alone (three or more), or "
            "directions with the one point that origin names"
        )


def _is_number(value: Any) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and abs(value) <= 1e12  # which no NaN is
