"""Every door of the public page: called with what is right, with every form of a model or an array,
and with wrong things; and every module, imported before all others."""

from __future__ import annotations

import inspect
import pkgutil
import random
import subprocess
import sys
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import condyle
from condyle.errors import LONGEST, CondyleError, printable

from .doors import DOORS, MACHINE, Stage, public_doors, target

# Not called rightly here.
UNCALLED = (
    "literature",  # long; its own room reads all cases,
    "Model.to_casadi",  # wants compiled kernels,
    "Model.to_jax",  # doubles,
    "Model.to_torch",  # and PyTorch
    "open_sweep",  # there is no such file here
    "Results.with_measured",
)


def doors(*names: str) -> list[Any]:
    """Names of doors; the dear ones have the mark `ci`."""
    return [pytest.param(n, marks=pytest.mark.ci) if DOORS[n].dear else n for n in names]


@pytest.fixture(scope="module")
def stage() -> Stage:
    return Stage()


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.ci
def test_modules_in_any_order() -> None:
    """A random order in a process; `test_house` proves that there is no circle."""
    found = pkgutil.walk_packages(condyle.__path__, "condyle.")
    modules = sorted(module.name for module in found if not module.name.endswith("__main__"))
    order = random.Random(0).sample(modules, len(modules))
    lines = "import importlib, sys\nfor name in sys.argv[1:]:\n    importlib.import_module(name)\n"
    done = subprocess.run([sys.executable, "-c", lines, *order], capture_output=True, text=True)
    assert not done.returncode, f"{order[:5]} ...: {done.stderr[-2000:]}"


def test_the_page_lists_what_it_has_and_every_door_has_a_row() -> None:
    assert public_doors() == set(DOORS)
    assert len(condyle.__all__) == len(set(condyle.__all__))
    assert all(hasattr(condyle, name) for name in condyle.__all__)
    assert set(condyle.__all__) == set(dir(condyle))


@pytest.mark.parametrize("name", doors(*(name for name in DOORS if name not in UNCALLED)))
def test_right_calls(stage: Stage, name: str) -> None:
    target(name, stage)(**DOORS[name].arguments(stage))


def test_arguments_that_a_door_has_not(stage: Stage) -> None:
    for name, door in DOORS.items():
        with pytest.raises((CondyleError, TypeError), match="nonsense"):
            target(name, stage)(**door.arguments(stage), nonsense=1)


@pytest.mark.parametrize("name", doors(*(name for name, door in DOORS.items() if door.model)))
def test_a_model_a_mechanism_a_path_a_name(stage: Stage, name: str) -> None:
    door, call = DOORS[name], target(name, stage)
    forms = (stage.model, stage.mechanism_file, MACHINE, Path("machine.toml"))
    for given in forms[1:2] if door.dear else forms:
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
        many = {k: np.broadcast_to(right[k], (*lead, len(right[k]))) for k in door.states.split()}
        for key, values in numbers(call(**right | many)).items():
            assert values.shape == lead + one[key].shape, key
            expected = np.broadcast_to(one[key], values.shape)
            np.testing.assert_allclose(values, expected, rtol=1e-12, atol=1e-12, err_msg=key)


def numbers(result: object) -> dict[str, np.ndarray]:
    """Arrays of a result: itself, its entries, or its attributes."""
    found = {"": result} if isinstance(result, np.ndarray) else dict(vars(result))
    found |= {str(k): v for k, v in result.items()} if isinstance(result, Mapping) else {}
    return {k: v for k, v in found.items() if isinstance(v, np.ndarray) and v.dtype.kind in "fiu"}


def test_one_state_unchecked_needs_no_wrench(stage: Stage) -> None:
    """And options of a solution are named."""
    model, q = stage.model, np.zeros(4)
    fast = model.unchecked()
    assert "inverse_dynamics(q, v, a" in repr(fast)
    effort = fast.inverse_dynamics(q, q, q)
    np.testing.assert_allclose(effort, model.inverse_dynamics(q, q, q).effort, atol=1e-12)
    np.testing.assert_allclose(fast.forward_dynamics(q, q, effort), q, atol=1e-9)
    with pytest.raises(TypeError, match="positional"):
        stage.model.solve(stage.motion, stage.load, "incisor")  # type: ignore[misc]


def test_failures_of_a_map_and_of_a_sweep(stage: Stage) -> None:
    """Of three poses of the map the outer ones cannot be reached."""
    found = stage.map.condyle.failures
    rows = [(one.first, one.count, one.status) for one in found]
    assert rows == [(0, 1, "unreachable"), (2, 1, "unreachable")]
    assert str(found[1]).startswith("row 3 (1 sample): unreachable, ")
    sizes = {"what": "platform.mass", "values": [0.1, -1.0]}
    found = condyle.sweep({"vary": [sizes]}, motion=stage.motion, workers=1).condyle.failures
    assert [(one.first, one.owner_kind) for one in found] == [(1, "sample")]
    assert found[0].cause


def test_datasets_and_files_that_are_no_results() -> None:
    for ask in ("failures", "columns", "__repr__", "plot"):
        with pytest.raises(CondyleError, match="condyle"):
            found = getattr(xr.Dataset({"x": ("a", [1, 2])}).condyle, ask)
            (found.effort if ask == "plot" else found)()
    for opens in (condyle.open_solution, condyle.open_map, condyle.open_sweep):
        for given in (5, None, b"x", "", "a\0", "."):
            with pytest.raises(CondyleError, match=r"path|folder"):
                opens(given)


# -- the fuzzer ------------------------------------------------------------------------------


class Strange:
    """Has nothing that anything looks for, and cannot be shown."""

    def __repr__(self) -> str:
        raise RuntimeError("no repr")

    __hash__ = None  # type: ignore[assignment]


