"""condyle literature: published numbers of the jaw beside the model's own."""

from __future__ import annotations

from .answer import Answer, command_line
from .command import COMPUTE, command


@command(COMPUTE, example="condyle literature")
def literature() -> Answer:
    """Published numbers of the human jaw beside those of the bundled jaws, with sources.

    Largest bites, joint loads of static bites and of chewing, what a bite that is let go does, the
    condyles' paths. Ratios and directions: nobody has measured a force on a human condyle.
    """
    import condyle

    found = condyle.literature()
    then = command_line("bite", "human-jaw")
    return Answer(str(found), found.data, then, "result")
