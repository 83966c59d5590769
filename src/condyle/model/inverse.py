"""Inverse dynamics: efforts, and all that follows, from motions and loads."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import cached_property

import numpy as np

from ..backends.c.kernel import CompiledKernel
from ..backends.kernel import AGAIN
from ..errors import InputError, did_you_mean
from ..questions.inverse import OUTPUTS
from ..status import Status
from .checks import LOAD, Sample, as_samples, check_states, ports_of_load, samples_of_states
from .data import Efforts, Evaluation
from .derivation import Derivation
from .one import OneByOne
from .poses import configured, singularity

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


class InverseDynamics(Derivation):
    """What efforts a motion takes; samples that a kernel cannot vouch for go the robust path."""

    def torques(
        self,
        q: np.ndarray,
        q1: np.ndarray,
        q2: np.ndarray,
        load: np.ndarray,
        outputs: Collection[str] = (),
        threads: int | None = None,
    ) -> Efforts:
        """Efforts alone, as fast as the machine.

        Args:    as for `evaluate`; outputs: what is wanted besides, of contact, share, gravity
                 (what of each share gravity and load alone ask for), motion, joint and condition:
                 ask for less, pay for less; threads: at most so many.
        Raises:  InputError: for an output that is none of these.
        """
        known = (*RESULTS, CONDITION)
        for name in outputs:
            if name not in known:
                raise InputError(f'no output "{name}".{did_you_mean(name, known)}')
        wanted = {*outputs} - {CONDITION}
        if CONDITION in outputs:
            wanted.add("configuration")
        values, status = self._solve(q, q1, q2, load, wanted, threads)
        effort = values["effort"].T
        if status.any():
            effort[status != Status.ok] = np.nan
        others = {name: _sample_first(name, values[name]) for name in _names(outputs)}
        if CONDITION in outputs:
            others[CONDITION] = singularity(values, self.characteristic_length).condition
        return Efforts(effort, others, status)

    def one(self, q: np.ndarray, q1: np.ndarray, q2: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Efforts of one sample, (n,) [N m or N], at least latency: for a control loop.

        Args: q, q1, q2: (m,) each, in the order of `independent`;  load: (9,), as of `evaluate`.
              Arrays of doubles go fastest.
        Returns: efforts in the order of the chains, a new array; NaN where there are none.
        Raises:  InputError: for arrays that do not fit.
        """
        if (quick := self._one_by_one) is not None:
            found = quick.call(q, q1, q2, load)
            if found is not None:
                return found
        rows = [a[None] for a in as_samples(self._samples, q, q1, q2, load)]
        return self.torques(rows[0], rows[1], rows[2], rows[3]).effort[0]

    @cached_property
    def _one_by_one(self) -> OneByOne | None:
        """What `one` calls; None where a kernel alone cannot say what the efforts are."""
        kernel = self.kernel("inverse", ())
        if self._distributor.chooses or not isinstance(kernel, CompiledKernel):
            return None
        return OneByOne(kernel, self._samples, np.argsort(kernel.order))

    @cached_property
    def _samples(self) -> tuple[Sample, ...]:
        return (*samples_of_states(self.independent), LOAD)

    def evaluate(
        self,
        q: np.ndarray,
        q1: np.ndarray,
        q2: np.ndarray,
        load: np.ndarray,
        threads: int | None = None,
    ) -> Evaluation:
        """Inverse dynamics at samples of the independent coordinates, with all that follows.

        Args: q, q1, q2: (N, m) each, in the order of `independent` [m, rad; per s; per s^2].
              load: (N, 9): force [N] and moment [N m] in {S}, and the point they act at, in {M}.
              threads: at most so many; default: the processors at hand. Results do not depend
              on it.
        """
        values, status = self._solve(q, q1, q2, load, EVERYTHING, threads)
        return Evaluation(
            **{name: _sample_first(name, values[name]) for name in ("effort", *_names(EVERYTHING))},
            configuration=configured(values, self.characteristic_length),
            status=status,
            shortfall=values.get("shortfall", np.where(status == Status.ok, 1.0, np.nan)),
            **self._rubbed(values),
        )

    def _rubbed(self, values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Sliding velocity and friction force at the contacts, (N, k, 3) each."""
        force = values["contact_force"]
        if "slip" not in values:
            # Of friction that no kernel goes through the sliding is not known.
            known = not self._structure.friction
            none = np.full((force.shape[1], force.shape[0], 3), 0.0 if known else np.nan)
            return {"slip": none, "friction_force": none}
        drag = np.moveaxis(values["drag"], -1, 0)
        return {
            "slip": np.moveaxis(values["slip"], -1, 0),
            "friction_force": -np.abs(force.T)[..., None] * drag,
        }

    def _solve(
        self,
        q: np.ndarray,
        q1: np.ndarray,
        q2: np.ndarray,
        load: np.ndarray,
        wanted: Collection[str],
        threads: int | None,
    ) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Results by name, samples last, and their statuses."""
        choosing = self._distributor.chooses
        if choosing:
            wanted = {*wanted, "contact", "motion"}
        kernel = self.kernel("inverse", tuple(o for o in OUTPUTS if o in wanted))
        inputs = {"q": q, "q1": q1, "q2": q2, **ports_of_load(load)}
        check_states(self.independent, q, q1, q2)
        answer = kernel.run(inputs, threads)
        if self._distributor.unsolved_friction:
            self._make_room(answer.values)
        again = np.flatnonzero(answer.status == AGAIN)
        if again.size:
            few = {name: np.asarray(a, dtype=float)[again] for name, a in inputs.items()}
            better, answer.status[again] = self._robust.evaluate(few)
            for name, value in answer.values.items():
                value[..., again] = better[name]
        if choosing:
            self._choose(answer.values, answer.status, inputs)
        return answer.values, answer.status

    def _make_room(self, values: dict[str, np.ndarray]) -> None:
        """For what friction adds to the results of a kernel that does not know of it, in place."""
        _add_parts(values, 2)
        if "contact_force" in values:
            k, N = values["contact_force"].shape
            values["slip"], values["drag"] = np.zeros((2, k, 3, N))

    def _choose(
        self,
        values: dict[str, np.ndarray],
        status: np.ndarray,
        inputs: Mapping[str, np.ndarray],
    ) -> None:
        """Replace what the least norm does not serve, in place, by what the policy asks for."""
        values["shortfall"] = np.where(status == Status.ok, 1.0, np.nan)
        if not self._structure.friction:
            _add_parts(values, 1)
        rows = self._distributor.rows(values, status)
        if not rows.size:
            return
        ports = {name: values[name].T[rows] for name in RESULTS["motion"]}
        ports |= {name: inputs[name][rows] for name in ("force", "moment", "point")}
        # Shares cost more than all the rest.
        question = "system" if {"share", "slip"} & values.keys() else "balance"
        better = self._distributor.solve(self.kernel(question).run(ports).values)
        status[rows] = better.pop("status")
        for name, value in better.items():
            if name in values:
                values[name][..., rows] = value


def _names(outputs: Collection[str]) -> list[str]:
    return [name for output in outputs for name in RESULTS.get(output, ())]


def _add_parts(values: dict[str, np.ndarray], count: int) -> None:
    """Parts more that ask for nothing, in place."""
    for name in {"share", "gravity"} & values.keys():
        zero = np.zeros((count, *values[name].shape[1:]))
        values[name] = np.concatenate([values[name], zero])


def _sample_first(name: str, value: np.ndarray) -> np.ndarray:
    """Samples last to samples first; of shares, after the parts."""
    return value.swapaxes(1, 2) if name in ("share", "gravity") else value.T
