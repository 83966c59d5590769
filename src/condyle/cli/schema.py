"""condyle schema: the file formats for editors."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from .answer import Answer
from .command import UPKEEP, command
from .completion import one_of


@command(UPKEEP, example="condyle schema > condyle.schema.json")
def schema(
    of: Annotated[
        str,
        typer.Argument(
            help="Kind of file: mechanism, scenario or study.",
            autocompletion=one_of("mechanism", "scenario", "study"),
        ),
    ] = "mechanism",
) -> Answer:
    """JSON schema of mechanism, scenario or study files, for editors.

    An editor that has it completes keys and marks mistakes while you type.
    """
    import condyle

    data = condyle.schema(of)
    return Answer(json.dumps(data, indent=2), data, "condyle check masticatory", "document")
