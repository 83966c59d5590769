"""The equations in the numbers of bodies and actuators: `Model.regressor`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ..kinematics.chain import FAMILIES
from ..kinematics.chain.family import Constants
from ..mechanism.mechanism import Mechanism
from ..mechanism.quantities import Unit
from ..questions.number_paths import FileNumbers, NumberPath
from ..questions.numbers import Layout
from ..questions.regressor import PLATFORM, ROTOR, chain_numbers
from ..questions.structure import Structure, walls_of
from ..status import Status
from .arguments import NOTHING, Arguments
from .poses import Poses
from .system import System

Array = np.ndarray


@dataclass(frozen=True)
class Regressor:
    """The equations of motion in the standard numbers pi, in which efforts are linear.

        Y pi + load + friction |contact_force| = J^T effort

    Y: (..., m, P);  load: (..., m) [N, N m], of the wrench;  J: (..., n, m), joint' = J q_EE';
    friction: (..., m, k).
    numbers: pi of the mechanism, (P,) [SI];  names, units: of each, (P,).
    status: (...), of `Status`; NaN where it is not 0.
    contact_Y (..., k, P), contact_load (..., k), contact_J (..., k, n), contact_friction
    (..., k, k): contact_force = contact_Y pi + contact_load + contact_friction |contact_force| -
    contact_J effort [N].
    """

    Y: Array
    load: Array
    J: Array
    friction: Array
    contact_Y: Array
    contact_load: Array
    contact_J: Array
    contact_friction: Array
    numbers: Array
    names: tuple[str, ...]
    units: tuple[str, ...]
    status: Array

    def __repr__(self) -> str:
        return f"Regressor Y {self.Y.shape} of {', '.join(self.names[:3])} .. {self.names[-1]}"


class StandardNumbers:
    """The numbers that efforts are linear in, from the file's: see `questions.regressor`.

    names, units: (P,), of the platform and then chain by chain;  home: the file's numbers, (F,),
    by `file_names` and `file_units`.
    """

    def __init__(self, mechanism: Mechanism, structure: Structure) -> None:
        walls = walls_of(mechanism, structure)
        layout = Layout.of_file(structure, walls)
        self._file = FileNumbers(mechanism, structure, walls)
        self.home: np.ndarray = self._file.row
        n, shared = structure.n, layout.sizes[0]
        self.file_names: list[str] = [""] * self.home.size  # where the file has no such number
        self.file_units: list[Unit] = [Unit()] * self.home.size
        for unit, slots in self._file.leaves.values():
            for slot, at in zip(slots, map(self._file.place, slots), strict=True):
                self.file_names[at], self.file_units[at] = self._file.names[slot], unit
        z = ca.SX.sym("file", self.home.size)
        named = {n: z[start : start + count] for n, (start, count) in layout.parameters.items()}
        names, units = list(PLATFORM), list(PLATFORM.values())
        values = [_platform(named["mass"], named["com"], named["inertia"])]
        for i, chain in enumerate(mechanism.chains):
            lane = layout.lanes[structure.families.index(chain.kind)].items()
            own = ca.reshape(z[shared:], n, -1)[i, :].T
            file = {path.replace(".", "_"): own[s : s + count] for path, (s, count) in lane}
            values.append(_chain(chain.kind, Constants(**file)))
            names += [f"chain.{chain.name}.{name}" for name in chain_numbers(chain.kind)]
            units += chain_numbers(chain.kind).values()
        self.names: tuple[str, ...] = tuple(names)
        self.units: tuple[str, ...] = tuple(units)
        pi = ca.vertcat(*values)
        self._pi = ca.Function("standard", [z], [pi])
        self._slope = ca.Function("slope", [z], [ca.densify(ca.jacobian(pi, z))])

    def at(self, paths: list[str]) -> list[NumberPath]:
        """As `FileNumbers.at`."""
        return self._file.at(paths)

    def places(self, path: NumberPath) -> list[int]:
        """Where numbers stand among all of the file."""
        return [self._file.place(slot) for slot in path.slots]

    def of(self, file: Array) -> Array:
        """Standard numbers of the file's, (P,)."""
        return np.asarray(self._pi(file)).ravel()

    def slope(self, file: Array) -> Array:
        """Their derivatives by the file's, (P, F)."""
        return np.asarray(self._slope(file))


def _platform(mass: ca.SX, com: ca.SX, inertia: ca.SX) -> ca.SX:
    """Mass, first moment and inertia about O_M."""
    square = ca.dot(com, com)
    shift = [square - com[i] ** 2 for i in range(3)]
    shift += [-com[0] * com[1], -com[0] * com[2], -com[1] * com[2]]
    return ca.vertcat(mass, mass * com, inertia + mass * ca.vertcat(*shift))


