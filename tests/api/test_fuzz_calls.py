"""Calls of every door with arguments of wrong kinds, shapes, names and units.

Only a `CondyleError` may come out, in text that a terminal can show, and it names an argument.
"""

from __future__ import annotations

import inspect
import random
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.errors import LONGEST, CondyleError, printable

from .doors import DOORS, Stage, target


class Strange:
    """Has nothing that anything looks for, and cannot be shown."""

    def __repr__(self) -> str:
        raise RuntimeError("no repr")

    __hash__ = None  # type: ignore[assignment]


def wrong(rng: random.Random, right: Any, stage: Stage) -> Any:
    """Something that an argument may not be, or something near what it is."""
    near = isinstance(right, list | tuple | np.ndarray) and rng.random() < 0.5
    if near:
        array = np.array(right)
        return rng.choice([of_array, of_numbers])(rng, array)
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
            array[:-1] if array.ndim else array,
            array[None, None],
            array.T,
            array.astype(str),
            array.astype(object),
            array.tolist(),
            [*array.tolist(), [None]],
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


@pytest.fixture(scope="module")
def stage() -> Stage:
    return Stage()


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.chdir(tmp_path)
    yield


@pytest.mark.parametrize("name", [name for name, d in DOORS.items() if d.right])
def test_wrong_calls(stage: Stage, name: str) -> None:
    door, call = DOORS[name], target(name, stage)
    refused, failures = 0, {}
    for seed in range(door.calls):
        rng = random.Random(f"{name} {seed}")
        given = door.arguments(stage)
        spoiled = rng.sample(sorted(given), 1 if rng.random() < 0.7 else min(2, len(given)))
        given |= {key: wrong(rng, given[key], stage) for key in spoiled}
        if any(repr_of(given[key]) in ("None", "{}") for key in {*door.long} & {*spoiled}):
            continue
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                call(**given)
        except CondyleError as error:
            refused += 1
            said = str(error)
            texts = (given[key] for key in spoiled if isinstance(given[key], str | Path))
            quoted = (printable(str(text))[:20] for text in texts)
            named = any(word in said for word in (*given, *door.words, *quoted))
            if not named or len(said) > LONGEST + 100 or not said.replace("\n", "").isprintable():
                failures.setdefault(f"unclear: {said[:150]}", f"seed {seed}, {spoiled}")
        except Exception as error:
            at = inspect.trace()[-1]
            where = f"{Path(at.filename).name}:{at.lineno}"
            got = {key: repr_of(given[key]) for key in spoiled}
            failures.setdefault(f"{type(error).__name__} in {where}: {error!s:.100}", f"{got}")
    assert not failures, "\n".join(f"{what}   [{how}]" for what, how in failures.items())
    assert refused > door.calls // 20, "the fuzzer refuses nothing: it tests nothing"


def repr_of(value: Any) -> str:
    try:
        return f"{value!r:.80}"
    except Exception:
        return type(value).__name__
