"""A peer as a shared library: built from one source file, called through C entry points."""

from __future__ import annotations

import ctypes
import tempfile
from abc import abstractmethod
from pathlib import Path
from typing import Any

import numpy as np

from . import compilers
from .base import Peer, PeerError, repeats
from .mechanism import CHAINS, Array, Mechanism, read

NATIVE = Path(__file__).parent / "native"
_DOUBLES = ctypes.POINTER(ctypes.c_double)


class CompiledPeer(Peer):
    """Samples cross as rows of 15 doubles (q, q', q'', F), torques as rows of 6."""

    source: str
    title: str

    def __init__(self, family: str) -> None:
        super().__init__()
        self.family = family
        self.name = f"{self.title} ({family})"
        self._engine: int | None = None

    def available(self) -> tuple[bool, str]:
        fine, reason = super().available()
        if fine and compilers.command(self.family) is None:
            return False, compilers.HINT[self.family]
        return fine, reason

    @abstractmethod
    def _options(self) -> list[str]:
        """Include directories and libraries of the engine."""

    def _model(self, mechanism: Mechanism) -> str:
        """Text of the model file, for an engine that reads one."""
        return ""

    def _prepare(self, mechanism: dict[str, Any], workdir: Path) -> None:
        numbers = read(mechanism)
        source = NATIVE / self.source
        versions = str(self.facts["versions"])
        library, flags = compilers.build(self.family, source, self._options(), versions, workdir)
        self.facts |= {"compiler": compilers.version(self.family), "flags": " ".join(flags)}
        self._library = _load(library)
        with tempfile.TemporaryDirectory() as folder:
            model = Path(folder) / "model.xml"
            model.write_text(self._model(numbers))
            constants = _pointer(numbers.packed())
            self._engine = self._library.peer_new(constants, str(model).encode())
        if not self._engine:
            raise PeerError(f"{self.name}: the engine refuses its model of this mechanism")

    def solve(self, q: Array, qd: Array, qdd: Array, F: Array) -> Array:
        samples, tau = _rows(q, qd, qdd, F), np.empty((len(q), CHAINS))
        self._library.peer_solve(self._engine, _pointer(samples), len(samples), _pointer(tau))
        return tau

    def time_one(
        self, q: Array, qd: Array, qdd: Array, F: Array, seconds: float, dependent: bool = False
    ) -> list[float]:
        samples = _rows(q, qd, qdd, F)

        def run(count: int) -> float:
            rows = _pointer(samples)
            library = self._library
            return float(library.peer_time(self._engine, rows, len(samples), count, dependent))

        return repeats(run, seconds)

    def __del__(self) -> None:
        if self._engine:
            self._library.peer_free(self._engine)


def _load(path: Path) -> ctypes.CDLL:
    library = ctypes.CDLL(str(path))
    library.peer_new.argtypes = [_DOUBLES, ctypes.c_char_p]
    library.peer_new.restype = ctypes.c_void_p
    library.peer_free.argtypes = [ctypes.c_void_p]
    library.peer_solve.argtypes = [ctypes.c_void_p, _DOUBLES, ctypes.c_long, _DOUBLES]
    library.peer_time.argtypes = [
        ctypes.c_void_p, _DOUBLES, ctypes.c_long, ctypes.c_long, ctypes.c_int,
    ]  # fmt: skip
    library.peer_time.restype = ctypes.c_double
    return library


def _rows(q: Array, qd: Array, qdd: Array, F: Array) -> Array:
    return np.ascontiguousarray(np.hstack([q, qd, qdd, F]), dtype=float)


def _pointer(values: Array) -> Any:
    return values.ctypes.data_as(_DOUBLES)
