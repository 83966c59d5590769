"""Labelled solutions, of a motion and a load or of their evaluation."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from ..distribution import EMG
from ..kinematics.causes import require_ok
from ..kinematics.constraints import indices
from ..markers import read_channels
from ..mechanism.mechanism import Mechanism
from ..mechanism.writing import record
from ..model.inverse_dynamics import SOLVED
from ..model.joint_reactions import Reaction
from ..model.joint_reactions import reactions as joint_reactions
from ..model.model import (
    Contacts,
    Model,
    inverse_for_motion,
    model_with_load_point,
    parts_with_inputs,
)
from ..motion import Load, Motion, as_load, as_motion, resolve_load_point
from ..motion.gravity_and_base import Given
from ..progress import step
from ..quantities import QUANTITIES, variables
from ..quantities.entries import chain_units, labels_of
from ..questions.equations import LOAD as LOAD_PART
from ..version import __version__
from . import solution as _accessor  # noqa: F401  # registers `dataset.condyle`
from .derived import Derived
from .emg_followed import measured_activation
from .measured import with_measured
from .warnings import Notice, Watch

SMOOTHED = 5e-5  # m, by which smoothing takes poses off contacts that they were fitted to


def solve(
    model: Model,
    motion: Motion,
    load: Load | None = None,
    load_point: str | None = None,
    flag: bool = False,
    reactions: bool = False,
    threads: int | None = None,
    measured: Any = None,
    contacts: Contacts = "kept",
) -> xr.Dataset:
    """As `Model.solve`."""
    start = time.perf_counter()
    motion, load = as_motion(motion), as_load(load)
    channels = None if measured is None else read_channels(measured)
    emg = measured_activation(model, channels, motion.t)
    wrench = load.at(motion.t)
    point = load.point if load_point is None else load_point
    model, name = model_with_load_point(model, point)
    if np.any(wrench) or name is not None:
        name = resolve_load_point(name, model.mechanism.platform.points)
    more = ["residual_wrench"] if model.distribution.name == EMG.name else []
    more += ["contact_active"] if model.distribution.unilateral == "release" else []
    with step("solving"):
        inverse, states, residual = inverse_for_motion(model, motion, contacts, emg)
        outputs = (*SOLVED, "ambiguous", *more)
        evaluation = inverse.solve(states, wrench, name, outputs, threads, motion.given)
    if not flag:
        require_ok(model.mechanism, evaluation, motion.t, free_motion=model.poses.free_motion_text)
    derived = Derived(model.mechanism, evaluation, wrench, model.limited, given=motion.given)
    smoothed = motion.contact_fit is not None and (residual or 0.0) <= SMOOTHED
    watch = Watch(model.mechanism, residual=None if smoothed else residual)
    watch.see(derived, motion.t)
    options = {
        "motion": motion.source,
        "motion_sha256": motion.sha256,
        "motion_kind": motion.kind,
        "landmark": motion.landmark,
        "load": load.source,
        "load_sha256": load.sha256,
        "load_point": name,
        "contact_residual_of_given_pose": residual,
        "contact_fit": motion.contact_fit,
        "contacts": contacts,
        "smoothing": None if motion.smoothing is None else str(motion.smoothing),
        "solve_seconds": time.perf_counter() - start,
    }
    parts = parts_with_inputs(model, motion.given)
    title = f"Inverse dynamics of {model.mechanism.name}"
    solution = labelled(model, derived, motion.t, parts, title, options, watch.notices())
    objective = model.distribution.objective
    choice = objective.chosen or f"by distribution {objective.name}"
    solution["effort"].attrs["long_name"] += f" {choice}"
    if channels is not None:
        solution = with_measured(solution, channels)
    if emg is not None:
        solution["emg_activation"] = QUANTITIES["emg_activation"].labelled(emg)
    if not reactions:
        return solution
    found = joint_reactions(model, evaluation, **motion.given)
    variables, coordinates = reaction_variables(model.mechanism, found)
    return solution.assign(variables).assign_coords(coordinates)


def base_parts() -> list[str]:
    """The names of the variables of the base's motion."""
    return [name for name, one in variables().items() if one.where == "base"]


