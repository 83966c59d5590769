"""condyle reference: the bundled motion and load as files."""

from __future__ import annotations

from pathlib import Path

from .answer import Answer, command_line
from .command import START, command
from .inputs import output_folder


@command(START, example="condyle reference --out case")
def reference(
    out: Path = Path(),
) -> Answer:
    """Write the bundled motion and bite force as files.

    Examples of the tables that condyle run reads. Both are synthetic, not measured.

    Options:
        out: Folder for the files.
    """
    import condyle

    motion, load = condyle.write_reference(output_folder(out))
    return Answer(
        f"Wrote {motion}\nWrote {load}",
        {"files": [motion, load]},
        command_line("run", motion=motion, load=load),
    )
