"""condyle bench: how fast, beside other engines."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from .answer import Answer, files_line
from .command import UPKEEP, command
from .inputs import output_folder


@command(UPKEEP, example="condyle bench --seconds 0.2 --out bench.json")
def bench(
    out: Annotated[Path | None, typer.Option(help="JSON file for the results.")] = None,
    seconds: Annotated[
        float, typer.Option(help="How long each row of the table is timed (s).", min=0.01, max=600)
    ] = 1.0,
    realtime: Annotated[
        bool,
        typer.Option(
            "--realtime",
            help="Instead: exported C in a loop of 1, 5, 10 and 20 kHz, beside an empty one: how "
            "late ticks are, the longest, and those missed.",
        ),
    ] = False,
) -> Answer:
    """How fast it is on this machine.

    One table: every way to compute, on one core. From the repository other engines are timed too.
    """
    from ..atomic import replacing
    from ..bench import real_time, run_benchmark
    from ..mechanism import load

    with ExitStack() as stack:  # a file that cannot be written is found before the minutes pass
        if out is not None:
            output_folder(out.parent)
            temporary = stack.enter_context(replacing(out))
        result = real_time(load("masticatory"), seconds) if realtime else run_benchmark(seconds)
        if out is not None:
            temporary.write_text(json.dumps(result.data(), indent=1), encoding="utf-8")
    files = [out] if out else []
    text = f"{result}\n{files_line(files)}" if out else str(result)
    return Answer(text, result.data() | {"files": files}, "condyle cache", "result")
