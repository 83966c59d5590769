"""condyle cite: references for a paper."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .answer import Answer, command_line
from .command import MAINTENANCE, command


@command(MAINTENANCE, example="condyle cite results/masticatory.nc > used.bib")
def cite(
    solution: Annotated[Path | None, typer.Argument(help="Solution (.nc).")] = None,
) -> Answer:
    """BibTeX entries of the method, the program and the solvers.

    Of a solution also what it used: solvers of efforts within limits, the muscle model, the jaw's
    data. A mechanism file names the sources of its own numbers.
    """
    import condyle

    found = condyle.cite(solution)
    return Answer(found, {"bibtex": found}, command_line("literature"), "result")
