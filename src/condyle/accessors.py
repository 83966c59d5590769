"""What later rooms add to earlier ones, by name: the earlier know no more than the name.

`model.solve` belongs to the results, `.condyle.plot` to the figures and `print(comparison)` to the
tables. Each is declared as the place of a function, "module:name", in the package's `__init__`, and
imported when it is used:

register("solution.plot", "condyle.report.figures:solution_plots")
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from .errors import UnsupportedError

_places: dict[str, str] = {}


def register(name: str, place: str) -> None:
    """Let `name` be what stands at `place`, "module:attribute"; nothing is imported yet."""
    _places[name] = place


def extend(name: str, *arguments: Any) -> Any:
    """What is registered as `name`, called with its owner and other arguments.

    Raises: UnsupportedError: if nothing is registered so.
    """
    if name not in _places:
        raise UnsupportedError(
            f"nothing is registered as {name}; known: {', '.join(sorted(_places)) or 'nothing'}. "
            "Import condyle, which registers its own, or call condyle.accessors.register"
        )
    module, _, attribute = _places[name].partition(":")
    return getattr(import_module(module), attribute)(*arguments)
