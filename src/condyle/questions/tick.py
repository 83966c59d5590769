"""A tick of a controller: sensors, law and limits, from what is measured to efforts.

    state = observer(joints)  or as it is,     asked, memory = law(state, reference, memory),
    effort = asked, within limits

What lasts from one tick to the next goes in and comes out: see `carried`.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import casadi as ca

from ..graph.program import Program, Programs
from .builder import Builder, Lanes
from .equations import Wrench
from .inverse import HUGE, efforts, in_variants
from .kalman import BEFORE as FILTERED
from .kalman import estimated
from .law.controller import Control, ControllerTable, Reference, gains_of
from .observer import BEFORE, ERROR, KALMAN, Measured, observe
from .platform import platform_at
from .structure import Structure
from .tick_limits import BEFORE as LIMITED
from .tick_limits import NONE, LimitedEfforts, LimitedTick, TickLimits

REQUEST = "request"  # results of ticks whose efforts are: what they have to balance
REFERENCE = ("q_d", "q1_d", "q2_d", "joint_d", "joint_rate_d", "force_d")


def tick(
    structure: Structure,
    law: type[ControllerTable] | None,
    choices: Sequence[tuple[str, Any]] = (),
    observer: str | None = None,
    limits: TickLimits = NONE,
    apart: bool = False,
    borne: bool = False,
) -> Programs:
    """Efforts that a law asks for at what is measured, and what lasts until the next tick.

    Ports: q, q1, joint, joint_rate: as they are; where there are sensors only joint, which is then
    the encoders' reading, its error encoder_error, and joint_rate; `KALMAN` takes the efforts that
    acted since the last tick, acted, in the place of joint_rate and force;
    reference `REFERENCE`, then those of `Structure.given`; force at the law's point, (3,); its
    gains; low, high: limits, a lane's.
    Results: effort; asked, without limits; q, q1, joint, joint_rate, measured_force, as sampled;
    memory.

    Args: law: whose equations, None where efforts are `given`;  choices: entries of its table.
          observer: `DIFFERENCE`, `EXACT` or `KALMAN`, None without sensors.
          limits: parts of the last stage, whose ports follow low and high.
          apart: efforts of the inverse dynamics are a port, `given`; `REQUEST`: q, q', q'' and
          force and point of the load that they are to balance, (3 m + 6,).
          borne: efforts bear a known load besides, ports borne_force, borne_moment, borne_point.
    """
    write = partial(_program, structure, law, choices, observer, limits, apart, borne)
    return in_variants(structure, write) if borne else Programs(write(True, False), single=True)


def carried(ports: Collection[str]) -> dict[str, str]:
    """Which ports of the next tick take which results, of those ports that there are."""
    pairs = {"memory_before": "memory", **BEFORE, **FILTERED, **LIMITED}
    return {port: result for port, result in pairs.items() if port in ports}


def _program(
    structure: Structure,
    law: type[ControllerTable] | None,
    choices: Sequence[tuple[str, Any]],
    observer: str | None,
    limits: TickLimits,
    apart: bool,
    borne: bool,
    robust: bool,
    low_latency: bool,
) -> Program:
    b = Builder(structure)
    m = structure.m
    period = b.sample("period", 1, "s")
    seen = b.lane_sample("joint", unit="rad or m")
    moved = b.lane_sample("acted" if observer == KALMAN else "joint_rate")
    now = None if observer else Measured(b.sample("q", m), b.sample("q1", m), seen, moved)
    force = None if observer == KALMAN else b.sample("force", 3, "N")
    q, q1, q2 = (b.sample(name, m) for name in REFERENCE[:3])
    joint, rate = (b.lane_sample(name) for name in REFERENCE[3:5])
    reference = Reference(q, q1, q2, joint, rate, b.sample(REFERENCE[5], 1, "N"))
    if observer:
        error = b.lane_sample(ERROR, unit="rad or m")
        seen = [one + off for one, off in zip(seen, error, strict=True)]
    for name in structure.given:
        getattr(b, name)  # their ports follow the reference's
    if observer == KALMAN:
        now = estimated(b, seen, moved, period)
    elif observer:
        now = observe(b, seen, moved, observer, period)
    assert now is not None
    now = now if force is None else replace(now, force=force)

    known = (
        Wrench(*(b.sample(f"borne_{x}", 3) for x in ("force", "moment", "point")))
        if borne
        else None
    )

    stage = LimitedTick(b, limits, period)
    chosen: list[LimitedEfforts] = []

    def solve(q: ca.SX, q1: ca.SX, q2: ca.SX, load: Wrench) -> Lanes:
        if apart:
            b.output(REQUEST, ca.vertcat(q, q1, q2, load.force, load.point), "", 3 * m + 6)
            return b.lane_sample("given", unit="N m or N")
        q, q1, q2 = (b.cut(part) for part in (q, q1, q2))

        def least_norm(q2: ca.SX, load: Wrench) -> Lanes:
            platform = platform_at(b, q, q1, q2)
            if known is not None:
                both = load.about_centre(platform.R) + known.about_centre(platform.R)
                load = Wrench(both[:3], both[3:], ca.SX.zeros(3))
            return efforts(b, platform, load, robust, low_latency)

        assert law is not None
        chosen.append(stage.solve(q, q1, q2, load, least_norm, law.adds))
        return chosen[-1].effort

    def cut(demand: Lanes) -> ca.SX:
        ends = enumerate(zip(demand, stage.clipped(demand), strict=True))
        cuts = b.total([b.lane(i, "mask") * ca.fabs(e - x) for i, (e, x) in ends]) > 0
        return ca.fmax(cuts, chosen[-1].cut) if chosen else cuts

    if law is None:
        demand, memory = b.lane_sample("given", unit="N m or N"), ca.SX(0, 1)
    else:
        before = b.sample("memory_before", len(law.memory)) if law.memory else ca.SX(0, 1)
        gains = gains_of(b, law.ports)
        demand, memory = law.equations(
            Control(b, now, reference, gains, dict(choices), before, period, solve, cut)
        )
    b.output("effort", stage.clipped(demand), "N m or N")
    b.output("asked", demand, "N m or N")
    b.output("q", now.q, "m, rad", m)
    b.output("q1", now.q1, "per s", m)
    b.output("measured_force", now.force, "N", 3)
    if observer in (None, KALMAN):
        b.output("joint", now.joint, "rad or m")
        b.output("joint_rate", now.joint_rate, "rad/s or m/s")
    if memory.numel():
        b.output("memory", memory, "", memory.numel())
    whole = b.total([b.lane(i, "mask") * demand[i] for i in range(len(demand))])
    b.check(2 * (ca.fabs(whole) < HUGE) - 1, 0.5)
    return b.finish()
