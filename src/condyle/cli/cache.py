"""condyle cache: compiled kernels on disk."""

from __future__ import annotations

from .answer import Answer
from .command import UPKEEP, command


@command(UPKEEP, example="condyle cache --clear")
def cache(
    clear: bool = False,
) -> Answer:
    """Show or clear the compiled kernels on disk.

    A kernel is compiled when it is first needed, in a second or two, and then reused.

    Options:
        clear: Remove all kernels.
    """
    from ..backends import cache as kernels

    had = kernels.clear() if clear else kernels.contents()
    count = "1 kernel" if had.kernels == 1 else f"{had.kernels} kernels"
    what = f"{count}, {had.size / 1e6:.1f} MB"
    return Answer(
        f"Removed {what} from {had.folder}" if clear else f"{had.folder}: {what}",
        {"folder": had.folder, "kernels": had.kernels, "bytes": had.size, "cleared": clear},
        "condyle cache --clear" if had.size and not clear else "condyle run",
        "result",
    )
