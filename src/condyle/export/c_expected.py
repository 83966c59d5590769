"""What exported functions should answer: the same questions by the library itself, in numpy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..backends.kernel import AGAIN
from ..mechanism.mechanism import Mechanism
from ..model.closing import Closure
from ..model.forward_kinematics import ForwardKinematics
from ..model.model import Model
from ..questions.structure import structure_of
from ..status import Status
from .c_context import CODES
from .c_function import own_numbers, renamed
from .catalogue import Wish, least_norm, require_question

Arrays = dict[str, np.ndarray]
Given = Mapping[str, np.ndarray]  # argument -> (N, size)


@dataclass
class Reference:
    """The library's own answers about one mechanism."""

    model: Model
    wish: Wish

    @staticmethod
    def of(mechanism: Mechanism, formulation: str, route: str, wish: Wish) -> Reference:
        """By numpy: no code is shared with what prints C."""
        least = least_norm(mechanism)
        return Reference(Model(mechanism, formulation, route, "numpy", least), wish)

    def __call__(self, question: str, given: Given) -> tuple[Arrays, np.ndarray]:
        """Results by argument, (N, size) each, and statuses, (N,): out of bounds is `overflow`.

        Results of samples that are not ok mean nothing.
        """
        good = np.isfinite(np.hstack(list(given.values()))).all(axis=1)
        answer = _ANSWERS.get(question, lambda r, given: _graph(r, question, given))
        with np.errstate(all="ignore"):
            found, own = answer(self, {name: a[good] for name, a in given.items()})
        status = np.full(len(good), Status.overflow)
        status[good] = own
        results = {name: np.full((len(good), *a.shape[1:]), np.nan) for name, a in found.items()}
        for name, a in found.items():
            results[name][good] = a
        return results, status


def _graph(r: Reference, question: str, given: Given) -> tuple[Arrays, np.ndarray]:
    """By numpy's kernel of the same question."""
    entry = require_question(question)
    kernel = r.model.kernel(entry.question or question, *entry.details(r.wish))
    names = renamed(entry.given)
    ports, known = {}, own_numbers(r.model.mechanism)
    for port in kernel.interface.ports:
        size = port.size * (kernel.interface.lanes if port.lanes else 1)
        ports[port.name] = np.zeros((len(next(iter(given.values()))), size))
        name = names.get(port.name, port.name)
        if name in given and (not names or port.name in names):
            ports[port.name] = given[name]
        elif port.name in known:
            ports[port.name] += known[port.name]
    found = kernel.run(ports)
    results = {
        name: found.values[result].reshape(-1, len(found.status)).T
        for result, name in renamed(entry.results).items()
        if result in found.values
    }
    unsure = CODES[entry.unsure(structure_of(r.model.mechanism))]
    return results, np.where(found.status == AGAIN, unsure, found.status)


def _inverse(r: Reference, given: Given) -> tuple[Arrays, np.ndarray]:
    load = np.hstack([given[name] for name in ("force", "moment", "point")])
    found = r.model.torques(given["q"], given["q1"], given["q2"], load, outputs=("contact",))
    return {"effort": found.effort, "contact_force": found["contact_force"]}, found.status


def _forward(r: Reference, given: Given) -> tuple[Arrays, np.ndarray]:
    load = np.hstack([given[name] for name in ("force", "moment", "point")])
    found = r.model.forward(given["q"], given["q1"], given["effort"], load)
    results = {"acceleration": found.acceleration, "contact_force": found.contact_force}
    return results, found.status


def _closure(r: Reference, given: Given) -> tuple[Arrays, np.ndarray]:
    closure = Closure(
        r.model.mechanism, r.wish.coordinates, r.wish.landmark, backend=r.model.backend
    )
    rest = np.zeros((len(given["s"]), int(not closure.names)))
    s, s1, s2 = (np.hstack([given[name], rest]) for name in ("s", "s1", "s2"))
    found = closure.solve(s, s1, s2)
    return dict(found.named()), np.where(found.reached, Status.ok, Status.unreachable)


def _pose(r: Reference, given: Given) -> tuple[Arrays, np.ndarray]:
    found = ForwardKinematics(r.model.mechanism).solve(given["joint"])
    # A residual beyond the tolerance is infeasible in C.
    codes = np.array([Status.ok, Status.unreachable, Status.unreachable, Status.infeasible])
    return {"pose": found.pose, "residual": found.residual}, codes[found.status]


_ANSWERS: dict[str, Callable[[Reference, Given], tuple[Arrays, np.ndarray]]] = {
    "inverse": _inverse,
    "contact": _inverse,
    "forward": _forward,
    "closure": _closure,
    "pose": _pose,
}
