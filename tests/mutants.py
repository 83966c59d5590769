"""Do the tests catch what breaks? Places drawn by a seed, each broken by itself.

    python tests/mutants.py --count 60 --seed 1          # over rooms in proportion to their lines
    python tests/mutants.py --count 60 --seed 1 --list   # what would be broken, and how

A place is a sign, an index, a comparison, a constant or a line that is skipped. Each is tried in a
copy of the tree, against the tests of its room and then of the rooms that import it.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "condyle"
COPIED = ("src", "tests", "docs", "examples", "benchmarks")
SIGNS = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"}
COMPARISONS = {
    ast.Lt: ">=", ast.LtE: ">", ast.Gt: "<=", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "==",
    ast.Is: "is not", ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in",
}  # fmt: skip
SKIPPED = (ast.Assign, ast.AugAssign, ast.Expr, ast.Raise, ast.Delete)


@dataclass(frozen=True)
class Mutant:
    """One place and what stands there instead."""

    path: Path
    line: int
    kind: str
    before: str
    after: str
    start: int
    end: int

    @property
    def room(self) -> str:
        return self.path.relative_to(SOURCE).parts[0].removesuffix(".py")

    def __str__(self) -> str:
        before, after = (" ".join(text.split())[:60] for text in (self.before, self.after))
        return f"{self.path.relative_to(ROOT)}:{self.line} {self.kind}: {before} -> {after}"

    def applied(self) -> str:
        text = self.path.read_text(encoding="utf-8")
        return text[: self.start] + self.after + text[self.end :]


def mutants(path: Path) -> list[Mutant]:
    """Every place of a file that can be broken."""
    text = path.read_text(encoding="utf-8")
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    lines = text.splitlines()

    def offset(line: int, column: int) -> int:
        return starts[line - 1] + len(lines[line - 1].encode()[:column].decode())

    found = []
    for node, kind, after in _changes(ast.parse(text)):
        start = offset(node.lineno, node.col_offset)
        end = offset(node.end_lineno or node.lineno, node.end_col_offset or 0)
        found.append(Mutant(path, node.lineno, kind, text[start:end], after, start, end))
    return found


def _changes(tree: ast.AST) -> Iterator[tuple[ast.expr | ast.stmt, str, str]]:
    """Nodes, what is changed in each, and its new text; annotations and docstrings left out."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Assert | ast.JoinedStr) or _for_readers(node):
            continue
        if isinstance(node, SKIPPED) and not _is_text(node):
            yield node, "skipped", "pass"
        if isinstance(node, ast.BinOp) and type(node.op) in SIGNS and not _of_text(node):
            left, right = ast.unparse(node.left), ast.unparse(node.right)
            yield node, "sign", f"(({left}) {SIGNS[type(node.op)]} ({right}))"
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
            yield node, "sign", f"({ast.unparse(node.operand)})"
        elif isinstance(node, ast.Compare) and len(node.ops) == 1:
            left, right = ast.unparse(node.left), ast.unparse(node.comparators[0])
            yield node, "comparison", f"(({left}) {COMPARISONS[type(node.ops[0])]} ({right}))"
        elif isinstance(node, ast.Constant) and type(node.value) in (bool, int, float):
            new = not node.value if isinstance(node.value, bool) else node.value + 1
            yield node, "constant", repr(new)
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
            base, i = ast.unparse(node.value), node.slice.value
            if isinstance(i, int):
                yield node, "index", f"{base}[{i + 1}]"
        for name in ("annotation", "returns"):
            if getattr(node, name, None) is not None:
                setattr(node, name, None)
        yield from _changes(node)


def _for_readers(node: ast.AST) -> bool:
    """Imports for type checkers, and `__all__`."""
    if isinstance(node, ast.If):
        return "TYPE_CHECKING" in ast.dump(node.test)
    return isinstance(node, ast.Assign) and "__all__" in ast.dump(node.targets[0])


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _of_text(node: ast.BinOp) -> bool:
    sides = (node.left, node.right)
    texts = (isinstance(side, ast.Constant) and isinstance(side.value, str) for side in sides)
    return any(texts) or any(isinstance(side, ast.JoinedStr) for side in sides)


def drawn(count: int, seed: int) -> list[Mutant]:
    """Mutants, drawn over files, and so over rooms, in proportion to their lines."""
    rng = random.Random(seed)
    files = sorted(SOURCE.rglob("*.py"))
    places = {path: mutants(path) for path in files}
    files = [path for path in files if places[path]]
    lines = [len(path.read_text(encoding="utf-8").splitlines()) for path in files]
    return [rng.choice(places[path]) for path in rng.choices(files, lines, k=count)]


def importers() -> dict[str, set[str]]:
    """For each room, the rooms that import it."""
    found: dict[str, set[str]] = {}
    for path in SOURCE.rglob("*.py"):
        parts = path.relative_to(SOURCE).parts
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.level == len(parts):
                for name in [node.module] if node.module else [a.name for a in node.names]:
                    room = str(name).split(".")[0]
                    found.setdefault(room, set()).add(parts[0].removesuffix(".py"))
    return found


def tests_of(room: str) -> list[str]:
    folder = ROOT / "tests" / room
    return [f"tests/{room}"] if folder.is_dir() else []


def caught(mutant: Mutant, users: set[str], limit: float) -> str:
    """By which tests; empty where none fails."""
    with tempfile.TemporaryDirectory(prefix="mutant-") as place:
        copy = Path(place) / "tree"
        copy.mkdir()
        for name in COPIED:
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
        for path in ROOT.iterdir():
            if path.is_file():
                shutil.copy(path, copy)
        (copy / mutant.path.relative_to(ROOT)).write_text(mutant.applied(), encoding="utf-8")
        environment = {**os.environ, "PYTHONPATH": str(copy / "src"), "CONDYLE_BROWSER": "off"}
        own = tests_of(mutant.room)
        others = sorted(t for user in users - {mutant.room} for t in tests_of(user))
        for tests in ([t] for t in own + others):
            command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
            try:
                code = subprocess.run(
                    [*command, "--numprocesses", "2", *tests],
                    cwd=copy, env=environment, timeout=limit, capture_output=True, check=False,
                ).returncode  # fmt: skip
            except subprocess.TimeoutExpired:
                return f"{tests[0]} (no end)"
            if code not in (0, 5):
                return tests[0]
    return ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=float, default=900.0, help="seconds for a room's tests")
    parser.add_argument("--list", action="store_true", help="only say what would be broken")
    asked = parser.parse_args()
    users, survived = importers(), []
    for i, mutant in enumerate(drawn(asked.count, asked.seed), 1):
        if asked.list:
            print(i, mutant)
            continue
        start = time.monotonic()
        by = caught(mutant, users.get(mutant.room, set()), asked.limit)
        took = f"{i:3} {time.monotonic() - start:4.0f} s"
        print(f"{took}  {'caught by ' + by if by else 'SURVIVED'}  {mutant}", flush=True)
        survived += [mutant] if not by else []
    if not asked.list:
        print(f"{asked.count - len(survived)} of {asked.count} caught")
    return bool(survived)


if __name__ == "__main__":
    sys.exit(main())
