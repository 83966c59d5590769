"""Status of a sample: the codes, their meaning and the cause that each can name."""

from __future__ import annotations

from enum import IntEnum
from typing import Self

import numpy as np


class Status(IntEnum):
    """Status of a sample, as kernels, results and files state it.

    Attributes: meaning: in a few words;  owner: the kind of its cause.
    """

    meaning: str
    owner: str

    def __new__(cls, value: int, meaning: str, owner: str) -> Self:
        member = int.__new__(cls, value)
        member._value_ = value
        member.meaning, member.owner = meaning, owner
        return member

    ok = 0, "computed", "nothing"
    unreachable = (
        1,
        "a chain is too short or too long, or no pose has the contacts on their surfaces",
        "chain or contact",
    )
    singular = (
        2,
        "smallest over largest dimensionless singular value below 1e-12",
        "chain or platform",
    )
    overflow = 3, "rates, accelerations or load are too large for numbers", "sample"
    infeasible = 4, "efforts within the limits cannot balance the sample", "sample"
    jammed = 5, "Coulomb friction has no solution: the mechanism jams", "sample"
    uncertified = 6, "efforts were found that could not be certified", "sample"
    gimbal_lock = (
        7,
        "beta at +-90 degrees: rates of the angles do not describe all motions",
        "sample",
    )
    ambiguous = 8, "under Coulomb friction several motions follow from these efforts", "sample"
    kink = (
        9,
        "derivatives are of one active set: a limit or a contact's sign is about to change",
        "sample",
    )
    refused = 10, "a variant whose numbers are those of no mechanism", "sample"
    overlap = 11, "the ball of a contact overlaps its surface beside where it touches", "contact"
    unstable = (
        12,
        "the loaded mechanism gives way: its stiffness is not positive definite",
        "sample",
    )
    indeterminate = 13, "active contacts depend on each other: forces are not determined", "contact"


# Statuses of samples whose motion is known, though no efforts were found for it.
POSED = (Status.ok, Status.infeasible, Status.jammed, Status.uncertified)
STATUS_NAMES = tuple(status.name for status in Status)


def judge(reached: np.ndarray, regular: np.ndarray, finite: np.ndarray) -> np.ndarray:
    """Status of N samples, (N,) int8.

    Args: reached: where every chain and contact can be, (N,).
          regular: where the mechanism is not singular, (N,).
          finite:  where every effort is a finite number, (N,).
    """
    status = np.where(finite, Status.ok, Status.overflow).astype(np.int8)
    status[~regular] = Status.singular
    status[~reached] = Status.unreachable
    return status
