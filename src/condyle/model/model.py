"""A model: one mechanism, one formulation, one route, ready to compute.

model = condyle.derive("masticatory", formulation="momentum", route="core")
found = model.inverse_dynamics(q, v, a, wrench, at="right_molar")
found.effort, found.contact_force, found.status

Arrays have any leading shape: one state is a vector (m,), a motion (N, m), variants of a motion
(V, N, m); arguments broadcast, and results have their common leading shape. Every question is run
by a kernel of the backend; samples that it cannot vouch for are solved again by robust methods.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal, Self, get_args

import numpy as np
from numpy.typing import ArrayLike

from ..backends.choose import Backend, BackendName
from ..backends.kernel import Kernel
from ..distribution import ObjectiveName
from ..dynamics import FormulationName, Route
from ..errors import InputError, as_name, brief, did_you_mean
from ..mechanism import as_mechanism
from ..mechanism.cells import table
from ..mechanism.kept_home import Keep
from ..mechanism.mechanism import Mechanism
from ..motion.points import with_load_point
from ..questions.equations import INTERNAL, part_names
from .arguments import Arguments, given_of
from .derivatives import Derivatives, Differentiator
from .distributing import Distribution, Distributor, Unilateral, reference_force
from .elasticity import Elasticity
from .forward_dynamics import ForwardDynamics
from .forward_kinematics import TOLERANCE, ForwardKinematics
from .inverse_dynamics import InverseDynamics
from .model_result import ModelResult
from .poses import Poses, Space, States
from .regressor import Regression, Regressor
from .system import System
from .unchecked import Unchecked

if TYPE_CHECKING:
    import xarray as xr

    from ..frameworks.casadi_functions import CasadiFunctions
    from ..frameworks.jax_functions import JaxFunctions, JaxMethod
    from ..frameworks.torch_functions import TorchFunctions
    from ..identification.base_parameters import BaseParameters
    from ..markers import MeasuredChannels
    from ..motion import Load, Motion
    from .variants import Variants

Array = np.ndarray
Point = str | ArrayLike | None
Contacts = Literal["kept", "compliant"]
Outputs = str | tuple[str, ...] | list[str]
FORMULATION: FormulationName = "virtual_power"  # by default
ROUTE: Route = "core"
WORTH_A_KERNEL = 20_000  # samples, which numpy answers in some 0.2 s a question


class Model:
    """Inverse and forward dynamics and kinematics of a mechanism, by one formulation and route.

    mechanism, formulation, route, backend: as derived;  derivation_seconds: duration.
    independent, dependent: names of the coordinates q_EE, in order, and of those that the contacts
                            determine.
    characteristic_length:  factor that converts angles to lengths [m].
    kernel, poses, system:  kernels of questions, configurations of poses, and the equations with
                            their numbers: for extensions, and the rooms that stand on models.

    Shapes: m independent coordinates, n chains, k contacts; "..." is the leading shape.
        q, v, a: independent coordinates, rates and accelerations, (..., m) [m, rad; per s; per s^2]
        wrench:  force [N] and moment [N m] on the platform in {S}, (..., 6); None is zero
        at:      point of action: a platform point by name, or (..., 3) [m] in {M}; None is O_M
        effort:  of the actuators, in the order of the file, (..., n) [N m or N]
        gravity: in {S}, (..., 3) [m/s^2]; None is the file's
        base:    acceleration of the origin of {S} [m/s^2], angular velocity [rad/s] and angular
                 acceleration [rad/s^2] of the base, components in {S}, (..., 9); None: at rest
    Arrays, points or outputs that do not fit are an InputError.
    """

    def __init__(
        self,
        mechanism: Mechanism | str | os.PathLike[str],
        *,
        formulation: FormulationName = FORMULATION,
        route: Route = ROUTE,
        distribution: ObjectiveName | Distribution | None = None,
        unilateral: Unilateral | None = None,
        backend: BackendName = "auto",
    ) -> None:
        """As `derive`."""
        for name, given in (("formulation", formulation), ("route", route), ("backend", backend)):
            as_name(given, name)
        system = System.of(as_mechanism(mechanism), formulation, route, backend)
        chosen = Distribution.of(distribution)
        self._assemble(
            system, chosen if unilateral is None else replace(chosen, unilateral=unilateral)
        )

    def _assemble(
        self,
        system: System,
        distribution: Distribution,
        distributor_of: Callable[[int], Distributor] | None = None,
    ) -> None:
        """Args: distributor_of: as of `InverseDynamics`."""
        self.system: System = system
        self._requested: Distribution = distribution
        self.mechanism: Mechanism = system.mechanism
        self.backend: Backend = system.backend
        self.formulation: FormulationName = system.formulation
        self.route: Route = system.route
        self.independent: tuple[str, ...] = system.independent
        self.dependent: tuple[str, ...] = system.dependent
        self.characteristic_length: float = system.length
        self.derivation_seconds: float = system.seconds
        self._arguments = Arguments(self.mechanism)
        self._distributor_of = distributor_of
        if distribution != Distribution():
            _ = self.distribution  # what is asked for has to fit, now

    def _with(
        self,
        system: System,
        distribution: Distribution,
        distributor_of: Callable[[int], Distributor] | None = None,
    ) -> Self:
        other = object.__new__(type(self))
        other._assemble(system, distribution, distributor_of)
        _ = other.distribution  # has to fit, now
        return other

    def __repr__(self) -> str:
        return (
            f'Model of "{self.mechanism.name}": {self.formulation}, route {self.route}, '
            f"{self.backend.name}\n"
            f"  {len(self.mechanism.chains)} efforts from q = ({', '.join(self.independent)})"
        )

    def _repr_html_(self) -> str:
        rows = [
            ("equations", f"{self.formulation}, route {self.route}, {self.backend.name}"),
            ("q", ", ".join(self.independent)),
            ("efforts", ", ".join(self.mechanism.chain_names)),
            ("distribution", str(self.distribution.name)),
        ]
        return table("Model", self.mechanism.name, rows)

    def __copy__(self) -> Self:
        return self._with(self.system, self._requested)

    def __reduce__(self) -> tuple[Any, ...]:
        """Models travel as their recipe; kernels are found again in the cache."""
        how: dict[str, Any] = {
            "formulation": self.formulation,
            "route": self.route,
            "distribution": self._requested,
            "backend": self.backend.requested,
        }
        return partial(type(self), self.mechanism, **how), ()

    def with_distribution(self, distribution: ObjectiveName | Distribution | None = None) -> Self:
        """The same model with its kernels and another distribution; see `derive`."""
        return self._with(self.system, Distribution.of(distribution))

    # -- dynamics ----------------------------------------------------------------------------

    @cached_property
    def _inverse(self) -> InverseDynamics:
        distributor = Distributor(self.mechanism, self.distribution, self.backend)
        return InverseDynamics(self.system, self._arguments, distributor, self._distributor_of)

    @cached_property
    def _forward(self) -> ForwardDynamics:
        return ForwardDynamics(self.system, self._arguments, self.poses)

    @cached_property
    def _derived(self) -> Differentiator:
        return Differentiator(
            self.system,
            self._arguments,
            self.poses,
            lambda: self._inverse,
            lambda: self._forward,
            lambda: self._forward_kinematics,
            lambda: self._elasticity,
        )

    @cached_property
    def _unchecked(self) -> Unchecked:
        return Unchecked(lambda: self._inverse.unchecked(), lambda: self._forward.unchecked())

    def inverse_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        wrench: ArrayLike | None = None,
        at: Point = None,
        *,
        gravity: ArrayLike | None = None,
        base: ArrayLike | None = None,
        activation: ArrayLike | None = None,
        contacts: Contacts = "kept",
        outputs: Outputs = (),
        threads: int | None = None,
    ) -> ModelResult:
        """Efforts for a motion under a wrench: J_A^T tau = F of [Cheng2023] eqs (57), (63).

        Args:    q, v, a, wrench, at, gravity, base: as of `Model`.
                 activation: measured, (..., n), NaN of chains without, for `emg`, `emg_assisted`.
                 contacts: kept on their surfaces, or compliant: those with `compliance` yield to
                 their forces, quasi-statically, and `indentation` (..., k) [m] says how much.
                 outputs: names of further results, computed only if named; "all" is
                 all: share, gravity_share, pose, pose_rate, pose_acceleration, joint_rate,
                 joint_acceleration, configuration, condition, slip, friction_force, shortfall,
                 residual_wrench (6,): what activations of `emg` do not balance, moment about O_M;
                 wall_force: of enabled walls, 0 with `minimum_norm`;
                 ambiguous: whether, under friction, other motions follow from the same efforts;
                 contact_active: which contacts bear: unilateral ones where they push.
                 threads: maximum number of threads; default: the processors at hand. Results do
                 not depend on it.
        Returns: effort (..., n), contact_force (..., k) [N], status (...), of `Status`, and what
                 `outputs` names; see `ModelResult`. NaN where the status is not 0.
        """
        solver = inverse_of(self, contacts, activation)
        return solver(q, v, a, wrench, at, outputs, threads, given_of(gravity, base))

    def forward_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        effort: ArrayLike,
        wrench: ArrayLike | None = None,
        at: Point = None,
        *,
        gravity: ArrayLike | None = None,
        base: ArrayLike | None = None,
        outputs: Outputs = (),
        threads: int | None = None,
    ) -> ModelResult:
        """Accelerations under efforts and a wrench.

        Limits of efforts are not applied, and cables may have negative efforts.

        Args:    q, v, effort, wrench, at, gravity, base: as of `Model`;  threads: as of
                 `inverse_dynamics`.
                 outputs: of pose, pose_rate, pose_acceleration, twist_rate (6,): [V'; omega'] in
                 {S}, joint, joint_rate, joint_acceleration, configuration, condition, slip,
                 friction_force, all_accelerations, all_contact_forces; "all" is all. The last two
                 are of every solution under friction, with one more dimension s, NaN where there
                 are fewer.
        Returns: acceleration (..., m) [m/s^2, rad/s^2], contact_force (..., k) [N], status (...),
                 and what `outputs` names; see `ModelResult`. NaN where the status is not 0; in a
                 gimbal lock of the angles accelerations of coordinates alone are.
        """
        return self._forward(q, v, effort, wrench, at, outputs, threads, given_of(gravity, base))

    def unchecked(self) -> Unchecked:
        """The same functions for one state, at least latency: for a control loop.

            dynamics = model.unchecked()
            effort = dynamics.inverse_dynamics(q, v, a, wrench, at)             (n,)
            acceleration = dynamics.forward_dynamics(q, v, effort, wrench, at)  (m,)

        Arrays of doubles are fastest; `at` is an array (3,) or None. Results are new arrays, NaN
        where there are none. The functions serve all threads.
        Raises: InputError: for arrays that are no state.
        """
        return self._unchecked

    def linearise(
        self,
        q: ArrayLike,
        v: ArrayLike,
        effort: ArrayLike,
        wrench: ArrayLike | None = None,
        at: Point = None,
        *,
        gravity: ArrayLike | None = None,
        base: ArrayLike | None = None,
    ) -> ModelResult:
        """x' = A x + B effort about states x = (q, v), exact; the wrench is constant in {S}.

        Args:    as of `forward_dynamics`.
        Returns: A (..., 2 m, 2 m), B (..., 2 m, n), status (...); NaN where there are no
                 accelerations.
        """
        return self._derived.linearised(q, v, effort, wrench, at, given_of(gravity, base))

    def derivatives(
        self,
        of: str | tuple[str, ...] | list[str],
        wrt: str | tuple[str, ...] | list[str],
        *,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        a: ArrayLike | None = None,
        effort: ArrayLike | None = None,
        joint: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
        at: Point = None,
        gravity: ArrayLike | None = None,
        base: ArrayLike | None = None,
        zeros: bool = False,
        keep: Keep = "home",
    ) -> Derivatives:
        """Exact derivatives of results by states, loads and numbers of the file.

            d = model.derivatives("effort", ("q", "v", "a", "platform.mass"), q=q, v=v, a=a)
            d["effort", "q"]                                    (..., n, m)

        Within limits they are those of the active set; where it is about to change the status is
        `kink`, and they are those of the set that was chosen.

        Args:    of: of effort, contact_force (inverse dynamics, by the model's distribution);
                 acceleration, contact_force (forward dynamics, with `effort`); pose, joint,
                 contact_point, singularity_ratio; q (forward kinematics, with `joint`).
                 wrt: of q, v, a, wrench, at, effort, joint, gravity, base, as far as they are
                 given and the result depends on them, and paths of numbers of the file.
                 q, v, a, effort, wrench, at, gravity, base: as of `Model`;  joint: (..., n)
                 [rad or m].
                 zeros: whether what cannot matter gives zeros, not an error.
                 keep: home: a surface follows a change of other numbers, so that its contact stays
                 on it at home; all: all else is held.
        Returns: by name, (..., of the result, of what it is taken by) [SI], status (...), and
                 units. NaN where the status is neither ok nor kink.
        Raises:  InputError: for unknown names, missing arguments, and what cannot matter.
        """
        given = {"q": q, "v": v, "a": a, "effort": effort, "joint": joint}
        given |= {"wrench": wrench, "at": at, "gravity": gravity, "base": base}
        return self._derived.matrices(of, wrt, given, zeros, keep)

    def jvp(
        self,
        of: str | tuple[str, ...] | list[str],
        tangents: Mapping[str, ArrayLike],
        *,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        a: ArrayLike | None = None,
        effort: ArrayLike | None = None,
        joint: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
        at: Point = None,
        gravity: ArrayLike | None = None,
        base: ArrayLike | None = None,
        zeros: bool = False,
        keep: Keep = "home",
    ) -> Derivatives:
        """Derivatives along a direction, by one sweep: d["effort"], (..., n).

        Args: tangents: what each of `wrt` changes by, of its shape;  others: as of `derivatives`.
        """
        given = {"q": q, "v": v, "a": a, "effort": effort, "joint": joint}
        given |= {"wrench": wrench, "at": at, "gravity": gravity, "base": base}
        return self._derived.jvp(of, tangents, given, zeros, keep)

    def vjp(
        self,
        of: str | tuple[str, ...] | list[str],
        cotangents: Mapping[str, ArrayLike] | ArrayLike,
        wrt: str | tuple[str, ...] | list[str],
        *,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        a: ArrayLike | None = None,
        effort: ArrayLike | None = None,
        joint: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
        at: Point = None,
        gravity: ArrayLike | None = None,
        base: ArrayLike | None = None,
        zeros: bool = False,
        keep: Keep = "home",
    ) -> Derivatives:
        """Derivatives of a weighted sum of results, by one reverse sweep: d["q"], (..., m).

        Args: cotangents: weights of each result, of its shape, or of the one in `of`;  others: as
              of `derivatives`.
        """
        given = {"q": q, "v": v, "a": a, "effort": effort, "joint": joint}
        given |= {"wrench": wrench, "at": at, "gravity": gravity, "base": base}
        return self._derived.vjp(of, cotangents, wrt, given, zeros, keep)

    @cached_property
    def regression(self) -> Regression:
        """The regressor and the numbers it is taken by: for rooms that stand on models."""
        return Regression(self.system, self._arguments, self.poses)

    def regressor(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        wrench: ArrayLike | None = None,
        at: Point = None,
        *,
        gravity: ArrayLike | None = None,
        base: ArrayLike | None = None,
    ) -> Regressor:
        """The equations of motion in the numbers of bodies and actuators, linear in them.

            r = model.regressor(q, v, a)
            r.Y @ r.numbers + r.load                            J^T effort, (..., m)

        The numbers are the platform's mass, first moment and inertia about O_M; masses, first
        moments and inertias of chains about their own joints; of actuators rotor (in a crank's
        inertia), viscous and Coulomb friction. Friction at contacts is left out.

        Args:    as of `inverse_dynamics`.
        Returns: Y (..., m, P), load (..., m), J (..., n, m), numbers, names, units (P,), status
                 (...), and the rows that give contact forces: see `Regressor`.
        """
        return self.regression(q, v, a, wrench, at, given_of(gravity, base))

    def base_parameters(self, motion: Motion | str | os.PathLike[str]) -> BaseParameters:
        """Combinations of the regressor's numbers that a motion can tell: `BaseParameters`.

        Args: motion: or the path of its file.
        """
        from ..identification.base_parameters import base_parameters

        return base_parameters(self, motion)

    def mass_matrix(self, q: ArrayLike, *, space: Space = "q") -> Array:
        """M_r of [Cheng2023] eqs (57), (63), (..., m, m) [kg, kg m, kg m^2].

        Args:   q: (..., m).
                space: "X" for the mechanism without contacts, dual to X_EE, (..., 6, 6): eqs (61),
                (64).
        Raises: InputError: for another space, or a pose that cannot be reached.
        """
        return self.poses.matrix("inertia_matrix", q, None, space)

    def bias(self, q: ArrayLike, v: ArrayLike, *, space: Space = "q") -> Array:
        """C_r v, Coriolis and centrifugal forces without gravity, (..., m) [N, N m]; in `space`
        "X", (..., 6).

        Friction of actuators is added.
        """
        return self.poses.matrix("bias", q, v, space)

    def coriolis(self, q: ArrayLike, v: ArrayLike, *, space: Space = "q") -> Array:
        """C of Christoffel's symbols, (..., m, m): M' - 2 C is skew, and C v is `bias`.

        As `bias` it is without gravity; friction of actuators is in `bias` and not in C.

        Args:   q, v: (..., m);  space: as of `mass_matrix`; of "X" (..., 6, 6), C X_EE' is `bias`.
        Raises: InputError: for another space, or a pose that cannot be reached.
        """
        return self.poses.coriolis(q, v, space)

    def gravity(self, q: ArrayLike, *, space: Space = "q") -> Array:
        """G_r, forces that balance gravity, (..., m) [N, N m]; in `space` "X", (..., 6)."""
        return self.poses.matrix("gravity", q, None, space)

    # -- what gives --------------------------------------------------------------------------

    @cached_property
    def _elasticity(self) -> Elasticity:
        return Elasticity(self.system, self._arguments, self.poses, lambda: self._inverse)

    def stiffness(
        self,
        q: ArrayLike,
        effort: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
        at: Point = None,
        *,
        contacts: Contacts = "kept",
    ) -> ModelResult:
        """Stiffness and compliance of the loaded mechanism at rest, for small deflections.

            K = -df/dq,    f(q) = 0 the equilibrium of the independent coordinates,

        with what drives, couplers, rods, legs, muscles and ligaments give, and with the geometric
        term of efforts, weights and the load, by exact derivatives of the closure. Lengths of the
        file are those at q, under the load.

        Args:    q, wrench, at: as of `Model`; the wrench is constant in {S}. The point is that of
                 the compliance too.
                 effort: (..., n) [N m or N]; default: what balances gravity and the wrench by the
                 model's distribution.
                 contacts: kept on their surfaces, or compliant: those with `compliance` have
                 yielded to their forces and yield further, by the slope of their law at constant
                 curvatures; their freedom is reduced statically.
        Returns: K (..., m, m) in q: infinite where chains without a stiffness hold; geometric
                 (..., m, m), what the load adds to it; compliance (..., 6, 6): displacement of the
                 point (translation, then rotation, in {S}) by a wrench at it, of rank 6 - k at
                 most where k contacts are kept; translation, rotation (..., 3), its principal
                 values, falling, units apart, and their axes (..., 3, 3) as rows; eigenscrew
                 (..., 6, 6), a wrench (f, m) at the point a row, |f| = 1, under which it moves by
                 eigenscrew_compliance (..., 6) [rad/N] times (m, f), NaN of those that are held;
                 bound (...) of the error of K relative to its
                 largest entry, angles times the characteristic length; status (...):
                 `unstable` where K is not positive definite and the mechanism buckles.
                 NaN where the status is neither ok nor unstable.
        Raises:  InputError: where no chain gives; with compliant contacts where one does not, or
                 no contact has compliance.
        """
        return self._elasticity.stiffness(q, effort, wrench, at, yields(contacts))

    def modes(
        self,
        q: ArrayLike,
        effort: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
        at: Point = None,
        *,
        contacts: Contacts = "kept",
    ) -> ModelResult:
        """Natural frequencies and shapes of small vibrations about loaded poses at rest.

            (K - omega^2 M) x = 0,    (s^2 M + s D + K) x = 0 with damping D

        Rotors move with their joints, and rods that give follow their ends: their freedom is
        reduced statically. D is of actuators (damping, viscous), taut ligaments and compliant
        contacts.

        Args:    as of `stiffness`.
        Returns: frequency (..., m) [Hz], rising, without damping; negative where the mechanism
                 gives way, infinite where chains without a stiffness hold; shape (..., m, m), a
                 mode a row, in q, with x M x = 1; displacement (..., m, 6) of the point in each;
                 damping (..., m): ratios x D x / (2 omega); eigenvalue (..., 2 m) [1/s], complex:
                 s of the damped motions; bound (...) of the relative error of squares of
                 frequencies; status (...), as of `stiffness`.
        Raises:  InputError: as of `stiffness`.
        """
        return self._elasticity.modes(q, effort, wrench, at, yields(contacts))

    # -- kinematics --------------------------------------------------------------------------

    @cached_property
    def poses(self) -> Poses:
        """Configurations and singularities of poses, and the states of motions."""
        return Poses(self.system, self._arguments)

    @cached_property
    def _forward_kinematics(self) -> ForwardKinematics:
        return ForwardKinematics(self.mechanism)

    def inverse_kinematics(
        self, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None
    ) -> ModelResult:
        """Pose, joints and contacts at independent coordinates.

        Args:    q, v, a: (..., m); with v and a come rates and accelerations.
        Returns: pose (..., 6), joint (..., n), contact_point and contact_normal (..., k, 3),
                 beta, gamma, cos_gamma, discriminant (..., n), singularity, condition (...), status
                 (...): 0 where contacts are closed and chains reach. With v: pose_rate,
                 joint_rate; with a: pose_acceleration, joint_acceleration.
        """
        return self.poses.inverse_kinematics(q, v, a)

    def forward_kinematics(
        self,
        joint: ArrayLike,
        *,
        start: ArrayLike | None = None,
        time: ArrayLike | None = None,
        tolerance: float = TOLERANCE,
        contacts: Contacts = "kept",
        wrench: ArrayLike | None = None,
        at: Point = None,
    ) -> ModelResult:
        """Poses from encoder readings, joint coordinates plus `actuator.zero`, by least squares.

        Args:    joint: readings, (..., n) [rad or m]; turning joints may count whole turns.
                 start: poses X_EE (..., 6) from which each is followed; default: home.
                 time: (N,) [s], increasing: each row of joint, (N, n), follows the row before.
                 tolerance: largest residual of a joint [rad or m].
                 contacts: kept on their surfaces, or compliant: those with `compliance` yield to
                 their forces at rest under gravity and a wrench, by the model's distribution.
                 wrench, at: as of `Model`, for compliant contacts alone.
        Returns: pose (..., 6), q (..., m), residual (..., n), condition (...), status (...), of
                 `PoseStatus`; with compliant contacts effort (..., n), contact_force and
                 indentation (..., k) too. NaN where the status is not 0.
        """
        own = self._forward_kinematics
        if yields(contacts):
            inverse = self._inverse.yielding()
            kept = own.solve(joint, time, sys.float_info.max, start)
            return own.yielding(kept, joint, wrench, at, inverse, tolerance)
        if wrench is not None or at is not None:
            raise InputError(
                'wrench, at: poses of contacts that are "kept" do not follow from loads; leave '
                'them out, or take contacts "compliant"'
            )
        return own.solve(joint, time, tolerance, start)

    def jacobians(self, q: ArrayLike) -> ModelResult:
        """Jacobians of [Cheng2023] eqs (9), (15)-(18) at q, (..., m).

        Returns: J (..., n, 6): theta' = J [V; omega]; twist_basis (..., 6, m): [V; omega] =
                 twist_basis v, both regular in a gimbal lock of the angles; length_sensitivity
                 (...): d log ratio / d log L of the singularity ratio, L the characteristic length.
                 The paper's: J_theta (..., n, 6): theta' = J_theta X_EE'; M_J (..., 6, m);
                 M_1 (..., n, 3, 3), M_2 and M_3 (..., n, 3, 6): M_1 q_r' = M_2 X_EE',
                 q_r' = M_3 X_EE' of every chain.
        """
        return self.poses.jacobians(q)

    # -- motions -----------------------------------------------------------------------------

    def solve(
        self,
        motion: Motion,
        load: Load | None = None,
        *,
        load_point: str | None = None,
        flag: bool = False,
        reactions: bool = False,
        threads: int | None = None,
        measured: MeasuredChannels | str | os.PathLike[str] | None = None,
        contacts: Contacts = "kept",
    ) -> xr.Dataset:
        """Inverse dynamics along a motion under a load: an `xarray.Dataset` with labels and units.

        Args:   motion: of the platform; load: on it (none by default).
                load_point: its point of action, by name, or "x,y,z" [m] in {M}; several,
                separated by ";", bear equal parts. Default: the load's own, else right_molar.
                flag: keep samples that cannot be computed, empty and with a status.
                reactions: forces and moments in every joint too.
                threads: maximum number of threads; results do not depend on it.
                measured: markers and EMG, or their table's file: kept with the results, and what
                `emg` and `emg_assisted` follow.
                contacts: kept or compliant, as of `inverse_dynamics`.
        Raises: UnreachableError, SingularError: for such samples, unless `flag`.
                InputError: if motion or load do not fit the mechanism.
        """
        from ..results.solving import solve

        return solve(self, motion, load, load_point, flag, reactions, threads, measured, contacts)

    def variants(self, table: Mapping[str, ArrayLike], *, keep: Keep = "home") -> Variants:
        """Variants of the mechanism, by numbers of its file as columns: `condyle.model.variants`.

        The coordinates stay independent and dependent as they are here.

        Args:   table: path of `mechanism.get` -> values, (V, ...) [SI]: a mapping, a Dataset or a
                data frame. `chain.*.base` is (V, chains, 3); a table is its entries in the file's
                order.
                keep: as of `mechanism.set`: by default surfaces follow their contacts' home.
        Raises: InputError: for an unknown path, or values that do not fit.
        """
        from .variants import Variants

        return Variants(self, table, keep)

    # -- in other frameworks -----------------------------------------------------------------

    def to_jax(self, method: JaxMethod = "kernel", numbers: Sequence[str] = ()) -> JaxFunctions:
        """Dynamics as pure functions of JAX, which jit, vmap and differentiate: `JaxFunctions`.

        Args:   method: kernel: our own C, called by XLA on processors; graph: traced operation by
                operation, slower there, but it runs wherever JAX does.
                numbers: paths of the file's numbers that calls may give, and derivatives be taken
                by: `numbers={"platform.mass": 0.2}`; home is kept.
        Raises: MissingExtraError: without JAX.
                InputError:        where JAX is set to float32; for another method or path.
                UnsupportedError:  for `kernel` without a compiler; for efforts within limits.
        """
        from ..frameworks.jax_functions import JaxFunctions

        return JaxFunctions(self, method, numbers)

    def to_torch(self) -> TorchFunctions:
        """Dynamics as operators of PyTorch, with exact derivatives: `TorchFunctions`.

        Raises: MissingExtraError: without PyTorch.
        """
        from ..frameworks.torch_functions import TorchFunctions

        return TorchFunctions(self)

    def to_casadi(self) -> CasadiFunctions:
        """Dynamics as functions of CasADi, with exact first derivatives: `CasadiFunctions`.

        Raises: CompilerError:    without a compiler.
                UnsupportedError: for efforts within limits.
        """
        from ..frameworks.casadi_functions import CasadiFunctions

        return CasadiFunctions(self)

    # -- what it is made of ------------------------------------------------------------------

    @cached_property
    def distribution(self) -> Distribution:
        """How redundancy is resolved; forward dynamics has no need of it.

        Raises: InputError: where the default does not fit the mechanism.
        """
        return self._requested.checked(self.mechanism)

    @cached_property
    def reference_force(self) -> float:
        """N_ref, the reference of contact forces in `weighted` [N]."""
        return reference_force(self.mechanism)

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts of the efforts."""
        structure = self.system.structure
        internal = not self._inverse.distributor.least_norm and not structure.friction
        return part_names(structure) + (INTERNAL,) * internal

    @property
    def limited(self) -> bool:
        """Whether efforts are chosen within limits."""
        return self.distribution.objective.limits

    @property
    def chooses_efforts(self) -> bool:
        """Whether efforts may be others than those of least norm."""
        return self.distributor.chooses

    @property
    def distributor(self) -> Distributor:
        """What chooses the efforts."""
        return self._inverse.distributor

    @cached_property
    def _by_numpy(self) -> Model:
        system = self.system.by_numpy
        return self if system is self.system else self._with(system, self._requested)

    def kernel(self, question: str, *details: Any) -> Kernel:
        """The kernel of a question, with its details; see `condyle.questions`.

        Raises: InputError: for an unknown question.
        """
        return self.system.kernel(as_name(question, "question"), *details)


def inverse_of(model: Model, contacts: Contacts, activation: Any = None) -> InverseDynamics:
    """What answers `Model.inverse_dynamics`."""
    own = model._inverse if activation is None else model._inverse.following(activation)
    return own.yielding() if yields(contacts) else own


def inverse_for_motion(
    model: Model, motion: Motion, contacts: Contacts = "kept", activation: Any = None
) -> tuple[InverseDynamics, States, float | None]:
    """Inverse dynamics of a motion's samples, their q, q', q'', (N, m) each, and as of
    `Poses.of_motion` how far whole poses are off.

    Where contacts are compliant, what the motion prescribes is kept, and q yields.
    """
    states, residual = model.poses.of_motion(motion)
    own = inverse_of(model, contacts, activation)
    return own.yielding(model.poses.placing(motion)) if own.compliant else own, states, residual


def yields(contacts: Contacts) -> bool:
    """Whether contacts are `compliant`.

    Raises: InputError: for anything but `Contacts`.
    """
    if contacts not in (known := get_args(Contacts)):
        raise InputError(
            f"contacts: unknown kind {brief(contacts)}.{did_you_mean(str(contacts), known)}"
        )
    return contacts == "compliant"


def model_for(model: Model, count: int) -> Model:
    """The same model for so many samples in all: by numpy where it answers them before a kernel is
    built."""
    return model if count > WORTH_A_KERNEL else model._by_numpy


def model_with_load_point(model: Model, given: str | None) -> tuple[Model, str | None]:
    """The same model of a mechanism that has the point where a load acts, and its name: as of
    `condyle.motion.with_load_point`."""
    machine, name = with_load_point(model.mechanism, given)
    if machine is model.mechanism:
        return model, name
    system = replace(model.system, mechanism=machine, shared=model.system.family)
    return model._with(system, model._requested, model._distributor_of), name


def model_with_mechanism(model: Model, machine: Mechanism, distribution: Any = None) -> Model:
    """A model of another mechanism, derived as this one was."""
    return type(model)(
        machine,
        formulation=model.formulation,
        route=model.route,
        distribution=distribution,
        backend=model.backend.requested,
    )


def model_with_inputs(model: Model, given: Iterable[str]) -> Model:
    """The same model whose kernels always take gravity, or the base's motion: for simulations."""
    names = tuple(given)
    return model._with(model.system.with_inputs(names), model._requested) if names else model


def parts_with_inputs(model: Model, given: Iterable[str]) -> tuple[str, ...]:
    """`Model.parts` where samples give gravity or the base's motion, by name."""
    system = model.system
    chosen = model.parts[len(part_names(system.structure)) :]
    return part_names(system.with_inputs(tuple(given)).structure) + chosen


def derive(
    mechanism: Mechanism | str | os.PathLike[str],
    *,
    formulation: FormulationName = FORMULATION,
    route: Route = ROUTE,
    distribution: ObjectiveName | Distribution | None = None,
    unilateral: Unilateral | None = None,
    backend: BackendName = "auto",
) -> Model:
    """Derive the equations of motion of a mechanism.

    Args:   mechanism: or the path of its file, or the name of a bundled one.
            formulation, route: of `condyle.dynamics`; the results are the same.
            distribution: how redundancy is resolved: a name of `condyle.distribution.OBJECTIVES`,
            or a `Distribution`; default: cubic with muscles, bounded with
            cables, else minimum_norm.
            unilateral: keep or release: whether efforts of least norm let a unilateral contact
            pull, or release it; default: the distribution's, keep. See `Distribution`.
            backend: compiled, numpy, cuda, or auto (compiled where there is a C compiler).
    Raises: InputError:       for anything but a mechanism; an unknown formulation, route,
                              distribution or backend.
            UnsupportedError: where route `direct` has no closed form.
            MechanismError:   if the contacts do not hold the platform at home.
            CompilerError:    if compiled is asked for and there is no compiler.
    """
    return Model(
        mechanism,
        formulation=formulation,
        route=route,
        distribution=distribution,
        unilateral=unilateral,
        backend=backend,
    )
