"""Many mechanisms of one structure asked together: samples carry the number of their mechanism."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np

from ..backends.kernel import VARIANT, Arrays, KernelValues, sample_rows
from ..graph.program import Numbers
from ..mechanism.mechanism import Mechanism
from ..questions.numbers import Layout, agree
from ..questions.structure import Structure
from .closing import Closure, PlatformMotion
from .distributing import Distributor
from .inverse_dynamics import InverseDynamics
from .overlapping import ContactBall, balls
from .robust_path import Robust
from .system import System

KEPT = 64  # systems at hand
Mechanisms = Callable[[int], Mechanism]
Points = Callable[[str], np.ndarray]


class ManySystem(System):
    """What `System` is of one mechanism. Samples come in whole rows of mechanisms, V N of them, or
    with an input `variant`.

    length: characteristic lengths, (V,) [m].
    """

    length: Any

    def __init__(
        self, base: System, numbers: Numbers, mechanism: Mechanisms, points: Points
    ) -> None:
        """Args: mechanism: each, for samples that no kernel can vouch for.
        points: of the platform, by name: of every mechanism, (V, 3) [m].
        """
        self.__dict__.update(
            (name, value) for name, value in vars(base).items() if not name.startswith("_")
        )
        shares = agree(base.structure, numbers)
        self._base = base if shares else base.serving_all
        self.structure: Structure = self._base.structure
        self.many: Numbers = numbers
        self._mechanism, self._points = mechanism, points
        self.one: Callable[[int], System] = lru_cache(KEPT)(self._lent)
        self._asked: dict[Any, Any] = {}
        place = Layout.of(self.structure).parameters["length"][0]
        self.length = numbers.parameters[:, place]

    def under(self, given: Sequence[str]) -> ManySystem:
        other = copy(self)
        other.__dict__.pop("robust", None)
        other._base = self._base.under(given)
        other.structure, other._asked = other._base.structure, {}
        other.one = lru_cache(KEPT)(other._lent)
        return other

    def _lent(self, i: int) -> System:
        return self._base.lent(self._mechanism(i), self.many.single(i))

    def kernel(self, question: str, *details: Any) -> Any:
        key = question, details
        if key not in self._asked:
            self._asked[key] = self._base.kernel(question, *details).renumbered(self.many)
        return self._asked[key]

    def closure(self, names: tuple[str, ...], landmark: str | None) -> Any:
        key = names, landmark
        if key not in self._asked:
            numbers = self.many
            if landmark is not None:
                start, count = Layout.of(self.structure).parameters["landmark"]
                numbers = copy(numbers)
                parameters = numbers.parameters.copy()
                parameters[:, start : start + count] = self._points(landmark)
                object.__setattr__(numbers, "parameters", parameters)
            closure = self._base.closure(names, landmark)
            if not agree(closure.structure, numbers):
                closure = self._base.serving_all.closure(names, landmark)
            own = lambda i: self.one(i).closure(names, landmark)  # noqa: E731
            self._asked[key] = ManyClosure(closure, numbers, own)
        return self._asked[key]

    @cached_property
    def _balls(self) -> tuple[ContactBall, ...]:
        return balls(self.structure, self.many.parameters, self.mechanism.contacts)

    @cached_property
    def robust(self) -> Any:
        return RobustPaths(lambda i: self.one(i).robust)

    def labels(self, count: int) -> Arrays:
        return {VARIANT: np.repeat(np.arange(len(self.many)), count // len(self.many))}

    def lengths(self, inputs: Mapping[str, np.ndarray]) -> Any:
        return self.length[inputs[VARIANT]]


class RobustPaths:
    """The functions of a `Robust`, of samples of several mechanisms: one after the other."""

    def __init__(self, one: Callable[[int], Robust]) -> None:
        self._one = one

    def __getattr__(self, name: str) -> Callable[[Mapping[str, np.ndarray]], Any]:
        return partial(self._asked, name)

    def _asked(self, name: str, inputs: Mapping[str, np.ndarray]) -> Any:
        which = inputs[VARIANT]
        order = np.argsort(which, kind="stable")
        found = []
        for i in np.unique(which).tolist():
            few = sample_rows(inputs, np.flatnonzero(which == i), len(which))
            found.append(getattr(self._one(i), name)(few))
        return _joined(found, np.argsort(order))


def _joined(parts: list[Any], order: np.ndarray) -> Any:
    """Arrays with samples last, dicts and tuples of them, in the order of the samples."""
    first = parts[0]
    if isinstance(first, dict):
        return {name: _joined([one[name] for one in parts], order) for name in first}
    if isinstance(first, tuple):
        return tuple(_joined(list(own), order) for own in zip(*parts, strict=True))
    return np.concatenate(parts, axis=-1)[..., order]


class ManyClosure:
    """What `Closure` is of one mechanism, of the same N conditions for each: (V N, 6)."""

    def __init__(self, closure: Closure, numbers: Numbers, one: Callable[[int], Closure]) -> None:
        self.names: tuple[str, ...] = closure.names
        self._count = len(numbers)
        self._kernel = closure.kernel.renumbered(numbers)
        self._followed = RobustPaths(lambda i: _Followed(one(i)))  # type: ignore[arg-type, return-value]

    def solve(
        self, s: np.ndarray, s1: np.ndarray, s2: np.ndarray, threads: int | None = None
    ) -> PlatformMotion:
        """X_EE and its rates where g = s, g' = s1, g'' = s2, (N, 6 - k) each, mechanism by
        mechanism."""
        conditions = {"s": s, "s1": s1, "s2": s2}
        inputs = {name: np.tile(a, (self._count, 1)) for name, a in conditions.items()}
        inputs[VARIANT] = np.repeat(np.arange(self._count), len(s))
        answer: KernelValues = self._kernel.run(inputs, threads)
        answer.mend(inputs, self._followed.solve)
        return PlatformMotion.of(answer)


class _Followed:
    def __init__(self, closure: Closure) -> None:
        self._closure = closure

    def solve(self, few: Mapping[str, np.ndarray]) -> tuple[Arrays, np.ndarray]:
        return self._closure.followed.solve(few["s"], few["s1"], few["s2"]).answer()


class ManyInverse(InverseDynamics):
    """Inverse dynamics of many; `distributor_of`: each mechanism's own, where they differ."""

    distributor_of: Callable[[int], Distributor] | None = None

    def _redistribute(
        self,
        distributor: Distributor,
        values: Mapping[str, np.ndarray],
        status: np.ndarray,
        inputs: Mapping[str, np.ndarray],
    ) -> None:
        if self.distributor_of is None:
            super()._redistribute(distributor, values, status, inputs)
            return
        which = inputs[VARIANT]
        for i in np.unique(which).tolist():
            rows = np.flatnonzero(which == i)
            part = slice(rows[0], rows[-1] + 1)
            own = {name: a[..., part] for name, a in values.items()}
            few = sample_rows(inputs, rows, len(which))
            super()._redistribute(self.distributor_of(i), own, status[part], few)
