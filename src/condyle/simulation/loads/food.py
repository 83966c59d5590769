"""A bolus between the teeth, as chewing studies model it.

    force = -(stiffness squeeze + damping closing') u    while squeeze > 0 and the food is whole,
    squeeze = thickness - gap,   gap = -u . (p - p_home),   closing' = max(0, u . p'),

with u the direction in which the point bites. It only pushes, since the damper acts while the teeth
close. It breaks at a force or at a thickness left over, and then does nothing until the teeth have
parted by its thickness: the tongue has put a new one between them.

The law and the numbers of `bolus` are those of the ArtiSynth jaw models (FoodBolus of dynjaw),
where stiffness is the force at full compression over the diameter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from ...errors import did_you_mean
from ...mechanism.mechanism import Mechanism
from ...mechanism.quantities import per_metre
from ..table import Direction, Gain, NonNegativeLength, Positive, PositiveLength
from .base import BoundLoad, Jump, LoadTable
from .spring import unit

APART, TOUCHING, BROKEN = 0, 1, 2


@dataclass(frozen=True)
class Food:
    """A preset: SI numbers, and where they are from.

    thickness [m], stiffness [N/m], damping [N s/m], break_force [N], break_thickness [m].
    """

    thickness: float
    stiffness: float
    damping: float
    break_force: float | None
    break_thickness: float
    source: str


# A(ssumed) numbers are named as such; damping of foods was found nowhere and is that of `bolus`.
_STYLUS = "breaking force by a 45-degree stylus, J. Dental Research 69 (1990) 1546-1550"
FOODS = {
    "bolus": Food(
        10e-3, 3.5e3, 10.0, None, 1e-6,
        "ArtiSynth dynjaw FoodBolus: 35 N at full compression of 10 mm",
    ),
    "firm_bolus": Food(
        8e-3, 13.75e3, 10.0, None, 0.1e-3,
        "ArtiSynth TMJ model: 110 N at full compression of 8 mm",
    ),
    "peanut": Food(
        8e-3, 30e3, 10.0, 52.0, 0.1e-3,
        f"{_STYLUS}; stiffness from Young's modulus 3.75 MPa at 7 % moisture (Nader, Processes 11 "
        "(2023) 2532) of a cube of 8 mm (assumed)",
    ),
    "carrot": Food(
        10e-3, 33e3, 10.0, 66.0, 0.1e-3,
        f"{_STYLUS}; thickness and compression at break, 20 %, assumed",
    ),
    "chow": Food(
        10e-3, 52e3, 10.0, 104.0, 0.1e-3,
        f"{_STYLUS} (monkey chow); thickness and compression at break, 20 %, assumed",
    ),
}  # fmt: skip
_KEYS = ("thickness", "stiffness", "damping", "break_force", "break_thickness")
_LENGTHS = ("thickness", "break_thickness")


class FoodTable(LoadTable):
    """Food at a tooth: a preset by its name, or numbers, or a preset with some numbers changed."""

    kind: Literal["food"]
    food: str | None = Field(default=None, description=f"preset: {', '.join(FOODS)}")
    direction: Direction = Field(
        default=(0.0, 0.0, 1.0), description="in which the point bites, in {S}"
    )
    thickness: PositiveLength = Field(description="of the food, whole")
    stiffness: Positive = Field(description="N/m")
    damping: Gain = Field(default=10.0, description="while the teeth close, N s/m")
    break_force: Positive | None = Field(default=None, description="at which it breaks, N")
    break_thickness: NonNegativeLength = Field(
        default=1e-4, description="to which it is bitten before it breaks"
    )

    @model_validator(mode="before")
    @classmethod
    def _preset(cls, data: Any, info: Any) -> Any:
        name = data.get("food") if isinstance(data, Mapping) else None
        if name is None:
            return data
        if name not in FOODS:
            raise ValueError(f'there is no food "{name}".{did_you_mean(str(name), FOODS)}')
        known = {key: getattr(FOODS[name], key) for key in _KEYS}
        scale = per_metre(info)
        known |= {key: known[key] * scale for key in _LENGTHS}
        return {**known, **data}

    @model_validator(mode="after")
    def _thinner(self) -> Self:
        if self.break_thickness >= self.thickness:
            raise ValueError("break_thickness: expected less than thickness")
        return self

    def bind(self, mechanism: Mechanism, name: str) -> BoundLoad:
        place, point = self.place(mechanism)
        return BoundFood(
            name,
            point,
            place,
            unit(self.direction),
            self.thickness,
            self.stiffness,
            self.damping,
            float("inf") if self.break_force is None else self.break_force,
            self.break_thickness,
        )


@dataclass(frozen=True)
class BoundFood(BoundLoad):
    knobs: ClassVar[Mapping[str, str]] = {
        "thickness": "m", "stiffness": "N/m", "damping": "N s/m", "break_force": "N",
    }  # fmt: skip

    direction: tuple[float, ...] = (0.0, 0.0, 1.0)
    thickness: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0
    break_force: float = 0.0
    break_thickness: float = 0.0

    def begin(self, s: Sequence[float]) -> int:
        """Between closed teeth there is none: what was there is broken."""
        return BROKEN if self.squeeze(s) > 0 else APART

    def squeeze(self, s: Sequence[float]) -> float:
        """How far the teeth are into the whole food [m]; negative where they are clear of it."""
        u = self.direction
        return self.thickness + u[0] * s[0] + u[1] * s[1] + u[2] * s[2]

    def push(self, s: Sequence[float], v: Sequence[float]) -> float:
        """Force of the whole food on the tooth, against `direction` [N]."""
        u = self.direction
        closing = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
        return self.stiffness * self.squeeze(s) + self.damping * max(closing, 0.0)

    def law(self, t: float, s: Sequence[float], v: Sequence[float], mode: int) -> tuple[float, ...]:
        if mode != TOUCHING or self.squeeze(s) <= 0:
            return 0.0, 0.0, 0.0
        u, f = self.direction, -self.push(s, v)
        return f * u[0], f * u[1], f * u[2]

    def guards(
        self, t: float, s: Sequence[float], v: Sequence[float], mode: int
    ) -> Sequence[float]:
        squeeze = self.squeeze(s)
        if mode == APART:
            return (squeeze,)
        if mode == BROKEN:
            return (-squeeze,)
        gap = self.thickness - squeeze
        return -squeeze, self.push(s, v) - self.break_force, self.break_thickness - gap

    def jumps(self, mode: int) -> Sequence[Jump]:
        if mode == APART:
            return (Jump(TOUCHING, "food_touched", "the teeth touch the food"),)
        if mode == BROKEN:
            return (Jump(APART, "food_whole", "the teeth have parted: the food is whole again"),)
        return (
            Jump(APART, "food_left", "the teeth leave the food"),
            Jump(BROKEN, "food_broken", f"the food breaks at {self.break_force:g} N"),
            Jump(BROKEN, "food_broken", f"the food is bitten to {self.break_thickness * 1e3:g} mm"),
        )
