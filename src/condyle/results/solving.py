"""A motion and a load in, a labelled solution out: what `Model.solve` returns."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from ..mechanism.mechanism import Mechanism
from ..model.data import require_ok
from ..model.joint_reactions import Reaction
from ..model.joint_reactions import reactions as joint_reactions
from ..model.model import Model, with_point
from ..motion import Load, Motion, as_load, as_motion, resolve_load_point
from ..progress import step
from .assemble import assemble
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


def reaction_variables(
    mechanism: Mechanism, found: dict[str, Reaction]
) -> tuple[dict[str, tuple[Any, ...]], dict[str, list[str]]]:
    """Variables and coordinates of a dataset, as xarray takes them.

    `reaction_<quantity>` has dimensions (time, chain, axis), or, where only chains of some
    families have it, (time, chain_<families>, axis) with those chains alone; contact forces are
    `contact_force_vector` (time, contact, axis).
    """
    variables: dict[str, tuple[Any, ...]] = {}
    coordinates: dict[str, list[str]] = {}
    groups: dict[str, list[Reaction]] = {}
    for reaction in found.values():
        groups.setdefault(reaction.quantity, []).append(reaction)
    for quantity, group in groups.items():
        owners = [reaction.owner for reaction in group]
        name, dimension = f"reaction_{quantity}", "chain"
        if quantity == "contact":
            name, dimension = "contact_force_vector", "contact"
        elif len(owners) < len(mechanism.chains):
            kinds = {c.kind: None for c in mechanism.chains if c.name in owners}
            dimension = "_".join(("chain", *kinds))
            coordinates[dimension] = owners
        values = np.stack([reaction.array for reaction in group], axis=1)
        variables[name] = (("time", dimension, "axis"), values, _attributes(group))
    return variables, coordinates


def _attributes(group: list[Reaction]) -> dict[str, str]:
    def joined(key: str) -> str:
        return ", ".join(dict.fromkeys(getattr(reaction, key) for reaction in group))

    keys = ("long_name", "body", "by", "place")
    return {"units": joined("unit"), **{key: joined(key) for key in keys}, "frame": Reaction.frame}
