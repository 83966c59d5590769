"""What can be mapped: each word with its quantities, and how these follow from a block of poses.

A quantity of your own is an entry in `QUANTITIES` and a row of `condyle.quantities`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError, did_you_mean
from ...kinematics.singularities import NEAR_SINGULAR
from ...mechanism.chain import limits
from ...mechanism.mechanism import COORDINATES, Mechanism
from ...model.model import Model
from ...quantities import QUANTITIES as ROWS
from .block import Block, Setup
from .load_capacity import limited
from .reach import bounded

Values = Callable[[Block], np.ndarray]


@dataclass(frozen=True)
class Mapped:
    """What one word asks for.

    needs:  of the survey.
    values: by the name of the quantity, of a block: (N, *entries).
    lacks:  what keeps a map from having it, or nothing.
    still:  whether it is of the platform at rest, which its description says too.
    """

    meaning: str
    needs: tuple[str, ...]
    values: Mapping[str, Values]
    lacks: Callable[[Setup], str] = lambda setup: ""
    still: bool = False


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


def _lift(b: Block) -> np.ndarray:
    """Efforts of least norm, and so contact forces, are affine in the load until one is lost."""
    load, direction = b.setup.load[:6], b.setup.direction
    assert direction is not None
    model = b.setup.model.with_distribution("minimum_norm")
    push = model.distributor.push
    one_further = load + np.concatenate([direction, np.zeros(3)])
    pressing, further = (push * b.holding(model, w).contact_force for w in (load, one_further))
    more = further - pressing
    with np.errstate(divide="ignore", invalid="ignore"):
        last = np.where((push != 0) & (more < 0), -pressing / more, np.inf).min(axis=1)
    last[(pressing < 0).any(axis=1)] = -np.inf
    return np.where(np.isfinite(more).all(axis=1), last, np.nan)


def scaled_rates(b: Block) -> np.ndarray:
    """Rates of the joints, (N, n, m), by those of q, angles multiplied by the length."""
    return b.value("rates").transpose(2, 1, 0) * _angle_scale(b.setup.model)


def _angle_scale(model: Model) -> np.ndarray:
    """Factors of rates, (m,), that make lengths of angles."""
    angles = [name not in COORDINATES[:3] for name in model.independent]
    return np.where(angles, 1.0 / model.characteristic_length, 1.0)


def _deflection(b: Block) -> np.ndarray:
    return (b.elastic.compliance @ b.setup.load[:6, None])[..., 0]


def _gives(setup: Setup) -> bool:
    return setup.model.system.structure.gives


def _speed(b: Block) -> np.ndarray:
    """A rate of size v makes joint i turn at |row_i| v in its worst direction."""
    with np.errstate(divide="ignore"):
        return (np.array(_speeds(b.setup.model)) / np.linalg.norm(scaled_rates(b), axis=2)).min(
            axis=1
        )


def _stiffness(b: Block) -> np.ndarray:
    """J^T k J of given stiffnesses, without a load; else of the file's, under it: (N, m, m)."""
    if b.setup.stiffness is None:
        return b.elastic.K
    rates = b.value("rates").transpose(2, 1, 0)
    return rates.transpose(0, 2, 1) @ (b.setup.stiffness[:, None] * rates)


def _stiffness_values(b: Block) -> np.ndarray:
    scale = _angle_scale(b.setup.model)
    K = _stiffness(b) * scale * scale[:, None]
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


def _keeps_contact(setup: Setup) -> str:
    if setup.direction is None:
        return "which way the load acts: --direction 0,0,-1"
    some = any(contact.one_sided for contact in setup.model.mechanism.contacts)
    return "" if some else "unilateral contacts: one_sided = true in the mechanism file"


def _speeds(model: Model) -> list[float]:
    return [limits(chain).speed for chain in model.mechanism.chains]


# What every map has.
ALWAYS = Mapped(
    "what became of the pose", (), {"status": lambda b: b.survey.status, "cause": lambda b: b.cause}
)

