"""Whatever a mechanism file holds: a mechanism, or a message that a person can read."""

from __future__ import annotations

import json
import random
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import condyle
from condyle.errors import CondyleError, CondyleWarning
from condyle.mechanism import Mechanism, dumps, parse
from condyle.mechanism.files import from_data
from condyle.mechanism.mechanism_checks import mechanism_warnings
from fuzz import mutations

LONGEST = 4000  # characters of a message


def readable(text: str) -> None:
    assert 0 < len(text) < LONGEST, len(text)
    assert text.replace("\n", "").isprintable(), repr(text)


def outcome(read: Callable[[], Any]) -> bool:
    """Whether it was a mechanism; all that is said of it must be readable."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", CondyleWarning)
        try:
            machine = read()
        except CondyleError as error:
            readable(str(error))
            return False
        assert isinstance(machine, Mechanism)
        readable(repr(machine))
        for warning in mechanism_warnings(machine):
            readable(str(warning))
            json.dumps(warning.data, allow_nan=False)
    return True


def run(seeds: range, attempt: Callable[[random.Random], bool]) -> None:
    """Both outcomes must occur, else the fuzzer has stopped testing something."""
    found = {True: 0, False: 0}
    for seed in seeds:
        try:
            found[attempt(random.Random(seed))] += 1
        except Exception as error:
            pytest.fail(f"seed {seed}: {type(error).__name__}: {str(error)[:300]}")
    assert found[False] and (found[True] or len(seeds) < 100), found


def test_broken_texts(fuzz_seeds: range) -> None:
    def attempt(rng: random.Random) -> bool:
        text = mutations.broken_text(rng)
        return outcome(lambda: parse(text, "jaw.toml"))

    run(fuzz_seeds, attempt)


def test_broken_bytes(fuzz_seeds: range, tmp_path: Path) -> None:
    path = tmp_path / "jaw.toml"

    def attempt(rng: random.Random) -> bool:
        path.write_bytes(mutations.broken_bytes(rng))
        return outcome(lambda: condyle.load_mechanism(path))

    run(fuzz_seeds, attempt)


def test_broken_tables(fuzz_seeds: range) -> None:
    def attempt(rng: random.Random) -> bool:
        tables = mutations.broken_tables(rng)
        good = outcome(lambda: from_data(tables, "jaw.toml"))
        if good:  # what passed is written and read as it is
            machine = from_data(tables)
            assert parse(dumps(machine)) == machine
        return good

    run(fuzz_seeds, attempt)


def test_hostile_changes(fuzz_seeds: range, reference: Mechanism) -> None:
    places = ["platform.mass", "gravity[2]", "chain.masseter_left.base[1]", "name", "dependent"]
    places += ["contact.left_condyle.surface", "contact.left_condyle.bounds.x", "chain", "contact"]
    places += ["platform.points", "platform.points.tip", "chain.masseter_left.actuator"]

    def attempt(rng: random.Random) -> bool:
        place = rng.choice([*places, *mutations.STRANGE])
        if rng.random() < 0.3:
            at = rng.randrange(len(place) + 1)
            place = place[:at] + rng.choice([*mutations.STRANGE, "[", "]", ".", '"']) + place[at:]
        value = rng.choice([mutations.hostile(rng), 0.3, None])
        if rng.random() < 0.2:
            return outcome(lambda: reference.set({place: value, rng.choice(places): 1.0}))
        return outcome(lambda: reference.set(place, value))

    run(fuzz_seeds, attempt)
