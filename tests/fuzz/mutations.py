"""Mechanism files, broken in every way that came to mind; and what must come of broken files."""

from __future__ import annotations

import copy
import math
import random
import re
import tomllib
import warnings
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
import tomli_w
from oracles.random_mechanism import SURFACES, random_mechanism, random_surface, toml_text

from condyle.errors import CondyleError, CondyleWarning
from condyle.mechanism import bundled_mechanisms, bundled_text
from condyle.mechanism.library import starter_text

HOME = np.array([-26.65, 72, 42.53])
STRANGE = [
    *("", " ", "\x1b[31mred", "\u202eback", "a\u2028b", "\x7f", "\U0001f9b7", "constructor"),
    *("__proto__", "__class__", "model_fields", "kind", "name", "n" * 300, "\u00e9" * 200, "../up"),
    *("a.b[3]", "<b>", "%s{0}", "nan", "\\", "="),
]
NUMBERS: list[Any] = [0, -1, 1, 1e-300, 1e-12, 1e7, 1e12, 1e200, -1e308, 5e-324, 2**63, 10**30]
NUMBERS += [math.nan, math.inf, -math.inf, -0.0, 10**4000]
LITERALS = ["9" * 5000, "1e400", "0x" + "f" * 5000, "-nan", "1_0", "1979-05-27", "07:32:00"]
LITERALS += ["[" * 3000 + "]" * 3000, "{a=" * 300 + "1" + "}" * 300, "true", "'''\n'''"]
LITERALS += ['"\\u0000"']
LITERALS += [".".join("a" * 2000) + " = 1", "[" + ".".join("b" * 2000) + "]", "[[chain]]", "[x]"]


@lru_cache(maxsize=1)
def originals() -> tuple[str, ...]:
    """Good files: bundled ones, the starter, every family and every surface."""
    texts = [*map(bundled_text, bundled_mechanisms()), starter_text("start")]
    texts += [toml_text(random_mechanism(np.random.default_rng(k), contacts=k)) for k in range(6)]
    for kind in SURFACES:
        raw = tomllib.loads(bundled_text("masticatory"))
        rng = np.random.default_rng(2)
        surface = random_surface(rng, kind, HOME, np.array([-1.1, 0.0]))
        side = "inside" if kind in ("sphere", "cylinder", "ellipsoid") else "below"
        raw["contact"][0] |= {"surface": surface, "side": side, "one_sided": True}
        texts.append(tomli_w.dumps(raw))
    return tuple(texts)


def broken_text(rng: random.Random) -> str:
    """The text of a file after one to four accidents."""
    text = rng.choice(originals())
    for _ in range(rng.randint(1, 4)):
        text = rng.choice(ACCIDENTS)(text, rng)
    return text


def broken_bytes(rng: random.Random) -> bytes:
    """A file some of whose bytes were lost, changed or doubled."""
    content = bytearray(broken_text(rng).encode("utf-8", "replace"))
    for _ in range(rng.randint(0, 3)):
        at = rng.randrange(len(content) + 1)
        damage = rng.choice([b"", b"\x00", b"\xff\xfe", b"\r", b"\n", rng.randbytes(3)])
        content[at : at + rng.choice([0, 1, 4, 40])] = damage
    return bytes(content)


def broken_tables(rng: random.Random) -> Any:
    """The tables of a file after one to four accidents."""
    return spoiled(tomllib.loads(rng.choice(originals())), rng)


def spoiled(original: Any, rng: random.Random) -> Any:
    """Tables with entries replaced, renamed, removed and doubled."""
    tables = copy.deepcopy(original)
    for _ in range(rng.randint(1, 4)):
        places = list(_places(tables))
        if not places:
            return tables
        node, key = rng.choice(places)
        what = rng.randrange(6)
        if what == 0:
            del node[key]
        elif what == 1 and isinstance(node, dict):
            node[rng.choice(STRANGE)] = node.pop(key)
        elif what == 2 and isinstance(node, list):
            node.extend(copy.deepcopy([node[key]]) * rng.choice([1, 2, 50]))
        elif what == 3:
            node[key] = copy.deepcopy(rng.choice(places)[0])
        elif what == 4 and isinstance(node[key], int | float) and abs(node[key]) < 1e12:
            node[key] *= rng.choice([-1, 0, 1e-3, 1e3, 1e6, 1 + 1e-9])
        else:
            node[key] = hostile(rng)
    return tables


