"""The equations of a mechanism by one formulation and route, and the kernels that run them."""

from __future__ import annotations

import time
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any, Self

from ..backends.choose import Backend
from ..backends.kernel import Kernel
from ..distribution import OBJECTIVES
from ..dynamics import ROUTES
from ..dynamics import formulation as formulation_named
from ..errors import InputError, MechanismError, did_you_mean
from ..mechanism.home import (
    characteristic_length,
    dependent_coordinates,
    holding_problems,
    home_problem,
    independent_coordinates,
)
from ..mechanism.mechanism import Mechanism
from ..progress import step
from ..questions import Question
from ..questions.equations import INTERNAL, part_names
from ..questions.numbers import Layout, require_closed_form, specialised
from ..questions.structure import structure_of
from .closing import Closure
from .distributing import LEAST, Distributor, Policy
from .reference_force import reference_force
from .robust import Robust

DEFAULT = (None, 0.0, 0.0)  # distribution, preload and contact weight
BY_POLICY = ("policy", "_distributor", "_one_by_one")  # what is kept of it


class Derivation:
    """A mechanism, a formulation and a route; kernels are made when they are first asked for."""

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
        check_home(mechanism)
        if route not in ROUTES:
            raise InputError(f'no route "{route}".{did_you_mean(route, ROUTES)}')
        if route == "direct":
            require_closed_form(mechanism)
        start = time.perf_counter()
        self.mechanism = mechanism
        self.formulation = formulation_named(formulation).name
        self.route = route
        self._asked = distribution, preload, contact_weight
        if self._asked != DEFAULT:
            _ = self.policy  # what is asked for has to fit, now
        self.backend = Backend(backend)
        with step("deriving the equations"):
            structure = structure_of(mechanism, self.formulation, route)
            self._numbers = Layout.of(structure).numbers(mechanism)
            self._structure = structure if general else specialised(structure, self._numbers)
        self._general: Any = self if general else None  # who lends kernels
        self._kernels: dict[Any, Kernel] = {}
        self._closures: dict[Any, Closure] = {}
        self.derivation_seconds = time.perf_counter() - start

    def __repr__(self) -> str:
        return (
            f'Model of "{self.mechanism.name}": {self.formulation}, route {self.route}, '
            f"{self.backend.name}\n"
            f"  {len(self.mechanism.chains)} efforts from q = ({', '.join(self.independent)})"
        )

    def __copy__(self) -> Self:
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        return other

    def __reduce__(self) -> tuple[Any, ...]:
        """Models travel as their recipe; kernels are found again in the cache."""
        return type(self), (
            self.mechanism,
            self.formulation,
            self.route,
            self.backend.asked,
            *self._asked,
            *((True,) if self._general is not None else ()),
        )

    def choosing(
        self, distribution: str | None = None, preload: float = 0.0, contact_weight: float = 0.0
    ) -> Self:
        """The same model, kernels and all, that chooses efforts otherwise; see `derive`."""
        other = copy(self)
        for name in BY_POLICY:
            other.__dict__.pop(name, None)
        other._asked = distribution, preload, contact_weight
        _ = other.policy  # has to fit, now
        return other

    def renumbered(self, mechanism: Mechanism) -> Self:
        """The same model, if it is general, of another mechanism of the same structure.

        It shares the kernels, so that it costs a thousandth of a new one. The mechanism must have
        been checked, as one from a file or from `Mechanism.set` is.

        Raises: InputError: if the distribution does not fit the mechanism.
        """
        assert self._general is not None
        other = copy(self._general)
        for name in _cached_by(type(self)):
            other.__dict__.pop(name, None)
        other.mechanism, other._asked = mechanism, self._asked
        _ = other.policy  # has to fit, now
        other._numbers = Layout.of(self._structure).numbers(mechanism)
        other._kernels, other._closures = {}, {}
        return other

    @cached_property
    def independent(self) -> tuple[str, ...]:
        """Names of the independent coordinates q_EE, in order."""
        return independent_coordinates(self.mechanism)

    @cached_property
    def dependent(self) -> tuple[str, ...]:
        """Names of the coordinates that the contacts determine."""
        return dependent_coordinates(self.mechanism)

    @cached_property
    def characteristic_length(self) -> float:
        """What angles are multiplied by where they meet lengths [m]."""
        return characteristic_length(self.mechanism)

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

    @cached_property
    def _distributor(self) -> Distributor:
        return Distributor(self.mechanism, self.policy, self.backend)

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts that share the efforts."""
        internal = not self._distributor.least_norm and not self._structure.friction
        return part_names(self._structure) + (INTERNAL,) * internal

    @property
    def limited(self) -> bool:
        """Whether efforts are chosen within limits."""
        return OBJECTIVES[self.policy.objective].limits

    @property
    def chooses_efforts(self) -> bool:
        """Whether efforts may be others than those of least norm."""
        return self._distributor.chooses

    def kernel(self, question: str, *details: Any) -> Kernel:
        """The kernel of a question; see `condyle.questions`."""
        asked = question, details
        if asked not in self._kernels and self._general not in (None, self):
            shared = self._general.kernel(question, *details)
            self._kernels[asked] = shared.renumbered(self._numbers)
        if asked not in self._kernels:
            structure = self._structure
            if question == "inverse" and self._distributor.unsolved_friction:
                structure = replace(structure, friction=())
            q = Question.about(structure, question, *details)
            self._kernels[asked] = self.backend.kernel(q.key, q.variants, self._numbers)
        return self._kernels[asked]

    @cached_property
    def _robust(self) -> Robust:
        """Where samples go that a kernel cannot vouch for."""
        distributor = Distributor(self.mechanism, Policy(LEAST))
        return Robust(self._structure, self._numbers, self.independent, distributor)

    def _closure(self, names: tuple[str, ...], landmark: str | None) -> Closure:
        """What leads from other coordinates, or from a landmark's path, to whole poses."""
        key = names, landmark
        if key not in self._closures and self._general not in (None, self):
            shared = self._general._closure(names, landmark)
            self._closures[key] = shared.renumbered(self.mechanism)
        if key not in self._closures:
            general = self._general is not None
            self._closures[key] = Closure(self.mechanism, names, landmark, self.backend, general)
        return self._closures[key]


def _cached_by(kind: type) -> tuple[str, ...]:
    """What instances keep because it was asked for once."""
    kept = (item for base in kind.__mro__ for item in vars(base).items())
    return tuple(name for name, value in kept if isinstance(value, cached_property))


def check_home(mechanism: Mechanism) -> None:
    """Raises MechanismError where the contacts cannot hold the platform at home."""
    problems = [
        f'contact "{contact.name}": {problem}'
        for contact in mechanism.contacts
        if (problem := home_problem(contact)) is not None
    ]
    problems += [] if problems else list(holding_problems(mechanism))
    if problems:
        raise MechanismError(mechanism.name, problems)
