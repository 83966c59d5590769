"""condyle: dynamics of redundantly actuated parallel mechanisms held at point contacts.

mechanism = condyle.load_mechanism("masticatory")
model = condyle.derive(mechanism, formulation="momentum", route="core")
solution = model.solve(condyle.reference_motion(), condyle.reference_load())
"""

from importlib import import_module
from typing import Any

# The list of public names is `__init__.pyi`, which editors and type checkers read: a line is
# "from .room import name as name". Rooms open when they are entered.
with open(f"{__path__[0]}/__init__.pyi", encoding="utf-8") as _page:
    _lines = [line.split() for line in _page if line.startswith("from ")]
_ROOMS = {words[-1]: words[1] for words in _lines}

__all__ = [*_ROOMS]


def __getattr__(name: str) -> Any:
    if name in _ROOMS:
        return getattr(import_module(_ROOMS[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
