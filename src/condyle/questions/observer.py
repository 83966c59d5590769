"""From encoders to the state: counts, the pose that they give, rates.

    count = resolution round(reading / resolution) - zero,    reading = theta + zero
    pose:  that of the counts, from the last one on, carried on by its rate (`pose_from_encoders`)
    q':    A q' ~ theta',   theta' = smoothing theta'_before + (1 - smoothing) (count - before) / T

Poses follow one another within a period, so that the assembly mode is that of the last one
(`condyle.model.forward_kinematics` looks for it from afar). What lasts from one period to the next
goes in and comes out: `BEFORE` says which result is which port of the next period.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from ..graph.program import Programs
from .builder import Builder, Lanes
from .platform import ANGLE_UNITS
from .pose import joints_read, pose_from_encoders
from .structure import Structure

ITERATIONS = 3  # from one period to the next
DIFFERENCE, EXACT = "difference", "exact"  # rates of counts, or tachometers'
ERROR = "encoder_error"  # of readings, a port of the tick: only simulations have it
KALMAN = "kalman"  # state and load by `condyle.questions.kalman`
BEFORE = {  # port -> result
    "pose_before": "pose",
    "pose_rate_before": "pose_rate",
    "joint_before": "joint",
    "joint_rate_before": "joint_rate",
}


@dataclass(frozen=True)
class Measured:
    """What a controller measures at a tick: expressions in a law, arrays where it is in Python.

    q, q1:  estimated state, (m,) each.
    joint, joint_rate: a chain's, as its encoder has it, zero at home.
    force:  of the loads on the platform at the controller's point, (3,) [N] in {S};  t: [s].
    """

    q: Any
    q1: Any
    joint: Any
    joint_rate: Any
    force: Any = None
    t: float = 0.0


def observer(structure: Structure, velocity: str = DIFFERENCE) -> Programs:
    """The state that encoders give.

    Ports: joint: readings, theta + zero; joint_rate: as they are; tachometers' rates are `EXACT`.
    Results: q, q1 (m,); joint, joint_rate: counts less zeros, and rates as filtered; pose,
    pose_rate (6,).
    """
    b = Builder(structure)
    reading, rate = b.lane_sample("joint", unit="rad or m"), b.lane_sample("joint_rate")
    found = observe(b, reading, rate, velocity, b.sample("period", 1, "s"))
    b.output("q", found.q, "m, rad", structure.m)
    b.output("q1", found.q1, "per s", structure.m)
    return Programs(b.finish(), single=True)


def observe(b: Builder, reading: Lanes, rate: Lanes, velocity: str, period: ca.SX) -> Measured:
    """The same as a part of another question: its other ports, results of `BEFORE`, and check."""
    counts = counted(b, reading)
    smoothing = b.sample("smoothing", 1)
    pose, pose_rate = b.sample("pose_before", 6, ANGLE_UNITS), b.sample("pose_rate_before", 6)
    before, rate_before = b.lane_sample("joint_before"), b.lane_sample("joint_rate_before")
    groups = range(len(reading))
    if velocity == DIFFERENCE:
        part = (1 - smoothing) / period
        rate = [smoothing * rate_before[i] + part * (counts[i] - before[i]) for i in groups]
    iterated = pose_from_encoders(b, counts, pose + period * pose_rate, ITERATIONS)
    q1 = iterated.last.rates(rate)
    b.output("pose", iterated.pose, ANGLE_UNITS, 6)
    b.output("pose_rate", iterated.last.M_J @ q1, "per s", 6)
    b.output("joint", counts, "rad or m")
    b.output("joint_rate", rate, "rad/s or m/s")
    b.check(2 * iterated.sure - 1, 0.5)
    return Measured(iterated.q, q1, counts, rate)


def counted(b: Builder, reading: Lanes) -> Lanes:
    """Counts less zeros, of a port resolution: joint coordinates as they are read."""
    resolution = b.lane_sample("resolution", unit="rad or m")
    counts = [
        one - ca.if_else(step > 0, ca.remainder(one, step), 0)
        for one, step in zip(reading, resolution, strict=True)
    ]
    return joints_read(b, counts)
