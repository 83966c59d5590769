"""Forward dynamics on arrays: accelerations and contact forces from states, efforts and loads."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import cached_property
from typing import Any

import numpy as np

from ..backends.c.kernel import CompiledKernel
from ..backends.kernel import AGAIN, Kernel
from ..errors import InputError, did_you_mean
from ..mechanism.home import independent_coordinates
from ..mechanism.mechanism import Mechanism
from ..questions.forward import OUTPUTS
from ..status import Status
from .checks import (
    LOAD,
    Sample,
    as_samples,
    check_array,
    check_states,
    ports_of_load,
    samples_of_states,
)
from .data import Accelerations
from .one import OneByOne
from .robust import Robust

# Names of results, by what is asked for; the contact forces always come.
RESULTS = {
    "contact": ("contact_force",),
    "motion": ("pose", "pose_rate", "pose_acceleration"),
    "joint": ("joint", "joint_rate", "joint_acceleration"),
    "sliding": ("slip", "drag"),
}
# What is no number where there are no accelerations.
DEPENDENT = ("acceleration", "contact_force", "pose_acceleration", "joint_acceleration")


class Accelerator:
    """What efforts and loads do to one mechanism."""

    def __init__(
        self, mechanism: Mechanism, kernel: Callable[..., Kernel], robust: Callable[[], Robust]
    ) -> None:
        """Args: kernel: the kernel of a question;  robust: the robust path, once it is wanted."""
        self._independent = independent_coordinates(mechanism)
        chains = [chain.name for chain in mechanism.chains]
        self._effort = Sample("effort", len(chains), f"{', '.join(chains)} [N m or N]")
        self._kernel, self._robust = kernel, robust

    def __call__(
        self,
        q: np.ndarray,
        q1: np.ndarray,
        effort: np.ndarray,
        load: np.ndarray,
        outputs: Collection[str] = (),
        threads: int | None = None,
    ) -> Accelerations:
        """As `Evaluator.forward`."""
        for name in outputs:
            if name not in RESULTS:
                raise InputError(f'no output "{name}".{did_you_mean(name, RESULTS)}')
        inputs = self._inputs(q, q1, effort, load)
        answer = self._for(outputs).run(inputs, threads)
        values, status = answer.values, answer.status
        again = np.flatnonzero(status == AGAIN)
        if again.size:
            few = {name: np.asarray(a, dtype=float)[again] for name, a in inputs.items()}
            better, status[again] = self._robust().forward(few)
            for name, value in values.items():
                value[..., again] = better[name]
        if status.any():
            for name in {*DEPENDENT} & values.keys():
                values[name][..., status != Status.ok] = np.nan
        first = {name: np.moveaxis(a, -1, 0) for name, a in values.items()}
        acceleration, force = first.pop("acceleration"), first.pop("contact_force")
        if "drag" in first:
            first["friction_force"] = -np.abs(force)[..., None] * first.pop("drag")
        return Accelerations(acceleration, force, first, status)

    def one(
        self, q: np.ndarray, q1: np.ndarray, effort: np.ndarray, load: np.ndarray
    ) -> np.ndarray:
        """As `Evaluator.forward_one`."""
        if (quick := self._one_by_one) is not None:
            found = quick.call(q, q1, effort, load)
            if found is not None:
                return found
        rows = [a[None] for a in as_samples(self._samples, q, q1, effort, load)]
        return self(rows[0], rows[1], rows[2], rows[3]).acceleration[0]

    @cached_property
    def _one_by_one(self) -> OneByOne | None:
        kernel = self._for(())
        if not isinstance(kernel, CompiledKernel):
            return None
        return OneByOne(kernel, self._samples, np.arange(len(self._independent)))

    @cached_property
    def _samples(self) -> tuple[Sample, ...]:
        q, q1, _ = samples_of_states(self._independent)
        return q, q1, self._effort, LOAD

    def linearised(
        self, q: np.ndarray, q1: np.ndarray, effort: np.ndarray, load: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """As `Evaluator.linearised`."""
        inputs = self._inputs(q, q1, effort, load)
        about = self(q, q1, effort, load, ("motion",))
        ports = {name: inputs[name] for name in ("q1", "effort", "force", "moment", "point")}
        ports |= {"pose": about["pose"], "q2": about.acceleration}
        ports["contact_force"] = about.contact_force
        found = self._robust().linear(ports)
        s = {name: np.moveaxis(a, -1, 0) for name, a in found.items()}
        count, m = about.acceleration.shape
        A, B = np.zeros((count, 2 * m, 2 * m)), np.zeros((count, 2 * m, self._effort.length))
        A[:, :m, m:] = np.eye(m)
        good = about.status == Status.ok
        A[~good] = B[~good] = np.nan
        unknown = np.concatenate([s["by_q2"], s["by_force"]], axis=2)[good]
        known = np.concatenate([-s["by_q"], -s["by_q1"], s["J"]], axis=2)[good]
        solved = np.linalg.solve(unknown, known)[:, :m]
        A[good, m:], B[good, m:] = solved[..., : 2 * m], solved[..., 2 * m :]
        return A, B

    def _for(self, outputs: Collection[str]) -> Kernel:
        wanted = {"contact", *outputs}
        return self._kernel("forward", tuple(o for o in OUTPUTS if o in wanted))

    def _inputs(
        self, q: np.ndarray, q1: np.ndarray, effort: np.ndarray, load: np.ndarray
    ) -> dict[str, Any]:
        check_states(self._independent, q, q1)
        check_array("effort", effort, *self._effort[1:])
        return {"q": q, "q1": q1, "effort": effort, **ports_of_load(load)}