GIVING = "chains with a stiffness in the mechanism file"
# fmt: off
QUANTITIES: dict[str, Mapped] = {
    "reachable": Mapped("whether a pose can be reached, and what forbids it", (), {}),
    "pose": Mapped("the whole pose", ("pose",), {"pose": lambda b: b.pose}),
    "bounds": Mapped(
        "how far contacts are within their bounds", ("points",), {"bounds": lambda b: b.bounds},
        _unless(lambda setup: bounded(setup.model.mechanism),
                "contacts with bounds in the mechanism file"),
    ),
    "joint": Mapped("joint coordinates", ("joint",), {"joint": _of_survey("joint")}),
    "ratio": Mapped(
        "how near to a singularity, and of which kind", ("ratio", "transmission"),
        {"ratio": lambda b: np.fmin(b.survey.inverse_ratio, b.survey.direct_ratio),
         "kind": _kind},
    ),
    "condition": Mapped(
        "condition number of the dimensionless J_W", ("ratio",), {"condition": _condition}
    ),
    "transmission": Mapped(
        "transmission of each chain", ("transmission",),
        {"transmission": _of_survey("transmission")},
    ),
    "effort": Mapped(
        "efforts that hold the platform under gravity and the load", (),
        {"effort": lambda b: b.held.effort}, still=True,
    ),
    "contact_force": Mapped(
        "contact forces under gravity and the load", (),
        {"contact_force": lambda b: b.held.contact_force},
        _unless(lambda setup: setup.model.mechanism.contacts, "contacts"), still=True,
    ),
    "load_limit": Mapped(
        "largest further load in a direction that limits allow", ("pose",), {"load_limit": _load},
        _no_limits,
    ),
    "lift_load": Mapped(
        "largest further load in a direction before a unilateral contact is lost", (),
        {"lift_load": _lift}, _keeps_contact,
    ),
    "speed": Mapped(
        "speed that speed limits allow in the worst direction", ("rates",), {"speed": _speed},
        _unless(lambda setup: np.isfinite(_speeds(setup.model)).any(),
                "actuators with a speed_limit in the mechanism file"),
    ),
    "stiffness": Mapped(
        "stiffness, of given stiffnesses of the actuators or the file's", ("rates",),
        {"principal_stiffness": _stiffness_values,
         "stiffness_matrix": _stiffness},
        _unless(lambda setup: setup.stiffness is not None or _gives(setup),
                "how stiff actuators are: --stiffness 1000, or their stiffness in the mechanism "
                "file"),
    ),
    "deflection": Mapped(
        "displacement by the load where it acts", (), {"deflection": _deflection},
        _unless(_gives, GIVING), still=True,
    ),
    "frequency": Mapped(
        "natural frequencies under gravity and the load", (),
        {"frequency": lambda b: b.modes.frequency}, _unless(_gives, GIVING), still=True,
    ),
}
# fmt: on
BUILT_IN = frozenset(QUANTITIES)
_LOADED = (
    "effort", "contact_force", "load_limit", "lift_load", "stiffness", "deflection", "frequency",
)  # fmt: skip
# Argument of a map -> those of ours that depend on it.
DEPENDENT = {
    "load": _LOADED,
    "direction": ("load_limit", "lift_load"),
    "stiffness": ("stiffness",),
    "contacts": ("effort", "contact_force", "stiffness", "deflection", "frequency"),
}


def chosen(names: tuple[str, ...], setup: Setup) -> tuple[Mapped, ...]:
    """What is mapped, by name, after what every map has.

    Raises: InputError: for one there is not, or one that the mechanism has not.
    """
    for name in names:
        if name not in QUANTITIES:
            raise InputError(f'no quantity "{name}".{did_you_mean(name, QUANTITIES)}')
        if lack := QUANTITIES[name].lacks(setup):
            raise InputError(f"quantity {name} needs {lack}")
    return (ALWAYS, *(QUANTITIES[name] for name in dict.fromkeys(names)))


def require_used(names: Sequence[str], given: Mapping[str, Any]) -> None:
    """Raises InputError for an argument that none of these quantities depends on."""
    for argument, value in given.items():
        absent = value is None or (isinstance(value, str | Mapping) and not value)
        if not absent and {*names} <= BUILT_IN.difference(DEPENDENT[argument]):
            users = " or ".join(DEPENDENT[argument])
            raise InputError(
                f"{argument}: no quantity of the map depends on it: add {users}, or leave it out"
            )


def described(mapped: Sequence[Mapped], mechanism: Mechanism) -> dict[str, Any]:
    """Dimensions besides the axes, shape, type and attributes of each variable, by name."""
    variables = {}
    for quantity in mapped:
        for name in quantity.values:
            row = ROWS[name]
            about = row.attributes(mechanism)
            if quantity.still:
                about["long_name"] += ", at rest"
            kind = "i2" if name == "cause" else "u1" if row.flags else "f8"
            variables[row.variable] = row.entries, row.shape(mechanism), kind, about
    return variables
