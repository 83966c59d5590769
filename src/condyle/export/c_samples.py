"""Recorded test vectors: arguments, and what the library answers to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..backends.numpy_kernel import NumpyKernel
from ..mechanism.home import characteristic_length, independent_coordinates
from ..mechanism.mechanism import Mechanism
from ..questions import Question
from ..questions.numbers import Layout, specialised
from ..questions.structure import structure_of
from ..status import Status
from .c_expected import Reference
from .exported import Exported, Function

COUNT = 40
SIZES = {"force": 20.0, "moment": 0.5, "point": 0.05, "kp": 400.0, "kd": 40.0, "period": 1e-3}
SIZES |= {"resolution": 1e-5, "smoothing": 0.9, "stiffness": 100.0, "damping": 10.0}
SIGNED = ("force", "moment", "point", "direction")
WIDTH = 0.1  # of states about home, in characteristic lengths and radians, halved until most reach


@dataclass(frozen=True)
class Vectors:
    """Samples of one function.

    given, right: argument -> (N, size);  status: (N,).
    """

    function: Function
    given: dict[str, np.ndarray]
    right: dict[str, np.ndarray]
    status: np.ndarray


def vectors(
    exported: Exported, mechanism: Mechanism, reference: Reference, count: int = COUNT
) -> list[Vectors]:
    """Seeded samples about home, home itself, and some that have to fail."""
    draw = Samples(mechanism, reference, np.random.default_rng(0), count)
    found = []
    for f in exported.functions:
        given = {a.name: _rounded(draw(a.name, a.size, f), exported) for a in f.inputs}
        _spoil(given)
        right, status = reference(f.question, given)
        good = (status == Status.ok)[:, None]
        right = {a.name: np.where(good, right[a.name], 0.0) for a in f.outputs}
        found.append(Vectors(f, given, right, status))
    return found


def _rounded(a: np.ndarray, exported: Exported) -> np.ndarray:
    return a if exported.precision == "double" else a.astype(np.float32).astype(float)


def _spoil(given: dict[str, np.ndarray]) -> None:
    """The last samples fail: out of reach, no number, infinite."""
    first = next(name for name in ("q", "s", "joint") if name in given)
    given[first][-1] *= 1e3
    given[first][-1] += 7.0
    given[first][-2, 0] = np.nan
    given[list(given)[-1]][-3, -1] = np.inf


class Samples:
    """Arguments by name, (N, size) each, that belong to states which can be reached."""

    def __init__(
        self, mechanism: Mechanism, reference: Reference, rng: np.random.Generator, count: int
    ) -> None:
        self._mechanism, self._reference, self._rng, self._count = mechanism, reference, rng, count
        length = characteristic_length(mechanism)
        names = independent_coordinates(mechanism)
        self._scale = np.array([length if n in "XYZ" else 1.0 for n in names])
        self.q, self.pose = self._states()

    def _states(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """q about home, (N, m), home first, and poses and rates that belong to them."""
        width, m = WIDTH, len(self._scale)
        while True:
            q = self._rng.uniform(-width, width, (4 * self._count, m)) * self._scale
            q[0] = 0.0
            zero = np.zeros((len(q), 3))
            given = {"q": q, "q1": 0 * q, "q2": 0 * q, "force": zero, "moment": zero, "point": zero}
            good = np.flatnonzero(self._sure(given))[: self._count]
            if len(good) == self._count:
                break
            width /= 2
        q = q[good]
        q1, q2 = (self._rng.uniform(-1, 1, q.shape) * self._scale * k for k in (1.0, 10.0))
        self._rates = q1, q2
        return q, self._reference("motion", {"q": q, "q1": q1, "q2": q2})[0]

    def _sure(self, given: Mapping[str, np.ndarray]) -> np.ndarray:
        """Where the kernels' own code can vouch for efforts, as the C is: no path to follow."""
        return self._reference.model.kernel("inverse", ("contact",)).run(given).status == Status.ok

    def __call__(self, name: str, size: int, f: Function) -> np.ndarray:
        """Numbers for an argument of a function."""
        q1, q2 = self._rates
        rng, shape = self._rng, (self._count, size)
        known = {"q": self.q, "q_d": self.q + 0.01 * self._scale * rng.uniform(-1, 1, self.q.shape)}
        known |= {"q1": q1, "q1_d": 0.9 * q1, "q2": q2, "q2_d": q2}
        if name in known:
            return known[name].copy()
        if name in ("s", "s1", "s2"):
            return self._prescribed(name, f)
        if name.startswith("joint") and "rate" not in name:
            return self._joints() * (0.98 if name == "joint_before" else 1.0)
        if name == "pose_before":  # where `joint` is, but for the last period's way
            return 0.98 * self._near()["pose"]
        if name in ("start", "pose_rate_before", "memory_before"):
            return np.zeros(shape)
        low = -1.0 if name in SIGNED or "rate" in name else 0.0
        return rng.uniform(low, 1.0, shape) * SIZES.get(name, 1.0)

    def _prescribed(self, name: str, f: Function) -> np.ndarray:
        quantity = {"s": "pose", "s1": "pose_rate", "s2": "pose_acceleration"}[name]
        labels = next(a.labels for a in f.inputs if a.name == name)
        if labels == ("x", "y", "z"):  # the landmark's path, small enough for any
            share = {"s": 0.02, "s1": 0.1, "s2": 1.0}[name] * self._scale[:1]
            return self._rng.uniform(-1, 1, (self._count, 3)) * share
        order = ["X", "Y", "Z", "alpha", "beta", "gamma"]
        return self.pose[quantity][:, [order.index(label) for label in labels]].copy()

    def _near(self) -> dict[str, np.ndarray]:
        """Poses on the way to those of `q`."""
        zero = np.zeros_like(self.q)
        return self._reference("motion", {"q": 0.3 * self.q, "q1": zero, "q2": zero})[0]

    def _joints(self) -> np.ndarray:
        """Joint coordinates of poses half-way to home: Newton's reach."""
        structure = structure_of(self._mechanism)
        numbers = Layout.of(structure).numbers(self._mechanism)
        question = Question.about(specialised(structure, numbers), "encoders")
        kernel = NumpyKernel(question.variants(), numbers)
        return kernel.run({"pose": self._near()["pose"]}).values["joint"].T.copy()
