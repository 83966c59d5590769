"""A mechanism's equations by one formulation and route: its numbers, and the kernels on them."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from ..backends.choose import Backend, BackendName
from ..backends.kernel import VARIANT, Arrays, Kernel
from ..dynamics import ROUTES, FormulationName, Route
from ..dynamics import formulation as formulation_named
from ..errors import InputError, MechanismError, did_you_mean
from ..graph.program import Numbers
from ..mechanism.home import holding_problems, home_problem
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..progress import step
from ..questions import Question
from ..questions.file_numbers import numbers_of
from ..questions.friction import MOST
from ..questions.number_paths import number_jacobian
from ..questions.numbers import agree, characteristic, require_closed_form, specialised
from ..questions.structure import GIVEN, Structure, smooth_forms, structure_of
from .closing import Closure
from .distributing import LEAST, Distribution, Distributor
from .overlapping import ContactBall, balls, mark
from .robust_path import Robust


class System:
    """What all parts of a model ask: kernels are made when they are first wanted.

    structure: of the mechanism; unless `general`, without what happens to be zero in it.
    numbers:   of the mechanism, as backends take them.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        formulation: FormulationName,
        route: Route,
        backend: BackendName,
        general: bool = False,
    ) -> None:
        """As of `Model`; general: leaving out nothing that happens to be zero in the mechanism."""
        check_home(mechanism)
        if route not in ROUTES:
            raise InputError(f'no route "{route}".{did_you_mean(route, ROUTES)}')
        if route == "direct":
            require_closed_form(mechanism)
        start = time.perf_counter()
        self.mechanism = mechanism
        formulation_named(formulation)  # has to be known
        self.formulation: FormulationName = formulation
        self.route: Route = route
        self.backend: Backend = Backend(backend)
        with step("deriving the equations"):
            structure = structure_of(mechanism, self.formulation, route)
            self.numbers: Numbers = numbers_of(structure, mechanism)
            self.structure: Structure = structure
            if not general:
                self.structure = specialised(structure, self.numbers)
        self._general = general
        self._lender: System | None = None
        self._kernels: dict[Any, Kernel] = {}
        self._closures: dict[Any, Closure] = {}
        self._under: dict[tuple[str, ...], System] = {}
        self.seconds: float = time.perf_counter() - start

    def lent(self, mechanism: Mechanism, numbers: Numbers) -> System:
        """The same with these numbers, sharing kernels: they leave out what is zero here."""
        other = self._copied()
        other.mechanism, other.numbers, other._lender = mechanism, numbers, self._lender or self
        return other

    def under(self, given: Sequence[str]) -> System:
        """The same where samples give gravity or the base's motion: see `Structure.given`."""
        given = tuple(name for name in GIVEN if name in given)
        if given == self.structure.given:
            return self
        if given not in self._under:
            other = self._copied()
            other.structure = replace(self.structure, given=given)
            other._lender = None if self._lender is None else self._lender.under(given)
            self._under[given] = other
        return self._under[given]

    @cached_property
    def by_numpy(self) -> System:
        """The same whose kernels need no compiler."""
        if self.backend.name == "numpy":
            return self
        other = self._copied()
        other.backend = Backend("numpy")
        other._lender = None if self._lender is None else self._lender.by_numpy
        return other

    def _copied(self) -> Self:
        """The same with nothing made yet."""
        other = copy(self)
        for name in [n for n, of in vars(System).items() if isinstance(of, cached_property)]:
            other.__dict__.pop(name, None)
        other._kernels, other._closures, other._under = {}, {}, {}
        return other

    @property
    def family(self) -> System:
        """Whose kernels it shares; itself where it has its own."""
        return self._lender or self

    def numberless(self, question: str, *details: Any) -> Kernel:
        """The kernel of a question that takes the mechanism's numbers as ports."""
        asked = question, details, "ports"
        if asked not in self._kernels:
            q = Question.about(self.structure, question, *details).with_ports()
            none = Numbers.none(self.numbers.order)
            self._kernels[asked] = self.backend.kernel(q.key, q.variants, none)
        return self._kernels[asked]

    @cached_property
    def serving_all(self) -> System:
        """One whose kernels serve every mechanism of the structure, whatever is zero in this."""
        if self._general:
            return self.family
        given = self.mechanism, self.formulation, self.route, self.backend.requested
        return System(*given, general=True).under(self.structure.given)

    def labels(self, count: int) -> Arrays:
        """What kernels take beside the inputs of samples."""
        return {}

    def lengths(self, inputs: Mapping[str, np.ndarray]) -> Any:
        """The characteristic length of samples [m]."""
        return self.length

    @cached_property
    def dependent(self) -> tuple[str, ...]:
        return tuple(self.structure.dependent)

    @cached_property
    def independent(self) -> tuple[str, ...]:
        return tuple(name for name in COORDINATES if name not in self.dependent)

    @cached_property
    def length(self) -> float:
        """The characteristic length [m]."""
        return characteristic(self.structure, self.numbers).item()

    def kernel(self, question: str, *details: Any) -> Kernel:
        """The kernel of a question."""
        asked = question, details
        if asked not in self._kernels and self._lender is not None:
            shared = self._lender.kernel(question, *details)
            self._kernels[asked] = shared.renumbered(self.numbers)
        if asked not in self._kernels:
            structure = self.structure
            if question == "inverse" and len(structure.friction) > MOST:
                structure = replace(structure, friction=())  # more patterns than a kernel tries
            q = Question.about(structure, question, *details)
            self._kernels[asked] = self.backend.kernel(q.key, q.variants, self.numbers)
        return self._kernels[asked]

    def derivative(
        self, how: str, question: str, by: tuple[str, ...], of: tuple[str, ...]
    ) -> Kernel:
        """The kernel of a question's derivatives: see `questions.derivative`."""
        return self.kernel("derivative", how, question, (), by, of)

    @cached_property
    def wide(self) -> System:
        """The same with all numbers of the kernel, for derivatives in those that are at zero.

        Contacts on parallel planes stand alone, and every actuator has losses.
        """
        forms = smooth_forms(self.mechanism)
        return self._restructured(zeros=frozenset(), parallel=False, losses=True, contacts=forms)

    @cached_property
    def rubbing(self) -> System:
        """The same with friction at every contact."""
        return self.wide._restructured(friction=tuple(range(len(self.structure.contacts))))

    def _restructured(self, **changes: Any) -> System:
        other = copy(self)
        other.structure = replace(self.structure, **changes)
        other.numbers = numbers_of(other.structure, self.mechanism)
        other._general, other._lender, other._kernels, other._under = False, None, {}, {}
        return other

    def number_jacobian(self, paths: Sequence[str], keep: str = "home") -> np.ndarray:
        """Derivatives of `numbers` by numbers of the file: see `number_paths.number_jacobian`."""
        return number_jacobian(self.mechanism, self.structure, paths, keep)

    def closure(self, names: tuple[str, ...], landmark: str | None) -> Closure:
        """What leads from other coordinates, or from a landmark's path, to whole poses."""
        key = names, landmark
        if key not in self._closures:
            lender = None if self._lender is None else self._lender.closure(names, landmark)
            if lender and not agree(lender.structure, lender.numbers_for(self.mechanism)):
                lender = self.family.serving_all.closure(names, landmark)
            self._closures[key] = Closure(
                self.mechanism, names, landmark, self.backend, self._general, lender
            )
        return self._closures[key]

    @cached_property
    def _balls(self) -> tuple[ContactBall, ...]:
        return balls(self.structure, self.numbers.parameters, self.mechanism.contacts)

    @property
    def may_overlap(self) -> bool:
        """Whether the ball of a contact may overlap its surface at some pose."""
        return bool(self._balls)

    def mark_overlaps(
        self, status: np.ndarray, pose: np.ndarray, inputs: Mapping[str, np.ndarray]
    ) -> None:
        """Status `overlap`, in place, where poses, (N, 6), have balls overlap their surfaces."""
        mark(self._balls, status, pose, inputs.get(VARIANT))

    @cached_property
    def robust(self) -> Robust:
        """Where samples go that a kernel cannot vouch for."""
        distributor = Distributor(self.mechanism, Distribution(LEAST))
        return Robust(self.structure, self.numbers, self.independent, distributor)


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
