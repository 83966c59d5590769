"""Recorded test vectors: arguments, and what the library itself answers to them, in numpy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..backends.kernel import AGAIN, Kernel
from ..backends.numpy_kernel import NumpyKernel
from ..graph.program import Programs
from ..model.closing import Closure
from ..model.model import Model, model_with_inputs
from ..progress import stepping
from ..questions import Question
from ..questions.derivative import PREFIX, directional
from ..questions.file_numbers import numbers_of
from ..questions.structure import structure_of
from ..status import Status
from .c_function import own_numbers, renamed
from .catalogue import CEntry, Wish, least_norm, require_question
from .exported import Exported, Function

Arrays = dict[str, np.ndarray]
Given = Mapping[str, np.ndarray]  # argument -> (N, size)
COUNT = 40
SPARE = 10  # samples drawn besides, in the place of those near a border
FAR = tuple(1e3 / 3.0**i for i in range(7))  # how far out of reach, the first that is clear
ROWS = COUNT + SPARE + len(FAR)  # samples that are drawn
NUDGES = 2  # how often all numbers of a sample are moved, by this part of their size
NUDGE = {"double": 1e-9, "float": 1e-6}  # far more than rounding does on any processor
SIZES = {"force": 20.0, "moment": 0.5, "point": 0.05, "kp": 400.0, "kd": 40.0, "period": 1e-3}
SIZES |= {"resolution": 1e-5, "smoothing": 0.9, "stiffness": 100.0, "damping": 10.0}
SIZES |= {"gravity": 10.0, "base": 3.0}
SIZES |= {"force_std": 25.0, "load_point": 0.05, "acceleration_std": 0.1}
SIGNED = ("gravity", "base", "force", "moment", "point", "direction")
WIDTH = 0.1  # of states about home, in characteristic lengths and radians, halved until most reach


@dataclass
class LibraryModel:
    """The library's own answers about one mechanism."""

    model: Model
    wish: Wish

    def around(self, given: Given) -> dict[str, Any]:
        """Gravity and the base's motion, as models take them."""
        return {name: given[name] for name in self.wish.given}

    def __call__(self, question: str, given: Given) -> tuple[Arrays, np.ndarray]:
        """Results by argument, (N, size) each, and statuses, (N,): out of bounds is `overflow`.

        Results of samples that are not ok mean nothing; what is in doubt is `AGAIN`.
        """
        good = np.isfinite(np.hstack(list(given.values()))).all(axis=1)
        answer = _ANSWERS.get(question, lambda r, given: _graph(r, question, given))
        with np.errstate(all="ignore"):
            values, own = answer(self, {name: a[good] for name, a in given.items()})
        status = np.full(len(good), Status.overflow)
        status[good] = own
        results = {name: np.full((len(good), *a.shape[1:]), np.nan) for name, a in values.items()}
        for name, a in values.items():
            results[name][good] = a
        return results, status


def _graph(r: LibraryModel, question: str, given: Given) -> tuple[Arrays, np.ndarray]:
    """Results and statuses by numpy's kernel of the same question."""
    entry = require_question(question).asking(question, r.wish)
    kernel, names = _kernel(r, question, entry)
    ports, known = {}, own_numbers(r.model.mechanism)
    for port in kernel.interface.ports:
        size = port.size * (kernel.interface.lanes if port.lanes else 1)
        ports[port.name] = np.zeros((len(next(iter(given.values()))), size))
        name = names.get(port.name, port.name)
        if name in given and (not names or port.name in names):
            ports[port.name] = given[name]
        elif port.name in known:
            ports[port.name] += known[port.name]
    answer = kernel.run(ports)
    results = {
        name: answer.values[result].reshape(-1, len(answer.status)).T
        for result, name in _tangent_names(entry, renamed(entry.results)).items()
        if result in answer.values
    }
    return results, answer.status


def _kernel(r: LibraryModel, question: str, entry: CEntry) -> tuple[Kernel, dict[str, str]]:
    """The kernel, and its ports' names in C where not all are their own."""
    names = renamed(entry.given)
    if not entry.tangent:
        return r.model.kernel(entry.question or question, *entry.details(r.wish)), names
    structure = structure_of(r.model.mechanism, r.model.formulation, r.model.route)
    structure = replace(structure, given=r.wish.given)
    numbers = numbers_of(structure, r.model.mechanism)
    found = Question.about(structure, entry.question, *entry.details(r.wish)).variants()
    program = directional(found.robust or found.main, set(names), set(renamed(entry.results)))
    return NumpyKernel(Programs(program), numbers), names | _tangent_names(entry, names)


