"""Functions of every framework against Pinocchio, which shares no code with the library."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles.closure import complete_state
from oracles.description import load, read
from support.cases import BUNDLED_FOLDER
from support.families import close
from support.machines import model

from .conftest import ARGUMENTS, RESULTS, STENCIL, arguments, state

NAME, STEP = "masticatory", 1e-4
Given = list[np.ndarray]


def by_casadi(question: str, given: Given) -> Given:
    import casadi as ca

    function, names = getattr(model(NAME, "compiled").to_casadi(), question), ARGUMENTS[question]
    symbols = [ca.MX.sym(name, len(a)) for name, a in zip(names, given, strict=True)]
    value = function(**dict(zip(names, symbols, strict=True)))[RESULTS[question]]
    blocks = [ca.jacobian(value, symbol) for symbol in symbols]
    found, *slopes = map(np.array, ca.Function("all", symbols, [value, *blocks])(*given))
    return [found.ravel(), *slopes]


def by_jax(question: str, given: Given) -> Given:
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    function, result = getattr(model(NAME, "compiled").to_jax(), question), RESULTS[question]
    blocks = jax.jacrev(lambda *x: function(*x)[result], range(len(given)))(*given)
    return [np.asarray(function(*given)[result]), *map(np.asarray, blocks)]


def by_torch(question: str, given: Given) -> Given:
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    function, result = getattr(model(NAME, "compiled").to_torch(), question), RESULTS[question]
    tensors = tuple(torch.tensor(a, dtype=torch.float64) for a in given)
    blocks = torch.autograd.functional.jacobian(lambda *x: function(*x)[result], tensors)
    return [function(*tensors)[result].numpy(), *(block.numpy() for block in blocks)]


@pytest.mark.parametrize("framework", [by_casadi, by_jax, by_torch])
def test_values_and_slopes_are_pinocchios(framework: Any, compiler_command: Any) -> None:
    """Efforts, and their slopes in every argument by differences between Pinocchio's efforts; by
    those efforts the mechanism accelerates as it should."""
    from oracles.pinocchio_engine import PinocchioEngine  # skips where there is none

    description = read(load(BUNDLED_FOLDER / f"{NAME}.toml"))
    pinocchio, names = PinocchioEngine(description), model(NAME).independent
    given = arguments("inverse_dynamics", state(NAME))

    def effort(q: Any, v: Any, a: Any, wrench: Any, at: Any) -> np.ndarray:
        pose = complete_state(description, names, q, v, a)
        return pinocchio.inverse_dynamics(*pose, wrench, at)["tau"]

    value, *slopes = framework("inverse_dynamics", given)
    right = effort(*given)
    close(value, right, 1e-9)
    for i, slope in enumerate(slopes):
        wanted = np.zeros_like(slope)
        for k in range(slope.shape[1]):
            for step, weight in STENCIL:
                moved = [*given]
                moved[i] = given[i] + STEP * step * np.eye(slope.shape[1])[k]
                wanted[:, k] += weight / STEP * effort(*moved)
        close(slope, wanted, 1e-7)
    q, v, a, *load_at = given
    acceleration, *slopes = framework("forward_dynamics", [q, v, right, *load_at])
    close(acceleration, a, 1e-9)
    # Efforts are linear in accelerations.
    by_a = effort(q, v, a + np.eye(4)[0], *load_at) - right
    close(slopes[2] @ by_a, np.eye(4)[0], 1e-9)
