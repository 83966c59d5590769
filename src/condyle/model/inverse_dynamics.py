"""Inverse dynamics: efforts, and all that follows, from motions and wrenches."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..backends.kernel import VARIANT, Arrays, KernelValues, sample_rows
from ..errors import InputError
from ..motion.followed_closure import MOTION
from ..questions.bound import CERTIFIED, bound
from ..questions.inverse import SETS
from ..status import Status
from .arguments import Argument, Lead
from .contact_patches import compliant
from .distributing import Distributor
from .dynamics import Dynamics
from .model_result import ModelResult
from .poses import configured, singularity
from .yielding import Place, Yielding, place_by_coordinates

Array = np.ndarray
BEARS = 1e-12  # of a sample's largest contact force: less is rounding of none
# What the question is asked for each output, besides what always comes.
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
    "wall_force": "contact",
    "ambiguous": "contact",
    "contact_active": "contact",
    "residual_wrench": "contact",
}
# Those that a solution has, and a sweep of them.
BESIDE = ("gravity_share", "condition", "ambiguous", "contact_active", "residual_wrench")
SOLVED = tuple(name for name in OUTPUTS if name not in BESIDE)


@dataclass(eq=False)
class InverseDynamics(Dynamics):
    """The efforts that a motion takes; see `Model`.

    distributor_of: of each mechanism by its number, where limits or weights differ.
    activation: measured, (..., n), NaN of chains without.
    compliant: whether contacts yield to their forces;  closing: how the poses follow from what is
    prescribed, if that is not q.
    """

    asks = "inverse", SETS
    results = ("effort", "contact_force", "bound")
    outputs = OUTPUTS

    distributor: Distributor
    distributor_of: Callable[[int], Distributor] | None = None
    activation: Array | None = None
    compliant: bool = False
    closing: Place | None = None

    @property
    def third(self) -> Argument:
        return self.arguments.a

    def following(self, activation: Any) -> InverseDynamics:
        """The same of measured activations, (..., n), NaN of chains without.

        Raises: InputError: for another shape, or a distribution that does not follow them.
        """
        chosen = self.distributor.distribution
        if not chosen.objective.follows:
            raise InputError(
                f"activation: distribution {chosen.name} follows no measured activations: take "
                "emg or emg_assisted, or leave them out"
            )
        values = self.arguments.activation.array(activation)
        gaps = np.isnan(values).reshape(-1, values.shape[-1])
        if (
            not ((values >= 0) | np.isnan(values)).all()
            or (gaps.any(axis=0) != gaps.all(axis=0)).any()
        ):
            raise InputError(
                "activation: expected numbers of at least 0, or NaN in all samples of a chain"
            )
        return replace(self, activation=values)

    def yielding(self, closing: Place | None = None) -> InverseDynamics:
        """The same of contacts that yield.

        Raises: InputError: where no contact has compliance.
        """
        if not compliant(self.system.mechanism):
            raise InputError(
                "contacts: no contact of this mechanism has compliance to yield by; give "
                'contact.<name>.compliance, or take contacts "kept"'
            )
        return replace(self, compliant=True, closing=closing)

    def question(self, with_contact_force: bool) -> tuple[tuple[Any, ...], dict[str, Array]]:
        if self.compliant:  # no kernel alone can answer it
            return (), {}
        return self.distributor.question(with_contact_force)

    def _solve_samples(
        self, lead: Lead, inputs: dict[str, Array], names: tuple[str, ...], threads: int | None
    ) -> ModelResult:
        if (given := self.activation) is not None:
            try:
                rows = np.broadcast_to(given, (*lead, given.shape[-1]))
            except ValueError:
                raise InputError(
                    f"activation: shape {given.shape} does not go with states of shape {lead}"
                ) from None
            inputs["activation"] = rows.reshape(-1, given.shape[-1])
        answer = (
            self._yielded(inputs) if self.compliant else self._run_kernel(inputs, names, threads)
        )
        values, status = answer.values, answer.status
        own = (*self.results, *(("indentation",) if self.compliant else ()))
        results = {name: values[name].T for name in own}
        if np.count_nonzero(status):  # quicker than `any`
            for value in results.values():
                value[status != Status.ok] = np.nan
        results["status"] = status
        if "ambiguous" in names:
            values["ambiguous"] = self._ambiguous(inputs, results["effort"], status)
        if names:
            length = self.system.lengths(inputs)
            results |= {name: self._read(name, values, status, length) for name in names}
        return ModelResult(**results).shaped(lead)

    def _ambiguous(self, inputs: Mapping[str, Array], effort: Array, status: Array) -> Array:
        """Whether forward dynamics has other motions under these efforts too, (N,)."""
        ambiguous, good = np.zeros(len(status), dtype=bool), np.flatnonzero(status == Status.ok)
        if self.system.structure.friction and good.size:
            given = sample_rows({**inputs, "effort": effort}, good, len(status))
            del given["q2"]
            ambiguous[good] = self.system.robust.forward_statuses(given) == Status.ambiguous
        return ambiguous

    def _read(self, name: str, values: Mapping[str, Array], status: Array, length: Any) -> Any:
        """One output, samples first."""
        if name in ("share", "gravity_share"):
            return np.moveaxis(values[OUTPUTS[name]], -1, 0)
        if name == "configuration":
            return configured(values, length)
        if name == "condition":
            return singularity(values, length).condition
        if name == "shortfall":
            return values.get(name, np.where(status == Status.ok, 1.0, np.nan))
        if name == "residual_wrench":
            wrench = values.get(name, np.zeros((6, len(status)))).T
            return np.where((status == Status.ok)[:, None], wrench, np.nan)
        if name == "wall_force":
            return values.get(name, self._no_walls(status)).T
        if name not in ("slip", "friction_force", "contact_active"):
            return values[name].T
        force = values["contact_force"].T
        if name == "contact_active":
            return active(self.distributor.push, force)
        if "slip" not in values:
            # Of friction that no kernel goes through the sliding is not known.
            shape = (*force.shape, 3)
            return np.full(shape, np.nan) if self.system.structure.friction else np.zeros(shape)
        if name == "slip":
            return np.moveaxis(values["slip"], -1, 0)
        return -np.abs(force)[..., None] * np.moveaxis(values["drag"], -1, 0)

    def _run_kernel(
        self, inputs: dict[str, Array], names: tuple[str, ...], threads: int | None
    ) -> KernelValues:
        kernel, spare = self._kernel(names)
        answer = kernel.run(inputs, threads, spare)
        if self.distributor.unsolved_friction:
            self._make_room(answer.values)
        answer.mend(inputs, lambda rows: self.system.robust.evaluate(rows))
        if self._needs_motion:
            self.system.mark_overlaps(answer.status, answer.values["pose"].T, inputs)
        if self._chooses:
            self._choose(answer.values, answer.status, inputs)
        return answer

    def _yielded(self, inputs: dict[str, Array]) -> KernelValues:
        """Results where contacts have yielded to their forces."""
        robust, count = self.system.robust, len(inputs["q"])
        q = {name: np.broadcast_to(a, (count, a.shape[1])) for name, a in inputs.items()}
        motion, closed = robust.motion({name: q[name] for name in ("q", "q1", "q2")})
        pose = np.where((closed == Status.ok)[:, None], motion["pose"].T, np.nan)
        place = self.closing
        if place is None:
            closure = self.system.closure(self.system.independent, None)
            place = place_by_coordinates(closure.followed, q["q"], q["q1"], q["q2"])

        return self.yielded(place, pose, q)

    def yielded(self, place: Place, pose: Array, inputs: Mapping[str, Array]) -> KernelValues:
        """All results, and indentation (k, N), where contacts have yielded to their forces.

        Args: place: how poses follow from the surfaces' levels;  pose: on them, (N, 6), NaN where
              there is none;  inputs: the load by port.
        """
        solver = Yielding(self.system, self.distributor, self.at_poses)
        poses, depth, known = solver.solve(place, pose, inputs)
        values, status = self.at_poses(poses, known, inputs)
        values["indentation"] = depth.T
        return KernelValues(values, status)

    def at_poses(
        self, poses: Arrays, reached: Array, inputs: Mapping[str, Array]
    ) -> tuple[Arrays, Array]:
        """As `Robust.evaluate_at`, with the efforts that the distribution chooses."""
        values, status = self.system.robust.evaluate_at(poses, reached, inputs)
        if self._chooses:
            self._choose(values, status, inputs)
        return values, status

    @cached_property
    def _chooses(self) -> bool:
        """Whether the distributor may replace the kernel's efforts."""
        return self.distributor.chooses

    @cached_property
    def _needs_motion(self) -> bool:
        return self._chooses or self.system.may_overlap

    def _no_walls(self, status: Array) -> Array:
        return np.zeros((len(self.system.structure.walls), len(status)))

    def _make_room(self, values: dict[str, Array]) -> None:
        """For what friction adds to the results of a kernel that does not know of it, in place."""
        _add_parts(values, 2)
        k, N = values["contact_force"].shape
        values["slip"], values["drag"] = np.zeros((2, k, 3, N))

    def _choose(self, values: dict[str, Array], status: Array, inputs: Mapping[str, Array]) -> None:
        """Replace what the least norm does not serve, in place, by what the objective asks for."""
        values["shortfall"] = np.where(status == Status.ok, 1.0, np.nan)
        values["residual_wrench"] = np.zeros((6, len(status)))
        values["wall_force"] = self._no_walls(status)
        if not self.system.structure.friction:
            _add_parts(values, 1)
        if self.distributor_of is None:
            self._redistribute(self.distributor, values, status, inputs)
            return
        variant = inputs.get(VARIANT, np.zeros(len(status), dtype=int))
        for i in np.unique(variant).tolist():
            rows = np.flatnonzero(variant == i)
            part = slice(rows[0], rows[-1] + 1)
            own = {name: a[..., part] for name, a in values.items()}
            given = sample_rows(inputs, rows, len(variant))
            self._redistribute(self.distributor_of(i), own, status[part], given)

    def _redistribute(
        self,
        distributor: Distributor,
        values: Mapping[str, Array],
        status: Array,
        inputs: Mapping[str, Array],
    ) -> None:
        rows = distributor.rows(values, status)
        if not rows.size:
            return
        load = {name: a for name, a in inputs.items() if name not in ("q", "q1", "q2")}
        ports = {name: values[name].T[rows] for name in MOTION}
        ports |= sample_rows(load, rows, len(status))
        activation = ports.pop("activation", None)
        structure = self.system.structure
        # What parts ask for with least norm is known, unless friction or walls bear some of it.
        borne = bool(structure.friction or structure.walls or distributor.unsolved_friction)
        again = borne and bool({"share", "slip"} & values.keys())
        system = self.system.kernel("system" if again else "balance").run(ports).values
        better = distributor.solve(system, activation)
        least = np.fmax(CERTIFIED, values["bound"][rows])  # minimum norm has the same equations
        better["bound"] = np.fmax(least, bound(system["data_error"]))
        status[rows] = better.pop("status")
        for name, value in better.items():
            if name in values:
                values[name][..., rows] = value
        if "share" in values and not borne:  # the last part is internal
            share = values["share"]
            share[-1][:, rows] = values["effort"][:, rows] - share[:-1, :, rows].sum(axis=0)


def active(push: Array, force: Array) -> Array:
    """Which contacts bear, (N, k), at forces (N, k): bilateral ones, and those that push."""
    least = BEARS * np.abs(force).max(axis=1, keepdims=True, initial=0.0)
    found: Array = np.isfinite(force) & ((push == 0) | (push * force > least))
    return found


def _add_parts(values: dict[str, Array], count: int) -> None:
    """Parts more that ask for nothing, in place."""
    for name in {"share", "gravity"} & values.keys():
        zero = np.zeros((count, *values[name].shape[1:]))
        values[name] = np.concatenate([values[name], zero])
