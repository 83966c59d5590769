"""Pictures that pages show and their own code makes: the page's blocks run when the site is built.

A page that has `....savefig("NAME.png")` in a Python block and shows `generated/NAME.png` gets what
that block drew, so a reader who copies the block sees the picture of the page.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path

DOCS = Path(__file__).parent
BLOCK = re.compile(r"^```python[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
SAVED = re.compile(r'\.savefig\("([\w-]+\.png)"')
NOT_RUN = "<!-- not run:"


def python_blocks(text: str) -> Iterator[tuple[int, str]]:
    """Line and code of each block of a page that is run."""
    for match in BLOCK.finditer(text):
        before = text[: match.start()].rstrip().rpartition("\n")[2]
        if not before.startswith(NOT_RUN):
            yield text.count("\n", 0, match.start()) + 2, match[1]


def drawn_by(text: str) -> list[str]:
    """Names of the pictures that a page's code saves and the page shows."""
    saved = (name for _, code in python_blocks(text) for name in SAVED.findall(code))
    return [name for name in saved if f"generated/{name})" in text]


def pages_with_pictures() -> dict[Path, list[str]]:
    pages = (page for page in sorted(DOCS.rglob("*.md")) if "generated" not in page.parts)
    found = {page: drawn_by(page.read_text(encoding="utf-8")) for page in pages}
    return {page: names for page, names in found.items() if names}


def draw_pages(folder: Path) -> None:
    """Run each such page in an empty folder, up to its last picture, and keep its pictures."""
    for page, names in pages_with_pictures().items():
        missing, namespace = set(names), {"__name__": "page"}
        with tempfile.TemporaryDirectory() as place, chdir(place), redirect_stdout(StringIO()):
            for line, code in python_blocks(page.read_text(encoding="utf-8")):
                exec(compile("\n" * (line - 1) + code, str(page), "exec"), namespace)
                missing -= {*SAVED.findall(code)}
                if not missing:
                    break
            for name in names:
                shutil.move(name, folder / name)
