"""Inverse dynamics: efforts, and all that follows, from motions and wrenches."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from ..backends.c.compiled_kernel import CompiledKernel
from ..backends.kernel import Answer
from ..questions.inverse import OUTPUTS as ASKED
from ..status import Status
from .arguments import Arguments, requested, sample_rows
from .distributing import Distributor
from .model_result import ModelResult
from .poses import configured, singularity
from .system import System, mended
from .unchecked import Call, bound

Array = np.ndarray
MOTION = ("pose", "pose_rate", "pose_acceleration")
# What the question is asked for each output; the contact forces always come.
OUTPUTS = {
    "share": "share",
    "gravity_share": "gravity",
    **dict.fromkeys(MOTION, "motion"),
    "joint_rate": "joint",
    "joint_acceleration": "joint",
    "configuration": "configuration",
    "condition": "configuration",
    "slip": "configuration",
    "friction_force": "configuration",
    "shortfall": "contact",
}
# Those that a solution has.
SOLVED = tuple(name for name in OUTPUTS if name not in ("gravity_share", "condition"))


class InverseDynamics:
    """What efforts a motion takes; see `Model`."""

    def __init__(self, system: System, arguments: Arguments, distributor: Distributor) -> None:
        self._system, self._arguments, self.distributor = system, arguments, distributor

    def __call__(
        self, q: Any, v: Any, a: Any, wrench: Any, at: Any, outputs: Any, threads: int | None
    ) -> ModelResult:
        """As `Model.inverse_dynamics`."""
        if type(q) is np.ndarray and q.ndim == 1 and not outputs and threads is None:
            found = self._one(q, v, a, wrench, self._arguments.point(at))
            if found is not None:
                n = len(self._system.mechanism.chains)
                status = np.zeros((), np.uint8)
                return ModelResult(effort=found[:n], contact_force=found[n:], status=status)
        names = requested(outputs, OUTPUTS)
        own = self._arguments
        lead, inputs = own.samples((own.q, own.v, own.a), (q, v, a), wrench, at)
        answer = self._solve(inputs, {OUTPUTS[name] for name in names}, threads)
        values, status = answer.values, answer.status
        found = {"effort": values["effort"].T, "contact_force": values["contact_force"].T}
        if status.any():
            for value in found.values():
                value[status != Status.ok] = np.nan
        found["status"] = status
        more = {name: self._read(name, values, status) for name in names}
        return ModelResult(**found, **more).shaped(lead)

    def _read(self, name: str, values: Mapping[str, Array], status: Array) -> Any:
        """One output, samples first."""
        if name in ("share", "gravity_share"):
            return np.moveaxis(values[OUTPUTS[name]], -1, 0)
        if name == "configuration":
            return configured(values, self._system.length)
        if name == "condition":
            return singularity(values, self._system.length).condition
        if name == "shortfall":
            return values.get(name, np.where(status == Status.ok, 1.0, np.nan))
        if name not in ("slip", "friction_force"):
            return values[name].T
        force = values["contact_force"].T
        if "slip" not in values:
            # Of friction that no kernel goes through the sliding is not known.
            known = not self._system.structure.friction
            return np.full((*force.shape, 3), 0.0 if known else np.nan)
        if name == "slip":
            return np.moveaxis(values["slip"], -1, 0)
        return -np.abs(force)[..., None] * np.moveaxis(values["drag"], -1, 0)

    # -- one state ---------------------------------------------------------------------------

    @cached_property
    def _one(self) -> Call:
        """Efforts and contact forces of one state in a row; None for what is none."""
        return self._bound(True, lambda *given: None)

    def unchecked(self) -> Call:
        """As `Model.unchecked`."""
        own = self._arguments

        def checked(q: Any, v: Any, a: Any, wrench: Any = None, at: Any = None) -> Array:
            q, v, a, wrench, at = own.state(own.a, q, v, a, wrench, at)
            return self(q, v, a, wrench, at, (), None).effort

        return self._bound(False, checked)

    def _bound(self, contact: bool, otherwise: Call) -> Call:
        question, fixed = self.distributor.question(contact)
        compiled = self._system.backend.name == "compiled"
        kernel = self._system.kernel(*question) if question and compiled else None
        if not isinstance(kernel, CompiledKernel):
            return otherwise
        results = ("effort", "contact_force") if contact else ("effort",)
        return bound(kernel, len(self._system.independent), results, otherwise, fixed)

    # -- many --------------------------------------------------------------------------------

    def _solve(
        self, inputs: dict[str, Array], asked: Collection[str], threads: int | None
    ) -> Answer:
        system, chooses = self._system, self.distributor.chooses
        asked = {*asked, "contact"} | ({"motion"} if chooses else set())
        kernel = system.kernel("inverse", tuple(name for name in ASKED if name in asked))
        answer = kernel.run(inputs, threads)
        if self.distributor.unsolved_friction:
            self._make_room(answer.values)
        mended(answer, inputs, lambda few: system.robust.evaluate(few))
        if chooses:
            self._choose(answer.values, answer.status, inputs)
        return answer

    def _make_room(self, values: dict[str, Array]) -> None:
        """For what friction adds to the results of a kernel that does not know of it, in place."""
        _add_parts(values, 2)
        k, N = values["contact_force"].shape
        values["slip"], values["drag"] = np.zeros((2, k, 3, N))

    def _choose(self, values: dict[str, Array], status: Array, inputs: Mapping[str, Array]) -> None:
        """Replace what the least norm does not serve, in place, by what the objective asks for."""
        values["shortfall"] = np.where(status == Status.ok, 1.0, np.nan)
        if not self._system.structure.friction:
            _add_parts(values, 1)
        rows = self.distributor.rows(values, status)
        if not rows.size:
            return
        load = {name: inputs[name] for name in ("force", "moment", "point")}
        ports = {name: values[name].T[rows] for name in MOTION}
        ports |= sample_rows(load, rows, len(status))
        # Shares cost more than all the rest.
        question = "system" if {"share", "slip"} & values.keys() else "balance"
        better = self.distributor.solve(self._system.kernel(question).run(ports).values)
        status[rows] = better.pop("status")
        for name, value in better.items():
            if name in values:
                values[name][..., rows] = value


def _add_parts(values: dict[str, Array], count: int) -> None:
    """Parts more that ask for nothing, in place."""
    for name in {"share", "gravity"} & values.keys():
        zero = np.zeros((count, *values[name].shape[1:]))
        values[name] = np.concatenate([values[name], zero])
