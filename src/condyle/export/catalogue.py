"""Questions that can be exported: their arguments in C, and their statuses.

A new one is an entry of `CATALOGUE`. Every controller of `condyle.questions.law` has one already.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from ..distribution import ObjectiveName
from ..errors import InputError, did_you_mean
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..model.distributing import MINIMUM_NORM
from ..questions import DYNAMIC
from ..questions.allocation import TERMS
from ..questions.law import CONTROLLERS, ControllerTable
from ..questions.law.computed_torque import ComputedTorque
from ..questions.observer import EXACT
from ..questions.observer import ITERATIONS as OBSERVER_STEPS
from ..questions.structure import Structure
from ..questions.tick_limits import TickLimits

POSE_STEPS = 8  # Newton steps from a start that is off by a third of the largest step
READ = {"joint": ("encoder readings: joint coordinates plus actuator.zero", "")}


@dataclass(frozen=True)
class Wish:
    """Options of a question.

    coordinates: names of 6 - k pose coordinates that `closure` starts from, in the order of X_EE,
                 or
    landmark:    the platform's point whose path it starts from.
    bound:       whether dynamics return the bound of their relative error too.
    given:       of gravity and base, what dynamics take besides: see `Structure.given`.
    """

    coordinates: tuple[str, ...] = ()
    landmark: str | None = None
    bound: bool = False
    given: tuple[str, ...] = ()


def in_order(coordinates: Sequence[str]) -> tuple[str, ...]:
    """Pose coordinates in the order of X_EE, in which functions take them.

    Raises: InputError: for an unknown name.
    """
    for name in coordinates:
        if name not in COORDINATES:
            raise InputError(f'no coordinate "{name}".{did_you_mean(name, COORDINATES)}')
    return tuple(sorted(coordinates, key=COORDINATES.index))


@dataclass(frozen=True)
class CEntry:
    """One question in C.

    text:     what it computes.
    given:    its arguments in turn, each as `port` or `port>name in C`; "": all ports that matter.
              Ports that are not among them are 0, efforts' limits those of the mechanism.
    results:  what it writes, likewise.
    question, details: of `condyle.questions`, where not of the entry's own name.
    doubt:    status of samples that cannot be certified;  rubbing: the same with friction.
    quick:    whether vector types make it faster.
    within:   result -> bound by precision, beyond which the sample is infeasible.
    steps:    fixed number of iterations; 0 for none.
    described: name in C -> description and unit, where `Arguments` has none.
    limited:  whether efforts are within limits.
    limits:   numbers of ports of these limits, where not those of the mechanism.
    tangent:  whether it is the derivative, along arguments `d_` of what is given.
    bounding: details with which the question has a result `bound`; None: it has none.
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
    described: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    limited: bool = False
    limits: Mapping[str, Sequence[float]] = field(default_factory=dict)
    tangent: bool = False
    bounding: tuple[Any, ...] | None = None

    def asking(self, name: str, wish: Wish) -> CEntry:
        """The entry with its relative error's bound among the results, and gravity and the base's
        motion among its arguments, as far as that is wished.

        Args: name: of the entry.
        """
        entry = self
        if self.given and self.dynamic(name):
            entry = replace(entry, given=" ".join((self.given, *wish.given)))
        if not wish.bound or self.bounding is None or self.tangent:
            return entry
        bounding = self.bounding
        return replace(entry, results=f"{self.results} bound", details=lambda wish: bounding)

    def dynamic(self, name: str) -> bool:
        """Whether it has gravity in it. Args: name: of the entry."""
        return (self.question or name) in (*DYNAMIC, "derivative")

    def unsure(self, structure: Structure) -> str:
        """The status of samples that cannot be certified."""
        return self.rubbing if self.rubbing and structure.friction else self.doubt


def least_norm(mechanism: Mechanism) -> ObjectiveName | None:
    """The distribution of exported efforts, as models take it: least norm, without limits."""
    cables = any(chain.kind in ("cable", "muscle") for chain in mechanism.chains)
    return MINIMUM_NORM if cables else None


