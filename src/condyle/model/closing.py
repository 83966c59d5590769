"""States of the platform in its independent coordinates, from what a motion gives."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import TYPE_CHECKING

import numpy as np

from ..backends.choose import Backend
from ..backends.kernel import AGAIN
from ..errors import InputError, did_you_mean
from ..mechanism.home import (
    MAX_CONDITION,
    condition_of,
    constraint_jacobian,
    usable_sets,
)
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..questions import Prescribed, Question
from ..questions.numbers import Layout, specialised
from ..questions.structure import structure_of
from ..status import Status
from .follow import Follow, PlatformMotion

if TYPE_CHECKING:
    from ..backends.kernel import Kernel


class Closure:
    """Closes a mechanism's contacts for 6 - k coordinates by name, or for a landmark's path."""

    def __init__(
        self,
        mechanism: Mechanism,
        names: Sequence[str] = (),
        landmark: str | None = None,
        backend: Backend | None = None,
        general: bool = False,
    ) -> None:
        """Args:   general: whether its kernel serves every mechanism of the structure.
        Raises: InputError: if these do not determine a pose.
        """
        if landmark is None:
            require_independent(mechanism, names)
            self.names = tuple(sorted(names, key=COORDINATES.index))
        else:
            require_landmark(mechanism, landmark)
            self.names = ()
        prescribed = Prescribed(self.names)
        self._landmark = landmark
        structure = structure_of(mechanism)
        self._numbers = Layout.of(structure).numbers(mechanism, landmark)
        if not general:
            structure = specialised(structure, self._numbers)
        question = Question.about(structure, "closure", prescribed)
        backend = backend or Backend()
        self._kernel: Kernel = backend.kernel(question.key, question.variants, self._numbers)
        self._robust = (structure, self._numbers, prescribed)
        self._follow: Follow | None = None

    def renumbered(self, mechanism: Mechanism) -> Closure:
        """The same, if it is general, of another mechanism of the structure.

        Raises: InputError: if the names or the landmark do not determine its pose.
        """
        if self._landmark is None:
            require_independent(mechanism, self.names)
        else:
            require_landmark(mechanism, self._landmark)
        other = copy(self)
        structure, _, prescribed = self._robust
        other._numbers = Layout.of(structure).numbers(mechanism, self._landmark)
        other._kernel = self._kernel.renumbered(other._numbers)
        other._robust, other._follow = (structure, other._numbers, prescribed), None
        return other

    def solve(
        self, s: np.ndarray, s1: np.ndarray, s2: np.ndarray, threads: int | None = None
    ) -> PlatformMotion:
        """X_EE and its rates where g = s, g' = s1, g'' = s2, (N, 6 - k) each."""
        answer = self._kernel.run({"s": s, "s1": s1, "s2": s2}, threads)
        pose, rate, acceleration = (
            answer.values[name].T for name in ("pose", "pose_rate", "pose_acceleration")
        )
        found = (pose, rate, acceleration)
        reached = answer.status == Status.ok
        again = np.flatnonzero(answer.status == AGAIN)
        if again.size:
            self._follow = self._follow or Follow(*self._robust)
            better = self._follow.solve(s[again], s1[again], s2[again])
            reached[again] = better.reached
            for target, a in zip(found, better.named().values(), strict=True):
                target[again] = a
        if not reached.all():
            for target in found:
                target[~reached] = np.nan
        return PlatformMotion(pose, rate, acceleration, reached)


def require_independent(mechanism: Mechanism, names: Sequence[str]) -> None:
    """Raises InputError if the contacts do not determine the other coordinates at home."""
    dependent = tuple(name for name in COORDINATES if name not in names)
    k = len(mechanism.contacts)
    usable = [tuple(n for n in COORDINATES if n not in d) for d in usable_sets(mechanism)]
    if len(names) != 6 - k:
        raise InputError(
            f"got the {len(names)} coordinates {', '.join(names)}; the mechanism has {6 - k} "
            f"degrees of freedom. Independent coordinates would be: {_sets(usable)}"
        )
    condition = condition_of(constraint_jacobian(mechanism), dependent) if k else 1.0
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
