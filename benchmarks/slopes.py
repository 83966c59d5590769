"""Derivatives of efforts over the efforts themselves, and beside other engines'.

Kernels on one thread and a batch of samples; of CasADi the Jacobian of its own efforts as C, sample
by sample; JAX on the same graph, jitted; of Pinocchio what it has, which is a part.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

import casadi as ca
import numpy as np

from condyle.mechanism.mechanism import Mechanism
from condyle.model.model import Model

from .own import Case, Timer, python_probe, straight_line, straight_run
from .rows import Probe, Row

SAMPLES = 1_000  # in a cache
STATE, LOAD, NUMBERS = ("q", "q1", "q2"), ("force", "moment", "point"), ("numbers", "lane_numbers")
EFFORTS = "efforts by their kernel"
BY_STATE, BY_INPUTS = "efforts by q, q', q''", "squared efforts by all inputs, reverse"
# What is taken, by what, of the sum of squared efforts or of each effort.
TAKEN = {
    BY_STATE: ("slopes", STATE),
    BY_INPUTS: ("gradient", (*STATE, *LOAD)),
    "squared efforts by all inputs and numbers, reverse": ("gradient", (*STATE, *LOAD, *NUMBERS)),
}


CASADI, JAX = "CasADi's Jacobian in C", "JAX"
PINOCCHIO = "peer pinocchio-derivatives: one"


def slope_probes(
    mechanism: Mechanism, timer: Timer, unavailable: dict[str, str]
) -> Iterator[Probe]:
    """Efforts, and each of `TAKEN`, whose values are not among its results; other engines'."""
    model, case = Model(mechanism, backend="compiled"), Case.of(mechanism)
    q, v, a, wrench, at = case.many(SAMPLES)
    ports = {"q": q, "q1": v, "q2": a, "force": wrench[:, :3], "moment": wrench[:, 3:], "point": at}
    kernel, label = model.kernel("inverse"), mechanism.name
    yield python_probe(f"{label}: {EFFORTS}", partial(kernel.run, ports, 1), SAMPLES)
    ports["w_effort"] = 2 * kernel.run(ports).values["effort"].T
    found = {}
    for what, (how, by) in TAKEN.items():
        taken = model.kernel("derivative", how, "inverse", (), by, ("effort",))
        given = {port.name: ports[port.name] for port in taken.interface.ports}
        found[what] = taken.run(given, 1).values
        yield python_probe(f"{label}: {what}", partial(taken.run, given, 1), SAMPLES)
    slopes = np.moveaxis(  # (samples, chains, all states)
        np.concatenate([found[BY_STATE][f"effort/{name}"] for name in STATE]), -1, 0
    ).swapaxes(1, 2)
    yield _casadi(f"{label}: {BY_STATE}, {CASADI}", case, timer, slopes)
    try:
        yield from _jax(label, model, (q, v, a, wrench, at), slopes, found[BY_INPUTS])
    except ImportError as missing:
        unavailable[f"{JAX}, derivatives"] = str(missing)


def _casadi(name: str, case: Case, timer: Timer, slopes: np.ndarray) -> Probe:
    efforts, order = straight_line(case)
    x = ca.SX.sym("x", efforts.size1_in(0))
    taken = ca.densify(ca.jacobian(efforts(x), x)[:, : slopes.shape[2]])
    function = ca.Function("slopes", [x], [ca.cse(taken)])
    got = np.array([function(sample).full() for sample in case.samples[:64]])
    error = np.abs(got[:, np.argsort(order)] - slopes[:64]).max() / np.abs(slopes).max()
    return Probe(name, partial(straight_run(function, case.samples, timer), 0), error)


def _jax(
    label: str,
    model: Model,
    given: tuple[np.ndarray, ...],
    slopes: np.ndarray,
    gradient: Mapping[str, np.ndarray],
) -> Iterator[Probe]:
    """The graph traced anew, operation by operation, with JAX's own derivatives of it."""
    import jax

    jax.config.update("jax_enable_x64", True)
    dynamics = model.to_jax(method="graph").inverse_dynamics

    def efforts(*sample: jax.Array) -> jax.Array:
        return dynamics(*sample)["effort"]

    def squared(*sample: jax.Array) -> jax.Array:
        return (efforts(*sample) ** 2).sum()

    own = np.concatenate([gradient[f"g_{name}"] for name in STATE]).T
    for what, taken, right in (
        (BY_STATE, jax.jacfwd(efforts, (0, 1, 2)), slopes),
        (BY_INPUTS, jax.grad(squared, (0, 1, 2, 3, 4)), own),
    ):
        run = jax.jit(jax.vmap(taken))
        got = np.concatenate(run(*given)[:3], axis=-1)
        error = float(np.abs(got - right).max() / np.abs(right).max())
        call = partial(lambda run: jax.block_until_ready(run(*given)), run)
        probe = python_probe(f"{label}: {what}, {JAX}", call, SAMPLES)
        yield Probe(probe.name, probe.run, error)


def slope_ratios(label: str, rows: Mapping[str, Row]) -> dict[str, float]:
    """The bars, and how many times longer others take, where they were timed."""
    efforts = rows[f"{label}: {EFFORTS}"]
    ratios = {f"{what}, over the efforts": rows[f"{label}: {what}"].over(efforts) for what in TAKEN}
    others = {
        f"{what}, times faster than {engine}": (f"{label}: {what}, {engine}", what)
        for what, engine in ((BY_STATE, CASADI), (BY_STATE, JAX), (BY_INPUTS, JAX))
    }
    part = f"{BY_STATE}, times faster than Pinocchio C++ for those of the couplers alone"
    others[part] = PINOCCHIO, BY_STATE
    for name, (other, own) in others.items():
        if other in rows:
            ratios[name] = rows[other].over(rows[f"{label}: {own}"])
    return ratios
