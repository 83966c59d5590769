"""Efforts within limits: which samples the least norm does not serve, and what serves them.

The kernels give the efforts of least norm. Where these break a limit, or another objective is asked
for, the equations of those samples go to `condyle.distribution`, and come back certified.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any, Literal, TypeAlias

import numpy as np

from ..backends.choose import Backend
from ..backends.notice import notice
from ..distribution import EMG, OBJECTIVES, Objective, Outcome, Problem, Result, distribute, within
from ..distribution.objectives import NAMED, ObjectiveName
from ..dynamics.minimum_norm import minimum_norm
from ..errors import InputError, brief, did_you_mean, join
from ..kinematics.chain import FAMILIES
from ..kinematics.chain.muscle import MuscleState, muscles
from ..mechanism.chain import limits
from ..mechanism.home import characteristic_length
from ..mechanism.mechanism import Mechanism
from ..questions.friction import MOST
from ..status import Status

MINIMUM_NORM: ObjectiveName = "minimum_norm"
Unilateral: TypeAlias = Literal["keep", "release"]
UNILATERAL: tuple[Unilateral, ...] = ("keep", "release")
RELEASED = replace(
    NAMED["bounded"], chosen="of minimum norm with unilateral contacts that never pull"
)
# N, by which a wall's force counts as an activation: so much that it costs hardly anything, as the
# fossa of de Zee and others, J. Biomech. 40, 1192-1201 (2007).
WALL = 20_000.0
PASSIVE = -2  # among the parts of a balance without friction: before the load
_STATUS = np.array([Status[outcome.name] for outcome in Outcome], dtype=np.uint8)


@dataclass(frozen=True)
class Distribution:
    """How redundancy is resolved: the objective that efforts minimise, with its numbers.

    name:           of `condyle.distribution.OBJECTIVES`, or `emg`; None: `cubic` with muscles,
                    `bounded` with cables, else `minimum_norm`.
    preload:        minimum compressive force on unilateral contacts [N]; on contacts with friction
                    that are bilateral, minimum force of either sign.
    contact_weight: W of `weighted`, dimensionless: it minimises the sum of (effort_i / max_i)^2
                    and of W (lambda_k / N_ref)^2 over the contacts, where N_ref [N] is
                    `Model.reference_force`, the largest limit of the actuators, of torques
                    over the characteristic length.
    emg_weight:     of `emg_assisted`, dimensionless: it minimises the sum of the squares of the
                    activations of chains without EMG and of emg_weight (activation - EMG's)^2.
    unilateral:     what `minimum_norm` does at a unilateral contact that would have to pull. keep:
                    it pulls, and `contact_loss` reports it. release: it bears nothing, and the
                    efforts of least norm balance the rest; there are no effort limits. Other
                    objectives never let such a contact pull.
    """

    name: ObjectiveName | None = None
    preload: float = 0.0
    contact_weight: float = 0.0
    emg_weight: float = 1.0
    unilateral: Unilateral = "keep"

    def __post_init__(self) -> None:
        if not isinstance(self.name, str | None):
            raise InputError(
                "distribution: expected a name, a condyle.Distribution or None, got "
                f"{type(self.name).__name__} {brief(self.name)}"
            )
        for label in ("preload", "contact_weight", "emg_weight"):
            value = getattr(self, label)
            number = isinstance(value, int | float | np.floating | np.integer)
            if not number or not 0 <= value <= sys.float_info.max:
                raise InputError(f"{label}: expected a number of at least 0, got {brief(value)}")
        if self.unilateral not in UNILATERAL:
            raise InputError(
                f"unilateral: expected {' or '.join(UNILATERAL)}, got {brief(self.unilateral)}"
            )
        if not self.emg_weight:
            raise InputError("emg_weight: expected a number above 0, got 0")

    @staticmethod
    def of(given: Any) -> Distribution:
        """The distribution of a name, of None or of a distribution.

        Raises: InputError: for anything else.
        """
        return given if isinstance(given, Distribution) else Distribution(given)

    def checked(self, mechanism: Mechanism) -> Distribution:
        """The same, by name, checked against a mechanism.

        Raises: InputError: for an unknown objective, or one that does not fit the mechanism.
        """
        name: Any = self.name
        if name is None:
            kinds = {chain.kind for chain in mechanism.chains}
            name = "cubic" if "muscle" in kinds else "bounded" if "cable" in kinds else MINIMUM_NORM
        if name not in NAMED:
            hint = did_you_mean(name, NAMED)
            raise InputError(f'distribution: unknown objective "{name:.60}".{hint}')
        objective = NAMED[name]
        units = {FAMILIES[chain.kind].effort_unit for chain in mechanism.chains}
        # The default without cables is as old as the program, and stays.
        chosen = self.name is not None or name != MINIMUM_NORM
        if chosen and len(units) > 1 and not objective.mixes_units:
            fit = _those(lambda o: o.mixes_units)
            raise InputError(
                f"distribution {name} adds the squares of efforts, and this mechanism has "
                f"{' and '.join(sorted(units))}: take one of {fit}, which measure each by its limit"
            )
        added = objective.limits and not objective.mixes_units
        if added and 0 < len(muscles(mechanism.chains)) < len(mechanism.chains):
            raise InputError(
                f"distribution {name} adds the squares of efforts and, for muscles, of "
                "activations; this mechanism has other chains beside muscles: take one of "
                f"{_those(lambda o: o.mixes_units)}, which measure each by its limit"
            )
        if objective.mixes_units:
            _require_limits(mechanism, objective)
        one_sided = any(contact.one_sided for contact in mechanism.contacts)
        releases = one_sided and self.unilateral == "release"
        if self.preload and not objective.limits and not releases:
            raise InputError(
                f"preload {self.preload:g} N is for efforts within limits, and distribution {name} "
                f"knows none: take one of {_those(lambda o: o.limits)}"
            )
        if self.contact_weight and not objective.weighs:
            weighing = _those(lambda o: o.weighs)
            raise InputError(
                f"distribution {name} does not weigh contact forces: take {weighing}, or "
                "leave the contact weight out"
            )
        if self.emg_weight != 1 and name != "emg_assisted":
            raise InputError(
                f"distribution {name} does not weigh EMG: take emg_assisted, or leave the EMG "
                "weight out"
            )
        rubs = [contact.friction.coefficient > 0 for contact in mechanism.contacts]
        if name == EMG.name and (any(rubs) or self.preload):
            raise InputError(
                "distribution emg takes contact forces without friction and without a preload: "
                "take emg_assisted"
            )
        if self.preload and not any(rubs) and not one_sided:
            notice(
                f"preload {self.preload:g} N presses on nothing: no contact of "
                f'"{mechanism.name}" is unilateral or has friction. Set one_sided = true at those '
                "that only push"
            )
        return replace(self, name=name, unilateral="release" if releases else "keep")

    @property
    def releases(self) -> bool:
        """Whether efforts of least norm release unilateral contacts; of one that was checked."""
        return self.name == MINIMUM_NORM and self.unilateral == "release"

    @property
    def objective(self) -> Objective:
        """What is minimised; of one that was checked."""
        return RELEASED if self.releases else NAMED[str(self.name)]


def _those(fit: Callable[[Objective], bool]) -> str:
    return ", ".join(n for n, o in OBJECTIVES.items() if fit(o) and not o.follows)


def _require_limits(mechanism: Mechanism, objective: Objective) -> None:
    """Raises InputError where efforts are measured by limits and actuators have none."""
    others = [chain for chain in mechanism.chains if chain.kind != "muscle"]
    without = [chain.name for chain in others if not np.isfinite(limits(chain).greatest)]
    if without:
        raise InputError(
            f"distribution {objective.name} measures each effort by its limit, and {join(without)} "
            f"{'has' if len(without) == 1 else 'have'} none: give torque_limit or force_limit in "
            "the mechanism file, or take bounded"
        )
    both = [chain.name for chain in mechanism.chains if limits(chain).low < 0]
    if objective.pulls and both:
        raise InputError(
            f"distribution {objective.name} is for efforts that only pull, and {join(both)} may be "
            "negative: set the lower limit to 0, or take weighted"
        )


def reference_force(mechanism: Mechanism) -> float:
    """The largest limit of the chains [N]; 1 N where none has a limit.

    `weighted` adds W (lambda_k / N_ref)^2 of every contact: with W = 1 a contact force as large as
    the strongest actuator's weighs as much as that actuator at its limit. A torque counts as the
    force that it gives at the characteristic length.
    """
    forces = np.array([force for force, _ in _forces(mechanism)])
    known = forces[np.isfinite(forces) & (forces > 0)]
    return float(known.max()) if known.size else 1.0


def _forces(mechanism: Mechanism) -> list[tuple[float, float]]:
    """The largest force of every chain [N], and the arm that it comes from [m], or 1."""
    forces = []
    for chain in mechanism.chains:
        arm = 1.0 if FAMILIES[chain.kind].effort_unit == "N" else characteristic_length(mechanism)
        greatest = getattr(chain, "muscle", limits(chain))
        forces.append((getattr(greatest, "max_force", limits(chain).greatest) / arm, arm))
    return forces


class Distributor:
    """Chooses the efforts of one mechanism."""

    def __init__(
        self, mechanism: Mechanism, distribution: Distribution, backend: Backend | None = None
    ) -> None:
        """Args: distribution: checked against the mechanism.
        backend: what the question of efforts runs by; None: the robust solver alone.
        """
        self.distribution: Distribution = distribution
        self._mechanism = mechanism
        self._backend = backend
        self._rubs = [contact.friction.coefficient > 0 for contact in mechanism.contacts]
        self.friction: bool = any(self._rubs)
        # More patterns than a kernel goes through.
        self.unsolved_friction: bool = sum(self._rubs) > MOST
        both = [limits(chain) for chain in mechanism.chains]
        self._chains: list[Any] = [*mechanism.chains]
        self._muscles = [] if distribution.name == MINIMUM_NORM else muscles(mechanism.chains)
        self._low, self._high = (np.array([getattr(x, n) for x in both]) for n in ("low", "high"))
        if distribution.releases:
            self._low, self._high = (
                np.full_like(self._low, -np.inf),
                np.full_like(self._high, np.inf),
            )
        self._greatest: np.ndarray | None = None
        if self._muscles:  # in the place of their tension, their activation
            self._high[self._muscles] = 1.0
            self._greatest = np.maximum(np.abs(self._low), np.abs(self._high))
            if distribution.objective.by_work:
                own = [self._chains[i].muscle for i in self._muscles]
                work = np.array([m.max_force * m.optimal_length for m in own])
                self._greatest[self._muscles] = work.max() / work
        self._walls = () if distribution.name == MINIMUM_NORM else mechanism.enabled_walls
        if self._walls:
            # Efforts besides, that only push: force over `WALL`.
            if self._greatest is None:
                self._greatest = np.maximum(np.abs(self._low), np.abs(self._high))
            count = len(self._walls)
            self._greatest = np.append(self._greatest, np.ones(count))
            self._low = np.append(self._low, np.zeros(count))
            self._high = np.append(self._high, np.full(count, np.inf))
        sides = [c.push if c.one_sided else 0 for c in mechanism.contacts]
        self.push: np.ndarray = np.array(sides, dtype=float)

    @property
    def shared_reference(self) -> bool:
        """Whether several chains have the largest force, which contact weights are of."""
        forces = np.array([force for force, _ in _forces(self._mechanism)])
        return int((forces == reference_force(self._mechanism)).sum()) > 1

    def weight_by_reference(self) -> tuple[float, np.ndarray, float]:
        """d W / d N_ref of `weighted`, and d N_ref by the least and greatest efforts, (2, n), and
        by the characteristic length; all zero without a contact weight."""
        n = len(self._chains)
        weight = self.distribution.objective.weight(self.problem)
        if not weight:
            return 0.0, np.zeros((2, n)), 0.0
        forces, arms = (np.array(x) for x in zip(*_forces(self._mechanism), strict=True))
        reference = reference_force(self._mechanism)
        by_ends = np.zeros((2, n))
        strongest = int(np.argmax(np.where(np.isfinite(forces), forces, -np.inf)))
        if forces[strongest] != reference:  # none has a limit
            return -2 * weight / reference, by_ends, 0.0
        of_high = abs(self._high[strongest]) >= abs(self._low[strongest])
        by_ends[int(of_high), strongest] = (1.0 if of_high else -1.0) / arms[strongest]
        turns = FAMILIES[self._chains[strongest].kind].effort_unit != "N"
        return -2 * weight / reference, by_ends, -reference / arms[strongest] * turns

    @property
    def least_norm(self) -> bool:
        """Whether the kernels' own efforts are those wanted."""
        return self.distribution.name == MINIMUM_NORM and not self.distribution.releases

    @property
    def chooses(self) -> bool:
        """Whether it has a say at all in the efforts."""
        return not self.least_norm or self.unsolved_friction

    def question(self, with_contact_force: bool) -> tuple[tuple[Any, ...], dict[str, np.ndarray]]:
        """The question of one state's efforts with its details, none where a kernel alone cannot
        say what they are; and its ports that are always given the same.

        Args: with_contact_force: whether contact forces and the bound are wanted too.
        """
        objective = self.distribution.objective
        if not self.chooses:
            return ("inverse", ("contact", "bound") if with_contact_force else ()), {}
        # Cubes take twice the steps, and compilers a minute.
        # A muscle's limits depend on the state, as what walls can bear does.
        if objective.term != "square" or objective.follows:
            return (), {}
        if self.unsolved_friction or self._muscles or self._walls:
            return (), {}
        ports = objective.ports(self.problem)
        return ("limited", objective.term, "weight" in ports), ports

    @cached_property
    def problem(self) -> Problem:
        """What the distribution asks for, of no samples."""
        empty = np.zeros((0, len(self._low), 6)), np.zeros((0, len(self.push), 6))
        return self._problem(np.zeros((0, 6)), *empty)

    def rows(self, values: Mapping[str, np.ndarray], status: np.ndarray) -> np.ndarray:
        """Good samples that the least norm does not serve."""
        good = status == Status.ok
        if self.unsolved_friction:
            return np.flatnonzero(good)
        if self.least_norm:
            return np.empty(0, dtype=int)
        if self.distribution.objective.name == "bounded" and not (self._muscles or self._walls):
            fits = within(self.problem, values["effort"].T, values["contact_force"].T)
            good &= ~fits
        return np.flatnonzero(good)

    def solve(
        self, system: Mapping[str, np.ndarray], activation: np.ndarray | None = None
    ) -> dict[str, np.ndarray]:
        """Efforts, contact forces, status and shortfall by name, samples last.

        With what of `system` the shares need, these as well, and how contacts slide.

        Args:   system: the results of that question or of `balance`, samples last.
                activation: measured, (N, n), of the distributions that follow it.
        Raises: InputError: where that is missing.
        """
        s = {name: np.moveaxis(a, -1, 0) for name, a in system.items()}
        Q, J = s["Q"], s["J"].transpose(0, 2, 1)
        passive, active = np.zeros(J.shape[:2]), np.ones(J.shape[:2])
        if self._muscles:
            passive, active = of_activations(self._chains, s)
            Q = Q - np.einsum("rni,rn->ri", J, passive)
        columns, n = active[..., None] * J, J.shape[1]
        if self._walls:
            near = s["wall_gap"] < [wall.reach for wall in self._walls]
            columns = np.concatenate([columns, WALL * near[..., None] * s["wall"]], axis=1)
        problem = self._problem(Q, columns, s["normal"], s["friction"])
        name = self.distribution.objective.name
        if self.distribution.objective.follows:
            problem = self._following(problem, activation)
        if name == EMG.name:
            result, left = _as_measured(problem, characteristic_length(self._mechanism))
        else:
            result, left = distribute(problem, name, self._backend), np.zeros_like(Q)
        values = {
            "residual_wrench": left.T,
            "effort": (passive + active * result.effort[:, :n]).T,
            "contact_force": result.contact_force.T,
            "status": _STATUS[result.status],
            "shortfall": result.shortfall,
        }
        if self._walls:
            values["wall_force"] = WALL * (near * result.effort[:, n:]).T
            if "A" in system:  # bearing them is a part, as bearing ligaments
                borne = np.einsum("wr,rwi->ri", values["wall_force"], s["wall"])
                s["b"] = s["b"].copy()
                s["b"][:, PASSIVE] -= (s["Pi"] @ borne[..., None])[..., 0]
        if "A" in system:
            rubbing = values["contact_force"].T if self.friction else None
            values["share"] = shares(s, values["effort"].T, rubbing).transpose(2, 1, 0)
            values |= {name: system[name] for name in ("slip", "drag")}
        return values

    def _following(self, problem: Problem, activation: np.ndarray | None) -> Problem:
        """The same with measured activations as the target; 0 where a chain has none."""
        if activation is None:
            raise InputError(
                f"distribution {self.distribution.name} follows activations from EMG, and none are "
                "given: give a table of EMG (measured=... of solve and run, --measured of the "
                "command), or activation=... of inverse_dynamics; other questions have no such "
                "input and take another distribution"
            )
        beside = ((0, 0), (0, len(self._walls)))  # walls have none
        activation = np.pad(activation, beside, constant_values=np.nan)
        known = np.isfinite(activation)
        limit = problem.scale
        weight = np.where(known.any(axis=0), self.distribution.emg_weight, 1.0)
        target = np.where(known, activation, 0.0) * limit
        return replace(problem, target=target, greatest=limit / np.sqrt(weight))

    def _problem(self, *balance: np.ndarray) -> Problem:
        """Q, J, normal and friction (if any) of samples, with what the distribution asks for."""
        Q, J, normal, *friction = balance
        return Problem(
            Q,
            J,
            normal,
            friction[0] if friction else None,  # type: ignore[arg-type]
            low=self._low,
            high=self._high,
            push=self.push,
            rubs=np.array(self._rubs, dtype=bool),
            greatest=self._greatest,
            preload=self.distribution.preload,
            contact_weight=self.distribution.contact_weight,
            reference_force=reference_force(self._mechanism),
        )


def of_activations(
    chains: Sequence[Any], s: Mapping[str, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Tension = passive + active times activation, (N, n) each; 0 and 1 for other chains.

    Args: s: stretch and joint_rate, of the questions `system` and `balance`, samples first.
    """
    columns, home = muscles(chains), np.zeros(len(chains))
    for i in columns:
        home[i] = np.linalg.norm(np.subtract(chains[i].platform, chains[i].anchor))
    state = MuscleState.of(chains, home * (1 - s["stretch"]), s["joint_rate"])
    passive, active = np.zeros_like(state.passive), np.ones_like(state.active)
    passive[:, columns], active[:, columns] = state.passive[:, columns], state.active[:, columns]
    return passive, active


def _as_measured(p: Problem, length: float) -> tuple[Result, np.ndarray]:
    """Efforts at their targets, contact forces nearest to the balance, and what is left of it.

    Nearest: least squares of the wrench, moments over the characteristic length, under the signs of
    unilateral contacts: of all sets of contacts that bear, the best whose forces have them.
    """
    assert p.target is not None
    result = Result.empty(p.count, p.n, p.k)
    needed = p.Q - np.einsum("rni,rn->ri", p.J, p.target)
    scale = np.repeat([1.0, 1.0 / length], 3)
    fine = np.isfinite(needed).all(axis=1)
    best = np.where(fine, np.inf, np.nan)
    force = np.zeros((p.count, p.k))
    for bears in product(*[(True, False) if push else (True,) for push in p.push]):
        some = np.flatnonzero(bears)
        columns = (p.normal[:, some] * scale).transpose(0, 2, 1)
        trial = np.zeros_like(force)
        nearest = np.linalg.pinv(columns[fine]) @ (needed * scale)[fine, :, None]
        trial[np.ix_(fine, some)] = nearest[..., 0]
        wrong = ((needed - np.einsum("rki,rk->ri", p.normal, trial)) * scale) ** 2
        better = (trial * p.push >= 0).all(axis=1) & (wrong.sum(axis=1) < best)
        best[better], force[better] = wrong.sum(axis=1)[better], trial[better]
    result.effort[fine], result.contact_force[fine] = p.target[fine], force[fine]
    result.status[...] = np.where(fine, Outcome.ok, Outcome.unreachable)
    result.shortfall[fine] = 1.0
    return result, needed - np.einsum("rki,rk->ri", p.normal, force)


def shares(
    system: Mapping[str, np.ndarray], effort: np.ndarray, contact_force: np.ndarray | None
) -> np.ndarray:
    """What each part asks for with least norm; the rest of the efforts is internal, and last.

    Args:    system: results of that question, samples first;  effort: (N, n).
             contact_force: (N, k) [N] where friction is a part of its own, before the last.
    Returns: (N, n, parts).
    """
    A = system["A"].transpose(0, 2, 1)
    with np.errstate(invalid="ignore"):
        right = system["b"].transpose(0, 2, 1)
        if contact_force is not None:
            rubbed = (np.abs(contact_force)[..., None] * system["friction"]).sum(axis=1)
            right = np.concatenate([right, (system["Pi"] @ rubbed[..., None])], axis=2)
        share = minimum_norm(A, np.ones(A.shape[2]), right)
        return np.concatenate([share, (effort - share.sum(axis=2))[..., None]], axis=2)
