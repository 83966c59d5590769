"""condyle schema: the file format for editors."""

from __future__ import annotations

from .app import MAKE, app
from .inputs import say_json


@app.command(rich_help_panel=MAKE)
def schema() -> None:
    """Print the JSON schema of mechanism files."""
    from ..mechanism import json_schema

    say_json(json_schema())
