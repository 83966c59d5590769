"""The plant as a system of first order: y' = f(y) with y = (q, q', works, activations, motors), and
what is watched.

    q'' by forward dynamics of the efforts, within limits, under the loads' wrenches,
    works: of the actuators, of the loads, lost in actuators and ligaments, rubbed off at the
    contacts [J],
    activations: of muscles, whose tensions are their efforts (`excitation`),
    motors: position and rate of those behind elastic gears, which drive the joints (`drive`).

What loads, sensors, events and results ask of a state comes with it. Numbers of loads and limits
are ports; the kinds of the loads shape the question. Every guard stays below zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import casadi as ca

from ..graph.program import Programs
from ..kinematics.constraints import contact_frame
from ..kinematics.state import twist_state
from .builder import Builder
from .configuration import loops_of, on_rates
from .drive import NUMBERS as DRIVE_NUMBERS
from .drive import Drive, Grip, driven
from .equations import Wrench, total
from .excitation import NUMBERS, Contraction, contraction
from .forward import accelerated, twist_rate
from .instant import losses
from .inverse import MUSCLE
from .lifting import NEVER, LiftingContact, pressed
from .load.acting import LoadPlace, LoadTable
from .numbers import single_contacts
from .passive import pulls
from .platform import ANGLE_UNITS, PlatformState, closed, contacts
from .sticking import sticking
from .structure import Structure


def rate(
    structure: Structure,
    loads: Sequence[type[LoadTable]] = (),
    measured: Sequence[int] = (),
    bounded: Sequence[int] = (),
    sided: Sequence[int] = (),
    lifting: Sequence[LiftingContact] = (),
    compliant: bool = False,
    drives: str = "",
    stuck: Sequence[int] = (),
    gripping: bool = False,
) -> Programs:
    """The rate of the state, from q, q' and efforts.

    Ports: low, high, speed: limits of efforts and of joint rates; of load i its point, mode and
    numbers, as `load_i_point`; of bounded contacts `bounds`, low then high a contact (6,), of
    unilateral ones `push`, the sign of their normal force.
    Results: rate (2 m + 4,); guards: of bounded contacts, of unilateral ones, of the loads' jumps;
    too_fast, a lane's. Where there are muscles: activation_rate, which follows `rate`; delivered,
    the efforts as they act; excitation. Their ports: works, which nothing depends on, and
    activation, which follow q and q'; muscle (9,), of `muscle_numbers`; excited, whether their
    efforts are excitations. Of drives in the same way motor_velocity and motor_acceleration,
    delivered, drive_energy (2,), excess, drive_apart, drive_beyond; ports motor_joint, motor_rate,
    drive (12,) and flank.
    wrench (6,) of all loads about O_M, load_force (loads, 3); measured_force (3,). joint, and its
    encoder's reading, a lane's.

    Args: loads: their laws;  measured: loads whose forces sum up to `measured_force`.
          bounded, sided: contacts whose bounds and pushes are guarded.
          lifting: contacts that lift and land, besides those of the structure; see `pressed`, whose
          ports and results there are then, and a guard each that passes zero where one lifts.
          compliant: whether their forces are given.
          drives: which side of the gears encoders read, "joint" or "motor"; "": there are none.
          stuck: contacts with static friction, of a platform whose contacts are kept; see
          `sticking`, whose ports and results there are then, and two guards each, the last.
          gripping: whether rotors of drives have static friction: ports static_friction, grips and
          turn_direction; results drive_pull, drive_slips and drive_stops, a lane's.
    """
    b = Builder(structure)
    m, k = structure.m, len(structure.contacts)
    platform = closed(b, rates=1)
    pulling = MUSCLE in structure.families
    if pulling or drives:
        b.sample("works", 4, "J")
    activation = b.lane_sample("activation") if pulling else []
    motors = [b.lane_sample(f"motor_{of}") for of in ("joint", "rate")] if drives else []
    commanded, low, high, speed = (
        b.lane_sample(name, unit="N m or N") for name in ("effort", "low", "high", "speed")
    )
    effort = [ca.fmin(ca.fmax(e, lo), hi) for e, lo, hi in zip(commanded, low, high, strict=True)]
    motion = platform.motion
    twist = motion.twist
    state = twist_state(platform.position, motion.R, twist, motion.twist_rate)
    contracted: list[Contraction | None] = [None] * len(effort)
    if pulling:
        numbers, excited = b.lane_sample("muscle", len(NUMBERS) + 1), b.sample("excited", 1)
        for i, kind in enumerate(structure.families):
            if kind == MUSCLE:
                element = contraction(b, i, state, numbers[i], activation[i], commanded[i], excited)
                contracted[i], effort[i] = element, element.tension
    groups = range(len(structure.chains))
    moving: list[Drive] = []
    if drives:
        numbers, loops = b.lane_sample("drive", len(DRIVE_NUMBERS)), loops_of(b, platform)
        rows = on_rates(b, platform, [loop.J for loop in loops])
        flank = b.lane_sample("flank")
        grips: list[Grip | None] = [None] * len(effort)
        if gripping:
            ports = ("static_friction", "N m or N"), ("grips", ""), ("turn_direction", "")
            grips = [Grip(*one) for one in zip(*(b.lane_sample(n, unit=u) for n, u in ports),
                                               strict=True)]  # fmt: skip
        for i in groups:
            joint = loops[i].q_r[0], ca.dot(rows[i], platform.q1)
            motor = motors[0][i], motors[1][i]
            moving.append(driven(numbers[i], effort[i], joint, motor, flank[i], grips[i]))
        effort = [element.effort for element in moving]
    acting = [_Acting(b, platform, i, law) for i, law in enumerate(loads)]
    wrench = total([ca.SX.zeros(6), *(element.wrench for element in acting)])
    zero = ca.SX.zeros(3)
    load = Wrench(wrench[:3], wrench[3:], zero)
    moved = accelerated(b, platform, load, effort, smooth=bool(stuck))
    q2, force, lifted = moved.q2, moved.force, None
    held = sticking(b, platform, moved, stuck) if stuck else None
    if held is not None:
        q2, force = held.q2, held.force
    if lifting:
        free = twist_rate(platform, moved.equations, moved.w)
        lifted = pressed(b, platform, moved, free, lifting, compliant)
        q2, force = lifted.q2, lifted.force
    rates = moved.equations.rates
    lost = [b.lane(i, "mask") * losses(b, i, rates[i]) for i in groups]
    power = [effort[i] * rates[i] for i in groups]
    if moving:
        power = [element.power for element in moving]
        lost = [lost[i] + b.lane(i, "mask") * moving[i].lost for i in groups]
    touch = moved.touch or contacts(b, platform)
    rub = ca.vertcat(ca.SX(0, 1), *(ca.dot(touch.slip[:, i], touch.drag[:, i]) for i in range(k)))
    work = b.total([b.lane(i, "mask") * power[i] for i in groups])
    damped = b.total(lost) + sum((element.lost for element in pulls(b, state)), ca.SX(0))
    rubbed = ca.dot(ca.fabs(force), rub) if held is None else held.power
    if lifted is not None:
        rubbed += lifted.power
    works = (work, ca.dot(wrench, twist), damped, rubbed)
    b.output("rate", ca.vertcat(platform.q1, q2, *works), "per s", 2 * m + 4)
    if pulling:
        zero = ca.SX(0)
        rising = [zero if element is None else element.rate for element in contracted]
        excitation = [zero if element is None else element.excitation for element in contracted]
        b.output("activation_rate", rising, "1/s")
        b.output("excitation", excitation, "1")
    if moving:
        b.output("motor_velocity", [element.rate for element in moving], "rad/s or m/s")
        b.output("motor_acceleration", [element.acceleration for element in moving], "per s^2")
        pairs = [ca.vertcat(element.kinetic, element.stored) for element in moving]
        masked = [b.lane(i, "mask") * pairs[i] for i in groups]
        b.output("drive_energy", b.total(masked), "J", 2)
        b.output("excess", [element.excess for element in moving], "N m or N")
        b.output("drive_apart", [element.apart for element in moving], "rad or m")
        b.output("drive_beyond", [element.beyond for element in moving], "rad or m")
    if gripping:
        b.output("drive_pull", [element.pull for element in moving], "N m or N")
        b.output("drive_slips", [element.slips for element in moving], "")
        b.output("drive_stops", [element.stops for element in moving], "rad/s or m/s")
    if pulling or moving:
        b.output("delivered", effort, "N m or N")
    guards = [*_bounds(b, platform, bounded)]
    if sided:
        guards += ca.vertsplit(-b.sample("push", len(sided)) * force[list(sided)])
    guards += [guard for element in acting for guard in element.guards]
    if lifted is not None:
        guards += ca.vertsplit(lifted.guards)
    if held is not None:
        guards += ca.vertsplit(held.guards)
        held.add_results(b)
    if guards:
        b.output("guards", ca.vertcat(*guards), "", len(guards))
    if lifted is not None:
        lifted.add_results(b)
    b.output("too_fast", [ca.fabs(r) - v for r, v in zip(rates, speed, strict=True)], "")
    b.output("pose", platform.pose, ANGLE_UNITS)
    joints = [loop.q_r[0] for loop in loops_of(b, platform)]
    b.output("joint", joints, "rad or m")
    read = joints
    if drives == "motor":
        elastic = [numbers[i][DRIVE_NUMBERS.index("elastic")] for i in groups]
        pairs = [ca.vertcat(joints[i], rates[i]) for i in groups]
        seen = [
            ca.if_else(elastic[i], ca.vertcat(motors[0][i], motors[1][i]), pairs[i]) for i in groups
        ]
        read = [one[0] for one in seen]
        b.output("reading_rate", [one[1] for one in seen], "rad/s or m/s")
    b.output("reading", [one + b.lane(i, "zero") for i, one in enumerate(read)], "rad or m")
    b.output("joint_rate", rates, "rad/s or m/s")
    b.output("loss", lost, "W")
    b.output("contact_force", force, "N", k)
    b.output("rub", rub, "m/s", k)
    b.output("wrench", wrench, "N, N m", 6)
    if acting:
        forces = ca.horzcat(*(element.force for element in acting)).T
        b.output("load_force", forces, "N", len(acting), 3)
        places = ca.horzcat(*(ca.vertcat(element.place.s, element.place.v) for element in acting)).T
        b.output("load_place", places, "m, m/s", len(acting), 6)
    if measured:
        b.output("measured_force", total([acting[i].force for i in measured]), "N", 3)
    placement = platform.placement
    certain = ca.SX(1) if placement.discriminant is None else placement.discriminant
    b.output("certain", certain if placement.iterated else ca.SX(1), "1")
    return Programs(b.finish(), single=True)


class _Acting:
    """A load at its place: force at the point, wrench about O_M, guards."""

    def __init__(self, b: Builder, platform: PlatformState, i: int, law: type[LoadTable]) -> None:
        own = f"load_{i}_"
        point, mode = b.sample(f"{own}point", 3, "m"), b.sample(f"{own}mode", 1)
        numbers = SimpleNamespace(
            **{name: b.sample(own + name, size) for name, size in law.ports.items()}
        )
        r, twist = platform.R @ point, platform.motion.twist
        s, v = platform.placement.position + r - point, twist[:3] + ca.cross(twist[3:], r)
        self.place = LoadPlace(s, v, mode, numbers)
        found = law.wrench(self.place)
        self.force = found[:3]
        moment = ca.cross(r, self.force)
        self.wrench = ca.vertcat(self.force, moment + found[3:] if found.numel() == 6 else moment)
        pairs = law.guards(self.place)
        self.guards = [ca.if_else(mode == when, value, NEVER) for when, value in pairs]


def _bounds(b: Builder, platform: PlatformState, bounded: Sequence[int]) -> list[ca.SX]:
    """How far contact points are beyond the faces of their bounds, six a contact [m]."""
    if not bounded:
        return []
    limits = b.sample("bounds", 6 * len(bounded), "m")
    bounds = []
    for j, (place, _) in enumerate(ball_centres(b, platform, bounded)):
        low, high = limits[6 * j : 6 * j + 3], limits[6 * j + 3 : 6 * j + 6]
        bounds += ca.vertsplit(ca.vertcat(low - place, place - high))
    return bounds


def ball_centres(
    b: Builder, platform: PlatformState, some: Sequence[int]
) -> list[tuple[ca.SX, ca.SX]]:
    """Centres of the balls of some contacts, and their levers from O_M, (3,) each [m]."""
    position = platform.placement.position
    frame = contact_frame(single_contacts(b.structure, b.parameter), position, platform.R)
    return [(position + frame.levers[i], frame.levers[i]) for i in some]
