"""A model: one mechanism, one formulation, one route, ready to compute.

model = condyle.derive(mechanism, formulation="momentum", route="core")
solution = model.solve(motion, load)

Numbers in, numbers out. Every question is run by a kernel of the backend; samples that it cannot
vouch for go the robust path. What a model answers stands in three classes that it joins.
"""

from __future__ import annotations

import os
from functools import cached_property
from typing import Any, Self

import numpy as np

from ..accessors import extend
from ..backends.kernel import Kernel
from ..distribution import OBJECTIVES
from ..errors import InputError
from ..mechanism import load as load_mechanism
from ..mechanism.mechanism import Mechanism
from ..motion import Load, Motion, resolve_load_point
from ..questions.equations import INTERNAL, part_names
from .distributing import reference_force
from .forward_dynamics import ForwardDynamics
from .inverse_dynamics import Asked, InverseDynamics
from .poses import Poses
from .system import System

Array = np.ndarray
DEFAULT: Asked = (None, 0.0, 0.0)


class Model(InverseDynamics, ForwardDynamics, Poses):
    """Inverse and forward dynamics of a mechanism by one formulation and route.

    mechanism, formulation, route, backend: as derived;  derivation_seconds: what that took.
    independent, dependent: names of the coordinates q_EE, in order, and of those that the contacts
                            determine.
    characteristic_length:  what angles are multiplied by where they meet lengths [m].
    system: its equations, with their kernels.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        formulation: str = "virtual_power",
        route: str = "core",
        backend: str = "auto",
        distribution: str | None = None,
        preload: float = 0.0,
        contact_weight: float = 0.0,
        general: bool = False,
    ) -> None:
        """Derive the equations of motion.

        Args:   distribution: how efforts are chosen, of `condyle.distribution.OBJECTIVES`; default:
                bounded with cables, else minimum_norm.
                preload: least push of one-sided contacts [N].
                contact_weight: W / N_ref^2 of `weighted` [1/N^2].
                backend: compiled, numpy, or auto (compiled where there is a C compiler).
                general: for `renumbered`: kernels that serve every mechanism of the structure,
                by leaving out nothing that happens to be zero in this one.
        Raises: InputError:       for an unknown formulation, route or backend.
                UnsupportedError: where route `direct` has no closed form.
                MechanismError:   if the contacts do not hold the platform at home.
                CompilerError:    if compiled is asked for and there is no compiler.
        """
        system = System(mechanism, formulation, route, backend, general)
        self._assemble(system, (distribution, preload, contact_weight))

    def _assemble(self, system: System, asked: Asked) -> None:
        self.system, self._asked = system, asked
        self.mechanism, self.backend = system.mechanism, system.backend
        self.formulation, self.route = system.formulation, system.route
        self.independent, self.dependent = system.independent, system.dependent
        self.characteristic_length = system.length
        self.derivation_seconds = system.seconds
        if asked != DEFAULT:
            _ = self.policy  # what is asked for has to fit, now

    def _with(self, system: System, asked: Asked) -> Self:
        other = object.__new__(type(self))
        other._assemble(system, asked)
        return other

    def __repr__(self) -> str:
        return (
            f'Model of "{self.mechanism.name}": {self.formulation}, route {self.route}, '
            f"{self.backend.name}\n"
            f"  {len(self.mechanism.chains)} efforts from q = ({', '.join(self.independent)})"
        )

    def __copy__(self) -> Self:
        return self._with(self.system, self._asked)

    def __reduce__(self) -> tuple[Any, ...]:
        """Models travel as their recipe; kernels are found again in the cache."""
        how = self.formulation, self.route, self.backend.asked
        return type(self), (self.mechanism, *how, *self._asked, self.system.general is not None)

    def choosing(
        self, distribution: str | None = None, preload: float = 0.0, contact_weight: float = 0.0
    ) -> Self:
        """The same model, kernels and all, that chooses efforts otherwise; see `derive`."""
        other = self._with(self.system, (distribution, preload, contact_weight))
        _ = other.policy  # has to fit, now
        return other

    def renumbered(self, mechanism: Mechanism) -> Self:
        """The same model, if it is general, of another mechanism of the same structure.

        It shares the kernels, so that it costs a thousandth of a new one. The mechanism must have
        been checked, as one from a file or from `Mechanism.set` is.

        Raises: InputError: if the distribution does not fit the mechanism.
        """
        other = self._with(self.system.renumbered(mechanism), self._asked)
        _ = other.policy  # has to fit, now
        return other

    @cached_property
    def reference_force(self) -> float:
        """N_ref, by which `weighted` measures contact forces [N]."""
        return reference_force(self.mechanism)

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts that share the efforts."""
        structure = self.system.structure
        internal = not self.distributor.least_norm and not structure.friction
        return part_names(structure) + (INTERNAL,) * internal

    @property
    def limited(self) -> bool:
        """Whether efforts are chosen within limits."""
        return OBJECTIVES[self.policy.objective].limits

    @property
    def chooses_efforts(self) -> bool:
        """Whether efforts may be others than those of least norm."""
        return self.distributor.chooses

    def kernel(self, question: str, *details: Any) -> Kernel:
        """The kernel of a question; see `condyle.questions`."""
        return self.system.kernel(question, *details)

    def solve(
        self,
        motion: Motion,
        load: Load | None = None,
        load_point: str | None = None,
        flag: bool = False,
        reactions: bool = False,
        threads: int | None = None,
    ) -> Any:
        """Torques along a motion under a load: a `Solution`, labelled and with units.

        Args:   motion: what the platform does; load: what acts on it (none by default).
                load_point: platform point the load acts at; default: the load's own, else
                right_molar.
                flag: keep samples that cannot be computed, empty and with a status.
                reactions: forces and moments in every joint too.
                threads: at most so many; results do not depend on it.
        Raises: UnreachableError, SingularError: for such samples, unless `flag`.
                InputError: if motion or load do not fit the mechanism.
        """
        return extend("model.solve", self, motion, load, load_point, flag, reactions, threads)

    def load_point(self, name: str | None) -> Array:
        """Where a load acts, (3,) [m] in {M}: a named point; else right_molar, or the only one.

        Raises: InputError: if the mechanism has no such point.
        """
        points = self.mechanism.platform.points
        return np.array(points[resolve_load_point(name, points)])


def derive(
    mechanism: Mechanism | str | os.PathLike[str],
    formulation: str = "virtual_power",
    route: str = "core",
    backend: str = "auto",
    distribution: str | None = None,
    preload: float = 0.0,
    contact_weight: float = 0.0,
) -> Model:
    """Derive the equations of motion of a mechanism, or of one by its file or name; see `Model`.

    Raises: InputError: for what is no mechanism;  as of `Model`.
    """
    if isinstance(mechanism, str | os.PathLike):
        mechanism = load_mechanism(os.fspath(mechanism))
    if not isinstance(mechanism, Mechanism):
        raise InputError(
            f"derive takes a mechanism, the path of its file, or the name of a bundled one; got "
            f"{type(mechanism).__name__}"
        )
    return Model(mechanism, formulation, route, backend, distribution, preload, contact_weight)


def with_point(wrench: Array, point: Array) -> Array:
    """Wrenches (N, 6) and the point they act at, (3,), as loads (N, 9)."""
    return np.hstack([wrench, np.broadcast_to(point, (len(wrench), 3))])
