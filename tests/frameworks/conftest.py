"""States of mechanisms, and derivatives of their answers by differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import condyle

Array = np.ndarray
NAMES = ("masticatory", "masticatory-curved", "gough-stewart")


@pytest.fixture(params=NAMES)
def model(request, compiler_command) -> condyle.Model:
    return condyle.derive(request.param, backend="compiled")


def state(model: condyle.Model, seed: int = 0, count: int | None = None) -> dict[str, Array]:
    """Arguments of inverse and forward dynamics."""
    rng, m, n = np.random.default_rng(seed), len(model.independent), len(model.mechanism.chains)
    lead = () if count is None else (count,)
    sizes = {"q": (0.003, m), "v": (0.1, m), "a": (1.0, m), "effort": (1.0, n), "wrench": (1.0, 6)}
    sizes["at"] = 0.01, 3
    return {name: rng.normal(0, s, (*lead, size)) for name, (s, size) in sizes.items()}


def differences(function: Callable[[Array], Array], x: Array, h: float = 1e-4) -> Array:
    """d function / d x by central differences of sixth order."""
    weights = {1: 45 / 60, 2: -9 / 60, 3: 1 / 60}
    return np.stack(
        [
            sum(w * (function(x + k * h * e) - function(x - k * h * e)) for k, w in weights.items())
            / h
            for e in np.eye(len(x))
        ],
        axis=-1,
    )


def numpy_answers(model: condyle.Model, question: str, names: tuple[str, ...]) -> Callable:
    """The first result of a question by numpy, as a function of its arguments."""
    plain = condyle.derive(model.mechanism, backend="numpy", distribution=model.distribution)
    result = {"inverse_dynamics": "effort", "forward_dynamics": "acceleration"}[question]
    return lambda given: getattr(getattr(plain, question)(*(given[x] for x in names)), result)


ARGUMENTS = {
    "inverse_dynamics": ("q", "v", "a", "wrench", "at"),
    "forward_dynamics": ("q", "v", "effort", "wrench", "at"),
}
RESULTS = {"inverse_dynamics": "effort", "forward_dynamics": "acceleration"}


def slopes(
    model: condyle.Model, question: str, given: dict[str, Array], by: str, h: float = 1e-4
) -> Array:
    """Of the first result in one argument, by differences of numpy's."""
    answer = numpy_answers(model, question, ARGUMENTS[question])
    return differences(lambda x: answer(given | {by: x}), given[by], h)