def _tangent_names(entry: CEntry, names: dict[str, str]) -> dict[str, str]:
    return {PREFIX + a: PREFIX + b for a, b in names.items()} if entry.tangent else names


def _load(given: Given) -> tuple[np.ndarray, np.ndarray]:
    """Wrench and point."""
    return np.hstack([given["force"], given["moment"]]), given["point"]


def _inverse(r: LibraryModel, given: Given) -> tuple[Arrays, np.ndarray]:
    q, v, a = (given[name] for name in ("q", "q1", "q2"))
    found = r.model.inverse_dynamics(q, v, a, *_load(given), **r.around(given))
    results = {"effort": found.effort, "contact_force": found.contact_force}
    return results | {"bound": found.bound[:, None]}, found.status


def _forward(r: LibraryModel, given: Given) -> tuple[Arrays, np.ndarray]:
    q, v, effort = (given[name] for name in ("q", "q1", "effort"))
    found = r.model.forward_dynamics(q, v, effort, *_load(given), **r.around(given))
    results = {"acceleration": found.acceleration, "contact_force": found.contact_force}
    return results | {"bound": found.bound[:, None]}, found.status


def _closure(r: LibraryModel, given: Given) -> tuple[Arrays, np.ndarray]:
    closure = Closure.of(
        r.model.mechanism, r.wish.coordinates, r.wish.landmark, backend=r.model.backend
    )
    rest = np.zeros((len(given["s"]), int(not closure.names)))
    s, s1, s2 = (np.hstack([given[name], rest]) for name in ("s", "s1", "s2"))
    found, status = closure.solve(s, s1, s2).answer()
    return {name: a.T for name, a in found.items()}, status


def _pose(r: LibraryModel, given: Given) -> tuple[Arrays, np.ndarray]:
    found = r.model.forward_kinematics(given["joint"])
    # A residual beyond the tolerance is infeasible in C.
    codes = np.array([Status.ok, Status.unreachable, Status.unreachable, Status.infeasible])
    return {"pose": found.pose, "residual": found.residual}, codes[found.status]


_ANSWERS: dict[str, Callable[[LibraryModel, Given], tuple[Arrays, np.ndarray]]] = {
    "inverse": _inverse,
    "contact": _inverse,
    "forward": _forward,
    "closure": _closure,
    "pose": _pose,
}


@dataclass(frozen=True)
class Vectors:
    """Samples of one function.

    given, right: argument -> (N, size);  status: (N,).
    """

    function: Function
    given: dict[str, np.ndarray]
    right: dict[str, np.ndarray]
    status: np.ndarray


def vectors(exported: Exported) -> list[Vectors]:
    """Seeded samples about home, home itself, and some that have to fail.

    All are clear: see `clear`.
    """
    # By numpy: no code is shared with what prints C.
    mechanism = exported.mechanism
    model = Model(mechanism, **exported.recipe, backend="numpy", distribution=least_norm(mechanism))
    reference = LibraryModel(model_with_inputs(model, exported.wish.given), exported.wish)
    draw = Samples(model)
    recorded = []
    for f in stepping("recording samples", exported.functions):
        given = {a.name: draw(a.name, a.size, f) for a in f.inputs}
        _spoil(given)
        if exported.precision == "float":
            given = {name: a.astype(np.float32).astype(float) for name, a in given.items()}
        right, status = reference(f.question, given)
        sure = clear(reference, f.question, given, status, NUDGE[exported.precision])
        chosen = _chosen(sure, status)
        given, right = ({name: a[chosen] for name, a in each.items()} for each in (given, right))
        status = status[chosen]
        good = (status == Status.ok)[:, None]
        right = {a.name: np.where(good, right[a.name], 0.0) for a in f.outputs}
        recorded.append(Vectors(f, given, right, status))
    return recorded


def clear(
    reference: LibraryModel, question: str, given: Given, status: np.ndarray, nudge: float
) -> np.ndarray:
    """Samples that keep a distance from every border, (N,): their status is in no doubt, and stays
    when every number moves by a part `nudge` of its size, of all samples' where it is 0."""
    sure, rng = status != AGAIN, np.random.default_rng(0)
    for _ in range(NUDGES):
        moved = {}
        for name, a in given.items():
            size = np.abs(np.where(np.isfinite(a), a, 0.0))
            size = np.maximum(size, np.median(size, axis=0))
            moved[name] = a + nudge * size * rng.choice((-1.0, 1.0), a.shape)
        sure &= reference(question, moved)[1] == status
    return sure


def _spoil(given: dict[str, np.ndarray]) -> None:
    """The last samples fail: infinite, no number, out of reach (as many as `FAR`)."""
    first = next(name for name in ("q", "s", "joint") if name in given)
    far = -len(FAR)
    given[first][far:] = np.outer(FAR, given[first][-1] + 7e-3)
    given[first][far - 1, 0] = np.nan
    given[list(given)[-1]][far - 2, -1] = np.inf


