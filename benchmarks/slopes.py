"""Derivatives of efforts over the efforts themselves: kernels, one thread, a batch of samples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from condyle.mechanism.mechanism import Mechanism
from condyle.model.model import Model

from .own import Case, python_probe
from .rows import Probe, Row

SAMPLES = 1_000  # in a cache
STATE, LOAD, NUMBERS = ("q", "q1", "q2"), ("force", "moment", "point"), ("numbers", "lane_numbers")
EFFORTS = "efforts by their kernel"
# What is taken, by what, of the sum of squared efforts or of each effort.
TAKEN = {
    "efforts by q, q', q''": ("slopes", STATE),
    "squared efforts by all inputs, reverse": ("gradient", (*STATE, *LOAD)),
    "squared efforts by all inputs and numbers, reverse": ("gradient", (*STATE, *LOAD, *NUMBERS)),
}


def slope_probes(mechanism: Mechanism) -> Iterator[Probe]:
    """Efforts, and each of `TAKEN`, whose values are not among its results."""
    model = Model(mechanism, backend="compiled")
    q, v, a, wrench, at = Case.of(mechanism).many(SAMPLES)
    ports = {"q": q, "q1": v, "q2": a, "force": wrench[:, :3], "moment": wrench[:, 3:], "point": at}
    kernel, label = model.kernel("inverse"), mechanism.name
    yield python_probe(f"{label}: {EFFORTS}", partial(kernel.run, ports, 1), SAMPLES)
    ports["w_effort"] = 2 * kernel.run(ports).values["effort"].T
    for what, (how, by) in TAKEN.items():
        taken = model.kernel("derivative", how, "inverse", (), by, ("effort",))
        given = {port.name: ports[port.name] for port in taken.interface.ports}
        yield python_probe(f"{label}: {what}", partial(taken.run, given, 1), SAMPLES)


def slope_ratios(label: str, rows: Mapping[str, Row]) -> dict[str, float]:
    efforts = rows[f"{label}: {EFFORTS}"]
    return {f"{what}, over the efforts": rows[f"{label}: {what}"].over(efforts) for what in TAKEN}
