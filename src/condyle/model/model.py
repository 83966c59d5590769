"""A model: one mechanism, one formulation, one route, ready to compute.

model = condyle.derive(mechanism, formulation="momentum", route="core")
solution = model.solve(motion, load)

Numbers in, numbers out. Every question is run by a kernel of the backend; samples that it cannot
vouch for go the robust path. A model is made of parts that share its system: `efforts`, `poses` and
`accelerations`.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from functools import cached_property
from typing import Any, Self

import numpy as np

from ..accessors import extend
from ..backends.kernel import Kernel
from ..distribution import OBJECTIVES
from ..errors import InputError
from ..mechanism import load_mechanism
from ..mechanism.mechanism import Mechanism
from ..motion import Load, Motion, resolve_load_point
from ..questions.equations import INTERNAL, part_names
from .data import Accelerations, Configuration, Efforts, Evaluation
from .distributing import Distributor, Policy, reference_force
from .forward_dynamics import ForwardDynamics
from .inverse_dynamics import InverseDynamics
from .poses import Poses, States
from .surveying import Survey
from .system import System

Array = np.ndarray
DEFAULT = (None, 0.0, 0.0)  # distribution, preload and contact weight


class Model:
    """Inverse and forward dynamics of a mechanism by one formulation and route.

    mechanism, formulation, route, backend: as derived;  derivation_seconds: what that took.
    independent, dependent: names of the coordinates q_EE, in order, and of those that the contacts
                            determine.
    characteristic_length:  what angles are multiplied by where they meet lengths [m].
    system, efforts, poses, accelerations: its parts.
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

    def _assemble(self, system: System, asked: tuple[str | None, float, float]) -> None:
        self.system, self._asked = system, asked
        self.mechanism, self.backend = system.mechanism, system.backend
        self.formulation, self.route = system.formulation, system.route
        self.independent, self.dependent = system.independent, system.dependent
        self.characteristic_length = system.length
        self.derivation_seconds = system.seconds
        if asked != DEFAULT:
            _ = self.policy  # what is asked for has to fit, now

    def _with(self, system: System, asked: tuple[str | None, float, float]) -> Self:
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

    @cached_property
    def policy(self) -> Policy:
        """How efforts are chosen; forward dynamics has no need of it.

        Raises: InputError: where the default does not fit the mechanism.
        """
        return Policy.of(self.mechanism, *self._asked)

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts that share the efforts."""
        structure = self.system.structure
        internal = not self.efforts.distributor.least_norm and not structure.friction
        return part_names(structure) + (INTERNAL,) * internal

    @property
    def limited(self) -> bool:
        """Whether efforts are chosen within limits."""
        return OBJECTIVES[self.policy.objective].limits

    @property
    def chooses_efforts(self) -> bool:
        """Whether efforts may be others than those of least norm."""
        return self.efforts.distributor.chooses

    def kernel(self, question: str, *details: Any) -> Kernel:
        """The kernel of a question; see `condyle.questions`."""
        return self.system.kernel(question, *details)

    # -- inverse dynamics --------------------------------------------------------------------

    @cached_property
    def efforts(self) -> InverseDynamics:
        distributor = Distributor(self.mechanism, self.policy, self.backend)
        return InverseDynamics(self.system, distributor)

    def evaluate(
        self, q: Array, q1: Array, q2: Array, load: Array, threads: int | None = None
    ) -> Evaluation:
        """Inverse dynamics at samples of the independent coordinates, with all that follows.

        Args: q, q1, q2: (N, m) each, in the order of `independent` [m, rad; per s; per s^2].
              load: (N, 9): force [N] and moment [N m] in {S}, and the point they act at, in {M}.
              threads: at most so many; default: the processors at hand. Results do not depend
              on it.
        """
        return self.efforts.everything(q, q1, q2, load, threads)

    def torques(
        self,
        q: Array,
        q1: Array,
        q2: Array,
        load: Array,
        outputs: Collection[str] = (),
        threads: int | None = None,
    ) -> Efforts:
        """Efforts alone, as fast as the machine.

        Args:    as for `evaluate`; outputs: what is wanted besides, of contact, share, gravity
                 (what of each share gravity and load alone ask for), motion, joint and condition:
                 ask for less, pay for less; threads: at most so many.
        Raises:  InputError: for an output that is none of these.
        """
        return self.efforts.efforts(q, q1, q2, load, outputs, threads)

    def one(self, q: Array, q1: Array, q2: Array, load: Array) -> Array:
        """Efforts of one sample, (n,) [N m or N], at least latency: for a control loop.

        Args: q, q1, q2: (m,) each, in the order of `independent`;  load: (9,), as of `evaluate`.
              Arrays of doubles go fastest.
        Returns: efforts in the order of the chains, a new array; NaN where there are none.
        Raises:  InputError: for arrays that do not fit.
        """
        return self.efforts.one(q, q1, q2, load)

    def solve(
        self,
        motion: Motion,
        load: Load | None = None,
        load_point: str | None = None,
        flag: bool = False,
        reactions: bool = False,
        threads: int | None = None,
    ) -> Any:
        """Torques along a motion under a load: a labelled dataset with units.

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

    # -- forward dynamics --------------------------------------------------------------------

    @cached_property
    def accelerations(self) -> ForwardDynamics:
        return ForwardDynamics(self.system)

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
        return self.accelerations.accelerations(q, q1, effort, load, outputs, threads)

    def forward_one(self, q: Array, q1: Array, effort: Array, load: Array) -> Array:
        """Accelerations of one sample, (m,), at least latency; NaN where there are none.

        Args: q, q1: (m,) each;  effort: (n,);  load: (9,); as of `forward`. Arrays of doubles go
              fastest.
        Returns: a new array.
        Raises:  InputError: for arrays that do not fit.
        """
        return self.accelerations.one(q, q1, effort, load)

    def linearised(self, q: Array, q1: Array, effort: Array, load: Array) -> tuple[Array, Array]:
        """x' = A x + B effort about states x = (q, q'), exact; arguments as of `forward`.

        The load stays as it is in {S}. Returns: A, (N, 2 m, 2 m), and B, (N, 2 m, n); NaN where
        there are no accelerations.
        """
        return self.accelerations.linearised(q, q1, effort, load)

    # -- poses -------------------------------------------------------------------------------

    @cached_property
    def poses(self) -> Poses:
        return Poses(self.system)

    def configuration(self, pose: Array, threads: int | None = None) -> Configuration:
        """Joint coordinates, contact points and singularity measures at poses X_EE, (N, 6)."""
        return self.poses.configuration(pose, threads)

    def survey(self, q: Array, wanted: Collection[str] = (), threads: int | None = None) -> Survey:
        """What poses are like, each judged, as fast as the machine: for maps.

        Args:    q: (N, m), in the order of `independent`.  wanted: of `SURVEYED`: pose, joint,
                 transmission, rates (of the joints on q', lanes last but one), rows (of the
                 dimensionless J_W), ratio, points (of the contacts).
        Raises:  InputError: for a name that is none of these.
        """
        return self.poses.survey(q, wanted, threads)

    def inertia_matrix(self, q: Array, space: str = "q") -> Array:
        """M_r of [Cheng2023] eqs (57), (63): (N, m, m) in q_EE.

        Args: q: (N, m), in the order of `independent`.
              space: "X" for the mechanism without contacts, dual to X_EE, (N, 6, 6): eqs (61),
              (64).
        Raises: InputError: for another space, or a pose that cannot be reached.
        """
        return self.poses.matrices(q, np.zeros_like(q), "inertia_matrix", space)

    def bias(self, q: Array, q1: Array, space: str = "q") -> Array:
        """C_r q', (N, m) [N, N m]: Coriolis and centrifugal forces; in `space` "X", (N, 6)."""
        return self.poses.matrices(q, q1, "bias", space)

    def gravity(self, q: Array, space: str = "q") -> Array:
        """G_r, (N, m) [N, N m]: what holds it against gravity; in `space` "X", (N, 6)."""
        return self.poses.matrices(q, np.zeros_like(q), "gravity", space)

    def jacobians(self, q: Array) -> dict[str, Array]:
        """Jacobians of [Cheng2023] eqs (9), (15)-(18) at samples (N, m).

        Returns: J_theta (N, n, 6): theta' = J_theta X_EE'; M_J (N, 6, m); M_1 (N, n, 3, 3), M_2 and
                 M_3 (N, n, 3, 6): M_1 q_r' = M_2 X_EE', q_r' = M_3 X_EE' of every chain.
        """
        return self.poses.jacobians(q)

    def independent_motion(self, motion: Motion) -> tuple[States, float | None]:
        """q_EE and its rates, (N, m) each, from a motion of any kind.

        Also returns the largest distance of a given whole pose from the contacts [m], which the
        projection removes; None for other kinds.
        """
        return self.poses.of_motion(motion)

    def independent_states(
        self,
        names: Sequence[str],
        value: Array,
        rate: Array,
        acceleration: Array,
        landmark: str | None = None,
        threads: int | None = None,
    ) -> States:
        """q_EE and its rates from another set of coordinates or a landmark's displacement.

        Samples that the contacts cannot meet come back as NaN.
        """
        return self.poses.states(names, (value, rate, acceleration), landmark, threads)

    def contact_residual(self, pose: Array) -> float:
        """Largest |phi| of the contacts over poses, (N, 6) [m]."""
        return self.poses.contact_residual(pose)

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
