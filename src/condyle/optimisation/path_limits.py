"""Limits along a path: what balances at given states, within which share of the limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import CondyleError
from ..mechanism.actuator import Limits
from ..mechanism.chain import limits
from ..mechanism.mechanism import Mechanism
from ..model.model import Model
from ..motion import Motion

_PLACED = ("pose", "pose_rate", "pose_acceleration")
STATES = 250  # a linear program
_TAKEN = ("Q", "J", "normal", "joint_rate")


@dataclass(frozen=True)
class TraversalLimits:
    """What limits a traversal: by coordinate of the motion, by contact [N], and a common share.

    A share narrows what is between the limits (`Limits.part`): neither the least effort of a cable
    nor `preload` is lowered.
    """

    speed: dict[str, float]
    acceleration: dict[str, float]
    contact: dict[str, float]
    share: float = 1.0
    preload: float = 0.0


@dataclass(frozen=True)
class Held:
    """Efforts and limited contact forces that balance.

    J^T effort + N lambda = Q. Contact forces without limits drop out of the balance.

    labels: of the n efforts, then of the contacts in `loaded`, w in all;
    full: their limits, (w, 2);  low, high: at the share, (w,);  share: of the bounds.
    """

    model: Model
    labels: tuple[str, ...]
    loaded: tuple[int, ...]
    full: np.ndarray
    low: np.ndarray
    high: np.ndarray
    share: float

    @classmethod
    def of(cls, model: Model, bounds: TraversalLimits) -> Held:
        machine = model.mechanism
        ranges = [(f"effort of {c.name}", limits(c)) for c in machine.chains]
        loaded = []
        for i, contact in enumerate(machine.contacts):
            most = bounds.contact.get(contact.name, np.inf)
            least = bounds.preload if contact.one_sided else -most
            if np.isfinite(least):
                loaded.append(i)
                low, high = (-most, -least) if contact.push < 0 else (least, most)
                ranges.append((f"load of {contact.name}", Limits(low, high, np.inf)))
        full = np.array([own[:2] for _, own in ranges])
        low, high = np.array([own.part(bounds.share)[:2] for _, own in ranges]).T
        labels = tuple(label for label, _ in ranges)
        return cls(model, labels, tuple(loaded), full, low, high, bounds.share)

    @property
    def width(self) -> np.ndarray:
        """How much each limit yields to a share of 1 more, (w, 2): its size."""
        size = np.abs(self.full)
        other = np.where(np.isfinite(size[:, ::-1]), size[:, ::-1], 0.0)
        size = np.where(size > 0, size, other)
        return np.where(size > 0, size, 1.0)

    def at(self, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Limits at shares (N,), (N, w) each. A least effort above zero rises as a share falls."""
        with np.errstate(invalid="ignore"):
            wide = (share - self.share)[:, None, None] * self.width
        wide[:, ~np.isfinite(self.full)] = 0.0
        return self.low - wide[..., 0], self.high + wide[..., 1]

    def balance(
        self, forces: dict[str, np.ndarray], others: Sequence[np.ndarray] = ()
    ) -> tuple[np.ndarray, ...]:
        """Rows of the balance: of the variables, (N, r, w), and of each Q of `others`, (N, r)."""
        normal = forces["normal"].transpose(0, 2, 1)
        held = np.concatenate([forces["J"], normal[:, :, self.loaded]], axis=2)
        free = [i for i in range(normal.shape[2]) if i not in self.loaded]
        if free:
            away = np.linalg.svd(normal[:, :, free])[0][:, :, len(free) :].transpose(0, 2, 1)
            held = away @ held
            others = [(away @ x[..., None])[..., 0] for x in others]
        size = np.abs(np.concatenate([held, *(x[..., None] for x in others)], axis=2)).max(axis=2)
        size[size == 0] = 1.0
        return held / size[..., None], *(x / size for x in others)

    def needed(self, forces: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """The least share of the limits that holds each state, (N,), and what then does, (N, w).

        Shares up to that of the bounds are within them.
        """
        held, Q = self.balance(forces, [forces["Q"]])
        parts = [slice(i, i + STATES) for i in range(0, len(Q), STATES)]
        share, efforts = zip(*(self._needed(held[i], Q[i]) for i in parts), strict=True)
        return np.concatenate(share), np.concatenate(efforts)

    def _needed(self, held: np.ndarray, Q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """One linear program, whose blocks are the states."""
        from scipy import sparse
        from scipy.optimize import linprog

        count, w = len(Q), len(self.labels)
        which, side = np.nonzero(np.isfinite(self.full))
        if not len(which):
            return np.zeros(count), np.full((count, w), np.nan)
        sign = np.where(side == 1, 1.0, -1.0)
        own = sparse.csr_array((sign, (np.arange(len(which)), which)), shape=(len(which), w))
        wide = self.width[which, side]
        every = sparse.eye_array(count)
        ends = np.where(side == 1, self.high[which], -self.low[which]) - self.share * wide
        rows = sparse.hstack([sparse.kron(every, own), sparse.kron(every, -wide[:, None])])
        none = sparse.csr_array((Q.size, count))
        result = linprog(  # type: ignore[call-overload]
            np.concatenate([np.zeros(count * w), np.ones(count)]),
            rows, np.tile(ends, count), sparse.hstack([sparse.block_diag(list(held)), none]),
            Q.ravel(), [(None, None)] * (count * w) + [(0, None)] * count, method="highs",
        )  # fmt: skip
        if result.x is None:
            raise CondyleError(f"the linear program of the efforts needed: {result.message}")
        return result.x[count * w :], result.x[: count * w].reshape(count, w)


def forces(
    model: Model, state: tuple[np.ndarray, ...], wrench: np.ndarray, at: Any
) -> dict[str, np.ndarray]:
    """Q, J, normal and joint_rate of the question `system` at q, v, a, samples first."""
    placed = model.inverse_kinematics(*state)
    point = np.zeros(3) if at is None else np.asarray(at, dtype=float)
    ports = {name: getattr(placed, name) for name in _PLACED}
    ports |= {"force": wrench[:, :3], "moment": wrench[:, 3:]}
    ports |= {"point": np.broadcast_to(point, (len(wrench), 3))}
    ports = {name: np.ascontiguousarray(x) for name, x in ports.items()}
    found = model.kernel("system").run(ports)
    return {name: np.moveaxis(found.values[name], -1, 0) for name in _TAKEN}


def used(
    model: Model, motion: Motion, bounds: TraversalLimits, wrench: np.ndarray, at: Any
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The least share of efforts and loads that holds each sample of a motion, (N,), and the
    share of each limit that is used with the efforts that need least, (N,) each."""
    held = Held.of(model, bounds)
    state, _ = model.poses.of_motion(motion)
    acting = forces(model, state, wrench, at)
    share, efforts = held.needed(acting)
    shares = bound_shares(motion, bounds.speed, bounds.acceleration)
    for label, (low, high), values in zip(held.labels, held.full, efforts.T, strict=True):
        if np.isfinite([low, high]).any():
            shares[label] = Limits(low, high, np.inf).used(values)
    return share, shares | speed_shares(model.mechanism, acting["joint_rate"])


def bound_shares(
    motion: Motion, speed: dict[str, float], acceleration: dict[str, float]
) -> dict[str, np.ndarray]:
    """Shares of bounds by coordinate of a motion, (N,) each."""
    return {
        f"{key} of {name}": np.abs(values[:, motion.names.index(name)]) / most
        for key, bounds, values in (
            ("speed", speed, motion.rate),
            ("acceleration", acceleration, motion.acceleration),
        )
        for name, most in bounds.items()
    }


def speed_shares(machine: Mechanism, rate: np.ndarray) -> dict[str, np.ndarray]:
    """Shares of the actuators' speeds, of joint rates (N, n)."""
    return {
        f"speed of {chain.name}": np.abs(own) / most
        for chain, own in zip(machine.chains, rate.T, strict=True)
        if np.isfinite(most := limits(chain).speed)
    }
