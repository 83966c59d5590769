"""Do the tests catch what breaks? Places drawn by a seed, each broken by itself.

    python tests/mutants.py draw FOLDER --count 60 --seed 1   # over rooms by their lines: patches
    python tests/mutants.py trace FOLDER --suite test         # which tests execute each place
    python tests/mutants.py run FOLDER --suite test           # is one of them red?

A place is a sign, an index, a comparison, a constant or a line that is skipped. Each is a patch, so
that the same places can be tried with other tests, in another tree, and others be added by hand:
FOLDER/NAME.patch. What a trace cannot see (C, JavaScript, templates, what runs at import) is tried
with the tests of its room.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "condyle"
COPIED = ("src", "tests", "docs", "examples", "benchmarks", "paper", "recipe", ".github", ".ci")
SIGNS = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"}
COMPARISONS = {
    ast.Lt: ">=", ast.LtE: ">", ast.Gt: "<=", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "==",
    ast.Is: "is not", ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in",
}  # fmt: skip
MOST = 300  # tests of a place
GREEN = {0: "SURVIVED", 5: "SURVIVED (no tests)"}  # statuses of pytest
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


def patch_of(mutant: Mutant) -> str:
    """As `patch -p1` takes it."""
    name = mutant.path.relative_to(ROOT).as_posix()
    old, new = mutant.path.read_text(encoding="utf-8"), mutant.applied()
    lines = difflib.unified_diff(
        old.splitlines(keepends=True), new.splitlines(keepends=True), f"a/{name}", f"b/{name}"
    )
    return f"{mutant}\n\n" + "".join(lines)


def copied(place: str) -> Path:
    """A copy of the tree."""
    copy = Path(place) / "tree"
    copy.mkdir()
    for name in COPIED:
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for path in ROOT.iterdir():
        if path.is_file():
            shutil.copy(path, copy)
    return copy


def applied(patch: Path, copy: Path) -> tuple[Path, int]:
    """Break the copy; returns the file and the line that changed.

    Raises: SystemExit: where the place is not there any more.
    """
    command = ["patch", "-p1", "--no-backup-if-mismatch", "-i", str(patch.absolute())]
    text = patch.read_text(encoding="utf-8")
    path = copy / text.split("\n+++ b/")[1].split("\n")[0].split("\t")[0]
    before = path.read_text(encoding="utf-8").splitlines()
    done = subprocess.run(command, cwd=copy, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{patch.name}: {done.stdout}")
    after = path.read_text(encoding="utf-8").splitlines()
    pairs = enumerate(zip(before, after, strict=False), 1)
    return path, next((i for i, (a, b) in pairs if a != b), len(before))


def probed(text: str, marks: dict[int, list[str]]) -> str:
    """A module that notes when it comes to the statements at some lines."""
    lines, tree = text.splitlines(keepends=True), ast.parse(text)
    places: dict[int, list[str]] = {}
    for line, names in marks.items():
        at = statement(tree, line, lines)
        if at is not None:
            places.setdefault(at, []).extend(names)
    for at in sorted(places, reverse=True):
        source = lines[at - 1]
        indent = source[: len(source) - len(source.lstrip())]
        lines.insert(at - 1, f'{indent}__import__("mutant_probe").hit({places[at]!r})\n')
    return "".join(lines)


def statement(tree: ast.Module, line: int, lines: list[str]) -> int | None:
    """Where the innermost statement of a function starts that has a line; None outside of any."""
    found = None
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        for node in ast.walk(function):
            if not isinstance(node, ast.stmt) or node is function:
                continue
            inside = node.lineno <= line <= (node.end_lineno or node.lineno)
            if inside and not lines[node.lineno - 1].lstrip().startswith(("elif", "@")):
                found = max(found or 0, node.lineno)
    return found


PROBE = """import os
SEEN = set()
def hit(names):
    test = os.environ.get("PYTEST_CURRENT_TEST", "").rsplit(" ", 1)[0]
    for name in names:
        if (name, test) not in SEEN:
            SEEN.add((name, test))
            with open(os.environ["MUTANT_HITS"], "a", encoding="utf-8") as file:
                file.write(f"{name}\\t{test}\\n")
