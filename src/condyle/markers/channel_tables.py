"""What a marker file says of other channels: [forces] for the load, [emg] for the muscles."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from ..mechanism.messages import shown
from ..mechanism.table import Table

_Label = Annotated[str, Field(min_length=1, max_length=200)]
_Hertz = Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)]
_Time = Annotated[float, Field(strict=True, allow_inf_nan=False)]
_Above = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]

HIGH_PASS, LOW_PASS = 20.0, 6.0  # Hz: below are movements of cables; above, single firings


class Forces(Table):
    """The load on the platform, from three channels or from a force plate."""

    channels: tuple[_Label, _Label, _Label] | None = Field(None, description="along x, y, z")
    plate: int | None = Field(None, description="number of a force plate, from 1")
    point: _Label | None = Field(None, description="point of the platform where it acts")
    axes: Literal["laboratory", "fixed", "platform"] = Field(
        "laboratory", description="what the sensor's axes, the laboratory's at home, turn with"
    )
    reverse: Annotated[bool, Field(strict=True)] = Field(
        False, description="the channels hold what the platform does to the sensor"
    )
    zero: tuple[_Time, _Time] | None = Field(None, description="when there is no load [s]")

    @field_validator("channels", mode="before")
    @classmethod
    def _three_labels(cls, value: Any) -> Any:
        labels = value if isinstance(value, list | tuple) else ()
        if len({*map(str, labels)}) != 3 or len(labels) != 3:
            raise ValueError(f"expected the labels of three channels, got {shown(value)}")
        return value

    @field_validator("plate", mode="before")
    @classmethod
    def _number(cls, value: Any) -> Any:
        if not isinstance(value, int) or isinstance(value, bool) or value < 1:
            raise ValueError(f"expected the number of a force plate, from 1, got {shown(value)}")
        return value

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if (self.channels is None) == (self.plate is None):
            raise ValueError("expected either channels (three of them) or plate (its number)")
        if self.plate is not None and self.axes != "laboratory":
            raise ValueError('a plate stands in the laboratory; axes is for "channels"')
        return self

    @field_validator("zero")
    @classmethod
    def _in_order(cls, value: tuple[float, float] | None) -> tuple[float, float] | None:
        if value is not None and value[1] < value[0]:
            raise ValueError(f"expected [from, to], got [{value[0]:g}, {value[1]:g}] s")
        return value


class Emg(Table):
    """Muscles' channels, and how their envelopes are made."""

    channels: dict[_Label, _Label] = Field(min_length=1, description="chain -> channel")
    high_pass: _Hertz = Field(HIGH_PASS, description="before rectifying [Hz]; 0: none")
    low_pass: _Above = Field(LOW_PASS, description="after rectifying [Hz]")
    greatest: dict[_Label, _Above] = Field(
        default_factory=dict, description="chain -> envelope that counts as 1, in its unit"
    )

    @model_validator(mode="after")
    def _of_channels(self) -> Self:
        if unknown := sorted(self.greatest.keys() - self.channels.keys()):
            raise ValueError(f"greatest: {', '.join(unknown)} has no channel in channels")
        return self
