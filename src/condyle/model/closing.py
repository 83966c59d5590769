"""States of the platform in its independent coordinates, from what a motion gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..backends.choose import Backend
from ..backends.kernel import VARIANT, Arrays, Kernel
from ..errors import InputError, did_you_mean
from ..graph.program import Numbers
from ..mechanism.home import (
    MAX_CONDITION,
    condition_of,
    constraint_jacobian,
    usable_sets,
)
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..motion.followed_closure import FollowedClosure, PlatformMotion
from ..questions import Question
from ..questions.file_numbers import numbers_of
from ..questions.numbers import specialised
from ..questions.structure import Structure, structure_of
from .variant_rows import solve_per_variant

Array = np.ndarray


@dataclass(eq=False)
class Closure:
    """Closes the contacts of V mechanisms for 6 - k coordinates by name, or for a landmark's path.

    kernel: of the question `closure`, on the numbers of all mechanisms.
    """

    names: tuple[str, ...]
    landmark: str | None
    structure: Structure
    numbers: Numbers
    kernel: Kernel

    @staticmethod
    def of(
        mechanism: Mechanism,
        names: Sequence[str] = (),
        landmark: str | None = None,
        backend: Backend | None = None,
        structure: Structure | None = None,
        general: bool = False,
    ) -> Closure:
        """The closure of one mechanism.

        Args:   structure: which it is seen as, without zeros; None: its own.
                general: whether its kernel serves every mechanism of the structure.
        Raises: InputError: if these do not determine a pose.
        """
        require_determined(mechanism, names, landmark)
        ordered = () if landmark is not None else tuple(sorted(names, key=COORDINATES.index))
        structure = structure or structure_of(mechanism)
        numbers = numbers_of(structure, mechanism, landmark)
        if not general:
            structure = specialised(structure, numbers)
        question = Question.about(structure, "closure", ordered)
        kernel = (backend or Backend()).kernel(question.key, question.variants, numbers)
        return Closure(ordered, landmark, structure, numbers, kernel)

    def numbers_for(self, mechanism: Mechanism) -> Numbers:
        """The numbers of another mechanism of its structure, for its kernel.

        Raises: InputError: as of `of`.
        """
        require_determined(mechanism, self.names, self.landmark)
        return numbers_of(self.structure, mechanism, self.landmark)

    @cached_property
    def followed(self) -> FollowedClosure:
        return FollowedClosure.of(self.structure, self.numbers, self.names)

    def solve(
        self, s: np.ndarray, s1: np.ndarray, s2: np.ndarray, threads: int | None = None
    ) -> PlatformMotion:
        """X_EE and its rates where g = s, g' = s1, g'' = s2, (N, 6 - k) each: (V N, 6), mechanism
        by mechanism."""
        inputs, V = {"s": s, "s1": s1, "s2": s2}, len(self.numbers)
        if V > 1:
            inputs = {name: np.tile(a, (V, 1)) for name, a in inputs.items()}
            inputs[VARIANT] = np.repeat(np.arange(V), len(s))
        answer = self.kernel.run(inputs, threads)
        answer.mend(inputs, self._follow)
        return PlatformMotion.of(answer)

    def _follow(self, rows: Arrays) -> tuple[Arrays, Array]:
        """Samples that the kernel cannot vouch for."""
        if len(self.numbers) == 1:
            return self.followed.solve(rows["s"], rows["s1"], rows["s2"]).answer()
        found: tuple[Arrays, Array] = solve_per_variant(rows, self._follow_single)
        return found

    def _follow_single(self, i: int, rows: Arrays) -> tuple[Arrays, Array]:
        return replace(self, numbers=self.numbers.single(i))._follow(rows)


def require_determined(mechanism: Mechanism, names: Sequence[str], landmark: str | None) -> None:
    """Raises InputError if coordinates, or a landmark's path, do not determine a pose."""
    if landmark is None:
        require_independent(mechanism, names)
    else:
        require_landmark(mechanism, landmark)


def require_independent(mechanism: Mechanism, names: Sequence[str]) -> None:
    """Raises InputError if the contacts do not determine the other coordinates at home."""
    dependent = tuple(name for name in COORDINATES if name not in names)
    k = len(mechanism.contacts)
    usable = [tuple(n for n in COORDINATES if n not in d) for d in usable_sets(mechanism)]
    if len(names) != 6 - k:
        got = (
            f"got the {len(names)} coordinates {', '.join(names)}"
            if names
            else "coordinates: got none"
        )
        raise InputError(
            f"{got}; the mechanism has {6 - k} degrees of freedom. Independent coordinates would "
            f"be: {_sets(usable)}"
        )
    condition = condition_of(constraint_jacobian(mechanism), dependent)
    if condition >= MAX_CONDITION:
        raise InputError(
            f"the coordinates {', '.join(names)} are not independent: the contacts do not "
            f"determine {', '.join(dependent)} from them. Available: {_sets(usable)}"
        )


def require_landmark(mechanism: Mechanism, landmark: str) -> None:
    """Raises InputError if the landmark's path does not determine a pose."""
    points = mechanism.platform.points
    if landmark not in points:
        raise InputError(
            f'the mechanism has no landmark "{landmark}".{did_you_mean(landmark, points)}'
        )
    if len(mechanism.contacts) != 2:
        raise InputError(
            f"a landmark's path determines a pose only with two contacts; this mechanism has "
            f"{len(mechanism.contacts)}. Give {6 - len(mechanism.contacts)} pose coordinates "
            "instead"
        )


def _sets(usable: list[tuple[str, ...]]) -> str:
    shown = "; ".join(",".join(names) for names in usable[:4])
    return shown + ("; ..." if len(usable) > 4 else "")
