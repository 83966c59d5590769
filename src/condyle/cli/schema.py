"""condyle schema: the file format for editors."""

from __future__ import annotations

import json

from .answer import Answer
from .command import UPKEEP, command


@command(UPKEEP, example="condyle schema > condyle.schema.json")
def schema() -> Answer:
    """The format of mechanism files, for editors.

    A JSON schema: an editor that knows it completes keys and marks mistakes while you type.
    """
    from ..mechanism import json_schema

    data = json_schema()
    return Answer(json.dumps(data, indent=2), data, "condyle check masticatory", "document")
