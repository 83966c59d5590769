"""The fastest traversal as samples whose accelerations change smoothly and keep the share.

Places are means over `blend` of those of the traversal, so accelerations change within that time. A
mean that passes a change may need more than either side of it: there the traversal gets less room,
and is planned again, until the spline through the samples keeps the share.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..motion import Motion
from .fastest import Planner, Traversal, at_times
from .path_limits import used

BLEND = 0.005  # of the least time: what rest to rest then takes more
SAMPLES = 8  # over `blend`, for the spline through them to swing little
RATE = 1000.0  # Hz: least default
LOOKS = 1, 2  # states looked at for every sample; those between samples once the samples keep it
ROUNDS = 12
BELOW = 1e-3  # of what rest leaves of the limits, by which plans stay below
KEPT = 1e-6  # of the share, at most above
MIN_LEFT = 0.3  # of the room, left by one round


@dataclass(frozen=True)
class Blended:
    """A motion and what it needs at times `t`.

    u: along the path;  over: of the share, the largest of all limits;  used: of each limit;
    left: part of the room of the traversal that would do.
    """

    motion: Motion
    traversal: Traversal
    t: np.ndarray
    u: np.ndarray
    over: np.ndarray
    used: dict[str, np.ndarray]
    left: np.ndarray

    @property
    def largest(self) -> float:
        """The largest share."""
        return float(self.over.max())

    @property
    def keeps(self) -> bool:
        """Whether the share is kept at all times."""
        return self.largest <= 1 + KEPT


def blended(planner: Planner, path: Motion, blend: float | None, rate: float | None) -> Blended:
    """The fastest motion within the share, at even times; where none was found, the nearest.

    Args:   path: the planner's, for its columns.
            blend: [s]; default: 1/200 of the least time, or `SAMPLES` at a given rate.
            rate: [Hz]; default: 1000, or more, whole thousands, for `SAMPLES` over `blend`.
    """
    room, best = np.full(planner.nodes, 1 - BELOW), None
    for _ in range(ROUNDS):
        traversal = planner.traversal(room)
        blend = blend or max(BLEND * traversal.duration, SAMPLES / rate if rate else 0.0)
        rate = rate or RATE * max(math.ceil(SAMPLES / blend / RATE), 1)
        t, u = _means(traversal, blend, rate, planner.closed)
        motion = Motion.from_arrays(
            t,
            _places(traversal, u, planner.closed),
            path.names,
            landmark=path.landmark,
            source="path",
        )
        for looks in LOOKS:
            own = _looked_at(planner, traversal, motion, u, looks)
            if not own.keeps:
                break
        if best is None or own.largest < best.largest or own.keeps:
            best = own
        if own.keeps:
            break
        room = room * _shrunk(planner, own, blend / 4)
    assert best is not None
    return best


def _means(
    traversal: Traversal, blend: float, rate: float, closed: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Times (N,), and how far along the path the motion is then.

    Where the traversal rests it waits for `blend`, so that the mean rests as well.
    """
    waits = blend * np.cumsum(np.diff(traversal.u, prepend=-1.0) <= 0)
    waiting = replace(traversal, t=traversal.t + waits)
    half = max(round(0.5 * blend * rate), 1)
    steps = math.ceil(waiting.duration * rate)
    more = 1 if closed else 2  # a cycle goes on, a path rests at its ends
    k = np.arange(-more * half, steps + more * half + 1)
    if closed:
        u = waiting.at(k % steps / steps * waiting.duration) + k // steps * traversal.u[-1]
    else:
        u = waiting.at(np.clip(k / steps, 0.0, 1.0) * waiting.duration)
    window = np.hanning(2 * half + 3)[1:-1]
    u = np.convolve(u, window / window.sum(), mode="valid")
    return np.arange(len(u)) / rate, u


def _places(traversal: Traversal, u: np.ndarray, closed: bool) -> np.ndarray:
    """The motion's columns; means at the ends of a cycle may lie beyond them, in the next."""
    if not closed:
        return traversal.place(np.clip(u, 0.0, traversal.u[-1]))
    cycles, own = np.divmod(u, traversal.u[-1])
    first, last = traversal.place(traversal.u[[0, -1]])
    return traversal.place(own) + cycles[:, None] * (last - first)


def _looked_at(
    planner: Planner, traversal: Traversal, motion: Motion, u: np.ndarray, looks: int
) -> Blended:
    path, share = planner.path, planner.bounds.share
    t = np.linspace(0.0, motion.t[-1], looks * (len(u) - 1) + 1)
    here = np.interp(t, motion.t, u)
    wrench = np.column_stack([np.interp(here, path.u, x) for x in path.wrench.T])
    needed, shares = used(path.model, at_times(motion, t), planner.bounds, wrench, path.at)
    moving = [x for n, x in shares.items() if n.startswith(("speed", "acceleration"))]
    fast = np.max([*moving, np.zeros(len(t))], axis=0)
    still, aim = np.interp(here, path.u, planner.program.rest), (1 - BELOW) * share
    with np.errstate(divide="ignore", invalid="ignore"):
        of_needed = np.where(needed > share, (aim - still) / (needed - still), 1.0)
        of_fast = np.where(fast > share, aim / fast, 1.0)
    left = np.maximum(np.minimum(of_needed, of_fast), MIN_LEFT)
    return Blended(motion, traversal, t, here, np.maximum(needed, fast) / share, shares, left)


def _shrunk(planner: Planner, own: Blended, around: float) -> np.ndarray:
    """Part of the room that is left to each node, around times where the share is exceeded."""
    u, length, left = planner.path.u, planner.path.u[-1], np.ones(planner.nodes)
    step = u[-1] / (len(u) - 1)
    for k in np.flatnonzero(own.over > 1):
        low, high = np.interp([own.t[k] - around, own.t[k] + around], own.t, own.u)
        low, high = low - step, high + step
        near = (u >= low) & (u <= high)
        if planner.closed:
            near |= (u >= low + length) | (u <= high - length)
        left[near] = np.minimum(left[near], own.left[k])
    return left
