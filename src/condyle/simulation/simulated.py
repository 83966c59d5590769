"""From a trace to a labelled solution: what moved, what was commanded, measured and lost."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
import xarray as xr

from ..errors import InputError
from ..mechanism.vocabulary import words_of
from ..model.distributing import shares
from ..model.model import Model, model_for, model_with_mechanism, parts_with_inputs
from ..model.model_result import ModelResult
from ..motion.gravity_and_base import Given
from ..quantities.entries import labels_of
from ..questions.equations import INTERNAL
from ..questions.kalman import entries
from ..questions.load.penalty import Penalty
from ..results.derived import Derived
from ..results.solving import labelled
from ..results.warnings import Notice, Watch
from .compliant import INDENTED, ContactLaws
from .plan import WORKS, ClosedLoop, FreedContacts, Plan, Trace
from .plant import Plant
from .slips import odd_things

POTENTIAL, CONTACTS = 1, 2 + WORKS.index("contact_friction")  # accounts of the energy


def solved(plan: Plan, trace: Trace, started: float, samples: int | None = None) -> xr.Dataset:
    """The solution of a run; `started`: of the clock `perf_counter`; `samples`: of all runs that
    are solved together."""
    if not len(trace.t):
        end = trace.ended
        raise InputError(f"{plan.source}: the run ended before it began: {end}")
    run, count = plan.freed or plan, len(trace.t) if samples is None else samples
    m, model = len(run.q), model_for(plan.model, count)
    moving = model if run is plan else model_for(run.model, count)
    q, q1 = trace.state[:, :m], trace.state[:, m : 2 * m]
    acted = Plant([run]).at_states(trace.t, trace.state, trace.modes, trace.effort)
    wrench, lifting = acted["wrench"], run.lifting
    around: Given = {} if plan.path is None else plan.path.around_at(trace.t)
    effort = acted.get("delivered", trace.effort)
    friction = None
    if run.sticking:
        friction, moving = acted["friction_wrench"], _without_friction(model)
        loaded = wrench + friction
        result = moving.forward_dynamics(q, q1, effort, loaded, **around, outputs="all")
        sliding = {name: acted[name] for name in ("slip", "friction_force")}
        result = ModelResult(**vars(result) | sliding)
    elif lifting is None:
        result = model.forward_dynamics(q, q1, effort, wrench, **around, outputs="all")
    else:
        result = _lifted(model, moving, lifting, (q, q1, effort), acted, around)
    # On a base that moves, or under gravity that turns, there is no potential.
    simulated = {} if around else _energy(moving, q, q1, trace, run)
    if lifting is not None and lifting.compliant:
        laws = ContactLaws(lifting).forces(*(acted[name] for name in INDENTED))
        elastic = _by_contact(lifting, laws.elastic * lifting.push, result.contact_force)
        result = ModelResult(**vars(result) | {"elastic_force": elastic})
        if "energy" in simulated:  # what contacts have taken is partly stored
            stored = laws.energy.sum(axis=1)
            simulated["energy"][:, POTENTIAL] += stored
            simulated["energy"][:, CONTACTS] -= stored - stored[:1]
    if run.drives is not None:
        simulated["motor_joint"] = np.where(
            run.drives.elastic, trace.state[:, Plant([run]).lags["motor_joint"]], result.joint
        )
        if "energy" in simulated:
            simulated["energy"][:, : POTENTIAL + 1] += acted["drive_energy"]
    evaluation = _evaluation(moving if run.sticking else model, result, effort, wrench, around)
    if friction is not None:
        rubbed = _evaluation(moving, result, effort, wrench + friction, around).share
        by_friction = rubbed[:, -2] - evaluation.share[:, -2]  # of the load, the last but internal
        share = [evaluation.share[:, :-1], by_friction[:, None], rubbed[:, -1:]]
        evaluation = ModelResult(**vars(evaluation) | {"share": np.concatenate(share, axis=1)})
    if lifting is not None:
        gap = np.zeros_like(result.contact_force)
        gap[:, lifting.contacts] = np.inf
        for i, face in zip(lifting.contacts, acted["gap"].T, strict=True):
            gap[:, i] = np.minimum(gap[:, i], face)
        simulated["contact_gap"] = gap
    if run.drives or any(not chain.actuator.ideal for chain in model.mechanism.chains):
        simulated["actuator_loss"] = acted["loss"]
    if "excitation" in acted:
        simulated["excitation"] = acted["excitation"]
    if plan.loads:
        simulated |= {
            "load_force": acted["load_force"],
            "load_mode": trace.modes[:, : len(plan.loads)],
        }
    if walls := [i for i, load in enumerate(plan.loads) if load.law is Penalty]:
        simulated["wall_force"] = np.linalg.norm(acted["load_force"][:, walls], axis=2)
    if isinstance(plan.drive, ClosedLoop):
        state = trace.state if lifting is None else lifting.seen(trace.state)
        simulated |= _controlled(plan, plan.drive, trace, state)
    derived = Derived(model.mechanism, evaluation, wrench, simulated=simulated, given=around)
    watch = Watch(model.mechanism)
    watch.see(derived, trace.t)
    notices = [*(Notice("implausible", text) for text in odd_things(plan)), *watch.notices()]
    if (end := trace.ended) is not None:
        text = f"the run ended at t = {end.time:.6g} s of {plan.duration:g} s: {end.text}"
        text = words_of(model.mechanism)(text) + (f' ("{end.owner}")' if end.owner else "")
        notices.append(Notice("ended", text, end.owner or None, time=end.time))
    parts = parts_with_inputs(model, around)
    parts = parts if INTERNAL in parts else (*parts, INTERNAL)
    seconds = time.perf_counter() - started
    solution = labelled(
        model,
        derived,
        trace.t,
        parts,
        f"Simulation of {model.mechanism.name}",
        _options(plan, seconds),
        notices,
    )
    solution["effort"].attrs["long_name"] = "actuator effort as it acted"
    solution.attrs["events"] = json.dumps([event.to_dict() for event in trace.events])
    if lifting is not None:
        lifts = {name: asdict(lift) for name, lift in trace.lifts.items()}
        solution.attrs["contact_lifts"] = json.dumps(lifts)
    own = ("account", *(("estimated", "beside") if trace.filtered else ()))
    labels = {name: list(of) for name, of in labels_of(model.mechanism, *own).items()}
    if plan.loads:
        labels["source"] = [load.name for load in plan.loads]
    return solution.assign_coords(labels)


def _without_friction(model: Model) -> Model:
    """The model of smooth contacts."""
    smooth = [one.model_copy(update={"friction": None}) for one in model.mechanism.contacts]
    mechanism = model.mechanism.replace(contacts=tuple(smooth))
    return model_with_mechanism(model, mechanism, model.distribution.name)


def _lifted(
    model: Model,
    freed: Model,
    lifting: FreedContacts,
    state: tuple[np.ndarray, np.ndarray, np.ndarray],
    acted: Mapping[str, np.ndarray],
    around: Given,
) -> ModelResult:
    """Forward dynamics of a platform under its active contacts, as of the model with all of them.

    Args: state: q, q' and efforts;  acted: what acted there.
    """
    wrench, contacts = acted["wrench"] + acted["pressed_wrench"], model.mechanism.contacts
    every = freed.forward_dynamics(*state, wrench, **around, outputs="all")
    own, rows = lifting.contacts, lifting.coordinates
    others = [i for i in range(len(contacts)) if i not in own]
    force = np.zeros((len(wrench), len(contacts)))
    force[:, others] = every.contact_force
    force = _by_contact(lifting, acted["pressing"] * lifting.push, force)
    active = np.ones(force.shape, dtype=bool)
    active[:, own] = force[:, own] != 0
    configuration = model.poses.configuration(every.pose)
    found = vars(every) | {"acceleration": every.acceleration[:, rows], "contact_force": force}
    found |= {"configuration": configuration, "condition": configuration.singularity.condition}
    return ModelResult(**found | {"contact_active": active})


def _by_contact(lifting: FreedContacts, faces: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Forces of contacts, (N, k): of those that lift the sums over their faces, (N, c)."""
    force = force.copy()
    force[:, lifting.contacts] = 0.0
    for i, face in zip(lifting.contacts, faces.T, strict=True):
        force[:, i] += face
    return force


