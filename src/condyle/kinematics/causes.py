"""Causes of failed samples: a chain, the contacts, the platform or the numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import (
    AmbiguousError,
    GimbalLockError,
    InfeasibleError,
    JammedError,
    NumberRangeError,
    OverlapError,
    SampleError,
    SingularError,
    UncertifiedError,
    UnreachableError,
)
from ..mechanism.mechanism import Mechanism
from ..mechanism.vocabulary import words_of
from ..status import Status
from .chain import FAMILIES
from .singularities import SINGULAR

FLAG = "or keep such samples with --flag (flag=True)."
WEAK = "Stronger actuators, a slower motion or a smaller load"
FAR_OFF = 20.0  # distance over a chain's length that suggests another unit
FAR = (
    "Are the lengths of the motion in mm? Name their columns so, as X [mm], or say --units mm "
    '(units="mm"). Else scale the motion down'
)
PULLED = (
    "Unilateral contacts would have to pull, or cables to push: reduce --preload, change the "
    "motion or load, or add cables that pull the other way"
)
# The error of a status, its message where no cause is named, and what to do.
StatusError = tuple[type[SampleError], str, str]
ERRORS: dict[Status, StatusError] = {
    Status.overflow: (
        NumberRangeError,
        "the efforts at {} are not finite: its rates, accelerations or load are too large",
        "",
    ),
    Status.singular: (SingularError, "", "The efforts are not determined there; avoid the pose"),
    Status.unreachable: (
        UnreachableError,
        "",
        "The motion goes too far for this mechanism; scale it down",
    ),
    Status.overlap: (
        OverlapError,
        "the ball of a contact overlaps its surface beside where it touches at {}",
        "Take a smaller ball or a wider surface, or avoid the pose",
    ),
    Status.indeterminate: (
        SingularError,
        "the contact forces at {} are not determined: active contacts depend on each other",
        "Remove a contact, or avoid the pose",
    ),
    Status.jammed: (
        JammedError,
        "the mechanism jams at {}: Coulomb friction has no consistent solution, whatever the "
        "efforts",
        "Rigid bodies have no solution there; reduce friction, or change the motion or the slopes "
        "of the contacts",
    ),
    Status.ambiguous: (
        AmbiguousError,
        "several motions follow from the efforts at {}, under Coulomb friction",
        "Rigid bodies have no single solution there; reduce friction, or change the efforts",
    ),
    Status.uncertified: (
        UncertifiedError,
        "the efforts found at {} could not be certified to 1e-9 of the largest",
        "Widen limits that leave hardly any margin",
    ),
    Status.gimbal_lock: (
        GimbalLockError,
        "the angles are in gimbal lock at {}: beta is +-90 degrees, where alpha and gamma turn "
        "about the same axis",
        "The mechanism is not singular there: choose axes of the platform that keep beta away from "
        "+-90 degrees",
    ),
    Status.infeasible: (
        InfeasibleError,
        "no efforts within the limits balance the mechanism at {}",
        "Raise the limits",
    ),
}


@dataclass(frozen=True)
class Owner:
    """The cause of a failure.

    kind: chain, contact, platform or sample; "" for none.  names: of the chain or the contacts.
    """

    kind: str
    names: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return " & ".join(self.names)

    def __str__(self) -> str:
        kind = f"{self.kind}s" if len(self.names) > 1 else self.kind
        return f"{kind} {self.name}" if self.names else kind


def owners(mechanism: Mechanism) -> tuple[Owner, ...]:
    """All possible causes in the order of `causes`: none, each chain, contacts, platform, sample.

    The contacts are closed together, so they are one cause.
    """
    chains = [Owner("chain", (name,)) for name in mechanism.chain_names]
    contacts = Owner("contact", mechanism.contact_names)
    return (Owner(""), *chains, contacts, Owner("platform"), Owner("sample"))


def causes(result: Any) -> np.ndarray:
    """Index into `owners` of the cause of each sample's failure, (N,) int16; 0 for none.

    Args: result: of a model: status, (N,), pose, (N, 6), NaN where the contacts cannot be met, and
          configuration.
    """
    n = result.configuration.discriminant.shape[1]  # negative or NaN where a chain cannot reach
    cause = np.zeros(len(result.status), dtype=np.int16)
    failed = np.flatnonzero(result.status != Status.ok)
    if not failed.size:
        return cause
    kind = result.status[failed]
    short = ~(result.configuration.discriminant[failed] >= 0)
    met = np.isfinite(result.pose[failed]).all(axis=1) & short.any(axis=1)
    transmission = np.abs(result.configuration.singularity.transmission[failed])
    smallest, largest = transmission.min(axis=1), transmission.max(axis=1)
    locked = smallest < SINGULAR * largest
    cause[failed] = np.select(
        [kind == Status.overlap, kind == Status.unreachable, kind == Status.singular],
        [
            1 + n,
            np.where(met, 1 + short.argmax(axis=1), 1 + n),
            np.where(locked, 1 + transmission.argmin(axis=1), 2 + n),
        ],
        3 + n,
    )
    return cause


def cause_text(status: int, owner: Owner) -> str:
    """A cause as text, such as 'chain "x" cannot reach its platform joint'."""
    named, several = ", ".join(f'"{name}"' for name in owner.names), len(owner.names) > 1
    texts: dict[tuple[int, str], str] = {
        (Status.unreachable, "chain"): f"chain {named} cannot reach its platform joint",
        (Status.unreachable, "contact"): "no pose with the given coordinates has the "
        + (f"contacts {named} on their surfaces" if several else f"contact {named} on its surface"),
        (Status.singular, "chain"): f"chain {named} is in line: its actuator has no lever arm",
        (Status.singular, "platform"): "the platform can move while all actuators are locked",
    }
    return texts.get((status, owner.kind), list(Status)[status].meaning)


def singular_text(where: str, ratio: float, owner: Owner) -> str:
    return (
        f"the mechanism is singular at {where}: dimensionless ratio {ratio:.2g}, must be above "
        f"{SINGULAR:g} ({cause_text(Status.singular, owner)})"
    )


def unreachable_text(mechanism: Mechanism, owner: Owner, pose: np.ndarray) -> str:
    """Why a pose, (6,), is out of reach, with distances where a chain is the cause."""
    if owner.kind != "chain":
        return cause_text(Status.unreachable, owner)
    chain = mechanism.chains[mechanism.chain_names.index(owner.name)]
    with np.errstate(all="ignore"):
        return FAMILIES[chain.kind].explain(chain, pose)


def require_ok(
    mechanism: Mechanism,
    result: Any,
    t: np.ndarray | None = None,
    row_offset: int = 0,
    errors: Mapping[Status, StatusError] = ERRORS,
    free_motion: Callable[[np.ndarray], str] | None = None,
) -> None:
    """Raise for samples that could not be computed, naming the first and its cause, in the words
    of the mechanism.

    Args: result: as of `causes`; of inverse dynamics with shortfall.
          t: their times, (N,) [s]; without, they are rows of a file that start at `row_offset`.
          errors: error, message and hint by status.
          free_motion: says what the platform does at a direct singularity, (6,).
    """
    bad = np.flatnonzero(result.status != Status.ok)
    if not bad.size:
        return
    i, singularity = int(bad[0]), result.configuration.singularity
    owner = owners(mechanism)[causes(result)[i]]
    where = f"row {row_offset + i + 1}" if t is None else f"t = {t[i]:g} s (sample {i})"
    more = f" {bad.size - 1} more samples fail too." if bad.size > 1 else ""
    named = {owner.kind: owner.name} if owner.names else {}
    about: dict[str, Any] = {
        "samples": bad.tolist(),
        "time": None if t is None else float(t[i]),
        "row": row_offset + i + 1 if t is None else None,
        **named,
    }
    kind, hint = list(Status)[result.status[i]], ""
    error, text, advice = errors[kind]
    if text:
        text = text.format(where)
        text += f" ({cause_text(kind, owner)})" if owner.kind == "chain" else ""
    elif kind == Status.singular:
        ratio = float(singularity.ratio[i])
        about |= {"value": ratio, "bound": SINGULAR, "unit": "1"}
        text = singular_text(where, ratio, owner)
        if owner.kind == "platform" and free_motion is not None:
            text += f": it {free_motion(result.pose[i])}"
    else:  # unreachable
        text = f"{unreachable_text(mechanism, owner, result.pose[i])} at {where}"
        if owner.kind == "chain":
            chain = mechanism.chains[mechanism.chain_names.index(owner.name)]
            with np.errstate(all="ignore"):
                if (span := FAMILIES[chain.kind].span(chain, result.pose[i])) is not None:
                    about |= {"value": span[0], "bound": span[1], "unit": "m"}
                    hint = FAR if span[0] > FAR_OFF * span[1] else ""
    if kind == Status.infeasible:
        least = float(result.shortfall[i])
        text, hint = f"{text}: {shortfall_text(least)}", WEAK if np.isfinite(least) else PULLED
        about |= {"value": least, "bound": 1.0, "unit": "1"}
    hint, say = hint or advice, words_of(mechanism)
    raise error(say(f"{text}.{more}"), hint=say(f"{hint}, {FLAG}") if hint else "", **about)


def unreachable_cause(mechanism: Mechanism, result: Any, sample: int) -> str:
    """Which chain or contact cannot be where the sample wants it."""
    owner = owners(mechanism)[causes(result)[sample]]
    return words_of(mechanism)(unreachable_text(mechanism, owner, result.pose[sample]))


def shortfall_text(shortfall: float) -> str:
    """As in 'all limits would have to be 1.3 times as large'."""
    if not np.isfinite(shortfall):
        return "no limits would suffice, however large"
    return f"all limits would have to be {shortfall:.4g} times as large"
