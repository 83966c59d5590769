"""What exported functions should answer: the same questions by the library itself, in numpy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..mechanism.mechanism import Mechanism
from ..model.closing import Closure
from ..model.evaluator import Evaluator
from ..model.forward_kinematics import ForwardKinematics
from ..status import Status
from .catalogue import Wish, least_norm

Arrays = dict[str, np.ndarray]
Given = Mapping[str, np.ndarray]  # argument -> (N, size)


@dataclass
class Reference:
    """The library's own answers about one mechanism."""

    model: Evaluator
    wish: Wish

    @staticmethod
    def of(mechanism: Mechanism, formulation: str, route: str, wish: Wish) -> Reference:
        """By numpy: no code is shared with what prints C."""
        least = least_norm(mechanism)
        return Reference(Evaluator(mechanism, formulation, route, "numpy", least), wish)

    def __call__(self, question: str, given: Given) -> tuple[Arrays, np.ndarray]:
        """Results by argument, (N, size) each, and statuses, (N,): out of bounds is `overflow`.

        Results of samples that are not ok mean nothing.
        """
        good = np.isfinite(np.hstack(list(given.values()))).all(axis=1)
        with np.errstate(all="ignore"):
            found, own = _ANSWERS[question](self, {name: a[good] for name, a in given.items()})
        status = np.full(len(good), Status.overflow)
        status[good] = own
        results = {name: np.full((len(good), *a.shape[1:]), np.nan) for name, a in found.items()}
        for name, a in found.items():
            results[name][good] = a
        return results, status


def _inverse(r: Reference, given: Given) -> tuple[Arrays, np.ndarray]:
    load = np.hstack([given[name] for name in ("force", "moment", "point")])
    found = r.model.torques(given["q"], given["q1"], given["q2"], load, outputs=("contact",))
    return {"effort": found.effort, "contact_force": found["contact_force"]}, found.status


def _bounded(r: Reference, given: Given) -> tuple[Arrays, np.ndarray]:
    model = r.model.choosing("bounded")
    load = np.hstack([given[name] for name in ("force", "moment", "point")])
    found = model.torques(given["q"], given["q1"], given["q2"], load, outputs=("contact",))
    return {"effort": found.effort, "contact_force": found["contact_force"]}, found.status


def _forward(r: Reference, given: Given) -> tuple[Arrays, np.ndarray]:
    load = np.hstack([given[name] for name in ("force", "moment", "point")])
    found = r.model.forward(given["q"], given["q1"], given["effort"], load)
    results = {"acceleration": found.acceleration, "contact_force": found.contact_force}
    return results, found.status


def _motion(r: Reference, given: Given) -> tuple[Arrays, np.ndarray]:
    poses, reached = r.model.poses.whole(given["q"], given["q1"], given["q2"])
    return poses, _reached(reached)


def _closure(r: Reference, given: Given) -> tuple[Arrays, np.ndarray]:
    closure = Closure(
        r.model.mechanism, r.wish.coordinates, r.wish.landmark, backend=r.model.backend
    )
    rest = np.zeros((len(given["s"]), int(not closure.names)))
    s, s1, s2 = (np.hstack([given[name], rest]) for name in ("s", "s1", "s2"))
    found = closure.solve(s, s1, s2)
    return dict(found.named()), _reached(found.reached)


def _pose(r: Reference, given: Given) -> tuple[Arrays, np.ndarray]:
    found = ForwardKinematics(r.model.mechanism).solve(given["joint"])
    # A residual beyond the tolerance is infeasible in C.
    codes = np.array([Status.ok, Status.unreachable, Status.unreachable, Status.infeasible])
    return {"pose": found.pose, "residual": found.residual}, codes[found.status]


def _computed_torque(r: Reference, given: Given) -> tuple[Arrays, np.ndarray]:
    g = given
    q2 = g["q2_d"] + g["kd"] * (g["q1_d"] - g["q1"]) + g["kp"] * (g["q_d"] - g["q"])
    return _inverse(r, {**given, "q2": q2})


def _reached(reached: np.ndarray) -> np.ndarray:
    return np.where(reached, Status.ok, Status.unreachable)


_ANSWERS: dict[str, Callable[[Reference, Given], tuple[Arrays, np.ndarray]]] = {
    "inverse": _inverse,
    "contact": _inverse,
    "bounded": _bounded,
    "forward": _forward,
    "motion": _motion,
    "closure": _closure,
    "pose": _pose,
    "computed_torque": _computed_torque,
}