def _chosen(sure: np.ndarray, status: np.ndarray) -> np.ndarray:
    """Numbers of `COUNT` clear samples: most of states, two of no numbers, one out of reach.

    Out of reach of all that are clear the farthest that fails, else the farthest.
    """
    every, first = np.flatnonzero(sure), len(sure) - len(FAR)
    states, far = every[every < first - 2], every[every >= first]
    ends = [first - 2, first - 1, *[*far[status[far] != Status.ok], *far][:1]]
    return np.array([*states[: COUNT - len(ends)], *ends])


class Samples:
    """Arguments by name, (N, size) each, that belong to states which can be reached."""

    def __init__(self, model: Model) -> None:
        self._model, self._rng = model, np.random.default_rng(0)
        length = model.characteristic_length
        self._scale = np.array([length if n in "XYZ" else 1.0 for n in model.independent])
        self.q: np.ndarray = self._states()
        self.q1: np.ndarray = self._rng.uniform(-1, 1, self.q.shape) * self._scale
        self.q2: np.ndarray = self._rng.uniform(-1, 1, self.q.shape) * self._scale * 10
        self._path = model.inverse_kinematics(self.q, self.q1, self.q2)
        self._near = model.inverse_kinematics(0.3 * self.q)  # Newton's reach from home

    def _states(self) -> np.ndarray:
        """q about home, (N, m), home first."""
        width, m = WIDTH, len(self._scale)
        while True:
            q = self._rng.uniform(-width, width, (4 * ROWS, m)) * self._scale
            q[0] = 0.0
            zero = np.zeros((len(q), 3))
            given = {"q": q, "q1": 0 * q, "q2": 0 * q, "force": zero, "moment": zero, "point": zero}
            # Where the kernels' own code can vouch for efforts, as the C is: no path to follow.
            efforts = self._model.kernel("inverse", ("contact",)).run(given)
            fits = self._model.inverse_kinematics(q).status == Status.ok  # no ball overlaps
            good = np.flatnonzero((efforts.status == Status.ok) & fits)[:ROWS]
            if len(good) == ROWS:
                return q[good]
            width /= 2

    def __call__(self, name: str, size: int, f: Function) -> np.ndarray:
        """Numbers for an argument of a function."""
        q1, q2, rng, shape = self.q1, self.q2, self._rng, (ROWS, size)
        known = {"q": self.q, "q_d": self.q + 0.01 * self._scale * rng.uniform(-1, 1, self.q.shape)}
        known |= {"q1": q1, "q1_d": 0.9 * q1, "q2": q2, "q2_d": q2}
        if name in known:
            return known[name].copy()
        if name in ("s", "s1", "s2"):
            return self._prescribed(name, f)
        if name.startswith("joint") and "rate" not in name:
            joint = self._near.joint * (0.98 if name == "joint_before" else 1.0)
            return joint + self._model.mechanism.zeros if name == "joint" else joint  # a reading
        if name == "pose_before":  # where `joint` is, but for the last period's way
            return 0.98 * self._near.pose
        if name == "estimate_before":
            return np.hstack([0.2 * self.q, 0.1 * q1, rng.uniform(-9, 9, (ROWS, 3))])
        if name == "covariance_before":
            sizes = np.repeat([1e-5, 1e-2, 2.0], [len(self._scale), len(self._scale), 3])
            return np.tile(np.diag(sizes**2)[np.tril_indices(len(sizes))], (ROWS, 1))
        if name == "encoder_std":
            return rng.uniform(0.5, 1.0, shape) * 1e-3
        if name in ("start", "pose_rate_before", "memory_before"):
            return np.zeros(shape)
        signed = name in SIGNED or "rate" in name or name.startswith(PREFIX)
        low = -1.0 if signed else 0.0
        return rng.uniform(low, 1.0, shape) * SIZES.get(name, 1.0)

    def _prescribed(self, name: str, f: Function) -> np.ndarray:
        quantity = {"s": "pose", "s1": "pose_rate", "s2": "pose_acceleration"}[name]
        labels = next(a.labels for a in f.inputs if a.name == name)
        if labels == ("x", "y", "z"):  # the landmark's path, small enough for any
            share = {"s": 0.02, "s1": 0.1, "s2": 1.0}[name] * self._scale[:1]
            return self._rng.uniform(-1, 1, (ROWS, 3)) * share
        order = ["X", "Y", "Z", "alpha", "beta", "gamma"]
        return getattr(self._path, quantity)[:, [order.index(label) for label in labels]].copy()
