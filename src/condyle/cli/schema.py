"""condyle schema: the file format for editors."""

from __future__ import annotations

import json
from enum import StrEnum
from typing import Annotated

import typer

from .answer import Answer
from .command import UPKEEP, command


class Format(StrEnum):
    """Files that have a schema."""

    mechanism = "mechanism"
    scenario = "scenario"
    study = "study"


@command(UPKEEP, example="condyle schema > condyle.schema.json")
def schema(
    of: Annotated[Format, typer.Argument(help="Kind of file.")] = (Format.mechanism),
) -> Answer:
    """JSON schema of mechanism, scenario or study files, for editors.

    An editor that has it completes keys and marks mistakes while you type.
    """
    if of is Format.study:
        from ..analysis.sweep import json_schema
    elif of is Format.scenario:
        from ..simulation import scenario_schema as json_schema
    else:
        from ..mechanism import json_schema

    data = json_schema()
    return Answer(json.dumps(data, indent=2), data, "condyle check masticatory", "document")
