"""Snapshot of a mechanism: its pose, its numbers, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..kinematics.singularities import KINDS, Singularity
from ..mechanism import Mechanism
from ..mechanism.chain import limits
from ..mechanism.vocabulary import words_of
from ..report.scene import (
    Force,
    Scene,
    SceneParts,
    activation_of,
    contact_forces,
    place,
)
from ..results.contacts import BOUND_TOLERANCE, contact_loss

Level = Literal["ok", "warning", "unreachable"]
MOST_NAMED = 4  # cables that one message names


@dataclass(frozen=True)
class Snapshot:
    """What the page draws and says.

    mechanism:      of which.
    pose:           X_EE that is drawn, (6,) [m, rad]; the last good one where none can be met.
    wanted:         X_EE that was asked for and cannot be met, (6,), or None.
    scene:          points at `pose`, of one sample.
    out_of_reach:         chains that cannot reach the platform.
    joint, rate, effort: (n,) [rad or m; per s; N m or N];  reach: (n,), negative out of reach, or
                    None.
    contact_force:  (k,) [N];  margin: (k,) [m], inf unbounded.
    load, load_at:  force in {S} [N] and its point in {M} [m], (3,) each.
    ratio, condition: of the singularity measures;  near: its kind, or "none".
    level, messages: what a reader should know, the worst first.
    time:           of a solution that is played [s], or None.
    stale:          there is no result, and `pose` is that of another time.
    over:           chains whose effort is outside its limits.
    activation:     of muscles, (n,), NaN where it is not known.
    pushes, pushes_at: forces besides, (l, 3) in {S} [N], and their points, (l, 3) in {M} [m];
                    the last is a hand's.
    markers:        of a solution with measured ones, (m, 3) [m] in {S}, NaN where not seen.
    """

    mechanism: Mechanism
    pose: np.ndarray
    scene: Scene
    joint: np.ndarray
    effort: np.ndarray
    contact_force: np.ndarray
    margin: np.ndarray
    load: np.ndarray
    load_at: np.ndarray
    ratio: float
    condition: float
    near: str
    level: Level
    messages: tuple[str, ...]
    wanted: np.ndarray | None = None
    out_of_reach: tuple[str, ...] = ()
    rate: np.ndarray | None = None
    reach: np.ndarray | None = None
    time: float | None = None
    stale: bool = False
    over: tuple[str, ...] = ()
    activation: np.ndarray | None = None
    pushes: np.ndarray | None = None
    pushes_at: np.ndarray | None = None
    markers: np.ndarray | None = None

    @classmethod
    def at(
        cls, mechanism: Mechanism, pose: np.ndarray, drawn: np.ndarray, **numbers: Any
    ) -> Snapshot:
        """The scene at X_EE, (6,), and joints `drawn`, (n,); `numbers`: the other fields."""
        scene = place(mechanism, pose[None], drawn[None])
        effort, rate = numbers["effort"], numbers.get("rate")
        rate = np.zeros(len(drawn)) if rate is None else rate
        return cls(
            mechanism=mechanism,
            pose=pose,
            scene=scene,
            over=over_limits(mechanism, effort),
            activation=activation_of(mechanism, effort[None], drawn[None], rate[None])[0],
            **numbers,
        )

    def forces(self, parts: SceneParts) -> Iterator[Force]:
        """What acts on the platform, for its arrows."""
        yield from contact_forces(self.mechanism, self.scene, parts, self.contact_force[None])
        yield Force("load", "", tuple(self.load_at), self.load[None])
        if self.pushes is not None and self.pushes_at is not None:
            *loads, hand = zip(self.pushes, self.pushes_at, strict=True)
            for kind, given in (("push", loads), ("hand", [hand])):
                for vector, at in given:
                    yield Force(kind, "", tuple(at), vector[None])


def measured(singularity: Singularity) -> dict[str, Any]:
    """How near to a singularity the first pose is, as a snapshot's fields."""
    ratio = float(singularity.ratio[0])
    near = KINDS[int(singularity.kind()[0])] if np.isfinite(ratio) else KINDS[0]
    return {"ratio": ratio, "condition": float(singularity.condition[0]), "near": near}


def state_messages(
    mechanism: Mechanism,
    margin: np.ndarray,
    force: np.ndarray,
    effort: np.ndarray,
    rate: np.ndarray | None,
) -> list[str]:
    """Contacts out of bounds or lost, and actuators above a limit."""
    messages = bound_messages(mechanism, margin)
    lost = contact_loss(mechanism, force[None])[0] if len(force) else []
    messages += [
        f"{name} loses contact: its surface would have to pull"
        for name, up in zip(mechanism.contact_names, lost, strict=True)
        if up
    ]
    slack, say = list[str](), words_of(mechanism)
    for i, chain in enumerate(mechanism.chains):
        low, high, speed = limits(chain)
        if chain.kind in ("cable", "muscle") and effort[i] < 0:
            slack.append(f"{chain.name} ({-effort[i]:.3g} N)")
        elif effort[i] > high or (low == -high and effort[i] < low):
            messages.append(f"{chain.name} is above its {say('effort')} limit of {high:g}")
        elif effort[i] < low:
            messages.append(f"{chain.name} is below its minimum {say('effort')} of {low:g}")
        if rate is not None and abs(rate[i]) > speed:
            messages.append(f"{chain.name} is above its speed limit of {speed:g}")
    if slack:
        more = f" and {len(slack) - MOST_NAMED} more" if len(slack) > MOST_NAMED else ""
        messages.append(f"Slack, negative tension needed: {', '.join(slack[:MOST_NAMED])}{more}")
    return messages


def over_limits(mechanism: Mechanism, effort: np.ndarray) -> tuple[str, ...]:
    """Chains whose effort, of (n,), is outside its limits."""
    with np.errstate(invalid="ignore"):
        return tuple(
            chain.name
            for chain, one in zip(mechanism.chains, effort, strict=True)
            if limits(chain).beyond(one)
        )


def bound_messages(mechanism: Mechanism, margin: np.ndarray) -> list[str]:
    """Contacts outside their bounds by margins (k,) [m], NaN where a pose has none."""
    return [
        f"{name} is {-m * 1e3:.3g} mm outside its bounds"
        for name, m in zip(mechanism.contact_names, margin, strict=True)
        if m < -BOUND_TOLERANCE
    ]