def hostile(rng: random.Random) -> Any:
    """A value that stands in no good file."""
    kind = rng.randrange(5)
    if kind == 0:
        return rng.choice(STRANGE)
    if kind == 1:
        return rng.choice([[], {}, [[]], [{}], {"kind": "plane"}, True, None, b"x", {1: 2}])
    if kind == 2:
        deep: Any = rng.choice(NUMBERS)
        for _ in range(rng.choice([2, 30, 100])):
            deep = [deep] if rng.random() < 0.5 else {rng.choice(STRANGE): deep}
        return deep
    if kind == 3:
        return [rng.choice(NUMBERS) for _ in range(rng.choice([1, 2, 3, 3, 3, 2000]))]
    return rng.choice(NUMBERS)


def _places(node: Any) -> Any:
    """(table or list, key) of every entry."""
    waiting = [node]
    while waiting:
        here = waiting.pop()
        keys = list(here) if isinstance(here, dict) else range(len(here))
        for key in keys:
            yield here, key
            if isinstance(here[key], dict | list):
                waiting.append(here[key])


def _number(text: str, rng: random.Random) -> str:
    new = rng.choice([*map(_written, NUMBERS), *LITERALS])
    return _replaced(text, r"-?\d+\.?\d*(e-?\d+)?", lambda _: new, rng)


def _written(number: Any) -> str:
    return str(number) if number != 10**4000 else "1" + "0" * 4000


def _word(text: str, rng: random.Random) -> str:
    def other(words: list[str]) -> str:
        return rng.choice([*STRANGE, f'"{rng.choice(STRANGE)}"', rng.choice(words)])

    return _replaced(text, "[A-Za-z_]+", other, rng)


def _replaced(text: str, pattern: str, new: Callable[[list[str]], str], rng: random.Random) -> str:
    """With one of the pattern's finds replaced."""
    found = list(re.finditer(pattern, text))
    if not found:
        return text
    match = rng.choice(found)
    return text[: match.start()] + new([one[0] for one in found]) + text[match.end() :]


def _lines(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    a, b = sorted(rng.randrange(len(lines) + 1) for _ in range(2))
    what = rng.randrange(4)
    if what == 0:
        del lines[a:b]
    elif what == 1:
        lines[a:a] = lines[a:b] * rng.choice([1, 1, 20])
    elif what == 2:
        lines.insert(a, rng.choice([*LITERALS, f"{rng.choice(STRANGE)} = 1", rng.choice(STRANGE)]))
    else:
        lines[a:b] = rng.sample(lines[a:b], b - a)
    return "\n".join(lines)


def _characters(text: str, rng: random.Random) -> str:
    at = rng.randrange(len(text) + 1)
    end = min(len(text), at + rng.choice([0, 1, 1, 30]))
    new = rng.choice([*STRANGE, chr(rng.randrange(0xD7FF)), "[", "]", "{", '"', "#", ".", ""])
    return text[:at] + new + text[end:]


def _end(text: str, rng: random.Random) -> str:
    return text[: rng.randrange(len(text) + 1)]


ACCIDENTS = (_number, _number, _number, _word, _word, _lines, _characters, _end)


def tried(seeds: range, attempt: Callable[[random.Random], object], quiet: bool = False) -> int:
    """How many seeds are taken for good files; the others' errors are ours, and in words.

    Both must occur among 500 seeds, else a fuzzer has stopped testing something.
    Args: attempt: False also says that a file is not good;
          quiet: libraries may warn; the library under test warns of what it says aloud.
    """
    good = 0
    for seed in seeds:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore" if quiet else "error")
            warnings.simplefilter("ignore", CondyleWarning)
            try:
                good += attempt(random.Random(seed)) is not False
            except CondyleError as error:
                readable(str(error), seed)
            except Exception as error:
                pytest.fail(f"seed {seed}: {type(error).__name__}: {str(error)[:300]}")
    assert good < len(seeds) and (good or len(seeds) < 500)
    return good


def readable(text: str, case: object = None) -> None:
    """Of a length and letters that a terminal can show."""
    assert 0 < len(text) < 4000 and text.replace("\n", "").isprintable(), (case, text)