def _chain(kind: str, f: Constants) -> ca.SX:
    own = FAMILIES[kind].to_standard(f)
    own |= {"actuator.viscous": f.actuator_viscous, "actuator.coulomb": f.actuator_coulomb}
    rotor = f.actuator_rotor_inertia * f.actuator_gear**2
    turned = "crank.inertia" if "crank.inertia" in own else ROTOR
    own[turned] = own.get(turned, ca.SX(0)) + rotor
    return ca.vertcat(*(own[name] for name in chain_numbers(kind)))


class Regression:
    """The regressor of one model; see `Model.regressor`."""

    def __init__(self, system: System, arguments: Arguments, poses: Poses) -> None:
        self._system, self._arguments, self._poses = system, arguments, poses

    @cached_property
    def standard(self) -> StandardNumbers:
        return StandardNumbers(self._system.mechanism, self._system.unreduced.structure)

    def __call__(
        self, q: Any, v: Any, a: Any, wrench: Any, at: Any, more: Mapping[str, Any] = NOTHING
    ) -> Regressor:
        """As `Model.regressor`. Args: more: gravity and base, if they are given."""
        own, kernel = (
            self._arguments,
            self._system.unreduced.with_inputs(tuple(more)).kernel("regressor"),
        )
        lead, inputs = own.samples((own.q, own.v, own.a), (q, v, a), wrench, at, more)
        states = [inputs.pop(name) for name in ("q", "q1", "q2")]
        count = max(map(len, (*states, *inputs.values()))) if 0 not in lead else 0
        rows = [np.broadcast_to(x, (count, x.shape[1])) for x in states]
        poses, closed = self._poses.platform_motion(*rows)
        answer = kernel.run(poses | inputs)
        status = np.where(closed, answer.status, Status.unreachable).astype(np.uint8)
        self._system.mark_overlaps(status, poses["pose"], {})
        result: dict[str, Array] = {}
        for prefix in ("", "contact_"):
            own_rows = self._rows(answer.values, prefix, count)
            result |= {f"{prefix}{name}": value for name, value in own_rows.items()}
        result["J"] = result["J"].swapaxes(1, 2)
        for name, value in result.items():
            value[status != Status.ok] = np.nan
            result[name] = value.reshape((*lead, *value.shape[1:]))
        standard = self.standard
        return Regressor(
            **result,
            numbers=standard.of(standard.home),
            names=standard.names,
            units=standard.units,
            status=status.reshape(lead),
        )

    def split(self, by_Y: Array, by_J: Array) -> dict[str, Array]:
        """Weights of Y, (N, m, P), and of J, (N, n, m), as those of the question's results."""
        structure, at = self._system.unreduced.structure, len(PLATFORM)
        N, m = by_Y.shape[:2]
        parts = {"platform": by_Y[:, :, :at].reshape(N, -1), "row": by_J.swapaxes(1, 2)}
        for i, chain in enumerate(self._system.mechanism.chains):
            group, size = structure.families.index(chain.kind), len(chain_numbers(chain.kind))
            own = parts.setdefault(f"chain_{group}", np.zeros((N, m * size, structure.n)))
            own[:, :, i] = by_Y[:, :, at : at + size].reshape(N, -1)
            at += size
        return parts

    def _rows(self, values: dict[str, Array], prefix: str, count: int) -> dict[str, Array]:
        """Y (N, rows, P), load (N, rows), J (N, rows, n) and friction (N, rows, k)."""
        structure = self._system.unreduced.structure
        n, k = structure.n, len(structure.contacts)
        rows = k if prefix else structure.m
        if not rows:
            sizes = {"Y": (len(self.standard.names),), "load": (), "J": (n,), "friction": (k,)}
            return {name: np.zeros((count, 0, *size)) for name, size in sizes.items()}
        columns: dict[int, Array] = {}
        lanes = iter(self._system.numbers.order)
        for group, size in enumerate(structure.counts):
            own = values[f"{prefix}chain_{group}"]  # (rows, p, lanes, N)
            columns |= {next(lanes): own[:, :, lane] for lane in range(size)}
        parts = [values[f"{prefix}platform"], *(columns[i] for i in range(n))]
        blocks = {
            "Y": np.concatenate(parts, axis=1),
            "load": values[f"{prefix}load"],
            "J": values[f"{prefix}row"],
            "friction": values.get(f"{prefix}friction", np.zeros((rows, k, count))),
        }
        return {name: np.moveaxis(value, -1, 0).copy() for name, value in blocks.items()}
