"""The index of the paper's equations: what a row names is a link to its source, and to its API.

The page names code in full, which a test holds against the package; here each name becomes short
and leads to the page of sources, which is written from the code itself.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from pathlib import Path
from textwrap import dedent
from types import ModuleType
from typing import Any

DOCS = Path(__file__).parent
INDEX, SOURCES, FILE = "theory/equations.md", "code.md", "equation-code.md"
NAME = re.compile(r"`(condyle\.[\w.]+)`")
IDENTIFIER = re.compile(r"^::: (condyle[\w.]+)$", re.MULTILINE)


def names() -> list[str]:
    """What the index names, each once."""
    text = (DOCS / INDEX).read_text(encoding="utf-8")
    return list(dict.fromkeys(NAME.findall(text)))


def with_links(markdown: str, page: str) -> str:
    """The index with a link to the source of each name, and to the API of those in it."""
    if page != INDEX:
        return markdown
    api = IDENTIFIER.findall((DOCS / "reference/api.md").read_text(encoding="utf-8"))

    def link(match: re.Match[str]) -> str:
        name = match[1]
        short = re.sub(r"^.*\.(?=\w+\.\w+$)", "", name)
        described = max((one for one in api if f"{name}.".startswith(f"{one}.")), default="")
        more = f" ([API](../reference/api.md#{described}))" if described else ""
        return f'[`{short}`]({SOURCES}#{name} "{name}"){more}'

    return NAME.sub(link, markdown)


def with_frame(html: str, page: str) -> str:
    """The index in an element of its own, whose rows a narrow screen shows as cards."""
    return f'<div class="equations">{html}</div>' if page == INDEX else html


def sources() -> str:
    """The page of sources: each name with its file and its text."""
    parts = []
    for name in names():
        module, text = source(name)
        path = Path(str(module.__file__)).relative_to(DOCS.parent / "src")
        parts.append(f"## {name} {{ #{name} }}\n\n`{path}`\n\n```python\n{text}\n```\n")
    return "\n".join(parts)


def source(name: str) -> tuple[ModuleType, str]:
    """Where a dotted name is defined, and the text of its definition; of a module its docstring.

    Raises: LookupError: if there is no such name.
    """
    parts = name.split(".")
    count = next(i for i in range(len(parts), 0, -1) if _module(parts[:i]))
    thing: Any = importlib.import_module(".".join(parts[:count]))
    if count == len(parts):
        return thing, f'"""{inspect.getdoc(thing)}\n"""'
    for part in parts[count:]:
        read = getattr if isinstance(thing, ModuleType) else inspect.getattr_static
        found = read(thing, part, None)
        if found is None:  # a field without a default: its class shows it
            break
        if not _has_source(found):
            return _assigned(thing, part)
        thing = getattr(thing, part)
        thing = found if isinstance(found, property) else thing
    thing = thing.fget if isinstance(thing, property) else thing
    module = inspect.getmodule(thing)
    assert module is not None
    return module, dedent(inspect.getsource(thing)).rstrip()


def _module(parts: list[str]) -> bool:
    try:
        importlib.import_module(".".join(parts))
    except ModuleNotFoundError:
        return False
    return True


def _has_source(thing: Any) -> bool:
    kinds = property, staticmethod, classmethod
    return inspect.isclass(thing) or inspect.isroutine(thing) or isinstance(thing, kinds)


def _assigned(owner: Any, name: str) -> tuple[ModuleType, str]:
    """The assignment of a module's constant, or the class of a field."""
    module = owner if isinstance(owner, ModuleType) else inspect.getmodule(owner)
    assert module is not None
    if owner is not module:
        return module, inspect.getsource(owner)
    text = inspect.getsource(module)
    for node in ast.parse(text).body:
        stored = (one for one in ast.walk(node) if isinstance(getattr(one, "ctx", None), ast.Store))
        assigns = isinstance(node, ast.Assign | ast.AnnAssign)
        if assigns and name in {getattr(one, "id", "") for one in stored}:
            return module, ast.get_source_segment(text, node) or ""
        if isinstance(node, ast.ImportFrom) and name in {one.name for one in node.names}:
            path = "." * node.level + (node.module or "")
            return _assigned(importlib.import_module(path, module.__package__), name)
    raise LookupError(f"{module.__name__} has no {name}")
