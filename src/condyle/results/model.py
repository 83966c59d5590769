"""A model: one mechanism, one formulation, one route, ready to compute and to say what it found.

model = condyle.derive(mechanism, formulation="momentum", route="core")
solution = model.solve(motion, load)
"""

from __future__ import annotations

import os
import time
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..mechanism import load as load_mechanism
from ..mechanism.mechanism import Mechanism
from ..model.evaluator import Evaluator, with_point
from ..model.judge import require_ok
from ..model.reactions import reactions as joint_reactions
from ..motion import Load, Motion, as_load, as_motion, resolve_load_point
from ..progress import step

if TYPE_CHECKING:
    from .solution import Solution


class Model(Evaluator):
    """An evaluator whose results are labelled."""

    def solve(
        self,
        motion: Motion,
        load: Load | None = None,
        load_point: str | None = None,
        flag: bool = False,
        reactions: bool = False,
        threads: int | None = None,
    ) -> Solution:
        """Torques along a motion under a load.

        Args:   motion: what the platform does; load: what acts on it (none by default).
                load_point: platform point the load acts at; default: the load's own, else
                right_molar.
                flag: keep samples that cannot be computed, empty and with a status.
                reactions: forces and moments in every joint too.
                threads: at most so many; results do not depend on it.
        Raises: UnreachableError, SingularError: for such samples, unless `flag`.
                InputError: if motion or load do not fit the mechanism.
        """
        # xarray and pandas wait until something is labelled: kernels alone start without them.
        from .assemble import assemble
        from .reactions import reaction_variables

        start = time.perf_counter()
        motion, load = as_motion(motion), as_load(load)
        wrench = load.at(motion.t)
        name = load_point or load.point
        if np.any(wrench) or name is not None:
            name = resolve_load_point(name, self.mechanism.platform.points)
        point = np.zeros(3) if name is None else self.load_point(name)
        with step("solving"):
            states, residual = self.independent_motion(motion)
            evaluation = self.evaluate(*states, with_point(wrench, point), threads)
        if not flag:
            require_ok(self.mechanism, evaluation, motion.t)
        seconds = time.perf_counter() - start
        solution = assemble(self, motion, load, wrench, name, evaluation, residual, seconds)
        if not reactions:
            return solution
        found = joint_reactions(self, evaluation)
        variables, coordinates = reaction_variables(self.mechanism, found)
        return solution.assign(variables).assign_coords(coordinates)


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
