"""The walks through a call and a simulation: their lines are those of the sources.

Where sources have moved the lines, and nothing else, rewrite them with

    WRITE_WALK=1 python -m pytest tests/docs/test_walk.py
"""

from __future__ import annotations

import ast
import os
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle

PAGE = Path(__file__).parents[2] / "docs" / "theory" / "questions.md"
SOURCES = Path(condyle.__file__).parent
PLACE = re.compile(r"`([\w.]+)`(\s+\(`)([\w/]+\.(?:py|c)):(\d+)`\)")
MOST = 7  # files of a warm call of many states


def lines(file: str) -> dict[str, int]:
    """Where functions and classes are defined, by qualified name."""
    text = (SOURCES / file).read_text(encoding="utf-8")
    if file.endswith(".c"):
        found = re.finditer(r"^(?!static)\w+ (\w+)\(.*\)\n\{", text, re.MULTILINE)
        return {m[1]: text.count("\n", 0, m.start()) + 1 for m in found}

    def within(node: ast.AST, prefix: str) -> dict[str, int]:
        own: dict[str, int] = {}
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.FunctionDef | ast.ClassDef):
                own[prefix + child.name] = child.lineno
                own |= within(child, f"{prefix}{child.name}.")
        return own

    return within(ast.parse(text), "")


def test_lines() -> None:
    text = PAGE.read_text(encoding="utf-8")

    def placed(m: re.Match[str]) -> str:
        name, between, file, _ = m.groups()
        known = lines(file)
        assert name in known, f"{file} defines no {name}"
        return f"`{name}`{between}{file}:{known[name]}`)"

    right, count = PLACE.subn(placed, text)
    assert count > 30 and count == len(re.findall(r"\.(?:py|c):\d", text))
    if "WRITE_WALK" in os.environ:
        PAGE.write_text(right, encoding="utf-8")
        return
    moved = [
        new for old, new in zip(text.splitlines(), right.splitlines(), strict=True) if old != new
    ]
    assert not moved, "WRITE_WALK=1 puts right:\n" + "\n".join(moved)


@pytest.mark.usefixtures("compiler_command")
def test_files_of_a_call() -> None:
    """A call whose kernel is there enters few files, and the walk names each."""
    model = condyle.derive("masticatory", backend="compiled")
    states = np.random.default_rng(0).normal(scale=1e-3, size=(3, 100, 4))
    assert not model.inverse_dynamics(*states).status.any()
    entered = set[str]()

    def note(frame: Any, event: str, _: Any) -> None:
        path = Path(frame.f_code.co_filename)
        if event == "call" and path.is_relative_to(SOURCES):
            entered.add(path.relative_to(SOURCES).as_posix())

    sys.setprofile(note)
    try:
        model.inverse_dynamics(*states)
    finally:
        sys.setprofile(None)
    walk = PAGE.read_text(encoding="utf-8").split("## A call, file by file")[1].split("\n## ")[0]
    assert entered <= {m[3] for m in PLACE.finditer(walk)}
    assert 0 < len(entered) <= MOST, sorted(entered)
