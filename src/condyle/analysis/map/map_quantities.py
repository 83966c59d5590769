"""What can be mapped: each quantity by name, with its variables.

A quantity of your own is an entry in `QUANTITIES`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ...errors import InputError, did_you_mean
from ...kinematics.singularities import KINDS, NEAR_SINGULAR
from ...mechanism.chain import limits
from ...mechanism.mechanism import COORDINATES, Mechanism
from ...model.model import Model
from ...results.variables import cause_flags, of_effort, of_joint, of_pose
from ...status import STATUS_NAMES
from .block import Block, Setup
from .load_capacity import limited
from .reach import bounded

Text = str | Callable[[Mechanism], str]
Values = Callable[[Block], np.ndarray]


@dataclass(frozen=True)
class Mapped:
    """A variable of a map.

    dims:   besides the axes: chain, contact, coordinate, mode, row, column.
    values: of a block, (N, *dims).
    """

    name: str
    dims: tuple[str, ...]
    units: Text
    meaning: str
    values: Values
    dtype: str = "f8"
    flags: Text = ""

    def attributes(self, mechanism: Mechanism) -> dict[str, str]:
        """Units, meaning and the words of flags."""
        units, flags = (t if isinstance(t, str) else t(mechanism) for t in (self.units, self.flags))
        about = {"units": units, "long_name": self.meaning}
        return about | ({"flag_meanings": flags} if flags else {})


@dataclass(frozen=True)
class Quantity:
    """What one word asks for.

    needs: of the survey.  lacks: what keeps a map from having it, or nothing.
    """

    meaning: str
    needs: tuple[str, ...]
    variables: tuple[Mapped, ...]
    lacks: Callable[[Setup], str] = lambda setup: ""


def _of_survey(name: str) -> Values:
    return lambda block: block.value(name).T


def _kind(b: Block) -> np.ndarray:
    s = b.survey
    return (s.inverse_ratio < NEAR_SINGULAR) + 2 * (s.direct_ratio < NEAR_SINGULAR)


def _condition(b: Block) -> np.ndarray:
    with np.errstate(divide="ignore"):
        return 1.0 / b.survey.direct_ratio


def _load(b: Block) -> np.ndarray:
    assert b.setup.direction is not None
    return b.setup.load_capacity.largest(b.pose, b.setup.load, b.setup.direction)


def scaled_rates(b: Block) -> np.ndarray:
    """Rates of the joints, (N, n, m), by those of q, angles multiplied by the length."""
    model = b.setup.model
    angles = [name not in COORDINATES[:3] for name in model.independent]
    scale = np.where(angles, 1.0 / model.characteristic_length, 1.0)
    return b.value("rates").transpose(2, 1, 0) * scale


def _speed(b: Block) -> np.ndarray:
    """A rate of size v makes joint i turn at |row_i| v in its worst direction."""
    with np.errstate(divide="ignore"):
        return (np.array(_speeds(b.setup.model)) / np.linalg.norm(scaled_rates(b), axis=2)).min(
            axis=1
        )


def _stiffness(b: Block, rates: np.ndarray) -> np.ndarray:
    """J^T k J, (N, m, m)."""
    assert b.setup.stiffness is not None
    return rates.transpose(0, 2, 1) @ (b.setup.stiffness[:, None] * rates)


def _stiffness_values(b: Block) -> np.ndarray:
    K = _stiffness(b, scaled_rates(b))
    found = np.full(K.shape[:2], np.nan)
    good = np.isfinite(K).all(axis=(1, 2))
    found[good] = np.linalg.eigvalsh(K[good])
    return found


def _unless(has: Callable[[Setup], object], needed: str) -> Callable[[Setup], str]:
    """What is needed, where a map has it not."""
    return lambda setup: "" if has(setup) else needed


def _no_limits(setup: Setup) -> str:
    if setup.direction is None:
        return "which way the load acts: --direction 0,0,-1"
    some = limited(setup.model.mechanism)
    return "" if some else "efforts with limits: torque_limit or force_limit in the mechanism file"


def _speeds(model: Model) -> list[float]:
    return [limits(chain).speed for chain in model.mechanism.chains]


# Which variables every map has.
ALWAYS = (
    Mapped("status", (), "1", "what became of the pose",
           lambda b: b.survey.status, "u1", " ".join(STATUS_NAMES)),
    Mapped("cause", (), "1", "chain, contact or platform that forbids the pose",
           lambda b: b.cause, "i2", cause_flags),
)  # fmt: skip

QUANTITIES: dict[str, Quantity] = {
    "reachable": Quantity("whether a pose can be reached, and what forbids it", (), ()),
    "pose": Quantity(
        "the whole pose", ("pose",),
        (Mapped("pose", ("coordinate",), of_pose("{}"), "pose of the platform X_EE",
                lambda b: b.pose),),
    ),
    "bounds": Quantity(
        "how far contacts are within their bounds", ("points",),
        (Mapped("bounds", ("contact",), "m", "distance of the contact point to its bounds, inside",
                lambda b: b.bounds),),
        _unless(lambda setup: bounded(setup.model.mechanism),
                "contacts with bounds in the mechanism file"),
    ),
    "joint": Quantity(
        "joint coordinates", ("joint",),
        (Mapped("joint", ("chain",), of_joint(), "joint coordinate, zero at home",
                _of_survey("joint")),),
    ),
    "ratio": Quantity(
        "how near to a singularity, and of which kind", ("ratio", "transmission"),
        (
            Mapped("ratio", (), "1", "smaller of both singularity ratios: 0 is singular",
                   lambda b: np.fmin(b.survey.inverse_ratio, b.survey.direct_ratio)),
            Mapped("kind", (), "1", f"kind of a singularity whose ratio is below {NEAR_SINGULAR:g}",
                   _kind, "u1", " ".join(KINDS)),
        ),
    ),
    "condition": Quantity(
        "condition number of the dimensionless J_W", ("ratio",),
        (Mapped("condition", (), "1", "condition number of the dimensionless J_W", _condition),),
    ),
    "transmission": Quantity(
        "transmission of each chain", ("transmission",),
        (Mapped("transmission", ("chain",), "1", "transmission of the chain: 1 is best, 0 none",
                _of_survey("transmission")),),
    ),
    "effort": Quantity(
        "efforts that hold the platform under gravity and the load", (),
        (Mapped("effort", ("chain",), of_effort(), "effort that holds the platform at rest",
                lambda b: b.held.effort),),
    ),
    "contact_force": Quantity(
        "contact forces under gravity and the load", (),
        (Mapped("contact_force", ("contact",), "N", "contact force at rest, along the unit normal",
                lambda b: b.held.contact_force),),
        _unless(lambda setup: setup.model.mechanism.contacts, "contacts"),
    ),
    "load_limit": Quantity(
        "largest further load in a direction that limits allow", ("pose",),
        (Mapped("load_limit", (), "N", "largest further load in the direction; -inf: none is held",
                _load),),
        _no_limits,
    ),
    "speed": Quantity(
        "speed that speed limits allow in the worst direction", ("rates",),
        (Mapped("speed", (), "m/s", "speed that limits allow in every direction, of q' with angles "
                "times the characteristic length", _speed),),
        _unless(lambda setup: np.isfinite(_speeds(setup.model)).any(),
                "actuators with a speed_limit in the mechanism file"),
    ),
    "stiffness": Quantity(
        "stiffness that given stiffnesses of the actuators make", ("rates",),
        (
            Mapped("stiffness", ("mode",), "N/m", "principal stiffnesses, rising; angles times the "
                   "characteristic length", _stiffness_values),
            Mapped("stiffness_matrix", ("row", "column"), "N/m, N/rad, N m/rad",
                   "stiffness in q_EE",
                   lambda b: _stiffness(b, b.value("rates").transpose(2, 1, 0))),
        ),
        _unless(lambda setup: setup.stiffness is not None,
                "how stiff actuators are: --stiffness 1000"),
    ),
}  # fmt: skip


def chosen(names: tuple[str, ...], setup: Setup) -> tuple[Quantity, ...]:
    """The quantities by name.

    Raises: InputError: for one there is not, or one that the mechanism has not.
    """
    for name in names:
        if name not in QUANTITIES:
            raise InputError(f'no quantity "{name}".{did_you_mean(name, QUANTITIES)}')
        if lack := QUANTITIES[name].lacks(setup):
            raise InputError(f"quantity {name} needs {lack}")
    return tuple(QUANTITIES[name] for name in dict.fromkeys(names))


def variables(quantities: tuple[Quantity, ...]) -> Iterator[Mapped]:
    """Of a map of these."""
    yield from ALWAYS
    for quantity in quantities:
        yield from quantity.variables
