"""JSON schemas of the files that people write."""

from __future__ import annotations

from typing import Any

from ..errors import InputError, did_you_mean, shown

KINDS = ("mechanism", "scenario", "session", "study")


def schema(of: str = "mechanism") -> dict[str, Any]:
    """The JSON schema of mechanism, scenario, session or study files, for editors.

    Raises: InputError: for another kind of file.
    """
    if not isinstance(of, str) or of not in KINDS:
        raise InputError(f"of: expected a kind of file, got {shown(of)}.{did_you_mean(of, KINDS)}")
    if of == "mechanism":
        from ..mechanism import json_schema as made
    elif of == "scenario":
        from ..simulation import scenario_schema as made
    elif of == "session":
        from ..markers.session_file import json_schema as made
    else:
        from .sweep import json_schema as made
    return made()
