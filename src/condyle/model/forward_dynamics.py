"""Forward dynamics on arrays: accelerations and contact forces from states, efforts and loads."""

from __future__ import annotations

from collections.abc import Collection
from functools import cached_property

import numpy as np

from ..backends.c.compiled_kernel import CompiledKernel
from ..backends.kernel import Kernel
from ..errors import InputError, did_you_mean
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
from .one_sample import OneByOne
from .system import System, mended

Array = np.ndarray

# Names of results, by what is asked for; the contact forces always come.
RESULTS = {
    "contact": ("contact_force",),
    "motion": ("pose", "pose_rate", "pose_acceleration"),
    "joint": ("joint", "joint_rate", "joint_acceleration"),
    "sliding": ("slip", "drag"),
}
# What is no number where there are no accelerations.
DEPENDENT = ("acceleration", "contact_force", "pose_acceleration", "joint_acceleration")


class ForwardDynamics:
    """What efforts and loads do to one mechanism; see `Model`."""

    def __init__(self, system: System) -> None:
        chains = system.mechanism.chain_names
        effort = Sample("effort", len(chains), f"{', '.join(chains)} [N m or N]")
        q, q1, _ = samples_of_states(system.independent)
        self._system, self._samples = system, (q, q1, effort, LOAD)

    def accelerations(
        self,
        q: Array,
        q1: Array,
        effort: Array,
        load: Array,
        outputs: Collection[str] = (),
        threads: int | None = None,
    ) -> Accelerations:
        """As `Model.forward`."""
        for name in outputs:
            if name not in RESULTS:
                raise InputError(f'no output "{name}".{did_you_mean(name, RESULTS)}')
        inputs = self._inputs(q, q1, effort, load)
        answer = self._kernel(outputs).run(inputs, threads)
        mended(answer, inputs, lambda few: self._system.robust.forward(few))
        values, status = answer.values, answer.status
        if status.any():
            for name in {*DEPENDENT} & values.keys():
                values[name][..., status != Status.ok] = np.nan
        first = {name: np.moveaxis(a, -1, 0) for name, a in values.items()}
        acceleration, force = first.pop("acceleration"), first.pop("contact_force")
        if "drag" in first:
            first["friction_force"] = -np.abs(force)[..., None] * first.pop("drag")
        return Accelerations(acceleration, force, first, status)

    def one(self, q: Array, q1: Array, effort: Array, load: Array) -> Array:
        """As `Model.forward_one`."""
        if (quick := self._one_by_one) is not None:
            found = quick.call(q, q1, effort, load)
            if found is not None:
                return found
        rows = [a[None] for a in as_samples(self._samples, q, q1, effort, load)]
        return self.accelerations(rows[0], rows[1], rows[2], rows[3]).acceleration[0]

    @cached_property
    def _one_by_one(self) -> OneByOne | None:
        kernel = self._kernel(())
        if not isinstance(kernel, CompiledKernel):
            return None
        return OneByOne(kernel, self._samples, np.arange(len(self._system.independent)))

    def linearised(self, q: Array, q1: Array, effort: Array, load: Array) -> tuple[Array, Array]:
        """As `Model.linearised`."""
        inputs = self._inputs(q, q1, effort, load)
        about = self.accelerations(q, q1, effort, load, ("motion",))
        ports = {name: inputs[name] for name in ("q1", "effort", "force", "moment", "point")}
        ports |= {"pose": about["pose"], "q2": about.acceleration}
        ports["contact_force"] = about.contact_force
        found = self._system.robust.linear(ports)
        s = {name: np.moveaxis(a, -1, 0) for name, a in found.items()}
        count, m = about.acceleration.shape
        A, B = np.zeros((count, 2 * m, 2 * m)), np.zeros((count, 2 * m, s["J"].shape[2]))
        A[:, :m, m:] = np.eye(m)
        good = about.status == Status.ok
        A[~good] = B[~good] = np.nan
        unknown = np.concatenate([s["by_q2"], s["by_force"]], axis=2)[good]
        known = np.concatenate([-s["by_q"], -s["by_q1"], s["J"]], axis=2)[good]
        solved = np.linalg.solve(unknown, known)[:, :m]
        A[good, m:], B[good, m:] = solved[..., : 2 * m], solved[..., 2 * m :]
        return A, B

    def _kernel(self, outputs: Collection[str]) -> Kernel:
        wanted = {"contact", *outputs}
        return self._system.kernel("forward", tuple(o for o in OUTPUTS if o in wanted))

    def _inputs(self, q: Array, q1: Array, effort: Array, load: Array) -> dict[str, Array]:
        check_states(self._system.independent, q, q1)
        check_array("effort", effort, *self._samples[2][1:])
        return {"q": q, "q1": q1, "effort": effort, **ports_of_load(load)}
