"""condyle bite: the largest bite within all limits."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ..errors import InputError, shown
from . import options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command


@command(COMPUTE, example="condyle bite human-jaw --point right_molar --over opening=0:40:9")
def bite(
    mechanism: options.Mechanism = "human-jaw",
    point: str = "right_molar",
    direction: Annotated[list[str] | None, options.option()] = None,
    over: str | None = None,
    out: Path | None = None,
) -> Answer:
    """The largest bite: what muscles within their limits can press at a point, at rest.

    With gravity, and unilateral contacts pushing; says which limits hold it, and the loads of the
    joints. One linear program per pose and direction.

    Options:
        point: Platform point that bites.
        direction: Direction of the force on the platform in {S}, "0,0,-1" (default: food pushes a
            jaw down); repeat it for an envelope.
        over: Poses: "opening=0:40:9" (mm: the incisor goes down by so much, and back by 0.29 of
            it), or a coordinate, "beta=0:20:9 deg". Default: home.
        out: Also write a table (.csv or .parquet), a pose and direction per row.
    """
    import condyle

    given = [_vector(text) for text in direction or ()] or (0.0, 0.0, -1.0)
    found = condyle.largest_bite(mechanism, point, given, over)
    text, files = str(found), list[Path]()
    if out is not None:
        found.save(out)
        files.append(out)
        text += f"\n{files_line(files)}"
    data = {**found.data, "files": list(map(str, files))}
    then = command_line("check", mechanism)
    return Answer(text, data, then, "summary" if files else "result")


def _vector(text: str) -> list[float]:
    try:
        return [float(x) for x in text.split(",")]
    except ValueError:
        raise InputError(f'direction: expected "x,y,z", got {shown(text)}') from None
