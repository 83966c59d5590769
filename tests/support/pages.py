"""Parts of one's own, as the pages of the documentation write them."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import ModuleType

DOCS = Path(__file__).parents[2] / "docs"
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


def module_of(page: str, name: str) -> ModuleType:
    """A module of the block of a page that defines a class; running it registers the class."""
    text = (DOCS / page).read_text(encoding="utf-8")
    (block,) = (b for b in BLOCK.findall(text) if f"class {name}(" in b)
    module = ModuleType(f"own_{name.lower()}")
    sys.modules[module.__name__] = module  # where dataclasses and pydantic look for names
    exec(compile(block, str(DOCS / page), "exec", dont_inherit=True), vars(module))
    return module
