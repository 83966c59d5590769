"""What docstrings say of arguments, and functions of the library read without importing them."""

from __future__ import annotations

import ast
import inspect
import re
from collections import defaultdict
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any


@cache
def function_of(place: Any) -> Any:
    """A function of the library, "room.file:name", with signature and docstring but no body.

    Its module is not imported: that takes half a second, and pages of help are there at once.
    A function stands for itself.
    """
    if callable(place):
        return place
    module, _, name = place.partition(":")
    source = files("condyle").joinpath(f"{module.replace('.', '/')}.py").read_text("utf-8")
    module_lines = ast.parse(source).body
    found = [n for n in module_lines if isinstance(n, ast.FunctionDef) and n.name == name]
    head = found[-1]  # after its overloads
    head.body, head.decorator_list = head.body[:1], []
    made: dict[str, Any] = defaultdict(lambda: inspect.Parameter.empty)  # constants of its module
    code = ast.Module([head], [])
    exec(compile(code, place, "exec", annotations.compiler_flag), {}, made)
    return made[name]


def parts(function: Any) -> tuple[str, dict[str, str]]:
    """The text of a docstring, a paragraph a line, and what its "Args:" say of each argument."""
    text, _, rest = f"\n{inspect.cleandoc(function.__doc__ or '')}".partition("\nArgs:")
    section = re.split(r"\n(?:Raises|Returns):", rest)[0]
    words = re.split(r"(?:^|\n|;? {2}) *((?:[a-z]\w*, )*[a-z]\w*):\s", section)
    helps = {
        name: " ".join(said.split())
        for names, said in zip(words[1::2], words[2::2], strict=True)
        for name in names.split(", ")
    }
    paragraphs = [part for part in text.strip("\n").split("\n\n") if not part.startswith(" ")]
    return "\n\n".join(" ".join(part.split()) for part in paragraphs), helps


def sentence(text: str, names: list[str]) -> str:
    """As help has it: with a capital, unless it begins with a name."""
    text = f"{text.rstrip(';.')}."
    return text if re.split(r"\W", text)[0] in names else text[:1].upper() + text[1:]


def kind_of(annotation: Any) -> Any:
    """What one word of a command line is, for an argument of the library with this annotation."""
    if not isinstance(annotation, str):
        annotation = inspect.formatannotation(annotation)
    if re.search(r"(Sequence|list)\[str\]", annotation):
        return list[str] | None
    if re.fullmatch(r"Literal\[[\d, ]+\]", annotation):
        return int
    words = re.findall(r"\w+", re.sub(r"\[.*?\]", "", annotation))
    kinds = {"PathLike": Path, "Path": Path, "bool": bool, "str": str, "int": int, "float": float}
    kind: Any = next((kinds[name] for name in kinds if name in words), str)
    return kind | None if "None" in words else kind
