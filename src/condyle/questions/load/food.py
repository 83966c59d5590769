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

import casadi as ca
from pydantic import Field, model_validator

from ...errors import brief, did_you_mean
from ...mechanism.quantities import Direction, NonNegativeLength, PositiveLength, per_metre
from ..entries import Gain, Machine, Positive, unit
from .acting import Jump, LoadPlace, LoadTable

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

    ports: ClassVar[Mapping[str, int]] = {"direction": 3, **dict.fromkeys(_KEYS, 1)}
    divided: ClassVar[tuple[str, ...]] = ("stiffness", "damping", "break_force")
    bears: ClassVar[int | None] = TOUCHING
    parameters: ClassVar[Mapping[str, str]] = {
        "thickness": "m",
        "stiffness": "N/m",
        "damping": "N s/m",
        "break_force": "N",
    }

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
        if not isinstance(name, str):
            raise ValueError(f"expected a name such as {next(iter(FOODS))}, got {brief(name)}")
        if name not in FOODS:
            guess = did_you_mean(name, FOODS)
            raise ValueError(f"expected a preset, got {brief(name)}.{guess}")
        known = {key: getattr(FOODS[name], key) for key in _KEYS}
        scale = per_metre(info)
        known |= {key: known[key] * scale for key in _LENGTHS}
        return {**known, **data}

    @model_validator(mode="after")
    def _thinner(self) -> Self:
        if self.break_thickness >= self.thickness:
            raise ValueError("break_thickness: expected less than thickness")
        return self

    def given(self, machine: Machine) -> Mapping[str, Any]:
        force = float("inf") if self.break_force is None else self.break_force
        own = {"direction": unit(self.direction), "break_force": force}
        return {**super().given(machine), **own}

    @staticmethod
    def begin(at: LoadPlace) -> Any:
        """Between closed teeth there is no food left: it is broken."""
        return ca.if_else(squeeze(at) > 0, BROKEN, APART)

    @staticmethod
    def wrench(at: LoadPlace) -> ca.SX:
        pressed = ca.logic_and(at.mode == TOUCHING, squeeze(at) > 0)
        return -ca.if_else(pressed, push(at), 0) * at.numbers.direction

    @staticmethod
    def guards(at: LoadPlace) -> Sequence[tuple[int, ca.SX]]:
        n, into = at.numbers, squeeze(at)
        return (
            (APART, into),
            (BROKEN, -into),
            (TOUCHING, -into),
            (TOUCHING, push(at) - n.break_force),
            (TOUCHING, n.break_thickness - (n.thickness - into)),
        )

    @staticmethod
    def jumps(numbers: Any) -> Sequence[Jump]:
        force, thin = numbers.break_force, numbers.break_thickness * 1e3
        return (
            Jump(TOUCHING, "food_touched", "the teeth touch the food"),
            Jump(APART, "food_whole", "the teeth have parted: the food is whole again"),
            Jump(APART, "food_left", "the teeth leave the food"),
            Jump(BROKEN, "food_broken", f"the food breaks at {force:g} N"),
            Jump(BROKEN, "food_broken", f"the food is bitten to {thin:g} mm, at {{force}}"),
        )


def squeeze(at: LoadPlace) -> ca.SX:
    """How far the teeth are into the whole food [m]; negative where they are clear of it."""
    return at.numbers.thickness + ca.dot(at.numbers.direction, at.s)


def push(at: LoadPlace) -> ca.SX:
    """Force of the whole food on the tooth, against `direction` [N]."""
    closing = ca.dot(at.numbers.direction, at.v)
    return at.numbers.stiffness * squeeze(at) + at.numbers.damping * ca.fmax(closing, 0)
