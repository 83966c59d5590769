"""States of mechanisms, and derivatives of their answers by differences."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from support.machines import model as shared_model

Array = np.ndarray
ARGUMENTS = {
    "inverse_dynamics": ("q", "v", "a", "wrench", "at"),
    "forward_dynamics": ("q", "v", "effort", "wrench", "at"),
}
RESULTS = {"inverse_dynamics": "effort", "forward_dynamics": "acceleration"}
# Steps and weights of central differences of sixth order.
STENCIL = [(s * k, s * w / 60) for k, w in ((1, 45), (2, -9), (3, 1)) for s in (1, -1)]


def state(
    name: str, seed: int = 0, count: int | None = None, size: float = 1.0
) -> dict[str, Array]:
    """Arguments of inverse and forward dynamics."""
    model, rng = shared_model(name), np.random.default_rng(seed)
    m, n = len(model.independent), len(model.mechanism.chains)
    lead = () if count is None else (count,)
    sizes = {"q": (0.003, m), "v": (0.1, m), "a": (1.0, m), "effort": (1.0, n), "wrench": (1.0, 6)}
    sizes["at"] = 0.01, 3
    return {own: size * rng.normal(0, s, (*lead, n)) for own, (s, n) in sizes.items()}


def arguments(question: str, given: dict[str, Array]) -> list[Array]:
    return [given[own] for own in ARGUMENTS[question]]


def answer(name: str, question: str, given: dict[str, Array]) -> Any:
    """By numpy."""
    return getattr(shared_model(name), question)(*arguments(question, given))


@cache
def slopes(name: str, question: str, h: float = 1e-4, size: float = 1.0) -> dict[str, Array]:
    """Of the first result in every argument at `state(name, size=size)`: differences of numpy's."""
    given, names = state(name, size=size), ARGUMENTS[question]
    widths = [len(given[own]) for own in names]
    moves = np.concatenate([k * h * np.eye(sum(widths)) for k, _ in STENCIL])
    parts = np.split(moves, np.cumsum(widths)[:-1], axis=1)
    moved = {own: given[own] + part for own, part in zip(names, parts, strict=True)}
    found = getattr(answer(name, question, moved), RESULTS[question])
    total = np.einsum("k,kij->ji", [w / h for _, w in STENCIL], found.reshape(6, sum(widths), -1))
    return dict(zip(names, np.split(total, np.cumsum(widths)[:-1], axis=1), strict=True))


def check_slopes(found: list[Any], right: dict[str, Array], bound: float = 3e-8) -> None:
    """Derivatives, in the order of `right`, to what differences leave."""
    for (name, wanted), got in zip(right.items(), found, strict=True):
        assert np.abs(np.asarray(got) - wanted).max() <= bound * np.abs(wanted).max(), name
