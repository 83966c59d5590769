"""condyle schema: the file format for editors."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from .answer import Answer
from .command import UPKEEP, command


@command(UPKEEP, example="condyle schema > condyle.schema.json")
def schema(
    scenario: Annotated[
        bool, typer.Option("--scenario", help="Of scenarios of condyle simulate.")
    ] = False,
) -> Answer:
    """The format of mechanism files, for editors.

    A JSON schema: an editor that knows it completes keys and marks mistakes while you type.
    """
    from ..mechanism import json_schema

    if scenario:
        from ..simulation import scenario_schema

        data = scenario_schema()
    else:
        data = json_schema()
    return Answer(json.dumps(data, indent=2), data, "condyle check masticatory", "document")