def _evaluation(
    model: Model,
    result: ModelResult,
    effort: np.ndarray,
    wrench: np.ndarray,
    around: Given,
) -> ModelResult:
    """Everything about the states of a trace, from forward dynamics."""
    ports = {name: getattr(result, name) for name in ("pose", "pose_rate", "pose_acceleration")}
    ports |= {"force": wrench[:, :3], "moment": wrench[:, 3:], "point": np.zeros((1, 3))}
    system = model.system.with_inputs(tuple(around)).kernel("system")
    values = system.run(ports | dict[str, Any](around)).values
    s = {name: np.moveaxis(a, -1, 0) for name, a in values.items()}
    rubbed = any(c.friction.coefficient for c in model.mechanism.contacts)
    share = shares(s, effort, result.contact_force if rubbed else None)
    own = {"effort": effort, "share": share.transpose(0, 2, 1), "shortfall": np.ones(len(effort))}
    if rubbed and "contact_active" in vars(result):
        own["slip"] = s["slip"]
        own["friction_force"] = -np.abs(result.contact_force)[..., None] * s["drag"]
    own["bound"] = result.bound * _share_of_motion(model, result.acceleration)
    return ModelResult(**vars(result) | own)


def _share_of_motion(model: Model, acceleration: np.ndarray) -> np.ndarray:
    """Sizes of accelerations, (N, m), over that of the motion, (N,).

    That is the largest along the motion, or gravity: relative to an acceleration near 0, as at
    rest, any error is large. Angles count times the characteristic length.
    """
    angles = ("alpha", "beta", "gamma")
    weights = [model.system.length if n in angles else 1.0 for n in model.independent]
    size = np.abs(acceleration * weights).max(axis=1)
    gravity = float(np.linalg.norm(model.mechanism.gravity))
    return size / max(np.nanmax(size, initial=gravity), np.finfo(float).tiny)