"""


def trace(folder: Path, suite: str) -> None:
    """Run the suite once; which of its tests come to each place stands in FOLDER/SUITE.trace."""
    hits = (folder / f"{suite}.trace").absolute()
    hits.write_text("", encoding="utf-8")
    with tempfile.TemporaryDirectory(prefix="mutant-") as place:
        copy, clean = copied(place), {}
        marks: dict[Path, dict[int, list[str]]] = {}
        for patch in sorted(folder.glob("*.patch")):
            text = patch.read_text(encoding="utf-8")
            if ".py\n" not in text.split("\n+++ b/")[1][:200]:
                continue
            path, line = applied(patch, copy)
            original = ROOT / path.relative_to(copy)
            clean[path] = original.read_text(encoding="utf-8")
            path.write_text(clean[path], encoding="utf-8")
            marks.setdefault(path, {}).setdefault(line, []).append(patch.stem)
        for path, own in marks.items():
            path.write_text(probed(clean[path], own), encoding="utf-8")
        copy.with_name("mutant_probe.py").write_text(PROBE, encoding="utf-8")
        tested(copy, [*chosen(suite), "--numprocesses", "2", "--dist", "loadfile"], None, hits)


def chosen(suite: str) -> list[str]:
    return ["-m", "not ci"] if suite == "test" else []


def tested(
    copy: Path, arguments: list[str], limit: float | None, hits: Path | None = None
) -> tuple[int, str]:
    """The status of pytest on a copy, 124 where it takes longer, and what was red first."""
    path = os.pathsep.join([str(copy / "src"), str(copy.parent)])
    environment = {**os.environ, "PYTHONPATH": path, "MUTANT_HITS": str(hits)}
    kernels = environment.get("CONDYLE_TEST_KERNELS") or str(ROOT / "build" / "kernels")
    environment["CONDYLE_TEST_KERNELS"] = kernels
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments]
    output = copy.with_name("output")
    with (
        output.open("wb") as file,
        subprocess.Popen(
            command, cwd=copy, env=environment, start_new_session=True,
            stdout=None if limit is None else file, stderr=subprocess.STDOUT,
        ) as process,
    ):  # fmt: skip
        try:
            code = process.wait(limit)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return 124, ""
    lines = output.read_text(encoding="utf-8", errors="replace").splitlines()
    return code, next((x for x in lines if x.startswith(("FAILED", "ERROR"))), "")


def tests_of(name: str, path: str, traced: dict[str, list[str]]) -> list[list[str]]:
    """Tests that come to a place, its room's first; then all of its room and of their files.

    What a file sets up once, or a cache keeps, is traced to the first test that asked for it.
    """
    parts = Path(path).parts
    room = f"tests/{parts[2]}" if (ROOT / "tests" / parts[2]).is_dir() else "tests"
    known = [test for test in traced.get(name, []) if test]
    known.sort(key=lambda test: not test.startswith(f"{room}/"))
    files = dict.fromkeys(test.split("::")[0] for test in known)
    return [known[:MOST], [room, *(file for file in files if not file.startswith(f"{room}/"))]]


def tried(patch: Path, traced: dict[str, list[str]], suite: str, limit: float) -> str:
    """What became of the tests of a place."""
    start, code, red = time.monotonic(), 0, ""
    with tempfile.TemporaryDirectory(prefix="mutant-") as place:
        copy = copied(place)
        path, line = applied(patch, copy)
        where = path.relative_to(copy).as_posix()
        for tests in tests_of(patch.stem, where, traced):
            left = limit - (time.monotonic() - start)
            if tests and code in GREEN and left > 0:
                code, red = tested(copy, ["-x", *chosen(suite), "-n0", *tests], left)
    said = {**GREEN, 124: "SURVIVED (in time)"}.get(code, "caught")
    took = time.monotonic() - start
    return f"{said}\t{patch.stem}\t{where}:{line}\t{took:.0f} s\t{red[:160]}"


def run(folder: Path, suite: str, limit: float, jobs: int, only: str) -> bool:
    """Try patches of a folder; whether all are caught."""
    traced: dict[str, list[str]] = {}
    if (record := folder / f"{suite}.trace").is_file():
        for row in record.read_text(encoding="utf-8").splitlines():
            name, test = row.split("\t", 1)
            traced.setdefault(name, []).append(test)
    patches = sorted(folder.glob(f"{only}.patch"))
    results = []
    with ThreadPoolExecutor(jobs) as pool:
        for said in pool.map(lambda p: tried(p, traced, suite, limit), patches):
            print(said, flush=True)
            results.append(said.startswith("caught"))
    print(f"{sum(results)} of {len(results)} caught")
    return all(results)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("draw", "trace", "run"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--suite", choices=("test", "all"), default="all", help="test: without ci")
    parser.add_argument("--limit", type=float, default=60.0, help="seconds for a place's tests")
    parser.add_argument("--only", default="*", help="patches whose names match, as h*")
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    if asked.what == "draw":
        asked.folder.mkdir(parents=True, exist_ok=True)
        for i, mutant in enumerate(drawn(asked.count, asked.seed), 1):
            print(i, mutant)
            target = asked.folder / f"{i:03}.patch"
            target.write_text(patch_of(mutant), encoding="utf-8")
    elif asked.what == "trace":
        trace(asked.folder, asked.suite)
    else:
        return not run(asked.folder, asked.suite, asked.limit, asked.jobs, asked.only)
    return 0


if __name__ == "__main__":
    sys.exit(main())
