"""What can be exported, by name: a question, its arguments in C, and what may go wrong.

A new one is an entry of `CATALOGUE`. Every controller of `condyle.questions.law` is one without.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ..errors import InputError, did_you_mean
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..model.distributing import LEAST
from ..questions.allocation import TERMS
from ..questions.closure import Prescribed
from ..questions.law import CONTROLLERS, ControllerTable
from ..questions.law.computed_torque import ComputedTorque
from ..questions.observer import ITERATIONS as OBSERVER_STEPS
from ..questions.structure import Structure

POSE_STEPS = 8  # as many as a start that is off by a third of what steps may be takes


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


@dataclass(frozen=True)
class Entry:
    """One question in C.

    text:     what it answers.
    given:    its arguments in turn, each as `port` or `port>name in C`; "": all ports that matter.
              Ports that are not among them are 0, efforts' limits those of the mechanism.
    results:  what it writes, likewise.
    question, details: of `condyle.questions`, where not of the entry's own name.
    doubt:    the status where a sample cannot be vouched for;  rubbing: with friction.
    quick:    whether it is worth vector types.
    within:   result -> bound by precision, beyond which nothing fits.
    steps:    so many, a fixed number; 0 for none.
    told:     name in C -> what it is and its unit, where `arguments` knows nothing of it.
    limited:  whether efforts are within limits.
    """

    text: str
    given: str = ""
    results: str = "effort"
    question: str = ""
    details: Callable[[Wish], tuple[Any, ...]] = lambda wish: ()
    doubt: str = "SINGULAR"
    rubbing: str = ""
    quick: bool = False
    within: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    steps: int = 0
    told: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    limited: bool = False

    def unsure(self, structure: Structure) -> str:
        """The status of what cannot be vouched for."""
        return self.rubbing if self.rubbing and structure.friction else self.doubt


def least_norm(mechanism: Mechanism) -> str | None:
    """The distribution of exported efforts, as models take it: least norm, limits not regarded."""
    cables = any(chain.kind == "cable" for chain in mechanism.chains)
    return LEAST if cables else None


STATE, LOAD = "q q1 q2", "force moment point"
BORNE = "borne_force>force borne_moment>moment borne_point>point"
WHOLE = "pose pose_rate pose_acceleration"
CATALOGUE: dict[str, Entry] = {
    "inverse": Entry(
        "Efforts of least norm that make a motion under a load.",
        f"{STATE} {LOAD}",
        rubbing="UNCERTIFIED",
        quick=True,
    ),
    "contact": Entry(
        "Efforts of least norm that make a motion under a load, and the contact forces.",
        f"{STATE} {LOAD}",
        "effort contact_force",
        question="inverse",
        details=lambda wish: (("contact",),),
        rubbing="UNCERTIFIED",
        quick=True,
    ),
    "bounded": Entry(
        "Efforts of least norm within the actuators' limits, and the contact forces.",
        f"{STATE} {LOAD}",
        "effort contact_force",
        question="limited",
        doubt="UNCERTIFIED",
        rubbing="UNCERTIFIED",
        limited=True,
        steps=TERMS["square"].turns,
    ),
    "forward": Entry(
        "Accelerations that efforts and a load make, and the contact forces.",
        f"q q1 effort {LOAD}",
        "acceleration contact_force",
        details=lambda wish: (("contact",),),
        rubbing="JAMMED",
        quick=True,
    ),
    "motion": Entry(
        "The whole pose and its rates, from the independent coordinates.",
        STATE,
        WHOLE,
        doubt="UNREACHABLE",
    ),
    "closure": Entry(
        "The whole pose and its rates, from other coordinates or a landmark's path.",
        "s s1 s2",
        WHOLE,
        details=lambda wish: (Prescribed(wish.coordinates),),
        doubt="UNREACHABLE",
    ),
    "pose": Entry(
        "The pose that joint coordinates belong to, as encoders give them.",
        "joint start",
        "pose residual",
        details=lambda wish: (POSE_STEPS,),
        doubt="UNREACHABLE",
        within={"residual": {"double": 1e-6, "float": 1e-4}},
        steps=POSE_STEPS,
    ),
    "observer": Entry(
        "The state that encoders give from one period to the next: pose, and rates of counts.",
        "joint period resolution smoothing pose_before pose_rate_before joint_before "
        "joint_rate_before",
        "q q1 pose pose_rate joint>joint_read joint_rate>joint_rate_read",
        doubt="UNREACHABLE",
        steps=OBSERVER_STEPS,
        told={
            "period": ("between calls", "s"),
            "smoothing": ("part of the last rates that is kept, 0 to below 1", "1"),
        },
    ),
    "computed_torque": Entry(
        "A controller: efforts that follow a wanted motion, by "
        "q'' = q2_d + kd (q1_d - q1) + kp (q_d - q).",
        f"q_d q1_d q2_d q q1 stiffness>kp damping>kd {BORNE}",
        "asked>effort",
        question="tick",
        details=lambda wish: (ComputedTorque, (), None, False, True),
        rubbing="UNCERTIFIED",
        quick=True,
    ),
}
DEFAULT = ("inverse", "contact", "forward", "motion", "pose", "computed_torque")


def usual(mechanism: Mechanism) -> tuple[str, ...]:
    """The questions that need nothing more to be said, and that the mechanism has answers to."""
    return tuple(q for q in DEFAULT if mechanism.contacts or q != "contact")


def require_question(name: str) -> Entry:
    """Raises InputError for what cannot be exported."""
    if name in CATALOGUE:
        return CATALOGUE[name]
    table = CONTROLLERS.get(name)
    if table is None or not issubclass(table, ControllerTable):
        known = [*CATALOGUE, *CONTROLLERS]
        raise InputError(f'no question "{name}" to export.{did_you_mean(name, known)}')
    return _law(name, table)


def _law(kind: str, table: type[ControllerTable]) -> Entry:
    """A controller, for a processor that reads its state and its aims."""
    fields = {name: given.description or name for name, given in table.model_fields.items()}
    units = {name: table.parameters.get(name, "1").replace("²", "^2") for name in table.ports}
    told = {name: (fields.get(name, name), unit) for name, unit in units.items()}
    words = ", ".join(str(number) for number in table.memory)
    choices = tuple((name, table.model_fields[name].default) for name in table.chooses)
    return Entry(
        f"A controller: {(table.__doc__ or kind).splitlines()[0]} Inverse dynamics is of "
        "least norm; of efforts, what is beyond the actuators' limits is cut off.",
        results="effort memory",
        question="tick",
        details=lambda wish: (table, choices),
        rubbing="UNCERTIFIED",
        limited=True,
        told={
            **told,
            "period": ("between calls", "s"),
            "force": ("of the load on the platform at the law's point, axes of {S}", "N"),
            "force_d": ("wanted force", "N"),
            "memory_before": (f"memory that the last call gave; at first {words}", "1"),
            "memory": ("what the next call is given as memory_before", "1"),
        },
    )
