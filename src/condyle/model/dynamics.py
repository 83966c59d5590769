"""The base class of inverse and forward dynamics: of one state, or arrays of any leading shape."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from ..backends.c.compiled_kernel import CompiledKernel
from ..backends.kernel import Kernel
from ..questions.output_sets import OutputSets
from .arguments import NOTHING, Argument, Arguments, Lead, requested
from .model_result import ModelResult
from .system import System
from .unchecked import Call, single_state_function

ALWAYS = frozenset({"contact", "bound"})  # what both questions are asked, whatever is wanted


@dataclass(eq=False)
class Dynamics:
    """Inverse or forward dynamics of the mechanisms of a system.

    asks:    the question of arrays of states, and its sets of outputs.
    results: the first result, the contact forces and the bound.
    outputs: what may be asked for besides, and what the question is asked for each.
    """

    asks: ClassVar[tuple[str, OutputSets]]
    results: ClassVar[tuple[str, str, str]]
    outputs: ClassVar[Mapping[str, str]]

    system: System
    arguments: Arguments
    _by_inputs: dict[tuple[str, ...], Self] = field(default_factory=dict, init=False, repr=False)
    _kernels: dict[tuple[str, ...], tuple[Kernel, frozenset[str]]] = field(
        default_factory=dict, init=False, repr=False
    )

    @property
    def third(self) -> Argument:
        """The argument after q and v."""
        raise NotImplementedError

    def __call__(
        self,
        q: Any,
        v: Any,
        x: Any,
        wrench: Any,
        at: Any,
        outputs: Any,
        threads: int | None,
        given: Mapping[str, Any] = NOTHING,
    ) -> ModelResult:
        """As `Model.inverse_dynamics` and `Model.forward_dynamics`; given: of `GIVEN`."""
        if given:
            return self.solve((q, v, x), wrench, at, outputs, threads, given)
        if type(q) is np.ndarray and q.ndim == 1 and not outputs and threads is None:
            row = self._single_state(q, v, x, wrench, self.arguments.point(at))
            if row is not None:
                first = len(row) - (7 - len(q))  # then the contact forces, and the bound
                parts = row[:first], row[first:-1], row[-1]
                found = dict(zip(self.results, parts, strict=True))
                return ModelResult(**found, status=np.zeros((), np.uint8))
        return self.solve((q, v, x), wrench, at, outputs, threads)

    def solve(
        self,
        state: Any,
        wrench: Any,
        at: Any,
        outputs: Any,
        threads: int | None,
        given: Mapping[str, Any] = NOTHING,
    ) -> ModelResult:
        """The same of arrays of any leading shape; state: q, v and the third argument."""
        names = requested(outputs, self.outputs)
        arguments = self.arguments.q, self.arguments.v, self.third
        lead, inputs = self.arguments.samples(arguments, state, wrench, at, given)
        if self._several:
            inputs |= self.system.labels(math.prod(lead))
        return self.with_inputs(given)._solve_samples(lead, inputs, names, threads)

    @cached_property
    def _several(self) -> bool:
        """Whether there are several mechanisms."""
        return len(self.system.numbers) > 1

    @cached_property
    def _needs_motion(self) -> bool:
        """Whether samples are judged by the platform's motion, whatever is wanted."""
        return self.system.may_overlap

    def _kernel(self, names: tuple[str, ...]) -> tuple[Kernel, frozenset[str]]:
        """The kernel that has these outputs, and its results that are not wanted."""
        if names not in self._kernels:
            question, sets = self.asks
            more = ["motion"] if self._needs_motion else []
            own, spare = sets.covering(ALWAYS.union((self.outputs[n] for n in names), more))
            self._kernels[names] = self.system.kernel(question, own), spare
        return self._kernels[names]

    def with_inputs(self, given: Iterable[str]) -> Self:
        """The same of samples that give these of `GIVEN` too."""
        names = tuple(given)
        if not names:
            return self
        if names not in self._by_inputs:
            self._by_inputs[names] = replace(self, system=self.system.with_inputs(names))
        return self._by_inputs[names]

    def _solve_samples(
        self, lead: Lead, inputs: dict[str, np.ndarray], names: tuple[str, ...], threads: int | None
    ) -> ModelResult:
        """Results of samples, given by port; names: of outputs."""
        raise NotImplementedError

    def question(
        self, with_contact_force: bool
    ) -> tuple[tuple[Any, ...], Mapping[str, np.ndarray]]:
        """The question of one state with its details, if a kernel alone can answer it, and its
        ports that are always given the same.

        Args: with_contact_force: whether contact forces and the bound are wanted too.
        """
        raise NotImplementedError

    @cached_property
    def _single_state(self) -> Call:
        """The results of one state in a row; None for anything else."""
        return self._compiled(self.results, lambda *given: None)

    def unchecked(self) -> Call:
        """As `Model.unchecked`."""

        def checked(q: Any, v: Any, x: Any, wrench: Any = None, at: Any = None) -> np.ndarray:
            *state, wrench, at = self.arguments.state(self.third, q, v, x, wrench, at)
            found: np.ndarray = getattr(self.solve(state, wrench, at, (), None), self.results[0])
            return found

        return self._compiled(self.results[:1], checked)

    def _compiled(self, results: tuple[str, ...], otherwise: Call) -> Call:
        question, fixed = self.question(results == self.results)
        system = self.system
        # A kernel does not see a ball overlap its surface.
        alone = len(system.numbers) == 1 and not system.may_overlap
        compiled = question and alone and system.backend.name == "compiled"
        kernel = system.kernel(*question) if compiled else None
        if not isinstance(kernel, CompiledKernel):
            return otherwise
        return single_state_function(kernel, self.arguments.q.size, results, otherwise, fixed)
