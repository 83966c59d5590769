"""A motion and a load in, a labelled solution out: what `Model.solve` returns."""

from __future__ import annotations

import time

import numpy as np

from ..model.judge import require_ok
from ..model.model import Model, with_point
from ..model.reactions import reactions as joint_reactions
from ..motion import Load, Motion, as_load, as_motion, resolve_load_point
from ..progress import step
from .assemble import assemble
from .reactions import reaction_variables
from .solution import Solution


def solve(
    model: Model,
    motion: Motion,
    load: Load | None = None,
    load_point: str | None = None,
    flag: bool = False,
    reactions: bool = False,
    threads: int | None = None,
) -> Solution:
    """As `Model.solve`."""
    start = time.perf_counter()
    motion, load = as_motion(motion), as_load(load)
    wrench = load.at(motion.t)
    name = load_point or load.point
    if np.any(wrench) or name is not None:
        name = resolve_load_point(name, model.mechanism.platform.points)
    point = np.zeros(3) if name is None else model.load_point(name)
    with step("solving"):
        states, residual = model.independent_motion(motion)
        evaluation = model.evaluate(*states, with_point(wrench, point), threads)
    if not flag:
        require_ok(model.mechanism, evaluation, motion.t)
    seconds = time.perf_counter() - start
    solution = assemble(model, motion, load, wrench, name, evaluation, residual, seconds)
    if not reactions:
        return solution
    found = joint_reactions(model, evaluation)
    variables, coordinates = reaction_variables(model.mechanism, found)
    return solution.assign(variables).assign_coords(coordinates)
