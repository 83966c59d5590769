"""Efforts within limits, beside solvers of quadratic programs that are called from Python."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from condyle.distribution import Problem, distribute
from condyle.distribution.eliminated import Sample
from condyle.mechanism.chain import limits
from condyle.mechanism.mechanism import Mechanism
from condyle.model.model import Model

from .peers.solvers import SOLVERS
from .rows import Probe

DIFFERENT = 1e-3  # of the largest effort: less, and a solver has solved the same program
BINDING = "bounded where limits bind"
PROGRAMS = 16  # that others solve, one after the other


Given = tuple[np.ndarray, ...]  # q, v, a, wrench, point


@dataclass(frozen=True)
class Bites:
    """Samples of a mechanism whose limits bind, and how they are called."""

    label: str
    model: Model
    given: Given

    def ours(self) -> float:
        """Seconds a sample of `inverse_dynamics`, from q to efforts."""
        start = time.perf_counter()
        self.model.inverse_dynamics(*self.given, threads=1)
        return (time.perf_counter() - start) / len(self.given[0])

    def programs(self) -> tuple[list[Sample], np.ndarray]:
        """Some of the programs, contacts eliminated, and the x that solve them, (R, n)."""
        rows = np.linspace(0, len(self.given[0]) - 1, PROGRAMS).astype(int)
        q, q1, q2, wrench, point = (a[rows] for a in self.given)
        model, outputs = self.model, ("pose", "pose_rate", "pose_acceleration")
        at = model.inverse_dynamics(q, q1, q2, wrench, point, outputs=outputs)
        ports = {"pose": at.pose, "pose_rate": at.pose_rate}
        ports |= {"pose_acceleration": at.pose_acceleration}
        ports |= {"force": wrench[:, :3], "moment": wrench[:, 3:], "point": point}
        s = {k: np.moveaxis(a, -1, 0) for k, a in model.kernel("balance").run(ports).values.items()}
        both = [limits(chain) for chain in model.mechanism.chains]
        low, high = (np.array([getattr(x, name) for x in both]) for name in ("low", "high"))
        push = [c.push if c.one_sided else 0.0 for c in model.mechanism.contacts]
        J, contacts = s["J"].transpose(0, 2, 1), s["normal"]
        problem = Problem(s["Q"], J, contacts, low=low, high=high, push=np.array(push))
        found = distribute(problem, "bounded")
        none, one = np.zeros(problem.k), np.ones(problem.n)
        good = np.flatnonzero(found.status == 0)
        samples = [Sample.of(problem, int(i), none, one, 0.0, True) for i in good]
        regular = [s for s in samples if s is not None]
        assert len(regular) == len(good)
        units = np.array([s.unit for s in regular])
        return regular, found.effort[good] / units[:, None]


def program_probes(bites: Bites, unavailable: dict[str, str]) -> Iterator[Probe]:
    """Our row, and one of each solver that is installed."""
    label = f"{bites.label}: {BINDING}"
    yield Probe(label, bites.ours, 0.0)
    programs, right = bites.programs()
    given = [_arguments(s) for s in programs]
    for name, solve in SOLVERS.items():
        try:
            got = np.array([solve(*one) for one in given])
        except ImportError as problem:
            unavailable[name] = str(problem)
            continue
        error = float(np.abs(got - right).max() / np.abs(right).max())
        probe = Probe(f"{label}, {name}", partial(_seconds, solve, given), error)
        yield replace(probe, tolerance=DIFFERENT, note="the program alone, from Python")


def _arguments(s: Sample) -> tuple[np.ndarray, ...]:
    m, c = s.m, s.right[s.m :]
    bounds = c - s.contact_high, c - s.contact_low
    one = (s.G[:m], s.right[:m], s.low, s.high, s.G[m:], *bounds)
    return tuple(np.ascontiguousarray(a) for a in one)


def _seconds(solve: Callable[..., np.ndarray], given: list[tuple[np.ndarray, ...]]) -> float:
    start = time.perf_counter()
    for one in given:
        solve(*one)
    return (time.perf_counter() - start) / len(given)


def tight(mechanism: Mechanism, limit: float) -> Mechanism:
    """The mechanism with limits on all efforts."""
    own = {"torque_limit": limit}
    chains = [
        chain.model_copy(update={"actuator": chain.actuator.model_copy(update=own)})
        for chain in mechanism.chains
    ]
    return mechanism.replace(chains=tuple(chains))