def wrong(rng: random.Random, right: Any, stage: Stage) -> Any:
    """Something that an argument may not be, or something near what it is."""
    if isinstance(right, list | tuple | np.ndarray) and rng.random() < 0.5:
        return rng.choice([of_array, of_numbers])(rng, np.array(right))
    if isinstance(right, dict) and right and rng.random() < 0.6:
        key = rng.choice(list(right))
        return right | {rng.choice([key, key, "x"]): wrong(rng, right[key], stage)}
    if isinstance(right, str) and right and rng.random() < 0.3:
        k = rng.randrange(len(right))
        return rng.choice([right[:k], right + right, right[:k] + "\0" + right[k:], right.upper()])
    return rng.choice(anything(rng, stage))


def of_array(rng: random.Random, array: np.ndarray) -> Any:
    """Of another shape or type."""
    return rng.choice(
        [
            *(array[:-1] if array.ndim else array, array[None, None], array.T, array.astype(str)),
            *(array.astype(object), array.tolist(), [*array.tolist(), [None]]),
            np.zeros((0, *array.shape[1:])),
            np.ma.masked_array(array, np.ones(array.shape)),
            dict(enumerate(array)),
            iter(array.tolist() if array.ndim else ()),
        ]
    )


def of_numbers(rng: random.Random, array: np.ndarray) -> Any:
    """With another number in it."""
    if array.dtype.kind not in "fi" or not array.size:
        return rng.choice([[*array.ravel(), 1], array[::-1], [None] * len(array)])
    spoiled = array.astype(complex if rng.random() < 0.1 else float)
    spoiled.flat[rng.randrange(array.size)] = rng.choice([np.nan, np.inf, -np.inf, 1e308, 1e-308])
    return spoiled


def anything(rng: random.Random, stage: Stage) -> list[Any]:
    nested: Any = []
    for _ in range(rng.choice([3, 50, 2000])):
        nested = [nested]
    return [
        *(None, True, False, 0, -1, 7, 10**400, 0.5, float("nan"), float("inf"), -1e308, 1j),
        *("", "x", "a\0b", "\ud800", "\x1b[2J", "furlong", "m" * 100_000, "..", "Fz=-50 kg"),
        *(b"", b"masticatory", [], {}, set(), (), [[]], [1, "a"], {"a": 1}, {1: 2}, nested),
        *(object(), Strange(), int, len, lambda *_: None, range(3), iter([1, 2]), Path("nowhere")),
        *(np.zeros(0), np.zeros((2, 0)), np.zeros((3, 2, 4)), np.array(1.0), np.array("x")),
        *(np.array([None]), np.array([1 + 1j]), np.float32(1), np.int8(1), np.datetime64("2026")),
        *(stage.mechanism, stage.model, stage.motion, stage.load, condyle, ValueError("x")),
    ]


def repr_of(value: Any) -> str:
    try:
        return f"{value!r:.80}"
    except Exception:
        return type(value).__name__


def wrong_calls(name: str, stage: Stage, count: int) -> Iterator[tuple[int, list[str], Any, Any]]:
    """Seed, names of the spoiled arguments, all arguments and the error, None without one."""
    door, call = DOORS[name], target(name, stage)
    for seed in range(count):
        rng = random.Random(f"{name} {seed}")
        given = door.arguments(stage)
        spoiled = rng.sample(sorted(given), 1 if rng.random() < 0.7 else min(2, len(given)))
        given |= {key: wrong(rng, given[key], stage) for key in spoiled}
        long = {*door.long.split()} & {*spoiled}
        if any(repr_of(given[key]) in ("None", "{}") for key in long):
            continue
        error = None
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                call(**given)
        except Exception as caught:
            error = caught
        yield seed, spoiled, given, error


def fault(door: str, spoiled: list[str], given: dict[str, Any], error: Exception) -> str:
    """What is wrong with an error: only a `CondyleError` may come out, in text that a terminal
    can show, and it names an argument."""
    if not isinstance(error, CondyleError):
        at = inspect.getinnerframes(error.__traceback__)[-1]  # type: ignore[arg-type]
        return f"{type(error).__name__} in {Path(at.filename).name}:{at.lineno}: {error!s:.100}"
    said = str(error)
    texts = (given[key] for key in spoiled if isinstance(given[key], str | Path))
    quoted = (printable(str(text))[:20] for text in texts)
    words = (word for word in DOORS[door].words.split(",") if word)
    named = any(word in said for word in (*given, *words, *quoted))
    fits = len(said) <= LONGEST + 100 and said.replace("\n", "").isprintable()
    return "" if named and fits else f"unclear: {said[:150]}"


@pytest.mark.parametrize(
    "share", [pytest.param(24, marks=pytest.mark.slow), pytest.param(2, marks=pytest.mark.ci)]
)
def test_wrong_calls(stage: Stage, share: int) -> None:
    """Calls of every door with arguments of wrong kinds, shapes, names and units."""
    failures = {}
    for name, door in DOORS.items():
        refused, count = 0, -(-door.calls // share) if door.right else 0
        for seed, spoiled, given, error in wrong_calls(name, stage, count):
            refused += isinstance(error, CondyleError)
            if error is not None and (what := fault(name, spoiled, given, error)):
                got = {key: repr_of(given[key]) for key in spoiled}
                failures.setdefault(what, f"{name}, seed {seed}: {got}")
        if count and refused <= count // 20 and share == 2:
            failures[f"{name}: the fuzzer refuses nothing: it tests nothing"] = str(count)
    assert not failures, "\n".join(f"{what}   [{how}]" for what, how in failures.items())
