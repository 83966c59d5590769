"""A drive between the effort that is asked for and its joint: motor, gear and play.

With u the effort asked for, within the actuator's limits, psi the motor's position in turns of the
joint, theta the joint's:

    tau_m = (1 + error) max(-most, min(most, u))
    I psi'' = tau_m - viscous psi' - coulomb psi' / sqrt(psi'^2 + s^2) - T
    d = psi - theta,    e = d - max(-b/2, min(b/2, d)),    T = k e + c d'

where a flank bears, which pushes and never pulls; without backlash b the gear bears both ways. T is
the effort at the joint. A rigid drive has neither rotor nor losses here, which are the mechanism's
then: its effort is tau_m.

With static friction F of the rotor, losses are set-valued: it grips, psi'' = 0, as long as
|tau_m - T| <= F; it turns in a direction d with `coulomb d` in the place of the term above, until
d psi' < 0. Which rotors grip is `condyle.simulation.gripping`'s to say.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from .lifting import NEVER

# Of port `drive`: elastic is 1, or 0 of a rigid drive; half_play is b / 2; turn is what joints of
# the same position are apart; least is that of T, which a cable cannot push.
NUMBERS = (
    *("elastic", "stiffness", "damping", "half_play", "inertia", "viscous", "coulomb", "square"),
    *("gain", "most", "least", "turn"),
)
BY_STATE = 2.0
REST = 1e-300  # N m or N: a quotient of nothing is a number


@dataclass(frozen=True)
class Drive:
    """A drive: the effort at its joint [N m or N], psi' and psi''.

    power: of the motor [W];  lost: in motor and gear [W];  kinetic, stored: its energies [J].
    excess: of the effort that is asked for, over the one that the largest current gives.
    apart: d;  beyond: above 0 where another flank bears, or none, than was given.
    pull: on the rotor, before its losses [N m or N];  slips, stops: above 0 where a rotor that
    grips breaks away, and where one that turns has come to rest.
    """

    effort: ca.SX
    rate: ca.SX
    acceleration: ca.SX
    power: ca.SX
    lost: ca.SX
    kinetic: ca.SX
    stored: ca.SX
    excess: ca.SX
    apart: ca.SX
    beyond: ca.SX
    pull: ca.SX
    slips: ca.SX
    stops: ca.SX


@dataclass(frozen=True)
class Grip:
    """Static friction of a rotor, 0 where there is none; whether it grips; else which way it
    turns."""

    static: ca.SX
    grips: ca.SX
    direction: ca.SX


def driven(
    numbers: ca.SX,
    asked: ca.SX,
    joint: tuple[ca.SX, ca.SX],
    motor: tuple[ca.SX, ca.SX],
    flank: ca.SX,
    grip: Grip | None = None,
) -> Drive:
    """A drive.

    Args: numbers: `NUMBERS`;  joint, motor: position and rate of each.
          flank: that bears up to the next event, -1, 0 (none) or 1; `BY_STATE`: the one that the
          state says.
    """
    n = dict(zip(NUMBERS, ca.vertsplit(numbers), strict=True))
    elastic, half, rate = n["elastic"], n["half_play"], motor[1]
    given = n["gain"] * _within(asked, n["most"])
    apart, slip = motor[0] - joint[0], rate - joint[1]
    apart -= n["turn"] * ca.floor(apart / n["turn"] + 0.5)
    sides = ca.if_else(apart > half, 1, ca.if_else(apart < -half, -1, 0))
    side = ca.if_else(flank == BY_STATE, sides, flank)
    pressed = ca.if_else(half > 0, ca.fabs(side) * (apart - side * half), apart)
    spring = n["stiffness"] * pressed
    both = spring + n["damping"] * slip
    pushing = ca.if_else(side > 0, ca.fmax(both, 0), ca.if_else(side < 0, ca.fmin(both, 0), 0))
    through = ca.fmax(ca.if_else(half > 0, pushing, both), n["least"])
    way, turns = rate / ca.sqrt(rate * rate + n["square"]), ca.SX(1)
    slips = stops = ca.SX(NEVER)
    pull = given - through
    if grip is not None:
        has, turns = grip.static > 0, 1 - grip.grips
        way = ca.if_else(has, grip.direction, way)
        over = (ca.fabs(pull) - grip.static) / (ca.fabs(pull) + grip.static + REST)
        slips = ca.if_else(grip.grips, over, NEVER)
        stops = ca.if_else(has * turns, -grip.direction * rate, NEVER)
    braking = n["viscous"] * rate + n["coulomb"] * way
    return Drive(
        effort=ca.if_else(elastic, through, given),
        rate=elastic * rate,
        acceleration=elastic * turns * (pull - braking) / n["inertia"],
        power=given * ca.if_else(elastic, rate, joint[1]),
        lost=elastic * (braking * rate + (through - spring) * slip),
        kinetic=elastic * n["inertia"] * rate * rate / 2,
        stored=elastic * spring * pressed / 2,
        excess=ca.fabs(asked) - n["most"],
        apart=apart,
        beyond=ca.if_else(
            flank == BY_STATE,
            NEVER,
            ca.if_else(flank == 0, ca.fabs(apart) - half, half - flank * apart),
        ),
        pull=pull,
        slips=slips,
        stops=stops,
    )


def _within(x: ca.SX, most: ca.SX) -> ca.SX:
    return ca.fmin(ca.fmax(x, -most), most)
