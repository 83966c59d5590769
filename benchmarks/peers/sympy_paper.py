"""SymPy as the paper's own way: symbolic derivation, then numeric functions in Python."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from .base import PythonPeer
from .mechanism import Array, Chain, Mechanism, read


class SympyPaper(PythonPeer):
    """Generalized momentum, Model 2, stage by stage as the paper writes it.

    Args: cse: let `lambdify` share common subexpressions; the paper's way does not.
    """

    packages = ("sympy",)

    def __init__(self, cse: bool) -> None:
        super().__init__()
        self.name = "SymPy, lambdify with cse" if cse else "SymPy, lambdify"
        self._cse = cse

    def _prepare(self, mechanism: dict[str, Any], workdir: Path) -> None:
        import sympy as sp

        from . import sympy_derivation as derivation

        numbers = read(mechanism)
        start = time.perf_counter()
        stages = {
            "contacts": derivation.contacts(numbers),
            "platform": derivation.platform(numbers),
            "chain": derivation.chain(),
        }
        derived = time.perf_counter()

        def function(stage: Any) -> Callable[..., Array]:
            shape = stage.values.shape
            call = sp.lambdify(stage.arguments, list(stage.values), modules="math", cse=self._cse)
            return lambda *arguments: np.array(call(*arguments)).reshape(shape).squeeze()

        self._f = {
            room: {name: function(stage) for name, stage in named.items()}
            for room, named in stages.items()
        }
        self.facts["derivation_seconds"] = derived - start
        self.facts["lambdify_seconds"] = time.perf_counter() - derived
        self._constants = [_constants(c, numbers) for c in numbers.chains]

    def torques(self, q: Array, qd: Array, qdd: Array, F: Array) -> Array:
        contacts, platform, chain = (self._f[room] for room in ("contacts", "platform", "chain"))
        X, M_J = contacts["pose"](q), contacts["M_J"](q)
        X_d = M_J @ qd
        X_dd = M_J @ qdd + contacts["M_J'"](q, qd) @ qd
        X_, X_d_ = X.tolist(), X_d.tolist()
        force = platform["force"](X_, X_d_, X_dd.tolist()) - platform["bite"](X_) @ F
        J_theta = np.empty((6, 6))
        for i, constants in enumerate(self._constants):
            theta = float(chain["theta"](X_, constants))
            q_r = [theta, *chain["turns"](X_, theta, constants).tolist()]
            M_3 = chain["M_3"](X_, q_r, constants)
            q_r_d = M_3 @ X_d
            M_3_d = chain["M_3'"](X_, X_d_, q_r, q_r_d.tolist(), constants)
            q_r_dd = M_3 @ X_dd + M_3_d @ X_d
            force += M_3.T @ chain["force"](q_r, q_r_d.tolist(), q_r_dd.tolist(), constants)
            J_theta[i] = M_3[0]
        A = J_theta @ M_J
        return A @ np.linalg.solve(A.T @ A, M_J.T @ force)


def _constants(c: Chain, m: Mechanism) -> list[float]:
    """Numbers for `sympy_derivation.CONSTANTS`: vectors of the chain along N_i0, N_i0, scalars."""
    local = [c.N.T @ v for v in (c.base, c.u, c.w)]
    columns = [*c.N.T]
    scalars = [c.crank, c.coupler, c.branch, c.crank_inertia, c.mass, c.com, c.transverse, c.axial]
    parts = [*local, c.joint, *columns, c.N.T @ m.gravity, scalars]
    return [float(v) for v in np.concatenate(parts)]
