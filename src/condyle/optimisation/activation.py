"""Muscles in a cycle: activations at the nodes, excitations that are constant between them.

    a_(i+1) - a_i = h rate((a_i + a_(i+1)) / 2, e_i)

The rate is that of `questions.excitation`; the rule is the implicit midpoint one, of second order.
Tensions follow from the activations (`questions.activated`), so balance is a constraint.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

from ..backends.kernel import OK
from ..kinematics.chain.muscle import muscles
from ..mechanism.chain import limits
from ..model.model import Model
from ..questions.excitation import NUMBERS, SMOOTHING, muscle_numbers

Array = np.ndarray
PORTS = {"q": "q", "v": "q1", "a": "q2", "w": "activation"}
SMALL = 1e-3  # weight of activations against the balance, at a start


class Activation:
    """Unknowns w (n,) of a node: activations of muscles, efforts over `scale` of other chains.

    names: of their limits;  low, high: those limits;  mine: which are of muscles.
    """

    low: np.ndarray
    high: np.ndarray

    def __init__(self, model: Model, activation: tuple[float, float], share: float) -> None:
        """Args: activation: least and greatest;  share: part of each limit of other chains."""
        machine = model.mechanism
        chains = machine.chains
        self.model: Model = model
        self.n: int = len(chains)
        self.mine: list[int] = muscles(chains)
        self.names: tuple[str, ...] = tuple(f"activation of {name}" for name in machine.chain_names)
        self.numbers: np.ndarray = muscle_numbers(chains)
        self.low, self.high = np.full((self.n, 2), activation).T
        for i, chain in enumerate(chains):
            if i not in self.mine:
                own = limits(chain)
                ends = np.abs(own[:2])
                scale = ends[np.isfinite(ends)].max(initial=0.0) or 1.0
                self.numbers[0, i] = scale
                self.low[i], self.high[i] = np.array(own.part(share)[:2]) / scale
        rise, fall = (
            self.numbers[NUMBERS.index(f"{x}_time")] for x in ("activation", "deactivation")
        )
        self.rise: np.ndarray = rise[self.mine]
        self.fall: np.ndarray = fall[self.mine]
        home = np.zeros((3, 1, len(model.independent)))
        by_w = self.slopes(home, np.zeros((1, self.n)), None, None)["balance", "w"]
        self.scale: np.ndarray = np.linalg.norm(by_w[0], axis=1)  # of the balance

    def _ports(self, q: Array, v: Array, a: Array, w: Array, wrench: Any, at: Any) -> Any:
        """As the kernel takes them, of states (..., N, m)."""
        lead, count = q.shape[:-1], q[..., 0].size
        wrench = np.zeros(6) if wrench is None else wrench
        rows = np.broadcast_to(wrench, (*lead, 6)).reshape(count, 6)
        w = np.broadcast_to(w, (*lead, self.n)).reshape(count, self.n)
        ports = {"q": q, "q1": v, "q2": a}
        ports = {name: one.reshape(count, -1) for name, one in ports.items()}
        point = np.zeros(3) if at is None else at
        ports |= {"force": rows[:, :3], "moment": rows[:, 3:], "point": point[None]}
        return ports | {"activation": w, "muscle": self.numbers[None]}

    def outputs(
        self, q: Array, v: Array, a: Array, w: Array, wrench: Any, at: Any
    ) -> tuple[dict[str, Array], Array]:
        """Balance, contact forces and activations, and where they are known."""
        kernel = self.model.system.kernel("activated")
        answer = kernel.run(self._ports(q, v, a, w, wrench, at))
        found = {name: np.moveaxis(one, -1, 0) for name, one in answer.values.items()}
        return found | {"activation": w}, answer.status == OK

    def slopes(self, z: Array, w: Array, wrench: Any, at: Any) -> dict[tuple[str, str], Array]:
        """Slopes of all of them by q, v, a, w, of states (3, ..., N, m): (..., N, r, size)."""
        of = ("balance", "contact_force")
        kernel = self.model.system.derivative("slopes", "activated", tuple(PORTS.values()), of)
        values = kernel.run(self._ports(z[0], z[1], z[2], w, wrench, at)).values
        lead, blocks = z.shape[1:-1], {}
        for name in of:
            for by, port in PORTS.items():
                one = values[f"{name}/{port}"]
                one = one[:, 0] if by == "w" else one
                blocks[name, by] = np.moveaxis(one, -1, 0).reshape(*lead, *one.shape[:2])
        unit = np.broadcast_to(np.eye(self.n), (*lead, self.n, self.n))
        return blocks | {("activation", "w"): unit}

    def balancing(self, q: Array, v: Array, a: Array, wrench: Any, at: Any) -> Array:
        """Small activations that balance nearly, (N, n)."""
        none = np.zeros((len(q), self.n))
        left = self.outputs(q, v, a, none, wrench, at)[0]["balance"] / self.scale
        by_w = self.slopes(np.stack([q, v, a]), none, wrench, at)["balance", "w"]
        excitation = np.empty_like(none)
        if not np.isfinite(by_w).all():
            return none
        for i, own in enumerate(by_w / self.scale[:, None]):
            A = np.vstack([own, SMALL * np.eye(self.n)])
            b = np.concatenate([-left[i], np.zeros(self.n)])
            excitation[i] = lsq_linear(A, b, (self.low, self.high)).x
        return excitation

    def spread(self, excitation: Array) -> Array:
        """(N, M) as (N, n), NaN for chains without."""
        found = np.full((len(excitation), self.n), np.nan)
        found[:, self.mine] = excitation
        return found

    # -- the dynamics: steps (N, M), of activations w (N, n) and excitations (N, M) -----------

    def steps(self, w: Array, e: Array, h: float) -> Array:
        """What is left of them."""
        a = w[:, self.mine]
        after: Array = np.roll(a, -1, axis=0)
        return after - a - h * self._rate((a + after) / 2, e)[0]

    def by_own(self, w: Array, e: Array, h: float, share: float, free: bool) -> Array:
        """Slopes by activation here and at the next node, excitation, the share where it is free;
        h: at a share of one."""
        a = w[:, self.mine]
        f, by_a, by_e, *_ = self._rate((a + np.roll(a, -1, axis=0)) / 2, e)
        half, step = 0.5 * share * h * by_a, share * h
        found = [-1 - half, 1 - half, -step * by_e]
        return np.stack(found + [-h * f] * free, axis=-1)

    def curved(
        self, w: Array, e: Array, h: float, share: float, free: bool, weights: Array
    ) -> Array:
        """Second derivatives of weights (N, M) . steps, (N, M, 3 or 4, 3 or 4)."""
        a = w[:, self.mine]
        _, by_a, by_e, aa, ae, ee = self._rate((a + np.roll(a, -1, axis=0)) / 2, e)
        H = np.zeros((*a.shape, 3 + free, 3 + free))
        H[..., :2, :2] = share * aa[..., None, None] / 4
        H[..., :2, 2] = H[..., 2, :2] = share * ae[..., None] / 2
        H[..., 2, 2] = share * ee
        if free:
            H[..., :2, 3] = H[..., 3, :2] = by_a[..., None] / 2
            H[..., 2, 3] = H[..., 3, 2] = by_e
        return -h * weights[..., None, None] * H

    def _rate(self, a: Array, e: Array) -> tuple[Array, ...]:
        """The rate of activation, and its derivatives by a, e, aa, ae, ee."""
        x, L = e - a, 0.5 + 1.5 * a
        t = np.tanh(SMOOTHING * x)
        s, s1 = t / 2, SMOOTHING / 2 * (1 - t * t)
        s2 = -2 * SMOOTHING * t * s1
        up, up1, up2 = x / 2 + s * x, 0.5 + s + s1 * x, 2 * s1 + s2 * x
        down, down1 = x / 2 - s * x, 0.5 - s - s1 * x
        P, D = 1 / (self.rise * L), L / self.fall
        P1, P2, D1 = -1.5 * P / L, 4.5 * P / (L * L), 1.5 / self.fall
        by_e, ee = P * up1 + D * down1, (P - D) * up2
        mixed = P1 * up1 + D1 * down1
        by_a = P1 * up + D1 * down - by_e
        aa = P2 * up - 2 * mixed + ee
        return P * up + D * down, by_a, by_e, aa, mixed - ee, ee
