"""The house as a whole: what files import, what they are called, what lies in the root."""

from __future__ import annotations

import ast
import subprocess
import tomllib
from collections import Counter
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src"
FILES = {
    ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__"): path
    for path in SOURCE.rglob("*.py")
}
# A command is called as what it calls; a question as the mechanics that it asks about.
NAMED_AFTER_OTHERS = ("cli", "questions")
# Documents and configuration.
IN_THE_ROOT = {
    *(".gitignore", ".pre-commit-config.yaml", "Makefile", "mkdocs.yml", "pyproject.toml"),
    *("CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE", "README.md"),
    *(".zenodo.json", "CODE_OF_CONDUCT.md", "SUPPORT.md"),
}
# Participles and pronouns say no thing.
NO_NAMES = {
    *("Along", "Asked", "Beside", "Each", "Ended", "Few", "Found", "Kept", "Lead", "Lent", "Look"),
    *("Lost", "Many", "Mine", "Moment", "One", "Ours", "Placed", "Said", "Shown", "Stuck", "Told"),
    *("Under", "Way", "Whole"),
}

# A docstring begins with what a thing is, or does.
NO_BEGINNINGS = {
    *("Along", "At", "Around", "Beside", "By", "From", "In", "Of", "On", "That", "Those", "To"),
    *("Under", "Whose", "With", "Within"),
}


def imports(name: str, path: Path) -> Iterator[str]:
    """Files of the package that a file imports, for types too."""
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names if one.name in FILES)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: 1 - node.level or None] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            found = {f"{base}.{one.name}" for one in node.names}
            yield from found & FILES.keys() or {base} & FILES.keys()


def test_no_circle_of_files() -> None:
    """But by the doors that the list of rooms names, which open as methods are called."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    (rooms,) = tomllib.loads(text)["tool"]["importlinter"]["contracts"]
    graph = {name: set(imports(name, path)) - {name} for name, path in FILES.items()}
    for door in rooms["ignore_imports"]:
        below, above = door.split(" -> ")
        graph[below].remove(above)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_imports_are_relative() -> None:
    """`import condyle` stands in commands, which call what a person calls."""
    absolute = {
        name
        for name, path in FILES.items()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and not node.level
        if (node.module or "").split(".")[0] == "condyle"
    }
    assert not absolute


def test_one_name_one_file() -> None:
    paths = [
        path.relative_to(SOURCE / "condyle")
        for suffix in ("py", "c", "h", "js", "css")
        for path in SOURCE.rglob(f"*.{suffix}")
        if path.name != "__init__.py"
    ]
    names = Counter(path.name for path in paths if path.parts[0] not in NAMED_AFTER_OTHERS)
    assert [name for name, count in names.items() if count > 1] == []


def test_a_class_has_a_name_of_its_own() -> None:
    names = Counter(
        node.name
        for path in FILES.values()
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    assert [n for n, count in names.items() if count > 1 or n in NO_NAMES] == []


def test_docstrings_begin_with_what_a_thing_is() -> None:
    kinds = (ast.FunctionDef, ast.ClassDef)
    fragments = [
        f"{name}.{node.name}: {text.partition(chr(10))[0]}"
        for name, path in FILES.items()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, kinds) and (text := ast.get_docstring(node) or "")
        if text.split()[0] in NO_BEGINNINGS
    ]
    assert not fragments


def git(*words: str) -> list[str]:
    """Lines of git's answer about the checkout; none where a search finds nothing."""
    try:
        inside = subprocess.run(["git", "rev-parse"], cwd=ROOT, capture_output=True)
    except FileNotFoundError:
        pytest.skip("git is not installed")
    if inside.returncode:
        pytest.skip("not a checkout")
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True).stdout.split()


def test_no_file_names_a_package_host() -> None:
    hosts = r"pythonhoste[d]|pypi\.or[g]|npmjs\.or[g]|debian\.org/debia[n]|anaconda\.or[g]"
    assert not git("grep", "-lE", hosts)


def test_the_root_holds_documents_and_configuration() -> None:
    assert set(git("ls-files", "--", ":(glob)*")) <= IN_THE_ROOT
