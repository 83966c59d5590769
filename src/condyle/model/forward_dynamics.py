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
    """What efforts and loads do to one mechanism: a part of `Model`."""

    system: System

    def forward(
        self,
        q: Array,
        q1: Array,
        effort: Array,
        load: Array,
        outputs: Collection[str] = (),
        threads: int | None = None,
    ) -> Accelerations:
        """Forward dynamics: the accelerations that efforts and loads make.

        Limits of efforts, and that cables cannot push, are the caller's concern.

        Args:    q, q1: (N, m) each, in the order of `independent` [m, rad; per s].
                 effort: (N, n) [N m or N], in the order of the chains.
                 load: (N, 9), as of `evaluate`.
                 outputs: what is wanted besides, of motion, joint and sliding; threads: at most so
                 many.
        Raises:  InputError: for an output that is none of these, or arrays that do not fit.
        """
        for name in outputs:
            if name not in RESULTS:
                raise InputError(f'no output "{name}".{did_you_mean(name, RESULTS)}')
        inputs = self._inputs(q, q1, effort, load)
        answer = self._forward_kernel(outputs).run(inputs, threads)
        mended(answer, inputs, lambda few: self.system.robust.forward(few))
        values, status = answer.values, answer.status
        if status.any():
            for name in {*DEPENDENT} & values.keys():
                values[name][..., status != Status.ok] = np.nan
        first = {name: np.moveaxis(a, -1, 0) for name, a in values.items()}
        acceleration, force = first.pop("acceleration"), first.pop("contact_force")
        if "drag" in first:
            first["friction_force"] = -np.abs(force)[..., None] * first.pop("drag")
        return Accelerations(acceleration, force, first, status)

    def forward_one(self, q: Array, q1: Array, effort: Array, load: Array) -> Array:
        """Accelerations of one sample, (m,), at least latency; NaN where there are none.

        Args: q, q1: (m,) each;  effort: (n,);  load: (9,); as of `forward`. Arrays of doubles go
              fastest.
        Returns: a new array.
        Raises:  InputError: for arrays that do not fit.
        """
        if (quick := self._one_acceleration) is not None:
            found = quick.call(q, q1, effort, load)
            if found is not None:
                return found
        row = [a[None] for a in as_samples(self._given, q, q1, effort, load)]
        return self.forward(row[0], row[1], row[2], row[3]).acceleration[0]

    @cached_property
    def _given(self) -> tuple[Sample, ...]:
        chains = self.system.mechanism.chain_names
        effort = Sample("effort", len(chains), f"{', '.join(chains)} [N m or N]")
        q, q1, _ = samples_of_states(self.system.independent)
        return q, q1, effort, LOAD

    @cached_property
    def _one_acceleration(self) -> OneByOne | None:
        kernel = self._forward_kernel(())
        if not isinstance(kernel, CompiledKernel):
            return None
        return OneByOne(kernel, self._given, np.arange(len(self.system.independent)))

    def linearised(self, q: Array, q1: Array, effort: Array, load: Array) -> tuple[Array, Array]:
        """x' = A x + B effort about states x = (q, q'), exact; arguments as of `forward`.

        The load stays as it is in {S}. Returns: A, (N, 2 m, 2 m), and B, (N, 2 m, n); NaN where
        there are no accelerations.
        """
        inputs = self._inputs(q, q1, effort, load)
        about = self.forward(q, q1, effort, load, ("motion",))
        ports = {name: inputs[name] for name in ("q1", "effort", "force", "moment", "point")}
        ports |= {"pose": about["pose"], "q2": about.acceleration}
        ports["contact_force"] = about.contact_force
        found = self.system.robust.linear(ports)
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

    def _forward_kernel(self, outputs: Collection[str]) -> Kernel:
        wanted = {"contact", *outputs}
        return self.system.kernel("forward", tuple(o for o in OUTPUTS if o in wanted))

    def _inputs(self, q: Array, q1: Array, effort: Array, load: Array) -> dict[str, Array]:
        check_states(self.system.independent, q, q1)
        check_array("effort", effort, *self._given[2][1:])
        return {"q": q, "q1": q1, "effort": effort, **ports_of_load(load)}
