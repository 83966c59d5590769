"""Peers of the benchmark: other engines on the same problem, in code their own users would write.

The problem: for the reference mechanism, from independent coordinates, rates, accelerations and
bite force to the six minimum-norm torques, closure included. No peer imports condyle; each reads
the mechanism file's dict. `condyle bench` checks and times them.
"""

from __future__ import annotations

from collections.abc import Callable

from . import compilers
from .base import Peer, PeerError
from .mujoco_c import MujocoFree, MujocoTree
from .mujoco_python import MujocoPython
from .pinocchio_cpp import PinocchioDerivatives, PinocchioFree, PinocchioTree
from .pinocchio_python import PinocchioPython
from .sympy_paper import SympyPaper

__all__ = ["PEERS", "Peer", "PeerError"]


def _best() -> str:
    """The compiler for code that is mostly a library already compiled."""
    return "clang" if compilers.command("clang") else "gcc"


PEERS: dict[str, Callable[[], Peer]] = {
    "pinocchio-tree-clang": lambda: PinocchioTree("clang"),
    "pinocchio-tree-gcc": lambda: PinocchioTree("gcc"),
    "pinocchio-free-clang": lambda: PinocchioFree("clang"),
    "pinocchio-free-gcc": lambda: PinocchioFree("gcc"),
    "pinocchio-derivatives": lambda: PinocchioDerivatives(_best()),
    "mujoco-tree": lambda: MujocoTree(_best()),
    "mujoco-free": lambda: MujocoFree(_best()),
    "pinocchio-python": PinocchioPython,
    "mujoco-python": MujocoPython,
    "sympy": lambda: SympyPaper(cse=False),
    "sympy-cse": lambda: SympyPaper(cse=True),
}
