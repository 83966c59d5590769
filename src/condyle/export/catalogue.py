"""What can be exported, by name: the function's arguments, its body and what may go wrong.

A new one is an entry of `CATALOGUE`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from ..errors import InputError, UnsupportedError, did_you_mean
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..model.distributing import LEAST
from ..questions import Prescribed
from ..questions.friction import MOST
from . import encoders, limited
from .context import Body, Context
from .exported import Argument
from .straight import function


@dataclass(frozen=True)
class Wish:
    """What is asked for besides the question's name.

    coordinates: names of 6 - k pose coordinates that `closure` starts from, in the order of X_EE,
                 or
    landmark:    the platform's point whose path it starts from.
    """

    coordinates: tuple[str, ...] = ()
    landmark: str | None = None


def in_order(coordinates: Sequence[str]) -> tuple[str, ...]:
    """Pose coordinates in the order of X_EE, in which functions take them.

    Raises: InputError: for what is none.
    """
    for name in coordinates:
        if name not in COORDINATES:
            raise InputError(f'no coordinate "{name}".{did_you_mean(name, COORDINATES)}')
    return tuple(sorted(coordinates, key=COORDINATES.index))


Arguments = Callable[[Context, Wish], list[Argument]]


@dataclass(frozen=True)
class Entry:
    """One question in C.

    text:       what it answers.
    needs:      questions that its code calls.
    statuses:   what it may return besides ok and out_of_bounds.
    iterations: at most so many steps.
    """

    text: str
    arguments: Arguments
    body: Callable[[Context, Wish], Body]
    statuses: tuple[str, ...]
    needs: tuple[str, ...] = ()
    iterations: int = 0


def least_norm(mechanism: Mechanism) -> str | None:
    """The distribution of exported efforts, as models take it: least norm, limits not regarded."""
    cables = any(chain.kind == "cable" for chain in mechanism.chains)
    return LEAST if cables else None


def _inverse_arguments(c: Context, wish: Wish) -> list[Argument]:
    return [*c.arguments.states(), *c.arguments.load(), c.arguments.effort()]


def _contact_arguments(c: Context, wish: Wish) -> list[Argument]:
    return [*_inverse_arguments(c, wish), *c.arguments.contact_force()]


def _inverse(c: Context, wish: Wish) -> Body:
    return _efforts(c, "inverse", (), _inverse_arguments(c, wish))


def _contact(c: Context, wish: Wish) -> Body:
    return _efforts(c, "contact", ("contact",), _contact_arguments(c, wish))


def _efforts(c: Context, name: str, wanted: tuple[str, ...], own: list[Argument]) -> Body:
    if len(c.structure.friction) > MOST:
        raise UnsupportedError(
            f"friction at {len(c.structure.friction)} contacts has no efforts in closed form; at "
            f"most {MOST} have"
        )
    found = c.variants("inverse", wanted)
    weak = "UNCERTIFIED" if c.structure.friction else "SINGULAR"
    program = found.robust or found.main
    quick = found.latency or (found.main if found.robust else None)
    return function(c, name, program, own, ("UNREACHABLE", weak), quick)


def _forward_arguments(c: Context, wish: Wish) -> list[Argument]:
    a = c.arguments
    found = replace(a.states()[2], name="acceleration", given=False, port="acceleration")
    return [*a.states()[:2], a.effort(given=True), *a.load(), found, *a.contact_force()]


def _forward(c: Context, wish: Wish) -> Body:
    program = c.variants("forward", ("contact",)).main
    weak = "JAMMED" if c.structure.friction else "SINGULAR"
    own = _forward_arguments(c, wish)
    return function(c, "forward", program, own, ("UNREACHABLE", weak), program)


def _motion_arguments(c: Context, wish: Wish) -> list[Argument]:
    return [*c.arguments.states(), *c.arguments.pose()]


def _motion(c: Context, wish: Wish) -> Body:
    return _placed(c, "motion", (), _motion_arguments(c, wish))


def _closure_arguments(c: Context, wish: Wish) -> list[Argument]:
    a = c.arguments
    if wish.landmark is None:
        names, what = wish.coordinates, "prescribed coordinates"
    else:
        names, what = ("x", "y", "z"), f'displacement of "{wish.landmark}" from home, in {{S}}'
    found = []
    for name, text, per in (
        ("s", what, ""),
        ("s1", "rates of s", "/s"),
        ("s2", "accelerations of s", "/s^2"),
    ):
        units = tuple(f"{'m' if n in 'XYZxyz' else 'rad'}{per}" for n in names)
        found.append(Argument(name, text, tuple(names), units, True, name))
    return [*found, *a.pose()]


def _closure(c: Context, wish: Wish) -> Body:
    # With a landmark a fourth number is given: the middle of the contacts keeps its home Y.
    rest = () if wish.landmark is None else tuple(f"{s}[3]" for s in ("s", "s1", "s2"))
    details = (Prescribed(wish.coordinates),)
    return _placed(c, "closure", details, _closure_arguments(c, wish), rest)


def _placed(
    c: Context,
    name: str,
    details: tuple[object, ...],
    own: list[Argument],
    rest: tuple[str, ...] = (),
) -> Body:
    program = c.variants(name, *details).main
    return function(c, name, program, own, ("UNREACHABLE",) * len(program.checks), zero=rest)


def _torque_arguments(c: Context, wish: Wish) -> list[Argument]:
    a = c.arguments
    names = a.independent
    wanted = [
        a.coordinates("q_d", "wanted independent coordinates", names),
        a.coordinates("q1_d", "wanted rates", names, "/s"),
        a.coordinates("q2_d", "wanted accelerations", names, "/s^2"),
    ]
    gains = [
        Argument(name, text, names, (unit,) * len(names), True)
        for name, text, unit in (
            ("kp", "stiffness: acceleration by deviation", "1/s^2"),
            ("kd", "damping: acceleration by deviation of rate", "1/s"),
        )
    ]
    return [*wanted, *a.states()[:2], *gains, *a.load(), a.effort()]


def _torque(c: Context, wish: Wish) -> Body:
    m = len(c.arguments.independent)
    words = ["q", "q1", "q2", "force", "moment", "point", "effort"]
    code = f"""int {c.prefix}_computed_torque({c.parameters(_torque_arguments(c, wish))})
{{
    {c.precision} q2[{m}];
    for (int i = 0; i < {m}; i++)
        q2[i] = q2_d[i] + kd[i] * (q1_d[i] - q1[i]) + kp[i] * (q_d[i] - q[i]);
    return {c.call(f"{c.prefix}_inverse", words)};
}}
"""
    return Body(code, 6 * m)


_EFFORTS = ("UNREACHABLE", "SINGULAR")
CATALOGUE: dict[str, Entry] = {
    "inverse": Entry(
        "Efforts of least norm that make a motion under a load.",
        _inverse_arguments, _inverse, _EFFORTS,
    ),
    "contact": Entry(
        "Efforts of least norm that make a motion under a load, and the contact forces.",
        _contact_arguments, _contact, _EFFORTS,
    ),
    "bounded": Entry(
        "Efforts of least norm within the actuators' limits, and the contact forces.",
        _contact_arguments, lambda c, wish: limited.body(c, _contact_arguments(c, wish)),
        (*_EFFORTS, "INFEASIBLE", "UNCERTIFIED"), ("contact", "motion"), limited.ROUNDS,
    ),
    "forward": Entry(
        "Accelerations that efforts and a load make, and the contact forces.",
        _forward_arguments, _forward, _EFFORTS,
    ),
    "motion": Entry(
        "The whole pose and its rates, from the independent coordinates.",
        _motion_arguments, _motion, ("UNREACHABLE",),
    ),
    "closure": Entry(
        "The whole pose and its rates, from other coordinates or a landmark's path.",
        _closure_arguments, _closure, ("UNREACHABLE",),
    ),
    "pose": Entry(
        "The pose that joint coordinates belong to, as encoders give them.",
        lambda c, wish: encoders.arguments(c), lambda c, wish: encoders.body(c),
        ("UNREACHABLE", "SINGULAR", "INFEASIBLE"), iterations=encoders.ITERATIONS,
    ),
    "computed_torque": Entry(
        "A controller: efforts that follow a wanted motion, by "
        "q'' = q2_d + kd (q1_d - q1) + kp (q_d - q).",
        _torque_arguments, _torque, _EFFORTS, needs=("inverse",),
    ),
}  # fmt: skip
DEFAULT = ("inverse", "contact", "forward", "motion", "pose", "computed_torque")


def usual(mechanism: Mechanism) -> tuple[str, ...]:
    """The questions that need nothing more to be said, and that the mechanism has answers to."""
    return tuple(q for q in DEFAULT if mechanism.contacts or q != "contact")


def require_question(name: str) -> Entry:
    """Raises InputError for what cannot be exported."""
    if name not in CATALOGUE:
        raise InputError(f'no question "{name}" to export.{did_you_mean(name, CATALOGUE)}')
    return CATALOGUE[name]
