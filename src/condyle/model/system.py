"""A mechanism's equations by one formulation and route: its numbers, and the kernels on them."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, cast

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
from ..questions.numbers import Layout, agree, characteristic, require_closed_form, specialised
from ..questions.structure import GIVEN, Structure, smooth_forms, structure_of
from .closing import Closure
from .distributing import MINIMUM_NORM, Distribution, Distributor
from .overlapping import ContactBall, balls, mark
from .robust_path import Robust
from .variant_rows import PerVariantMethods

CACHED = 64  # systems of single mechanisms


@dataclass(eq=False)
class System:
    """The equations of one structure, the numbers of V mechanisms, and the kernels on them.

    With several mechanisms samples come in whole rows of mechanisms, V N of them, or with an input
    `variant`. Kernels are made when they are first wanted.

    mechanism: the first, or that which the others vary.
    structure: of all; unless `general`, without what happens to be zero in the mechanism.
    numbers:   of all, as backends take them.
    shared:    the system whose kernels this uses; None where it has its own.
    variants:  of several mechanisms, or of one that was not made yet: what its file says.
    seconds:   duration of the derivation.
    """

    mechanism: Mechanism
    structure: Structure
    numbers: Numbers
    backend: Backend
    general: bool = False
    shared: System | None = None
    variants: VariantSource | None = None
    seconds: float = 0.0
    _kernels: dict[Any, Kernel] = field(default_factory=dict, init=False, repr=False)
    _closures: dict[Any, Closure] = field(default_factory=dict, init=False, repr=False)
    _by_inputs: dict[tuple[str, ...], System] = field(default_factory=dict, init=False, repr=False)

    @staticmethod
    def of(
        mechanism: Mechanism,
        formulation: FormulationName,
        route: Route,
        backend: BackendName,
    ) -> System:
        """The system of one mechanism, as of `Model`."""
        check_home(mechanism)
        if route not in ROUTES:
            raise InputError(f'no route "{route}".{did_you_mean(route, ROUTES)}')
        if route == "direct":
            require_closed_form(mechanism)
        start = time.perf_counter()
        formulation_named(formulation)  # has to be known
        runs_on = Backend(backend)
        with step("deriving the equations"):
            structure = structure_of(mechanism, formulation, route)
            numbers = numbers_of(structure, mechanism)
            structure = specialised(structure, numbers)
        seconds = time.perf_counter() - start
        return System(mechanism, structure, numbers, runs_on, seconds=seconds)

    @property
    def formulation(self) -> FormulationName:
        return cast("FormulationName", self.structure.formulation)

    @property
    def route(self) -> Route:
        return cast("Route", self.structure.route)

    def with_variants(
        self, structure: Structure, numbers: Numbers, variants: VariantSource
    ) -> System:
        """The equations of other mechanisms, sharing kernels where their structure is this one's.

        Args: structure: of all of them, without zeros;  numbers: laid out for it.
        """
        base = self
        if structure != replace(self.structure, zeros=frozenset()):
            base = replace(
                self,
                mechanism=variants.mechanism(0),
                structure=specialised(structure, numbers),
                numbers=numbers.single(0),
                general=False,
                shared=None,
                variants=None,
            )
        elif not agree(self.structure, numbers):
            base = self.general_system
        return replace(base, numbers=numbers, shared=base.family, variants=variants)

    def require_giving(self) -> None:
        """Raises InputError for a mechanism that is rigid."""
        if not self.structure.gives:
            raise InputError(
                f'"{self.mechanism.name}" is rigid: no chain of it gives. State the stiffness of '
                "its drives (chain.<name>.actuator.stiffness), or of couplers, rods or legs "
                "(chain.<name>.coupler.stiffness), in its file"
            )

    @cached_property
    def single(self) -> Callable[[int], System]:
        """The system of one of the mechanisms, by its number; some are cached."""

        def single(i: int) -> System:
            numbers = self.numbers.single(i)
            return replace(self, mechanism=self._mechanism(i), numbers=numbers, variants=None)

        return lru_cache(CACHED)(single)

    def _mechanism(self, i: int) -> Mechanism:
        return self.variants.mechanism(i) if self.variants else self.mechanism

    def with_inputs(self, given: Sequence[str]) -> System:
        """The same where samples give gravity or the base's motion: see `Structure.given`."""
        given = tuple(name for name in GIVEN if name in given)
        if given == self.structure.given:
            return self
        if given not in self._by_inputs:
            self._by_inputs[given] = replace(
                self,
                structure=replace(self.structure, given=given),
                shared=self.shared and self.shared.with_inputs(given),
            )
        return self._by_inputs[given]

    @cached_property
    def by_numpy(self) -> System:
        """The same whose kernels need no compiler."""
        if self.backend.name == "numpy":
            return self
        return replace(self, backend=Backend("numpy"), shared=self.shared and self.shared.by_numpy)

    @property
    def family(self) -> System:
        """The system whose kernels it uses; itself where it has its own."""
        return self.shared or self

    def numberless(self, question: str, *details: Any) -> Kernel:
        """The kernel of a question that takes the mechanism's numbers as ports."""
        key = question, details, "ports"
        if key not in self._kernels:
            q = Question.about(self.structure, question, *details).with_ports()
            none = Numbers.none(self.numbers.order)
            self._kernels[key] = self.backend.kernel(q.key, q.variants, none)
        return self._kernels[key]

    @cached_property
    def general_system(self) -> System:
        """One whose kernels serve every mechanism of the structure, whatever is zero in this."""
        if self.general:
            return self.family
        structure = replace(self.structure, zeros=frozenset())
        return replace(self, structure=structure, general=True, shared=None)

    def labels(self, count: int) -> Arrays:
        """The input `variant` of samples, where there are several mechanisms."""
        V = len(self.numbers)
        return {VARIANT: np.repeat(np.arange(V), count // V)} if V > 1 else {}

    def lengths(self, inputs: Mapping[str, np.ndarray]) -> Any:
        """The characteristic length of samples [m]: a number, or (N,)."""
        return self.length[inputs[VARIANT]] if len(self.numbers) > 1 else self.length

    @cached_property
    def dependent(self) -> tuple[str, ...]:
        return tuple(self.structure.dependent)

    @cached_property
    def independent(self) -> tuple[str, ...]:
        return tuple(name for name in COORDINATES if name not in self.dependent)

    @cached_property
    def length(self) -> Any:
        """The characteristic length [m]; (V,) of several mechanisms."""
        found = characteristic(self.structure, self.numbers)
        return found if len(found) > 1 else found.item()

    def kernel(self, question: str, *details: Any) -> Kernel:
        """The kernel of a question."""
        key = question, details
        if key not in self._kernels and self.shared is not None:
            own = self.shared.kernel(question, *details)
            self._kernels[key] = own.renumbered(self.numbers)
        if key not in self._kernels:
            structure = self.structure
            if question == "inverse" and len(structure.friction) > MOST:
                structure = replace(structure, friction=())  # more patterns than a kernel tries
            q = Question.about(structure, question, *details)
            self._kernels[key] = self.backend.kernel(q.key, q.variants, self.numbers)
        return self._kernels[key]

    def derivative(
        self, how: str, question: str, by: tuple[str, ...], of: tuple[str, ...]
    ) -> Kernel:
        """The kernel of a question's derivatives: see `questions.derivative`."""
        return self.kernel("derivative", how, question, (), by, of)

    @cached_property
    def unreduced(self) -> System:
        """The same with all numbers of the kernel, for derivatives in those that are at zero.

        Contacts on parallel planes stand alone, and every actuator has losses.
        """
        forms = smooth_forms(self.mechanism)
        return self._restructured(zeros=frozenset(), parallel=False, losses=True, contacts=forms)

    @cached_property
    def with_friction(self) -> System:
        """The same with friction at every contact."""
        return self.unreduced._restructured(friction=tuple(range(len(self.structure.contacts))))

    def _restructured(self, **changes: Any) -> System:
        structure = replace(self.structure, **changes)
        numbers = numbers_of(structure, self.mechanism)
        return replace(self, structure=structure, numbers=numbers, general=False, shared=None)

    def number_jacobian(self, paths: Sequence[str], keep: str = "home") -> np.ndarray:
        """Derivatives of `numbers` by numbers of the file: see `number_paths.number_jacobian`."""
        return number_jacobian(self.mechanism, self.structure, paths, keep)

    def closure(self, names: tuple[str, ...], landmark: str | None) -> Closure:
        """The poses that follow from other coordinates, or from a landmark's path."""
        key = names, landmark
        if key not in self._closures:
            self._closures[key] = self._new_closure(names, landmark)
        return self._closures[key]

    def _new_closure(self, names: tuple[str, ...], landmark: str | None) -> Closure:
        if self.shared is None:
            structure = replace(self.structure, zeros=frozenset())
            given = self.mechanism, names, landmark, self.backend
            return Closure.of(*given, structure, self.general)
        shared = self.shared.closure(names, landmark)
        if len(self.numbers) > 1:
            numbers = self._with_landmark(landmark)
        else:
            numbers = shared.numbers_for(self._mechanism(0))
        if not agree(shared.structure, numbers):
            shared = self.family.general_system.closure(names, landmark)
        return replace(shared, numbers=numbers, kernel=shared.kernel.renumbered(numbers))

    def _with_landmark(self, landmark: str | None) -> Numbers:
        """The numbers of all mechanisms with a platform point whose path is given."""
        if landmark is None:
            return self.numbers
        assert self.variants is not None
        start, count = Layout.of(self.structure).parameters["landmark"]
        parameters = self.numbers.parameters.copy()
        parameters[:, start : start + count] = self.variants.points(landmark)
        return replace(self.numbers, parameters=parameters)

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
        if len(self.numbers) > 1:
            return PerVariantMethods(lambda i: self.single(i).robust)  # type: ignore[return-value]
        distributor = Distributor(self._mechanism(0), Distribution(MINIMUM_NORM))
        return Robust(self.structure, self.numbers, self.independent, distributor)


@dataclass(frozen=True)
class VariantSource:
    """What the files of variants say, by the variant's number or for all.

    mechanism: of one;  points: a point of the platform by name, (V, 3) [m].
    """

    mechanism: Callable[[int], Mechanism]
    points: Callable[[str], np.ndarray]


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
