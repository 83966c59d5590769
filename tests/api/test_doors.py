"""Every door of the public page: called with what is right, with every form of a model or an array,
and with a wrong thing; and every module, imported before all others."""

from __future__ import annotations

import pkgutil
import random
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.speeds import first, slow

import condyle
from condyle.errors import CondyleError

from .doors import DOORS, MACHINE, Stage, public_doors, target

# Its file is none here: the right call is refused too.
BROKEN = (
    "Model.to_casadi",  # wants compiled kernels,
    "Model.to_jax",  # doubles,
    "Model.to_torch",  # and PyTorch
    "open_sweep",
    "Results.with_measured",
)
MODULES = sorted(
    module.name
    for module in pkgutil.walk_packages(condyle.__path__, "condyle.")
    if not module.name.endswith("__main__")
)
ORDERS = 3


@pytest.fixture(scope="module")
def stage() -> Stage:
    return Stage()


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.chdir(tmp_path)
    yield


@pytest.mark.parametrize("seed", first(range(ORDERS), rest=slow))
def test_modules_in_any_order(seed: int) -> None:
    """One process an order, each begun by other modules; `test_house` proves there is no circle."""
    order = random.Random(seed).sample(MODULES, len(MODULES))
    lines = "import importlib, sys\nfor name in sys.argv[1:]:\n    importlib.import_module(name)\n"
    done = subprocess.run([sys.executable, "-c", lines, *order], capture_output=True, text=True)
    assert not done.returncode, f"{order[:5]} ...: {done.stderr[-2000:]}"


def test_every_door_has_a_row() -> None:
    assert public_doors() == set(DOORS)


def test_the_page_lists_what_it_has() -> None:
    assert len(condyle.__all__) == len(set(condyle.__all__))
    assert all(hasattr(condyle, name) for name in condyle.__all__)
    assert set(condyle.__all__) == set(dir(condyle))


@pytest.mark.parametrize("name", [name for name in DOORS if name not in BROKEN])
def test_right_calls(stage: Stage, name: str) -> None:
    target(name, stage)(**DOORS[name].arguments(stage))


@pytest.mark.parametrize("name", [name for name, door in DOORS.items() if door.model])
def test_a_model_a_mechanism_a_path_a_name(stage: Stage, name: str) -> None:
    door, call = DOORS[name], target(name, stage)
    file = stage.mechanism_file
    for given in (stage.model, stage.mechanism, MACHINE, file, Path(file)):
        call(**door.arguments(stage) | {door.model: given})
    for wrong, said in ((5, "int"), (None, "NoneType"), (b"masticatory", "bytes"), ([], "list")):
        with pytest.raises(CondyleError, match=f"(mechanism|model): expected a .*got {said}") as e:
            call(**door.arguments(stage) | {door.model: wrong})
        assert "\n" not in str(e.value)
    with pytest.raises(CondyleError, match="masticatory"):
        call(**door.arguments(stage) | {door.model: "mastikatory"})


@pytest.mark.parametrize("name", [name for name, door in DOORS.items() if door.states])
def test_a_vector_and_a_batch(stage: Stage, name: str) -> None:
    """States of shapes (m,), (N, m) and (V, N, m) give the same numbers, of their leading shape."""
    door, call = DOORS[name], target(name, stage)
    right = door.arguments(stage)
    one = numbers(call(**right))
    for lead in ((3,), (2, 3)):
        many = {k: np.broadcast_to(right[k], (*lead, len(right[k]))) for k in door.states}
        for key, values in numbers(call(**right | many)).items():
            assert values.shape == lead + one[key].shape, key
            expected = np.broadcast_to(one[key], values.shape)
            np.testing.assert_allclose(values, expected, rtol=1e-12, atol=1e-12, err_msg=key)


def numbers(result: object) -> dict[str, np.ndarray]:
    """Arrays of a result: itself, its entries, or its attributes."""
    found = {"": result} if isinstance(result, np.ndarray) else dict(vars(result))
    found |= {str(k): v for k, v in result.items()} if isinstance(result, Mapping) else {}
    return {k: v for k, v in found.items() if isinstance(v, np.ndarray) and v.dtype.kind in "fiu"}


@pytest.mark.parametrize("name", DOORS)
def test_arguments_that_a_door_has_not(stage: Stage, name: str) -> None:
    call = target(name, stage)
    with pytest.raises((CondyleError, TypeError), match="nonsense"):
        call(**DOORS[name].arguments(stage), nonsense=1)


@pytest.mark.parametrize("backend", ["numpy", "compiled"])
def test_one_state_unchecked_needs_no_wrench(stage: Stage, backend: str) -> None:
    model, q = condyle.Model(MACHINE, backend=backend), np.zeros(4)
    fast = model.unchecked()
    assert "inverse_dynamics(q, v, a" in repr(fast)
    effort = fast.inverse_dynamics(q, q, q)
    np.testing.assert_allclose(effort, model.inverse_dynamics(q, q, q).effort, atol=1e-12)
    np.testing.assert_allclose(fast.forward_dynamics(q, q, effort), q, atol=1e-9)


def test_options_of_a_solution_are_named(stage: Stage) -> None:
    with pytest.raises(TypeError, match="positional"):
        stage.model.solve(stage.motion, stage.load, "incisor")  # type: ignore[misc]


def test_failures_of_a_map(stage: Stage) -> None:
    """Of three poses the outer ones cannot be reached."""
    found = stage.map.condyle.failures
    assert [(one.first, one.count, one.status) for one in found] == [
        (0, 1, "unreachable"),
        (2, 1, "unreachable"),
    ]
    assert str(found[1]).startswith("row 3 (1 sample): unreachable, ")


def test_failures_of_a_sweep(stage: Stage) -> None:
    sizes = {"what": "platform.mass", "values": [0.1, -1.0]}
    found = condyle.sweep({"vary": [sizes]}, motion=stage.motion, workers=1).condyle.failures
    assert [(one.first, one.owner_kind) for one in found] == [(1, "sample")]
    assert found[0].cause


@pytest.mark.parametrize("ask", ["failures", "columns", "__repr__", "plot"])
def test_datasets_that_are_no_results(ask: str) -> None:
    import xarray as xr

    with pytest.raises(CondyleError, match="condyle"):
        found = getattr(xr.Dataset({"x": ("a", [1, 2])}).condyle, ask)
        (found.effort if ask == "plot" else found)()


@pytest.mark.parametrize("opens", [condyle.open_solution, condyle.open_map, condyle.open_sweep])
@pytest.mark.parametrize("given", [5, None, b"x", "", "a\0", "."])
def test_files_that_are_no_results(opens: Callable[[Any], Any], given: object) -> None:
    with pytest.raises(CondyleError, match=r"path|folder"):
        opens(given)
