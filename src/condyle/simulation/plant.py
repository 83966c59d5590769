"""The mechanism as a system of first order: y' = f(t, y) with y = (q, q', works)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..backends.kernel import AGAIN
from ..mechanism.mechanism import Mechanism
from ..model.evaluator import Evaluator
from ..results.contacts import bound_margins
from ..status import Status
from .integrators import Stuck
from .loads import BoundLoad
from .plan import WORKS
from .point import Instant
from .single import Single

Floats = Sequence[float]


class Plant:
    """Kernels and loads of one run. It looks at one state at a time."""

    def __init__(self, model: Evaluator, loads: Sequence[BoundLoad]) -> None:
        self._model = model
        self._m = len(model.independent)
        self._instant = Instant(model)
        self._forward = Single(model.kernel("forward", ("contact",)))
        self.loads = loads
        self._zero = np.zeros(3)
        self._lossy = bool(model.mechanism.contacts)

    @property
    def loads(self) -> Sequence[BoundLoad]:
        """What acts on the platform."""
        return self._loads

    @loads.setter
    def loads(self, loads: Sequence[BoundLoad]) -> None:
        self._loads = loads
        self._points = [tuple(load.point.tolist()) for load in loads]

    # -- a state --------------------------------------------------------------------------

    def look(self, q: np.ndarray, q1: np.ndarray) -> Instant:
        """Where everything is; valid until the next look.

        Raises: Stuck: where it cannot be.
        """
        status = self._instant(q, q1)
        if status:
            raise Stuck(Status.unreachable if status == AGAIN else status)
        return self._instant

    @property
    def last(self) -> Instant:
        """The last look."""
        return self._instant

    def places(self) -> list[tuple[Floats, Floats, Floats]]:
        """Of every load at the last look: s and v of its point, and its lever from O_M [m, m/s]."""
        if not self._loads:
            return []
        x = self._instant["pose"].tolist()
        R = self._instant["R"].tolist()
        V = self._twist
        found: list[tuple[Floats, Floats, Floats]] = []
        for p in self._points:
            r = [row[0] * p[0] + row[1] * p[1] + row[2] * p[2] for row in R]
            s = (x[0] + r[0] - p[0], x[1] + r[1] - p[1], x[2] + r[2] - p[2])
            v = (
                V[0] + V[4] * r[2] - V[5] * r[1],
                V[1] + V[5] * r[0] - V[3] * r[2],
                V[2] + V[3] * r[1] - V[4] * r[0],
            )
            found.append((s, v, r))
        return found

    def wrench(self, t: float, modes: Floats) -> np.ndarray:
        """Of all loads at the last look, about O_M, (6,) [N, N m] in {S}."""
        total = np.zeros(6)
        for load, mode, (s, v, r) in zip(self._loads, modes, self.places(), strict=True):
            f = load.law(t, s, v, int(mode))
            total[0] += f[0]
            total[1] += f[1]
            total[2] += f[2]
            total[3] += r[1] * f[2] - r[2] * f[1]
            total[4] += r[2] * f[0] - r[0] * f[2]
            total[5] += r[0] * f[1] - r[1] * f[0]
            if len(f) == 6:
                total[3:] += f[3:]
        return total

    def force_at(self, place: str | None, t: float, modes: Floats) -> np.ndarray:
        """Of the loads at a named point, at the last look, (3,) [N] in {S}."""
        total = np.zeros(3)
        for load, mode, (s, v, _) in zip(self._loads, modes, self.places(), strict=True):
            if place is not None and load.place == place:
                total += load.law(t, s, v, int(mode))[:3]
        return total

    @property
    def _twist(self) -> list[float]:
        return (self._instant["T"] @ self._q1).tolist()

    # -- its rate ---------------------------------------------------------------------------

    def accelerate(
        self, q: np.ndarray, q1: np.ndarray, effort: np.ndarray, wrench: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """q'' (m,) and contact forces (k,) [N], valid until the next call.

        Raises: Stuck: where there are none.
        """
        call = self._forward
        status = call(q, q1, effort, wrench[:3], wrench[3:], self._zero)
        if status == AGAIN:
            load = np.concatenate([wrench, self._zero])
            found = self._model.forward(q[None], q1[None], effort[None], load[None])
            if found.status[0]:
                raise Stuck(int(found.status[0]))
            return found.acceleration[0], found.contact_force[0]
        if status:
            raise Stuck(status)
        return call["acceleration"], call["contact_force"]

    def state(self, t: float, y: np.ndarray, modes: Floats) -> np.ndarray:
        """Look at y, and the loads' wrench there."""
        m = self._m
        self._q1 = y[m : 2 * m]
        self.look(y[:m], self._q1)
        return self.wrench(t, modes)

    def rate(self, t: float, y: np.ndarray, effort: np.ndarray, modes: Floats) -> np.ndarray:
        """y', from the efforts as they act."""
        wrench = self.state(t, y, modes)
        return self.rate_here(y, effort, wrench)

    def rate_here(self, y: np.ndarray, effort: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """y' at the state that was looked at last."""
        m, at = self._m, self._instant
        acceleration, force = self.accelerate(y[:m], y[m : 2 * m], effort, wrench)
        found = np.empty(2 * m + len(WORKS))
        found[:m] = y[m : 2 * m]
        found[m : 2 * m] = acceleration
        found[2 * m] = effort @ at["joint_rate"]
        found[2 * m + 1] = wrench @ (at["T"] @ y[m : 2 * m])
        found[2 * m + 2] = at["loss"].sum()
        found[2 * m + 3] = np.abs(force) @ at["rub"] if self._lossy else 0.0
        return found

    # -- what is watched ----------------------------------------------------------------------

    def margins(self, mechanism: Mechanism) -> np.ndarray:
        """Distance of every contact point to its nearest bound at the last look, (k,) [m]."""
        return bound_margins(mechanism, self._instant["contact_point"][None])[0]
