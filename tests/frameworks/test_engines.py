"""Functions of every framework against Pinocchio, which shares no code with the library."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles.closure import complete_state
from oracles.description import load, read
from support.cases import BUNDLED_FOLDER
from support.machines import model

from .conftest import ARGUMENTS, STENCIL, arguments, state

NAME, STEP = "masticatory", 1e-4
INVERSE = ARGUMENTS["inverse_dynamics"]


def by_casadi(given: list[np.ndarray]) -> list[np.ndarray]:
    import casadi as ca

    function = model(NAME, "compiled").to_casadi().inverse_dynamics
    symbols = [ca.MX.sym(name, len(a)) for name, a in zip(INVERSE, given, strict=True)]
    effort = function(**dict(zip(INVERSE, symbols, strict=True)))["effort"]
    blocks = [ca.jacobian(effort, symbol) for symbol in symbols]
    value, *found = map(np.array, ca.Function("all", symbols, [effort, *blocks])(*given))
    return [value.ravel(), *found]


def by_jax(given: list[np.ndarray]) -> list[np.ndarray]:
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    function = model(NAME, "compiled").to_jax().inverse_dynamics
    blocks = jax.jacrev(lambda *x: function(*x)["effort"], range(len(given)))(*given)
    return [np.asarray(function(*given)["effort"]), *map(np.asarray, blocks)]


def by_torch(given: list[np.ndarray]) -> list[np.ndarray]:
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    function = model(NAME, "compiled").to_torch().inverse_dynamics
    tensors = tuple(torch.tensor(a, dtype=torch.float64) for a in given)
    blocks = torch.autograd.functional.jacobian(lambda *x: function(*x)["effort"], tensors)
    return [function(*tensors)["effort"].numpy(), *(block.numpy() for block in blocks)]


@pytest.mark.parametrize("framework", [by_casadi, by_jax, by_torch])
def test_values_and_slopes_are_pinocchios(framework: Any, compiler_command: Any) -> None:
    """Efforts, and their slopes in every argument by differences between Pinocchio's efforts."""
    from oracles.pinocchio_engine import PinocchioEngine  # skips where there is none

    description = read(load(BUNDLED_FOLDER / f"{NAME}.toml"))
    pinocchio, names = PinocchioEngine(description), model(NAME).independent
    given = arguments("inverse_dynamics", state(NAME))

    def effort(q: Any, v: Any, a: Any, wrench: Any, at: Any) -> np.ndarray:
        pose = complete_state(description, names, q, v, a)
        return pinocchio.inverse_dynamics(*pose, wrench, at)["tau"]

    value, *slopes = framework(given)
    right = effort(*given)
    assert np.abs(value - right).max() <= 1e-9 * np.abs(right).max()
    for i, slope in enumerate(slopes):
        wanted = np.zeros_like(slope)
        for k in range(slope.shape[1]):
            for step, weight in STENCIL:
                moved = [*given]
                moved[i] = given[i] + STEP * step * np.eye(slope.shape[1])[k]
                wanted[:, k] += weight / STEP * effort(*moved)
        assert np.abs(slope - wanted).max() <= 1e-7 * np.abs(wanted).max(), INVERSE[i]