STATE, LOAD = "q q1 q2", "force moment point"
BORNE = "borne_force>force borne_moment>moment borne_point>point"
WHOLE = "pose pose_rate pose_acceleration"
CATALOGUE: dict[str, CEntry] = {
    "inverse": CEntry(
        "Inverse dynamics: efforts of least norm for a motion under a load.",
        f"{STATE} {LOAD}",
        rubbing="UNCERTIFIED",
        quick=True,
        bounding=(("bound",),),
    ),
    "contact": CEntry(
        "Inverse dynamics: efforts of least norm and contact forces for a motion under a load.",
        f"{STATE} {LOAD}",
        "effort contact_force",
        question="inverse",
        details=lambda wish: (("contact",),),
        rubbing="UNCERTIFIED",
        quick=True,
        bounding=(("contact", "bound"),),
    ),
    "bounded": CEntry(
        "Inverse dynamics within limits: efforts of least norm, and contact forces.",
        f"{STATE} {LOAD}",
        "effort contact_force",
        question="limited",
        doubt="UNCERTIFIED",
        rubbing="UNCERTIFIED",
        limited=True,
        steps=TERMS["square"].turns,
        bounding=(),
    ),
    "forward": CEntry(
        "Forward dynamics: accelerations under efforts and a load, and the contact forces.",
        f"q q1 effort {LOAD}",
        "acceleration contact_force",
        details=lambda wish: (("contact",),),
        rubbing="UNCERTIFIED",
        quick=True,
        bounding=(("contact", "bound"),),
    ),
    "derivatives": CEntry(
        "Derivatives of efforts of least norm by q, q1 and q2, one column after another.",
        f"{STATE} {LOAD}",
        " ".join(f"effort/{port}>effort_by_{port}" for port in ("q", "q1", "q2")),
        question="derivative",
        details=lambda wish: ("slopes", "inverse", (), ("q", "q1", "q2"), ("effort",)),
        rubbing="UNCERTIFIED",
    ),
    "motion": CEntry(
        "Pose and its rates from the independent coordinates.", STATE, WHOLE, doubt="UNREACHABLE"
    ),
    "closure": CEntry(
        "Pose and its rates from other coordinates or a landmark's path.",
        "s s1 s2",
        WHOLE,
        details=lambda wish: (wish.coordinates,),
        doubt="UNREACHABLE",
    ),
    "pose": CEntry(
        "Forward kinematics: the pose from encoder readings.",
        "joint start",
        "pose residual",
        details=lambda wish: (POSE_STEPS,),
        doubt="UNREACHABLE",
        within={"residual": {"double": 1e-6, "float": 1e-4}},
        steps=POSE_STEPS,
        described=READ,
    ),
    "observer": CEntry(
        "State from encoders, period by period: pose, and rates of the counts.",
        "joint period resolution smoothing pose_before pose_rate_before joint_before "
        "joint_rate_before",
        "q q1 pose pose_rate joint>joint_read joint_rate>joint_rate_read",
        doubt="UNREACHABLE",
        steps=OBSERVER_STEPS,
        described=READ,
    ),
    "state": CEntry(
        "State from encoders and their rates (tachometers): pose, q and q1.",
        "joint joint_rate pose_before",
        "q q1 pose pose_rate",
        question="observer",
        details=lambda wish: (EXACT,),
        doubt="UNREACHABLE",
        steps=OBSERVER_STEPS,
        described=READ,
    ),
    "kalman": CEntry(
        "State, and load at a point, from encoders and the efforts that acted since the last call: "
        "a Kalman filter, with the covariance of (q, q1, force).",
        "joint acted period resolution encoder_std acceleration_std force_std load_point "
        "estimate_before covariance_before begun_before",
        "q q1 force estimate covariance innovation begun",
        doubt="UNREACHABLE",
        rubbing="UNCERTIFIED",
        described={
            "estimate": ("q, q1 and force", "1"),
            "begun": ("1", "1"),
            **READ,
        },
    ),
    "joints": CEntry(
        "Joint coordinates and their rates, and the pose, from the independent coordinates.",
        "q q1",
        "joint joint_rate pose pose_rate",
        question="instant",
        doubt="UNREACHABLE",
    ),
    "computed_torque": CEntry(
        "Controller: efforts that follow a desired motion, by "
        "q'' = q2_d + kd (q1_d - q1) + kp (q_d - q). Of least norm, and clipped at the actuators' "
        "limits.",
        f"q_d q1_d q2_d q q1 stiffness>kp damping>kd {BORNE}",
        question="tick",
        details=lambda wish: (ComputedTorque, (), None, TickLimits(), False, True),
        rubbing="UNCERTIFIED",
        quick=True,
        limited=True,
    ),
}
TANGENT = "_derivative"  # after the name of a question: how its results change
DEFAULT = ("inverse", "contact", "forward", "motion", "pose", "computed_torque")


def usual(mechanism: Mechanism) -> tuple[str, ...]:
    """The default questions of a mechanism."""
    return tuple(q for q in DEFAULT if mechanism.contacts or q != "contact")


def require_question(name: str) -> CEntry:
    """Raises InputError for an unknown question."""
    if name in CATALOGUE:
        return CATALOGUE[name]
    base = CATALOGUE.get(name.removesuffix(TANGENT))
    if base is not None and not base.steps:
        text = f"Derivative along a direction of all arguments of: {base.text}"
        question = base.question or name.removesuffix(TANGENT)
        return replace(base, text=text, question=question, quick=False, tangent=True)
    table = CONTROLLERS.get(name)
    if table is None or not issubclass(table, ControllerTable):
        known = CATALOGUE.keys() | CONTROLLERS.keys()
        raise InputError(f'no question "{name}" to export.{did_you_mean(name, known)}')
    return _law(name, table)


def _law(kind: str, table: type[ControllerTable]) -> CEntry:
    """The entry of a controller."""
    fields = {name: given.description or name for name, given in table.model_fields.items()}
    units = {name: table.parameters.get(name, "1").replace("²", "^2") for name in table.ports}
    described = {name: (fields.get(name, name), unit) for name, unit in units.items()}
    words = ", ".join(str(number) for number in table.memory)
    choices = tuple((name, table.model_fields[name].default) for name in table.chooses)
    return CEntry(
        f"Controller: {(table.__doc__ or kind).splitlines()[0]} Its inverse dynamics is of least "
        "norm; efforts are clipped at the actuators' limits.",
        results="effort memory",
        question="tick",
        details=lambda wish: (table, choices),
        rubbing="UNCERTIFIED",
        limited=True,
        described={
            **described,
            "force": ("of the load on the platform at the controller's point, axes of {S}", "N"),
            "force_d": ("desired force", "N"),
            "memory_before": (f"memory of the previous call; first {words}", "1"),
            "memory": ("memory for the next call's memory_before", "1"),
        },
    )