def _energy(
    model: Model, q: np.ndarray, q1: np.ndarray, trace: Trace, plan: Plan
) -> dict[str, np.ndarray]:
    """Kinetic and potential energy, works and losses since the start [J]."""
    values = model.kernel("energy").run({"q": q, "q1": q1}).values
    accounts = [
        values["kinetic"],
        values["potential"],
        *trace.state[:, 2 * len(plan.q) :][:, : len(WORKS)].T,
    ]
    return {"energy": np.column_stack(accounts)}


def _controlled(
    plan: Plan, drive: ClosedLoop, trace: Trace, state: np.ndarray
) -> dict[str, np.ndarray]:
    """Commands, measurements and the reference, at states (N, size) of the controller's."""
    m = len(plan.q)
    wanted, rate, _ = drive.path.states(trace.t)
    values = {
        "reference": wanted,
        "reference_rate": rate,
        "tracking_error": wanted - state[:, :m],
    }
    if drive.period is None:
        return values
    k = trace.tick
    values |= {
        "command": trace.command[k],
        "measured_joint": trace.count[k],
        "estimate": trace.estimate[k, :m],
        "estimate_rate": trace.estimate[k, m:],
    }
    if drive.law.place is not None:
        values["bite_force"] = trace.force[k]
    if drive.path.force.any():
        values["bite_reference"] = drive.path.force_at(trace.t)
    if trace.filtered:
        rows, columns = zip(*entries(size := 2 * m + 3), strict=True)
        full = np.empty((len(k), size, size))
        full[:, rows, columns] = full[:, columns, rows] = trace.filtered["covariance"][k]
        values |= {
            "load_estimate": trace.filtered["measured_force"][k],
            "estimate_covariance": full,
            "innovation": trace.filtered["innovation"][k, 0],
        }
    return values


def _options(plan: Plan, seconds: float) -> dict[str, Any]:
    scenario = plan.scenario
    kind = scenario.controller.kind if scenario.closed_loop else "open loop"
    return {
        "motion": f"simulation, {kind}",
        "motion_kind": "simulation",
        "load": ", ".join(load.name for load in plan.loads) or "no load",
        "load_point": next((load.place for load in plan.loads if load.place), None),
        "solve_seconds": seconds,
        "scenario_source": plan.source,
        "scenario": json.loads(scenario.model_dump_json(by_alias=True, exclude_none=True)),
        "method": plan.method,
        "rtol": plan.settings.rtol,
        "step": plan.settings.step,
    }
