"""Random mechanisms with actuators and friction, states of them, and their equations by numpy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from oracles.random_mechanism import random_mechanism, random_state, toml_text
from oracles.rubbing import Balance, balance

from condyle.mechanism import Mechanism, parse

Array = np.ndarray


@dataclass(frozen=True)
class Rubbing:
    """A mechanism and N of its states."""

    raw: dict[str, Any]
    states: dict[str, Any]

    @cached_property
    def mechanism(self) -> Mechanism:
        return parse(toml_text(self.raw))

    @property
    def arguments(self) -> tuple[Array, Array, Array, Array, Array]:
        """Of inverse dynamics: q, v, a, wrench and point."""
        q, q1, q2, load = self.packed
        return q, q1, q2, load[:, :6], load[:, 6:]

    @property
    def packed(self) -> tuple[Array, Array, Array, Array]:
        """With wrench and point in one array, (N, 9)."""
        s = self.states
        point = self.mechanism.platform.points[s["load_point"]]
        load = np.hstack([s["wrench"], np.tile(point, (len(s["wrench"]), 1))])
        return s["q"], s["qd"], s["qdd"], load

    def balances(self) -> Iterator[Balance]:
        s = self.states
        names = ("pose", "pose_rate", "pose_acceleration", "wrench")
        for row in zip(*(s[name] for name in names), strict=True):
            yield balance(self.raw, *row, s["load_point"])

    def still(self) -> Rubbing:
        """The same poses at rest, under the same loads."""
        names = ("qd", "qdd", "pose_rate", "pose_acceleration")
        return Rubbing(self.raw, self.states | {name: 0 * self.states[name] for name in names})


def drawn(
    seed: int,
    count: int = 6,
    mu: float = 0.25,
    lossy: bool = True,
    limit: float | None = None,
    one_sided: bool = False,
    **options: Any,
) -> Rubbing:
    """A random mechanism, all of whose contacts have friction.

    Args: mu: the coefficients are up to 1.5 of it, and at least half; limit: of all efforts, in
          times of what a joint typically needs; options: as of `random_mechanism`.
    """
    rng = np.random.default_rng(seed)
    raw = random_mechanism(rng, **{"condition": 100.0, **options})
    for contact in raw.get("contact", []):
        if mu:
            friction = {"coefficient": mu * rng.uniform(0.5, 1.5)}
            friction["smoothing_speed"] = 10 ** rng.uniform(-4, -2)
            contact["friction"] = friction
        if one_sided:
            contact["one_sided"] = True
            contact.setdefault("side", "above" if "slope" in contact["surface"] else "outside")
    for chain in raw["chain"]:
        turns = chain["kind"] == "RSS"
        own: dict[str, Any] = {}
        if lossy:
            size = 1.0 if turns else 50.0
            own = {"viscous": size * rng.uniform(0, 0.02), "coulomb": size * rng.uniform(0, 0.05)}
            own |= {"rotor_inertia": rng.uniform(0, 2e-6), "gear": rng.uniform(5, 20)}
            if not turns:
                own["gear"] = own["gear"] * 50
            own["smoothing_speed"] = 10 ** rng.uniform(-3, -1)
        if limit is not None:
            greatest = limit * (0.2 if turns else 10.0) * rng.uniform(0.8, 1.2)
            least = 0.0 if chain["kind"] == "cable" else -greatest * rng.uniform(0.5, 1)
            own["torque_limit" if turns else "force_limit"] = [float(least), float(greatest)]
        if own:
            chain["actuator"] = {k: v if isinstance(v, list) else float(v) for k, v in own.items()}
    return Rubbing(raw, random_state(rng, raw, count))


def balanced(case: Rubbing, seed: int, greatest: float) -> Rubbing:
    """The same states under loads that known efforts, all of them pulls, and pushes balance."""
    rng, s = np.random.default_rng(seed), case.states
    loads = np.empty_like(s["wrench"])
    for i in range(len(loads)):
        state = (s[name][i] for name in ("pose", "pose_rate", "pose_acceleration"))
        pose, rate, second = state
        none, *units = (
            balance(case.raw, pose, rate, second, w, s["load_point"])
            for w in (np.zeros(6), *np.eye(6))
        )
        slope = np.column_stack([u.b - none.b for u in units])
        n, k = none.C.shape[1], none.N.shape[1]
        held = none.C @ rng.uniform(0.05, 0.6, n) * greatest
        held += none.along(np.ones(k, dtype=int)) @ rng.uniform(1, 5, k)
        loads[i] = np.linalg.solve(slope, held - none.b)
    return Rubbing(case.raw, s | {"wrench": loads})
