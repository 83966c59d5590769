"""JSON schemas of the files that people write."""

from __future__ import annotations

from typing import Any

from ..errors import InputError, did_you_mean

KINDS = ("mechanism", "scenario", "study")


def schema(of: str = "mechanism") -> dict[str, Any]:
    """The JSON schema of mechanism, scenario or study files, for editors.

    Raises: InputError: for another kind of file.
    """
    if of == "mechanism":
        from ..mechanism import json_schema as made
    elif of == "scenario":
        from ..simulation import scenario_schema as made
    elif of == "study":
        from .sweep import json_schema as made
    else:
        raise InputError(f'schema: no kind of file "{of}".{did_you_mean(of, KINDS)}')
    return made()
