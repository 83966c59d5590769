"""Inverse dynamics: efforts, and all that follows, from motions and loads."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import cached_property

import numpy as np

from ..backends.c.compiled_kernel import CompiledKernel
from ..backends.kernel import Answer
from ..errors import InputError, did_you_mean
from ..questions.inverse import OUTPUTS
from ..status import Status
from .checks import LOAD, Sample, as_samples, check_states, ports_of_load, samples_of_states
from .data import Efforts, Evaluation
from .distributing import Distributor
from .one_sample import OneByOne
from .poses import configured, singularity
from .system import System, mended

Array = np.ndarray

CONDITION = "condition"
EVERYTHING = ("contact", "share", "motion", "joint", "configuration")
# Names of results, by what is asked for.
RESULTS = {
    "contact": ("contact_force",),
    "share": ("share",),
    "gravity": ("gravity",),
    "motion": ("pose", "pose_rate", "pose_acceleration"),
    "joint": ("joint_rate", "joint_acceleration"),
}


class InverseDynamics:
    """What efforts a motion takes; see `Model`."""

    def __init__(self, system: System, distributor: Distributor) -> None:
        self._system, self.distributor = system, distributor

    def efforts(
        self,
        q: Array,
        q1: Array,
        q2: Array,
        load: Array,
        outputs: Collection[str],
        threads: int | None,
    ) -> Efforts:
        """As `Model.torques`."""
        known = (*RESULTS, CONDITION)
        for name in outputs:
            if name not in known:
                raise InputError(f'no output "{name}".{did_you_mean(name, known)}')
        wanted = {*outputs} - {CONDITION}
        if CONDITION in outputs:
            wanted.add("configuration")
        found = self._solve(q, q1, q2, load, wanted, threads)
        values, status, effort = found.values, found.status, found.values["effort"].T
        if status.any():
            effort[status != Status.ok] = np.nan
        others = {name: _sample_first(name, values[name]) for name in _names(outputs)}
        if CONDITION in outputs:
            others[CONDITION] = singularity(values, self._system.length).condition
        return Efforts(effort, others, status)

    def one(self, q: Array, q1: Array, q2: Array, load: Array) -> Array:
        """As `Model.one`."""
        if (quick := self._one_by_one) is not None:
            found = quick.call(q, q1, q2, load)
            if found is not None:
                return found
        rows = [a[None] for a in as_samples(self._samples, q, q1, q2, load)]
        return self.efforts(rows[0], rows[1], rows[2], rows[3], (), None).effort[0]

    @cached_property
    def _one_by_one(self) -> OneByOne | None:
        """What `one` calls; None where a kernel alone cannot say what the efforts are."""
        question, fixed = self.distributor.question
        compiled = self._system.backend.name == "compiled"
        kernel = self._system.kernel(*question) if question and compiled else None
        if not isinstance(kernel, CompiledKernel):
            return None
        return OneByOne(kernel, self._samples, np.argsort(kernel.order), fixed)

    @cached_property
    def _samples(self) -> tuple[Sample, ...]:
        return (*samples_of_states(self._system.independent), LOAD)

    def everything(
        self, q: Array, q1: Array, q2: Array, load: Array, threads: int | None
    ) -> Evaluation:
        """As `Model.evaluate`."""
        found = self._solve(q, q1, q2, load, EVERYTHING, threads)
        values, status = found.values, found.status
        return Evaluation(
            **{name: _sample_first(name, values[name]) for name in ("effort", *_names(EVERYTHING))},
            configuration=configured(values, self._system.length),
            status=status,
            shortfall=values.get("shortfall", np.where(status == Status.ok, 1.0, np.nan)),
            **self._rubbed(values),
        )

    def _rubbed(self, values: Mapping[str, Array]) -> dict[str, Array]:
        """Sliding velocity and friction force at the contacts, (N, k, 3) each."""
        force = values["contact_force"]
        if "slip" not in values:
            # Of friction that no kernel goes through the sliding is not known.
            known = not self._system.structure.friction
            none = np.full((force.shape[1], force.shape[0], 3), 0.0 if known else np.nan)
            return {"slip": none, "friction_force": none}
        drag = np.moveaxis(values["drag"], -1, 0)
        return {
            "slip": np.moveaxis(values["slip"], -1, 0),
            "friction_force": -np.abs(force.T)[..., None] * drag,
        }

    def _solve(
        self,
        q: Array,
        q1: Array,
        q2: Array,
        load: Array,
        wanted: Collection[str],
        threads: int | None,
    ) -> Answer:
        system, choosing = self._system, self.distributor.chooses
        if choosing:
            wanted = {*wanted, "contact", "motion"}
        kernel = system.kernel("inverse", tuple(o for o in OUTPUTS if o in wanted))
        inputs = {"q": q, "q1": q1, "q2": q2, **ports_of_load(load)}
        check_states(system.independent, q, q1, q2)
        answer = kernel.run(inputs, threads)
        if self.distributor.unsolved_friction:
            self._make_room(answer.values)
        mended(answer, inputs, lambda few: system.robust.evaluate(few))
        if choosing:
            self._choose(answer.values, answer.status, inputs)
        return answer

    def _make_room(self, values: dict[str, Array]) -> None:
        """For what friction adds to the results of a kernel that does not know of it, in place."""
        _add_parts(values, 2)
        if "contact_force" in values:
            k, N = values["contact_force"].shape
            values["slip"], values["drag"] = np.zeros((2, k, 3, N))

    def _choose(self, values: dict[str, Array], status: Array, inputs: Mapping[str, Array]) -> None:
        """Replace what the least norm does not serve, in place, by what the policy asks for."""
        values["shortfall"] = np.where(status == Status.ok, 1.0, np.nan)
        if not self._system.structure.friction:
            _add_parts(values, 1)
        rows = self.distributor.rows(values, status)
        if not rows.size:
            return
        ports = {name: values[name].T[rows] for name in RESULTS["motion"]}
        ports |= {name: inputs[name][rows] for name in ("force", "moment", "point")}
        # Shares cost more than all the rest.
        question = "system" if {"share", "slip"} & values.keys() else "balance"
        better = self.distributor.solve(self._system.kernel(question).run(ports).values)
        status[rows] = better.pop("status")
        for name, value in better.items():
            if name in values:
                values[name][..., rows] = value


def _names(outputs: Collection[str]) -> list[str]:
    return [name for output in outputs for name in RESULTS.get(output, ())]


def _add_parts(values: dict[str, Array], count: int) -> None:
    """Parts more that ask for nothing, in place."""
    for name in {"share", "gravity"} & values.keys():
        zero = np.zeros((count, *values[name].shape[1:]))
        values[name] = np.concatenate([values[name], zero])


def _sample_first(name: str, value: Array) -> Array:
    """Samples last to samples first; of shares, after the parts."""
    return value.swapaxes(1, 2) if name in ("share", "gravity") else value.T