def inputs_of(solution: xr.Dataset) -> Given:
    """`gravity` and `base` of a solution, as models take them, where its motion gave them."""
    inputs: Given = {}
    if "gravity" in solution:
        inputs["gravity"] = solution["gravity"].values
    if parts := [solution[name].values for name in base_parts() if name in solution]:
        inputs["base"] = np.hstack(parts)
    return inputs


def states_of(model: Model, solution: xr.Dataset) -> dict[str, Any]:
    """States of a model along a solution, the load on its platform, gravity and the base's motion,
    as models take them."""
    wrench, at = solution["load"].values, solution.condyle.options["load_point"]
    if at is None and wrench.any():
        at = resolve_load_point(None, model.mechanism.platform.points)
    own = indices(model.independent)
    rates = {"q": "pose", "v": "pose_rate", "a": "pose_acceleration"}
    states = {name: solution[of].values[:, own] for name, of in rates.items()}
    return {**states, "wrench": wrench, "at": at, **inputs_of(solution)}


def labelled(
    model: Model,
    derived: Derived,
    times: np.ndarray,
    parts: Sequence[str],
    title: str,
    options: Mapping[str, Any],
    notices: Sequence[Notice],
) -> xr.Dataset:
    """The dataset of samples at times (N,) [s].

    Args: parts: of `share`;  options: what was solved; what the model is, is added.
    """
    mechanism = model.mechanism
    loaded = bool(np.any(derived.wrench))
    used = [i for i, part in enumerate(parts) if loaded or part != LOAD_PART]
    made: dict[str, Any] = {
        name: (v.dims, derived.filled(v), v.attributes(mechanism))
        for name, v in variables().items()
        if derived.has(v)
    }
    if len(used) < len(parts):
        dims, share, attributes = made["share"]
        made["share"] = dims, share[used], attributes
    solution = xr.Dataset(made, coordinates(model, times, [parts[i] for i in used]))
    solution.attrs = {
        "title": title,
        "source": f"condyle {__version__}",
        "condyle_version": __version__,
        "mechanism_name": mechanism.name,
        "mechanism": record(mechanism),
        "options": json.dumps(_options(model, options)),
        "warnings": json.dumps([notice.text for notice in notices]),
        "notices": json.dumps([notice.to_dict() for notice in notices]),
    }
    return solution


def coordinates(model: Model, times: np.ndarray, parts: Sequence[str]) -> dict[str, Any]:
    """Labels along every dimension of results, and the units of each chain."""
    mechanism = model.mechanism
    labels: dict[str, Any] = {name: list(own) for name, own in labels_of(mechanism).items()}
    labels["contact"] = np.array(mechanism.contact_names, dtype=object)  # may be none
    return {
        "time": ("time", times, {"units": "s", "long_name": "time"}),
        **labels,
        "part": list(parts),
        "effort_unit": ("chain", chain_units(mechanism, "effort")),
        "joint_unit": ("chain", chain_units(mechanism, "joint")),
    }


def _options(model: Model, own: Mapping[str, Any]) -> dict[str, Any]:
    """How a solution was made: by the model, and of what."""
    return {
        "formulation": model.formulation,
        "route": model.route,
        "distribution": model.distribution.name,
        "preload": model.distribution.preload,
        "contact_weight": model.distribution.contact_weight,
        "emg_weight": model.distribution.emg_weight,
        "unilateral": model.distribution.unilateral,
        "reference_force": model.reference_force,
        "independent": list(model.independent),
        "dependent": list(model.dependent),
        "characteristic_length": model.characteristic_length,
        "derivation_seconds": model.derivation_seconds,
        **dict.fromkeys(("motion_sha256", "landmark", "load_sha256", "load_point", "smoothing")),
        "contact_residual_of_given_pose": None,
        "contact_fit": None,
        **own,
    }


def reaction_variables(
    mechanism: Mechanism, reactions: dict[str, Reaction]
) -> tuple[dict[str, tuple[Any, ...]], dict[str, list[str]]]:
    """Variables and coordinates of a dataset, as xarray takes them.

    `reaction_<quantity>` has dimensions (time, chain, axis), or, where only chains of some
    families have it, (time, chain_<families>, axis) with those chains alone; contact forces are
    `contact_force_vector` (time, contact, axis).
    """
    variables: dict[str, tuple[Any, ...]] = {}
    coordinates: dict[str, list[str]] = {}
    groups: dict[str, list[Reaction]] = {}
    for reaction in reactions.values():
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
