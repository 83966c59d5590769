"""What a peer is: another engine that solves the same problem, and how it is asked and timed."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from .mechanism import Array

REPEAT_SECONDS = 1e-3  # short, so that most repeats escape whatever else the machine does


class PeerError(Exception):
    """A peer that is there but cannot be built or started; the message says what was tried."""


class Peer(ABC):
    """Inverse dynamics, closure included: independent (q, q', q'') and bite force to six torques.

    Attributes:
        name: what the table calls it.
        packages: distributions that it needs, as pip names them.
        facts: after `prepare`, what the result depends on: versions, flags, seconds to be ready.
    """

    name: str
    packages: tuple[str, ...]

    def __init__(self) -> None:
        self.facts: dict[str, Any] = {}

    def available(self) -> tuple[bool, str]:
        """Whether it can run here; if not, why and what to do."""
        missing = [p for p in self.packages if _version(p) is None]
        if missing:
            names = " ".join(missing)
            return False, f"{' and '.join(missing)} not installed: pip install {names}"
        return True, ""

    def prepare(self, mechanism: dict[str, Any], workdir: Path) -> None:
        """Make ready for one mechanism, given as the dict of its TOML file.

        Raises: PeerError: if it cannot be built; ValueError: if the mechanism is of another kind.
        """
        start = time.perf_counter()
        workdir.mkdir(parents=True, exist_ok=True)
        self.facts = {"versions": {p: _version(p) for p in self.packages}}
        self._prepare(mechanism, workdir)
        self.facts["prepare_seconds"] = time.perf_counter() - start

    @abstractmethod
    def _prepare(self, mechanism: dict[str, Any], workdir: Path) -> None: ...

    @abstractmethod
    def solve(self, q: Array, qd: Array, qdd: Array, F: Array) -> Array:
        """Torques, (N, 6) N m. q, qd, qdd: (N, 4) of X, Y, alpha, beta; F: (N, 3) N in {S}."""

    @abstractmethod
    def time_one(
        self, q: Array, qd: Array, qdd: Array, F: Array, seconds: float, dependent: bool = False
    ) -> list[float]:
        """Seconds per evaluation, one per repeat, for about `seconds` in all.

        With `dependent`, each evaluation waits for the one before, as in a control loop.
        """


class PythonPeer(Peer):
    """A peer whose code for one sample is Python: its calls are always dependent."""

    @abstractmethod
    def torques(self, q: Array, qd: Array, qdd: Array, F: Array) -> Array:
        """Torques of one sample, (6,)."""

    def solve(self, q: Array, qd: Array, qdd: Array, F: Array) -> Array:
        return np.array([self.torques(*sample) for sample in zip(q, qd, qdd, F, strict=True)])

    def time_one(
        self, q: Array, qd: Array, qdd: Array, F: Array, seconds: float, dependent: bool = False
    ) -> list[float]:
        samples = list(zip(q, qd, qdd, F, strict=True))

        def run(count: int) -> float:
            start = time.perf_counter()
            for i in range(count):
                self.torques(*samples[i % len(samples)])
            return time.perf_counter() - start

        return repeats(run, seconds)


def repeats(run: Callable[[int], float], seconds: float) -> list[float]:
    """Seconds per evaluation of repeats long enough for the clock.

    Args: run: does so many evaluations and returns the seconds they took.
    """
    count = 1
    while (elapsed := run(count)) < REPEAT_SECONDS / 2:  # warms up as well
        count = max(2 * count, int(count * REPEAT_SECONDS / max(elapsed, 1e-9) / 2))
    number = max(3, round(seconds / elapsed))
    return [run(count) / count for _ in range(number)]


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
